"""A wall clock that can be stepped for one program and what it starts; their other clocks, and the computer, stay true.

libfaketime 0.9.10 does not do for the service: its `clock_nanosleep` fails with EINVAL for an absolute time of a clock
that it is told to leave alone, so the first scan ends with SYS-09.
"""

from __future__ import annotations

import mmap
import struct
import subprocess
from pathlib import Path

SOURCE = Path(__file__).with_name("stepped_clock.c")
_OFFSET = struct.Struct("<q")


class SteppedClock:
    """An offset of the wall clock.

    Attributes:
        environment: of a program whose wall clock is to have it.
    """

    def __init__(self, folder: Path, offset_s: int = 0) -> None:
        library, file = folder / "stepped_clock.so", folder / "stepped_clock"
        # The C compiler is there where the core was built.
        subprocess.run(["cc", "-O2", "-shared", "-fPIC", "-o", str(library), str(SOURCE)], check=True)
        file.write_bytes(_OFFSET.pack(offset_s))
        with file.open("r+b") as opened:
            self._map = mmap.mmap(opened.fileno(), _OFFSET.size)
        self.environment = {"LD_PRELOAD": str(library), "STEPPED_CLOCK": str(file)}

    @property
    def offset_s(self) -> int:
        """How far the wall clock of the program is ahead, s."""
        return int(_OFFSET.unpack(self._map[:])[0])

    @offset_s.setter
    def offset_s(self, value: int) -> None:
        # One word: no reader sees half of it.
        self._map[:] = _OFFSET.pack(value)
