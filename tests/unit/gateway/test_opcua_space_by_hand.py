"""What OPC UA shows of the axis, by hand: values, their status, units and ranges."""

from __future__ import annotations

import asyncio
import math
from collections import defaultdict
from datetime import UTC, datetime, timedelta
from types import SimpleNamespace
from typing import Any

import pytest

asyncua = pytest.importorskip("asyncua", reason="the extra [opcua] is not installed")
from asyncua import ua  # noqa: E402

from gantryctl.gateway.opcua import space as space_module  # noqa: E402
from gantryctl.gateway.opcua.space import AddressSpace, _status, _value  # noqa: E402
from gantryctl.gateway.opcua.units import information, normal_range  # noqa: E402
from gantryctl.program import AxisState  # noqa: E402
from gantryctl.service.protocol.tags import BY_NAME, TAGS  # noqa: E402
from support.opcua_by_hand import S  # noqa: E402


@pytest.mark.parametrize(
    ("age_ms", "status"),
    [
        (0.0, S.Good), (500.0, S.Good), (500.1, S.UncertainNoCommunicationLastUsableValue),
        (5000.0, S.UncertainNoCommunicationLastUsableValue), (5000.1, S.BadNoCommunication),
        (math.nan, S.BadNoCommunication),
    ],
)  # fmt: skip
def test_a_value_is_good_for_half_a_second_and_shown_for_5_s(age_ms: float, status: int) -> None:
    assert _status(age_ms) == status


@pytest.mark.parametrize(
    ("name", "value", "shown"),
    [
        ("pos_act_deg", None, (None, S.BadSensorFailure)), ("vel_act_deg_s", None, (None, S.BadSensorFailure)),
        ("torque_act_nm", None, (None, S.BadSensorFailure)), ("target_deg", None, (None, S.BadOutOfService)),
        ("pos_act_deg", 5, (5.0, 0)), ("alarms", None, ("[]", 0)), ("brake_open", True, (True, 0)),
        ("alarms", [{"text": "门"}], ('[{"text": "门"}]', 0)), ("scan", 7, (7, 0)),
    ],
)  # fmt: skip
def test_what_is_not_believed_and_what_nobody_measures_are_told_apart(
    name: str, value: object, shown: tuple[object, int]
) -> None:
    found = _value(BY_NAME[name], value)
    assert (found, type(found[0])) == (shown, type(shown[0]))


class Node:
    """What was written into one variable, with its status."""

    def __init__(self) -> None:
        self.written: list[tuple[object, int]] = []

    async def write_value(self, data: Any) -> None:
        self.written.append((data.Value.Value, data.StatusCode.value))


def space() -> tuple[AddressSpace, dict[str, Node]]:
    nodes: dict[str, Node] = {}

    class All(dict[str, Any]):
        def __missing__(self, key: str) -> Any:
            return nodes.setdefault(key, Node())

    made = AddressSpace(None)  # type: ignore[arg-type]
    made._nodes = All()
    # The library finds the type of a value by itself.
    made._kinds = defaultdict(lambda: None)  # type: ignore[arg-type]
    return made, nodes


def test_an_angle_that_gets_old_loses_its_good_status_though_it_stays_the_same() -> None:
    made, nodes = space()
    tags = {"pos_act_deg": 12.5, "vel_act_deg_s": -0.5, "torque_act_nm": 7.0}
    for age_ms in (0.0, 400.0, 600.0, 6000.0):
        asyncio.run(made.show(tags, age_ms))
    statuses = [S.Good, S.UncertainNoCommunicationLastUsableValue, S.BadNoCommunication]
    assert nodes["ReadActualPosition.Position"].written == [(12.5, status) for status in statuses]
    assert nodes["ReadActualVelocity.Velocity"].written[0] == (-0.5, S.Good)
    assert nodes["ReadActualTorque.Torque"].written[0] == (7.0, S.Good)


def test_an_angle_that_is_not_believed_has_no_value() -> None:
    made, nodes = space()
    asyncio.run(made.show({"pos_act_deg": None, "vel_act_deg_s": 1.5}, 0.0))
    assert nodes["ReadActualPosition.Position"].written == [(None, S.BadSensorFailure)]
    assert nodes["ReadActualVelocity.Velocity"].written == [(1.5, S.Good)]


def test_before_the_first_picture_nothing_is_shown() -> None:
    made, nodes = space()
    for tags, age_ms in (({}, 0.0), ({"pos_act_deg": 0.0}, math.inf)):
        asyncio.run(made.show(tags, age_ms))
    assert not nodes


