"""A day of treatment, by seed: morning checks, patients with their fields, pauses, and people with habits.

16 h of use (two shifts) and 8 h switched off. An hour has some seven patients with one to four fields each; with
pictures from two sides, corrections by key and fields that are begun again these are some 40 motions. Every second of
use is scanned, pauses with power off included; a night is a controller that is switched off and started again, and a
jump of the calendar.
"""

from __future__ import annotations

import random
from collections.abc import Callable
from datetime import UTC, datetime, timedelta
from typing import Final, NamedTuple

from gantryctl.program import BrakeTestOutcome
from gantryctl.service.protocol.messages import Identity
from gantryctl.service.protocol.roles import Role
from gantryctl.units import deg
from support.virtual_soak.climate import moment_share
from support.virtual_soak.desk import RENEW_S, Desk, Stuck

USED_S: Final = 16 * 3600.0
OPENS_S: Final = 6.5 * 3600.0
"""Machine time 0 is a midnight; the controller is switched on at half past six."""
BEGINS: Final = datetime(2027, 1, 1, tzinfo=UTC)
# Angles that plans prefer; the others lie anywhere.
_USUAL_DEG: Final = (0.0, 30.0, 45.0, 60.0, 75.0, 90.0, 110.0, 135.0, 150.0, 180.0)
_FAR_DEG: Final = 179.9
# deg: a load that stands farther from its target than this has not arrived; the verdict of issue 5.
_ANGLE_MAX_DEG: Final = 0.1
# A busy room powers up some 120 times a day and is due after a hundred: the physicist tests in the morning what is due
# within some hours, and is called between two patients when it is due at once.
_DUE_MORNING: Final = 50
_DUE_NOW: Final = 5
_DUE_DAYS: Final = 1.0


class Habits(NamedTuple):
    """How one person works.

    Attributes:
        speed_deg_s: of moves. jog_deg_s: of the key.
        keys: share of corrections by key. stops: share of moves that are stopped and begun again.
        powers_off: switches power off between two patients.
    """

    name: str
    speed_deg_s: float
    jog_deg_s: float
    keys: float
    stops: float
    powers_off: float


PEOPLE: Final = (
    Habits("anna", 6.0, 1.0, 0.5, 0.02, 0.9),
    Habits("ben", 3.0, 0.6, 0.8, 0.05, 0.5),
    Habits("cem", 6.0, 2.0, 0.2, 0.01, 0.2),
    Habits("dana", 4.5, 1.0, 0.3, 0.10, 1.0),
)


def date_at(time_s: float) -> datetime:
    """Date of a machine time."""
    return BEGINS + timedelta(seconds=time_s)


