"""A stepped drive on the bench: raw frames in, raw frames out. Knows CiA 301 and 402, and nothing of our master."""

import struct
from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import NamedTuple

from gantryctl.drives.virtual.axis.cia402 import State
from gantryctl.drives.virtual.axis.hardware import Hardware
from gantryctl.drives.virtual.communication.parameters import ParameterStore
from gantryctl.drives.virtual.node import DriveNode
from gantryctl.drives.virtual.personality import personality
from gantryctl.drives.virtual.side_channel.requests import Requests
from gantryctl.machine import default_machine, with_values
from gantryctl.units import deg
from gantryctl.wiring.virtual import drive_hardware

NODE = 2
SDO_RX, SDO_TX = 0x600 + NODE, 0x580 + NODE
TPDO1, TPDO2, RPDO1, EMCY, HEARTBEAT = 0x180 + NODE, 0x280 + NODE, 0x200 + NODE, 0x80 + NODE, 0x700 + NODE
SHUTDOWN, SWITCH_ON, ENABLE, QUICK_STOP, DISABLE_VOLTAGE, RESET = 0x06, 0x07, 0x0F, 0x02, 0x00, 0x80


class Aborted(Exception):
    """The server aborted."""

    def __init__(self, code: int) -> None:
        self.code = code
        super().__init__(f"{code:08X}")


class Feedback(NamedTuple):
    """What two TPDOs bring."""

    status: int
    position: int
    velocity: int
    torque: int
    error: int

    @property
    def state(self) -> State:
        """Decoded as CiA 402 says."""
        for state, mask in ((State.NOT_READY, 0x4F), (State.SWITCH_ON_DISABLED, 0x4F), (State.FAULT, 0x4F),
                            (State.FAULT_REACTION, 0x4F)):  # fmt: skip
            if self.status & mask == state:
                return state
        return State(self.status & 0x6F)


@cache
def hardware(owner: str = "drive", angle_rad: float = 0.3) -> Hardware:
    """The reference gantry."""
    return drive_hardware(with_values(default_machine(), {"brake.owner": owner}), deg(angle_rad))


