"""What a stop has shown, and what keeps a reset back: each condition alone."""

import math
from dataclasses import replace
from types import SimpleNamespace

import pytest

from gantryctl.image import DigitalInputs, DriveState
from gantryctl.program import Reaction
from gantryctl.program.alarms.codes import Code
from gantryctl.program.alarms.words import Words
from gantryctl.program.monitors.recovery import Recovery, StopRecord
from gantryctl.program.power.phases import PowerPhase
from gantryctl.units import rad
from unit.program.parts import PERIODS, Parts, in_scans

approx = pytest.approx
ON, OFF = DriveState.OPERATION_ENABLED, DriveState.SWITCH_ON_DISABLED


def power(phase=PowerPhase.ON, **said):
    return SimpleNamespace(
        **({"phase": phase, "brake_open": True, "falling": True, "fault_reset": False} | said)
    )


class Stop:
    """A stop from 3 deg/s at 10 deg, seen scan by scan."""

    def __init__(
        self,
        reaction=Reaction.TORQUE_OFF,
        period_s=0.001,
        before=None,
        at_scan=0,
        dec=None,
        close_s=0.15,
        swing_s=0.5,
        **said,
    ):
        self.parts = Parts(period_s)
        settings = self.parts.settings
        ramps, power_settings = settings.ramps, replace(settings.power, brake_close_time_s=close_s)
        if dec is not None:
            ramps = replace(ramps, quick_dec_rad_s2=rad(dec))
            power_settings = replace(power_settings, brake_dec_least_rad_s2=rad(dec))
        monitors = replace(settings.monitors, swing_s=swing_s)
        settings = replace(settings, ramps=ramps, power=power_settings, monitors=monitors)
        self.parts.alarms.scan = at_scan
        self.parts.alarms.pos_rad = rad(10.0)
        self.parts.turn(3.0)
        for name, value in (before or {}).items():
            setattr(self.parts.feedback, name, value)
        self.parts.alarms.raise_(Code.CTL_02, reaction, measured="a test")
        self.alarm = self.parts.alarms.first_out
        self.record = StopRecord(self.alarm, settings, self.parts.feedback, power(**said), self.parts.alarms)

    def scan(self, scan, pos_deg=10.0, *, over=False, deg_s=None, **said):
        for name, value in said.items():
            setattr(self.parts.feedback, name, value)
        if deg_s is not None:
            self.parts.turn(deg_s)
        self.record.scan(scan, rad(pos_deg), self.parts.feedback, not over)
        return self.alarm.steps

    @property
    def steps(self):
        return [getattr(step, "words", step) for step in self.alarm.steps]

    def value(self, words, name):
        return next(step.values[name] for step in self.alarm.steps if getattr(step, "words", None) is words)


W = Words


def test_each_step_is_told_with_its_time_in_the_order_of_what_was_shown():
    stop = Stop()
    stop.scan(2, state=OFF)
    stop.scan(40, brake_open=False)
    stop.scan(500, deg_s=0.0)
    stop.scan(800, 11.5, over=True)
    assert stop.steps == [W.TORQUE_OFF_AFTER, W.BRAKE_CLOSED_AFTER, W.AT_REST_AFTER, W.MOVED_TO]
    times = [stop.value(words, "time_ms") for words in stop.steps[:3]]
    assert times == approx([2.0, 40.0, 500.0])
    assert stop.value(W.MOVED_TO, "way") == approx(1.5)
    assert stop.value(W.MOVED_TO, "position") == approx(11.5)


def test_a_quick_stop_is_told_first_and_rest_counts_from_when_it_lasted():
    stop = Stop(Reaction.QUICK_STOP, 0.004)
    stop.scan(100, deg_s=0.0)
    stop.scan(110, deg_s=0.1)
    stop.scan(150, deg_s=0.0)
    stop.scan(200, brake_open=False)
    stop.scan(220, state=OFF)
    stop.scan(230, 9.0, over=True)
    assert stop.steps == [W.QUICK_STOP, W.AT_REST_AFTER, W.BRAKE_CLOSED_AFTER, W.TORQUE_OFF_AFTER, W.MOVED_TO]
    assert stop.value(W.AT_REST_AFTER, "time_ms") == approx(600.0)
    assert stop.value(W.MOVED_TO, "way") == approx(1.0)


