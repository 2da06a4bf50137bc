"""An object dictionary in memory, and the settings of the set-up that reads and writes it."""

from __future__ import annotations

from dataclasses import replace

from gantryctl.drives.canopen.bus.sdo import SdoError
from gantryctl.drives.canopen.settings import CanopenSettings
from gantryctl.wiring.canopen import canopen_settings
from unit.drives.canopen.canopen_bench import machine

Place = tuple[int, int]
READ_ONLY, MISSING = 0x0601_0002, 0x0602_0000


class Dictionary:
    """An object dictionary in memory that stands for `SdoClient`.

    Attributes:
        written: (index, sub, value) in their order.
        fixed: objects that take a write and keep their value. refused: abort codes by object.
    """

    def __init__(self, values: dict[Place, int], sizes: dict[int, int] | None = None) -> None:
        self.values, self._sizes = dict(values), sizes or {}
        self.written: list[tuple[int, int, int]] = []
        self.fixed: set[Place] = set()
        self.refused: dict[Place, int] = {}

    def number(self, index: int, sub: int = 0) -> int:
        if (index, sub) not in self.values:
            raise SdoError(index, sub, MISSING)
        return self.values[index, sub]

    def optional(self, index: int, sub: int = 0) -> int | None:
        return self.values.get((index, sub))

    def read(self, index: int, sub: int) -> bytes:
        return self.number(index, sub).to_bytes(self._sizes.get(index, 4), "little")

    def set(self, index: int, sub: int, value: int, size: int | None = None) -> None:
        if (index, sub) in self.refused:
            raise SdoError(index, sub, self.refused[index, sub])
        self.written.append((index, sub, value))
        if (index, sub) not in self.fixed:
            self.values[index, sub] = value

    def write(self, index: int, sub: int, data: bytes) -> None:
        self.set(index, sub, int.from_bytes(data, "little"))

    def text(self, index: int) -> str:
        return ""


class CountedSync(Dictionary):
    """A drive whose counter of SYNC changes while it has no period, and then alone (CiA 301)."""

    def set(self, index: int, sub: int, value: int, size: int | None = None) -> None:
        if index == 0x1019 and self.values.get((0x1006, 0)):
            raise SdoError(index, sub, 0x0800_0022)
        super().set(index, sub, value, size)


def settings(**changes: object) -> CanopenSettings:
    return replace(canopen_settings(machine()), **changes)  # type: ignore[arg-type]
