"""What is kept of a silence, which time of it counts, and a controller that is killed; by hand, nothing is forked."""

from __future__ import annotations

import math
import signal
from types import SimpleNamespace
from typing import Any

import pytest

from gantryctl.commissioning.results import Outcome
from gantryctl.commissioning.stopping import controller_death, silence, steps_silence
from gantryctl.errors import AlarmStop
from gantryctl.image import DriveRequest, DriveState
from gantryctl.machine import with_values
from gantryctl.operation.ledger.rows import SILENT_STOP_S
from unit.commissioning.hand_drive import MACHINE, PERIOD_S, HandDrive, axis_of, context, enabled, opens

pytestmark = pytest.mark.can

S = DriveState


class Silences:
    """Stands for `fall_silent`: times until the drive was off, by what was silent; and what was done around it."""

    def __init__(
        self, monkeypatch: pytest.MonkeyPatch, drive: HandDrive, ways: tuple[silence.Way, ...]
    ) -> None:
        self.did: list[object] = []
        self.marker: int | None = 7
        self.off_s = {silence.Way.COMMANDS: 0.03, silence.Way.HEARTBEAT: 0.05}
        drive.settings.rpdo_deadline_s, drive.settings.watch_s = 0.05, 0.15
        drive.resume = lambda: self.did.append("awake")  # type: ignore[method-assign]
        monkeypatch.setattr(steps_silence, "open_loop_axis", opens(drive))
        monkeypatch.setattr(steps_silence, "watched_ways", lambda _: ways)
        monkeypatch.setattr(steps_silence, "fall_silent", self.fall)
        monkeypatch.setattr(steps_silence, "_keep_proof", self.keep)

    def fall(self, axis: object, silent: silence.Silence, speed: float = 0.0) -> silence.SilentDrive:
        self.did.append((silent.ways, silent.limit_s))
        off_s = min(self.off_s[way] for way in silent.ways)
        return silence.SilentDrive(stopped_s=off_s, state=S.FAULT, brake_open=False)

    def keep(self, c: object) -> int | None:
        self.did.append("kept")
        return self.marker


@pytest.mark.parametrize("marker", [7, None])
def test_a_drive_that_watches_two_ways_stops_by_the_quicker_one(
    monkeypatch: pytest.MonkeyPatch, marker: int | None
) -> None:
    """Each way alone, awake again behind it; then the proof is kept. Without a marker a restart is not noticed."""
    silences = Silences(monkeypatch, HandDrive(), tuple(silence.Way))
    silences.marker = marker
    found = steps_silence.silence(context())
    assert (found.outcome, found.number("silent_stop_s")) == (Outcome.PASSED, 0.03)
    commands, heartbeat = silence.Way
    assert silences.did == [((commands,), 0.05), "awake", ((heartbeat,), 0.15), "awake", "kept"]
    assert ("no marker" in found.proof) is (marker is None)


@pytest.mark.parametrize("way", silence.Way)
def test_a_drive_that_watches_one_way_shows_that_one(
    monkeypatch: pytest.MonkeyPatch, way: silence.Way
) -> None:
    silences = Silences(monkeypatch, HandDrive(), (way,))
    (other,) = set(silence.Way) - {way}
    found = steps_silence.silence(context())
    assert (found.outcome, found.number("silent_stop_s")) == (Outcome.PASSED, silences.off_s[way])
    assert [what[0] for what in silences.did if isinstance(what, tuple)] == [(way,)]
    assert f"this drive has no {other.place} ({other})" in found.proof


def test_a_drive_that_had_to_be_broken_off_is_left_as_it_is(monkeypatch: pytest.MonkeyPatch) -> None:
    """It does not obey: it gets no other command, and the second silence is not tried."""
    silences = Silences(monkeypatch, HandDrive(), tuple(silence.Way))
    liar = silence.SilentDrive(broken_off="still operation enabled · torque off and brake closed after 20 ms")
    monkeypatch.setattr(steps_silence, "fall_silent", lambda *_: silences.did.append("silent") or liar)
    found = steps_silence.silence(context())
    assert found.outcome is Outcome.FAILED
    assert "still operation enabled" in found.proof
    assert silences.did == ["silent"]


