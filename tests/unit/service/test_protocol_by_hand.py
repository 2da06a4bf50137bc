"""The protocol by hand: what a message, a reply, a mark, a right and a tag are, and how the schemas say it."""

from __future__ import annotations

import re
from typing import Any

import pytest

from gantryctl.image import DriveState, Mode
from gantryctl.program import AxisState, BrakeTestOutcome, BrakeTestPhase, PowerPhase
from gantryctl.program.alarms.codes import Code
from gantryctl.program.alarms.words import Words
from gantryctl.service.memory.memory import JournalState
from gantryctl.service.protocol import answers, limits, messages
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
from gantryctl.service.protocol.tags import ALARM_ROW, BY_NAME, CommissioningPhase

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
    for digits, fits in ((15, True), (16, False), (0, False)):
        assert (re.search(MARK_PATTERN, f"{'9' * digits}-{'a' * 16}") is not None) is fits
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


# --- limits -----------------------------------------------------------------------------------------------------------


def test_times_and_rates_are_those_of_the_manual() -> None:
    """docs/explanation/security.md and decision 0011, in seconds, bytes and messages a second."""
    wanted = {
        "MESSAGE_MAX": 16_384, "FRAME_S": 0.05, "KEY_FRAME_S": 0.02, "VIEW_MAX_S": 0.5, "STALE_S": 0.5,
        "RENEW_S": 0.03, "HELD_S": 30.0, "SILENCE_S": 2.0, "WATCHED_S": 1.0, "ARMED_S": 10.0, "LINK_S": 60.0,
        "ANSWER_S": 1.0, "KEEP_S": 1.0, "COMMANDS_PER_S": 20.0, "SIGNS_PER_S": 100.0, "FLOOD_PER_S": 200.0,
        "FLOOD_BYTES": 1024, "_SENDERS": 10_000,
    }  # fmt: skip
    assert {name: getattr(limits, name) for name in wanted} == wanted


def test_a_bucket_is_never_fuller_than_its_reserve_and_gives_whole_tokens() -> None:
    """Two a second, three at once: after a night three, and then one in half a second."""
    now_s = 0.0
    rate = limits.RateLimiter(2.0, 3.0, now=lambda: now_s)
    for now_s in (0.0, 80_000.0):  # noqa: B007 - the limiter looks at it
        assert [rate.wait_s() for _ in range(5)] == [0.0, 0.0, 0.0, 0.5, 0.5]
    now_s += 0.49
    assert rate.wait_s() == pytest.approx(0.01)
    now_s += 0.02
    assert rate.wait_s() == 0.0
    assert limits.RateLimiter(2.0, 0.0, now=lambda: now_s).wait_s() == 0.5


# --- what a message needs ---------------------------------------------------------------------------------------------


def test_what_stops_needs_no_frame_and_a_note_no_epoch() -> None:
    """A line of the shift log is right whatever has changed since; a sign of life counts by its frame."""
    assert {"stop", "quick_stop", "release"} == messages.WITHOUT_FRAME
    assert {"stop", "quick_stop", "release", "alive", "note"} == messages.WITHOUT_EPOCH
    assert {"stop", "quick_stop", "release", "alive", "renew"} == messages.FREE
    assert {"alive", "renew"} == messages.SILENT
    assert {
        "power", "increment", "move", "move_by", "reset", "acknowledge", "set", "note", "brake_test",
        "commission_begin", "commission_step", "commission_end",
    } == messages.KEPT_FIRST  # fmt: skip


@pytest.mark.parametrize(
    ("kind", "values", "waits"),
    [
        ("power", {"on": True}, True), ("power", {"on": False}, False), ("move", {"target_deg": 0.0}, True),
        ("jog", {"lease": "a"}, False), ("halt", {}, False), ("stop", {}, False), ("take", {"over": True}, False),
    ],
)  # fmt: skip
def test_power_on_waits_for_its_event_and_power_off_for_nothing(
    kind: str, values: dict[str, Any], waits: bool
) -> None:
    assert messages.is_kept_first(Message(kind, 1, "", 1, values)) is waits


