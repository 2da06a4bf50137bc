"""Stops by the drive alone, by hand: ways, ramps, and what a silent controller's drive must show."""

from __future__ import annotations

import math
from collections.abc import Iterator
from contextlib import contextmanager
from types import SimpleNamespace
from typing import Any

import pytest

from gantryctl.commissioning import steps_lacks, steps_motion
from gantryctl.commissioning.results import Figure, Outcome, StepResult
from gantryctl.commissioning.stopping import silence, steps_silence
from gantryctl.commissioning.stopping.quick_stop import (
    QuickStop,
    _deceleration,
    computed_way_deg,
    measure_quick_stop,
    permitted_way_deg,
)
from gantryctl.commissioning.watch import Halt, StepStopped
from gantryctl.drives.od.verdicts import ParameterVerdict
from gantryctl.errors import AlarmStop, DeviceError
from gantryctl.image import DriveRequest, DriveState
from gantryctl.operation.client import Stop
from gantryctl.runtime.recorder import MemoryRecorder
from unit.commissioning.hand_drive import (
    PERIOD_S,
    HandDrive,
    axis_of,
    context,
    enabled,
    opens,
)

pytestmark = pytest.mark.can

ENABLE, S = DriveRequest.ENABLE, DriveState


# --- quick stop -------------------------------------------------------------------------------------------------------


def test_the_way_of_a_stop() -> None:
    """v^2 / 2a: 36 / 10.8 deg from 6 deg/s; 60 ms of reaction, and 50 ms of silence, at 6 deg/s."""
    assert computed_way_deg(6.0, 5.4) == pytest.approx(3.3333, abs=1e-4)
    assert computed_way_deg(-6.0, 5.4, 0.05) == pytest.approx(3.6333, abs=1e-4)
    assert permitted_way_deg(-6.0, 5.4) == pytest.approx(3.6933, abs=1e-4)
    assert permitted_way_deg(6.0, 5.4, 0.05) == pytest.approx(3.9933, abs=1e-4)


def stopped(speed: float, **what: Any) -> QuickStop:
    _, axis = enabled(**what)
    axis.ramp_to(speed, 5.0)
    axis.run(0.1, speed_deg_s=speed)
    return measure_quick_stop(axis, speed, 5.4)


@pytest.mark.parametrize("speed", [1.0, -1.0, 3.0])
@pytest.mark.parametrize("dec", [5.4, 8.0])
def test_a_quick_stop_has_its_way_and_its_ramp(speed: float, dec: float) -> None:
    seen = stopped(speed, quick_dec=dec)
    assert seen.way_deg == pytest.approx(speed * speed / (2.0 * dec), abs=abs(speed) * PERIOD_S)
    assert seen.dec_deg_s2 == pytest.approx(dec, rel=0.01)
    # One scan in the 0.7 of the speed over which the ramp is fitted.
    assert seen.uncertainty_deg_s2 == pytest.approx(dec * PERIOD_S / (0.7 * abs(speed) / dec), rel=0.02)


@pytest.mark.parametrize("speed", [1.0, -3.0])
@pytest.mark.parametrize(
    ("what", "words"),
    [
        ({"quick_dec": 2.0}, "is too long"),
        ({"quick_dec": 0.0}, "is too long"),
        ({"obeys": False}, "still operation enabled"),
        ({"quick_state": S.SWITCH_ON_DISABLED}, "left its quick stop for switch on disabled"),
        ({"quick_state": S.FAULT}, "left its quick stop for fault"),
    ],
)
def test_a_quick_stop_that_is_none_is_broken_off(speed: float, what: dict[str, Any], words: str) -> None:
    with pytest.raises(AlarmStop, match=words):
        stopped(speed, **what)


@pytest.mark.parametrize("way", [1.0, -1.0])
@pytest.mark.parametrize(
    ("speed", "left_at", "stops"),
    [(3.0, 0.7, False), (3.0, 0.8, True), (0.3, 0.09, False), (0.3, 0.11, True)],
)
def test_a_drive_may_leave_its_quick_stop_when_it_hardly_turns(
    way: float, speed: float, left_at: float, stops: bool
) -> None:
    """At a quarter of its speed, and at 0.1 deg/s of a slow one."""
    drive, axis = enabled()
    axis.ramp_to(way * speed, 5.0)
    drive.spoil = lambda seen: seen._replace(
        state=S.SWITCH_ON_DISABLED if abs(drive.speed) <= left_at else S.QUICK_STOP_ACTIVE,
        vel_act_rad_s=math.radians(math.copysign(max(abs(drive.speed), left_at), way)) * 1144,
    )
    if stops:
        with pytest.raises(AlarmStop, match="left its quick stop"):
            measure_quick_stop(axis, way * speed, 5.4)
    else:
        measure_quick_stop(axis, way * speed, 5.4)


