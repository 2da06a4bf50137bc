"""What the desk of a commissioning shows: tags of the step under way, and the board of steps."""

from __future__ import annotations

import json
import math
from types import SimpleNamespace
from typing import Any

import pytest

from gantryctl.commissioning import STEPS, Commissioning, Outcome, StepResult
from gantryctl.commissioning.in_service.board import offered
from gantryctl.commissioning.in_service.tags import fast_tags, slow_tags
from gantryctl.commissioning.results import Figure
from gantryctl.commissioning.watch import Seen, StepWatch
from gantryctl.engineering.report.meter import Meter
from gantryctl.image import DigitalInputs, DriveFeedback, DriveState, EncoderFlag
from gantryctl.operation.ledger import LedgerRow, Standing
from gantryctl.service.memory.snapshot import FAST
from gantryctl.service.protocol.messages import MessageRefused
from gantryctl.service.protocol.tags import BY_NAME
from unit.commissioning.desk_room import ANNA, MACHINE, Room

INPUTS = ("limit_minus_ok", "limit_plus_ok", "estop_ok", "enabling_switch", "mains_ready")
SITE = ("collision_ok", "door_ok", "motion_permit", "estop_ok_2")


@pytest.mark.parametrize("name", [*INPUTS, *SITE])
@pytest.mark.parametrize("brake_open", [True, False])
def test_the_page_shows_what_the_drive_shows(name: str, brake_open: bool) -> None:
    """One input that is off, and no other one."""
    drive = DriveFeedback(
        DriveState.SWITCHED_ON, 0, 0.0, -12.5, brake_open, False, 0.0, EncoderFlag.NONE,
        inputs=DigitalInputs()._replace(**dict.fromkeys(SITE, True) | {name: False}),
    )  # fmt: skip
    tags = fast_tags(MACHINE, Seen(-90.25, 0.5, drive), moves=True, holds_load=False)
    assert {each for each in (*INPUTS, *SITE) if not tags[each]} == {name}
    bare = drive._replace(inputs=DigitalInputs())
    assert all(
        math.isnan(fast_tags(MACHINE, Seen(0.0, 0.0, bare), moves=True, holds_load=False)[each])
        for each in SITE
    )
    assert (tags["pos_act_deg"], tags["vel_act_deg_s"], tags["torque_act_nm"]) == (-90.25, 0.5, -12.5)
    assert (tags["brake_open"], tags["drive_state"]) == (brake_open, DriveState.SWITCHED_ON)
    assert tags["brake_open_cmd"] == brake_open
    # An angle that nobody knows is not shown.
    lost = fast_tags(MACHINE, Seen(None, None, drive), moves=True, holds_load=False)
    assert math.isnan(lost["pos_act_deg"])
    assert (lost["pos_ref_deg"], tags["pos_ref_deg"]) == (0.0, -90.25)
    # Nobody has read a drive, or a program has it.
    for seen in (None, Seen(-90.25, 0.5, None)):
        assert fast_tags(MACHINE, seen, moves=True, holds_load=False)["drive_state"] is DriveState.UNKNOWN


def test_what_cannot_be_while_the_axis_is_commissioned() -> None:
    """No motion, no reset, nothing refused; the page of the commissioning is open."""
    tags = slow_tags(MACHINE, None, None, second_person=False)
    assert (tags["mode"], tags["reset_locked"], tags["commissioning_available"]) == ("none", False, True)
    assert (tags["refusal_text"], tags["refusal_messages"]) == ("", [])


def test_tags_that_may_not_be_null_are_not(free_room: Room) -> None:
    free_room.begun("velocity")
    tags = free_room.tags
    assert {name for name in FAST if tags[name] is None and not BY_NAME[name].null} == set()
    assert tags["pos_act_deg"] is None
    assert math.isfinite(tags["armed_left_s"])
    assert tags["at_rest"] is False
    assert tags["blocked_by"] == "the axis is being commissioned: end the commissioning first"


def test_what_a_step_sees_is_told_while_it_runs(free_room: Room, monkeypatch: pytest.MonkeyPatch) -> None:
    watch = StepWatch(Meter(lambda line: None, 20.0, lambda: 0.0), free_room.desk.halt)
    watch.seen = Seen(12.5, 0.25, None)
    watch.meter.advance(5.0)
    monkeypatch.setattr(free_room.work, "watch", watch)
    assert (free_room.tags["pos_act_deg"], free_room.tags["commissioning_left_s"]) == (None, None)
    free_room.begun("velocity")
    tags = free_room.tags
    assert (tags["pos_act_deg"], tags["vel_act_deg_s"]) == (12.5, 0.25)
    assert tags["commissioning_left_s"] == pytest.approx(watch.meter.left_s)