@pytest.mark.parametrize(
    ("place", "local", "remote"),
    [("local", True, False), ("console", False, False), ("remote", False, True), ("", False, True)],
)
def test_whoever_has_not_proved_to_be_here_is_remote(place: str, local: bool, remote: bool) -> None:
    who = Identity("c", "anna", Role.OPERATOR, place)
    assert (who.local, who.remote) == (local, remote)


@pytest.mark.parametrize(
    ("change", "cause"),
    [
        ('"target_deg":"a"', "move: 'epoch' is missing"),
        ('"epoch":"a","target_deg":1,"more":2', "move: 'more' is not a key of it"),
        ('"epoch":1,"target_deg":"a"', "move: 'target_deg' is not a finite number"),
    ],
)
def test_a_key_too_few_or_too_many_is_told_before_a_wrong_value(change: str, cause: str) -> None:
    with pytest.raises(MessageRefused) as refused:
        parse(f'{{"type":"move","seq":1,"frame":"1-0123456789abcdef",{change}}}')
    assert str(refused.value) == cause


# --- tags -------------------------------------------------------------------------------------------------------------


def test_the_unit_of_a_tag_is_that_of_its_name() -> None:
    units = {
        "_deg_s2": "deg/s2", "_deg_s": "deg/s", "_deg": "deg", "_nm": "N m", "_us": "us", "_ms": "ms", "_s": "s",
        "_percent": "%",
    }  # fmt: skip
    for name, tag in BY_NAME.items():
        wanted = next((unit for ending, unit in units.items() if name.endswith(ending)), "")
        assert tag.unit == wanted, name


def test_each_word_has_the_number_of_its_place() -> None:
    """A packed number is the place of a word among the labels."""
    words = {
        "axis_state": AxisState, "drive_state": DriveState, "power_phase": PowerPhase, "mode": Mode,
        "brake_test_phase": BrakeTestPhase, "brake_test_result": BrakeTestOutcome,
        "commissioning": CommissioningPhase, "journal_state": JournalState,
    }  # fmt: skip
    for name, kind in words.items():
        assert [each.value for each in kind] == list(range(len(kind))), name
        assert BY_NAME[name].labels == tuple(each.name.lower() for each in kind)
    assert {name for name, tag in BY_NAME.items() if tag.kind == "enum"} == {*words, "armed_action"}


def test_what_moves_is_told_twenty_times_a_second_and_who_may_set_what() -> None:
    moving = (
        "pos_act_deg", "vel_act_deg_s", "pos_ref_deg", "vel_ref_deg_s", "pos_err_deg", "torque_act_nm", "time_left_s",
        "stopping_angle_deg", "key_lost_angle_deg", "quick_stop_angle_deg", "travel_left_minus_deg", "axis_state",
        "brake_open", "horn", "estop_ok", "lease_left_ms", "following_error_trip_deg", "brake_test_torque_nm",
    )  # fmt: skip
    assert {BY_NAME[name].rate for name in moving} == {"20 Hz"}
    assert {name: tag.role for name, tag in BY_NAME.items() if tag.role != "viewer"} == {
        "mode": "operator", "speed_setting_deg_s": "operator", "increment_deg": "operator",
        "override_percent": "operator", "acc_setting_deg_s2": "physicist",
    }  # fmt: skip


# --- descriptions -----------------------------------------------------------------------------------------------------