def test_a_drive_that_heeds_its_first_silence_and_not_the_second_has_proven_nothing(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    silences = Silences(monkeypatch, HandDrive(), tuple(silence.Way))
    liar = silence.SilentDrive(broken_off="still operation enabled · torque off and brake closed after 20 ms")
    fall = silences.fall
    monkeypatch.setattr(
        steps_silence,
        "fall_silent",
        lambda axis, to: liar if silence.Way.HEARTBEAT in to.ways else fall(axis, to),
    )
    found = steps_silence.silence(context())
    assert (found.outcome, "kept" in silences.did) == (Outcome.FAILED, False)
    assert "heartbeat silent: no EMCY, still operation enabled" in found.proof


def test_a_drive_without_a_watch_has_shown_nothing(monkeypatch: pytest.MonkeyPatch) -> None:
    silences = Silences(monkeypatch, HandDrive(), ())
    assert steps_silence.silence(context()).outcome is Outcome.NOT_TESTABLE
    assert silences.did == []


NODE = with_values(MACHINE, {"can.io.node": 3, "can.io.outputs.drive_enable": 0})


@pytest.mark.parametrize("ways", [(), (silence.Way.HEARTBEAT,)])
@pytest.mark.parametrize(("off_s", "longest_s"), [(0.04, 0.06), (0.07, 0.07)])
def test_the_longest_time_of_a_watchdog_counts(
    monkeypatch: pytest.MonkeyPatch, ways: tuple[silence.Way, ...], off_s: float, longest_s: float
) -> None:
    """60 ms of the node for a whole silence, 150 ms of its heartbeat alone. Only a drive without a watch of its own is
    proven by the watchdog. The contact is read while the controller is still silent.
    """
    drive = HandDrive()
    silences = Silences(monkeypatch, drive, ways)
    silences.off_s = {silence.Way.COMMANDS: off_s, silence.Way.HEARTBEAT: 0.1}

    def contact() -> bool:
        silences.did.append("contact")
        return False

    drive.beside = SimpleNamespace(  # type: ignore[attr-defined]
        inputs=SimpleNamespace(watchdog_contact=lambda: True),
        ask_watchdog_contact=contact,
        io=SimpleNamespace(ask_silence_limit_s=lambda: 0.06),
    )
    found = steps_silence.watchdog(context(NODE))
    assert (found.outcome, found.number(SILENT_STOP_S)) == (Outcome.PASSED, longest_s)
    assert found.proof.endswith("its contact is open" if ways else "the drive has no watch of its own")
    # Four scans of 4 ms and 10 ms until it shows.
    times = {name: found.figures[name] for name in ("watchdog_heartbeat_ms", "watchdog_ms")}
    assert [each.value for each in times.values()] == pytest.approx([100.0, 1e3 * off_s])
    assert [each.high for each in times.values()] == pytest.approx([176.0, 86.0])
    heartbeat = silence.Way.HEARTBEAT
    assert silences.did == [
        ((heartbeat,), 0.15), "contact", "awake", (tuple(silence.Way), 0.06), "contact", "awake",
        *([] if ways else ["kept"]),
    ]  # fmt: skip


@pytest.mark.parametrize("own", [True, False])
@pytest.mark.parametrize("closed", [True, False, None])
def test_a_watchdog_has_acted_when_its_contact_says_so(
    monkeypatch: pytest.MonkeyPatch, own: bool, closed: bool | None
) -> None:
    """Without a contact only a drive that has no watch of its own shows it: its own may have been earlier."""
    drive, axis = enabled()
    Silences(monkeypatch, drive, ())
    inputs = SimpleNamespace(watchdog_contact=lambda: True)
    drive.beside = SimpleNamespace(inputs=inputs, ask_watchdog_contact=lambda: closed)  # type: ignore[attr-defined]
    fall = steps_silence._Fall("watchdog", (silence.Way.COMMANDS,), 0.05)
    proofs: list[str] = []
    dog = steps_silence._Watchdog("the relay", (fall,), "")
    result, _ = steps_silence._fall(context(), axis, dog, fall, {}, proofs, own=own)
    passes = closed is False or (closed is None and not own)
    assert (result is None) is passes
    assert len(proofs) == passes
    assert all(proof.startswith(f"{silence.Way.COMMANDS} silent: left operation enabled") for proof in proofs)
    assert result is None or result.outcome is Outcome.FAILED


def test_the_proof_is_kept_with_the_drive_and_its_marker(monkeypatch: pytest.MonkeyPatch) -> None:
    """Some drives answer SDO in PRE-OPERATIONAL only: there first."""
    did: list[object] = []
    drive = HandDrive()
    drive.node.enter_pre_operational = lambda: did.append("quiet")
    drive.leave_restart_marker = lambda: did.append("marked") or 7  # type: ignore[attr-defined]
    drive.opened.identity = SimpleNamespace(key="maker 1")
    monkeypatch.setattr(steps_silence, "open_loop_axis", opens(drive))
    monkeypatch.setattr(steps_silence, "silent_master_proof_path", lambda *_: "here")
    monkeypatch.setattr(steps_silence, "store_silent_master_proof", lambda *kept: did.append(kept))
    c = context()
    object.__setattr__(c, "store", SimpleNamespace(directory=None))
    assert steps_silence._keep_proof(c) == 7
    assert did == ["quiet", "marked", ("here", "maker 1", 7)]


def test_a_relay_has_one_silence_to_show_itself(monkeypatch: pytest.MonkeyPatch) -> None:
    """That of everything; the time of its setting counts where it was quicker."""
    drive = HandDrive()
    silences = Silences(monkeypatch, drive, ())
    drive.beside = SimpleNamespace(  # type: ignore[attr-defined]
        inputs=SimpleNamespace(watchdog_contact=lambda: True), ask_watchdog_contact=lambda: False, io=None
    )
    dog = steps_silence._Watchdog(
        "the relay", (steps_silence._Fall("watchdog", tuple(silence.Way), 0.08),), ""
    )
    monkeypatch.setattr(steps_silence, "_watchdog_of", lambda *_: dog)
    found = steps_silence.watchdog(context())
    assert (found.outcome, found.number(SILENT_STOP_S)) == (Outcome.PASSED, 0.08)
    assert found.proof.startswith("all silent: left operation enabled")
    assert silences.did == [(tuple(silence.Way), 0.08), "awake", "kept"]


@pytest.mark.parametrize(
    ("looks", "silent_data", "age", "by_telegram"),
    [
        (False, False, 0, True),
        (False, False, 1, False),
        (False, True, 0, False),
        (True, True, 0, True),
        (True, True, 1, False),
    ],
)
def test_only_a_telegram_of_this_scan_shows_a_silent_drive(
    looks: bool, silent_data: bool, age: int, by_telegram: bool
) -> None:
    drive = HandDrive()
    view = silence._View(axis_of(drive))
    view.looks, drive.silent_process_data, drive.process.age = looks, silent_data, age
    assert view._by_telegram is by_telegram


# --- silence, scan by scan --------------------------------------------------------------------------------------------


def silent(drive: HandDrive, axis: Any, **what: Any) -> silence.SilentDrive:
    drive.process.age = 0
    drive.node.emergencies = SimpleNamespace(count=0)
    drive.beside = SimpleNamespace(ask_brake_contact=lambda: False)  # type: ignore[attr-defined]
    drive.look = drive.read  # type: ignore[attr-defined]
    return silence.fall_silent(axis, silence.Silence((silence.Way.HEARTBEAT,), 0.05, 0.05), **what)


def test_commands_go_on_while_the_heartbeat_alone_is_silent() -> None:
    """At its speed, with the brake open; the drive is in its fault from the sixth scan on, which is 24 ms."""
    drive, axis = enabled()
    write = drive.write
    drive.wrote.clear()

    def till_the_fault(output: Any) -> None:
        drive.process.statusword = 0x1637
        if len(drive.wrote) < 5:
            write(output)
        else:
            drive.wrote.append(output)
            drive.process.statusword, drive.state, drive.speed, drive.brake_open = 0x0008, S.FAULT, 0.0, False

    drive.write = till_the_fault  # type: ignore[method-assign]
    seen = silent(drive, axis, speed_deg_s=0.6)
    assert (seen.stopped, seen.stopped_s) == (True, pytest.approx(6 * PERIOD_S))
    assert {output.torque_ff_nm for output in drive.wrote} == {0.0}
    assert {(output.request, output.brake_open, round(axis.motor_rad_s(0.6) - output.vel_cmd_rad_s, 9))
            for output in drive.wrote} == {(DriveRequest.ENABLE, True, 0.0)}  # fmt: skip
    assert not drive.silent_process_data
    assert drive.silent_heartbeat


def test_a_drive_that_was_broken_off_shows_its_last_state_and_its_whole_way() -> None:
    """Still enabled after 80 ms: 20 scans of 0.6 deg/s; then the gantry goes on for 0.01 deg while it is stopped."""
    drive, axis = enabled()
    write = drive.write

    def on(output: Any) -> None:
        first = output.request is DriveRequest.DISABLE and drive.state is S.OPERATION_ENABLED
        write(output)
        drive.deg += 0.01 * first
        drive.process.statusword = 0x1637

    drive.write = on  # type: ignore[method-assign]
    seen = silent(drive, axis, speed_deg_s=0.6)
    assert seen.broken_off.startswith("still operation enabled 80 ms")
    assert seen.state is S.SWITCH_ON_DISABLED
    assert seen.way_deg == pytest.approx(20 * PERIOD_S * 0.6 + 0.01, abs=1e-6)


@pytest.mark.parametrize(
    ("data", "state"), [(b"\x08\x00", S.FAULT), (b"\x08", None), (b"\x08\x00\x00", None), (None, None)]
)
def test_a_state_by_sdo_has_two_bytes(data: bytes | None, state: DriveState | None) -> None:
    view = silence._View(enabled()[1])
    view._state(data)
    assert view.state is (state or S.OPERATION_ENABLED)


@pytest.mark.parametrize("looks", [True, False])
def test_where_no_sync_goes_out_the_link_listens_for_a_scan_itself(looks: bool) -> None:
    drive, axis = enabled()
    drive.silent_process_data, drive.process.age = True, 1
    asked: list[tuple[int, int]] = []
    drive.requests = SimpleNamespace(read=lambda index, sub, _: asked.append((index, sub)))  # type: ignore[attr-defined]
    drive.look = drive.read  # type: ignore[attr-defined]
    view, before = silence._View(axis), axis._watch.meter.done
    view.looks = looks
    view.scan()
    assert axis._watch.meter.done - before == pytest.approx(PERIOD_S if looks else 0.0)
    # State and position in turn, of a drive that has no telegrams: without the position there is no way to judge.
    for _ in range(3):
        view.scan()
    assert asked == [(0x6041, 0), (0x6064, 0)] * 2


# --- death of a controller --------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("interface", "clock", "can"),
    [
        ("socketcan", True, True),
        ("udp_multicast", True, True),
        ("pcan", True, False),
        ("socketcan", False, False),
    ],
)
def test_only_a_process_apart_from_its_drive_can_be_killed(interface: str, clock: bool, can: bool) -> None:
    machine: Any = SimpleNamespace(paced_by_clock=clock, can=SimpleNamespace(interface=interface))
    assert controller_death.can_be_killed(machine) is can