@pytest.mark.parametrize("speed", [1.0, -1.0])
def test_a_drive_that_turns_round_in_its_quick_stop_does_not_stand(speed: float) -> None:
    """It leaves its quick stop at 0.5 deg/s the other way, within the way that is permitted."""
    drive, axis = enabled()
    axis.ramp_to(speed, 5.0)
    drive.spoil = lambda seen: seen._replace(
        state=S.SWITCH_ON_DISABLED if abs(drive.speed) <= 0.1 else S.QUICK_STOP_ACTIVE,
        vel_act_rad_s=math.radians(-0.5 * speed) * 1144 if abs(drive.speed) <= 0.1 else seen.vel_act_rad_s,
    )
    with pytest.raises(AlarmStop, match=r"left its quick stop for switch on disabled at 0\.50 deg/s"):
        measure_quick_stop(axis, speed, 5.4)


@pytest.mark.parametrize(("scans", "obeyed"), [(5, True), (6, False)])
def test_a_quick_stop_may_show_five_scans_after_its_command(scans: int, obeyed: bool) -> None:
    """At the next SYNC it acts, at the one after it shows, and two scans more are granted."""
    drive, axis = enabled()
    drive.spoil = lambda seen: seen._replace(
        state=S.OPERATION_ENABLED
        if sum(output.request is DriveRequest.QUICK_STOP for output in drive.wrote) <= scans
        else S.QUICK_STOP_ACTIVE
    )
    if obeyed:
        measure_quick_stop(axis, 0.3, 5.4)
    else:
        with pytest.raises(AlarmStop, match="is not obeyed"):
            measure_quick_stop(axis, 0.3, 5.4)


def test_a_ramp_of_three_scans_is_not_measured() -> None:
    assert math.isnan(stopped(1.0, quick_dec=200.0).dec_deg_s2)


@pytest.mark.parametrize(("within", "measured"), [([8.0, 6.0], False), ([8.0, 6.0, 4.0], True)])
def test_a_ramp_needs_three_scans_between_its_ends(within: list[float], measured: bool) -> None:
    """Below 9 and above 2 of 10 deg/s."""
    assert math.isfinite(_deceleration([10.0, *within, 1.0, 0.0], 10.0, 1.0)) is measured


@pytest.mark.parametrize(("dec", "passes"), [(5.4, True), (6.0, True), (7.0, False), (300.0, False)])
def test_a_quick_stop_harder_than_the_checked_one_fails(
    monkeypatch: pytest.MonkeyPatch, dec: float, passes: bool
) -> None:
    """1.15 times 5.4 deg/s2 and the uncertainty of the measurement."""
    drive = HandDrive(quick_dec=dec)
    monkeypatch.setattr(steps_motion, "open_loop_axis", opens(drive))
    decs: list[float] = []
    if passes:
        what, measured, computed = steps_motion._quick_stop(context(), -3.0, decs)
        assert drive.ways == [-3.0]  # there it needs room
        assert (what, computed) == ("quick stop", pytest.approx(9.0 / 10.8, abs=1e-4))
        assert measured == pytest.approx(9.0 / (2.0 * dec), abs=0.012)
        assert decs == pytest.approx([dec], rel=0.01)
    else:
        with pytest.raises(AlarmStop, match="too hard"):
            steps_motion._quick_stop(context(), 3.0, decs)
        assert not decs


def test_what_is_still_at_nine_tenths_is_no_ramp_yet() -> None:
    """From 10 deg/s, a deg/s in a scan of a second; before it the drive hesitates."""
    speeds = [10.0, 9.0, 9.0, 9.0, 8.0, 7.0, 6.0, 5.0, 4.0, 3.0, 2.0, 1.0, 0.0]
    assert _deceleration(speeds, 10.0, 1.0) == pytest.approx(1.0, rel=1e-9)


