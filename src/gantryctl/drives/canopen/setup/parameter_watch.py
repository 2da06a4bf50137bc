"""Parameter watch: read the safety-relevant parameters again while the axis runs, without waiting."""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import suppress
from functools import partial
from typing import Final

from gantryctl.drives.canopen.bus.requests import SdoRequests
from gantryctl.drives.canopen.bus.sdo import abort_text, decode_object
from gantryctl.drives.canopen.setup.parameter_check import WantedParameter, compare
from gantryctl.drives.od.verdicts import ParameterVerdict

# Every parameter is read once in this time: about one request every three seconds behind the process data.
ROUND_S: Final = 60.0
_ERROR_CODE: Final = WantedParameter(0x603F, 0, 0, "why the drive is in fault")


class ParameterWatch:
    """Read one parameter after the other, round robin, and compare.

    Args:
        requests: to the drive.
        wanted: parameters that were right when the drive was set up.
        period_s: scan period.

    Attributes:
        error_code: 603F, requested when a fault comes without an emergency message; else 0.
        differs: a line for each parameter that is not as written any more, by object.
    """

    # Silence is not a difference: it has alarms of its own.

    def __init__(self, requests: SdoRequests, wanted: Sequence[WantedParameter], period_s: float) -> None:
        self._requests, self._wanted = requests, tuple(wanted)
        self._every = max(1, round(ROUND_S / period_s / max(1, len(wanted))))
        self._left = self._every
        self._next = 0
        self.differs: dict[tuple[int, int], str] = {}
        self.error_code = 0
        self._unknown_fault = False

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
        self._requests.read(wanted.obj, wanted.sub, partial(self._answer, wanted))

    def _answer(self, asked: WantedParameter, data: bytes | None) -> None:
        have: int | None = None
        if data is not None:
            with suppress(ValueError):
                value = decode_object(asked.obj, asked.sub, data)
                have = value if isinstance(value, int) else None
        if asked is _ERROR_CODE:
            self.error_code = have or 0
            return
        row = compare(asked, have)
        if data is None:
            row = row._replace(have=abort_text(self._requests.abort_code))
        if row.verdict is ParameterVerdict.OK:
            self.differs.pop((asked.obj, asked.sub), None)
        else:
            self.differs[asked.obj, asked.sub] = row.line