def test_units_are_those_of_recommendation_20_and_ranges_those_of_the_machine() -> None:
    """Common codes as bytes of a number: DD, E96, NU."""
    ids = {
        name: information(BY_NAME[name]).UnitId for name in ("pos_act_deg", "vel_act_deg_s", "torque_act_nm")
    }
    assert ids == {"pos_act_deg": 17476, "vel_act_deg_s": 4536630, "torque_act_nm": 20053}
    limits = {tag.name: None for tag in TAGS}
    wide = normal_range(BY_NAME["pos_act_deg"], limits)
    assert (wide.Low, wide.High) == (-360.0, 360.0)
    own = {"over_travel_min_deg": -190.0, "over_travel_max_deg": 185.0, "limit_switch_max_deg": 183.0}
    narrow = normal_range(BY_NAME["pos_act_deg"], limits | own)
    assert (narrow.Low, narrow.High) == (-190.0, 190.0)


def test_the_error_is_the_alarm_that_stopped_the_axis_with_its_code_and_its_text() -> None:
    made, nodes = space()
    rows = [
        {"code": "CTL-02", "text": "a consequence", "first_out": False},
        {"code": "INT-06", "text": "the cause", "first_out": True},
        {"code": "CTL-03", "text": "another one", "first_out": False},
    ]
    asyncio.run(made.show({"alarms": rows}, 0.0))
    asyncio.run(made.show({"alarms": rows[:1]}, 0.0))
    assert [value for value, _ in nodes["AxisErrorID"].written] == ["INT-06", ""]
    assert [value for value, _ in nodes["Text"].written] == ["the cause", ""]


def test_one_state_of_the_axis_is_true_and_all_others_are_not() -> None:
    made, nodes = space()
    for state in ("standstill", "error_stop"):
        asyncio.run(made.show({"axis_state": state}, 0.0))
    names = [space_module._words(each.name) for each in AxisState]
    assert {name: [value for value, _ in nodes[name].written] for name in names} == {
        name: {"Standstill": [True, False], "ErrorStop": [False, True]}.get(name, [False]) for name in names
    }
    assert {"Standstill", "ErrorStop", "Disabled"} <= set(names)


def test_without_limits_of_the_machine_a_range_is_that_of_its_unit() -> None:
    limits = {tag.name: None for tag in TAGS}
    ranges = {
        unit: normal_range(next(t for t in TAGS if t.kind == "float" and t.unit == unit), limits)
        for unit in ("deg", "deg/s", "deg/s2", "N m", "s", "ms", "us", "%", "")
    }
    assert {unit: (each.Low, each.High) for unit, each in ranges.items()} == {
        "deg": (-360.0, 360.0), "deg/s": (-10.0, 10.0), "deg/s2": (-10.0, 10.0), "N m": (-1000.0, 1000.0),
        "s": (0.0, 3600.0), "ms": (0.0, 1000.0), "us": (0.0, 1e5), "%": (0.0, 100.0), "": (0.0, 1.0),
    }  # fmt: skip


def test_the_range_of_the_moment_of_an_axis_is_what_its_motor_holds() -> None:
    """385 N m at the motor are 440.44 kN m at a gantry of 1144 : 1, and 1.88 N m are 339 N m at a table of 180 : 1."""
    limits = {tag.name: None for tag in TAGS} | {"torque_rated_nm": 257.0, "torque_max_nm": 385.0}
    for moment_nm in (440_440.0, 338.8):
        known = limits | {"moment_max_nm": moment_nm}
        eccentric = normal_range(BY_NAME["eccentric_moment_nm"], known)
        motor = normal_range(BY_NAME["torque_act_nm"], known)
        assert (eccentric.Low, eccentric.High) == (-moment_nm, moment_nm)
        assert (motor.Low, motor.High) == (-385.0, 385.0)


def test_a_value_has_the_time_in_which_it_was_measured() -> None:
    made, _ = space()
    times: list[Any] = []

    class Timed(Node):
        async def write_value(self, data: Any) -> None:
            times.append(data.SourceTimestamp)

    made._nodes = defaultdict(Timed)  # type: ignore[arg-type]
    begun = datetime.now(UTC)
    asyncio.run(made.show({"pos_act_deg": 1.0}, 400.0))
    ended = datetime.now(UTC)
    old = timedelta(milliseconds=400.0)
    assert all(begun - old <= each.replace(tzinfo=UTC) <= ended - old for each in times)


