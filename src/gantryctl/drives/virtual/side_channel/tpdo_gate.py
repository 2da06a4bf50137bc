"""Gate that spoils TPDOs."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable

from gantryctl.drives.faults import Faults, TpdoFault


class TpdoGate:
    """Gate between the TPDOs and the bus: drops, delays, duplicates, swaps or cuts frames.

    Args:
        faults: which TPDO is affected.
        send: takes (identifier, data).
    """

    def __init__(self, faults: Faults, send: Callable[[int, bytes], None]) -> None:
        self._faults, self._send = faults, send
        self._held: dict[int, deque[tuple[int, bytes]]] = {}

    def reset(self) -> None:
        """Discard the frames held back."""
        self._held.clear()

    def send(self, number: int, can_id: int, data: bytes) -> None:
        """Send one TPDO (number 0 is the first)."""
        fault = self._faults.tpdo.get(number + 1)
        if fault is None:
            self._flush(number)
            self._send(can_id, data)
            return
        if fault.count is not None:
            fault.count -= 1
            if fault.count <= 0:
                del self._faults.tpdo[number + 1]
        self._spoiled(number, fault, can_id, data)

    def _spoiled(self, number: int, fault: TpdoFault, can_id: int, data: bytes) -> None:
        held = self._held.setdefault(number, deque())
        match fault.kind:
            case "drop":
                pass
            case "duplicate":
                for _ in range(2):
                    self._send(can_id, data)
            case "length":
                self._send(can_id, data[: fault.amount].ljust(fault.amount, b"\0"))
            case "delay":
                held.append((can_id, data))
                if len(held) > fault.amount:
                    self._send(*held.popleft())
            case "swap":
                if held:
                    self._send(can_id, data)
                    self._send(*held.popleft())
                else:
                    held.append((can_id, data))

    def _flush(self, number: int) -> None:
        """Send the frames held back: the fault is over."""
        held = self._held.pop(number, None)
        while held:
            self._send(*held.popleft())
