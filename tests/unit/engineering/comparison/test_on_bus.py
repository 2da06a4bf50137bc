"""Two ways of control on one machine on a bus: what is compared, and what is refused."""

from __future__ import annotations

import math
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from gantryctl.engineering.comparison.on_bus import (
    BusComparison,
    BusFigures,
    _dwell,
    _load_error_deg_s,
    compare_on_bus,
)
from gantryctl.engineering.identification.samples import MoveLog
from gantryctl.engineering.instruments import SimulatedTracker, TrackerErrors
from gantryctl.engineering.report.head import Head
from gantryctl.errors import UsageError
from gantryctl.machine import Machine, Requirement, configs_folder, default_machine, load_machine, with_values
from gantryctl.operation.run import AxisRun
from gantryctl.units import deg, rad
from support.command_line import cli

MACHINE = load_machine(configs_folder() / "hust_can.toml")
PERIOD_S = 0.004


def tracker(run: AxisRun) -> SimulatedTracker:
    truth = run.drive.truth_source
    assert truth is not None
    return SimulatedTracker(lambda _: deg(truth.truth()[0]), 0, TrackerErrors())


def log_of(load_rad: np.ndarray, vel_rad_s: np.ndarray) -> MoveLog:
    """A move read every 25 scans."""
    seen = np.full(len(load_rad), np.nan)
    seen[::25] = load_rad[::25]
    nothing = np.zeros(len(load_rad))
    return MoveLog(PERIOD_S, load_rad, seen, nothing, vel_rad_s, nothing, nothing, 25, 0.0)


def test_the_load_speed_error_is_that_of_the_readings() -> None:
    """A load that lags the set-point by 2e-4 rad within half a second is 0.023 deg/s slow there."""
    time_s = PERIOD_S * np.arange(2500)
    vel = np.full(2500, rad(1.0))
    late = 2e-4 * np.clip((time_s - 5.0) / 0.5, 0.0, 1.0)
    assert _load_error_deg_s(log_of(vel * time_s, vel)) == pytest.approx(0.0, abs=1e-9)
    assert _load_error_deg_s(log_of(vel * time_s - late, vel)) == pytest.approx(deg(4e-4), rel=1e-6)


def test_a_dwell_is_the_mean_of_its_last_two_seconds() -> None:
    load = np.concatenate([np.linspace(0.0, 1.0, 1000), np.full(500, 1.0)])
    assert _dwell(log_of(load, np.zeros(1500))) == pytest.approx(1.0)


def test_a_bus_is_judged_with_the_uncertainty_that_its_instrument_states() -> None:
    """0.0091 deg keeps 0.01 deg; with the 0.0015 deg that the readings leave uncertain it may not."""
    figures = BusFigures(0.0091, 0.0015, 0.005, 0.0003, 0.03, 0.03, 30.0, 60.0, 100.0)
    required = Requirement(0.01, "dish", "tender 4711")
    near = BusComparison("tracker", required, (("before", figures), ("after", figures)))
    assert near.verdict.passed is None
    assert "after: A as measured 0.0091 +- 0.0015 deg: 0.01 deg lies within" in near.verdict.text
    sure = figures._replace(a_expanded_deg=0.0005)
    assert near._replace(rows=(("after", sure),)).verdict.passed is True
    assert near._replace(rows=(("after", sure._replace(a_seen_deg=0.0127)),)).verdict.passed is False


def other(change: dict[str, object]) -> Machine:
    return with_values(MACHINE, change)


@pytest.mark.parametrize(
    ("paper", "improved", "said"),
    [
        (default_machine(), MACHINE, "both or none with a drive on a bus"),
        (MACHINE, other({"can.node": 3}), "can.node differ"),
        (MACHINE, other({"motor.inertia_kg_m2": 0.3}), "motor.inertia_kg_m2 differ"),
    ],
    ids=["one simulated", "another node", "another motor"],
)
def test_two_machines_that_are_not_one_are_refused_before_anything_moves(
    paper: Machine, improved: Machine, said: str
) -> None:
    with pytest.raises(UsageError, match=said):
        compare_on_bus(paper, improved, tracker)


def test_random_plants_are_refused_on_a_bus(tmp_path: Path) -> None:
    name = configs_folder() / "hust_can.toml"
    refused = cli("compare", name, name, "--ensemble", "2")
    assert refused.code == 2
    assert "--ensemble: its plants are simulated" in refused.err


@pytest.mark.parametrize(("place", "told"), [("tcp:here:1", "D-K-4711"), ("simulated", "none: simulated")])
def test_the_report_names_the_certificate_of_the_instrument(
    place: str, told: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The runs are left out: 20 minutes of axis time."""
    found = SimpleNamespace(instrument=place, verdict=SimpleNamespace(passed=True), rows=())
    heads: list[Head] = []

    def page(_: object, head: Head) -> str:
        heads.append(head)
        return ""

    monkeypatch.setattr("gantryctl.engineering.comparison.on_bus.compare_on_bus", lambda *_, **__: found)
    monkeypatch.setattr("gantryctl.engineering.accuracy.report.data.verdict_data", lambda _: {})
    monkeypatch.setattr("gantryctl.engineering.comparison.page.render_bus_comparison", page)
    name = configs_folder() / "hust_can.toml"
    given = ("--certificate", "D-K-4711", "--instrument", place, "--json", "--out", tmp_path)
    assert cli("compare", name, name, *given).code == 0
    assert [head.measured_by.certificate for head in heads if head.measured_by] == [told]


@pytest.mark.slow
def test_a_profile_without_steps_shakes_the_load_less_on_the_bus() -> None:
    """No calibration: the S-curve alone, 0.030 against 0.059 deg/s; the tracker's noise is 0.003 deg/s over 0.1 s."""
    smooth = with_values(
        MACHINE,
        {"machine.name": "smooth", "virtual_axis.profile": "jerk_limited", "virtual_axis.jerk_deg_s3": 0.8},
    )
    found = compare_on_bus(MACHINE, smooth, tracker)
    (_, bare), (_, better) = found.rows
    assert bare.load_error_short_deg_s == pytest.approx(0.059, abs=0.006)
    assert better.load_error_short_deg_s < 0.7 * bare.load_error_short_deg_s
    # Neither looks at the load, so both are as accurate as the gear.
    assert bare.a_seen_deg == pytest.approx(0.0111, abs=0.001)
    assert better.a_seen_deg == pytest.approx(0.0111, abs=0.002)
    assert math.isclose(bare.time_short_s, 30.25, abs_tol=0.05)