@pytest.mark.parametrize(
    ("state", "brake_open", "known", "deg_s", "words"),
    [
        (ON, True, True, 0.0, [W.STOP_UNCONFIRMED]),
        (ON, False, True, 0.0, [W.TORQUE_UNCONFIRMED]),
        (OFF, True, True, 0.0, [W.BRAKE_COMMANDED]),
        (OFF, True, True, 0.019, [W.BRAKE_COMMANDED]),
        (OFF, False, False, 0.0, [W.BRAKE_COMMANDED]),
        (OFF, False, True, 0.0, []),
        # What turns on has confirmed nothing.
        (OFF, False, True, 1.0, [W.STOP_UNCONFIRMED, W.STILL_TURNING]),
        (OFF, True, True, -1.0, [W.STOP_UNCONFIRMED, W.STILL_TURNING]),
    ],
)
def test_what_was_commanded_and_not_shown_is_told(state, brake_open, known, deg_s, words):
    stop = Stop()
    stop.scan(5, over=True, state=state, brake_open=brake_open, brake_contact=known, deg_s=deg_s)
    told = {W.STOP_UNCONFIRMED, W.TORQUE_UNCONFIRMED, W.BRAKE_COMMANDED, W.STILL_TURNING}
    assert [step for step in stop.steps if step in told] == words
    rests = abs(deg_s) < 0.02
    assert (W.TORQUE_OFF_AFTER in stop.steps) is (state is OFF and rests)
    assert (W.BRAKE_CLOSED_AFTER in stop.steps) is (known and not brake_open and rests)


def test_a_brake_that_nobody_saw_close_of_a_shaft_that_nobody_sees_rest_is_not_told_as_commanded_alone():
    stop = Stop()
    stop.parts.feedback._speed_age = stop.parts.feedback.age = 30
    stop.scan(5, over=True, state=OFF, brake_open=True)
    assert W.STOP_UNCONFIRMED in stop.steps
    assert W.BRAKE_COMMANDED not in stop.steps
    assert W.STILL_TURNING not in stop.steps, "the last speed is an old one"


def test_a_reading_that_came_to_stand_long_before_the_brake_closed_is_told_with_its_last_speed():
    stop = Stop()
    stop.scan(2, state=OFF, counts=100)
    stop.scan(5, counts=101, deg_s=-2.5)
    stop.scan(6, deg_s=0.0)
    stop.scan(200, brake_open=False)
    stop.scan(300, over=True)
    told = stop.parts.alarms.active[Code.ENC_02].values
    assert told["measured"].values["value"] == approx(2.5)
    assert told["time_ms"] == approx(295.0)
    assert stop.parts.feedback.in_doubt


def test_rest_counts_from_when_the_speed_is_known():
    stop = Stop()
    stop.parts.feedback._speed_age = stop.parts.feedback.age = 30
    stop.scan(1, deg_s=0.0)
    stop.parts.feedback._speed_age = stop.parts.feedback.age = 0
    stop.scan(400, deg_s=0.0)
    stop.scan(500, over=True, state=OFF, brake_open=False)
    assert stop.value(W.AT_REST_AFTER, "time_ms") == approx(400.0)


@pytest.mark.parametrize("unknown", [False, True])
def test_torque_whose_end_nobody_saw_has_no_time(unknown):
    stop = Stop()
    if unknown:
        stop.scan(1, state=DriveState.UNKNOWN, deg_s=0.0)
        stop.parts.feedback._was_energised = True
        stop.scan(2)
    stop.parts.feedback._was_energised = False
    stop.scan(3, state=OFF, brake_open=False, deg_s=0.0)
    stop.scan(4, over=True)
    assert (W.TORQUE_OFF_SEEN in stop.steps) is unknown
    assert (W.TORQUE_OFF_AFTER in stop.steps) is not unknown


