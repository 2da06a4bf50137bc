"""Injections as data: strict, with one clear sentence for what is wrong."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from gantryctl.drives.faults import BUS_ONLY, names
from gantryctl.engineering.faults.catalogue import CATALOGUE, fault_case
from gantryctl.engineering.faults.injection import (
    Injection,
    When,
    injection,
    load_injections,
    parse_injection,
)
from gantryctl.engineering.faults.kinds.kind import Place
from gantryctl.engineering.faults.run import fault_machine
from gantryctl.engineering.faults.seams import KINDS
from gantryctl.errors import UsageError
from support.frames_left import leaves_frames


def refusal(**data: object) -> str:
    with pytest.raises(UsageError) as wrong:
        parse_injection({"where": "encoder", "kind": "gain", "args": {"value": 0.0}, **data})
    return str(wrong.value)


def test_an_injection_says_when_where_what_and_how_long() -> None:
    row = injection("encoder", "gain", value=0.9, for_s=0.5, when=When(angle_deg=30.0))
    assert row == Injection(
        where=Place.ENCODER, kind="gain", args={"value": 0.9}, for_s=0.5, when=When(angle_deg=30.0)
    )
    assert row.text == "encoder gain value=0.9"
    assert injection("drive", "emcy", code=5).values == {"code": 5, "count": 1}


@pytest.mark.parametrize(
    ("data", "text"),
    [
        ({"where": "moon"}, "injection.where: must be one of encoder, drive, brake"),
        ({"kind": "gremlin"}, "there is no fault 'gremlin' of the encoder; there are: gain, jump"),
        ({"args": {"value": float("nan")}}, "injection.args.value"),
        ({"args": {"value": 1e9}}, "encoder gain: value must be from -10 to 10, got 1000000000.0"),
        ({"args": {"value": True}}, "encoder gain: value must be of type float, got True"),
        ({"args": {"value": "0"}}, "encoder gain: value must be of type float, got '0'"),
        ({"args": {}}, "encoder gain needs the argument 'value'"),
        ({"args": {"value": 0.0, "colour": 1}}, "encoder gain has no argument 'colour'; it takes: value"),
        ({"for_s": 0.0}, "injection.for_s: Input should be greater than 0"),
        ({"for_s": float("inf")}, "injection.for_s"),
        ({"when": {"after_s": 1.0, "event": "DRV-01"}}, "when: one of after_s, angle_deg, state, event"),
        ({"when": {"after_s": -1.0}}, "injection.when.after_s"),
        ({"until": 3}, "injection.until: Extra inputs are not permitted"),
    ],
)
def test_what_makes_no_sense_is_one_sentence(data: dict[str, object], text: str) -> None:
    said = refusal(**data)
    assert text in said
    assert "\n" not in said


def test_a_file_of_injections_may_be_toml_or_json(tmp_path: Path) -> None:
    rows = [{"where": "brake", "kind": "torque", "args": {"share": 0.5}, "when": {"angle_deg": 40.0}}]
    toml, as_json = tmp_path / "my.toml", tmp_path / "my.json"
    toml.write_text(
        '[[injection]]\nwhere = "brake"\nkind = "torque"\nargs = { share = 0.5 }\nwhen = { angle_deg = 40.0 }\n'
    )
    as_json.write_text(json.dumps({"injection": rows}))
    assert load_injections(toml) == load_injections(as_json) == (parse_injection(rows[0]),)


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("", r"there is no \[\[injection\]\] table"),
        ("x = 1", "unknown key 'x'"),
        ("[[injection]]\nwhere = 3", r"injection\[0\]\.where"),
        ("[[", "my.toml: "),
        ("[[injection]]\n" * 101, "101 injections, at most 100 permitted"),
        ("#" * 300_000, "300000 bytes, at most 262144 permitted"),
    ],
)
def test_a_wrong_file_is_one_sentence(tmp_path: Path, text: str, said: str) -> None:
    path = tmp_path / "my.toml"
    path.write_text(text)
    with pytest.raises(UsageError, match=said):
        load_injections(path)
    with pytest.raises(UsageError, match="cannot be read"):
        load_injections(tmp_path / "none.toml")


def test_a_refused_injection_leaves_no_frames() -> None:
    """A context error that holds its traceback, inside an error of compiled code, was never collected."""
    wrong = {"where": "encoder", "kind": "gain", "args": {"value": "x"}}
    assert not leaves_frames(lambda: parse_injection(wrong), UsageError)


def test_every_standing_fault_of_a_drive_can_be_injected_by_some_kind() -> None:
    import inspect

    from gantryctl.engineering.faults.kinds import axis, bus

    text = inspect.getsource(axis) + inspect.getsource(bus)
    left_out = BUS_ONLY | {"position_offset"}
    missing = [name for name in names() if f'"{name}"' not in text and name not in left_out]
    assert missing == []
    assert all(kind.words for kind in KINDS.values())


def test_a_number_of_the_catalogue_is_used_once() -> None:
    numbers = [case.number for case in CATALOGUE]
    assert len(numbers) == len(set(numbers))
    assert fault_case("a2").number == "A2"
    with pytest.raises(UsageError, match="there is no fault 'Z9'"):
        fault_case("Z9")


@pytest.mark.parametrize("beside", [False, True], ids=["drive", "nodes"])
def test_every_input_that_a_row_opens_is_wired_on_the_bus(beside: bool) -> None:
    """Unwired, the second channel of the emergency stop took the torque and nothing told it (row G10)."""
    can = fault_machine(None, "bus", 1.0, 4.0, beside=beside).can
    opened = {
        # Limit switches are wired by their side.
        str(each.values["name"]).replace("minus_ok", "minus").replace("plus_ok", "plus")
        for case in CATALOGUE
        if "bus" in case.buses and (beside or not case.beside)
        for each in case.injections
        if (each.where, each.kind) == (Place.INPUT, "off")
    }
    assert opened >= {"estop_ok", "estop_ok_2", "collision_ok", "door_ok"}
    for name in opened:
        # What the node reads is read there; without one, by the drive.
        bits = [getattr(can.inputs, name)] + ([getattr(can.io.inputs, name)] if beside else [])
        assert max(bits) >= 0, name
    if beside:
        assert can.io.inputs.estop_ok_2 == 7  # the first behind the seven of the file
