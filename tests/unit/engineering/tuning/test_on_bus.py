"""Tuning of a machine on a bus: two halves with the maker's tool between them."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import cast

import numpy as np
import pytest

from gantryctl.cli.engineering.tune import _show_on_bus
from gantryctl.engineering.analysis.measured.on_engine import experiment
from gantryctl.engineering.analysis.measured.response import MeasuredResponse
from gantryctl.engineering.analysis.measured.speed_loop import SpeedLoop
from gantryctl.engineering.identification.measure import quiet_machine
from gantryctl.engineering.tuning.gains import Gains, machine_with
from gantryctl.engineering.tuning.on_bus import (
    DriveFigures,
    TuningSession,
    _sensitivity,
    begin,
    end,
    load_session,
    proposed,
    store_session,
)
from gantryctl.errors import ConfigError, StateError, UsageError
from gantryctl.machine import Machine, configs_folder, load_machine, with_values
from gantryctl.operation.run import AxisRun
from support.command_line import cli
from support.improved import improved_machine

MACHINE = load_machine(configs_folder() / "hust_can.toml")
LOOP = SpeedLoop(80.0, 0.0093, 0.357, 0.00449, 0.00037, 800.0, 1.7, 0.6)
PROPOSAL = Gains(105.0, 0.003, 4.4, 1.0, 0.39)
SESSION = TuningSession("hust_can", "CAN-1", 1.7, DriveFigures(LOOP, 1.1, 20.0), PROPOSAL)


def run_of(serial: str) -> AxisRun:
    """As much of an open machine as is asked before anything moves."""
    drive = SimpleNamespace(identity=lambda: SimpleNamespace(encoder_serial=serial))
    return cast(AxisRun, SimpleNamespace(drive=drive))


def known_machine() -> Machine:
    """The CAN machine with a calibration of its own, as `identify` writes it."""
    found = improved_machine().calibration
    assert found is not None
    serial = "CAN-000007FF-00470402-1"
    origin = found.origin.model_copy(update={"encoder_serial": serial, "machine": "hust_can"})
    return MACHINE.calibrated(found.model_copy(update={"origin": origin}))


def after(kvp: float, tvi_s: float, sensitivity: float) -> TuningSession:
    loop = LOOP._replace(kvp_nm_s_per_rad=kvp, tvi_s=tvi_s)
    return replace(SESSION, after=DriveFigures(loop, sensitivity, 10.0))


@pytest.mark.parametrize(
    ("session", "passed"),
    [
        (after(105.0, 0.003, 1.2), True),
        (after(80.0, 0.0093, 1.2), False),
        (after(105.0, 0.0093, 1.2), False),
        (after(105.0, 0.003, 2.5), False),
        (after(float("nan"), 0.003, 1.2), False),
        (after(105.0, 0.003, float("nan")), False),
        # 15 % of Kvp and 25 % of Tvi either way.
        (after(91.0, 0.0037, 1.2), True),
        (after(87.0, 0.003, 1.2), False),
        (after(105.0, 0.0021, 1.2), False),
    ],
    ids=["as proposed", "the drive as it was", "Tvi as it was", "a loop that rings", "no gain", "no peak",
         "about as proposed", "Kvp too small", "Tvi too small"],
)  # fmt: skip
def test_the_second_half_passes_only_what_was_proposed(session: TuningSession, passed: bool) -> None:
    assert session.passed is passed


def test_the_sensitivity_is_the_largest_of_the_lines_that_stand_above_their_noise() -> None:
    """L = -0.5 makes 2 at 10 Hz; -0.9 would make 10 at 20 Hz, where nothing was heard."""
    lines = SimpleNamespace(position_open=np.array([0.0, -0.5, -0.9]), hz=np.array([5.0, 10.0, 20.0]))
    heard = SimpleNamespace(measured=lines, trusted=np.array([1.0, 1.0, 0.0]))
    assert _sensitivity(cast(MeasuredResponse, heard)) == (2.0, 10.0)
    with pytest.raises(UsageError, match=r"no line .* stands above its noise"):
        _sensitivity(cast(MeasuredResponse, SimpleNamespace(measured=lines, trusted=np.zeros(3))))


def test_the_factors_that_a_person_enters_in_the_maker_s_tool(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Kvp from 80 to 105 is x 1.3125; the integral gain Kvp/Tvi from 80/9.3 ms to 105/3 ms is x 4.069."""
    _show_on_bus(SESSION, tmp_path)
    told = " ".join(capsys.readouterr().out.split())
    assert "--kp-times 1.312 --ki-times 4.069 --save" in told
    assert "proportional gain x 1.312, integral gain (where it is one of its own) x 4.069" in told


def test_a_session_waits_for_its_second_half(tmp_path: Path) -> None:
    path = tmp_path / "on_bus.json"
    assert load_session(path) is None
    store_session(path, SESSION)
    assert load_session(path) == SESSION
    store_session(path, after(105.0, 0.003, 1.2))
    assert load_session(path) is None  # both halves are done: the next one begins anew
    path.write_text(path.read_text("utf-8")[:50], "utf-8")
    with pytest.raises(StateError, match="--again begins anew"):
        load_session(path)


def test_the_second_half_belongs_to_the_same_drive_and_to_the_proposed_gain() -> None:
    with pytest.raises(UsageError, match="of hust_can with CAN-1, this is hust_can with CAN-2"):
        end(MACHINE, run_of("CAN-2"), SESSION)
    with pytest.raises(UsageError, match=r"kpp_per_s = 10, proposed are 4.4 /s"):
        end(MACHINE, run_of("CAN-1"), SESSION)


def test_a_machine_that_was_not_identified_is_not_tuned() -> None:
    with pytest.raises(ConfigError, match="gantryctl identify"):
        begin(MACHINE, run_of("CAN-1"))
    refused = cli("tune", "--config", configs_folder() / "hust_can.toml")
    assert refused.code == 2
    assert "gantryctl identify" in refused.err


@pytest.mark.slow
def test_a_virtual_drive_is_tuned_in_two_halves_and_one_that_kept_its_gains_fails() -> None:
    machine = known_machine()
    with experiment(machine, controlled_as=quiet_machine(machine)) as run:
        session = begin(machine, run)
    entered = machine_with(machine, session.proposal)
    with experiment(entered, controlled_as=quiet_machine(entered)) as run:
        assert end(entered, run, session).passed
    # Kpp went into the machine file, the maker's tool was forgotten.
    forgotten = with_values(machine, {"control.kpp_per_s": session.proposal.kpp_per_s})
    with experiment(forgotten, controlled_as=quiet_machine(forgotten)) as run:
        checks = end(forgotten, run, session).checks
    assert [check.passed for check in checks] == [False, False, True]


@pytest.mark.slow
def test_the_proposal_keeps_the_quick_stop_of_the_machine_file() -> None:
    """By margins alone Kvp would be 214: the stop from 6 deg/s would ask for more than 385 N m."""
    from gantryctl.engineering.stops import check_quick_stop
    from gantryctl.engineering.tuning.by_margins import STATED, by_margins
    from gantryctl.engineering.tuning.on_bus import measured_machine

    machine = known_machine()
    known = measured_machine(machine, LOOP, "CAN-000007FF-00470402-1")
    bare, kept = by_margins(known).gains, proposed(machine, known, STATED)
    assert kept.kvp_nm_s_per_rad < bare.kvp_nm_s_per_rad
    check_quick_stop(machine_with(machine, kept))
    with pytest.raises(ConfigError, match="quick_dec_deg_s2"):
        check_quick_stop(machine_with(machine, replace(bare, kvf=1.0)))
