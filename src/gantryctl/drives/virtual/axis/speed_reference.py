"""Speed reference of an enabled drive: cyclic synchronous velocity and profile velocity, halt, limits."""

from __future__ import annotations

from typing import Final, NamedTuple

from gantryctl.drives.faults import Faults
from gantryctl.drives.virtual.axis.cia402 import HALT_BIT, Ramp, stop_ramp
from gantryctl.drives.virtual.axis.hardware import Scaling, rad_s_of_r_min
from gantryctl.drives.virtual.axis.plant import DrivePlant, StageMode
from gantryctl.drives.virtual.communication.dictionary import Dictionary
from gantryctl.drives.virtual.communication.objects import MODE_CSV, MODE_PV
from gantryctl.drives.virtual.personality import Personality

NO_MODE: Final = 0
# Several makers deliver 606F = 0, Yiyou among them; no shaft with friction turns evenly at less than that.
_OWN_THRESHOLD_RAD_S: Final = rad_s_of_r_min(1)
# Speed up to which a drive with `sign_wrong_at_speed` turns the right way: 0.31 deg/s of the reference gantry.
_CREEP_RAD_S: Final = rad_s_of_r_min(60)


class StageCommand(NamedTuple):
    """Command to the power stage for one tick."""

    mode: StageMode
    vel_rad_s: float


