"""What steps of commissioning say, word by word: figures of which no two are alike, in their units and directions."""

from __future__ import annotations

import math
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from gantryctl.commissioning import STEPS, steps_bus, steps_lacks, steps_motion, steps_power, steps_sign
from gantryctl.commissioning.results import Figure, Outcome, StepResult
from gantryctl.commissioning.stopping import steps_silence
from gantryctl.commissioning.stopping.quick_stop import QuickStop
from gantryctl.commissioning.stopping.silence import SilentDrive
from gantryctl.drives.od.verdicts import ParameterVerdict
from gantryctl.errors import AlarmStop
from gantryctl.image import DriveState
from gantryctl.machine import with_values
from gantryctl.program import BrakeTestOutcome, BrakeTestResult
from gantryctl.program.alarms.words import Words
from unit.commissioning.hand_drive import MACHINE, HandDrive, answering, axis_of, context, opens

pytestmark = pytest.mark.can

ENCODER = {
    "inverted": False,
    "increments_per_turn": 524_288,
    "turns": 4096,
    "position_around_zero": False,
}


def test_sync_tells_the_middle_and_the_late_answers_and_the_time_of_a_command(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Scans of 4 ms; the drive shows a command in the first of them."""
    drive = HandDrive()
    answering(drive, 0.0035, *[0.001] * 99)
    monkeypatch.setattr(steps_bus, "open_loop_axis", opens(drive))
    proof = steps_bus.sync(context()).proof
    assert proof == "answers 1.00 ms after SYNC (p50), 3.50 ms (p99); a command shows 1 scans later (4 ms)"
    answering(drive, math.inf, *[0.001] * 99)
    assert "1.00 ms after SYNC (p50), over 2 ms (p99)" in steps_bus.sync(context()).proof


def test_a_push_tells_what_was_given_and_what_is_not_shown(step: Any) -> None:
    """0.6 of 70 N m less 14 N m of the load are asked for, 26 N m are given back."""
    drive: Any = HandDrive()
    drive.machine = with_values(MACHINE, {"can.torque_limit_in_drive_nm": 385.0})
    drive.spoil = lambda seen: seen._replace(torque_act_nm=max(seen.torque_act_nm, -26.0))
    held = {"plus_nm": Figure(70.0), "minus_nm": Figure(-70.0)}
    found = step(steps_lacks, "torque", drive, brake=StepResult("brake", Outcome.PASSED, "", held))
    assert found.proof == (
        "28.0 N m asked for against the closed brake, 26.0 and 28.0 N m given; limit of the drive as entered 385 N m, "
        "what lies above 26.0 N m is not shown"
    )


def test_a_ramp_tells_up_to_which_speed_it_was_seen(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(steps_lacks, "_stop_from", lambda c, speed: QuickStop(1.0, 5.5, 0.0))
    found = steps_lacks.ramp(context())
    assert found.proof == "5.50 deg/s2, seen up to 3 deg/s; the stops are computed with 5.4"


def test_friction_of_a_short_travel_is_told_in_kn_m(monkeypatch: pytest.MonkeyPatch) -> None:
    """5 kN m at the load, through 1144 turns of the motor; 100 deg are too little for the moment."""
    angle = np.radians(np.concatenate((np.arange(-48.0, 48.0), np.arange(48.0, -48.0, -1.0))))
    forward = np.repeat((1.0, -1.0), 96)
    trace = {
        "vel_ref_rad_s": np.radians(3.0) * forward, "pos_act_rad": angle, "pos_err_rad": 0.0 * angle,
        "torque_act_nm": 5000.0 / 1144.0 * forward,
    }  # fmt: skip

    @contextmanager
    def run(*_: object) -> Iterator[tuple[Any, Any]]:
        nothing = lambda *_: SimpleNamespace(done=True)  # noqa: E731
        run = SimpleNamespace(speed_max_deg_s=6.0, move=nothing, observe=nothing)
        yield run, SimpleNamespace(trace=lambda: trace)

    monkeypatch.setattr(steps_motion, "_recorded_run", run)
    monkeypatch.setattr(steps_motion, "reach_deg", lambda _: (-50.0, 50.0))
    assert steps_motion.slow_turn(context()).proof == (
        "friction 5.00 kN m at 3 deg/s; the travel is too short for the eccentric moment"
    )


def test_the_longest_stop_is_one_that_was_measured(monkeypatch: pytest.MonkeyPatch) -> None:
    """0.9 deg were computed for each, 0.4 measured."""
    stop = lambda c, speed, decs: ("quick stop", 0.4, 0.9)  # noqa: E731
    for name in ("_quick_stop", "_silent_stop"):
        monkeypatch.setattr(steps_motion, name, stop)
    monkeypatch.setattr(steps_motion, "_jog_release", lambda c, speed: 0.01)
    assert steps_motion.stops(context()).proof.endswith("stops, largest 0.400 deg")


@pytest.mark.parametrize(
    ("seen", "told"),
    [
        (SilentDrive(broken_off="moved 2 deg · torque off and brake closed after 8 ms"), "moved 2 deg · torque off"),
        (SilentDrive(state=DriveState.SWITCH_ON_DISABLED, brake_open=True), "switch on disabled, brake open: True"),
    ],
)  # fmt: skip
def test_a_silence_that_stopped_nothing_is_told_with_what_the_drive_has_confirmed(
    monkeypatch: pytest.MonkeyPatch, seen: SilentDrive, told: str
) -> None:
    monkeypatch.setattr(steps_motion, "open_loop_axis", opens(HandDrive()))
    monkeypatch.setattr(steps_motion, "watched_ways", lambda axis: ())
    monkeypatch.setattr(steps_motion, "_watchdog_s", lambda c: 0.1)
    monkeypatch.setattr(steps_motion, "fall_silent", lambda *_: seen)
    with pytest.raises(AlarmStop, match=f"silence at 1 deg/s: {told}"):
        steps_motion._silent_stop(context(), 1.0, [])


def test_a_picture_names_the_direction_of_its_stop(monkeypatch: pytest.MonkeyPatch) -> None:
    parts: list[str] = []

    @contextmanager
    def opened(c: object, leash_deg: float, part: str, **_: object) -> Iterator[Any]:
        parts.append(part)
        yield axis_of(HandDrive(), leash_deg)

    monkeypatch.setattr(steps_motion, "open_loop_axis", opened)
    for speed in (3.0, -3.0):
        with steps_motion._at_speed(context(), "silence", speed, 1.0):
            pass
    assert parts == ["silence from +3 deg/s", "silence from -3 deg/s"]


@pytest.mark.parametrize(
    ("output", "what"),
    [("watchdog", "the relay at 60FE bit 16"), ("drive_enable", "the enable relay at 6200 bit 2 of node 3")],
)
def test_a_watchdog_is_told_with_its_place(output: str, what: str) -> None:
    wired = {
        "watchdog": {"can.outputs.watchdog": 16},
        "drive_enable": {"can.io.node": 3, "can.io.outputs.drive_enable": 2},
    }
    dog = steps_silence._watchdog_of(with_values(MACHINE, wired[output]), 0.05)
    assert dog is not None
    assert dog.what == what


@pytest.mark.parametrize("outcome", [BrakeTestOutcome.FAILED, BrakeTestOutcome.ABORTED])
def test_a_brake_that_has_not_passed_is_told_with_what_to_do(
    monkeypatch: pytest.MonkeyPatch, step: Any, outcome: BrakeTestOutcome
) -> None:
    result = BrakeTestResult(outcome, 70.0, -70.0, 0.0, Words.STOPPED)
    monkeypatch.setattr(steps_power, "_test_brake", lambda c, axis: result)
    found = step(steps_power, "brake", HandDrive())
    assert (found.outcome, found.to_do) == (Outcome.FAILED, "brake or torque scaling; call service")
    assert found.proof == str(Words.STOPPED)


def test_a_torque_that_brakes_has_its_sign(step: Any) -> None:
    """A load that pulls the gantry on: the motor holds it back by 12.5 N m."""
    found = step(steps_power, "velocity", HandDrive(torque_nm=-12.5))
    assert found.number("torque_nm") == -12.5
    assert found.proof.endswith("mean torque -12.5 N m")


def test_each_ramp_is_told_as_it_is_seen_with_what_it_would_load(monkeypatch: pytest.MonkeyPatch) -> None:
    said: list[str] = []
    c = context()
    object.__setattr__(c, "say", said.append)
    monkeypatch.setattr(steps_lacks, "_stop_from", lambda c, speed: QuickStop(1.0, 5.5, 0.0))
    loads = SimpleNamespace(torque_motor_nm=300.0, torque_reducer_nm=20e3)
    monkeypatch.setattr(steps_lacks, "worst_stop", lambda *_: loads)
    monkeypatch.setattr(steps_lacks, "within_ratings", lambda *_: True)
    steps_lacks.ramp(c)
    assert said == [
        f"  from {speed} deg/s: 5.50 deg/s2; from 6 deg/s that is 300 N m at the motor, 20.0 kN m at the reducer"
        for speed in ("0.3", "0.6", "1", "2", "3")
    ]


@pytest.mark.parametrize("key", ["pdo", "sync", "sign", "velocity", "brake"])
def test_a_step_takes_the_time_of_the_axis_that_people_are_told(
    key: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Within 20 %: what is left is said in minutes and seconds, and a step is not measured anew for each machine."""
    asked = next(each for each in STEPS if each.key == key)
    drive: Any = HandDrive()
    drive.process.answer_times_s, drive.process.counts = [0.001], 0
    drive.sdo.values |= {0x6041: 0x0250, 0x6064: 0}
    drive.process.statusword = 0x0250
    drive.settings = SimpleNamespace(**vars(drive.settings), **ENCODER)
    drive.health = lambda: SimpleNamespace(scans=1000, missed=(0,), late=(0,))
    c = context()
    module = {"pdo": steps_bus, "sync": steps_bus, "sign": steps_sign}.get(key, steps_power)

    @contextmanager
    def opened(
        c: Any, leash_deg: float, part: str = "", *, following: bool = True, **_: object
    ) -> Iterator[Any]:
        axis = axis_of(drive, leash_deg, following=following)
        axis._watch = c.watch
        yield axis

    monkeypatch.setattr(module, "open_loop_axis", opened)
    asked.run(c)
    assert c.watch.meter.done == pytest.approx(asked.lasts_s(MACHINE), rel=0.2)


# --- the bus, a person at the inputs, the pulse -----------------------------------------------------------------------


def bus_drive() -> Any:
    drive: Any = HandDrive()
    drive.sdo.values |= {0x6041: 0x0250, 0x6064: 7}
    drive.process.counts, drive.process.statusword = 10, 0x0250
    drive.settings = SimpleNamespace(**vars(drive.settings), **ENCODER)
    # Of 1,000 SYNCs; nothing was missed before the drive was watched.
    drive.health = lambda: SimpleNamespace(scans=1000, missed=(5 if drive.wrote else 0,), late=(20,))
    return drive


def test_telegrams_are_told_in_percent_of_the_time_that_was_watched(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(steps_bus, "open_loop_axis", opens(bus_drive()))
    assert steps_bus.process_data(context()).proof == (
        "1000 SYNCs, 0.50 % missed, 2.00 % late; statusword by SDO agrees 8 times; position 3 increments apart"
    )


def test_a_drive_that_has_all_lacks_nothing(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    drive = bus_drive()
    drive.opened.rows = [
        SimpleNamespace(
            place="6085:00", name="quick stop", want="5400", have="5400", verdict=ParameterVerdict.OK
        )
    ]
    monkeypatch.setattr(steps_bus, "open_loop_axis", opens(drive))
    monkeypatch.setattr(steps_bus, "backup", lambda *_: {})
    c = context()
    object.__setattr__(c, "folder", tmp_path)
    found = steps_bus.parameters(c)
    assert found.proof == "1 parameters read back as written, backup in hust_can.drive.json"


def test_a_person_is_told_what_to_work_and_what_to_look_at(monkeypatch: pytest.MonkeyPatch) -> None:
    drive, said = bus_drive(), list[str]()
    drive.beside = SimpleNamespace(
        inputs=SimpleNamespace(levels=lambda: {"door_ok": not 30 <= len(drive.wrote) < 40})
    )
    monkeypatch.setattr(steps_bus, "open_loop_axis", opens(drive))
    c = context(with_values(MACHINE, {"can.outputs.lamp": 17, "can.inputs.door_ok": 9}))
    object.__setattr__(c, "say", said.append)
    steps_bus.wiring(c)
    assert said == [
        "  door_ok (60FD bit 9): change it within 60 s, then change it back",
        "  lamp (60FE bit 17): on for 3 s, look",
    ]


def test_the_pulse_is_told_by_position_and_by_speed(step: Any) -> None:
    """Three quarters of the way by position, all of it by speed: which of two keys is wrong."""
    found = step(steps_sign, "sign", HandDrive(way=0.75, shown=1.0))
    assert "+0.0225 deg by position, +0.0300 deg by speed" in found.proof


def test_the_lowered_limit_is_told_beside_what_was_given() -> None:
    """100 N m, and 95 of them are given."""
    axis: Any = SimpleNamespace(ratio=1144.0, angle_deg=0.0, period_s=0.004, run=lambda *_: None)
    process, units = SimpleNamespace(torque_known=True), SimpleNamespace(torque_unit_nm=1.0)
    axis.drive = SimpleNamespace(process=process, opened=SimpleNamespace(units=units))
    axis.feedback = SimpleNamespace(torque_act_nm=-95.0)
    axis.scan = lambda *_: None
    assert steps_sign._push(axis, {0x6072: 100}, {}) == "; 6072 lowered to 100 N m, 95 N m given"


# --- stops, loop, bands -----------------------------------------------------------------------------------------------


def test_a_stop_that_is_too_hard_is_told_with_what_was_set(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(steps_motion, "open_loop_axis", opens(HandDrive(quick_dec=8.0)))
    with pytest.raises(AlarmStop, match=r"from 3 deg/s is too hard: 8\.\d\d deg/s2, 5\.40 deg/s2 were set"):
        steps_motion._quick_stop(context(), 3.0, [])


def test_a_stop_that_is_too_long_is_told_with_what_is_permitted(monkeypatch: pytest.MonkeyPatch) -> None:
    """9 / 10.8 deg and 0.18 of the reaction are permitted; at 2 deg/s2 it is still fast there."""
    monkeypatch.setattr(steps_motion, "open_loop_axis", opens(HandDrive(quick_dec=2.0)))
    with pytest.raises(
        AlarmStop, match=r"too long: 1\.02\d deg and still at 2\.\d\d deg/s, 1\.013 deg are permitted"
    ):
        steps_motion._quick_stop(context(), 3.0, [])


def test_a_stop_is_told_as_it_was_measured_and_as_it_was_computed() -> None:
    said: list[str] = []
    c = context()
    object.__setattr__(c, "say", said.append)
    steps_motion._add(c, {}, "quick stop", 3.0, 0.9, 0.8)
    assert said == ["  quick stop from 3 deg/s: 0.900 deg, computed 0.800 deg"]


def test_the_loop_is_told_with_the_band_that_it_is_held_against(monkeypatch: pytest.MonkeyPatch) -> None:
    trace = {"vel_ref_rad_s": np.array([0.01, 0.0, 0.0]), "pos_err_rad": np.radians([0.02, 0.001, 0.001])}
    monkeypatch.setattr(steps_motion, "_there_and_back", lambda *_, **__: (trace, True))
    assert steps_motion.loop(context()).proof == (
        "largest following error 0.02000 deg at 0.6 deg/s (band 0.037), 0.001000 deg at rest"
    )


def test_bands_are_told_as_they_are_proposed_and_as_they_are_in_force() -> None:
    """Twice 0.004 and 0.01 deg."""
    results = {
        "loop": StepResult("loop", Outcome.PASSED, "", {"rest_error_deg": Figure(0.004)}),
        "turn": StepResult(
            "turn", Outcome.PASSED, "", {"following_error_deg": Figure(0.01), "speed_deg_s": Figure(3.0)}
        ),
    }
    window = MACHINE.monitors.in_position_window_deg
    assert steps_motion.bands(context(**results)).proof == (
        f"in position: 0.0080 deg from data, [monitors] in_position_window_deg = {window:g}; following error at 3 "
        "deg/s: 0.0200 deg from data, 0.0660 deg in force"
    )
