"""The experiment: the axis moved under its position loop while an instrument watches the load."""

from __future__ import annotations

from contextlib import suppress
from dataclasses import dataclass
from typing import Final, Protocol

from gantryctl.engineering.analysis.measured.speed_loop import MISFIT_LOUD, SpeedLoop
from gantryctl.engineering.identification.experiment import Experiment, experiment_of
from gantryctl.engineering.identification.samples import MoveLog, Samples, hash_of, joined, steady
from gantryctl.errors import UsageError
from gantryctl.machine import Machine, with_values

# Of the rated torque: far above ripple and quantisation, far below the limit. An axis whose speed loop does not answer
# like a linear one is asked again more quietly: gears that leave their flank are not linear.
SPEED_LOOP_SHARES: Final = (0.15, 0.04)
# Of the rated torque, which holds the load and turns it: beyond it a measurement is stopped.
TORQUE_LIMIT_SHARE: Final = 1.0

_OFF: Final = (
    "torque.eccentric", "torque.acceleration", "gear_map.active", "windup.active", "windup.reversal",
    "load_encoder.active", "load_encoder.own_errors", "damping.active", "moment_observer.active",
    "backlash_observer.active",
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
        check: a part of the turns once more, which no fit sees.
        experiment: places, speeds and times.
        speed_loop: of the drive, as measured; None where it does not answer like a PI with a lag.
        instrument: what watched the load. sees_space: it measures the load in space.
        has_ring: a load-side encoder was recorded.
        axis_time_s: length of the runs.
        trace_sha256: of the samples.
    """

    turns: Samples
    swings: Samples
    creep: Samples
    check: Samples
    experiment: Experiment
    speed_loop: SpeedLoop | None
    instrument: str
    sees_space: bool
    has_ring: bool
    encoder_serial: str
    axis_time_s: float
    trace_sha256: str


def quiet_machine(machine: Machine) -> Machine:
    """The machine as it is identified: every compensation off, ramps of the experiment."""
    experiment = experiment_of(machine)
    acc = experiment.swing_acc_deg_s2
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
            "virtual_axis.jerk_deg_s3": acc / experiment.jerk_time_s,
        },
    )


def record(axis: AxisUnderTest) -> MotionRecording:
    """Turn slowly through the travel both ways, swing at both sides, creep, excite the speed loop, and check.

    Raises:
        AlarmStop: the axis was stopped.
    """
    machine = axis.machine
    experiment = experiment_of(machine)
    low, high, fast = experiment.low_deg, experiment.high_deg, machine.speed.setting_max_deg_s
    loop = _speed_loop(axis, experiment, fast)
    axis.go(low, fast)
    turns = [steady(axis.go(to, experiment.turn_deg_s), experiment, cruise_only=True) for to in (high, low)]
    swings = []
    for inner, outer in experiment.swings_deg:
        axis.go(inner, fast)
        logs = [axis.go(to, experiment.swing_deg_s) for to in (outer, inner)]
        swings += [steady(log, experiment, cruise_only=False) for log in logs]
    start, end = experiment.creep_deg
    axis.go(start, fast)
    creep = steady(axis.go(end, experiment.creep_deg_s), experiment, cruise_only=True)
    first, last = experiment.check_deg
    axis.go(first, fast)
    check = [steady(axis.go(to, experiment.turn_deg_s), experiment, cruise_only=True) for to in (last, first)]
    parts = (joined(turns), joined(swings), creep, joined(check))
    return MotionRecording(
        *parts,
        experiment=experiment,
        speed_loop=loop,
        instrument=axis.instrument,
        sees_space=axis.sees_space,
        has_ring=axis.has_ring,
        encoder_serial=axis.encoder_serial,
        axis_time_s=axis.time_s,
        trace_sha256=hash_of(parts),
    )


def _speed_loop(axis: AxisUnderTest, experiment: Experiment, fast_deg_s: float) -> SpeedLoop | None:
    """The speed loop at the loudest signal to which it answers like one, else as well as it does; None for not."""
    found: list[SpeedLoop] = []
    for share in SPEED_LOOP_SHARES:
        axis.go(experiment.speed_loop_deg, fast_deg_s)
        with suppress(UsageError):
            found.append(axis.speed_loop(share * axis.machine.motor.torque_rated_nm))
        if found and found[-1].misfit <= MISFIT_LOUD:
            break
    return min(found, key=lambda loop: loop.misfit, default=None)
