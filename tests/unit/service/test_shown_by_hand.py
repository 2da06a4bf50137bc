"""What the controller tells people and keeps of a run, by hand: numbers of a motion, counters, rows, last words."""

from __future__ import annotations

import asyncio
import math
import struct
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import pytest

from gantryctl.image import DriveState
from gantryctl.program import Code, Reaction
from gantryctl.program.alarms.words import Words
from gantryctl.service.clients.hub import Hub
from gantryctl.service.controller import process
from gantryctl.service.memory import snapshot
from gantryctl.service.memory.last_seen import LastSeen
from gantryctl.service.memory.memory import Source, Word
from gantryctl.service.memory.ring import Ring
from gantryctl.service.memory.snapshot import FAST, Snapshot, decode, publish_fast
from gantryctl.service.memory.trace_ring import rest_metadata
from gantryctl.service.protocol.messages import from_record
from gantryctl.service.protocol.tags import BY_NAME
from gantryctl.service.supervisor import child as module
from gantryctl.service.supervisor.child import Child
from gantryctl.units import SIGNED, deg, rad
from support.slow_network import shared_memory
from unit.service.test_alarm_view import Seen
from unit.service.test_controller import (
    delivered,
    moved_while_off,
    opened,
    published,
    publisher_of,
    retained,
    texts,
)

approx = pytest.approx
POWER_UP_SCANS = 4000