@pytest.mark.parametrize(("periods", "seen"), [([1, 3], False), ([1, 4], True), ([100, 1], False)])
def test_what_ended_while_the_controller_stood_still_has_no_time(periods, seen):
    """Three scans are what a time may be late by; what is still on after the gap is seen to end."""
    stop = Stop()
    stop.scan(1, periods=periods[0])
    stop.scan(300, periods=periods[1], state=OFF, brake_open=False, deg_s=0.0)
    stop.scan(301, over=True, periods=1)
    assert (W.TORQUE_OFF_SEEN in stop.steps) is (W.BRAKE_CLOSED_SEEN in stop.steps) is seen
    assert (W.TORQUE_OFF_AFTER in stop.steps) is (W.BRAKE_CLOSED_AFTER in stop.steps) is not seen


@pytest.mark.parametrize(
    ("spoilt", "known"),
    [({}, True), ({"in_doubt": True}, False), ({"_old": True}, False)],
)
def test_where_it_came_to_rest_is_told_only_of_an_angle_that_was_known_all_the_time(spoilt, known):
    stop = Stop()
    # Doubt at any time; an old reading at the end.
    stop.scan(1, deg_s=0.0, **({"in_doubt": True} if "in_doubt" in spoilt else {}))
    stop.scan(2, in_doubt=False)
    stop.scan(3, over=True, state=OFF, brake_open=False, **{k: v for k, v in spoilt.items() if k == "_old"})
    assert (W.MOVED_TO in stop.steps) is known
    assert (W.ANGLE_UNKNOWN in stop.steps) is not known
    assert (W.AT_REST_AFTER in stop.steps) is known


@PERIODS
@pytest.mark.parametrize(
    ("changed", "doubted"),
    [
        ({}, True),
        ({"closed_s": 0.04}, False),  # a contact may be so late
        ({"off_s": 0.06}, False),  # until then torque held the shaft
        ({"off_s": math.inf}, False),  # and it still does
        ({"counts_end": 1.0}, False),  # it moves as the load swings on
        ({"slow_s": 0.05}, False),  # friction may have stopped it
        ({"reaction": Reaction.QUICK_STOP}, False),
        ({"unheard": True}, False),  # nobody knows since when the brake is closed
    ],
)
def test_a_reading_that_stands_at_once_long_before_the_brake_closes_is_frozen(period_s, changed, doubted):
    at = {
        "closed_s": 0.1,
        "off_s": 0.0,
        "counts_end": 0.0,
        "slow_s": 0.0,
        "reaction": Reaction.TORQUE_OFF,
    } | changed
    stop = Stop(at["reaction"], period_s, before={"brake_open": True})
    feedback, end = stop.parts.feedback, round(0.4 / period_s)
    for scan in range(1, end + 1):
        time_s = (scan - 1) * period_s
        feedback.counts = 5000.0 + (min(time_s, at["slow_s"]) if scan < end else at["counts_end"])
        feedback.brake_contact = not (at.get("unheard") and scan == 1)
        stop.scan(
            scan,
            over=scan == end,
            state=ON if time_s < at["off_s"] else OFF,
            brake_open=time_s < at["closed_s"],
            deg_s=0.3 if scan == 1 else 0.0,
        )
    assert feedback.in_doubt is doubted
    assert (W.ANGLE_UNKNOWN in stop.steps) is doubted


@PERIODS
@pytest.mark.parametrize(
    ("reaction", "state", "told_s"),
    [(Reaction.QUICK_STOP, ON, 3.5), (Reaction.QUICK_STOP, OFF, 3.5), (Reaction.TORQUE_OFF, ON, 0.5),
     (Reaction.TORQUE_OFF, OFF, 0.95), (Reaction.HOLD, ON, math.inf)],
)  # fmt: skip
def test_a_stop_that_takes_too_long_is_told_before_it_ends(period_s, reaction, state, told_s):
    """A quick stop from 3 deg/s with 6 deg/s2 has half a second of ramp.

    A brake of 0.15 s has slowed the shaft after a swing of 0.5 s, and 0.3 s of rest have shown.
    """
    stop = Stop(reaction, period_s, dec=6.0)
    before = stop.alarm.steps
    seconds = math.inf
    for scan in range(1, round(5.0 / period_s)):
        if stop.scan(scan, state=state) is not before:
            seconds = scan * period_s
            break
    assert seconds == (math.inf if told_s == math.inf else approx(told_s + period_s, abs=1.01 * period_s))
    if seconds < math.inf:
        assert seconds > told_s - 1e-9
        assert stop.steps == [W.STOP_UNCONFIRMED]