def test_what_is_at_two_tenths_is_still_in_the_ramp() -> None:
    """8, 7, 6, 5, 4 and 2 deg/s: the line through all six falls by 20 / 17.5 in a scan."""
    assert _deceleration([10.0, 8.0, 7.0, 6.0, 5.0, 4.0, 2.0, 1.0], 10.0, 1.0) == pytest.approx(8.0 / 7.0)


def test_stops_go_forward_and_back_and_the_longest_is_told(monkeypatch: pytest.MonkeyPatch) -> None:
    """Quick stop forward and silence back, from 1 and from 3 deg/s; 0.833 deg from 3 deg/s were computed."""
    asked: list[tuple[str, float]] = []

    def stop(what: str) -> Any:
        def measure(c: Any, speed: float, decs: list[float]) -> tuple[str, float, float]:
            asked.append((what, speed))
            decs.append(5.0 + len(decs))
            return what, 0.25 * abs(speed), 0.25 * abs(speed)

        return measure

    monkeypatch.setattr(steps_motion, "_quick_stop", stop("quick stop"))
    monkeypatch.setattr(steps_motion, "_silent_stop", stop("silence"))
    monkeypatch.setattr(steps_motion, "_jog_release", lambda c, speed: 0.01)
    found = steps_motion.stops(context())
    assert asked == [("quick stop", 1.0), ("silence", -1.0), ("quick stop", 3.0), ("silence", -3.0)]
    assert (found.outcome, found.proof) == (Outcome.PASSED, "5 stops, largest 0.750 deg")
    assert found.number("slowest_ramp_deg_s2") == 5.0
    # 0.6 deg/s at 2 deg/s2 and 20 deg/s3: 0.3 s and 0.1 s of jerk, at half of it; 60 ms of reaction more may be.
    assert found.number("jog_release_0p6_computed_deg") == pytest.approx(0.12)
    assert found.figures["jog_release_0p6_measured_deg"].high == pytest.approx(0.156)


@pytest.mark.parametrize("stopped", [False, True])
def test_a_run_of_a_step_is_closed_with_what_stopped_it(
    monkeypatch: pytest.MonkeyPatch, stopped: bool
) -> None:
    """Powered down after its motion; an alarm holds the axis as it is."""
    did: list[object] = []
    run = SimpleNamespace(
        engine=SimpleNamespace(recorder=MemoryRecorder(["time_s", "pos_act_rad"])),
        power_down=lambda: did.append("down"),
        close=lambda what, alarm: did.append((what, alarm)),
    )
    monkeypatch.setattr(steps_motion, "AxisRun", lambda *_, **__: run)
    monkeypatch.setattr(steps_motion, "_samples", lambda _: [])
    alarm = AlarmStop("CAN-03")
    c = context()
    drawn: list[object] = []
    monkeypatch.setattr(c.watch, "draw", lambda *given: drawn.append(given))
    if stopped:
        with pytest.raises(AlarmStop), steps_motion._recorded_run(c, "there"):
            raise alarm
    else:
        with steps_motion._recorded_run(c, "there"):
            did.append("moved")
    # What moved has its picture, whatever ended it.
    assert drawn == [("there", [])]
    assert did == ([("commissioning", alarm)] if stopped else ["moved", "down", ("commissioning", None)])


def ramp_result(outcome: Outcome) -> StepResult:
    return StepResult("ramp", outcome, "", {steps_motion.RAMP_DEG_S2: Figure(3.0)})


def test_the_own_ramp_of_a_drive_counts_when_its_step_has_passed() -> None:
    assert steps_motion._ramp_deg_s2(context()) == 5.4
    assert steps_motion._ramp_deg_s2(context(ramp=ramp_result(Outcome.PASSED))) == 3.0
    assert steps_motion._ramp_deg_s2(context(ramp=ramp_result(Outcome.FAILED))) == 5.4


def test_a_watchdog_counts_when_its_step_has_passed() -> None:
    def shown(outcome: Outcome) -> StepResult:
        return StepResult("watchdog", outcome, "", {steps_motion.SILENT_STOP_S: Figure(0.1)})

    assert steps_motion._watchdog_s(context(watchdog=shown(Outcome.PASSED))) == 0.1
    for outcome in (Outcome.FAILED, Outcome.NOT_TESTABLE):
        with pytest.raises(AlarmStop, match="has not passed"):
            steps_motion._watchdog_s(context(watchdog=shown(outcome)))
    with pytest.raises(AlarmStop, match="has not passed"):
        steps_motion._watchdog_s(context())


