"""Every message is checked strictly: type, keys, kinds of values and their ranges."""

from __future__ import annotations

from typing import Any

import pytest

from gantryctl.image import Mode
from gantryctl.service.protocol.messages import (
    FIELDS,
    MESSAGES,
    SETTABLE,
    WITHOUT_EPOCH,
    WITHOUT_FRAME,
    Arm,
    ChooseMode,
    MessageRefused,
    Set,
    checked,
    parse,
)
from gantryctl.service.protocol.roles import ARMABLE

STAMP: dict[str, Any] = {"seq": 1, "frame": "2-0123456789abcdef", "epoch": 3}
LEASE = "0123456789abcdef"
WHOLE: dict[str, dict[str, Any]] = {
    "take": {"over": True}, "power": {"on": False}, "mode": {"mode": "none"},
    "jog": {"lease": LEASE, "direction": "forward"},
    "renew": {"lease": LEASE}, "release": {"lease": LEASE}, "increment": {"direction": "reverse"},
    "move": {"target_deg": 90}, "move_by": {"distance_deg": 1.5},
    "acknowledge": {"id": 7}, "commission_step": {"step": "identity"},
    "set": {"tag": "override_percent", "value": 40}, "arm": {"action": "brake_test"},
    "note": {"line": "门已修好 \U0001f527"},
}  # fmt: skip


@pytest.mark.parametrize("kind", sorted(FIELDS))
def test_a_whole_message_is_taken_with_its_values_as_they_came(kind: str) -> None:
    values = WHOLE.get(kind, {})
    message = checked({"type": kind, **STAMP, **values})
    assert (message.kind, message.seq) == (kind, 1)
    assert message.frame == ("" if kind in WITHOUT_FRAME else STAMP["frame"])
    assert message.epoch == (None if kind in WITHOUT_EPOCH else 3)
    assert [*message.values.items()] == [
        *values.items()
    ]  # in the order of the table: the journal writes it so
    assert all(type(each) is type(values[name]) for name, each in message.values.items())


@pytest.mark.parametrize("kind", sorted(FIELDS))
def test_each_key_is_needed_and_no_other_is_known(kind: str) -> None:
    whole = {"type": kind, **STAMP, **WHOLE.get(kind, {})}
    for name in whole:
        if (name == "epoch" and kind in WITHOUT_EPOCH) or (name == "frame" and kind in WITHOUT_FRAME):
            continue
        refuse({other: value for other, value in whole.items() if other != name})
    refuse({**whole, "more": 1}, "more")


def refuse(found: object, name: str = "") -> None:
    with pytest.raises(MessageRefused, match=name or None):
        checked(found)


WRONG: dict[str, list[Any]] = {
    "seq": [True, 1.0, -1, 2**53 + 1, "1", None],
    "frame": [False, 0.5, [1], 2, "2", "2-0123456789ABCDEF"],
    "epoch": ["3", None, -3, True],
    "over": [1, 0, "true", None],
    "target_deg": [True, "1", None, 1.1e9, -1.1e9, 10**400, float("nan"), float("inf"), [1.0]],
    "lease": ["0" * 15, "0" * 17, "ABCDEF0123456789", LEASE + "\n", 16, "\ud800" * 16],
    "direction": ["up", "", True, None],
    "id": [1.0, True, -1],
    "mode": ["NONE", 0, None],
    "tag": ["mode", "pos_act_deg", None],
    "action": ["power", "view", None],
    "line": ["", "x" * 121, "two\nlines", "\u2028", "\x1b[2J", "\ud800", 1, None],
}


@pytest.mark.parametrize("name", sorted(WRONG))
def test_values_of_another_kind_or_range_are_refused(name: str) -> None:
    kind = next((kind for kind, values in WHOLE.items() if name in values), "move")
    whole = {"type": kind, **STAMP, **WHOLE[kind]}
    checked(whole)
    for value in WRONG[name]:
        refuse({**whole, name: value}, f"^{kind}: '{name}' ")