class SpeedReference:
    """Reference of the modes 9 (CSV) and 3 (PV).

    Args:
        od: 60FF, 60B1, 6080, 607F, 6083 to 6085, 605D.
        plant: for its speed and its ramp.
        scaling: units.
        kind: quirks.
        faults: injected faults.
        tick_s: period of `run`.
    """

    def __init__(
        self,
        od: Dictionary,
        plant: DrivePlant,
        scaling: Scaling,
        kind: Personality,
        faults: Faults,
        tick_s: float,
    ) -> None:
        self._od, self._plant, self._scaling, self._kind = od, plant, scaling, kind
        self._faults, self._tick_s = faults, tick_s
        # Seen on a real drive: after a quick stop it reports Operation enabled and stands until 6060 changes.
        self.dead = False
        self.reset()

    def reset(self) -> None:
        """State after power on."""
        self.mode = NO_MODE
        self.cycle_time_written = False
        self.start()

    def start(self) -> None:
        """Begin at the present speed, enabled for the first time or again."""
        # 606B, the demand, is `vel_rad_s`.
        self.vel_rad_s = self._plant.vel_rad_s if abs(self._plant.vel_rad_s) > self.threshold_rad_s else 0.0
        self.clamped = self.halted = False
        self._reached_s = 0.0
        self._held: float | None = None

    def set_mode(self, mode: int) -> None:
        """6060 was written."""
        if mode != self.mode:
            self.mode = mode
            self.dead = False
            self.start()

    @property
    def threshold_rad_s(self) -> float:
        """Velocity threshold 606F: below it the shaft is at rest; the drive's own one where 606F is less."""
        return max(self._scaling.rad_s(self._od.number(0x606F)), _OWN_THRESHOLD_RAD_S)

    @property
    def follows(self) -> bool:
        """Following the command value of the mode (CSV: bit 12 of an enabled drive)."""
        return not self._faults.ignore_target and not self.halted and self._can_follow()

    def _can_follow(self) -> bool:
        if self.mode == MODE_CSV:
            return self._kind.csv and (not self._kind.needs_cycle_time or self._cycle_time_ok())
        return self.mode == MODE_PV

    def _cycle_time_ok(self) -> bool:
        # Some drives do not move in CSV before 60C2 agrees with the SYNC period.
        cycle_us = self._od.number(0x1006)
        return self.cycle_time_written and (cycle_us == 0 or cycle_us == interpolation_us(self._od))

    def deceleration(self, ramp: Ramp) -> float:
        """Deceleration of a ramp, rad/s2."""
        if ramp is Ramp.QUICK:
            return self._kind.quick_stop_ramp_share * self._scaling.rad_s2(self._od.number(0x6085))
        return self._scaling.rad_s2(self._od.number(0x6084))

    def run(self, controlword: int) -> StageCommand:
        """Command of one tick while enabled."""
        faults = self._faults
        if faults.ignore_target:
            self._held = self.vel_rad_s if self._held is None else self._held
            return StageCommand(StageMode.SPEED, self._held)
        self._held = None
        # In CSV the halt bit has no function on many drives (CiA 402 leaves it to the mode); a quirk gives it one.
        halting = self.mode == MODE_PV or (self.mode == MODE_CSV and self._kind.halt_in_csv)
        if controlword & HALT_BIT and halting:
            return self._halt()
        if self.halted:
            self.start()
        if faults.never_move or self.dead or not self._can_follow():
            self.vel_rad_s = 0.0
            self._plant.set_ramp(self.deceleration(Ramp.QUICK))
            return StageCommand(StageMode.RAMP, 0.0)
        wanted = self._wanted()
        self.vel_rad_s = wanted if self.mode == MODE_CSV else self._profiled(wanted)
        return StageCommand(StageMode.SPEED, self.vel_rad_s)

    def _halt(self) -> StageCommand:
        self.halted = True
        self.vel_rad_s = 0.0
        ramp = stop_ramp(self._od.number(0x605D))
        if ramp is Ramp.LIMIT:
            return StageCommand(StageMode.SPEED, 0.0)
        self._plant.set_ramp(self.deceleration(ramp))
        return StageCommand(StageMode.RAMP, 0.0)

    def _wanted(self) -> float:
        """60FF + 60B1 within the speed ceiling: 6080, and in profile velocity 607F."""
        od = self._od
        vel = self._command_sign * self._scaling.rad_s(od.number(0x60FF) + od.number(0x60B1))
        if self._kind.sign_wrong_at_speed and abs(vel) > _CREEP_RAD_S:
            vel = -vel
        ceiling = rad_s_of_r_min(od.number(0x6080))
        if self.mode == MODE_PV:
            ceiling = min(ceiling, self._scaling.rad_s(od.number(0x607F)))
        self.clamped = abs(vel) > ceiling
        return max(-ceiling, min(ceiling, vel))

    def _profiled(self, wanted: float) -> float:
        """Speed after one tick towards the target on the ramps 6083 and 6084."""
        vel = self.vel_rad_s
        speeding_up = abs(wanted) > abs(vel) and wanted * vel >= 0.0
        rate = self._scaling.rad_s2(self._od.number(0x6083 if speeding_up else 0x6084))
        step = rate * self._tick_s
        vel = max(vel - step, min(vel + step, wanted))
        window = self._scaling.rad_s(self._od.number(0x606D))
        near = abs(self._plant.vel_rad_s - wanted) <= window
        self._reached_s = self._reached_s + self._tick_s if near else 0.0
        return vel

    @property
    def _command_sign(self) -> float:
        return self._faults.command_sign * self._plant.motor_sign

    @property
    def target_reached(self) -> bool:
        """PV: the speed has been within the window 606D for the time 606E."""
        return (
            self.mode == MODE_PV
            and self._reached_s > 0.0
            and (1000.0 * self._reached_s >= self._od.number(0x606E))
        )

    @property
    def torque_ff_nm(self) -> float:
        """60B2."""
        return self._command_sign * self._scaling.nm(self._od.number(0x60B2))

    @property
    def at_rest(self) -> bool:
        """The shaft is slower than 606F."""
        return abs(self._plant.vel_rad_s) < self.threshold_rad_s


def interpolation_us(od: Dictionary) -> int:
    """60C2 in microseconds."""
    value, index = od.number(0x60C2, 1), od.number(0x60C2, 2)
    return round(value * 10.0 ** (index + 6))
