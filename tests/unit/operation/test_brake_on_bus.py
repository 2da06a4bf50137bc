"""The brake test of a CANopen axis in virtual time: object 60FE keeps the brake closed, 60B2 gives the torque."""

from __future__ import annotations

import math
from collections.abc import Callable

import pytest

from gantryctl.drives.virtual.node import DriveNode
from gantryctl.errors import AlarmStop
from gantryctl.image import DriveState
from gantryctl.machine import configs_folder, load_machine, with_values
from gantryctl.operation.client import Snapshot, Stop
from gantryctl.operation.run import AxisRun
from gantryctl.program import BrakeTestOutcome, BrakeTestPhase, PowerPhase

pytestmark = pytest.mark.can

MACHINE = with_values(
    load_machine(configs_folder() / "hust_can.toml"),
    {"brake.owner": "object_60FE", "can.commissioning_required": False},
)
LEVEL_NM = MACHINE.brake.test_torque_nm


class Bench:
    """A session whose drive gets a fault when the test reaches a phase."""

    def __init__(self) -> None:
        self.session = AxisRun(MACHINE, None, observer=self._look, brake_test=True)
        drive = self.session.drive
        assert isinstance(drive.truth_source, DriveNode)
        self.node = drive.truth_source
        self._at: BrakeTestPhase | None = None
        self._do: Callable[[], None] = lambda: None
        self.brake_commands: set[bool] = set()

    def when(self, phase: BrakeTestPhase, do: Callable[[], None]) -> None:
        self._at, self._do = phase, do

    def _look(self, _: Snapshot) -> None:
        self.brake_commands.add(self.session.engine.output.brake_open)
        if self.session.axis.brake_test.phase is self._at:
            self._at = None
            self._do()

    def outcome(self) -> BrakeTestOutcome:
        """Of the test; afterwards the drive is off and its brake closed."""
        try:
            outcome = self.session.test_brake().outcome
        except AlarmStop:
            result = self.session.axis.brake_test.last
            assert result is not None
            outcome = result.outcome
        self.session.engine.run_for(2.0)
        feedback = self.session.engine.image.drive
        assert self.brake_commands == {False}
        if self.session.axis.power.phase is not PowerPhase.TORQUE_HOLD:
            assert feedback.state is not DriveState.OPERATION_ENABLED
            assert not feedback.brake_open
            assert self.node.plant.torque_nm == pytest.approx(0.0, abs=1.0)  # the current has died away
        return outcome


def test_a_sound_brake_passes_and_bears_what_was_asked_for() -> None:
    bench = Bench()
    assert bench.outcome() is BrakeTestOutcome.PASSED
    law = bench.session.axis.brake_test
    # 6077 has steps of 0.1 % of the rated torque, 0.26 N m, and the law takes 95 % for enough.
    assert law.plus_nm == pytest.approx(LEVEL_NM, rel=0.05)
    assert law.minus_nm == pytest.approx(-LEVEL_NM, rel=0.05)
    assert law.moved_rad < math.radians(0.001)


@pytest.mark.parametrize("share", [0.1, 0.6, 0.8])
def test_a_weak_brake_fails(share: float) -> None:
    """Less than the level, and 6 N m of the motor's own friction do not make up for it."""
    bench = Bench()
    bench.node.plant.change_plant("brake_torque_nm", share * LEVEL_NM)
    assert bench.outcome() is BrakeTestOutcome.FAILED


@pytest.mark.parametrize("phase", [BrakeTestPhase.PLUS_HELD, BrakeTestPhase.MINUS_HELD])
def test_a_brake_that_gives_way_while_it_is_held_fails(phase: BrakeTestPhase) -> None:
    bench = Bench()
    bench.when(phase, lambda: bench.node.plant.change_plant("brake_torque_nm", 20.0))
    assert bench.outcome() is BrakeTestOutcome.FAILED


def test_a_power_stage_without_torque_fails() -> None:
    bench = Bench()
    bench.node.faults.no_torque = True
    assert bench.outcome() is BrakeTestOutcome.FAILED


PHASES = [
    BrakeTestPhase.PLUS_RISING, BrakeTestPhase.PLUS_HELD, BrakeTestPhase.MINUS_RISING, BrakeTestPhase.MINUS_HELD,
]  # fmt: skip


FIRST = {"stop": "", "estop": "INT-03", "fault": "DRV-01", "mains": "PWR-01", "silence": "CAN"}


@pytest.mark.parametrize("phase", PHASES)
@pytest.mark.parametrize("how", FIRST)
def test_whatever_ends_it_leaves_torque_off_and_the_brake_closed(phase: BrakeTestPhase, how: str) -> None:
    bench = Bench()
    faults = bench.node.faults

    def spoil() -> None:
        match how:
            case "stop":
                bench.session.stop = Stop.RAMP
            case "estop":
                faults.estop_ok = False
            case "mains":
                faults.mains_ready = False
            case "silence":
                faults.silence = True
            case _:
                bench.node.axis.fault(0x7305)

    bench.when(phase, spoil)
    if how == "silence":
        with pytest.raises(AlarmStop, match="CAN-"):
            bench.session.test_brake()
        assert bench.session.axis.brake_test.last is not None
        assert bench.session.axis.brake_test.last.outcome is BrakeTestOutcome.ABORTED
        return
    assert bench.outcome() is BrakeTestOutcome.ABORTED
    first = bench.session.axis.alarms.first_out
    assert (str(first.code) if first else "") == FIRST[how]
