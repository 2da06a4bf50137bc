"""Requests of the side channel and their answers, both JSON objects; no bus, no socket.

| cmd     | fields                                        | answer                                                  |
|---------|-----------------------------------------------|---------------------------------------------------------|
| hello   |                                               | node, personality, stepped, faults, events              |
| truth   |                                               | time_s and the true state of load, motor and base       |
| status  |                                               | states, phase, brake, torque, overload, faults in force |
| inject  | fault, value; for_s                           | a standing fault; back to sound after for_s             |
| inject  | fault "tpdo", tpdo, kind; amount, count       | drop, delay, duplicate, swap or length                  |
| inject  | fault "frame", can_id, kind; amount, count    | the same for another frame, from or to the drive        |
| node    | node, fault, value                            | a standing fault of a node beside the drive             |
| event   | event and its fields                          | something that happens once, see `EVENTS`               |
| clear   | fault (all when not given)                    |                                                         |
| read    | index; sub                                    | value as the behaviour has it                           |
| write   | index, value; sub                             | past all access rules, with the action it has           |
| advance | s                                             | lets a stepped drive's time go on without SYNC          |

Every answer has "ok"; a refused request has "error", one sentence.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from typing import Any, Final, TypeVar

from gantryctl.drives.faults import Faults, default_of, frame_fault, names, set_fault
from gantryctl.drives.virtual.communication.abort import SdoAbort
from gantryctl.drives.virtual.communication.nmt import NmtState
from gantryctl.drives.virtual.node import DriveNode
from gantryctl.drives.virtual.nodes.group import Neighbours, spoil
from gantryctl.errors import UsageError

Answer = dict[str, Any]
_Action = TypeVar("_Action")
_MAX_S: Final = 3600.0


class Requests:
    """Answer requests about one node; the caller holds the lock of the node.

    Args:
        node: the drive.
        neighbours: the nodes beside it.
    """

    def __init__(self, node: DriveNode, neighbours: Neighbours | None = None) -> None:
        self._node = node
        self._beside = {each.slave.node_id: each for each in neighbours or () if each is not None}
        self._commands: dict[str, Callable[[Mapping[str, Any]], Answer]] = {
            "hello": self._hello,
            "truth": self._truth,
            "status": self._status,
            "inject": self._inject,
            "node": self._spoil,
            "event": self._event,
            "clear": self._clear,
            "read": self._read,
            "write": self._write,
            "advance": self._advance,
        }
        self._events: dict[str, Callable[[Mapping[str, Any]], None]] = {
            "fault": self._fault,
            "emcy": self._emcy,
            "heartbeat": lambda request: node.send_heartbeat(),
            "nmt": self._nmt,
            "reset": self._reset,
            "lose_turns": self._lose_turns,
            "plant": self._plant,
            "frame": self._frame,
            "foreign": self._foreign,
        }

    def answer(self, request: object) -> Answer:
        """Answer to any request; a refused one gets its reason."""
        try:
            if not isinstance(request, dict):
                raise UsageError("a request is a JSON object")
            return {"ok": True, **_chosen(self._commands, "cmd", request)(request)}
        except UsageError as wrong:
            return {"ok": False, "error": str(wrong)}

    def _hello(self, request: Mapping[str, Any]) -> Answer:
        node = self._node
        return {
            "node": node.node_id,
            "personality": node.kind.name,
            "stepped": node.stepped,
            "faults": [*names(), "tpdo", "frame"],
            "events": list(self._events),
        }

    def _truth(self, request: Mapping[str, Any]) -> Answer:
        node = self._node
        values = dict(zip(node.truth_columns, node.truth(), strict=True))
        return {"time_s": node.time_us * 1e-6, **values}

    def _status(self, request: Mapping[str, Any]) -> Answer:
        node, axis = self._node, self._node.axis
        sound = Faults()
        spoiled: dict[str, Any] = {
            n: v for n in names() if (v := getattr(node.faults, n)) != getattr(sound, n)
        }
        spoiled |= {
            what: {str(n): fault.kind for n, fault in table.items()}
            for what, table in (("tpdo", node.faults.tpdo), ("frame", node.faults.frames))
            if table
        }
        return {
            "time_s": node.time_us * 1e-6,
            "command_s": node.process_data.command_us * 1e-6,
            "nmt": node.state.name,
            "state": axis.state.name,
            "phase": axis.stage.phase.name,
            "statusword": node.od.packed(node.od.entry(0x6041, 0)).hex(),
            "error_code": axis.error_code,
            "mode": axis.reference.mode,
            "brake_open": axis.plant.brake_open,
            "torque_nm": axis.plant.torque_nm,
            "vel_motor_rad_s": axis.plant.vel_rad_s,
            "overload": axis.plant.overload,
            "faults": spoiled,
        }

    # --- standing faults -----------------------------------------------------------------------------------------

    def _inject(self, request: Mapping[str, Any]) -> Answer:
        node, name = self._node, str(request.get("fault"))
        for_s = None if request.get("for_s") is None else _number(request, "for_s", 0.0, _MAX_S)
        if name in ("tpdo", "frame"):
            is_tpdo = name == "tpdo"
            table = node.faults.tpdo if is_tpdo else node.faults.frames
            key = _whole(request, "tpdo", 1, 1, 4) if is_tpdo else _whole(request, "can_id", 0x80, 0, 0x7FF)
            table[key] = frame_fault(request.get("kind"), request.get("amount", 1), request.get("count"))
            self._end(for_s, lambda: table.pop(key, None))
        else:
            set_fault(node.faults, name, request.get("value", True))
            self._end(for_s, lambda: set_fault(node.faults, name, default_of(name)))
        return {}

    def _spoil(self, request: Mapping[str, Any]) -> Answer:
        number = _whole(request, "node", 0, 1, 127)
        node = self._beside.get(number)
        if node is None:
            beside = ", ".join(map(str, self._beside)) or "none"
            raise UsageError(f"node {number} is not beside the drive; there are: {beside}")
        spoil(node, str(request.get("fault")), request.get("value", True))
        return {}

    def _end(self, for_s: float | None, action: Callable[[], object]) -> None:
        if for_s is not None:
            self._node.after(round(for_s * 1e6), action)

    def _clear(self, request: Mapping[str, Any]) -> Answer:
        faults = self._node.faults
        name = request.get("fault")
        for what, table in (("tpdo", faults.tpdo), ("frame", faults.frames)):
            if name in (None, what):
                table.clear()
        for each in names() if name is None else () if name in ("tpdo", "frame") else (str(name),):
            if each not in names():
                raise UsageError(f"there is no fault '{each}'")
            set_fault(faults, each, default_of(each))
        return {}

    # --- events --------------------------------------------------------------------------------------------------

    def _event(self, request: Mapping[str, Any]) -> Answer:
        _chosen(self._events, "event", request)(request)
        return {}

    def _fault(self, request: Mapping[str, Any]) -> None:
        """code; emcy (true), ramp (false: the power stage is gone)."""
        code = _whole(request, "code", 0xFF00, 1, 0xFFFF)
        report, ramp = request.get("emcy", True) is True, request.get("ramp", False) is True
        self._node.axis.fault(code, report=report, ramp=ramp)

    def _emcy(self, request: Mapping[str, Any]) -> None:
        """code, register, count (a flood); the drive itself is sound."""
        code = _whole(request, "code", 0xFF00, 0, 0xFFFF)
        register = _whole(request, "register", 0x81, 0, 0xFF)
        for _ in range(_whole(request, "count", 1, 1, 100_000)):
            self._node.emergency.raw(code, register)

    def _nmt(self, request: Mapping[str, Any]) -> None:
        """state: the node changes it by itself."""
        name = str(request.get("state"))
        if name not in ("STOPPED", "OPERATIONAL", "PRE_OPERATIONAL"):
            raise UsageError(f"state is STOPPED, OPERATIONAL or PRE_OPERATIONAL, got {name!r}")
        self._node.stack.enter(NmtState[name])

    def _reset(self, request: Mapping[str, Any]) -> None:
        """off_s: the drive restarts by itself, as after a power failure, and is away that long."""
        off_s = _number(request, "off_s", 0.0, _MAX_S)
        self._node.reset(communication_only=False, off_us=round(off_s * 1e6))

    def _lose_turns(self, request: Mapping[str, Any]) -> None:
        """turns: the multiturn part of the encoder is wrong from now on."""
        turns = _whole(request, "turns", 1, -100_000, 100_000)
        self._node.plant.lose_turns(turns)

    def _plant(self, request: Mapping[str, Any]) -> None:
        """name, value: another parameter of the plant (eccentric_moment_nm, brake_torque_nm, half_backlash_rad ...)."""
        name = str(request.get("name"))
        value = _number(request, "value", -1e12, 1e12)
        self._node.plant.change_plant(name, value)

    def _frame(self, request: Mapping[str, Any]) -> None:
        """can_id, data (hex): any frame, as if this node had sent it."""
        self._node.send(*self._frame_of(request))

    def _foreign(self, request: Mapping[str, Any]) -> None:
        """can_id, data (hex): any frame of a third party, which this node hears too."""
        self._node.foreign(*self._frame_of(request))

    def _frame_of(self, request: Mapping[str, Any]) -> tuple[int, bytes]:
        can_id = _whole(request, "can_id", 0, 0, 0x7FF)
        try:
            data = bytes.fromhex(str(request.get("data", "")))
        except ValueError:
            raise UsageError("data is hexadecimal") from None
        if len(data) > 8:
            raise UsageError(f"a frame has at most 8 bytes, got {len(data)}")
        return can_id, data

    # --- dictionary and time -------------------------------------------------------------------------------------

    def _place(self, request: Mapping[str, Any]) -> tuple[int, int]:
        index, sub = _whole(request, "index", 0, 0, 0xFFFF), _whole(request, "sub", 0, 0, 0xFF)
        if not self._node.od.known(index, sub):
            raise UsageError(f"there is no object {index:04X}:{sub:02X}")
        return index, sub

    def _read(self, request: Mapping[str, Any]) -> Answer:
        value = self._node.od.value(*self._place(request))
        return {"value": value.hex() if isinstance(value, bytes) else value}

    def _write(self, request: Mapping[str, Any]) -> Answer:
        place = self._place(request)
        value = _whole(request, "value", 0, -(1 << 31), (1 << 32) - 1)
        try:
            self._node.od.force(*place, value)
        except SdoAbort as refused:
            raise UsageError(f"{place[0]:04X}:{place[1]:02X} does not take {value}: {refused}") from None
        return {}

    def _advance(self, request: Mapping[str, Any]) -> Answer:
        node = self._node
        if not node.stepped:
            raise UsageError("this drive runs in real time; only a stepped one can be advanced")
        seconds = _number(request, "s", 0.0, _MAX_S)
        node.advance(round(seconds * 1e6))
        return {"time_s": node.time_us * 1e-6}


def _chosen(table: Mapping[str, _Action], key: str, request: Mapping[str, Any]) -> _Action:
    found = table.get(str(request.get(key)))
    if found is None:
        raise UsageError(f"there is no {key} {request.get(key)!r}; there are: {', '.join(table)}")
    return found


def _whole(request: Mapping[str, Any], key: str, default: int, low: int, high: int) -> int:
    value = request.get(key, default)
    if not isinstance(value, int) or isinstance(value, bool) or not low <= value <= high:
        raise UsageError(f"{key} is a whole number from {low} to {high}, got {value!r}")
    return value


def _number(request: Mapping[str, Any], key: str, low: float, high: float) -> float:
    value = request.get(key, 0.0)
    if not isinstance(value, int | float) or isinstance(value, bool) or not math.isfinite(value):
        raise UsageError(f"{key} is a number, got {value!r}")
    if not low <= value <= high:
        raise UsageError(f"{key} is from {low:g} to {high:g}, got {value!r}")
    return float(value)
