"""Any bytes as any frame on any identifier, power off and on: no scan raises, and the axis never moves for it.

INV-9: no frame raises in the controller or changes its state.
"""

from __future__ import annotations

import math

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from gantryctl.image import DriveRequest, DriveState, InputImage, OperatorCommand
from gantryctl.program import Axis, AxisState, GantryProgram
from gantryctl.runtime import Engine, FixedOperator
from gantryctl.units import deg, rad
from gantryctl.wiring.engine import build_engine
from gantryctl.wiring.program import axis_settings
from support.examples import examples
from unit.drives.canopen.canopen_bench import Bench

pytestmark = pytest.mark.can

# Of the drive, of this master, and some of neither.
IDENTIFIERS = [
    0x000, 0x080, 0x082, 0x100, 0x182, 0x282, 0x382, 0x482, 0x202, 0x302, 0x582, 0x602, 0x702, 0x77F, 0x7FF,
]  # fmt: skip
FRAMES = st.lists(st.tuples(st.sampled_from(IDENTIFIERS), st.binary(max_size=8)), max_size=12)
SPEED_DEG_S = 1.0
# Way from the alarm to rest: the class of feedback faults at 1 deg/s, for a frame may be a reading that is wrong.
WAY_DEG = 0.8
# A reading is judged in the scan that has it, and again after missing ones; a speed that was wrong shows in 1.2 deg/s.
FASTER_DEG_S = 1.2
# A foreign command of full speed acts for one SYNC and winds up the drive's speed loop: 1.34 deg/s before it stops.
FOREIGN_DEG_S = 3.0


@settings(max_examples=examples(80), deadline=None, suppress_health_check=[HealthCheck.too_slow])
@given(st.lists(FRAMES, min_size=1, max_size=8))
def test_any_frame_from_the_bus_never_raises_and_never_moves_the_axis(
    scans: list[list[tuple[int, bytes]]],
) -> None:
    """What reaches the master reaches the program too, which answers with what it likes: but nothing turns."""
    bench = Bench().open()
    program = GantryProgram(Axis(axis_settings(bench.machine), 0.0))
    before = bench.load_deg
    for k, frames in enumerate(scans):
        for can_id, data in frames:
            bench.virtual._out(can_id, data)  # onto the bus, as from any node
        feedback = bench.drive.read()
        output = program.scan(InputImage(k, 0.004 * k, feedback, OperatorCommand()))
        bench.drive.write(output)
        assert output.request is not DriveRequest.ENABLE
    assert abs(bench.load_deg - before) < 1e-6
    bench.drive.close()


class Powered:
    """A bench with the shipped program, power on; it watches the true motor side in every scan."""

    def __init__(self) -> None:
        self.bench = Bench().open()
        self.operator = FixedOperator()
        self.engine = build_engine(self.bench.machine, drive=self.bench.drive, operator=self.operator)
        program = self.engine.program
        assert isinstance(program, GantryProgram)
        self.axis = program.axis
        self.fastest_deg_s = 0.0
        self.from_deg = math.nan
        self.levels(power=True)
        assert self.engine.run_until(lambda _: self.axis.state is AxisState.STANDSTILL, 3.0)
        self.run(0.4)

    def levels(self, **levels: object) -> None:
        self.operator.command = self.operator.command._replace(**levels)

    def move(self) -> None:
        """In the middle of a move."""
        self.levels(move=True, target_rad=rad(5.0), speed_rad_s=rad(SPEED_DEG_S))
        self.run(3.0)
        assert self.axis.state is AxisState.DISCRETE_MOTION

    def run(self, seconds: float) -> None:
        self.engine.run_until(self._look, seconds)

    def frames(self, frames: list[tuple[int, bytes]], both: bool) -> None:
        put = self.bench.virtual.foreign if both else self.bench.virtual._out
        for can_id, data in frames:
            put(can_id, data)
        self.run(self.engine.period_s)

    def _look(self, _: Engine) -> bool:
        _, _, motor_rad, motor_rad_s, *_ = self.bench.virtual.truth()
        ratio = self.bench.ratio
        self.fastest_deg_s = max(self.fastest_deg_s, abs(deg(motor_rad_s / ratio)))
        self.motor_deg = deg(motor_rad / ratio)
        if self.axis.alarms.first_out is not None and math.isnan(self.from_deg):
            self.from_deg = self.motor_deg
        return False

    def settle(self) -> None:
        """Let the axis finish what it does, and judge where it is."""
        self.levels(move=False)
        self.run(2.0)
        stopped = self.axis.alarms.first_out
        if stopped is not None:
            # Where it stands now: at rest behind the brake, or under torque at zero speed (HOLD).
            here = self.motor_deg
            assert abs(here - self.from_deg) <= WAY_DEG, stopped.text
            self.run(0.5)
            assert abs(self.motor_deg - here) <= 0.15, stopped.text
            assert self.axis.state is AxisState.ERROR_STOP
            held = self.axis.power.request is DriveRequest.ENABLE
            assert held or self.axis.feedback.state is not DriveState.OPERATION_ENABLED, stopped.text
        # The link alone: a drive that is closed under power drops its load.
        self.bench.drive.link.close()


@pytest.mark.parametrize("both", [False, True], ids=["master hears", "drive hears too"])
@settings(max_examples=examples(12), deadline=None, suppress_health_check=list(HealthCheck))
@given(scans=st.lists(FRAMES, min_size=1, max_size=8))
def test_any_frame_at_standstill_with_power_on_moves_nothing(
    scans: list[list[tuple[int, bytes]]], both: bool
) -> None:
    powered = Powered()
    start = powered.motor_deg
    for frames in scans:
        powered.frames(frames, both)
    powered.settle()
    # From standstill: the class of faults at standstill, 0.35 deg.
    assert abs(powered.motor_deg - start) <= 0.35
    assert powered.fastest_deg_s <= (FOREIGN_DEG_S if both else FASTER_DEG_S)


@pytest.mark.parametrize("both", [False, True], ids=["master hears", "drive hears too"])
@settings(max_examples=examples(12), deadline=None, suppress_health_check=list(HealthCheck))
@given(scans=st.lists(FRAMES, min_size=1, max_size=8))
def test_any_frame_in_motion_makes_the_axis_go_on_or_stop(
    scans: list[list[tuple[int, bytes]]], both: bool
) -> None:
    powered = Powered()
    powered.move()
    for frames in scans:
        powered.frames(frames, both)
    powered.settle()
    assert powered.fastest_deg_s <= SPEED_DEG_S + (FOREIGN_DEG_S if both else FASTER_DEG_S)
