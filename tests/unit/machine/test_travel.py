"""Travel of any axis: each side its own signed angle, 0 deg anywhere."""

import pytest

from gantryctl.errors import ConfigError
from gantryctl.machine import default_machine, with_values
from gantryctl.machine.tables.axis import AxisTable
from gantryctl.units import Dial

MACHINE = default_machine()


def axis(low_deg: float, high_deg: float, **more: float) -> AxisTable:
    return AxisTable(pos_min_deg=low_deg, pos_max_deg=high_deg, reducer_ratio=88.0, ring_ratio=13.0, **more)


def limits(table: AxisTable) -> tuple[float, ...]:
    return (
        table.mechanical_stop_min_deg, table.limit_switch_min_deg, table.over_travel_min_deg, table.pos_min_deg,
        table.pos_max_deg, table.over_travel_max_deg, table.limit_switch_max_deg, table.mechanical_stop_max_deg,
    )  # fmt: skip


@pytest.mark.parametrize(
    ("low_deg", "high_deg"), [(-180.0, 180.0), (-5.0, 95.0), (10.0, 200.0), (-270.0, -30.0)]
)
def test_limits_stand_beside_their_end_of_travel(low_deg: float, high_deg: float) -> None:
    """A limit of both sides of zero, 180.5 deg for all, would lie 85 deg behind an axis that ends at 95 deg."""
    away = (-7.0, -2.0, -0.5, 0.0, 0.0, 0.5, 2.0, 7.0)
    ends = (low_deg,) * 4 + (high_deg,) * 4
    assert limits(axis(low_deg, high_deg)) == tuple(end + by for end, by in zip(ends, away, strict=True))


@pytest.mark.parametrize(
    ("angle_deg", "shown"),
    [
        (-180.0, "180 (- end)"), (180.0, "180 (+ end)"), (-20.0, "340"), (0.0, "0"), (-0.004, "-0.004"),
        (-0.01, "359.99"), (173.5, "173.5 (+ end)"), (172.5, "172.5"), (-172.5, "187.5"),
    ],
)  # fmt: skip
def test_an_angle_within_0_to_360_names_its_end_of_travel_where_two_places_read_alike(
    angle_deg: float, shown: str
) -> None:
    """Stops at +-187 deg: from 173 deg on, either way, the other end has the same reading. At rest 0 is not 360."""
    assert Dial(0.0, (-187.0, 187.0)).text(angle_deg) == shown


def test_a_given_limit_moves_no_other() -> None:
    found = limits(axis(-5.0, 95.0, limit_switch_max_deg=96.0))
    assert found == (-12.0, -7.0, -5.5, -5.0, 95.0, 95.5, 96.0, 102.0)


@pytest.mark.parametrize(
    ("low_deg", "high_deg", "stands_deg"), [(-5.0, 95.0, 0.0), (0.0, 90.0, 0.0), (10.0, 200.0, 105.0)]
)
def test_a_new_machine_stands_inside_its_travel(low_deg: float, high_deg: float, stands_deg: float) -> None:
    assert axis(low_deg, high_deg).start_angle_deg == stands_deg


@pytest.mark.parametrize("name", ["over_travel", "limit_switch", "mechanical_stop"])
def test_a_key_of_both_sides_is_answered_with_those_of_each(name: str, tmp_path) -> None:
    from gantryctl.machine import load_machine

    file = tmp_path / "old.toml"
    file.write_text(
        f"[machine]\nname = 'old'\n[axis]\npos_min_deg = -180.0\npos_max_deg = 180.0\n{name}_deg = 190.0\n"
    )
    with pytest.raises(ConfigError) as error:
        load_machine(file)
    line = next(line for line in error.value.problems if f"[axis] {name}_deg" in line)
    assert f"{name}_min_deg and {name}_max_deg" in line


def test_a_refused_end_of_travel_has_one_line() -> None:
    """The limits beside it cannot be computed: they are not reported as wrong too."""
    with pytest.raises(ConfigError) as error:
        with_values(MACHINE, {"axis.pos_min_deg": -1e6})
    assert len(error.value.problems) == 1


@pytest.mark.parametrize(
    ("low_deg", "high_deg", "typed_deg", "meant_deg"),
    [
        # 300 to 420 deg are read as 300 to 360 and 0 to 60; -60 to 60 as 300 to 360 and 0 to 60, too.
        (300.0, 420.0, 20.0, 380.0), (300.0, 420.0, 310.0, 310.0), (300.0, 420.0, 200.0, 200.0),
        (-60.0, 60.0, 310.0, -50.0), (-60.0, 60.0, 20.0, 20.0), (-60.0, 60.0, 200.0, 200.0),
    ],
)  # fmt: skip
def test_an_angle_that_is_typed_as_it_is_read_is_one_of_the_travel(
    low_deg: float, high_deg: float, typed_deg: float, meant_deg: float
) -> None:
    axis = AxisTable(
        pos_min_deg=low_deg, pos_max_deg=high_deg, reducer_ratio=88.0, ring_ratio=13.0, display="0..360"
    )
    assert axis.meant_deg(typed_deg) == meant_deg