class Bench:
    """One drive, its frames, and a clock made of SYNCs."""

    def __init__(
        self,
        *names: str,
        period_ms: int = 4,
        owner: str = "drive",
        store: Path | None = None,
        angle_rad: float = 0.3,
        **plates: float,
    ) -> None:
        self.frames: list[tuple[int, bytes]] = []
        self.node = DriveNode(
            replace(hardware(owner, angle_rad), **plates),
            NODE,
            lambda can_id, data: self.frames.append((can_id, data)),
            kind=personality(names),
            store=ParameterStore(store),
            stepped=True,
        )
        self.control = Requests(self.node).answer
        self.period_ms = period_ms
        self.node.boot()

    # --- frames ------------------------------------------------------------------------------------------------

    def send(self, can_id: int, data: bytes = b"") -> list[tuple[int, bytes]]:
        """One frame; what the drive sends because of it."""
        before = len(self.frames)
        self.node.on_frame(can_id, data)
        return self.frames[before:]

    def take(self, can_id: int) -> list[bytes]:
        """All frames of an identifier so far; forgets every frame."""
        found = [data for other, data in self.frames if other == can_id]
        self.frames.clear()
        return found

    def nmt(self, command: int, node: int = NODE) -> list[tuple[int, bytes]]:
        return self.send(0x000, bytes((command, node)))

    def start(self) -> None:
        self.nmt(0x01)

    def inject(self, fault: str, value: object = True, **fields: object) -> None:
        answer = self.control({"cmd": "inject", "fault": fault, "value": value, **fields})
        assert answer["ok"], answer

    def event(self, event: str, **fields: object) -> None:
        answer = self.control({"cmd": "event", "event": event, **fields})
        assert answer["ok"], answer

    # --- SDO ---------------------------------------------------------------------------------------------------

    def sdo(self, request: bytes) -> bytes:
        """One request, its response."""
        answers = [data for can_id, data in self.send(SDO_RX, request.ljust(8, b"\0")) if can_id == SDO_TX]
        assert len(answers) == 1, answers
        if answers[0][0] == 0x80:
            raise Aborted(struct.unpack_from("<I", answers[0], 4)[0])
        return answers[0]

    def up(self, index: int, sub: int = 0) -> int:
        """Expedited upload of a number."""
        answer = self.sdo(struct.pack("<BHB", 0x40, index, sub))
        assert answer[0] & 0xE3 == 0x43
        assert answer[1:4] == struct.pack("<HB", index, sub)
        size = 4 - (answer[0] >> 2 & 3)
        signed = index in (0x6061, 0x6064, 0x606C, 0x6077)
        return int.from_bytes(answer[4 : 4 + size], "little", signed=signed)

    def down(self, index: int, sub: int, value: int, size: int) -> None:
        """Expedited download of a number."""
        data = (value & (1 << 8 * size) - 1).to_bytes(size, "little")
        answer = self.sdo(struct.pack("<BHB", 0x23 | (4 - size) << 2, index, sub) + data)
        assert answer == struct.pack("<BHBI", 0x60, index, sub, 0)

    # --- process data ------------------------------------------------------------------------------------------

    def map(self, communication: int, cob_id: int, entries: tuple[int, ...], kind: int = 1) -> None:
        """The CiA procedure: invalid, count 0, entries, count, type, valid."""
        mapping = communication + 0x200
        self.down(communication, 1, cob_id | 0x8000_0000, 4)
        self.down(mapping, 0, 0, 1)
        for sub, entry in enumerate(entries, start=1):
            self.down(mapping, sub, entry, 4)
        self.down(mapping, 0, len(entries), 1)
        self.down(communication, 2, kind, 1)
        self.down(communication, 1, cob_id, 4)

    def set_up(self, mode: int = 9, rpdo_kind: int = 1) -> "Bench":
        """As a master would: cycle time, mode, mapping, OPERATIONAL."""
        seen = self.node.device.objects
        if 0x1006 in seen:
            self.down(0x1006, 0, 1000 * self.period_ms, 4)
        if 0x60C2 in seen:
            self.down(0x60C2, 1, self.period_ms, 1)
            self.down(0x60C2, 2, -3, 1)
        self.down(0x6060, 0, mode, 1)
        preload = (0x60B20010,) if 0x60B2 in seen else ()
        error = (0x603F0010,) if 0x603F in seen else ()
        self.map(0x1400, RPDO1, (0x60400010, 0x60FF0020, *preload), rpdo_kind)
        self.map(0x1800, TPDO1, (0x60410010, 0x60640020))
        torque = (0x60770010,) if self.node.device.objects[0x6077].entries[0].mappable else ()
        self.map(0x1801, TPDO2, (0x606C0020, *torque, *error))
        self.start()
        return self

    def cycle(self, word: int, velocity: int = 0, preload: int = 0) -> Feedback:
        """One SYNC, its TPDOs, then the RPDO."""
        found = dict(self.send(0x80))
        data = struct.pack("<Hih", word, velocity, preload)
        self.send(RPDO1, data[:6] if 0x60B2 not in self.node.device.objects else data)
        status, position = struct.unpack("<Hi", found[TPDO1])
        second = found[TPDO2].ljust(8, b"\0")
        return Feedback(status, position, *struct.unpack("<ihH", second))

    def run(self, seconds: float, word: int, velocity: int = 0, preload: int = 0) -> Feedback:
        """Many cycles; the last feedback."""
        count = max(1, round(seconds * 1000 / self.period_ms))
        for _ in range(count - 1):
            self.cycle(word, velocity, preload)
        return self.cycle(word, velocity, preload)

    def enable(self) -> Feedback:
        """Walk up to Operation enabled."""
        self.run(0.02, SHUTDOWN)
        self.run(0.02, SWITCH_ON)
        feedback = self.run(0.3, ENABLE)
        assert feedback.state is State.ENABLED, hex(feedback.status)
        return feedback

    def turn(self, deg_s: float) -> int:
        """A gantry speed in units of 60FF."""
        return round(self.node.scaling.per_rad_s * deg_s * 1144 * 3.141592653589793 / 180)

    def deg_s(self, units: int) -> float:
        """Units of 606C as gantry speed."""
        return units / self.node.scaling.per_rad_s / 1144 * 180 / 3.141592653589793

    def ramp_to(self, deg_s: float, acc_deg_s2: float = 2.0) -> Feedback:
        """Speed up as a careful master would."""
        feedback = self.cycle(ENABLE)
        speed = self.deg_s(feedback.velocity)
        step = acc_deg_s2 * self.period_ms * 1e-3
        while abs(speed - deg_s) > step:
            speed += step if deg_s > speed else -step
            feedback = self.cycle(ENABLE, self.turn(speed))
        return self.run(0.2, ENABLE, self.turn(deg_s))

    @property
    def load_deg(self) -> float:
        return self.node.truth()[0] * 180 / 3.141592653589793

    @property
    def load_deg_s(self) -> float:
        return self.node.truth()[1] * 180 / 3.141592653589793