class Day:
    """The people of one day at one controller start; `work` goes on until the time is over.

    Args:
        rng: of this start. now: the date. until_s: time of the controller at which people go home.
    """

    def __init__(self, desk: Desk, rng: random.Random, now: Callable[[], datetime], until_s: float) -> None:
        self._desk, self._rng, self._now, self._until_s = desk, rng, now, until_s
        self._moment_nm = desk.drive.plant_params.eccentric_moment_nm
        self._powered = False
        self._shift()

    def _shift(self) -> None:
        habits = self._rng.choice(PEOPLE)
        place = self._rng.choice(("console", "console", "console", "room"))
        # A page in the room is remote: it moves at 1 deg/s at most unless the enabling input is on, as it is here.
        self._habits = habits
        self._who = Identity(
            f"c-{habits.name}-{self._rng.randrange(10**6)}", habits.name, Role.OPERATOR, place
        )

    @property
    def _over(self) -> bool:
        return self._desk.engine.time_s >= self._until_s

    def work(self, *, morning: bool) -> None:
        """Everything from switching on to going home, but for what does not fit before the end."""
        desk, rng = self._desk, self._rng
        desk.wait(rng.uniform(5.0, 60.0))
        self._brake_test(_DUE_MORNING)
        if morning:
            self._check_travel()
        while not self._over:
            self._patient()
        self._switch_off()
        desk.wait(rng.uniform(5.0, 60.0))
        desk.look()

    # --- checks -----------------------------------------------------------------------------------------------------

    def _brake_test(self, power_ups: int) -> None:
        """The physicist tests the brake when it is due within so many power-ups, or within a day."""
        desk, brake = self._desk, self._desk.controller.brake
        due = brake.due
        soon = due.power_ups_left is not None and due.power_ups_left < power_ups
        if due.at:
            at = datetime.fromisoformat(due.at)
            soon = soon or at - self._now() < timedelta(days=_DUE_DAYS)
        if not soon:
            return
        who = Identity(f"c-phil-{self._rng.randrange(10**6)}", "phil", Role.PHYSICIST, "console")
        desk.ask("take", who, over=False)
        desk.ask("arm", who, action="brake_test")
        desk.ask("brake_test", who)
        if not desk.until(lambda: not desk.axis.brake_test.under_way and desk.axis.is_off, 30.0):
            raise Stuck(f"a brake test does not end: {desk.axis.brake_test.phase.name}")
        last = desk.axis.brake_test.last
        desk.counts.brake_tests += 1
        if last is None or last.outcome is not BrakeTestOutcome.PASSED:
            desk.trouble(f"brake test {'without result' if last is None else last.text}")
        desk.ask("give", who)
        desk.look()

    def _check_travel(self) -> None:
        """Morning: through the whole travel and back, and the speed at 0.1 r/min."""
        self._begin()
        self._set_speed(6.0)
        for target in (-179.0, 179.0, 0.0):
            self._move(target)
        self._set_speed(0.6)
        self._move(6.0)
        self._set_speed(self._habits.speed_deg_s)
        self._end()

    # --- a patient --------------------------------------------------------------------------------------------------

    def _patient(self) -> None:
        rng, desk = self._rng, self._desk
        if rng.random() < 0.1:
            self._shift()
        self._begin()
        self._set_speed(self._habits.speed_deg_s)
        # Pictures from two sides, a correction, fields; the door between stays as it is.
        for target in rng.choice(((0.0, 90.0), (0.0, -90.0), (180.0, 90.0))):
            self._move(min(target, _FAR_DEG))
            desk.wait(rng.uniform(2.0, 15.0))
        self._correct()
        for _ in range(rng.choice((1, 2, 2, 3, 3, 4))):
            if self._over:
                break
            usual = rng.choice(_USUAL_DEG) * rng.choice((-1.0, 1.0))
            target = usual if rng.random() < 0.8 else rng.uniform(-_FAR_DEG, _FAR_DEG)
            self._move(max(-_FAR_DEG, min(_FAR_DEG, target)))
            if rng.random() < 0.2:
                self._correct()
            # The beam: 10 to 60 s of standing at the angle, by the servo.
            desk.wait(rng.uniform(10.0, 60.0))
        if rng.random() < 0.5:
            self._move(0.0)
        self._end()
        self._change_over()

    def _change_over(self) -> None:
        """The next patient: the room is prepared, now and then a pause, a note, another nozzle."""
        rng, desk = self._rng, self._desk
        desk.wait(rng.uniform(30.0, 240.0) if rng.random() < 0.97 else rng.uniform(600.0, 1800.0))
        if not self._powered and rng.random() < 0.5:
            desk.change_load(self._moment_nm * moment_share(rng))
        if not self._powered:
            self._brake_test(_DUE_NOW)
        desk.look()

    def _begin(self) -> None:
        desk = self._desk
        desk.ask("take", self._who, over=False)
        if not self._powered:
            desk.power_on(self._who)
            self._powered = True

    def _end(self) -> None:
        """After a patient: power off, or control given back with power on, which goes off by itself after 300 s."""
        desk = self._desk
        if self._rng.random() < self._habits.powers_off or self._over:
            self._switch_off()
        desk.ask("give", self._who)
        if self._powered:
            # [monitors] unheld_power_time_s switches off what nobody holds: somebody takes over before.
            desk.wait(self._rng.uniform(10.0, 120.0))
            desk.ask("take", self._who, over=False)
            self._switch_off()
            desk.ask("give", self._who)

    def _switch_off(self) -> None:
        if self._powered:
            self._desk.power_off(self._who)
            self._powered = False

    # --- motions ----------------------------------------------------------------------------------------------------

    def _set_speed(self, speed_deg_s: float) -> None:
        self._desk.ask("set", self._who, tag="speed_setting_deg_s", value=speed_deg_s)

    def _move(self, target_deg: float) -> None:
        """Move to an angle; now and then it is stopped on the way and begun again."""
        desk, rng = self._desk, self._rng
        desk.ask("move", self._who, target_deg=target_deg)
        desk.counts.moves += 1
        if rng.random() < self._habits.stops:
            desk.wait(rng.uniform(0.2, 12.0))
            kind = rng.choice(("stop", "halt", "give"))
            if kind == "stop":
                desk.ask("stop", self._who)
            elif kind == "halt":
                desk.ask("halt", self._who)
            else:
                # A page that is closed and opened again: control goes and comes, the move goes on.
                desk.ask("give", self._who)
                desk.ask("take", self._who, over=False)
            desk.counts.operator_stops += kind != "give"
            desk.until_rest()
            desk.wait(rng.uniform(1.0, 10.0))
            desk.ask("move", self._who, target_deg=target_deg)
            desk.counts.moves += 1
        if rng.random() < 0.05:
            desk.wait(rng.uniform(0.5, 5.0))
            desk.ask("set", self._who, tag="override_percent", value=rng.choice((10.0, 50.0, 80.0)))
            desk.wait(rng.uniform(0.5, 5.0))
            desk.ask("set", self._who, tag="override_percent", value=100.0)
        self._arrived(target_deg)

    def _arrived(self, target_deg: float) -> None:
        desk = self._desk
        desk.until_rest()
        # The load swings on for some seconds; in position is judged on the motor.
        desk.wait(5.0)
        if desk.axis.alarms.first_out is not None:
            desk.recover(self._who)
            return
        error = abs(deg(desk.drive.truth()[0]) - target_deg)
        desk.counts.worst_angle_deg = max(desk.counts.worst_angle_deg, error)
        if desk.axis.monitors.not_in_position or error > _ANGLE_MAX_DEG:
            desk.trouble(f"the load stands {error:.4f} deg from {target_deg:.3f} deg")

    def _correct(self) -> None:
        """A correction by key or by increments, and back to the modes of moves."""
        if self._rng.random() < self._habits.keys:
            self._jog()
        else:
            self._increments()
        self._desk.ask("mode", self._who, mode="none")

    def _jog(self) -> None:
        desk, rng = self._desk, self._rng
        desk.ask("mode", self._who, mode="continuous")
        self._set_speed(self._habits.jog_deg_s)
        lease = f"{rng.getrandbits(64):016x}"
        forward = deg(desk.axis.pos_act_rad) < 0.0
        desk.ask("jog", self._who, lease=lease, direction="forward" if forward else "reverse")
        for _ in range(rng.randrange(5, 150)):
            desk.send("renew", self._who, lease=lease)
            desk.wait(RENEW_S)
        desk.ask("release", self._who, lease=lease)
        desk.until_rest()
        desk.counts.jogs += 1
        desk.wait(1.0)
        self._set_speed(self._habits.speed_deg_s)

    def _increments(self) -> None:
        desk, rng = self._desk, self._rng
        desk.ask("mode", self._who, mode="incremental")
        desk.ask("set", self._who, tag="increment_deg", value=rng.choice((0.1, 0.5, 1.0)))
        forward = deg(desk.axis.pos_act_rad) < 0.0
        for _ in range(rng.randrange(1, 5)):
            desk.ask("increment", self._who, direction="forward" if forward else "reverse")
            desk.until_rest()
            desk.counts.increments += 1
            desk.wait(rng.uniform(0.5, 2.0))
