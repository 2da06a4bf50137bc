"""Sentences of the program name angles as people read them, within 0 to 360 deg where the display does."""

import re
from dataclasses import replace

import pytest

from gantryctl.image import DigitalInputs, Mode
from gantryctl.program import Code
from gantryctl.program.alarms.log import messages_to_wire
from gantryctl.units import deg, rad
from unit.program.rig import Rig, moving_rig, press, settings

_IEC = replace(settings(), travel=replace(settings().travel, read_within_turn=True))
# An angle of the axis: not a speed, and not a way, which keeps its sign.
_ANGLE = re.compile(r"(?<![\w.])([+-]?\d+\.\d+) deg(?!/s)")


def _told(rig: Rig) -> list[str]:
    """Texts of all alarms and of the last refusal."""
    found = [alarm.text for alarm in rig.axis.alarms.history]
    return found + ([rig.axis.refusal.text] if rig.axis.refusal else [])


def _angles(text: str) -> list[float]:
    return [float(angle) for angle in _ANGLE.findall(text)]


def _raised(code: str, rig: Rig) -> str:
    (text,) = {text for text in _told(rig) if text.startswith(code)}
    return text


def test_over_travel_and_a_foreseen_stop_name_the_angle_that_is_read():
    """LIM-02 and CTL-10 by the monitor itself: angles beyond an end keep their sign, as the end does."""
    rig = Rig(at_deg=-100.0, config=_IEC)
    rig.power_up()
    monitors = rig.axis.monitors
    monitors._beyond_travel(rad(-180.6), rad(-180.6), 0.0)
    assert _angles(_raised("LIM-02", rig)) == [-180.6, -180.5]
    monitors._beyond_travel(rad(-179.0), rad(-182.0), rad(-6.0))
    assert _angles(_raised("CTL-10", rig)) == [-182.0, -180.5]


@pytest.mark.parametrize(
    ("inputs", "code"),
    [
        (DigitalInputs(estop_ok=False), "INT-03"),
        (DigitalInputs(mains_ready=False), "PWR-01"),
        (DigitalInputs(limit_minus_ok=False), "LIM-03"),
        (DigitalInputs(limit_minus_ok=False, limit_plus_ok=False), "LIM-04"),
    ],
)
def test_a_stop_names_the_angle_at_which_it_began_and_ended(inputs, code):
    rig = moving_rig(at_deg=60.0, config=_IEC)  # to -40 deg
    rig.until(lambda: rig.ref_deg < -20.0)
    at_deg = rig.pos_deg
    rig.drive.inputs = inputs
    rig.run(4.0)
    text = _raised(code, rig)
    assert _angles(text)[0] == pytest.approx(at_deg + 360.0, abs=0.1)  # one scan of 6 deg/s, two decimals
    # "axis moved WAY deg to ANGLE deg": the way is a difference.
    way, end = (float(part) for part in re.findall(r"axis moved ([\d.]+) deg to ([\d.]+) deg", text)[0])
    assert way < 10.0
    assert end == pytest.approx(rig.pos_deg + 360.0, abs=0.01)


def test_the_end_of_travel_and_what_is_still_open_are_read_within_the_turn():
    rig = Rig(at_deg=-175.0, config=_IEC)
    rig.power_up()
    rig.op(mode=Mode.CONTINUOUS, speed_rad_s=rad(6.0))
    press(rig, reverse=True)
    rig.hold_key(8.0)
    assert _angles(_raised("LIM-01", rig)) == [-180.0]
    press(rig, reverse=False)
    press(rig, reverse=True)
    assert _angles(rig.refused()) == [180.0]
    assert rig.axis.refusal.code is Code.LIM_05


@pytest.mark.parametrize(
    ("angle_deg", "read_deg"),
    [(-90.0, 270.0), (-0.5, 359.5), (300.0, 300.0), (-361.0, -361.0), (400.0, 400.0)],
)
def test_an_angle_is_read_within_the_turn_and_what_was_typed_beyond_one_as_it_was(angle_deg, read_deg):
    assert deg(_IEC.travel.read_rad(rad(angle_deg))) == pytest.approx(read_deg)
    assert deg(settings().travel.read_rad(rad(angle_deg))) == pytest.approx(angle_deg)


def test_signed_angles_stay_signed():
    rig = moving_rig(at_deg=60.0)
    rig.until(lambda: rig.ref_deg < -20.0)
    rig.drive.inputs = DigitalInputs(estop_ok=False)
    rig.run(4.0)
    assert _angles(_raised("INT-03", rig))[0] < 0.0


def test_the_values_of_a_message_are_its_fields_and_the_row_of_an_alarm_keeps_the_angle_of_the_axis():
    """A page makes its Chinese sentence of the values: they say what the English one says."""
    rig = moving_rig(at_deg=60.0, config=_IEC)
    rig.until(lambda: rig.ref_deg < -20.0)
    rig.drive.inputs = DigitalInputs(estop_ok=False)
    rig.run(4.0)
    (alarm,) = rig.axis.alarms.history
    (wire,) = messages_to_wire(*[alarm.values["measured"]])
    assert isinstance(wire, dict)
    assert wire["values"]["value"] == pytest.approx(deg(alarm.pos_rad) + 360.0, abs=0.1)
    assert deg(alarm.pos_rad) < 0.0
