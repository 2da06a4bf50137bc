"""GantryProgram: the operator's stops, and the way back from outside the travel."""

import pytest

from gantryctl.image import DigitalInputs, DriveRequest, Mode
from gantryctl.program import AxisState
from gantryctl.units import rad
from unit.program.rig import COUNTS_PER_DEG, RATIO, Rig, moving_rig, powered, press, settings
from unit.program.spoiling import POSITION_ALONE


@pytest.fixture
def rig():
    return powered()


# --- stops ----------------------------------------------------------------------------------------


def test_halt_stop_and_quick_stop_are_three_ramps():
    """From 6 deg/s: 4 deg/s2, 5 deg/s2 (with its jerk), 5.5 deg/s2: v^2 / 2a."""
    ways = {}
    for stop in ("halt", "stop", "quick_stop"):
        rig = moving_rig()
        before = rig.pos_deg
        rig.op(**{stop: True})
        rig.until(lambda rig=rig: abs(rig.drive.vel_rad_s) < rad(0.001) * RATIO)
        ways[stop] = rig.pos_deg - before
    assert ways["halt"] == pytest.approx(4.5, abs=0.02)
    assert ways["stop"] == pytest.approx(3.75, abs=0.02)
    assert ways["quick_stop"] == pytest.approx(3.273, abs=0.02)


def test_stop_stays_in_stopping(rig):
    rig.op(stop=True)
    rig.run(0.5)
    assert rig.axis.state is AxisState.STOPPING
    rig.move(5.0)
    assert "held by Stop" in rig.refused()
    rig.op(stop=False)
    rig.step()
    assert rig.axis.state is AxisState.STANDSTILL


def test_quick_stop_while_off_is_nothing():
    rig = Rig()
    rig.op(quick_stop=True)
    rig.run(0.1)
    assert not rig.codes
    assert rig.output.request is DriveRequest.DISABLE


def test_reset_without_power_leads_to_disabled():
    rig = moving_rig()
    rig.op(quick_stop=True)
    rig.run(4.0)
    rig.op(quick_stop=False, power=False, reset=True)
    rig.step()
    assert rig.axis.state is AxisState.DISABLED
    assert not rig.codes
    rig.op(reset=False)
    rig.power_up()


def test_override_of_the_operator(rig):
    rig.op(override=0.5)
    rig.move(30.0)
    rig.run(2.0)
    assert rig.vel_deg_s == pytest.approx(3.0)
    rig.op(override=2.0)
    assert "override must be within 0 and 1, got 2.0" in rig.refused()
    rig.run(0.5)
    assert rig.vel_deg_s == pytest.approx(3.0)


# --- the way back ---------------------------------------------------------------------------------


@pytest.mark.parametrize("side", [1.0, -1.0])
def test_the_way_back_is_open_from_outside(side):
    rig = Rig(at_deg=side * 180.4)
    rig.power_up()
    rig.move(side * 180.45)
    assert "is beyond" in rig.refused()
    rig.move(side * 170.0)
    rig.until(lambda: not rig.program.move.busy)
    assert rig.pos_deg == pytest.approx(side * 170.0, abs=1e-4)
    assert not rig.codes


@pytest.mark.parametrize("side", [1.0, -1.0])
def test_switched_on_far_outside_only_inward(side):
    """Beyond over-travel too: nobody moves the axis back but itself."""
    rig = Rig(at_deg=side * 181.5)
    rig.power_up()
    outward, inward = ("forward", "reverse") if side > 0.0 else ("reverse", "forward")
    rig.op(mode=Mode.CONTINUOUS, speed_rad_s=rad(2.0))
    press(rig, **{outward: True})
    assert f"at {side * 181.5:.2f} deg only motion {inward} is open" in rig.refused()
    press(rig, **{outward: False})
    press(rig, **{inward: True})
    rig.hold_key(1.5)
    press(rig, **{inward: False})
    rig.run(1.0)
    assert abs(rig.pos_deg) < 180.0
    assert not rig.codes
    rig.move(side * 200.0)
    assert "is beyond" in rig.refused()


@pytest.mark.parametrize("side", [1.0, -1.0])
def test_further_out_trips_again(side):
    rig = Rig(at_deg=side * 181.5)
    rig.power_up()
    pushed = {"deg": 0.0}

    def push(drive):
        pushed["deg"] = min(pushed["deg"] + 0.004, 0.04)
        moved = round(side * pushed["deg"] * COUNTS_PER_DEG)
        return drive._replace(pos_act_counts=drive.pos_act_counts + moved)

    rig.spoil = push
    rig.run(0.05)
    assert "LIM-02" in rig.codes


@pytest.mark.parametrize("side", [1.0, -1.0])
def test_over_travel_then_reset_and_back(side):
    rig = Rig(at_deg=side * 180.45, config=settings(monitors=POSITION_ALONE))
    rig.power_up()
    pushed = {"deg": 0.0}

    def push(drive):
        pushed["deg"] = min(pushed["deg"] + 0.01, 0.2)
        moved = round(side * pushed["deg"] * COUNTS_PER_DEG)
        return drive._replace(pos_act_counts=drive.pos_act_counts + moved)

    rig.spoil = push
    rig.until(lambda: rig.first is not None, 0.1)
    assert "LIM-02" in rig.codes
    rig.run(2.0)
    rig.op(power=False, reset=True)
    rig.op(reset=False)
    rig.op(power=True)
    rig.run(1.5)
    assert not rig.codes, "acknowledged: the way back is open"
    rig.move(side * 170.0)
    rig.until(lambda: not rig.program.move.busy)
    assert rig.pos_deg == pytest.approx(side * 170.0, abs=1e-3)


def test_a_limit_switch_open_from_the_start_is_no_alarm():
    rig = Rig()
    rig.drive.inputs = DigitalInputs(limit_plus_ok=False)
    rig.power_up()
    rig.move(50.0)
    assert rig.refused() == "at 0.00 deg only motion reverse is open"
    rig.move(-5.0)
    rig.until(lambda: not rig.program.move.busy)
    rig.drive.inputs = DigitalInputs()
    rig.step()
    rig.drive.inputs = DigitalInputs(limit_plus_ok=False)
    rig.step()
    assert rig.codes == ["LIM-03"], "once it has closed, opening counts"


def test_both_limit_switches_open_from_the_start():
    rig = Rig()
    rig.drive.inputs = DigitalInputs(limit_plus_ok=False, limit_minus_ok=False)
    rig.run(0.01)
    assert rig.codes == ["LIM-04"]


@pytest.mark.parametrize(
    ("side", "outward_deg", "inward_deg"), [("plus", 50.0, -50.0), ("minus", -50.0, 50.0)]
)
def test_an_open_limit_switch_leaves_the_way_back(side, outward_deg, inward_deg):
    rig = Rig()
    rig.power_up()
    rig.drive.inputs = DigitalInputs(**{f"limit_{side}_ok": False})
    rig.run(1.5)
    assert rig.codes == ["LIM-03"]
    rig.op(power=False, reset=True)
    rig.op(reset=False)
    rig.op(power=True)
    rig.run(1.5)
    rig.move(outward_deg)
    assert "only motion" in rig.refused()
    rig.move(inward_deg)
    rig.run(1.0)
    assert rig.axis.state is AxisState.DISCRETE_MOTION
    assert not rig.codes
