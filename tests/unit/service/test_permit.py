"""Permission to switch power on: which reset clears which reason, what is locked, what a drive set up again changes."""

from __future__ import annotations

import json
import time
from types import SimpleNamespace
from typing import Any

import pytest

from gantryctl.program.alarms.codes import Code
from gantryctl.program.alarms.reason import ClearedBy, Reason
from gantryctl.service.command.permit import Permit
from gantryctl.service.memory.events import RESERVE, EventLog
from gantryctl.service.memory.memory import JournalHealth, JournalState, Word
from gantryctl.service.memory.ring import Ring
from gantryctl.service.protocol.messages import Identity, MessageRefused
from gantryctl.service.protocol.roles import Role

WHO = Identity("page", "anna", Role.SERVICE, "console")
# After an earlier stop by the brake, by the encoder; drive limits that differ; a setting that can be reset.
EARLIER = Reason(Code.SYS_12, {"stopped_by": Code.BRK_01, "measured": "1"}, ClearedBy.RESET)
SERVICE = Reason(Code.SYS_12, {"stopped_by": Code.ENC_01, "measured": "1"}, ClearedBy.SERVICE)
BUS = Reason(Code.CFG_CAN_01, {"reason": "limits of the drive differ"}, ClearedBy.RESET)
LASTING = Reason(Code.CFG_CAN_02, {"why": "never was"}, ClearedBy.COMMISSIONING)


def axis(*, valid: bool = True, locked: bool = False) -> Any:
    alarm = SimpleNamespace(definition=SimpleNamespace(lock=locked))
    return SimpleNamespace(
        feedback=SimpleNamespace(position_valid=valid), alarms=SimpleNamespace(active={1: alarm})
    )


def permit(
    *reasons: Reason, slots: int = RESERVE + 8, journal: int = JournalState.OK, **of_axis: bool
) -> Permit:
    words = memoryview(bytearray(512)).cast("Q")
    words[Word.RECORDER_NS], words[Word.JOURNAL_STATE] = time.monotonic_ns() + 10**15, journal
    log = EventLog(Ring(memoryview(bytearray(192 + slots * 1024)), 1024))
    return Permit(axis(**of_axis), JournalHealth(words), log, reasons)


def refused_by(found: Permit, *, service: bool) -> str:
    try:
        found.reset(WHO, service=service)
    except MessageRefused as refused:
        return str(refused.refusal.code)
    return ""


def test_what_no_reset_clears_stands_first_and_stays() -> None:
    found = permit(EARLIER, LASTING)
    assert found.lasting is LASTING
    assert list(found.blocked_by) == [LASTING]
    assert list(found.held) == [EARLIER]
    assert refused_by(found, service=True) == "CFG-CAN-02"
    assert found.reasons == (EARLIER, LASTING)
    assert found.resets == 1


def test_a_reset_clears_what_it_may() -> None:
    found = permit(EARLIER)
    assert list(found.blocked_by) == [EARLIER]
    assert refused_by(found, service=False) == ""
    assert not found.blocked_by
    assert refused_by(found, service=False) == ""
    assert found.resets == 2


def test_what_service_clears_an_operator_does_not() -> None:
    found = permit(EARLIER, SERVICE)
    assert refused_by(found, service=False) == "CTL-14"
    assert found.reasons == (EARLIER, SERVICE)
    assert refused_by(found, service=True) == ""
    assert not found.blocked_by


def test_a_drive_that_was_set_up_again_is_judged_anew_and_nothing_else() -> None:
    found = permit(EARLIER, BUS)
    found.judge_bus(())
    assert found.reasons == (EARLIER,)
    found.judge_bus((LASTING,))
    assert found.reasons == (LASTING, EARLIER)  # what no reset clears stands first
    found.judge_bus((BUS,))
    assert found.reasons == (EARLIER, BUS)


@pytest.mark.parametrize(
    ("reasons", "journal", "of_axis", "locked"),
    [
        ((), JournalState.OK, {}, False),
        ((EARLIER,), JournalState.OK, {}, False),
        ((SERVICE,), JournalState.OK, {}, True),
        ((), JournalState.LOCKED, {}, True),
        ((), JournalState.OK, {"valid": False}, True),
        ((), JournalState.OK, {"locked": True}, True),
    ],
)
def test_what_only_the_service_role_may_reset(
    reasons: tuple[Reason, ...], journal: int, of_axis: dict[str, bool], locked: bool
) -> None:
    assert permit(*reasons, journal=journal, **of_axis).reset_locked is locked


def test_the_angle_is_in_doubt_by_the_encoder_and_not_by_the_brake() -> None:
    assert permit(EARLIER, SERVICE).doubts_position
    assert not permit(EARLIER).doubts_position


def test_events_need_a_journal_that_keeps_them_and_room_on_the_way() -> None:
    assert permit().keeps_events
    assert permit(journal=JournalState.SLOW).keeps_events
    assert not permit(journal=JournalState.FAILED).keeps_events
    assert not permit(slots=RESERVE).keeps_events


def test_service_acknowledges_a_damaged_journal_by_an_event_of_that_kind() -> None:
    """An event of the kind `journal` frees the lock of the journal: an operator's reset must not write one."""
    damaged, sound = JournalState.LOCKED, JournalState.OK
    for journal, service, kinds in (
        (damaged, False, []), (damaged, True, [b'"kind":"journal"']), (sound, True, []),
    ):  # fmt: skip
        found = permit(journal=journal)
        assert refused_by(found, service=service) == ""
        events = found._events._ring.peek(10)
        assert [kind for each in events if each for kind in [b'"kind":"journal"'] if kind in each] == kinds


def test_what_a_reset_acknowledges_stands_in_the_journal_with_its_person() -> None:
    found = permit(EARLIER)
    log: Any = found._events
    assert refused_by(found, service=False) == ""
    (event,) = [json.loads(each) for each in log._ring.peek(10) if each is not None]
    assert (event["kind"], event["user"]) == ("command", "anna")
    assert event["text"] == f"acknowledged: {EARLIER}"