@pytest.mark.parametrize(
    ("before", "said", "nothing"),
    [
        ({"state": OFF, "brake_open": False}, {"phase": PowerPhase.OFF, "brake_open": False}, True),
        ({"state": ON, "brake_open": False}, {"phase": PowerPhase.OFF, "brake_open": False}, False),
        ({"state": OFF, "brake_open": True}, {"phase": PowerPhase.OFF, "brake_open": False}, False),
        ({"state": OFF, "brake_open": False}, {"phase": PowerPhase.OFF, "brake_open": True}, False),
        ({"state": OFF, "brake_open": False}, {"phase": PowerPhase.PROVING, "brake_open": False}, False),
        # A drive that owns its brake gives torque before it shows Operation enabled.
        (
            {"state": DriveState.SWITCHED_ON, "brake_open": False},
            {"phase": PowerPhase.ENABLING, "brake_open": False},
            False,
        ),
        (
            {"state": DriveState.SWITCHED_ON, "brake_open": False},
            {"phase": PowerPhase.OFF, "brake_open": False},
            True,
        ),
        ({"state": OFF, "brake_open": False}, {"phase": PowerPhase.ENABLING, "brake_open": False}, True),
    ],
)
def test_nothing_was_switched_on_only_where_neither_torque_nor_brake_was(before, said, nothing):
    stop = Stop(before=before, **said)
    stop.scan(0, deg_s=0.0)
    stop.scan(1, over=True, state=OFF, brake_open=False)
    assert (stop.steps == [W.NOTHING_ON]) is nothing


@pytest.mark.parametrize(
    ("reaction", "before", "told"),
    [
        (Reaction.TORQUE_OFF, {"state": ON, "brake_open": False}, W.TORQUE_UNCONFIRMED),
        (Reaction.TORQUE_OFF, {"state": OFF, "brake_open": True}, W.BRAKE_COMMANDED),
        (Reaction.HOLD, {"state": OFF, "brake_open": False}, W.TORQUE_KEPT),
    ],
)
def test_one_thing_that_was_not_shown_is_told_of_an_axis_that_stood(reaction, before, told):
    stop = Stop(reaction, before=before, phase=PowerPhase.OFF, brake_open=False)
    stop.scan(0, deg_s=0.0)
    stop.scan(1, over=True)
    assert stop.steps[0] is told


def test_nothing_was_switched_on_is_not_told_of_an_axis_that_has_turned():
    stop = Stop(before={"state": OFF, "brake_open": False}, phase=PowerPhase.OFF, brake_open=False)
    # Of an angle in doubt rest is not told either.
    stop.scan(0, deg_s=0.5, in_doubt=True)
    stop.scan(1, over=True, deg_s=0.0)
    assert stop.steps == [W.ANGLE_UNKNOWN]


def test_nobody_is_told_to_press_the_emergency_stop_on_a_load_that_torque_holds():
    """The brake does not hold it: the load is caught at up to 0.21 deg/s, and the emergency stop would let it go."""
    stop = Stop(Reaction.HOLD)
    stop.scan(1, deg_s=0.2, brake_open=False)
    stop.scan(2, over=True)
    assert stop.steps == [W.TORQUE_KEPT, W.MOVED_TO]


def test_the_speed_of_an_axis_whose_angle_is_in_doubt_is_not_told():
    stop = Stop()
    stop.scan(1, in_doubt=True)
    stop.scan(2, over=True, state=OFF, brake_open=False)
    assert stop.steps == [W.STOP_UNCONFIRMED, W.ANGLE_UNKNOWN]


