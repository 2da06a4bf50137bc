"""Trace rows on their way out of the scan: into a ring, while power is on."""

from __future__ import annotations

import struct
from collections.abc import Sequence
from typing import Final

from gantryctl.errors import UsageError
from gantryctl.service.memory.memory import ROW_BYTES
from gantryctl.service.memory.ring import Ring
from gantryctl.units import rad

# Between two rows at rest.
REST_S: Final = 0.1
# How far angle, and torque as part of the rated one, may stray at rest. On the reference gantry, held at rest, the
# angle strays by 3e-7 deg and the torque by 0.8 N m of 200 (simulator, 20 s). A shaft that stands between two steps of
# a coarse encoder is read as one of them or the other.
_BAND_RAD: Final = rad(0.001)
_BAND_STEPS: Final = 1.5
_BAND_TORQUE: Final = 0.05
# Before a column's name in the metadata of a recording.
BAND_KEY: Final = "rest_band_"


def rest_metadata(torque_rated_nm: float, step_rad: float = 0.0) -> dict[str, float]:
    """Say in the metadata of a recording how rows of an axis at rest are told from others.

    Args:
        step_rad: of the encoder, at the gantry.
    """
    return {
        "rest_spacing_s": REST_S,
        f"{BAND_KEY}pos_act_rad": max(_BAND_RAD, _BAND_STEPS * step_rad),
        f"{BAND_KEY}torque_act_nm": _BAND_TORQUE * torque_rated_nm,
    }


class RingRecorder:
    """A `Recorder` that packs rows into a ring; the recorder process writes the file.

    Attributes:
        number: of the recording under way; 0 while nothing is recorded.
        mark: changes when something has happened that a reader of the recording wants every scan of.
        lost: rows that found the ring full.
    """

    def __init__(self, ring: Ring, columns: Sequence[str]) -> None:
        if (len(columns) + 2) * 8 > ROW_BYTES - 8:
            raise UsageError(f"a trace of {len(columns)} columns: the ring takes {ROW_BYTES // 8 - 3}")
        self.columns = tuple(columns)
        self.number = self.mark = 0
        self.lost = 0
        self._ring = ring
        self._pack = struct.Struct(f"<{len(columns) + 2}d").pack

    def record(self, row: tuple[float, ...]) -> None:
        """Pack one row of the recording under way."""
        if self.number and not self._ring.put(self._pack(self.number, self.mark, *row)):
            self.lost += 1

    def stop(self) -> None:
        """End the recording under way."""
        self.end(self.number)
        self.number = 0

    def end(self, number: int) -> None:
        """End a recording by its number, one of a controller that is gone for example; 0 for none."""
        # A record of the number alone marks the end.
        if number:
            self._ring.put(struct.pack("<d", number))

    def close(self) -> None:
        """End the recording under way."""
        self.stop()