# From the slowest to the fastest; no uncertainty.
@pytest.mark.parametrize(
    ("seen", "hardest"),
    [
        (((0.3, 5.0),), 5.0),
        (((0.3, 5.0), (0.6, 5.5), (1.0, 5.2)), 5.5),
        # A ramp of a fixed time: from 6 deg/s ten times as hard as from 0.6.
        (((0.3, 1.2), (0.6, 2.4)), 24.0),
        (((0.3, 1.2), (0.6, 1.6)), 1.6),
    ],
)
def test_the_ramp_to_be_expected_from_the_highest_speed(
    seen: tuple[tuple[float, float], ...], hardest: float
) -> None:
    ramps = [steps_lacks._Ramp(speed, QuickStop(0.0, dec, 0.0)) for speed, dec in seen]
    assert steps_lacks._at_top_deg_s2(ramps, 6.0) == pytest.approx(hardest)


@pytest.mark.parametrize(
    ("dec", "fits", "passes"), [(5.4, True, True), (5.4, False, False), (5.2, True, True), (5.0, True, False)]
)
def test_the_own_ramp_is_held_against_ratings_and_computed_stops(
    step: Any, monkeypatch: pytest.MonkeyPatch, dec: float, fits: bool, passes: bool
) -> None:
    """At least 0.95 of 5.4 deg/s2, and none that motor or reducer do not bear from 6 deg/s."""
    asked: list[float] = []

    def worst(machine: object, kind: object, top: float, hardest: float) -> SimpleNamespace:
        asked.append(hardest)
        return SimpleNamespace(torque_motor_nm=1.0, torque_reducer_nm=1.0)

    monkeypatch.setattr(steps_lacks, "worst_stop", worst)
    monkeypatch.setattr(steps_lacks, "within_ratings", lambda machine, stop: fits)
    drive = HandDrive(quick_dec=dec)
    found = step(steps_lacks, "ramp", drive)
    assert (found.outcome is Outcome.PASSED) is passes
    assert len(asked) == (5 if fits else 1)
    if fits:
        assert found.number(steps_lacks.RAMP_DEG_S2) == pytest.approx(dec, rel=0.02)


@pytest.mark.parametrize(
    ("decs", "slowest"),
    [((5.4, 5.2, 5.4, 5.4, 5.4), 5.2), ((5.4, 5.4, 5.4, 5.4, 5.2), 5.2), ((math.nan,), None)],
)
def test_the_slowest_ramp_counts_and_one_that_cannot_be_seen_fails(
    step: Any, monkeypatch: pytest.MonkeyPatch, decs: tuple[float, ...], slowest: float | None
) -> None:
    load = SimpleNamespace(torque_motor_nm=1.0, torque_reducer_nm=1.0)
    monkeypatch.setattr(steps_lacks, "worst_stop", lambda machine, kind, top, hardest: load)
    monkeypatch.setattr(steps_lacks, "within_ratings", lambda machine, stop: True)
    left = list(decs)
    monkeypatch.setattr(steps_lacks, "_stop_from", lambda c, speed: QuickStop(1.0, left.pop(0), 0.0))
    found = step(steps_lacks, "ramp", HandDrive())
    if slowest is None:
        assert (found.outcome, "within three scans" in found.proof) == (Outcome.FAILED, True)
    else:
        assert found.number(steps_lacks.RAMP_DEG_S2) == slowest