def test_what_may_be_missing_or_unknown_is_described_so() -> None:
    """A client that checks what it gets would refuse a state that there is."""
    kinds: dict[str, Any] = {
        name: schema["properties"] for name, schema in SCHEMAS.items() if "properties" in schema
    }
    null = ["number", "null"]
    assert SCHEMAS["Tags"]["properties"]["no_go_deg"]["items"] == {
        "type": "array", "items": {"type": "number"}, "minItems": 2, "maxItems": 2,
    }  # fmt: skip
    assert kinds["Visitor"]["place"] == {"enum": ["console", "remote"]}
    assert kinds["CommissioningStep"]["outcome"] == {"enum": ["", "passed", "failed", "not_testable"]}
    figure = kinds["CommissioningStep"]["figures"]["additionalProperties"]["properties"]
    assert figure == {key: {"type": null} for key in ("value", "low", "high")}
    assert kinds["Health"]["controller"] == {"enum": ["ok", "silent"]}
    assert [kinds["Samples"][key]["type"] for key in ("period_s", "newest_s", "utc_s")] == [
        null,
        null,
        "number",
    ]
    sampled = kinds["Samples"]["tags"]["properties"]
    assert sampled["pos_act_deg"]["items"] == {"type": null}
    assert "machine" not in sampled
    assert kinds["Samples"]["tags"]["required"] == []
    assert kinds["Columns"]["utc_s"]["type"] == null
    assert {name for name, schema in SCHEMAS.items() if schema.get("additionalProperties", True)} == {
        "Message", "Description"
    }  # fmt: skip


def test_a_refusal_that_was_made_by_hand_has_no_number() -> None:
    """0 stands for none: a page waits for the numbers that it has given."""
    refused = MessageRefused(Code.SEC_07, reason=Words.TAKE_CONTROL_FIRST)
    assert (refused.seq, refused.exit_code) == (0, 2)


@pytest.mark.parametrize(("length", "shown"), [(40, 40), (41, 40), (500, 40)])
def test_of_a_key_that_nobody_knows_forty_letters_are_told(length: int, shown: int) -> None:
    with pytest.raises(MessageRefused) as refused:
        parse(f'{{"type":"stop","seq":1,"{"k" * length}":1}}')
    assert str(refused.value) == f"stop: '{'k' * shown}' is not a key of it"


def test_of_a_value_beyond_its_limit_forty_letters_are_told() -> None:
    with pytest.raises(MessageRefused) as refused:
        parse(f'{{"type":"stop","seq":{"9" * 60}}}')
    assert str(refused.value) == f"stop: 'seq' {'9' * 40} is beyond 9007199254740992"
    assert refused.value.seq == 0


def test_a_number_begins_at_0() -> None:
    samples = SCHEMAS["Samples"]["properties"]
    assert [samples[key]["minimum"] for key in ("from", "next", "newest")] == [0, 0, 0]


# --- records ----------------------------------------------------------------------------------------------------------


def test_a_record_has_its_sender_and_its_message_in_any_script() -> None:
    """A line of 120 letters of four bytes finds its place in the ring of commands, 1,016 bytes; escapes would not."""
    who = Identity("c1", "anna.s", Role.PHYSICIST, "console", "anna")
    message = {"type": "note", "line": "\U0001f527" * 120}
    record = to_record(who, message)
    assert messages.from_record(record) == (who, message)
    assert len(record) < 1016


@pytest.mark.parametrize(
    "record",
    [b"", b"7", b"[]", b"[" * 100_000, b'["c","anna","operator","console","",7]',
     b'["c","anna","operator","console",{}]', b'["c","anna","king","console","",{}]'],
)  # fmt: skip
def test_a_damaged_record_is_a_wrong_value(record: bytes) -> None:
    """The scan leaves it out and goes on."""
    with pytest.raises(ValueError):  # noqa: PT011 - whichever it is
        messages.from_record(record)


@pytest.mark.parametrize(
    ("step", "taken"), [("ring", True), ("a" * 20, True), ("a" * 21, False), ("", False), ("../x", False)]
)
def test_a_step_has_twenty_letters_at_most(step: str, taken: bool) -> None:
    text = f'{{"type":"commission_step","seq":1,"frame":"1-0123456789abcdef","epoch":1,"step":"{step}"}}'
    if taken:
        assert parse(text).values == {"step": step}
        return
    with pytest.raises(MessageRefused) as refused:
        parse(text)
    assert str(refused.value.refusal.code) == "SEC-05"


