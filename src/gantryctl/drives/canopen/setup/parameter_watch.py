"""Parameter watch: read the safety-relevant parameters again while the axis runs, without waiting."""

from __future__ import annotations

import struct
from collections.abc import Sequence
from contextlib import suppress
from typing import Final

from gantryctl.drives.canopen.bus.node import RemoteNode
from gantryctl.drives.canopen.bus.sdo import decode_object
from gantryctl.drives.canopen.setup.parameter_check import ParameterVerdict, WantedParameter, compare

# Every parameter is read once in this time: about one request every three seconds behind the process data. A thread
# would need the bus for itself, and waiting would cost the scan (decision 0012).
ROUND_S: Final = 60.0
_ERROR_CODE: Final = WantedParameter(0x603F, 0, 0, "why the drive is in fault")
_ABORT: Final = 0x80
_UPLOAD: Final = 0x40
_EXPEDITED: Final = 0x02


class ParameterWatch:
    """Read one parameter after the other, round robin, and compare.

    Args:
        node: sends and takes the frames.
        wanted: parameters that were right when the drive was set up.
        period_s: scan period.

    Attributes:
        error_code: 603F, requested when a fault comes without an emergency message; else 0.
        differs: a line for each parameter that is not as written any more, by object.
        answered, unanswered: requests so far; silence is not a difference, it has alarms of its own.
    """

    def __init__(self, node: RemoteNode, wanted: Sequence[WantedParameter], period_s: float) -> None:
        self._node, self._wanted = node, tuple(wanted)
        self._every = max(1, round(ROUND_S / period_s / max(1, len(wanted))))
        self._left = self._every
        self._next = 0
        self._asked: WantedParameter | None = None
        self.differs: dict[tuple[int, int], str] = {}
        self.answered = self.unanswered = 0
        self.error_code = 0
        self._unknown_fault = False
        node.listen(node.sdo.response_id, self._answer)

    @property
    def line(self) -> str:
        """First difference, or ""."""
        return next(iter(self.differs.values()), "")

    def scan(self, periods: int, unknown_fault: bool = False) -> None:
        """Send the request that is due, after the process data of a scan.

        Args:
            periods: since the scan before.
            unknown_fault: the drive is in fault without an emergency message.
        """
        self._left -= periods
        if unknown_fault and not self._unknown_fault:
            self._ask(_ERROR_CODE)
        elif self._left <= 0 and self._wanted:
            self._left = self._every
            self._ask(self._wanted[self._next])
            self._next = (self._next + 1) % len(self._wanted)
        self._unknown_fault = unknown_fault
        if not unknown_fault:
            self.error_code = 0

    def _ask(self, wanted: WantedParameter) -> None:
        self.unanswered += self._asked is not None
        self._asked = wanted
        request = struct.pack("<BHB4x", _UPLOAD, wanted.obj, wanted.sub)
        self._node.link.send(self._node.sdo.request_id, request)

    def _answer(self, data: bytes) -> None:
        """Take a frame of the drive's SDO server, whatever it is."""
        asked = self._asked
        if asked is None or len(data) < 8 or data[1:4] != struct.pack("<HB", asked.obj, asked.sub):
            return
        command = data[0]
        have: int | None = None
        if command != _ABORT:
            if command & 0xE0 != _UPLOAD or not command & _EXPEDITED:
                return
            size = 4 - (command >> 2 & 3) if command & 1 else 4
            with suppress(ValueError):
                value = decode_object(asked.obj, asked.sub, data[4 : 4 + size])
                have = value if isinstance(value, int) else None
        self._asked = None
        self.answered += 1
        if asked is _ERROR_CODE:
            self.error_code = have or 0
            return
        row = compare(asked, have)
        if row.verdict is ParameterVerdict.OK:
            self.differs.pop((asked.obj, asked.sub), None)
        else:
            self.differs[asked.obj, asked.sub] = row.line