@pytest.mark.parametrize(("state", "stopped"), [(S.SWITCH_ON_DISABLED, True), (S.OPERATION_ENABLED, False)])
def test_a_drive_alone_has_as_long_as_its_quickest_watch_and_must_stop(
    monkeypatch: pytest.MonkeyPatch, state: DriveState, stopped: bool
) -> None:
    """5.4 deg/s2 from 1 deg/s, after the shorter one of 0.05 and 0.15 s."""
    asked: list[float] = []
    did: list[object] = []

    @contextmanager
    def at_speed(c: object, what: str, speed: float, way_deg: float) -> Iterator[SimpleNamespace]:
        did.append(("leash", way_deg))
        yield SimpleNamespace(drive=None, wake=lambda: did.append("awake"))

    def fall(axis: object, silent: silence.Silence, speed: float) -> silence.SilentDrive:
        did.append((silent.ways, silent.limit_s, silent.way_deg, silent.ramp_s, speed))
        return seen

    def computed(machine: object, speed: float, delay_ms: float, *, dec_deg_s2: float) -> float:
        asked.append((delay_ms, dec_deg_s2))
        return 0.1

    ways = [SimpleNamespace(limit_s=lambda drive, s=s: s) for s in (0.15, 0.05)]
    monkeypatch.setattr(steps_motion, "_ramp_deg_s2", lambda c: 5.4)
    monkeypatch.setattr(steps_motion, "_at_speed", at_speed)
    monkeypatch.setattr(steps_motion, "watched_ways", lambda axis: ways)
    monkeypatch.setattr(steps_motion, "silent_way_deg", computed)
    seen = silence.SilentDrive(state=state, brake_open=False, way_deg=0.08)
    monkeypatch.setattr(steps_motion, "fall_silent", fall)
    if stopped:
        assert steps_motion._silent_stop(context(), -1.0, []) == ("silence", 0.08, 0.1)
    else:
        with pytest.raises(AlarmStop, match="silence at 1 deg/s"):
            steps_motion._silent_stop(context(), -1.0, [])
    assert asked == [(50.0, 5.4)]
    # 60 ms of reaction at 1 deg/s more than computed, and 1 / 5.4 s of ramp; the fault is cleared behind a stop.
    permitted = (tuple(silence.Way), 0.05, pytest.approx(0.16), pytest.approx(0.18519, abs=1e-5), -1.0)
    # The leash is no part of the proof: 4 deg, in which the room wants the gantry to stop.
    leash = ("leash", 4.0)
    assert did == [leash, permitted, *(["awake"] if stopped else [])]


@pytest.mark.parametrize("speed", [1.0, -3.0])
def test_a_stop_by_a_watchdog_has_the_time_of_its_step_and_the_brake_alone(
    monkeypatch: pytest.MonkeyPatch, speed: float
) -> None:
    """The torque is gone with the relay: no ramp, and 0.1 s of the step are 100 ms."""
    asked: list[object] = []

    @contextmanager
    def at_speed(*_: object) -> Iterator[SimpleNamespace]:
        yield SimpleNamespace(drive=None, wake=lambda: None)

    def way(machine: object, speed: float, delay_ms: float, *, brake: bool) -> float:
        asked.append((speed, delay_ms, brake))
        return 0.5

    def fall(axis: object, silent: silence.Silence, speed: float) -> silence.SilentDrive:
        asked.append((silent.limit_s, silent.way_deg))
        return silence.SilentDrive(state=S.FAULT, brake_open=False, way_deg=0.4)

    for name, stand_in in (
        ("_at_speed", at_speed), ("watched_ways", lambda axis: ()), ("fall_silent", fall), ("silent_way_deg", way),
    ):  # fmt: skip
        monkeypatch.setattr(steps_motion, name, stand_in)
    passed = StepResult("watchdog", Outcome.PASSED, "", {steps_motion.SILENT_STOP_S: Figure(0.1)})
    assert steps_motion._silent_stop(context(watchdog=passed), speed, []) == ("silence", 0.4, 0.5)
    assert asked == [(speed, 100.0, True), (0.1, pytest.approx(0.5 + 0.06 * abs(speed)))]


# --- silence ----------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("state", S)
@pytest.mark.parametrize("brake_open", [True, False])
@pytest.mark.parametrize("broken_off", ["", "still operation enabled"])
def test_a_drive_has_stopped_when_it_is_off_and_braked_by_itself(
    state: DriveState, brake_open: bool, broken_off: str
) -> None:
    seen = silence.SilentDrive(state=state, brake_open=brake_open, broken_off=broken_off)
    assert seen.stopped is (state in (S.FAULT, S.SWITCH_ON_DISABLED) and not brake_open and not broken_off)


