"""What an alarm says was measured, and against which limit: in the units that people read, by hand; both ways.

A value without its sign here is told without it, one with a sign has that of the way.
"""

from __future__ import annotations

from typing import NamedTuple

import pytest

from gantryctl.image import DigitalInputs, DriveState
from gantryctl.program import BrakeTestOutcome
from gantryctl.program.alarms.codes import Code
from gantryctl.program.alarms.words import Said, Words, drive_state_words
from gantryctl.units import rad
from unit.program import judges
from unit.program.judges import Acts
from unit.program.parts import BOTH, Parts
from unit.program.rig import RATIO, Rig, moving_rig, settings

approx = pytest.approx


class Way(NamedTuple):
    """A value with the sign of the way."""

    value: float


# A judge, what it is given, the code, and the values of its message.
SAID: dict[str, tuple[Acts, float, Code, dict[str, float | Way]]] = {
    "slip": (judges.slips, rad(0.03), Code.BRK_03, {"measured": 0.03, "limit": 0.02}),
    "slip without torque": (
        judges.slips_without_torque, rad(0.03), Code.BRK_04, {"measured": 0.03, "limit": 0.02}
    ),
    "way in HOLD": (judges.moves_in_hold, rad(0.2), Code.BRK_13, {"measured": 0.2, "speed": 0.0}),
    "speed in HOLD": (judges.turns_in_hold, rad(0.2), Code.BRK_13, {"measured": 0.0, "speed": 0.2}),
    "torque in HOLD": (judges.pushes_too_much_in_hold, 80.0, Code.BRK_13, {"measured": 0.0, "speed": 0.2}),
    "ramp": (judges.turns_on_its_ramp, rad(0.6), Code.DRV_07, {"measured": 0.6, "limit": 0.5}),
    "end of the ramp": (judges.turns_after_its_ramp, rad(0.06), Code.DRV_07, {"measured": 0.06, "limit": 0.05}),
    "lag that warns": (judges.lags, rad(0.02), Code.CTL_12, {"measured": 0.02, "limit": 0.015, "trip": 0.03}),
    "lag": (judges.lags_too_far, rad(0.04), Code.CTL_03, {"measured": 0.04, "limit": 0.03, "speed": 0.0}),
    "deviation": (
        judges.does_not_obey, rad(0.6), Code.CTL_05, {"measured": Way(0.6), "command": 0.0, "limit": 0.5}
    ),
    # Each 100 ms to the other side, 5 Hz: eleven times, the first after 99 ms.
    "swing": (judges.swings, rad(0.21), Code.CTL_08, {"measured": 0.21, "rate": 5.0, "time_s": 1.099}),
    "overspeed": (judges.is_too_fast, rad(6.7), Code.CTL_04, {"measured": 6.7, "limit": 6.6}),
    "over-travel": (judges.is_beyond, rad(181.0), Code.LIM_02, {"measured": Way(181.0), "limit": Way(180.5)}),
    "brake": (judges.feels_the_brake, rad(0.02), Code.BRK_05, {"measured": 0.0, "error": 0.02}),
    "standstill": (judges.leaves_standstill, rad(0.03), Code.CTL_13, {"measured": 0.03, "limit": 0.02}),
    "torque limit": (judges.grows_at_the_torque_limit, rad(0.01), Code.CTL_07, {"measured": 0.01, "time_ms": 200.0}),
    # 200 of 257 N m
    "heavy": (judges.is_heavy, 200.0, Code.CTL_06, {"measured": 77.821, "torque": 200.0}),
    "no torque": (
        judges.loses_its_torque, rad(0.06), Code.DRV_13, {"measured": 0.0, "deviation": 0.06, "time_ms": 50.0}
    ),
    "standing count": (judges.stands_under_torque, 20.0, Code.ENC_02, {"value": Way(20.0), "time_ms": 30.0}),
    "wrong sign": (judges.pushes_with_all, 320.0, Code.ENC_12, {"speed": 0.4, "torque": Way(320.0)}),
    "speed reading": (judges.is_a_wrong_speed, rad(22.0), Code.ENC_14, {"value": Way(22.0), "limit": 21.0}),
    "proof": (judges.gives_too_much, 91.0, Code.DRV_14, {"torque": Way(91.0), "wanted": Way(30.0)}),
    "warm": (judges.is_warm("THM-01"), 0.85, Code.THM_01, {"measured": 85.0, "limit": 80.0}),
    "hot": (judges.is_warm("THM-03"), 0.96, Code.THM_03, {"measured": 96.0, "limit": 95.0}),
    "too hot": (judges.is_warm("THM-04"), 1.02, Code.THM_04, {"measured": 102.0}),
}  # fmt: skip