def test_a_hold_keeps_its_torque_and_tells_no_end_of_it():
    stop = Stop(Reaction.HOLD)
    stop.scan(1, deg_s=0.0, state=OFF, brake_open=False)
    stop.scan(2, over=True)
    assert stop.steps[0] is W.TORQUE_KEPT
    assert not {W.TORQUE_OFF_AFTER, W.BRAKE_CLOSED_AFTER, W.STOP_UNCONFIRMED} & set(stop.steps)


# --- reset ------------------------------------------------------------------------------------------------------------


def recovery(period_s=0.001, **said):
    parts = Parts(period_s)
    parts.alarms.scan = 10
    stand_in = power(falling=False, **said)
    return parts, stand_in, Recovery(parts.settings, parts.feedback, stand_in, parts.alarms)


def raised(parts, code, reaction=None, **values):
    parts.alarms.raise_(code, reaction, **values)
    parts.alarms.scan += 1


def inputs(code, open_inputs, **values):
    """An alarm of an input, and inputs that are open now."""

    def spoil(parts, _):
        raised(parts, code, **(values or {"measured": "a test"}))
        parts.feedback.inputs = open_inputs

    return spoil


def encoder_alarm(parts, _):
    raised(parts, Code.ENC_05)
    parts.feedback.encoder_alarm = True


DIFFER = {"time_ms": 1.0, "limit": 1.0}
# Whether service opens it, what it is, and a word of the refusal.
CAUSES = {
    "falling": (False, lambda _, power: setattr(power, "falling", True), "stopping"),
    "just raised": (False, lambda parts, _: parts.alarms.raise_(Code.CTL_02, measured="a test"), "CTL-02"),
    "lock": (True, lambda parts, _: raised(parts, Code.BRK_03, measured=0.03, limit=0.02), "service role only"),
    "doubt": (True, lambda parts, _: setattr(parts.feedback, "in_doubt", True), "position"),
    "chain": (False, inputs(Code.INT_03, DigitalInputs(estop_ok=False)), "emergency-stop"),
    "second channel": (False, inputs(Code.INT_03, DigitalInputs(estop_ok_2=False)), "emergency-stop"),
    "channels": (
        False, inputs(Code.INT_04, DigitalInputs(estop_ok=False, estop_ok_2=True), **DIFFER), "channels"
    ),
    "collision": (False, inputs(Code.INT_01, DigitalInputs(collision_ok=False)), "collision"),
    "permit": (False, inputs(Code.INT_08, DigitalInputs(motion_permit=False)), "permit"),
    "door": (False, inputs(Code.INT_07, DigitalInputs(door_ok=False)), "door"),
    "encoder": (False, encoder_alarm, "alarm"),
}  # fmt: skip


@pytest.mark.parametrize("service", [False, True])
@pytest.mark.parametrize("name", CAUSES)
def test_each_cause_keeps_a_reset_back_and_service_opens_lock_and_doubt_alone(name, service):
    opened_by_service, spoil, words = CAUSES[name]
    parts, stand_in, reset = recovery()
    spoil(parts, stand_in)
    refused = reset.request(service)
    if service and opened_by_service:
        assert refused is None
        assert reset.resetting
        assert reset.service
        return
    assert refused is not None
    assert not reset.resetting
    assert not stand_in.fault_reset
    if not (name == "encoder" and not service):
        assert words in refused.text.lower() or words in refused.text


@pytest.mark.parametrize(
    ("code", "inputs"),
    [
        (Code.INT_01, DigitalInputs(door_ok=False, motion_permit=False)),
        (Code.INT_07, DigitalInputs(collision_ok=False, motion_permit=False)),
        (Code.INT_08, DigitalInputs(collision_ok=False, door_ok=False)),
        (Code.CTL_02, DigitalInputs(collision_ok=False, door_ok=False, motion_permit=False, estop_ok=False)),
    ],
)
def test_an_input_keeps_back_the_reset_of_its_own_alarm_alone(code, inputs):
    parts, _, reset = recovery()
    raised(parts, code, measured="a test")
    parts.feedback.inputs = inputs
    assert reset.request(service=True) is None


