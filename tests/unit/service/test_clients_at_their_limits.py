"""Connections, rings and logs at their limits: the last place, the last moment, what is behind it; by hand."""

from __future__ import annotations

import asyncio
import json
import struct
from collections.abc import Iterator
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from gantryctl.program.alarms.codes import Code
from gantryctl.program.alarms.words import Words
from gantryctl.service.clients import hub as hub_module
from gantryctl.service.clients import recorded
from gantryctl.service.clients.hub import Hub
from gantryctl.service.clients.samples import Samples
from gantryctl.service.memory import snapshot
from gantryctl.service.memory.events import EventLog, printable
from gantryctl.service.memory.held_up import HeldUp
from gantryctl.service.memory.memory import SharedMemory, Source
from gantryctl.service.memory.refusals import RefusalLog
from gantryctl.service.memory.snapshot import FAST, publish_fast, publish_json
from gantryctl.service.memory.trace_ring import rest_metadata
from gantryctl.service.protocol.messages import Identity, Message, MessageRefused, reply_to
from gantryctl.service.protocol.roles import Role
from support.service_bench import ring
from support.slow_network import shared_memory
from unit.service.test_connection_by_hand import COMMAND, Desk, say, sent
from unit.service.test_link_by_hand import Desk as LinkDesk
from unit.service.test_link_by_hand import reply
from unit.service.test_local_by_hand import Desk as LocalDesk
from unit.service.test_local_by_hand import line


@pytest.fixture
def desk() -> Iterator[Desk]:
    with shared_memory() as memory:
        yield Desk(memory)


# --- connections ------------------------------------------------------------------------------------------------------


def test_the_first_epoch_goes_with_its_command(desk: Desk) -> None:
    """Epoch 0 is one, and a command without one would count in any."""
    client = desk.hub.connect("anna", Role.OPERATOR, "console")
    say(client, 1, **{**COMMAND, "epoch": 0})
    ((_, message),) = desk.took()
    assert message["epoch"] == 0


def test_two_hundred_replies_wait_for_a_slow_reader(desk: Desk) -> None:
    client = desk.hub.connect("anna", Role.OPERATOR, "console")
    for seq in range(300):
        client.answer(reply_to(seq))
    assert [each["seq"] for each in sent(client)] == list(range(200))


def test_a_state_of_just_half_a_second_is_fresh(monkeypatch: pytest.MonkeyPatch) -> None:
    now_ns = [5_000_000_000]
    monkeypatch.setattr(snapshot, "time", SimpleNamespace(monotonic_ns=lambda: now_ns[0]))
    with shared_memory() as memory:
        hub = Hub(memory, Source.LOCAL)
        publish_fast(memory.fast, dict.fromkeys(FAST, 0.0), 0)
        for later_ns, fresh in ((500_000_000, True), (1_000, False)):
            now_ns[0] += later_ns
            hub.look()
            assert hub.fresh is fresh


def test_replies_are_looked_for_on_and_on_only_while_one_is_expected(
    desk: Desk, monkeypatch: pytest.MonkeyPatch
) -> None:
    looks: list[int] = []
    monkeypatch.setattr(desk.hub, "pass_replies", lambda: looks.append(1))
    monkeypatch.setattr(hub_module.limits, "FRAME_S", 60.0)

    async def whole() -> None:
        answering = asyncio.create_task(desk.hub._answer_on())
        for _ in range(3):
            desk.hub.expect()
            for _ in range(50):
                await asyncio.sleep(0)
        answering.cancel()

    asyncio.run(whole())
    assert len(looks) == 3