@BOTH
@pytest.mark.parametrize("name", SAID)
def test_an_alarm_says_what_was_measured(name: str, way: float) -> None:
    acts, given, code, expected = SAID[name]
    parts = Parts()
    acts(parts, way * given)
    said: dict[str, object] = dict(parts.alarms.active[code].values)
    for value in list(said.values()):
        if isinstance(value, Said):
            said |= value.values
    assert {key: said[key] for key in expected} == {
        key: _near(key, value, way) for key, value in expected.items()
    }


def _near(key: str, value: float | Way, way: float) -> object:
    size = way * value.value if isinstance(value, Way) else value
    # A scan of 1 ms more or less until a time is over.
    return approx(size, abs=1.01 if key == "time_ms" else 1e-2 if key == "rate" else 1e-3)


def slow_rig(at_deg_s: float = 0.0) -> Rig:
    """At scans of 4 ms, so that no scan is a millisecond."""
    config = settings(period_s=0.004)
    return moving_rig(config=config, speed_deg_s=at_deg_s) if at_deg_s else Rig(config=config)


def test_a_brake_that_does_not_open_is_told_in_milliseconds() -> None:
    """100 ms to open and 300 for its contact."""
    rig = slow_rig()
    rig.spoil = lambda drive: drive._replace(brake_open=False)
    rig.op(power=True)
    rig.until(lambda: bool(rig.codes), 5.0)
    assert rig.first.code == "BRK-01"
    assert rig.first.values == {"time_ms": approx(404.0), "limit": approx(400.0)}


def test_a_drive_that_leaves_its_state_is_told_with_the_state_that_it_shows() -> None:
    rig = slow_rig(3.0)
    rig.spoil = lambda drive: drive._replace(state=DriveState.SWITCHED_ON)
    rig.step()
    assert rig.first.values == {"measured": drive_state_words(DriveState.SWITCHED_ON)}


def test_channels_that_differ_are_told_in_milliseconds() -> None:
    rig = slow_rig()
    rig.drive.inputs = DigitalInputs(estop_ok=True, estop_ok_2=False)
    rig.until(lambda: Code.INT_04 in rig.axis.alarms.active, 1.0)
    assert rig.axis.alarms.active[Code.INT_04].values == {"time_ms": approx(500.0), "limit": approx(500.0)}


def test_an_old_reading_is_told_in_milliseconds() -> None:
    """30 ms are seven scans and a half."""
    rig = slow_rig(3.0)
    rig.spoil = lambda drive: drive._replace(age_scans=9)
    rig.step()
    assert rig.axis.alarms.active[Code.CAN_07].values == {"measured": approx(36.0), "limit": approx(28.0)}


@pytest.mark.parametrize(("commanded", "words"), [(True, Words.WHILE_COMMANDED), (False, Words.WHILE_READ)])
def test_a_frozen_reading_is_told_with_the_speed_that_it_should_have_shown(
    commanded: bool, words: Words
) -> None:
    """5 deg/s are commanded behind 3 that were read, or nothing behind 5."""
    parts = Parts()
    feedback = parts.feedback
    feedback._vel_before = rad(3.0 if commanded else 5.0)
    feedback.unchanged_scans = 20
    feedback.report_frozen(rad(5.0) * RATIO if commanded else 0.0)
    measured: object = parts.alarms.active[Code.ENC_02].values["measured"]
    assert isinstance(measured, Said)
    assert (measured.words, measured.values["value"]) == (words, approx(5.0))


def test_a_contact_that_opens_in_the_first_scan_of_torque_fails_the_brake() -> None:
    rig = Rig()
    rig.op(brake_test=True)
    test = rig.axis.brake_test
    rig.until(lambda: test.running, 2.0)
    rig.spoil = lambda drive: drive._replace(brake_open=True)
    rig.step()
    assert (test.outcome, test.words) == (BrakeTestOutcome.FAILED, Words.BRAKE_CONTACT_OPEN)
