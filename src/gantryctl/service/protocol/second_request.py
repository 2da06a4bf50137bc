"""A load that torque alone holds is let go at a person's second request, never at the first."""

from __future__ import annotations

from typing import Final

FIRST: Final = 1
SECOND: Final = 2


class SecondRequest:
    """Requests of persons to end what holds the load.

    The first may be of somebody who does not know that it would fall. The second is to be meant as such: two people
    who have asked once each have not asked twice.
    """

    __slots__ = ("_asked",)

    def __init__(self) -> None:
        self._asked: set[str] = set()

    def forget(self) -> None:
        """Nothing holds a load by torque alone, or another time does: what was asked before is over."""
        self._asked.clear()

    def asked(self, who: str = "") -> int:
        """Take one request: FIRST of all, SECOND of the same person, or 0 where it counts as neither."""
        again, alone = who in self._asked, not self._asked
        self._asked.add(who)
        return SECOND if again else FIRST if alone else 0
