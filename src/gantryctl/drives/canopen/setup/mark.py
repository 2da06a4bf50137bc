"""A mark in the drive that a boot-up wipes off: how a drive that restarted while nobody looked is known.

The identifier of a telegram that is not used, with its invalid bit set, means nothing to the drive. It comes back with
its default at every boot-up, and is kept over one only when it is stored by 1010.
"""

from __future__ import annotations

from typing import Final

from gantryctl.drives.canopen.bus.sdo import SdoClient
from gantryctl.errors import DeviceError

_UNUSED: Final = ((0x1403, 0x500), (0x1402, 0x400))  # RPDO 4 and 3, and where their defaults begin
_INVALID: Final = 0x8000_0000
_IDENTIFIER: Final = 0x7FF
RESTART_MARKERS: Final = range(0x181, 0x400)
"""Identifiers that CiA 301 restricts to nothing; the defaults of both telegrams lie above."""


def read_restart_marker(sdo: SdoClient) -> int | None:
    """The mark; None where the drive has none, or no place for one."""
    for index, _ in _UNUSED:
        found = sdo.optional(index, 1)
        if found is not None:
            marker = found & _IDENTIFIER
            return marker if found & _INVALID and marker in RESTART_MARKERS else None
    return None


def write_restart_marker(sdo: SdoClient, node: int, marker: int | None) -> bool:
    """Set a mark, or take it off again (None); False where the drive takes none."""
    for index, default in _UNUSED:
        found = sdo.optional(index, 1)
        if found is None:
            continue
        wanted = _INVALID | (default + node if marker is None else marker)
        if not found & _INVALID:
            return False
        try:
            sdo.set(index, 1, wanted, 4)
        except DeviceError:
            return False
        return sdo.optional(index, 1) == wanted
    return False