def test_ranges_are_written_where_a_limit_of_the_machine_has_changed() -> None:
    made, _ = space()
    written: list[Any] = []

    async def write(found: Any) -> None:
        written.append((found.Low, found.High))

    made._ranges = {"pos_act_deg": (BY_NAME["pos_act_deg"], SimpleNamespace(write_value=write))}  # type: ignore[dict-item]
    for limit in (185.0, 185.0, 190.0):
        asyncio.run(made.show({"over_travel_max_deg": limit}, 0.0))
    assert written == [(-185.0, 185.0), (-190.0, 190.0)]


def test_every_unit_has_its_sign_and_its_name() -> None:
    shown = {tag.unit: information(tag) for tag in TAGS if tag.kind == "float"}
    assert {unit: each.DisplayName.Text for unit, each in shown.items()} == {
        "deg": "°", "deg/s": "°/s", "deg/s2": "°/s²", "N m": "N·m", "s": "s", "ms": "ms", "us": "µs", "%": "%", "": "",
    }  # fmt: skip
    # Common codes of Recommendation 20, as bytes of a number.
    codes = {
        "deg": b"DD",
        "deg/s": b"E96",
        "deg/s2": b"M45",
        "N m": b"NU",
        "s": b"SEC",
        "ms": b"C26",
        "us": b"B98",
    }
    for unit, code in {**codes, "%": b"P1", "": b"C62"}.items():
        assert shown[unit].UnitId == int.from_bytes(code)


def test_a_variable_says_what_it_means_and_waits_for_its_first_value() -> None:
    """OPC UA Part 8: before the first picture no value is good."""
    written: list[Any] = []

    async def write_attribute(which: Any, data: Any) -> None:
        written.append((which, data.Value.Value.Text))

    async def write_value(data: Any) -> None:
        written.append((data.Value.Value, data.StatusCode.value))

    async def add_variable(*what: Any) -> Any:
        written.append((what[0].Identifier, what[1].Name))
        return SimpleNamespace(write_attribute=write_attribute, write_value=write_value)

    made = AddressSpace(None)  # type: ignore[arg-type]
    parent = SimpleNamespace(add_variable=add_variable)
    asyncio.run(made._add(parent, 2, "Text", ua.VariantType.String, "The whole line."))
    assert written == [
        ("Axis.Text", "Text"), (ua.AttributeIds.Description, "The whole line."), ("", S.BadWaitingForInitialData)
    ]  # fmt: skip
    assert [space_module._words(each) for each in ("ERROR_STOP", "STANDSTILL")] == ["ErrorStop", "Standstill"]


@pytest.mark.parametrize(
    ("name", "kind", "meaning"),
    [
        ("pos_act_deg", ua.VariantType.Double, f"{BY_NAME['pos_act_deg'].meaning} deg"),
        ("overload", ua.VariantType.Double, BY_NAME["overload"].meaning),
        ("scan", ua.VariantType.Int64, BY_NAME["scan"].meaning),
        ("power", ua.VariantType.Boolean, BY_NAME["power"].meaning),
        ("axis_state", ua.VariantType.String, BY_NAME["axis_state"].meaning),
    ],
)
def test_a_tag_is_told_with_its_unit_and_a_number_with_its_range(name: str, kind: Any, meaning: str) -> None:
    """OPC UA Part 8, section 5.3.2.3: a number is an analogue item with range and unit."""
    did: list[Any] = []

    async def add(*what: Any) -> Any:
        did.append(what)
        return SimpleNamespace(delete_reference=away, add_reference=there, add_property=prop)

    async def away(kind: Any, _: Any) -> None:
        did.append(("no more", kind.Identifier))

    async def there(kind: Any, _: Any) -> None:
        did.append(("now", kind.Identifier))

    async def prop(node: Any, named: Any, value: Any) -> str:
        did.append((node.Identifier, named.Name, type(value).__name__))
        return named.Name

    made = AddressSpace(None)  # type: ignore[arg-type]
    made._add = add  # type: ignore[method-assign]
    asyncio.run(made._add_tag("parent", 2, BY_NAME[name], "Shown", "Block.Shown"))
    assert did[0] == ("parent", 2, "Shown", kind, meaning, "Block.Shown")
    if kind is not ua.VariantType.Double:
        assert (did[1:], made._ranges) == ([], {})
        return
    ids = ua.ObjectIds
    assert did[1:] == [
        ("no more", ids.BaseDataVariableType), ("now", ids.AnalogItemType),
        ("Block.Shown.EURange", "EURange", "Range"),
        ("Block.Shown.EngineeringUnits", "EngineeringUnits", "EUInformation"),
    ]  # fmt: skip
    assert made._ranges == {"Block.Shown": (BY_NAME[name], "EURange")}