def test_each_way_has_its_object_and_its_time() -> None:
    settings = SimpleNamespace(rpdo_deadline_s=0.05, watch_s=0.15)
    drive: Any = SimpleNamespace(opened=SimpleNamespace(settings=settings))
    assert [(way.place, way.limit_s(drive)) for way in silence.Way] == [("1400:05", 0.05), ("1016:01", 0.15)]
    rows = [
        SimpleNamespace(place="1400:05", verdict=ParameterVerdict.ABSENT),
        SimpleNamespace(place="1016:01", verdict=ParameterVerdict.OK),
    ]
    axis: Any = SimpleNamespace(drive=SimpleNamespace(opened=SimpleNamespace(rows=rows)))
    assert silence.watched_ways(axis) == (silence.Way.HEARTBEAT,)


@pytest.mark.parametrize(
    ("contact", "state", "is_open"),
    [
        (True, S.FAULT, True), (False, S.FAULT, False), (False, S.OPERATION_ENABLED, False),
        (None, S.FAULT, False), (None, S.READY_TO_SWITCH_ON, False), (None, S.OPERATION_ENABLED, True),
        (None, S.FAULT_REACTION_ACTIVE, True),
        (DeviceError("no"), S.FAULT, True),
    ],
)  # fmt: skip
def test_a_brake_is_closed_when_something_says_so(contact: Any, state: DriveState, is_open: bool) -> None:
    def ask() -> Any:
        if isinstance(contact, Exception):
            raise contact
        return contact

    axis: Any = SimpleNamespace(drive=SimpleNamespace(beside=SimpleNamespace(ask_brake_contact=ask)))
    assert silence._brake_open(axis, state) is is_open


@pytest.mark.parametrize("speed", [1.0, -1.0])
@pytest.mark.parametrize(("way_deg", "after_scans"), [(0.05, 13), (0.034, 9)])
def test_a_gantry_that_turns_on_in_a_silence_is_broken_off_at_the_permitted_way(
    speed: float, way_deg: float, after_scans: int
) -> None:
    """1 deg/s is 0.004 deg in a scan: 13 of them are the first beyond 0.05 deg, 0.052 s after the last command. The
    limit of the drive's own watch, 0.05 s and what it takes to see it, is over after 0.076 s.
    """
    drive, axis = enabled()
    axis.ramp_to(speed, 5.0)
    axis.run(0.1, speed_deg_s=speed)
    drive.process.age, drive.process.statusword = 0, 0x1637  # Operation enabled, bit 12
    drive.node.emergencies = SimpleNamespace(count=0)
    before = len(drive.wrote)
    seen = silence.fall_silent(axis, silence.Silence((silence.Way.HEARTBEAT,), 0.05, way_deg), speed)
    assert seen.broken_off.startswith(f"moved {0.004 * after_scans:.3f} deg, {way_deg:.3f} deg are permitted")
    assert [output.request for output in drive.wrote[before:]].index(DriveRequest.DISABLE) == after_scans
    assert seen.way_deg == pytest.approx(0.004 * after_scans, abs=1e-6)
    assert not seen.stopped


@pytest.mark.parametrize("speed", [1.0, -1.0])
def test_a_drive_that_stays_enabled_in_a_silence_is_broken_off_when_its_time_is_over(speed: float) -> None:
    """0.05 s, four scans to see it and 10 ms: scan 20 is the first beyond 0.076 s."""
    drive, axis = enabled()
    axis.ramp_to(speed, 5.0)
    axis.run(0.1, speed_deg_s=speed)
    drive.process.age, drive.process.statusword = 0, 0x1637
    drive.node.emergencies = SimpleNamespace(count=0)
    seen = silence.fall_silent(axis, silence.Silence((silence.Way.HEARTBEAT,), 0.05, 1.0), speed)
    assert seen.broken_off.startswith("still operation enabled 80 ms")
    assert seen.way_deg == pytest.approx(0.08, abs=1e-6)


