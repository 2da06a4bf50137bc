"""Tables [control.compensation.*]: what the controller adds to the paper's position loop, each switched alone.

What these laws know about the machine stands in the calibration file (`calibration.py`), never in [plant].
"""

from __future__ import annotations

from operator import attrgetter
from typing import Annotated, Final

from pydantic import Field

from gantryctl.machine.tables.fields import Table, number, numbers, switch, table, text

# The compiled law has as many places (`FAST_WAVES` of the core).
MAX_FAST_WAVES = 12
# Compensations that live on identified values.
NEED_CALIBRATION: Final = (
    "torque.eccentric", "torque.acceleration", "gear_map.active", "windup.active", "windup.reversal",
    "load_encoder.own_errors", "damping.active", "moment_observer.active", "backlash_observer.active",
)  # fmt: skip


class TorqueFeedForwardTable(Table):
    """[control.compensation.torque]: motor torque that is known beforehand, given to the drive."""

    eccentric: bool = switch(False, "Feed forward the torque that carries the eccentric moment.")
    acceleration: bool = switch(False, "Feed forward the torque that accelerates; jerk-limited only.")
    # Above what the eccentric moment and a move of the reference machine ask for, far below the rated torque.
    limit_nm: float = number(60.0, 0.0, 1e6, "Largest torque fed forward, motor side.")


class GearMapTable(Table):
    """[control.compensation.gear_map]: gear error over the turn, from the calibration."""

    active: bool = switch(False, "Apply the map.")
    cycles_per_turn: tuple[Annotated[float, Field(ge=1.0, le=1e5)], ...] = numbers(
        (),
        0,
        MAX_FAST_WAVES,
        "Waves per turn of the axis that are known, such as the tooth mesh; identification finds others too.",
    )
    fade_hz: float = number(
        8.0, 0.1, 100.0, "A wave that passes faster is no longer followed: torque for nothing."
    )
    limit_deg: float = number(0.05, 0.0, 0.5, "Largest correction of all maps together, the motor's lead.")


class WindupTable(Table):
    """[control.compensation.windup]: what the transmission gives way, from the calibration."""

    active: bool = switch(False, "Wind-up under eccentric moment and acceleration; jerk-limited only.")
    reversal: bool = switch(False, "Lost motion of friction and backlash, by the last direction.")
    # Not a step, which would be a jump of the speed command. No longer either: friction turns round as the load begins
    # to move, and at 90 deg the ramp changes the flank after 0.15 s, 0.001 deg on: with 0.01 deg nothing drove the load
    # for as long again, and it swung by 0.023 deg/s (0.011 with 0.003).
    reversal_length_deg: float = number(0.003, 1e-6, 0.05, "Way over which the direction turns round.")


class LoadEncoderLoopTable(Table):
    """[control.compensation.load_encoder]: slow outer loop through an encoder on the load."""

    active: bool = switch(False, "Close the loop.")
    own_errors: bool = switch(False, "Take the encoder's own errors out, from the calibration.")
    # Slow against the load mode of 2 Hz: the loop corrects what stands, not what swings.
    integral_per_s: float = number(1.0, 0.01, 10.0, "Integral gain.")
    dead_band_deg: float = number(1e-4, 0.0, 0.005, "Errors below this are left alone.")
    limit_deg: float = number(0.05, 0.0, 0.5, "Largest correction.")
    disagreement_deg: float = number(
        0.05, 1e-6, 10.0, "Difference of both encoders that trips; supervised if the loop is closed."
    )
    disagreement_time_ms: float = number(20.0, 1.0, 1000.0, "How long, before it trips.")


class DampingTable(Table):
    """[control.compensation.damping]: the motor yields to the swing of the load; needs the load encoder."""

    active: bool = switch(False, "Damp the swing.")
    gain: float = number(0.05, 0.0, 0.3, "Part of the swing that the motor yields to.")
    filter_ms: float = number(5.0, 0.1, 100.0, "Filter of the load speed.")
    # Wind-up under a standing moment is no swing. Shorter than a swing (0.5 s): what lost motion leaves after a stop is
    # gone before the load-side loop has integrated it. With 0.3 s and half the gain the swing of a gear of 0.3e9
    # N m/rad lasts too long.
    slow_s: float = number(0.4, 0.1, 20.0, "Twist that lasts longer is no swing.")


