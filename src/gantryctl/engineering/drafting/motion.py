"""Travel, speeds and decelerations of a draft."""

from __future__ import annotations

from typing import Final

from gantryctl.engineering.drafting.basis import Basis
from gantryctl.engineering.drafting.origin import (
    Drafted,
    Origin,
    Values,
    chosen,
    computed,
    guessed,
    significant,
)
from gantryctl.machine.specs import Value
from gantryctl.units import DEG_S_PER_R_MIN

# Parts of the permitted stopping angle: trip, switch and mechanical stop beyond travel. The stop has the whole angle
# behind the switch and a quarter more.
_TRIP, _SWITCH, _STOP = 0.125, 0.5, 1.75
# Over the highest setting; the first is the least that the machine file allows.
_CHAIN: Final = {"command_clamp_deg_s": 1.05, "drive_ceiling_deg_s": 1.08, "overspeed_trip_deg_s": 1.1}
_CREEP: Final = 60.0


def motion_values(basis: Basis) -> Values:
    """[axis], [speed] and [virtual_axis]."""
    return {**_axis(basis), **_speed(basis), **_set_point(basis)}


def _axis(basis: Basis) -> Values:
    return {
        "axis.kind": basis.of_sheet("range.kind"),
        # The ratios of a sheet are decimal numbers of few digits, and exact as they are written.
        "axis.gear_motor_turns": chosen(0),
        "axis.gear_axis_turns": chosen(1),
        "axis.pos_min_deg": basis.of_sheet("range.pos_min_deg"),
        "axis.pos_max_deg": basis.of_sheet("range.pos_max_deg"),
        **({} if basis.sheet.range.kind == "modulo" else _ends(basis)),
        "axis.reducer_ratio": basis.of_sheet("gears.reducer_ratio"),
        "axis.ring_ratio": basis.of_sheet("gears.ring_ratio"),
    }


def _ends(basis: Basis) -> Values:
    """What lies beyond travel, where the axis has ends."""
    sheet, permitted = basis.sheet, basis.required.stopping_angle_deg
    ends = {"min": (sheet.range.pos_min_deg, -permitted), "max": (sheet.range.pos_max_deg, permitted)}
    built = "x stopping angle beyond travel; where it is built"
    return {
        **{
            f"axis.over_travel_{side}_deg": computed(
                round(end + _TRIP * way, 3), "1/8 x stopping angle beyond travel"
            )
            for side, (end, way) in ends.items()
        },
        **{
            f"axis.{what}_{side}_deg": guessed(round(end + part * way, 3), f"{part:g} {built}")
            for what, part in (("limit_switch", _SWITCH), ("mechanical_stop", _STOP))
            for side, (end, way) in ends.items()
        },
    }


def _in_deg_s(basis: Basis, path: str) -> Drafted:
    """A speed of the sheet, r/min, in deg/s."""
    value, origin, rule = basis.of_sheet(path)
    assert isinstance(value, float)
    return Drafted(round(value * DEG_S_PER_R_MIN, 12), origin, rule)


def _speed(basis: Basis) -> Values:
    v = basis.speed_deg_s
    return {
        "speed.setting_min_deg_s": _in_deg_s(basis, "motion.speed_min_r_min"),
        "speed.setting_max_deg_s": _in_deg_s(basis, "motion.speed_max_r_min"),
        "speed.creep_deg_s": computed(significant(v / _CREEP), "highest setting / 60"),
        **{
            f"speed.{key}": computed(significant(part * v, 6), f"{part:g} x highest setting")
            for key, part in _CHAIN.items()
        },
    }


def _set_point(basis: Basis) -> Values:
    acc, quick = basis.sheet.motion.acc_deg_s2, basis.quick_dec_deg_s2
    profile: Value = "jerk_limited"
    return {
        "virtual_axis.profile": Drafted(profile, Origin.CHOICE, "a step of the acceleration swings the load"),
        "virtual_axis.acc_deg_s2": basis.of_sheet("motion.acc_deg_s2"),
        "virtual_axis.dec_deg_s2": basis.of_sheet("motion.acc_deg_s2"),
        "virtual_axis.jerk_deg_s3": computed(significant(basis.jerk_deg_s3), "acceleration x first mode"),
        "virtual_axis.gentle_end": Drafted(False, Origin.CHOICE, "for an axis whose backlash is followed"),
        "virtual_axis.end_dec_deg_s2": computed(significant(0.3 * acc), "0.3 x acceleration"),
        "virtual_axis.end_jerk_deg_s3": computed(
            significant(0.1 * basis.jerk_deg_s3), "gentle end over in three periods of the first mode"
        ),
        "virtual_axis.jog_release_dec_deg_s2": computed(
            significant(basis.release_dec_deg_s2), "sqrt(acceleration x quick stop)"
        ),
        "virtual_axis.jog_release_jerk_deg_s3": computed(
            significant(basis.release_jerk_deg_s3), "reached in 0.1 s"
        ),
        "virtual_axis.quick_dec_deg_s2": computed(
            significant(quick), "1.1 x v^2 / 2 (stopping angle - 60 ms x v), 1.5 x acceleration at least"
        ),
    }