def test_events_recordings_and_alarms_are_described_key_by_key() -> None:
    """A client that checks what it gets knows each key, and which may be null."""
    kinds: dict[str, Any] = {
        name: {key: each.get("type") for key, each in SCHEMAS[name]["properties"].items()}
        for name in ("Event", "Recording", "AlarmRow", "Note")
    }
    assert kinds["Event"] == {
        **dict.fromkeys(("seq", "boot", "source", "number", "monotonic_ns"), "integer"),
        **dict.fromkeys(
            ("utc", "kind", "user", "role", "client", "place", "text", "detail", "hash"), "string"
        ),
    }
    assert kinds["Recording"] == {"id": "string", "name": "string", "size": "integer", "modified": "string"}
    assert kinds["Note"] == {"seq": "integer", "utc": "string", "user": "string", "text": "string"}
    assert {key: kind for key, kind in kinds["AlarmRow"].items() if kind != "string"} == {
        "id": "integer", "values": "object", "steps": "array", "time_s": "number",
        "pos_act_deg": ["number", "null"], **dict.fromkeys(("active", "first_out", "lock"), "boolean"),
    }  # fmt: skip


def test_a_description_has_no_other_keys_and_tells_units_and_nulls() -> None:
    """As they are made, one by one."""
    assert exactly({"a": {}}) == {
        "type": "object", "properties": {"a": {}}, "required": ["a"], "additionalProperties": False
    }  # fmt: skip
    described = {name: answers._of_tag(BY_NAME[name]) for name in ("pos_act_deg", "power", "axis_state")}
    assert {name: (each["type"], each.get("x-unit")) for name, each in described.items()} == {
        "pos_act_deg": (["number", "null"], "deg"), "power": ("boolean", None), "axis_state": ("string", None)
    }  # fmt: skip
    assert described["axis_state"]["enum"] == [each.name.lower() for each in AxisState]
    assert described["power"]["description"] == BY_NAME["power"].meaning


def test_each_thing_that_is_told_is_described_with_all_its_keys_and_no_other() -> None:
    """A client that checks what it gets refuses what has one more or one less."""
    keys = {
        "Error": "error", "Person": "user person role may", "Health": "controller", "Alarms": "active history",
        "TagRow": "name unit type direction rate role meaning labels null", "Status": "type fresh age_ms tags",
        "Samples": "period_s from next newest newest_s utc_s tags", "Recording": "id name size modified",
        "Commissioning": "machine drive complete note steps ledger open",
        "CommissioningStep": "key title does moves offered outcome proof to_do at by figures",
        "Columns": "name machine utc_s end_s columns", "Note": "seq utc user text",
        "Event": "seq boot source number utc monotonic_ns kind user role client place text detail hash",
        "Visitor": "client user person role place", "AlarmRow": " ".join(ALARM_ROW),
    }  # fmt: skip
    for name, wanted in keys.items():
        schema = SCHEMAS[name]
        assert list(schema["properties"]) == wanted.split() == schema["required"], name
    assert set(SCHEMAS) == {*keys, "Message", "Tags", "Event", "Description"}
    row, status = SCHEMAS["TagRow"]["properties"], SCHEMAS["Status"]["properties"]
    assert row["type"]["enum"] == ["float", "int", "bool", "text", "pairs", "rows", "messages", "enum"]
    assert status["type"] == {"const": "status"}
    assert SCHEMAS["Event"]["properties"]["detail"]["contentMediaType"] == "application/json"
    *coded, plain = SCHEMAS["Message"]["anyOf"]
    assert [each["required"] for each in coded] == [[key, "values"] for key in ("code", "reason", "words")]
    assert plain == {"type": "string"}


def test_what_is_sent_has_the_letters_of_its_words() -> None:
    assert messages.compact({"a": ["门", 1]}) == '{"a":["门",1]}'