def test_a_copy_is_killed_as_soon_as_a_person_stops_the_step(monkeypatch: pytest.MonkeyPatch) -> None:
    slept: list[float] = []
    stand_in = SimpleNamespace(
        fork=lambda: 77, WNOHANG=1, waitpid=lambda *_: (0, 0), kill=lambda *_: slept.append(math.inf)
    )
    monkeypatch.setattr(controller_death, "os", stand_in)
    clock = SimpleNamespace(monotonic=lambda: 50.0 + sum(slept), sleep=slept.append)
    monkeypatch.setattr(controller_death, "time", clock)
    link = SimpleNamespace(take_over=lambda: None)
    axis: Any = SimpleNamespace(halted=True, drive=SimpleNamespace(link=link))
    controller_death.kill_controller(axis)
    assert slept == [math.inf]


@pytest.mark.parametrize(("brake_open", "words"), [(True, "brake open"), (False, "brake closed")])
def test_a_silence_is_told_with_its_brake(brake_open: bool, words: str) -> None:
    seen = silence.SilentDrive(stopped_s=0.05, state=S.FAULT, brake_open=brake_open, way_deg=0.01)
    assert (
        steps_silence._told(seen)
        == f"left operation enabled after 50 ms (no EMCY), moved 0.0100 deg, fault, {words}"
    )
    seen.complained_s = 0.012
    assert "after 50 ms (EMCY after 12 ms), moved" in steps_silence._told(seen)