@pytest.mark.parametrize(
    ("turns_deg_s", "stops"), [(0.04, True), (-0.04, True), (0.06, False), (-0.06, False)]
)
@pytest.mark.parametrize(("ramp_s", "scans"), [(0.0, 357), (2.0, 857)])
def test_a_shaft_that_creeps_on_behind_its_brake_has_not_stopped(
    turns_deg_s: float, stops: bool, ramp_s: float, scans: int
) -> None:
    """0.05 deg/s of swing are rest. In its fault it has 0.076 s, its ramp, 0.35 s of rest and 1 s to come to rest."""
    drive, axis = enabled()
    drive.process.age, drive.process.statusword = 0, 0x0008  # Fault
    drive.node.emergencies = SimpleNamespace(count=0)
    drive.beside = SimpleNamespace(ask_brake_contact=lambda: False)  # type: ignore[attr-defined]
    drive.look = drive.read  # type: ignore[attr-defined]

    def write(output: Any) -> None:
        drive.wrote.append(output)
        drive.state, drive.brake_open = S.FAULT, False
        drive.deg += turns_deg_s * PERIOD_S

    drive.write = write  # type: ignore[method-assign]
    seen = silence.fall_silent(axis, silence.Silence((silence.Way.HEARTBEAT,), 0.05, 1.0, ramp_s))
    assert seen.stopped is stops
    if not stops:
        # 357 scans are the first beyond 1.426 s, 857 beyond 3.426 s.
        assert seen.broken_off.startswith(f"in fault after {1.4 + ramp_s:.1f} s")
        assert len(drive.wrote) > scans


@pytest.mark.parametrize("state", [S.SWITCHED_ON, S.READY_TO_SWITCH_ON, S.UNKNOWN])
def test_a_drive_that_is_neither_off_nor_in_its_fault_is_broken_off(state: DriveState) -> None:
    """At rest, braked, and one word from its torque: it has left Operation enabled, and not switched itself off."""
    drive, axis, _ = silent_fault()
    drive.state = state
    drive.process.statusword = {S.SWITCHED_ON: 0x23, S.READY_TO_SWITCH_ON: 0x21, S.UNKNOWN: 0x01}[state]
    drive.write = drive.wrote.append  # type: ignore[method-assign]
    seen = silence.fall_silent(axis, silence.Silence((silence.Way.HEARTBEAT,), 0.05, 1.0))
    assert not seen.stopped
    assert seen.broken_off.startswith(f"in {state.name.lower().replace('_', ' ')} after 1.4 s")


def test_what_a_sync_shows_right_after_the_limit_was_so_before() -> None:
    """A drive that answers no SDO in OPERATIONAL is looked at by SYNC when its time is over: 0.05 s, four scans and 10
    ms. It has been in its fault since before, and is not late.
    """
    drive, axis = enabled()
    drive.process.age, drive.process.statusword = 0, 0x0008  # Fault
    drive.node.emergencies = SimpleNamespace(count=0)
    drive.requests = SimpleNamespace(read=lambda *_: None)  # type: ignore[attr-defined]
    drive.beside = SimpleNamespace(ask_brake_contact=lambda: False)  # type: ignore[attr-defined]
    drive.look = drive.read  # type: ignore[attr-defined]
    drive.write = lambda output: None  # type: ignore[method-assign]
    drive.state, drive.brake_open = S.FAULT, False
    seen = silence.fall_silent(axis, silence.Silence((silence.Way.COMMANDS,), 0.05, 0.05))
    assert seen.stopped, seen
    assert seen.stopped_s == pytest.approx(0.05 + 4 * PERIOD_S + 0.01)


def silent_fault(halt: Halt | None = None) -> tuple[HandDrive, Any, list[int]]:
    """A drive in its fault from the first scan on, braked; every SDO request is written down."""
    drive = HandDrive()
    axis, asked = axis_of(drive, halt=halt), list[int]()
    drive.process.age, drive.process.statusword = 0, 0x0008
    drive.node.emergencies = SimpleNamespace(count=1)
    drive.requests = SimpleNamespace(read=lambda index, *_: asked.append(index))  # type: ignore[attr-defined]
    drive.beside = SimpleNamespace(ask_brake_contact=lambda: False)  # type: ignore[attr-defined]
    drive.look = drive.read  # type: ignore[attr-defined]
    drive.state, drive.brake_open = S.FAULT, False
    return drive, axis, asked


@pytest.mark.parametrize("complains", [True, False])
def test_a_complaint_of_before_is_none_of_the_silence(complains: bool) -> None:
    """The fifth scan of 4 ms brings one; the one before the silence counts nothing."""
    drive, axis, _ = silent_fault()
    scans = [0]

    def write(_: Any) -> None:
        scans[0] += 1
        drive.node.emergencies.count += complains and scans[0] == 5

    drive.write = write  # type: ignore[method-assign]
    seen = silence.fall_silent(axis, silence.Silence((silence.Way.HEARTBEAT,), 0.05, 0.05))
    assert seen.complained_s == pytest.approx(0.02 if complains else math.nan, nan_ok=True)


