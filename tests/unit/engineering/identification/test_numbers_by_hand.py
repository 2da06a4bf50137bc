"""From the fits of an identification to its numbers, each written down by hand."""

from __future__ import annotations

import math
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from gantryctl.cli.engineering.identify import _show
from gantryctl.engineering.identification import lead, text, truth
from gantryctl.engineering.identification.fit import _numbers, _Windup, _without_windup
from gantryctl.engineering.identification.on_batch import _COLUMNS, SimulatedAxis
from gantryctl.engineering.identification.samples import MoveLog, steady
from gantryctl.engineering.identification.torque_balance import BalanceFit, TorqueBalance
from gantryctl.engineering.identification.validation import Validation
from gantryctl.engineering.identification.waves import Band
from gantryctl.machine import Identified, default_machine, with_values
from support.improved import improved_machine


def test_a_gear_map_is_the_lead_without_the_windup_of_a_moment_wherever_its_load_hangs() -> None:
    """10 sin x + 20 cos x kN m over 5e8 N m/rad lead the load by 20 sin x + 40 cos x urad: no gear is left of that."""
    identified = Identified(moment_sine_nm=1e4, moment_cosine_nm=2e4, stiffness_nm_per_rad=5e8)
    windup, gear = np.array([0.0, 2e-5, 4e-5]), np.array([0.0, 3e-5, -1e-5])
    # Map and wind-up together are 0 at the angle 0, where the cosine is 40 urad, and 30 with the gear's.
    assert _without_windup(windup, identified, [], 0.0) == pytest.approx(
        np.array([-4e-5, 0.0, 0.0]), abs=1e-18
    )
    found = _without_windup(windup + gear, identified, [], 0.0)
    assert found == pytest.approx(np.array([-3e-5, 3e-5, -1e-5]), abs=1e-18)


def test_a_mode_is_half_as_unsure_as_the_windup_that_it_comes_of() -> None:
    """f = 1 / (2 pi sqrt(c)): 40 % of c are 20 % of f, and with the quarter that the model leaves out 32 %.

    The stiffness is J / c: 40 % and 10 % of the inertia, and 40 % that the model leaves out, are 57 %.
    """
    balance = TorqueBalance(1e4, 0.0, 0.0, 6000.0, 6000.0, 0.1, 2e4, 2e6, 3e5, 1.0)
    names = (*TorqueBalance._fields[:-2], "inertia_kg_m2", "friction_nm")
    half = dict.fromkeys(names, 1.0) | {"inertia_load_kg_m2": 2e5, "friction_load_ratio": 0.01}
    lead: Any = SimpleNamespace(backlash_rad=None)
    found, widths, unknown = _numbers(BalanceFit(balance, half), None, _Windup(0.006, 0.0024), lead, 2000.0)
    swing_hz = 1.0 / (2.0 * math.pi * math.sqrt(0.006))
    assert found.swing_hz == pytest.approx(swing_hz)
    assert widths["swing_hz"] == pytest.approx(math.hypot(0.2, 0.25) * swing_hz)
    assert found.stiffness_nm_per_rad == pytest.approx(2e6 / 0.006)
    assert widths["stiffness_nm_per_rad"] == pytest.approx(math.hypot(0.4, 0.1, 0.4) * 2e6 / 0.006)
    assert set(unknown) == {"motor_inertia_kg_m2", "dead_time_s", "backlash_rad"}


@pytest.mark.parametrize(
    ("repeats_deg", "refused", "warned"),
    [(0.0101, True, True), (0.0099, False, True), (0.0031, False, True), (0.0029, False, False)],
)
def test_maps_that_leave_a_third_of_the_lead_are_refused_and_a_tenth_is_told(
    repeats_deg: float, refused: bool, warned: bool
) -> None:
    """Of a lead of 0.03 deg; what is left and does not come again, 0.02 deg, is noise and judges nothing."""
    found = Validation(0.03, 0.02, repeats_deg, 0.0, (-90.0, 90.0))
    assert (found.refused, found.warned) == (refused, warned)