def test_a_board_without_a_drive_is_not_complete(room: Room) -> None:
    room.board.refuse("a machine", "no drive answers")
    shown = json.loads(room.memory.commissioning.read() or b"")
    assert (shown["machine"], shown["complete"], shown["note"]) == ("a machine", False, "no drive answers")
    assert shown["steps"] == shown["ledger"] == shown["open"] == []
    with pytest.raises(MessageRefused):
        room.board.step("identity")


def test_a_board_tells_of_a_step_what_its_result_tells(room: Room) -> None:
    result = StepResult(
        "identity", Outcome.FAILED, "as it was", {"way_deg": Figure(0.5, None, 0.4)}, "what to do", 7.0, 5.0,
        "2026-11-20", "eve",
    )  # fmt: skip
    rows = (LedgerRow("shown", Standing.PROVEN, "sign"), LedgerRow("left", Standing.LACKING, proof="brake"))
    asked = next(each for each in STEPS if each.key == "identity")
    progress = SimpleNamespace(results={"identity": result}, drive="maker 1")
    work: Any = SimpleNamespace(
        progress=progress, ledger=rows, steps=(asked,), machine=MACHINE, complete=False
    )
    room.board.show(work, "a note")
    shown = json.loads(room.memory.commissioning.read() or b"")
    assert shown.pop("steps") == [
        {
            "key": "identity", "title": "Identity", "does": asked.does, "moves": "", "offered": True,
            "outcome": "failed", "proof": "as it was", "to_do": "what to do", "at": "2026-11-20", "by": "eve",
            "figures": {"way_deg": {"value": 0.5, "low": None, "high": 0.4}},
        }
    ]  # fmt: skip
    assert shown == {
        "machine": MACHINE.name, "drive": "maker 1", "complete": False, "note": "a note",
        "ledger": [row.text for row in rows], "open": [rows[1].text],
    }  # fmt: skip


def test_what_is_armed_and_a_new_board_are_shown_at_once(free_room: Room) -> None:
    assert free_room.ask(ANNA, "take", over=False) == ""
    before = free_room.tags
    assert (before["armed_action"], before["commissioning_results"]) == ("none", 1)
    assert free_room.ask(ANNA, "arm", action="commission", step="velocity") == ""
    tags = free_room.tags
    assert (before["armed_step"], tags["armed_action"], tags["armed_step"]) == ("", "commission", "velocity")
    free_room.board.show(free_room.work)
    assert free_room.tags["commissioning_results"] == 2


def test_what_was_written_is_told_apart_from_what_is_kept(free_room: Room) -> None:
    """No recorder takes the events of this room."""
    free_room.begun("velocity")
    tags = free_room.tags
    assert tags["journal_sequence"] > 0
    assert tags["journal_committed"] == 0


@pytest.mark.parametrize(("key", "at_rest"), [("identity", True), ("velocity", False)])
def test_only_a_step_that_moves_is_no_rest(free_room: Room, key: str, at_rest: bool) -> None:
    free_room.begun(key)
    assert free_room.tags["at_rest"] is at_rest


def test_a_page_knows_whether_a_second_person_is_wanted(work: Commissioning) -> None:
    assert [Room(work, second_person=wanted).tags["second_person"] for wanted in (True, False)] == [
        True,
        False,
    ]


@pytest.mark.parametrize("complete", [True, False])
def test_a_board_is_complete_when_the_commissioning_is(room: Room, complete: bool) -> None:
    """Nothing of the ledger is open, and yet a step may be."""
    progress = SimpleNamespace(results={}, drive="maker 1")
    machine = SimpleNamespace(name="m")
    made: Any = SimpleNamespace(progress=progress, ledger=(), steps=(), machine=machine, complete=complete)
    room.board.show(made)
    shown = json.loads(room.memory.commissioning.read() or b"")
    assert (shown["machine"], shown["drive"], shown["complete"], shown["open"]) == (
        "m",
        "maker 1",
        complete,
        [],
    )


def test_a_page_has_no_step_that_needs_hands_or_an_instrument() -> None:
    assert {step.key for step in STEPS if not offered(step)} == {"wiring", "accuracy"}