def test_an_encoder_whose_alarm_has_gone_is_reset_by_service_while_another_keeps_its_own():
    parts, _, reset = recovery()
    parts.feedback.encoder_alarm = True
    raised(parts, Code.CTL_02, measured="a test")
    assert reset.request(service=True) is None
    parts.alarms.clear()
    raised(parts, Code.ENC_05)
    parts.feedback.encoder_alarm = False
    assert reset.request(service=True) is None


@PERIODS
def test_a_drive_has_a_second_to_clear_its_fault(period_s):
    parts, stand_in, reset = recovery(period_s)
    parts.feedback.state = DriveState.FAULT
    assert reset.finished() is False, "nobody has asked"
    assert reset.request(service=False) is None
    assert stand_in.fault_reset
    seconds = parts.after(reset.finished, lambda: not reset.resetting, 2.0)
    assert seconds == approx(1.0 + period_s)
    assert reset.failure is not None
    assert not stand_in.fault_reset
    # Once more, and the drive clears it: that is told once.
    assert reset.request(service=True) is None
    assert reset.failure is None
    assert not reset.finished()
    parts.feedback.state = OFF
    stand_in.fault_reset = True
    assert reset.finished()
    assert not reset.resetting
    assert not stand_in.fault_reset
    assert reset.failure is None
    assert not reset.finished()


def test_a_fault_that_a_lost_drive_shows_when_it_answers_again_is_reset_too():
    parts, stand_in, reset = recovery()
    assert reset.request(service=False) is None
    assert not stand_in.fault_reset
    parts.feedback.state = DriveState.FAULT
    assert not reset.finished()
    assert stand_in.fault_reset


def test_missed_scans_are_time_of_a_reset():
    parts, _, reset = recovery(0.010)
    parts.feedback.state = DriveState.FAULT
    reset.request(service=False)
    parts.feedback.periods = 10
    assert parts.after(reset.finished, lambda: not reset.resetting, 2.0) == approx(in_scans(0.1, 0.01) + 0.01)


def test_a_new_alarm_ends_a_reset_under_way_and_is_followed_from_its_own_start():
    parts, stand_in, reset = recovery()
    parts.feedback.state = DriveState.FAULT
    reset.request(service=False)
    parts.alarms.raise_(Code.CTL_02, Reaction.TORQUE_OFF, measured="a test")
    reset.stop_begun(parts.alarms.first_out)
    assert not reset.resetting
    assert not stand_in.fault_reset
    first = reset._record
    reset.stop_begun(parts.alarms.first_out)
    assert reset._record is first, "the same stop"
    parts.alarms.clear()
    parts.alarms.raise_(Code.CTL_05, measured=1.0, command=1.0, limit=1.0)
    reset.stop_begun(parts.alarms.first_out)
    assert reset._record is not first


def test_each_reset_has_its_own_role_and_its_own_second():
    parts, _, reset = recovery()
    parts.feedback.state = DriveState.FAULT
    for service in (True, False):
        assert reset.request(service) is None
        assert reset.service is service
        assert parts.after(reset.finished, lambda: not reset.resetting, 2.0) == approx(1.001)


@pytest.mark.parametrize(
    ("reaction", "state", "last"),
    [(Reaction.QUICK_STOP, OFF, 3500), (Reaction.TORQUE_OFF, ON, 500), (Reaction.TORQUE_OFF, OFF, 950)],
)
def test_a_stop_may_take_its_whole_time_to_the_scan(reaction, state, last):
    stop = Stop(reaction, dec=6.0)
    stop.scan(1, state=state)
    assert W.STOP_UNCONFIRMED not in stop.scan(last)
    assert W.STOP_UNCONFIRMED in stop.scan(last + 1)