@pytest.fixture(autouse=True)
def _own_state(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("GANTRYCTL_STATE", str(tmp_path))


# --- a motion -------------------------------------------------------------------------------------


def test_the_numbers_of_a_motion_and_what_is_kept_of_it() -> None:
    """To 2 deg and back at up to 1.5 deg/s, of a gantry that has been used before."""
    delivered()
    retained(lambda kept: replace(kept, power_ups=7, moves=3, travelled_rad=rad(50.0)))
    with opened() as desk:
        desk.scans(3)
        assert desk.ask("take", over=False) == ""
        assert desk.ask("power", on=True) == ""
        desk.scans(POWER_UP_SCANS)
        assert desk.controller.retainer.power_ups == 8
        assert desk.ask("set", tag="speed_setting_deg_s", value=1.5) == ""
        assert desk.ask("move", target_deg=2.0) == ""
        desk.scans(1800)
        shown, pos, vel = published(desk), deg(desk.axis.pos_act_rad), deg(desk.axis.feedback.vel_rad_s)
        assert vel > 0.5
        assert shown["pos_act_deg"] == approx(pos, abs=1e-4)
        # 1144 turns of the motor are one of the gantry.
        assert shown["vel_cmd_deg_s"] == approx(shown["vel_ref_deg_s"], abs=0.1)
        # v^2 / 2a at 5.4 deg/s2, without the time in which the drive answers.
        assert shown["quick_stop_angle_deg"] == approx(vel * vel / (2.0 * 5.4), abs=1e-3)
        assert shown["travel_left_plus_deg"] == approx(180.0 - pos, abs=1e-3)
        assert shown["travel_left_minus_deg"] == approx(180.0 + pos, abs=1e-3)
        assert shown["following_error_trip_deg"] == approx(0.03 + 0.012 * shown["vel_ref_deg_s"], abs=1e-4)
        assert shown["recording"] is True
        desk.memory.words[Word.RECORDING_STOPPED] = 1
        assert published(desk)["recording"] is False
        desk.scans(4000)
        assert desk.ask("move", target_deg=0.0) == ""
        desk.scans(6000)
        desk.controller._close(None)
    kept = retained()
    assert (kept.power_ups, kept.moves) == (8, 5)
    assert deg(kept.travelled_rad) == approx(54.0, abs=0.02)


def test_what_is_old_or_not_yet_kept_is_told_as_that() -> None:
    with opened() as desk:
        desk.scans(3)
        assert desk.ask("take", over=False) == ""
        shown = published(desk)
        assert shown["position_valid"] is True
        assert shown["drive_state"] != "unknown"
        assert shown["brake_open"] is False
        # Nobody has taken the events out of the ring.
        assert (shown["journal_sequence"] > 0, shown["journal_committed"]) == (True, 0)
        feedback = desk.axis.feedback
        feedback.state_old, feedback._inputs_age = True, 10**6
        shown = published(desk)
        assert (shown["drive_state"], shown["brake_open"]) == ("unknown", None)
        desk.operator.hold.left_s = lambda now_s: 0.2  # type: ignore[method-assign]
        assert published(desk)["lease_left_ms"] == approx(200.0)


def test_an_angle_that_nobody_has_confirmed_is_not_told_as_valid() -> None:
    delivered()
    retained(moved_while_off)
    with opened() as desk:
        desk.scans(3)
        assert desk.axis.feedback.position_valid
        assert published(desk)["position_valid"] is False


def test_status_is_published_every_10_ms_also_where_scans_were_missed() -> None:
    with opened() as desk:
        publisher, fast = publisher_of(desk), desk.memory.fast
        step = round(0.010 / desk.engine.period_s)
        found = []
        for scan in (step - 1, step + 1, 2 * step - 1, 2 * step + 1, 4 * step + 1):
            desk.engine.scan, before = scan, fast.version
            publisher.scan()
            found.append(fast.version - before)
        assert found == [0, 1, 0, 1, 1]


# --- what a run leaves ----------------------------------------------------------------------------


def test_a_stop_that_nobody_has_acknowledged_outlives_the_next_run_and_no_reset() -> None:
    delivered()
    retained(lambda kept: replace(kept, error_stop="INT-03"))
    with opened() as desk:
        desk.scans(3)
        desk.controller._close(None)
    assert retained().error_stop == "INT-03"
    with opened() as desk:
        desk.scans(3)
        assert desk.ask("take", over=False) == ""
        assert desk.ask("reset") == ""
        desk.scans(3)
        assert desk.controller.retainer.retained.error_stop == ""


@pytest.mark.parametrize("off", [True, False])
def test_a_drive_is_set_up_again_with_power_off_only(monkeypatch: pytest.MonkeyPatch, off: bool) -> None:
    asked: list[bool] = []
    monkeypatch.setattr(process, "set_up_again", lambda engine: asked.append(True))
    with opened() as desk:
        desk.scans(3)
        assert desk.ask("take", over=False) == ""
        if not off:
            assert desk.ask("power", on=True) == ""
        assert desk.axis.is_off is off
        desk.controller._after_reset()
        assert asked == [True] * off


@pytest.mark.parametrize(
    ("seen", "confirmed"),
    [
        ({}, True),
        ({"brake_open": True}, False),
        ({"age_scans": 1}, False),
        ({"state": DriveState.UNKNOWN}, False),
        ({"state": DriveState.OPERATION_ENABLED}, False),
    ],
)
def test_the_last_words_confirm_only_what_was_read_in_the_last_scan(
    seen: dict[str, object], confirmed: bool
) -> None:
    with opened() as desk:
        desk.scans(3)
        image = desk.engine.image
        desk.engine.image = image._replace(drive=image.drive._replace(**seen))
        told = desk.controller._ended(True)
        assert told.endswith("brake closed, torque off") is confirmed
        assert told.endswith("not confirmed: press the emergency stop") is not confirmed


# --- brake test -----------------------------------------------------------------------------------


def test_an_overdue_brake_test_is_told_once_and_found_while_the_controller_runs() -> None:
    delivered()
    with opened() as desk:
        brake, kept = desk.controller.brake, desk.controller.retainer.retained
        kept = replace(kept, brake_tested_at="2100-01-01T00:00:00Z")
        brake.judge(kept, 0)
        brake.scan(kept, 0, 1000.0)
        assert not brake.due.overdue
        old = replace(kept, brake_tested_at="2020-01-01T00:00:00Z")
        brake.scan(old, 0, 1000.0 + 59.0)
        assert not brake.due.overdue
        for minute in (1, 2, 3):
            brake.scan(old, 0, 1000.0 + minute * 60.0)
            assert brake.due.overdue
        assert sum(text.startswith("brake test overdue") for text in texts(desk.memory)) == 1
        assert brake.slow()["brake_test_available"] is True


# --- rows of alarms -------------------------------------------------------------------------------


def test_the_cause_stands_first_then_the_newest_and_the_history_goes_backwards() -> None:
    seen = Seen()
    seen.log.raise_(Code.INT_06, measured=5.0, speed=-6.0)
    seen.log.raise_(Code.CTL_02, Reaction.QUICK_STOP, measured="a test")
    seen.log.raise_(Code.PWR_01, measured=Words.AT_UNKNOWN)
    seen.view.scan()
    rows = seen.view.rows()
    assert [row["code"] for row in rows["alarm_history"]] == ["PWR-01", "CTL-02", "INT-06"]
    assert [row["code"] for row in rows["alarms"]] == ["INT-06", "PWR-01", "CTL-02"]
    assert [event["values"]["code"] for event in seen.journal()] == ["INT-06", "CTL-02", "PWR-01"]


# --- memory ---------------------------------------------------------------------------------------


def test_a_status_is_as_old_as_it_is(monkeypatch: pytest.MonkeyPatch) -> None:
    now_ns = [5_000_000_000]
    monkeypatch.setattr(snapshot, "time", SimpleNamespace(monotonic_ns=lambda: now_ns[0]))
    with shared_memory() as memory:
        publish_fast(memory.fast, dict.fromkeys(FAST, 0.0), 0)
        now_ns[0] += 250_000_000
        assert Snapshot(memory).fast()[1] == approx(250.0)


@pytest.mark.parametrize("number", [math.nan, math.inf, -math.inf])
def test_no_tag_has_a_number_that_is_none(number: float) -> None:
    assert {decode(name, number) for name in FAST} == {None}


def test_a_word_that_there_is_not_is_none() -> None:
    name = next(name for name in FAST if BY_NAME[name].kind == "enum")
    labels = BY_NAME[name].labels
    assert [decode(name, n) for n in (-1.0, 0.0, len(labels) - 1.0, float(len(labels)))] == [
        None, labels[0], labels[-1], None,
    ]  # fmt: skip


def test_bands_of_rest_are_0_001_deg_and_5_percent_of_the_rated_torque() -> None:
    told = rest_metadata(200.0)
    assert told["rest_band_pos_act_rad"] == approx(math.radians(0.001))
    assert told["rest_band_torque_act_nm"] == approx(10.0)


def a_ring(head: int = 0, tail: int = 0) -> Ring:
    """Four slots of 64 bytes."""
    memory = bytearray(192 + 4 * 64)
    struct.pack_into("<Q", memory, 0, head)
    struct.pack_into("<Q", memory, 64, tail)
    return Ring(memoryview(memory), 64)


def test_a_record_is_whole_before_its_reader_is_told_of_it() -> None:
    ring = a_ring()
    words, seen = ring._words, []

    class Watched:
        def __getitem__(self, index: int) -> int:
            return words[index]

        def __setitem__(self, index: int, value: int) -> None:
            seen.append(ring._read(value - 1))
            words[index] = value

    ring._words = Watched()  # type: ignore[assignment]
    assert ring.put(b"whole")
    assert seen == [b"whole"]


def test_a_reader_of_a_ring_neither_overtakes_its_writer_nor_believes_numbers_of_none() -> None:
    ring = a_ring()
    ring.put(b"one")
    ring.advance(5)
    ring.put(b"two")
    assert ring.peek(10) == [b"two"]
    # Five records wait in four slots.
    ring = a_ring(head=3, tail=8)
    assert ring.peek(10) == []
    assert (ring.damaged, len(ring)) == (1, 0)


@pytest.mark.parametrize("at", [0, 4, 8, 12])
def test_a_record_that_is_not_as_it_was_written_is_none(at: int) -> None:
    """Length, check and content."""
    ring = a_ring()
    ring.put(b"whole")
    ring.put(b"other")
    ring._memory[192 + at] ^= 1
    assert ring.peek(2) == [None, b"other"]


@pytest.mark.parametrize(
    ("pos", "vel", "valid", "seen"),
    [
        (350.0, 0.5, True, (350.0, 0.5)), (None, 0.5, True, (None, None)), (350.0, None, True, (None, None)),
        (350.0, 0.5, False, (None, None)), (0.0, 0.0, True, (0.0, 0.0)),
    ],
)  # fmt: skip
def test_where_an_axis_was_seen_is_known_with_angle_and_speed_or_not_at_all(
    pos: float | None, vel: float | None, valid: bool, seen: tuple[float | None, float | None]
) -> None:
    tags = {"pos_act_deg": pos, "vel_act_deg_s": vel, "position_valid": valid}
    found = LastSeen.of(tags, SIGNED)
    assert tuple(found) == seen
    told = found.told(Words.AGO(age_s=1.0)).line
    assert ("at an angle that is not known" in told) is (seen[0] is None)


@pytest.mark.parametrize(("source", "place"), [(Source.WEB, "web"), (Source.LOCAL, "local")])
def test_a_hub_that_begins_says_so_in_the_place_of_its_source(source: Source, place: str) -> None:
    """The controller ends what the connections of the one before have held: of this place alone."""
    with shared_memory() as memory:
        Hub(memory, source)
        (record,) = memory.commands[source].peek(10)
        who, message = from_record(record)
        assert (who.place, message["type"]) == (place, "restart")


# --- processes ------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("critical", "calm_s", "ends"), [(True, 10.0, True), (False, 10.0, False), (True, -1.0, False)]
)
def test_the_service_ends_with_a_process_only_if_it_needs_it_and_it_failed_again_and_again(
    monkeypatch: pytest.MonkeyPatch, critical: bool, calm_s: float, ends: bool
) -> None:
    """A gateway that fails leaves the axis to the console; and a run of hours between two failures is no series."""
    monkeypatch.setattr(module, "_CALM_S", calm_s)
    monkeypatch.setattr(module, "_PAUSES_S", (0.0, 0.0))
    child = Child("gateway", ["/nothing/there"], [], critical=critical)
    said: list[str] = []

    def say(text: str) -> None:
        said.append(text)
        if len(said) == 6:
            child._ending.set()

    asyncio.run(asyncio.wait_for(child.keep(say), 10.0))
    assert said[-1].endswith("3 times: the service ends") is ends
    assert len(said) == (3 if ends else 6)