def test_a_brake_that_nobody_has_seen_counts_as_open() -> None:
    """A drive in fault that has said nothing of its brake has not stopped the axis."""
    assert not silence.SilentDrive(state=S.FAULT).stopped
    assert silence.SilentDrive(state=S.FAULT, brake_open=False).stopped


def test_the_copy_and_not_the_original_runs_the_axis(monkeypatch: pytest.MonkeyPatch) -> None:
    def run_on(_: object) -> None:
        raise SystemExit

    monkeypatch.setattr(controller_death, "os", SimpleNamespace(fork=lambda: 0))
    monkeypatch.setattr(controller_death, "_run_on", run_on)
    with pytest.raises(SystemExit):
        controller_death.kill_controller(SimpleNamespace())  # type: ignore[arg-type]


@pytest.mark.parametrize("ended", [0, 77])
def test_a_copy_runs_the_axis_for_half_a_second_and_is_killed(
    monkeypatch: pytest.MonkeyPatch, ended: int
) -> None:
    """One that has ended by itself proves nothing: the axis is stopped."""
    did: list[object] = []
    now = [50.0]

    def sleep(seconds: float) -> None:
        now[0] += seconds

    def wait(copy: int, how: int) -> tuple[int, int]:
        did.append(("waited", how, round(now[0] - 50.0, 2)))
        return ended, 0

    stand_in = SimpleNamespace(
        fork=lambda: did.append("forked") or 77, WNOHANG=1, waitpid=wait,
        kill=lambda copy, number: did.append((copy, number)),
    )  # fmt: skip
    monkeypatch.setattr(controller_death, "os", stand_in)
    monkeypatch.setattr(controller_death, "time", SimpleNamespace(monotonic=lambda: now[0], sleep=sleep))

    def stop_for(why: str) -> None:
        raise AlarmStop(why)

    link = SimpleNamespace(take_over=lambda: did.append("taken over"))
    axis: Any = SimpleNamespace(halted=False, stop_for=stop_for, drive=SimpleNamespace(link=link))
    if ended:
        with pytest.raises(AlarmStop, match="has ended by itself"):
            controller_death.kill_controller(axis)
        assert did[1:] == [("waited", 1, pytest.approx(0.5, abs=0.011))]
    else:
        controller_death.kill_controller(axis)
        half_s = pytest.approx(0.5, abs=0.011)
        # Looked at without waiting (WNOHANG), and waited for when it is killed.
        looked, waited = ("waited", 1, half_s), ("waited", 0, half_s)
        assert did == ["forked", looked, (77, signal.SIGKILL), waited, "taken over"]