class MomentObserverTable(Table):
    """[control.compensation.moment_observer]: the eccentric moment followed by the torque of the motor."""

    active: bool = switch(False, "Follow it.")
    # Whoever sets it knows what may be put on the axis; more is no change of load but a fault.
    limit_nm: float = number(
        0.0, 0.0, 1e8, "Largest change since the calibration, at the axis; above 0 to follow."
    )
    # Some moves of a minute each: a change is followed within a few of them, and one move makes little of it.
    memory_s: float = number(300.0, 10.0, 1e4, "Time in motion over which what was seen fades.")


class BacklashObserverTable(Table):
    """[control.compensation.backlash_observer]: backlash followed by the motor's torque or an encoder on the ring."""

    active: bool = switch(False, "Follow it; needs the moment observer, wind-up and lost motion.")
    # 0.35 mm on the ring of the reference gantry: models 0.05 mm apart.
    limit_deg: float = number(
        0.0, 0.0, 0.5, "Largest backlash that is followed, at the axis; above 0 to follow."
    )
    # Some thirty moves.
    memory_s: float = number(
        100.0,
        10.0,
        5e3,
        "Time over which what was seen fades: in ramps, or with an encoder on the ring at constant speed.",
    )


class CalibrationWatchTable(Table):
    """[control.compensation.calibration_watch]: a warning when the calibration no longer fits the machine."""

    active: bool = switch(True, "Compare what the moves show with the calibration.")
    moment_nm: float = number(
        0.0,
        0.0,
        1e8,
        "Least change of the eccentric moment that is named, at the axis: loads that come and go.",
    )
    # Grease of 10 % less viscosity and rollers of 10 % less friction are a sound machine.
    friction_ratio: float = number(
        0.2, 0.0, 10.0, "Least change of the friction that is named, of all of it."
    )
    # 0.02 mm on the ring of the reference gantry: the motor's torque shows half of a gap of 0.2 mm.
    backlash_deg: float = number(
        0.0005, 0.0, 0.1, "Least growth of the backlash that is named, by the motor."
    )
    # 0.08 mm there: a ring 5 K colder than its frame opens the gap by 0.095 mm, for some hours of a day.
    lost_motion_deg: float = number(
        0.002, 0.0, 0.1, "Least change of the lost motion that is named, by the load-side encoder."
    )


class CompensationTable(Table):
    """[control.compensation]: file of identified values, and what holds for all."""

    calibration: str = text(
        "", 200, 'Calibration file beside this one, written by `gantryctl identify`; "" = none.'
    )
    latency_us: float = number(
        0.0, 0.0, 2000.0, "Age of encoder readings by their time stamp; 0 = not compensated."
    )
    # Lower than the true one costs time alone. Above 25 Hz a creep of some degrees would be all ramps.
    first_mode_hz: float = number(
        2.0,
        0.02,
        25.0,
        "First mode of the load, for `gantryctl identify` and the torque monitors; 25 of a stiffer one.",
    )
    torque: TorqueFeedForwardTable = table("Torque feed-forward.", TorqueFeedForwardTable)
    gear_map: GearMapTable = table("Gear-error map.", GearMapTable)
    windup: WindupTable = table("Wind-up and lost motion.", WindupTable)
    load_encoder: LoadEncoderLoopTable = table("Load-side loop.", LoadEncoderLoopTable)
    damping: DampingTable = table("Swing damping.", DampingTable)
    moment_observer: MomentObserverTable = table("Moment observer.", MomentObserverTable)
    backlash_observer: BacklashObserverTable = table("Backlash observer.", BacklashObserverTable)
    calibration_watch: CalibrationWatchTable = table("Stale calibration.", CalibrationWatchTable)

    @property
    def any_active(self) -> bool:
        """Whether the position loop is more than the paper's."""
        return self.needs_calibration or self.load_encoder.active or self.latency_us > 0.0

    @property
    def moves_motor(self) -> bool:
        """Whether the motor leaves the set-point on purpose, so that the load keeps it."""
        windup = self.windup
        moved = windup.active or windup.reversal or self.gear_map.active
        return moved or self.load_encoder.active or self.damping.active

    @property
    def needs_calibration(self) -> bool:
        """Whether a compensation that is on uses identified values."""
        return any(attrgetter(*NEED_CALIBRATION)(self))
