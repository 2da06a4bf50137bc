"""Where an axis is tried: inside its travel, and where the reference machine is tried if that fits."""

from collections.abc import Callable

import pytest

from gantryctl.machine import Machine, default_machine, with_values
from gantryctl.machine.places import fitted_stretch_deg, heaviest_deg, one_flank_deg, reach_deg
from support.axes import dish, stage, table, tilt

AXES = (default_machine, table, tilt, dish, stage)


@pytest.mark.parametrize("axis", AXES)
@pytest.mark.parametrize(
    "wanted", [(0.0, 90.0), (-90.0, 90.0), (-130.0, -50.0), (75.0, 75.0), (-500.0, 500.0)]
)
def test_a_stretch_lies_in_travel_and_is_as_long_as_it_can_be(
    axis: Callable[[], Machine], wanted: tuple[float, float]
) -> None:
    machine = axis()
    low, high = fitted_stretch_deg(machine, *wanted)
    travel = machine.axis.pos_max_deg - machine.axis.pos_min_deg
    assert machine.axis.pos_min_deg <= low <= high <= machine.axis.pos_max_deg
    assert high - low == pytest.approx(min(wanted[1] - wanted[0], travel))


def test_the_reference_machine_is_tried_where_it_was() -> None:
    machine = default_machine()
    assert fitted_stretch_deg(machine, -90.0, 90.0) == (-90.0, 90.0)
    assert heaviest_deg(machine) == (90.0, -90.0)
    assert one_flank_deg(machine) == 75.0


@pytest.mark.parametrize(
    ("low", "high", "level", "heaviest"),
    [
        (-5.0, 95.0, 0.0, (90.0, -5.0)),
        (10.0, 200.0, 0.0, (90.0, 200.0)),  # sin 200 deg is below sin 10 deg
        (-5.0, 95.0, 90.0, (95.0, 0.0)),
        (-270.0, 270.0, 0.0, (90.0, -90.0)),  # and not -270, 270, a turn further
    ],
)
def test_the_moment_is_largest_there(
    low: float, high: float, level: float, heaviest: tuple[float, float]
) -> None:
    ends = {
        f"axis.{name}_{side}_deg": end + sign * by
        for side, end, sign in (("min", low, -1.0), ("max", high, 1.0))
        for name, by in (("pos", 0.0), ("over_travel", 0.5), ("limit_switch", 2.0), ("mechanical_stop", 7.0))
    }
    machine = with_values(default_machine(), ends | {"plant.load.eccentric_angle_deg": level})
    assert heaviest_deg(machine) == heaviest


@pytest.mark.parametrize(
    ("sectors", "reach"),
    [
        (((60.0, 120.0),), (-180.0, 59.5)),  # 0 deg lies below it; half a degree away
        (((-120.0, -60.0), (60.0, 120.0)), (-59.5, 59.5)),
        (
            ((-20.0, 30.0),),
            (-180.0, -20.5),
        ),  # 0 deg lies in it: the wider rest, 160 deg below against 150 above
    ],
)
def test_trials_stay_away_from_no_go_sectors(
    sectors: tuple[tuple[float, float], ...], reach: tuple[float, float]
) -> None:
    machine = with_values(default_machine(), {"axis.no_go_deg": sectors})
    assert reach_deg(machine) == reach
    assert reach[0] <= machine.axis.start_angle_deg <= reach[1]
    for low, high in (fitted_stretch_deg(machine, -90.0, 90.0), heaviest_deg(machine)[::-1]):
        assert reach[0] <= min(low, high) <= max(low, high) <= reach[1]
