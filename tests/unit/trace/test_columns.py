"""Names of columns carry their unit, and only radians and SI come into a recording."""

import math

import pytest

from gantryctl.errors import UsageError
from gantryctl.trace.columns import degree_factor, in_degrees, unit_of, validate_columns


@pytest.mark.parametrize(
    ("name", "symbol"),
    [
        ("time_s", "s"),
        ("pos_ref_rad", "rad"),
        ("vel_cmd_rad_s", "rad/s"),
        ("acc_ref_rad_s2", "rad/s²"),
        ("jerk_ref_rad_s3", "rad/s³"),
        ("torque_act_nm", "N m"),
        ("pos_act_counts", "counts"),
        ("kpp_per_s", "1/s"),
        ("kvp_nm_s_per_rad", "N m s/rad"),
        ("axis_state", ""),
        ("overload", ""),
        ("pos_load_deg", "deg"),
    ],
)
def test_the_unit_is_the_end_of_the_name(name: str, symbol: str) -> None:
    assert unit_of(name).symbol == symbol


def test_names_and_values_change_to_degrees_together() -> None:
    assert in_degrees("vel_ref_rad_s") == "vel_ref_deg_s"
    assert in_degrees("torque_act_nm") == "torque_act_nm"
    assert in_degrees("kvp_nm_s_per_rad") == "kvp_nm_s_per_rad"
    assert degree_factor("pos_ref_rad") == 180.0 / math.pi
    assert degree_factor("time_s") == 1.0


def test_good_columns_pass() -> None:
    names = ("time_s", "pos_ref_rad", "vel_cmd_rad_s", "torque_act_nm", "axis_state")
    assert validate_columns(names) == names


@pytest.mark.parametrize(
    ("names", "message"),
    [
        ((), "first column must be time_s, not nothing"),
        (("pos_ref_rad",), "first column must be time_s, not pos_ref_rad"),
        (("time_s", "Pos_rad"), "'Pos_rad': only small letters"),
        (("time_s", "pos__rad"), "only small letters"),
        (("time_s", "pos,rad"), "only small letters"),
        (("time_s", "pos_ref_deg"), "did you mean pos_ref_rad?"),
        (("time_s", "vel_ref_deg_s"), "did you mean vel_ref_rad_s?"),
        (("time_s", "delay_ms"), "did you mean delay_s?"),
        (("time_s", "speed_r_min"), "did you mean speed_rad_s?"),
        (("time_s", "a_rad", "a_rad"), "a_rad: there twice"),
    ],
)
def test_a_wrong_column_is_named_with_what_is_wanted(names: tuple[str, ...], message: str) -> None:
    with pytest.raises(UsageError) as caught:
        validate_columns(names)
    assert message in str(caught.value)


def test_all_wrong_columns_are_named_at_once() -> None:
    with pytest.raises(UsageError, match=r"(?s)time_s.*pos_deg.*X"):
        validate_columns(("pos_deg", "X"))
