"""Digital inputs of the axis, from the drive (60FD) and from an I/O node (6000)."""

from __future__ import annotations

from gantryctl.drives.canopen.settings import InputBits
from gantryctl.image import DigitalInputs

# Level of each input that is its safe state: what an I/O node that is lost shows.
_UNSAFE_HIGH = ("limit_minus", "limit_plus")


class InputReader:
    """Names to levels. An input that is wired to the I/O node is read there, whatever 60FD says.

    Args:
        drive: bits of 60FD.
        node: bits of the I/O node; None without one.
    """

    def __init__(self, drive: InputBits, node: InputBits | None) -> None:
        self._drive, self._node = drive, InputBits(*[None] * len(drive)) if node is None else node
        self._words: tuple[int | None, int | None] = (None, None)
        self._shown = self._inputs()

    def read(self, drive: int | None, node: int | None) -> DigitalInputs:
        """Inputs of this scan, the same object while nothing changes.

        Args:
            drive: 60FD; None where the drive has none.
            node: 6000 of the I/O node; None while it is lost: its inputs then show their safe state.
        """
        if self._words != (drive, node):
            self._words = drive, node
            found = self._inputs()
            if found != self._shown:
                self._shown = found
        return self._shown

    def brake_contact(self) -> bool | None:
        """Level of the brake contact in this scan; None where it is not wired, or its node is lost."""
        return self._level("brake_open", lost=None)

    def watchdog_contact(self) -> bool | None:
        """Contact of the watchdog relay in this scan; None where it is not wired, or its node is lost."""
        return self._level("watchdog_closed", lost=None)

    def levels(self) -> dict[str, bool]:
        """Level of every wired input in this scan, by name."""
        found = {name: self._level(name, lost=None) for name in InputBits._fields}
        return {name: level for name, level in found.items() if level is not None}

    def _level(self, name: str, lost: bool | None) -> bool | None:
        drive, node = self._words
        at_node: int | None = getattr(self._node, name)
        if at_node is not None:
            return lost if node is None else bool(node >> at_node & 1)
        at_drive: int | None = getattr(self._drive, name)
        return None if at_drive is None or drive is None else bool(drive >> at_drive & 1)

    def _good(self, name: str) -> bool:
        """An input that counts as good where it is not wired."""
        unsafe_high = name in _UNSAFE_HIGH
        level = self._level(name, lost=unsafe_high)
        return level is None or level is not unsafe_high

    def _fitted(self, name: str) -> bool | None:
        return self._level(name, lost=False)

    def _inputs(self) -> DigitalInputs:
        first, second = self._good("estop_ok"), self._fitted("estop_ok_2")
        # Two channels of which one is not known do not differ: the chain as a whole is not known to be closed.
        at_node = self._node.estop_ok is not None or self._node.estop_ok_2 is not None
        if self._words[1] is None and at_node:
            first, second = False, None if second is None else False
        return DigitalInputs(
            first,
            self._good("enabling_switch"),
            self._good("limit_minus"),
            self._good("limit_plus"),
            self._good("mains_ready"),
            self._fitted("collision_ok"),
            self._fitted("door_ok"),
            second,
            self._fitted("motion_permit"),
        )