def test_the_copy_hears_nobody_and_goes_on_until_it_is_killed(monkeypatch: pytest.MonkeyPatch) -> None:
    did: list[object] = []

    def leave(code: int) -> None:
        did.append(code)
        raise SystemExit

    def scan(request: DriveRequest) -> None:
        did.append(request)
        if did.count(request) == 3:
            raise KeyboardInterrupt

    stand_in = SimpleNamespace(
        open=lambda *_: 9, devnull="", O_WRONLY=1, dup2=lambda a, b: did.append(f"{a} for {b}"), _exit=leave
    )  # fmt: skip
    monkeypatch.setattr(controller_death, "os", stand_in)
    link = SimpleNamespace(log_nothing=lambda: did.append("no log"))
    axis: Any = SimpleNamespace(
        drive=SimpleNamespace(link=link), hear_nobody=lambda: did.append("deaf"),
        begin_time=lambda: did.append("in time"), scan=scan,
    )  # fmt: skip
    with pytest.raises(SystemExit):
        controller_death._run_on(axis)
    # Standard output and error: the other one tells what is to be told.
    assert did[:2] == ["9 for 1", "9 for 2"]
    assert did[2:] == ["no log", "deaf", "in time", *[DriveRequest.ENABLE] * 3, 1]


@pytest.mark.parametrize("contact", [True, False])
def test_a_watchdog_that_has_not_acted_fails_its_step_and_keeps_no_proof(
    monkeypatch: pytest.MonkeyPatch, contact: bool
) -> None:
    """Its contact still shows closed, or the drive is still enabled."""
    drive = HandDrive()
    silences = Silences(monkeypatch, drive, ())
    inputs = SimpleNamespace(watchdog_contact=lambda: True)
    drive.beside = SimpleNamespace(  # type: ignore[attr-defined]
        inputs=inputs,
        ask_watchdog_contact=lambda: contact,
        io=SimpleNamespace(ask_silence_limit_s=lambda: 0.06),
    )
    if not contact:
        monkeypatch.setattr(
            steps_silence, "fall_silent", lambda *_: silence.SilentDrive(broken_off="still operation enabled")
        )
    found = steps_silence.watchdog(context(NODE))
    assert found.outcome is Outcome.FAILED
    assert ("its contact still shows closed" if contact else "still operation enabled") in found.proof
    assert "kept" not in silences.did