@pytest.mark.parametrize(
    ("brake", "start_deg_s", "now_deg_s", "told_s"),
    [
        # 0.15 s of brake, 0.5 s of swing, 0.3 s of rest; 1 deg/s of 3 is left: 2 / 5.8 s more.
        ({}, 3.0, 1.0, 0.95 + 0.3448),
        ({}, -3.0, -1.0, 0.95 + 0.3448),
        ({}, 3.0, 0.0, 0.95 + 0.5172),
        ({}, 3.0, 3.2, 0.95),
        # No sound axis is faster than the trip of 6.6 deg/s.
        ({}, math.nan, 0.0, 0.95 + 1.1379),
        ({}, 1e9, 0.0, 0.95 + 1.1379),
        # A crane: 10 deg of 3.6 deg/s behind a brake of 0.4 s, which swings at 0.65 Hz.
        ({"dec": 0.757, "close_s": 0.4, "swing_s": 1.54}, 3.6, 1.1, 2.24 + 3.3025),
        ({"dec": 0.757, "close_s": 0.4, "swing_s": 1.54}, 3.6, 3.6, 2.24),
    ],
)
def test_a_stop_by_the_brake_is_overdue_by_what_it_has_slowed(brake, start_deg_s, now_deg_s, told_s):
    stop = Stop(before={"vel_rad_s": rad(start_deg_s)}, **brake)
    stop.scan(1, state=OFF, deg_s=now_deg_s)
    last = math.floor(1e3 * told_s)
    assert W.STOP_UNCONFIRMED not in stop.scan(last)
    assert W.STOP_UNCONFIRMED in stop.scan(last + 2)


@pytest.mark.parametrize(("swing_s", "told_s"), [(0.5, 2.0), (1.75, 2.2)])
def test_a_stop_by_the_brake_whose_speed_nobody_reads_is_told_in_two_seconds(swing_s, told_s):
    """Nothing shows that the brake slows it; but nobody is told before a slow axis could have stopped."""
    stop = Stop(swing_s=swing_s)
    stop.parts.feedback.age = stop.parts.feedback._speed_age = 100
    stop.scan(1, state=OFF)
    assert W.STOP_UNCONFIRMED not in stop.scan(round(1e3 * told_s) - 1)
    assert W.STOP_UNCONFIRMED in stop.scan(round(1e3 * told_s) + 2)


@pytest.mark.parametrize(
    ("dec", "read_rad_s", "told_s"),
    [(0.6, rad(3.0), 8.0), (0.6, rad(-3.0), 8.0), (6.6, math.nan, 4.0), (6.6, 1e9, 4.0)],
)
def test_a_quick_stop_is_overdue_behind_its_own_ramp(dec, read_rad_s, told_s):
    """From 3 deg/s with 0.6 deg/s2, as a crane stops, 5 s; nobody waits for a speed above the trip of 6.6 deg/s."""
    stop = Stop(Reaction.QUICK_STOP, dec=dec, before={"vel_rad_s": read_rad_s})
    stop.scan(1, state=ON)
    assert W.STOP_UNCONFIRMED not in stop.scan(round(1e3 * told_s) - 1)
    assert W.STOP_UNCONFIRMED in stop.scan(round(1e3 * told_s) + 2)


def test_a_stop_in_the_first_scan_of_all_is_told_with_its_times():
    """Scan 0 is a scan like any other."""
    stop = Stop()
    stop.scan(0, state=OFF, brake_open=False, deg_s=0.0)
    stop.scan(1, over=True)
    assert stop.steps == [W.TORQUE_OFF_AFTER, W.BRAKE_CLOSED_AFTER, W.MOVED_TO]


def test_a_drive_that_was_being_enabled_and_is_off_gives_no_torque_any_more():
    """In Switched on it may have given torque already; off it gives none."""
    on = {"state": DriveState.SWITCHED_ON, "brake_open": False}
    stop = Stop(before=on, phase=PowerPhase.ENABLING, brake_open=False)
    stop.scan(1, deg_s=0.0, **on)
    stop.scan(5, state=OFF)
    stop.scan(6, over=True)
    assert W.TORQUE_OFF_AFTER in stop.steps
    assert stop.value(W.TORQUE_OFF_AFTER, "time_ms") == approx(5.0)
