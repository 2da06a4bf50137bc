"""Each monitor acts in exactly the scan in which its time is over, at every scan period, both ways and at both ends."""

import math
from collections.abc import Callable

import pytest

from gantryctl.units import deg, rad
from unit.program.rig import RATIO, Rig, settings

# Speed that the set-point keeps, deg/s.
SPEED_DEG_S = 6.0


def shows(more_deg_s: float) -> Callable[[Rig, float], None]:
    """The speed reading is wrong by so much, in the direction of motion."""

    def spoil(rig: Rig, direction: float) -> None:
        rig.spoil = lambda drive: drive._replace(
            vel_act_rad_s=drive.vel_act_rad_s + direction * rad(more_deg_s) * RATIO
        )

    return spoil


def error_seen(extra_deg: float) -> Callable[[Rig, float], None]:
    """The following error is larger than it is, for the monitors only."""

    def spoil(rig: Rig, direction: float) -> None:
        law = rig.axis._law

        def shifted(*given: float) -> tuple[float, float, float]:
            vel, pos, error = law(*given)
            return vel, pos, error + direction * rad(extra_deg)

        rig.axis._law = shifted

    return spoil


ROWS = {
    "velocity deviation": (shows(0.6), "CTL-05", 0.020, False),
    "overspeed": (shows(0.65), "CTL-04", 0.020, False),
    "following error": (error_seen(0.2), "CTL-03", 0.010, False),
    "standstill": (error_seen(0.025), "CTL-13", 0.010, True),
}


@pytest.mark.parametrize("direction", [1.0, -1.0], ids=["forward", "back"])
@pytest.mark.parametrize("period_s", [0.001, 0.004, 0.010])
@pytest.mark.parametrize("name", ROWS)
def test_the_time_of_a_monitor_to_the_scan(name: str, period_s: float, direction: float) -> None:
    spoil, code, time_s, standing = ROWS[name]
    # Of two monitors that see the same, the other one is left out.
    others = {"velocity_deviation_rad_s": math.inf} if name == "overspeed" else {}
    rig = Rig(config=settings(period_s=period_s, monitors=others))
    rig.power_up()
    if not standing:
        rig.move(direction * 100.0, SPEED_DEG_S)
        rig.run(2.0)
        assert math.isclose(rig.vel_deg_s, direction * SPEED_DEG_S, rel_tol=1e-9)
    spoil(rig, direction)
    scans = 0
    while code not in rig.codes:
        rig.step()
        scans += 1
        assert scans < 100, rig.codes
    # At least two readings, whatever the period.
    assert scans == max(2, math.ceil(time_s / period_s - 1e-9))


@pytest.mark.parametrize("direction", [1.0, -1.0], ids=["forward", "back"])
def test_an_axis_that_never_came_into_its_window_has_not_left_it(direction: float) -> None:
    """0.025 deg off from the start of the move on: outside the windows of arrival and of standstill, 0.02 deg."""
    rig = Rig()
    rig.power_up()
    error_seen(0.025)(rig, direction)
    rig.move(direction * 1.0, 3.0)
    rig.run(8.0)
    assert "CTL-11" in rig.codes
    assert "CTL-13" not in rig.codes


@pytest.mark.parametrize("direction", [1.0, -1.0], ids=["plus", "minus"])
@pytest.mark.parametrize(("beyond_deg", "stops"), [(-0.05, False), (0.05, True)])
def test_over_travel_at_either_end(direction: float, beyond_deg: float, stops: bool) -> None:
    """180.5 deg, measured; the reading goes there slowly enough to be believed."""
    rig = Rig(at_deg=direction * 180.0, config=settings(monitors={"encoder_drift_max_rad": math.inf}))
    rig.power_up()
    law, shift = rig.axis._law, direction * rad(0.5 + beyond_deg)

    def shifted(*given: float) -> tuple[float, float, float]:
        vel, pos, error = law(*given)
        return vel, pos + shift, error

    rig.axis._law = shifted
    rig.run(0.02)
    assert ("LIM-02" in rig.codes) is stops
    assert abs(deg(rig.axis.pos_act_rad)) == pytest.approx(180.5 + beyond_deg, abs=0.001)


@pytest.mark.parametrize("direction", [1.0, -1.0], ids=["plus", "minus"])
def test_a_limit_switch_that_stays_open_stops_once_and_leaves_the_way_back_open(direction: float) -> None:
    rig = Rig(at_deg=direction * 100.0)
    rig.power_up()
    end = "limit_plus_ok" if direction > 0.0 else "limit_minus_ok"
    rig.drive.inputs = rig.drive.inputs._replace(**{end: False})
    rig.step()
    assert rig.codes == ["LIM-03"]
    rig.run(1.0)
    rig.op(power=False, reset=True)
    rig.op(reset=False)
    rig.run(0.1)
    assert rig.codes == []
    rig.power_up()
    rig.move(direction * 110.0, 3.0)
    assert f"only motion {'reverse' if direction > 0.0 else 'forward'} is open" in rig.refused()
    rig.move(direction * 95.0, 3.0)
    rig.run(4.0)
    assert rig.codes == []
    assert rig.pos_deg == pytest.approx(direction * 95.0, abs=0.01)


def test_missed_scans_count_for_a_condition_that_began_before_them() -> None:
    feedback = Rig().axis.feedback
    feedback.periods = 5
    assert feedback.lasting(0) == 1, "what begins now has lasted one scan, however late it comes"
    assert feedback.lasting(1) == 6