def test_without_sync_state_and_position_are_asked_for_in_turn() -> None:
    drive, axis, asked = silent_fault()
    drive.write = lambda output: None  # type: ignore[method-assign]
    silence.fall_silent(axis, silence.Silence((silence.Way.COMMANDS,), 0.05, 0.05))
    assert asked[:6] == [0x6041, 0x6064] * 3


def test_a_position_by_sdo_has_its_sign() -> None:
    """Behind 0 the drive counts backwards: -5 is FFFFFFFBh. An answer of another length does not count."""
    drive, axis, _ = silent_fault()
    taken: list[int] = []
    drive.process.counts, drive.process.take_position = 7, taken.append
    view = silence._View(axis)
    for data in (b"\xfb\xff\xff\xff", b"\x05\x00\x00\x00", b"\x05\x00", None):
        view._position(data)
    assert taken == [-5, 5]
    assert axis.feedback.pos_act_counts == 7


def test_a_contact_that_shows_open_while_the_drive_is_enabled_proves_no_watchdog(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """It is wired to something else, or open all the time. A machine without a contact goes on."""
    fell: list[object] = []
    seen = silence.SilentDrive(stopped_s=0.1, state=S.FAULT, brake_open=False)
    monkeypatch.setattr(steps_silence, "fall_silent", lambda *_: fell.append(1) or seen)
    dog = steps_silence._Watchdog("the relay", (), "")
    fall = steps_silence._Fall("watchdog", (silence.Way.HEARTBEAT,), 0.1)
    for contact, falls in ((False, 0), (True, 1), (None, 1)):
        fell.clear()
        drive, axis = enabled()
        inputs = SimpleNamespace(watchdog_contact=lambda contact=contact: contact)
        drive.beside = SimpleNamespace(inputs=inputs, ask_watchdog_contact=lambda: False)  # type: ignore[attr-defined]
        result, _ = steps_silence._fall(context(), axis, dog, fall, {}, [], own=False)
        assert len(fell) == falls
        assert (result is not None) is (contact is False)


def test_a_stop_is_heard_in_a_silence() -> None:
    halt = Halt()
    drive, axis, _ = silent_fault(halt)
    wrote = list[DriveRequest]()

    def write(output: Any) -> None:
        wrote.append(output.request)
        if len(wrote) == 5:
            halt.ask(Stop.RAMP, "stopped by anna")

    drive.write = write  # type: ignore[method-assign]
    with pytest.raises(StepStopped, match="stopped by anna"):
        silence.fall_silent(axis, silence.Silence((silence.Way.HEARTBEAT,), 0.05, 0.05))
    # In the very next scan torque off and brake are commanded.
    assert wrote[4:6] == [DriveRequest.ENABLE, DriveRequest.DISABLE]


@pytest.mark.parametrize(
    ("stopped_s", "brake_open", "passes"), [(0.07, False, True), (0.09, False, False), (0.07, True, False)]
)
def test_a_drive_that_stops_after_its_time_fails_its_silence(
    step: Any, monkeypatch: pytest.MonkeyPatch, stopped_s: float, brake_open: bool, passes: bool
) -> None:
    """0.05 s, four scans and 10 ms to see it: 76 ms. One that has not braked is not spoken to as if nothing were."""
    drive, resumed = HandDrive(), list[int]()
    drive.resume = lambda: resumed.append(1)  # type: ignore[method-assign]
    drive.settings.rpdo_deadline_s = 0.05
    seen = silence.SilentDrive(stopped_s=stopped_s, state=S.FAULT, brake_open=brake_open)
    monkeypatch.setattr(steps_silence, "fall_silent", lambda *_: seen)
    monkeypatch.setattr(steps_silence, "watched_ways", lambda axis: (silence.Way.COMMANDS,))
    monkeypatch.setattr(steps_silence, "_keep_proof", lambda c: None)
    found = step(steps_silence, "silence", drive)
    assert (found.outcome is Outcome.PASSED) is passes
    assert found.figures["process_data_ms"].high == pytest.approx(76.0)
    assert found.figures["process_data_moved_deg"].high == 0.05
    assert len(resumed) == (not brake_open)
