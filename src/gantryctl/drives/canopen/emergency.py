"""Emergency messages (EMCY) in words: cause and what to do; bounded, whatever a drive sends."""

from __future__ import annotations

from collections import deque
from typing import Final, NamedTuple

# Messages kept; a flood is counted, not stored. Logs of a library grew without bound.
HISTORY: Final = 64
# Error codes of CiA 301 and, from 2310 to FF00 but for the class 8xxx, of CiA 402.
_EXACT: Final = {
    0x8110: ("CAN overrun: the drive lost telegrams", "Lower the bus load."),
    0x8120: ("CAN error passive in the drive", "Check cable, terminators and bit rate."),
    0x8130: ("the drive missed the controller's heartbeat", "Was the controller stopped or overloaded?"),
    0x8140: ("the drive was off the bus and came back", "Check cable and terminators."),
    0x8150: ("two nodes use the same identifier", "Give every node its own node id."),
    0x8210: ("a process data telegram was too short for the drive's mapping", "Start the controller again."),
    0x8220: ("a process data telegram was longer than the drive's mapping", "Start the controller again."),
    0x8240: ("SYNC with an unexpected length", "Another master may be on the bus."),
    0x8250: ("the drive missed its process data", "Was the controller stopped or overloaded?"),
    0x2310: ("overcurrent at the output", "Motor cable or motor; call service."),
    0x2350: ("overload of the drive or motor (I2t)", "Let it cool; move less or slower."),
    0x2351: ("warning: overload of the motor (I2t)", "Move less or slower."),
    0x3210: ("DC link overvoltage", "Check the brake resistor: stops feed energy back."),
    0x3220: ("DC link undervoltage", "Check the mains."),
    0x4310: ("drive too hot", "Check cooling."),
    0x5530: ("parameter memory of the drive failed", "Restore the drive's parameters from a backup."),
    0x6310: ("stored parameters of the drive are lost", "Restore the drive's parameters from a backup."),
    0x7305: ("motor encoder", "Check encoder cable and plug; call service."),
    0x8611: ("following error in the drive", "The drive does not reach its set-point."),
    0xFF00: ("a manufacturer-specific fault", "Read the drive's display."),
}
_CLASSES: Final = {
    0x1: "general error", 0x2: "current", 0x3: "voltage", 0x4: "temperature", 0x5: "drive hardware",
    0x6: "drive software or parameters", 0x7: "additional module: motor, brake, encoder", 0x8: "monitoring",
    0x9: "external error", 0xF: "specific to the drive",
}  # fmt: skip


# Warnings by their text in CiA 301 and CiA 402: the drive goes on, and so does the axis.
_WARNINGS: Final = frozenset({0x2351, 0x8110, 0x8120, 0x8140, 0x8240})


def stops(code: int) -> bool:
    """Whether a complaint of a drive that shows no fault stops the axis: any that is not known to be a warning."""
    return code != 0 and code not in _WARNINGS


class Emergency(NamedTuple):
    """Emergency message."""

    scan: int
    code: int
    register: int
    vendor: bytes

    @property
    def text(self) -> str:
        """Words for people, with the code for the drive's manual."""
        return emergency_text(self.code)


def emergency_text(code: int) -> str:
    """Meaning of an error code of CiA 301 or CiA 402 and what to do."""
    if code == 0:
        return "EMCY 0000: no error any more"
    what, do = _EXACT.get(
        code, (_CLASSES.get(code >> 12, "unknown class"), "Look it up in the drive's manual.")
    )
    return f"EMCY {code:04X}: {what} · {do}"


class EmergencyLog:
    """Latest emergency messages and their number.

    Attributes:
        code: of the last message; 0 after "error reset".
        count: messages since the start.
        complaints: of these, what stops the axis. complaint: error code of the last one of them.
    """

    def __init__(self) -> None:
        self.messages: deque[Emergency] = deque(maxlen=HISTORY)
        self.code = self.count = self.complaints = self.complaint = 0

    @property
    def fault_code(self) -> int:
        """Code that explains a fault; a warning does not."""
        return self.code if stops(self.code) else 0

    def take(self, data: bytes, scan: int) -> None:
        """Take one frame; some drives send fewer than the eight bytes of CiA 301, two carry the code."""
        if len(data) < 2:
            return
        self.count += 1
        code = int.from_bytes(data[:2], "little")
        self.code = code
        if stops(code):
            self.complaints += 1
            self.complaint = code
        # A flood of one code in one scan is one line.
        last = self.messages[-1] if self.messages else None
        if last is None or (last.code, last.scan) != (code, scan):
            self.messages.append(Emergency(scan, code, data[2] if len(data) > 2 else 0, bytes(data[3:8])))
