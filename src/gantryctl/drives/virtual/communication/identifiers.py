"""Identifiers of the pre-defined connection set (CiA 301) that every virtual node serves; node ids are added."""

from __future__ import annotations

from collections.abc import Callable
from typing import Final

NMT: Final = 0x000
SDO_RESPONSE: Final = 0x580
SDO_REQUEST: Final = 0x600
HEARTBEAT: Final = 0x700

Send = Callable[[int, bytes], None]
"""Takes identifier and data of a frame."""
