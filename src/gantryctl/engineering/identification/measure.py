"""The experiment: the axis moved under its position loop while an instrument watches the load."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final, Protocol

from gantryctl.engineering.analysis.measured.speed_loop import SpeedLoop
from gantryctl.engineering.identification.samples import MoveLog, Samples, hash_of, joined, steady
from gantryctl.errors import UsageError
from gantryctl.machine import Machine, with_values
from gantryctl.machine.places import fitted_stretch_deg, reach_deg

# Speed of the slow turns: friction is steady, and the tooth mesh passes below the first mode.
TURN_DEG_S: Final = 1.0
# Speed of the creep: the waves of the reducer pass slowly enough for the load to follow.
CREEP_DEG_S: Final = 0.1
CREEP_DEG: Final = 8.2
# Swings for inertia and wind-up, on both sides of 0: where the eccentric moment is large, acceleration does not turn
# the torque of the mesh round, and its backlash stays out of the wind-up.
SWING_DEG: Final = (50.0, 130.0)
SWING_DEG_S: Final = 3.5
SWING_ACC_DEG_S2: Final = 0.3
# Where, and how fast, the speed loop is measured: friction slides.
SPEED_LOOP_DEG: Final = 60.0
# Room that it turns in meanwhile.
_SPEED_LOOP_WAY_DEG: Final = 50.0
# Of the rated torque: far above ripple and quantisation, far below the limit.
SPEED_LOOP_SHARE: Final = 0.15
# Of the travel, kept at both ends.
_MARGIN_DEG: Final = 0.5
# Acceleration ramps of the runs.
_JERK_TIME_S: Final = 0.5

_OFF: Final = (
    "torque.eccentric", "torque.acceleration", "gear_map.active", "windup.active", "windup.reversal",
    "load_encoder.active", "load_encoder.own_errors", "damping.active",
)  # fmt: skip


class AxisUnderTest(Protocol):
    """An axis that an experiment moves: the compiled loop of the simulator, or the scan engine over any drive.

    It runs as `quiet_machine` says, and stands at the beginning.
    """

    @property
    def machine(self) -> Machine:
        """The machine that is identified."""
        ...

    @property
    def instrument(self) -> str:
        """What watches the load."""
        ...

    @property
    def sees_space(self) -> bool:
        """The instrument measures the load in space; an encoder on the ring measures it against its base."""
        ...

    @property
    def has_ring(self) -> bool:
        """A load-side encoder is recorded beside the instrument."""
        ...

    @property
    def encoder_serial(self) -> str:
        """Serial number of the motor encoder, as the drive says it."""
        ...

    @property
    def time_s(self) -> float:
        """Axis time so far."""
        ...

    def go(self, to_deg: float, vel_deg_s: float) -> MoveLog:
        """Move and settle.

        Raises:
            AlarmStop: the axis was stopped.
        """
        ...

    def speed_loop(self, torque_nm: float) -> SpeedLoop:
        """Turn slowly from where the axis stands, excite the speed loop, come to rest.

        Raises:
            AlarmStop: the axis was stopped. UsageError: it cannot be read.
        """
        ...


@dataclass(frozen=True)
class MotionRecording:
    """Recorded motion of one identification.

    Attributes:
        turns: slow turns, forward and back. swings: faster moves, steady stretches. creep: a slow crawl.
        speed_loop: of the drive, as measured.
        instrument: what watched the load. sees_space: it measures the load in space.
        has_ring: a load-side encoder was recorded.
        axis_time_s: length of the runs.
        trace_sha256: of the samples.
    """

    turns: Samples
    swings: Samples
    creep: Samples
    speed_loop: SpeedLoop
    instrument: str
    sees_space: bool
    has_ring: bool
    encoder_serial: str
    axis_time_s: float
    trace_sha256: str


def quiet_machine(machine: Machine) -> Machine:
    """The machine as it is identified: every compensation off, ramps of the experiment."""
    acc = min(SWING_ACC_DEG_S2, machine.virtual_axis.acc_deg_s2)
    at = "control.compensation."
    changes: dict[str, object] = {at + key: False for key in _OFF}
    return with_values(
        machine,
        changes
        | {
            at + "latency_us": 0.0,
            "virtual_axis.profile": "jerk_limited",
            "virtual_axis.acc_deg_s2": acc,
            "virtual_axis.dec_deg_s2": acc,
            "virtual_axis.jerk_deg_s3": acc / _JERK_TIME_S,
        },
    )


def travel_of(machine: Machine) -> tuple[float, float]:
    """Ends of the slow turns, deg.

    Raises:
        UsageError: the travel is shorter than half a turn: the maps would have no ground.
    """
    least, most = reach_deg(machine)
    low, high = least + _MARGIN_DEG, most - _MARGIN_DEG
    # Sixteen harmonics over less than half a turn cannot be told apart.
    if high - low < 180.0:
        raise UsageError(
            f"identification needs at least half a turn of travel, [axis] gives {high - low + 1.0:g} deg"
        )
    return low, high


def record(axis: AxisUnderTest) -> MotionRecording:
    """Turn slowly through the travel both ways, swing at both sides, creep, and excite the speed loop: 18 minutes.

    Raises:
        UsageError: the travel is too short, or the speed loop cannot be read. AlarmStop: the axis was stopped.
    """
    machine = axis.machine
    low, high = travel_of(machine)
    fast = machine.speed.setting_max_deg_s
    near, far = SWING_DEG
    axis.go(fitted_stretch_deg(machine, SPEED_LOOP_DEG, SPEED_LOOP_DEG + _SPEED_LOOP_WAY_DEG)[0], fast)
    loop = axis.speed_loop(SPEED_LOOP_SHARE * machine.motor.torque_rated_nm)
    axis.go(low, fast)
    turns = [steady(axis.go(to, TURN_DEG_S), cruise_only=True) for to in (high, low)]
    swings = []
    outer_low, inner_low = fitted_stretch_deg(machine, -far, -near)
    for inner, outer in ((inner_low, outer_low), fitted_stretch_deg(machine, near, far)):
        axis.go(inner, fast)
        swings += [steady(axis.go(to, SWING_DEG_S), cruise_only=False) for to in (outer, inner)]
    start, end = fitted_stretch_deg(machine, -0.5 * CREEP_DEG, 0.5 * CREEP_DEG)
    axis.go(start, fast)
    creep = steady(axis.go(end, CREEP_DEG_S), cruise_only=True)
    parts = (joined(turns), joined(swings), creep)
    return MotionRecording(
        *parts,
        speed_loop=loop,
        instrument=axis.instrument,
        sees_space=axis.sees_space,
        has_ring=axis.has_ring,
        encoder_serial=axis.encoder_serial,
        axis_time_s=axis.time_s,
        trace_sha256=hash_of(parts),
    )
