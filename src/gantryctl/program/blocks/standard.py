"""Standard function blocks of IEC 61131-3 (third edition, tables 43 to 46): timers, edges, flip-flops, a counter.

They know no axis and no clock: a timer is given the time of the scan, `image.time_s`. Each is called once
per scan and shows its outputs as attributes, under the names of the standard in small letters.
"""

from __future__ import annotations

import math
from typing import Final

# PVmax of CTU: the largest INT, at which the standard has the counter stop.
COUNT_MAX: Final = 32767
# Times of scans are products of a number and a period: 500 periods of 10 ms may be 4.9999999999 s.
_ROUNDING_S: Final = 1e-9


class TON:
    """On-delay: `q` once `in_` has been TRUE for `pt_s`.

    Attributes:
        q: the output.
        et_s: how long `in_` has been TRUE, `pt_s` at most; 0 while it is FALSE.
        error: `pt_s` is no time (NaN, infinite or negative), so `q` stays FALSE.
    """

    __slots__ = ("_since_s", "error", "et_s", "q")

    def __init__(self) -> None:
        self.q = self.error = False
        self.et_s = 0.0
        self._since_s: float | None = None

    def __call__(self, *, in_: bool, pt_s: float, time_s: float) -> None:
        self.error = not 0.0 <= pt_s < math.inf
        if not in_:
            self._since_s = None
        elif self._since_s is None:
            self._since_s = time_s
        if self._since_s is None or self.error:
            self.q, self.et_s = False, 0.0
            return
        elapsed_s = time_s - self._since_s
        self.q = elapsed_s >= pt_s - _ROUNDING_S
        self.et_s = pt_s if self.q else elapsed_s


class TOF:
    """Off-delay: `q` while `in_` is TRUE and for `pt_s` after it fell.

    Attributes:
        q: the output.
        et_s: how long `in_` has been FALSE since it fell, `pt_s` at most; 0 before.
        error: `pt_s` is no time (NaN, infinite or negative), so `q` follows `in_`.
    """

    __slots__ = ("_since_s", "_was", "error", "et_s", "q")

    def __init__(self) -> None:
        self.q = self.error = self._was = False
        self.et_s = 0.0
        self._since_s: float | None = None

    def __call__(self, *, in_: bool, pt_s: float, time_s: float) -> None:
        self.error = not 0.0 <= pt_s < math.inf
        if in_:
            self._since_s = None
        elif self._was:
            self._since_s = time_s
        self._was = in_
        if self._since_s is None or self.error:
            self.q, self.et_s = in_, 0.0
            return
        elapsed_s = time_s - self._since_s
        self.q = elapsed_s < pt_s - _ROUNDING_S
        self.et_s = elapsed_s if self.q else pt_s


class TP:
    """Pulse: `q` for `pt_s` from the rising edge of `in_`; a further edge during the pulse changes nothing.

    Attributes:
        q: the output.
        et_s: how long the pulse has lasted; after it `pt_s` while `in_` stays TRUE, then 0.
        error: `pt_s` is no time (NaN, infinite or negative), so no pulse begins and one under way ends.
    """

    __slots__ = ("_since_s", "_was", "error", "et_s", "q")

    def __init__(self) -> None:
        self.q = self.error = self._was = False
        self.et_s = 0.0
        self._since_s: float | None = None

    def __call__(self, *, in_: bool, pt_s: float, time_s: float) -> None:
        self.error = not 0.0 <= pt_s < math.inf
        rises, self._was = in_ and not self._was, in_
        if self.error:
            self._since_s = None
        elif rises and self._since_s is None:
            self._since_s = time_s
        if self._since_s is None:
            self.q, self.et_s = False, 0.0
            return
        elapsed_s = time_s - self._since_s
        self.q = elapsed_s < pt_s - _ROUNDING_S
        self.et_s = elapsed_s if self.q else pt_s
        if not self.q and not in_:
            self._since_s, self.et_s = None, 0.0


class R_TRIG:  # noqa: N801  the name in IEC 61131-3
    """Rising edge: `q` for one call when `clk` has become TRUE; also in the first call with TRUE."""

    __slots__ = ("_was", "q")

    def __init__(self) -> None:
        self.q = self._was = False

    def __call__(self, *, clk: bool) -> None:
        self.q, self._was = clk and not self._was, clk


class F_TRIG:  # noqa: N801  the name in IEC 61131-3
    """Falling edge: `q` for one call when `clk` has become FALSE.

    Not in the first call: there the text of the standard gives a pulse that no edge has made.
    """

    __slots__ = ("_was", "q")

    def __init__(self) -> None:
        self.q = self._was = False

    def __call__(self, *, clk: bool) -> None:
        self.q, self._was = self._was and not clk, clk


class SR:
    """Flip-flop, set dominant."""

    __slots__ = ("q1",)

    def __init__(self) -> None:
        self.q1 = False

    def __call__(self, *, s1: bool, r: bool) -> None:
        self.q1 = s1 or (self.q1 and not r)


class RS:
    """Flip-flop, reset dominant."""

    __slots__ = ("q1",)

    def __init__(self) -> None:
        self.q1 = False

    def __call__(self, *, s: bool, r1: bool) -> None:
        self.q1 = not r1 and (s or self.q1)


class CTU:
    """Up-counter: `cv` counts the rising edges of `cu` up to 32767; `r` sets it to 0.

    Attributes:
        q: `cv` has reached `pv`.
        cv: the count.
    """

    __slots__ = ("_was", "cv", "q")

    def __init__(self) -> None:
        self.q = self._was = False
        self.cv = 0

    def __call__(self, *, cu: bool, r: bool, pv: int) -> None:
        rises, self._was = cu and not self._was, cu
        if r:
            self.cv = 0
        elif rises and self.cv < COUNT_MAX:
            self.cv += 1
        self.q = self.cv >= pv