@pytest.mark.parametrize(
    ("change", "cause"),
    [
        ({"target_deg": ...}, "move: 'target_deg' is missing"),
        ({"more": 1}, "move: 'more' is not a key of it"),
        ({"target_deg": ..., "more": 1}, "move: 'target_deg' is missing"),
        ({"target_deg": "5"}, "move: 'target_deg' is not a finite number"),
        ({"target_deg": float("nan")}, "move: 'target_deg' is not a finite number"),
        ({"target_deg": 1e12}, "move: 'target_deg' 1000000000000.0 is beyond 1000000000"),
        ({"target_deg": -1e12}, "move: 'target_deg' -1000000000000.0 is beyond -1000000000"),
        ({"seq": 2**53 + 1}, "move: 'seq' 9007199254740993 is beyond 9007199254740992"),
        ({"seq": 1.5}, "move: 'seq' is not a whole number"),
        ({"type": "jog", "lease": "x"}, "jog: 'lease' does not match ^[0-9a-f]{16}$"),
        ({"type": "jog", "lease": 7}, "jog: 'lease' is not a text"),
        ({"type": "jog", "direction": "up"}, "jog: 'direction' is not one of 'forward', 'reverse'"),
        ({"type": "take", "over": 1}, "take: 'over' is neither true nor false"),
    ],
)
def test_a_refusal_names_the_one_cause(change: dict[str, Any], cause: str) -> None:
    kind = change.get("type", "move")
    whole = {"type": kind, **STAMP, **WHOLE[kind], **change}
    with pytest.raises(MessageRefused) as refused:
        checked({name: value for name, value in whole.items() if value is not ...})
    assert str(refused.value) == cause


@pytest.mark.parametrize("found", [[], None, 3, {}, {"type": 3}, {"type": ["stop"]}, {"type": "start"}])
def test_what_is_no_message_is_refused(found: object) -> None:
    refuse(found)


def test_the_largest_safe_integer_is_taken() -> None:
    assert checked({"type": "stop", "seq": 2**53, "frame": 0}).seq == 2**53


@pytest.mark.parametrize(
    "text", ['{"type":"stop","seq":1,"seq":2,"frame":1}', '{"type":"stop","seq":NaN,"frame":1}', "[" * 9000]
)
def test_texts_that_a_parser_may_read_in_two_ways_are_refused(text: str) -> None:
    with pytest.raises(MessageRefused, match="not one JSON object"):
        parse(text)


def test_a_refusal_carries_the_number_of_its_message() -> None:
    with pytest.raises(MessageRefused) as refused:
        parse('{"type":"move","seq":12,"frame":"1-0123456789abcdef","epoch":1,"target_deg":"1"}')
    assert refused.value.seq == 12


@pytest.mark.parametrize(
    ("action", "step", "said"),
    [
        ("commission", None, "'step' is missing"),
        ("commission", "", "'step' is missing"),
        ("brake_test", "sign", "'step'"),
        ("commission", "sign!", "'step'"),
        ("commission", "sign", ""),
        ("brake_test", "", ""),
        ("reset_locked", None, ""),
    ],
)
def test_a_step_is_armed_with_commissioning_and_with_nothing_else(
    action: str, step: str | None, said: str
) -> None:
    frame = '"frame":"1-0123456789abcdef","epoch":1'
    text = f'{{"type":"arm","seq":12,{frame},"action":"{action}"'
    text += "}" if step is None else f',"step":"{step}"}}'
    if not said:
        assert parse(text).values.get("step", "") == (step or "")
        return
    with pytest.raises(MessageRefused, match=said):
        parse(text)


def test_words_of_messages_are_those_of_the_tables() -> None:
    def words(model: type[Any], name: str) -> list[str]:
        return list(model.model_json_schema()["properties"][name]["enum"])

    assert words(Set, "tag") == list(SETTABLE)
    assert words(Arm, "action") == list(ARMABLE)
    assert words(ChooseMode, "mode") == [mode.name.lower() for mode in Mode]


def test_the_schema_names_every_message() -> None:
    schema = MESSAGES.json_schema()
    assert set(schema["discriminator"]["mapping"]) == set(FIELDS)
    # What a client reads of a move without a direction is what `Direction.SHORTEST` does with it.
    assert schema["$defs"]["Move"]["properties"]["direction"]["default"] == "shortest"