def test_a_sample_is_the_mean_of_the_scans_that_an_instrument_has_read() -> None:
    """A tracker reads every other scan of a block of four, a slow one a single scan of the next: at 1 deg/s, 10 ms."""
    scans = 240
    at = np.arange(scans) * 0.01
    read = np.where(np.arange(scans) % 2 == 0, at + 5.0, np.nan)
    # From here on the third scan of each block alone; the first block that is kept begins with scan 201.
    read[205:] = np.where(np.arange(205, scans) % 4 == 3, at[205:] + 5.0, np.nan)
    nothing = np.zeros(scans)
    log = MoveLog(0.01, at, read, at, np.full(scans, 1.0), nothing, at + 1.0, 4, 0.0)
    experiment: Any = SimpleNamespace(
        transient_s=2.0, creep_deg_s=0.5, low_deg=0.0, high_deg=90.0, turn_deg_s=1.0
    )
    found = steady(log, experiment, cruise_only=True)
    # Scans 202 and 204 of 201 to 204; then 207 of 205 to 208, 211 of 209 to 212 ...
    assert found.act_rad[:3] == pytest.approx([2.03, 2.07, 2.11])
    assert found.load_rad - found.act_rad == pytest.approx(np.full(len(found.act_rad), 5.0))
    # The torque is read at every scan.
    assert found.torque_nm[:2] == pytest.approx([1.0 + 2.025, 1.0 + 2.065])


def test_the_jerk_whose_ramps_last_one_swing(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """0.39336 deg/s2 within 1/2.5 s take 0.983 deg/s3."""
    machine, calibration = default_machine(), improved_machine().calibration
    assert calibration is not None
    identified = calibration.identified.model_copy(update={"swing_hz": 2.5})
    calibration = calibration.model_copy(update={"identified": identified})
    monkeypatch.setattr(text, "lead_lines", lambda *_: [])
    found: Any = SimpleNamespace(recording=SimpleNamespace(axis_time_s=1560.0), residual_deg=1e-4)
    _show(tmp_path / "c.toml", machine, calibration, found, [])
    told = capsys.readouterr().out
    assert "First mode with the motor held: 2.50 Hz." in told
    assert "jerk_deg_s3 = 0.983 with the present acc_deg_s2 = 0.3934" in told


def test_a_reading_is_taken_to_when_the_load_was_seen() -> None:
    """At 0.01 rad/s a reading that is 2 ms old lags by 20 urad."""
    machine = with_values(default_machine(), {"control.compensation.latency_us": 2000.0})
    rows = {name: np.zeros(2) for name in _COLUMNS} | {
        "pos_act_rad": np.array([0.1, 0.1]), "vel_ref_rad_s": np.array([0.01, -0.01])
    }  # fmt: skip

    class Log(dict[str, Any]):
        period_s = 0.002

        def __len__(self) -> int:
            return 2

    run: Any = lambda *_: Log(rows)  # noqa: E731
    log = SimulatedAxis(machine, run=run).go(10.0, 1.0)
    assert log.act_rad - 0.1 == pytest.approx(np.array([2e-5, -2e-5]))


def test_a_command_on_a_bus_acts_a_scan_later() -> None:
    """The truth of the dead time: of one drive the same, and a SYNC period more where it is on a bus."""
    beside = with_values(default_machine(), {"control.scan_period_ms": 4.0})
    on_bus = with_values(beside, {"drive.kind": "canopen"})
    assert truth._dead_time_s(on_bus) - truth._dead_time_s(beside) == pytest.approx(4e-3)
    # 1.5 cycles of 125 us, a current loop, and a reading that is some us old.
    assert 0.19e-3 < truth._dead_time_s(beside) < 1e-3


@pytest.mark.parametrize(("gap_rad", "told"), [(3.1e-5, 3.1e-5), (3.0e-5, None), (-1e-5, None)])
def test_a_gap_whose_interval_reaches_0_is_none(
    monkeypatch: pytest.MonkeyPatch, gap_rad: float, told: float | None
) -> None:
    """Half of its interval is 30 urad; the model without a gap takes its place."""

    def fitted(*some: Any) -> lead.Lead:
        none = lead.Lead(np.zeros(1), np.zeros(1), [], [], None, np.inf, np.zeros(1), None)
        with_gap = some[-1] == (True, False)
        return none._replace(backlash_rad=gap_rad, backlash_half_width_rad=3e-5) if with_gap else none

    monkeypatch.setattr(lead, "_fitted", fitted)
    nothing: Any = SimpleNamespace()
    assert lead.fit_lead(nothing, np.zeros(1), 1.0, Band(0.0, 10.0), ()).backlash_rad == told
