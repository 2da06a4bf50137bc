"""Gate that spoils frames."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable

from gantryctl.drives.faults import FrameFault


class FrameGate:
    """Gate that frames pass: drops, delays, duplicates, swaps or cuts those of the keys that a fault names.

    Args:
        faults: by key, the number of a TPDO or an identifier.
        send: takes (identifier, data).
    """

    def __init__(self, faults: dict[int, FrameFault], send: Callable[[int, bytes], None]) -> None:
        self._faults, self._send = faults, send
        self._held: dict[int, deque[tuple[int, bytes]]] = {}

    @property
    def in_use(self) -> bool:
        """A fault is in force, or frames are held back."""
        return bool(self._faults or self._held)

    def reset(self) -> None:
        """Discard the frames held back."""
        self._held.clear()

    def send(self, key: int, can_id: int, data: bytes) -> None:
        """Send one frame."""
        fault = self._faults.get(key)
        if fault is None:
            self._flush(key)
            self._send(can_id, data)
            return
        if fault.count is not None:
            fault.count -= 1
            if fault.count <= 0:
                del self._faults[key]
        self._spoiled(key, fault, can_id, data)

    def _spoiled(self, key: int, fault: FrameFault, can_id: int, data: bytes) -> None:
        held = self._held.setdefault(key, deque())
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

    def _flush(self, key: int) -> None:
        """Send the frames held back: the fault is over."""
        held = self._held.pop(key, None)
        while held:
            self._send(*held.popleft())
