"""What changes on a sound gantry from day to day: temperatures, friction, wear, the moment of nozzle and snout.

Every figure lies within what a sound machine does; the reason stands beside it. All of it is a function of seed and
machine time, so a day can be computed again by itself.
"""

from __future__ import annotations

import math
import random
from typing import Final, NamedTuple

from gantryctl.machine import Machine, with_values

DAY_S: Final = 86_400.0
# Rollers and grease from one service to the next and over the seasons: +-30 % in all, the band of [plant.uncertainty].
_FRICTION_SEASON, _FRICTION_WEEK = 0.25, 0.05
_SEASON_DAYS, _WEEK_DAYS = 90.0, 7.0
# K about the temperature of alignment: an air-conditioned treatment room, over the year and over the day.
_ROOM_YEAR_K, _ROOM_DAY_K = 1.5, 0.5
# K above the room: gears in use, and a motor that holds and moves a fifth of the time (class F would allow 115 K).
_GEARS_USED_K, _MOTOR_USED_K = 3.0, 30.0
GEARS_S: Final = 36_000.0
MOTOR_S: Final = 1_800.0
# Flanks of a ring wear by some micrometres a year; linings of a holding brake that seldom brakes lose some per cent.
_WEAR_MM_A_DAY = 0.01 / 365.0
_BRAKE_A_DAY = 0.05 / 365.0
# Of the eccentric moment: a snout of 40 kg on 1 m, 400 N m, and counterweights that follow it in steps.
_MOMENT_SHARE = 0.10

SWITCHED: Final = ("ageing", "cable", "cogging", "encoder_errors", "thermal", "tooth_pitch")
"""Effects of the plant that the reference machine has switched off and the soak switches on."""


class Temperatures(NamedTuple):
    """Above the temperature of alignment, K."""

    gears_k: float
    motor_k: float

    def after(self, seconds: float, towards: Temperatures) -> Temperatures:
        """The temperatures after a time on the way towards others."""
        gears, motor = math.exp(-seconds / GEARS_S), math.exp(-seconds / MOTOR_S)
        return Temperatures(
            towards.gears_k + (self.gears_k - towards.gears_k) * gears,
            towards.motor_k + (self.motor_k - towards.motor_k) * motor,
        )


def room_k(time_s: float) -> float:
    """Temperature of the room above that of alignment."""
    day = time_s / DAY_S
    return _ROOM_YEAR_K * math.sin(math.tau * day / 365.0) - _ROOM_DAY_K * math.cos(math.tau * day)


def in_use(time_s: float) -> Temperatures:
    """Where the temperatures tend to while the gantry is used."""
    room = room_k(time_s)
    return Temperatures(room + _GEARS_USED_K, room + _MOTOR_USED_K)


def at_rest(time_s: float) -> Temperatures:
    """Where they tend to while it is switched off."""
    return Temperatures(room_k(time_s), room_k(time_s))


def friction_share(seed: int, part: str, day: float) -> float:
    """Friction as a share of that of the machine file: 0.7 to 1.3."""
    rng = random.Random(f"{seed} friction {part}")
    season, week = rng.uniform(0.0, math.tau), rng.uniform(0.0, math.tau)
    return (
        1.0
        + _FRICTION_SEASON * math.sin(math.tau * day / _SEASON_DAYS + season)
        + _FRICTION_WEEK * math.sin(math.tau * day / _WEEK_DAYS + week)
    )


def moment_share(rng: random.Random) -> float:
    """Eccentric moment with the nozzle and snout of one patient, as a share of that of the machine file."""
    return 1.0 + rng.uniform(-_MOMENT_SHARE, _MOMENT_SHARE)


def machine_at(nominal: Machine, seed: int, time_s: float, start: Temperatures) -> Machine:
    """The machine as it is from a machine time on, switched on with these temperatures."""
    day = time_s / DAY_S
    roller, motor = (friction_share(seed, part, day) for part in ("roller", "motor"))
    plant, end = nominal.plant, in_use(time_s)
    changes: dict[str, object] = {f"plant.switches.{name}": True for name in SWITCHED}
    for name in ("coulomb_nm", "breakaway_nm", "viscous_nm_s_per_rad"):
        changes[f"plant.roller_friction.{name}"] = getattr(plant.roller_friction, name) * roller
        changes[f"plant.motor_friction.{name}"] = getattr(plant.motor_friction, name) * motor
    changes |= {
        "plant.thermal.gears_start_k": start.gears_k,
        "plant.thermal.gears_end_k": end.gears_k,
        "plant.thermal.gears_time_s": GEARS_S,
        "plant.thermal.motor_start_k": start.motor_k,
        "plant.thermal.motor_end_k": end.motor_k,
        "plant.thermal.motor_time_s": MOTOR_S,
        "plant.transmission.backlash_mm": plant.transmission.backlash_mm + _WEAR_MM_A_DAY * day,
        "plant.brake.torque_share": plant.brake.torque_share * (1.0 - _BRAKE_A_DAY * day),
    }
    return with_values(nominal, changes)