def test_a_reply_is_taken_once(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    made = LinkDesk(monkeypatch)
    link = made.open(tmp_path)
    made.socket.answers = {"halt": [reply()]}
    for _ in range(3):
        link.ask("halt")
    assert not link._replies


def test_the_first_line_of_a_connection_has_five_seconds(monkeypatch: pytest.MonkeyPatch) -> None:
    made = LocalDesk(monkeypatch)
    made.serve(line(watch=True), b"one\n")
    assert (made.waits[0], None in made.waits) == (5.0, True)


@pytest.mark.parametrize(("unused_s", "room"), [(59.75, False), (60.0, True)])
def test_a_page_that_was_unused_for_just_its_time_makes_room(desk: Desk, unused_s: float, room: bool) -> None:
    client = desk.hub.connect("anna", Role.OPERATOR, "console")
    desk.now_s += unused_s
    assert desk.hub.make_room("anna", 1, 60.0) is room
    assert client.displaced is room


# --- recordings -------------------------------------------------------------------------------------------------------


def test_curves_are_in_degrees_with_their_unit_and_the_spacing_is_none(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """`spare_rad` is no tag: its unit is that of its name in degrees."""

    class Trace(dict[str, Any]):
        def __init__(self, **columns: Any) -> None:
            super().__init__(columns)
            self.metadata = {"machine": "a"}

        @property
        def columns(self) -> tuple[str, ...]:
            return tuple(self)

        def __len__(self) -> int:
            return 2

    trace = Trace(
        time_s=np.array([7.0, 7.5]), spacing_s=np.array([0.5, 0.5]), spare_rad=np.array([np.pi, np.nan]),
        torque_act_nm=np.array([1.5, -2.5]),
    )  # fmt: skip
    monkeypatch.setattr(recorded, "read_trace", lambda _: trace)
    found = recorded.columns_between(Path("x"), "one.parquet", 0, 500)
    assert [(each["name"], each["unit"], each["x"], each["y"]) for each in found["columns"]] == [
        ("spare_deg", "deg", [0.0, 0.5], [180.0, None]), ("torque_act_nm", "N m", [0.0, 0.5], [1.5, -2.5])
    ]  # fmt: skip
    assert (found["end_s"], found["utc_s"], found["machine"]) == (0.5, None, "a")


def test_rows_of_a_controller_with_more_columns_are_left_out() -> None:
    memory = SharedMemory.create()
    publish_json(memory.columns, {"columns": ["time_s"], "metadata": {"period_s": 0.001}})
    for values in ((7.0, 0.0, 1.5, 99.0), (8.0, 0.0, 2.5)):
        assert memory.rows.put(struct.pack(f"<{len(values)}d", *values))
    found = Samples(memory).read(0, 10)
    assert (found["next"], found["newest_s"], found["tags"]) == (2, 2.5, {"time_s": [2.5]})
    memory.close()


# --- events -----------------------------------------------------------------------------------------------------------


def test_a_text_has_so_many_bytes_and_a_user_64(monkeypatch: pytest.MonkeyPatch) -> None:
    """A letter of four bytes is taken whole or not at all."""
    for text, length, kept in (("x" * 600, 500, 500), ("\U0001f527" * 200, 500, 125), ("é" * 50, 33, 16)):
        assert len(printable(text, length)) == kept
    made = ring(4)
    log = EventLog(made)
    log.put("login", "x", Identity("c" * 40, "u" * 70, Role.VIEWER, "console"))
    found = json.loads(made.take() or b"")
    assert (len(found["user"]), len(found["client"])) == (64, 32)


@pytest.mark.parametrize(("gap_s", "told"), [(1.0, []), (1.25, ["gateway was held up for 1.2 s"])])
def test_a_process_that_was_held_up_for_more_than_a_second_says_so(gap_s: float, told: list[str]) -> None:
    said: list[str] = []
    now_s = [64.0]
    watch = HeldUp("gateway", said.append, lambda: now_s[0])
    now_s[0] += gap_s
    watch.look()
    assert said == told


def test_each_area_has_its_room() -> None:
    memory = SharedMemory.create()
    room = {
        name: getattr(memory, name).capacity + 24
        for name in ("fast", "slow", "alarms", "columns", "commissioning")
    }
    assert room == {
        "fast": 4096, "slow": 65_536, "alarms": 262_144, "columns": 8192, "commissioning": 131_072
    }  # fmt: skip
    memory.close()


def test_each_source_and_each_ring_has_its_places() -> None:
    """Gateway, local socket, controller, OPC UA; 33 s of rows at 1 ms, 2 s of frames of a full bus."""
    assert [each.name for each in sorted(Source)] == ["WEB", "LOCAL", "CONTROLLER", "OPCUA"]
    assert sorted(Source) == [0, 1, 2, 3]
    memory = SharedMemory.create()
    assert {each.slots for each in (*memory.commands, *memory.replies)} == {256}
    assert {each.slots for each in memory.events} == {10_240}
    assert (memory.rows.slots, memory.frames.slots) == (32_768, 16_384)
    memory.close()


def test_a_recording_says_how_an_axis_at_rest_is_told() -> None:
    """A row each 0.1 s, within 0.001 deg and a twentieth of the rated torque: 10 of 200 N m."""
    assert rest_metadata(200.0) == {
        "rest_spacing_s": 0.1,
        "rest_band_pos_act_rad": pytest.approx(np.pi / 180_000.0),
        "rest_band_torque_act_nm": pytest.approx(10.0),
    }
    # Of an encoder with steps of 0.02 deg the two that a shaft stands between, and no third one.
    assert rest_metadata(200.0, np.radians(0.02))["rest_band_pos_act_rad"] == pytest.approx(np.radians(0.03))


# --- refusals ---------------------------------------------------------------------------------------------------------

ANNA, BEN = (Identity("c", name, Role.VIEWER, "console") for name in ("anna", "ben"))
HALT = Message("halt", 1, "", 1, {})
NOT_YOURS = MessageRefused(Code.SEC_07, reason=Words.TAKE_CONTROL_FIRST)


class Refused:
    """Refusals on a clock of the test's own, and the rows that are written."""

    def __init__(self) -> None:
        self.now_s, self.ring = 1000.0, ring(4096, 512)
        self.log = RefusalLog(EventLog(self.ring), lambda: self.now_s)

    def rows(self) -> list[dict[str, Any]]:
        found = []
        while (record := self.ring.take()) is not None:
            found.append(json.loads(record))
        return found


def test_what_is_refused_all_day_has_a_row_every_ten_minutes_with_its_own_time() -> None:
    """After 10, 20, 40 ... 320 s, and then 600: each row counts from the one before."""
    made = Refused()
    for _ in range(3600):
        made.log.put(ANNA, HALT, NOT_YOURS)
        made.now_s += 1.0
        made.log.look()
    spans = [row["text"].rpartition(" in ")[2] for row in made.rows()[1:]]
    assert spans == ["10 s", "20 s", "40 s", "80 s", "160 s", "320 s", *["600 s"] * 4]


def test_a_row_says_how_many_it_stands_for_unless_it_is_the_first_of_one() -> None:
    made = Refused()
    for count, later_s in ((2, 10.0), (3, 20.0)):
        for _ in range(count):
            made.log.put(ANNA, HALT, NOT_YOURS)
        made.now_s += later_s
        made.log.look()
    rows = made.rows()
    assert [row["values"].get("count") for row in rows] == [None, 1, 3]
    assert [row["text"].partition("; ")[2] for row in rows] == ["", "once in 10 s", "3 times in 20 s"]


def test_a_first_row_that_had_to_wait_says_how_many_it_stands_for() -> None:
    made = Refused()
    for n in range(100):
        made.log.put_text(ANNA, "read", "x", f"action {n}", NOT_YOURS)
    for _ in range(2):
        assert made.log.put(ANNA, HALT, NOT_YOURS) == 0
    made.rows()
    # One row more in ten seconds.
    for counts in ([], [2]):
        made.now_s += 5.0
        for _ in range(200):
            made.log.look()
        assert [row["values"].get("count") for row in made.rows()] == counts


@pytest.mark.parametrize(
    ("kind", "written"),
    [("note", "note"), ("set", "setting"), ("take", "authority"), ("give", "authority"), ("halt", "command")],
)
def test_a_refusal_has_the_kind_of_its_command_and_what_is_known_beside_it(kind: str, written: str) -> None:
    made = Refused()
    values = {"tag": "increment_deg", "over": False}
    made.log.put(ANNA, Message(kind, 1, "", 1, values), NOT_YOURS, {"address": "192.0.2.7"})
    (row,) = made.rows()
    assert row["kind"] == written
    assert row["values"]["code"] == "SEC-07"
    assert row["values"]["address"] == "192.0.2.7"


def test_what_is_refused_for_the_first_time_waits_for_no_row_of_another() -> None:
    """That of Anna is due in ten minutes, that of Ben in ten seconds."""
    made = Refused()
    for window_s in (10.0, 20.0, 40.0, 80.0, 160.0, 320.0, 0.0):
        for _ in range(2):
            made.log.put(ANNA, HALT, NOT_YOURS)
        made.now_s += window_s
        made.log.look()
    made.rows()
    for _ in range(2):
        made.log.put(BEN, HALT, NOT_YOURS)
    made.now_s += 10.0
    made.log.look()
    rows = made.rows()
    assert [(row["user"], row["values"].get("count")) for row in rows] == [("ben", None), ("ben", 1)]


def test_an_account_that_has_used_its_rows_up_takes_none_from_another() -> None:
    made = Refused()
    written = [made.log.put_text(ANNA, "read", "x", f"action {n}", NOT_YOURS) for n in range(150)]
    assert sum(number > 0 for number in written) == 100
    assert made.log.put(BEN, HALT, NOT_YOURS) == 101


def test_256_causes_have_a_row_each_and_all_others_one() -> None:
    made = Refused()
    for n in range(300):
        who = Identity("c", f"user {n}", Role.VIEWER, "console")
        made.log.put(who, HALT, NOT_YOURS)
    made.log.close()
    counts = [row["values"].get("count", 1) for row in made.rows()]
    assert (len(counts), counts[-1], sum(counts)) == (258, 43, 300)


# --- rings ------------------------------------------------------------------------------------------------------------


def test_records_behind_the_first_ones_are_looked_at_as_many_as_are_asked_for() -> None:
    made = ring(8)
    for text in (b"a", b"b", b"c", b"d"):
        made.put(text)
    assert [made.peek(2, skip) for skip in range(5)] == [
        [b"a", b"b"], [b"b", b"c"], [b"c", b"d"], [b"d"], []
    ]  # fmt: skip


def test_whoever_looks_on_gets_what_is_there_from_a_number_that_is() -> None:
    made = ring(4)
    assert made.look(0, 9) == (0, [])
    for text in (b"a", b"b"):
        made.put(text)
    assert made.look(-5, 9) == (0, [b"a", b"b"])
    assert made.look(99, 9) == (2, [])
    made.clear()
    for text in (b"c", b"d", b"e"):
        made.put(text)
    # The oldest place is the next to be written.
    assert made.look(0, 9) == (2, [b"c", b"d", b"e"])
    assert made.look(1, 0) == (1, [])


def test_a_ring_whose_numbers_are_wrong_holds_nothing() -> None:
    made = ring(4)
    made.put(b"a")
    made._words[0] = 9
    assert (len(made), made.peek(9), made.damaged) == (0, [], 1)
    made.put(b"b")
    assert made.take() == b"b"
