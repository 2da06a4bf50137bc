"""The protocol by hand: what a message, a reply, a mark, a right and a tag are, and how the schemas say it."""

from __future__ import annotations

import re

import pytest

from gantryctl.program.alarms.codes import Code
from gantryctl.service.memory.memory import JournalState
from gantryctl.service.protocol.answers import SCHEMAS, exactly, list_of
from gantryctl.service.protocol.frames import MARK_PATTERN, mark_of
from gantryctl.service.protocol.messages import (
    Identity,
    Message,
    MessageRefused,
    action_of,
    parse,
    reply_to,
    to_record,
)
from gantryctl.service.protocol.roles import Action, Role, may, rights_of
from gantryctl.service.protocol.tags import ALARM_ROW, BY_NAME

KIB = 1024
STOP = '{"type":"stop","seq":7}'


def test_a_message_has_16_kib_at_most() -> None:
    assert parse(STOP.ljust(16 * KIB)).kind == "stop"
    with pytest.raises(MessageRefused, match=r"16385.*16384") as refused:
        parse(STOP.ljust(16 * KIB + 1))
    assert str(refused.value.refusal.code) == "SEC-05"


@pytest.mark.parametrize(
    ("text", "seq"),
    [
        ("[]", 0), ('{"type":"x"}', 0), ('{"type":"x","seq":7}', 7), ('{"type":"x","seq":true}', 0),
        ('{"type":"x","seq":-1}', 0), (f'{{"type":"x","seq":{2**53}}}', 2**53),
        (f'{{"type":"x","seq":{2**53 + 1}}}', 0),
    ],
)  # fmt: skip
def test_a_refused_message_has_its_number_where_it_is_one(text: str, seq: int) -> None:
    with pytest.raises(MessageRefused) as refused:
        parse(text)
    assert refused.value.seq == seq
    assert refused.value.exit_code == 2


def test_a_record_holds_no_number_that_is_none() -> None:
    with pytest.raises(ValueError, match="not JSON compliant"):
        to_record(
            Identity("c", "anna", Role.OPERATOR, "console"), {"type": "move", "target_deg": float("nan")}
        )


def test_a_reply_names_no_event_and_no_epoch_unless_it_has_them() -> None:
    assert reply_to(7) == {
        "type": "reply", "seq": 7, "ok": True, "code": "", "text": "", "values": {}, "epoch": None, "journal": 0,
    }  # fmt: skip


def test_a_mark_is_of_its_frame_and_connection_and_has_the_form_that_is_checked() -> None:
    mark = mark_of(1250, 5, "anna")
    assert re.fullmatch(MARK_PATTERN, mark)
    assert mark.startswith("1250-")
    assert len({mark, mark_of(1251, 6, "anna"), mark_of(1250, 6, "anna"), mark_of(1250, 5, "ben")}) == 4


def test_what_stands_in_no_table_is_nobodys_right() -> None:
    unknown: Action = "dance"  # type: ignore[assignment]
    assert not any(may(role, unknown) for role in Role)
    assert rights_of(Role.VIEWER) == ["view", "stop", "quick_stop"]
    assert rights_of(Role.ADMIN) == ["view", "stop", "quick_stop", "journal", "users"]


def test_what_may_be_unknown_is_null_and_nothing_else() -> None:
    """A client that reads an unknown brake as closed, or asks for a tag that has not come, misleads people."""
    assert [BY_NAME[name].null for name in ("brake_open", "pos_act_deg", "door_ok", "pos_ref_deg", "estop_ok")] == [
        True, True, True, False, False
    ]  # fmt: skip
    assert [key for key, row in ALARM_ROW.items() if row.null] == ["pos_act_deg"]
    assert {name for name, tag in BY_NAME.items() if tag.direction == "both"} == {
        "mode", "speed_setting_deg_s", "increment_deg", "override_percent", "acc_setting_deg_s2",
    }  # fmt: skip
    tags = SCHEMAS["Tags"]
    assert [tags["properties"][name]["type"] for name in ("brake_open", "estop_ok", "pos_act_deg")] == [
        ["boolean", "null"], "boolean", ["number", "null"],
    ]  # fmt: skip
    assert tags["properties"]["pos_act_deg"]["x-unit"] == "deg"
    assert (tags["required"], tags["additionalProperties"]) == ([], False)
    assert exactly({"a": {}, "b": {}}, optional=["a"])["required"] == ["b"]
    assert list_of("AlarmRow") == {"type": "array", "items": {"$ref": "#/components/schemas/AlarmRow"}}
    assert SCHEMAS["Status"]["properties"]["age_ms"]["type"] == ["number", "null"]
    assert SCHEMAS["Status"]["required"] == ["type", "fresh", "age_ms", "tags"]


@pytest.mark.parametrize(
    ("kind", "values", "action"),
    [
        ("take", {"over": False}, "authority"), ("take", {"over": True}, "take_over"), ("give", {}, "authority"),
        ("power", {"on": True}, "power"), ("mode", {}, "mode"), ("jog", {}, "jog"), ("renew", {}, "jog"),
        ("release", {}, "view"), ("alive", {}, "view"), ("increment", {}, "jog"), ("move", {}, "move"),
        ("move_by", {}, "move"), ("halt", {}, "halt"), ("stop", {}, "stop"), ("quick_stop", {}, "quick_stop"),
        ("reset", {}, "reset"), ("acknowledge", {}, "acknowledge"), ("note", {}, "note"),
        ("brake_test", {}, "brake_test"), ("commission_begin", {}, "commission"), ("commission_step", {}, "commission"),
        ("commission_end", {}, "commission"), ("arm", {"action": "brake_test"}, "brake_test"),
        ("arm", {"action": "reset_locked"}, "reset_locked"), ("arm", {"action": "commission"}, "commission"),
        ("set", {"tag": "speed_setting_deg_s"}, "set_speed"), ("set", {"tag": "increment_deg"}, "set_increment"),
        ("set", {"tag": "override_percent"}, "set_override"),
        ("set", {"tag": "acc_setting_deg_s2"}, "set_acceleration"),
    ],
)  # fmt: skip
def test_every_message_asks_for_its_own_right(kind: str, values: dict[str, object], action: str) -> None:
    assert action_of(Message(kind, 1, "", None, values)) == action


def test_a_refusal_has_its_code_with_the_values_of_its_words() -> None:
    refused = MessageRefused(Code.SEC_13, measured=171.0, limit=150.0)
    reply = reply_to(7, refused, epoch=4, journal=9)
    assert (reply["ok"], reply["code"], reply["epoch"], reply["journal"]) == (False, "SEC-13", 4, 9)
    assert reply["values"] == {"measured": 171.0, "limit": 150.0}
    assert "171" in reply["text"]


def test_words_of_tags_stand_in_the_order_of_their_numbers() -> None:
    assert BY_NAME["journal_state"].labels == tuple(state.name.lower() for state in JournalState)
    assert BY_NAME["commissioning"].labels == ("none", "setting_up", "waiting", "running", "ending")
    assert BY_NAME["armed_action"].labels == ("none", "brake_test", "reset_locked", "commission")
    assert (BY_NAME["horn"].rate, BY_NAME["pos_act_deg"].unit, BY_NAME["vel_act_deg_s"].unit) == (
        "20 Hz",
        "deg",
        "deg/s",
    )
    assert BY_NAME["acc_setting_deg_s2"].role == "physicist"
    assert SCHEMAS["Person"]["properties"]["may"]["items"] == {"enum": list(Action)}
    assert SCHEMAS["Person"]["properties"]["role"] == {"enum": list(Role)}
