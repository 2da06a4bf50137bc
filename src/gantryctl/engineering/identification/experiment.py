"""The experiment of one axis: places, speeds and times, from its travel, its speeds and the first mode that it expects.

The scales are those at which the motion says something. Waves of the gear must pass below the first mode, or the load
swings instead of following; a transient is over after some periods of it; acceleration must wind the transmission up
for longer than the transient lasts. The factors give round numbers on a gantry of 2 Hz and 6 deg/s.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Final

from gantryctl.machine import Machine
from gantryctl.machine.derived import rigid_stop
from gantryctl.machine.places import fitted_stretch_deg, reach_deg

# A wave that passes at half the first mode is seen a third larger; above it the correction is guesswork.
_PASSES_BELOW_MODE: Final = 0.5
_TURN_MESH_PER_MODE: Final = 0.47
# The fastest wave of the creep: seen 1.7 times as large, the same on every axis.
_CREEP_WAVE_PER_MODE: Final = 0.64
# Beyond its fastest expected wave the creep shows no more than its rounding to two digits allows.
_CREEP_BAND_PER_MODE: Final = 0.68
# Turns of the slowest wave in the creep.
_CREEP_TURNS: Final = 7.7
# A motor and its reducer make waves of one turn, of two (a wave generator is an ellipse) and of four.
_MOTOR_WAVES: Final = (1.0, 2.0, 4.0)
# A turn of the axis takes ten minutes at most, where its speed allows it.
_SLOWEST_TURN_DEG_S: Final = 0.6
# Swings for inertia and wind-up, on both sides of 0: where an eccentric moment is large, acceleration does not turn
# the torque of the mesh round, and its backlash stays out of the wind-up.
_SWING_DEG: Final = (50.0, 130.0)
# Ramps of a swing last so many periods of the first mode, or take 0.44 of the acceleration of a move.
_RAMP_PERIODS: Final = 23.3
_SWING_ACC_SHARE: Final = 0.44
# Where the speed loop is measured, the room that it turns in, and for how long at most: friction slides.
_SPEED_LOOP_DEG: Final = (60.0, 110.0)
SPEED_LOOP_S: Final = 100.0
# Of the travel, kept at both ends.
_MARGIN_DEG: Final = 0.5


@dataclass(frozen=True)
class Experiment:
    """Places, speeds and times of an identification.

    Attributes:
        low_deg, high_deg: ends of the slow turns: travel, or one turn of a longer one.
        turn_deg_s: speed of the slow turns; friction is steady.
        turn_waves, creep_waves: largest number of waves per turn that the slow turns, and the creep, show.
        creep_deg_s: speed of the creep. creep_deg: its ends.
        check_deg: ends of the move each way that no fit sees, at the speed of the slow turns.
        swings_deg: each from its inner to its outer end and back. swing_deg_s, swing_acc_deg_s2: of the swings.
        jerk_time_s: of the ramps. transient_s: after a change of the acceleration. settle_s: after a move.
        block_s: averaged to one sample.
        speed_loop_deg, speed_loop_deg_s: where the speed loop is measured, and the turning meanwhile.
    """

    low_deg: float
    high_deg: float
    turn_deg_s: float
    turn_waves: float
    creep_waves: float
    creep_deg_s: float
    creep_deg: tuple[float, float]
    check_deg: tuple[float, float]
    swings_deg: tuple[tuple[float, float], ...]
    swing_deg_s: float
    swing_acc_deg_s2: float
    jerk_time_s: float
    transient_s: float
    settle_s: float
    block_s: float
    speed_loop_deg: float
    speed_loop_deg_s: float

    @property
    def minutes(self) -> float:
        """About how long it takes."""
        way = self.high_deg - self.low_deg
        creep = self.creep_deg[1] - self.creep_deg[0]
        swings = sum(2.0 * abs(outer - inner) for inner, outer in self.swings_deg)
        way += self.check_deg[1] - self.check_deg[0]
        turning_s = 2.0 * way / self.turn_deg_s + creep / self.creep_deg_s + 1.5 * swings / self.swing_deg_s
        return (turning_s + SPEED_LOOP_S) / 60.0


def expected_waves(machine: Machine) -> tuple[float, ...]:
    """Waves per turn that the ratios make and the machine file lists: they are looked for first."""
    axis = machine.axis
    motor = (times * axis.ratio for times in _MOTOR_WAVES)
    return tuple(
        dict.fromkeys((*machine.control.compensation.gear_map.cycles_per_turn, axis.ring_ratio, *motor))
    )


def experiment_of(machine: Machine) -> Experiment:
    """The experiment that fits an axis; of [plant] it reads nothing."""
    mode_hz, top = machine.control.compensation.first_mode_hz, machine.speed.setting_max_deg_s
    listed = machine.control.compensation.gear_map.cycles_per_turn
    least, most = reach_deg(machine)
    margin = min(_MARGIN_DEG, 0.05 * (most - least))
    low, high = fitted_stretch_deg(machine, -180.0, 180.0)
    low, high = max(low, least + margin), min(high, most - margin)
    turn = min(0.6 * top, max(top / 6.0, min(_SLOWEST_TURN_DEG_S, top)))
    if listed:
        turn = min(turn, _TURN_MESH_PER_MODE * mode_hz * 360.0 / min(listed))
    turn = _two_digits(turn)
    turn_waves = _PASSES_BELOW_MODE * mode_hz * 360.0 / turn
    fastest = max(*expected_waves(machine), turn_waves)
    creep = _two_digits(min(turn, _CREEP_WAVE_PER_MODE * mode_hz * 360.0 / fastest))
    transient_s = 4.0 / mode_hz
    # Long enough for the transient and as long again between its ramps, and for its waves to be told from each other.
    even_way = 2.0 * transient_s * creep + _ramps_deg(machine, creep)
    creep_way = _two_digits(max(_CREEP_TURNS * 360.0 / turn_waves, even_way))
    swings, swing_deg_s, acc = _swings(machine, mode_hz)
    near, far = _SPEED_LOOP_DEG
    start = fitted_stretch_deg(machine, near, min(far, near + 0.5 * (most - least)))[0]
    return Experiment(
        low_deg=low,
        high_deg=high,
        turn_deg_s=turn,
        turn_waves=turn_waves,
        creep_waves=_CREEP_BAND_PER_MODE * mode_hz * 360.0 / creep,
        creep_deg_s=creep,
        creep_deg=fitted_stretch_deg(machine, -0.5 * creep_way, 0.5 * creep_way),
        check_deg=(low + 0.25 * (high - low), high - 0.25 * (high - low)),
        swings_deg=swings,
        swing_deg_s=swing_deg_s,
        swing_acc_deg_s2=acc,
        jerk_time_s=1.0 / mode_hz,
        transient_s=transient_s,
        settle_s=6.0 / mode_hz,
        block_s=0.08 / mode_hz,
        speed_loop_deg=start,
        speed_loop_deg_s=min(turn, (most - margin - start) / SPEED_LOOP_S),
    )


def _swings(machine: Machine, mode_hz: float) -> tuple[tuple[tuple[float, float], ...], float, float]:
    """Ends, speed and acceleration of the swings."""
    near, far = _SWING_DEG
    low, high = fitted_stretch_deg(machine, -far, -near), fitted_stretch_deg(machine, near, far)
    speed, most = 7.0 / 12.0 * machine.speed.setting_max_deg_s, machine.virtual_axis.acc_deg_s2
    acc = min(most, max(_two_digits(speed * mode_hz / _RAMP_PERIODS), _SWING_ACC_SHARE * most))
    # At most 0.6 of the way is ramps.
    speed = min(speed, math.sqrt(0.6 * (high[1] - high[0]) * acc))
    return ((low[1], low[0]), high), speed, acc


def _ramps_deg(machine: Machine, vel_deg_s: float) -> float:
    """Way of both ramps of a move at a speed."""
    axis = machine.virtual_axis
    jerk = axis.jerk_deg_s3 if axis.profile == "jerk_limited" else math.inf
    return sum(rigid_stop(vel_deg_s, ramp, jerk)[0] for ramp in (axis.acc_deg_s2, axis.dec_deg_s2))


def _two_digits(value: float) -> float:
    """Rounded to two digits: what is printed is what is driven."""
    return float(f"{value:.2g}")
