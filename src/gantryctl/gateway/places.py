"""Places for connections, limited for each address and in all."""

from __future__ import annotations

from collections.abc import Callable
from itertools import count

from gantryctl.gateway.settings import is_loopback, neighbourhood


class Places:
    """Places for connections. Where none is left, who has been idle for longest makes room.

    Args:
        most: of all addresses together. loopback: of this machine. remote: of any other address.
    """

    def __init__(self, most: int, *, loopback: int, remote: int) -> None:
        self._taken: dict[str, list[Place]] = {}
        self._most, self._loopback, self._remote = most, loopback, remote
        self._order = count()

    def take(self, address: str) -> Place | None:
        """A place, or None when there is none for this address."""
        key = neighbourhood(address)
        own = self._taken.get(key, [])
        most = self._loopback if is_loopback(address) else self._remote
        if len(own) >= most and not _make_room(own):
            return None
        if sum(map(len, self._taken.values())) >= self._most and not _make_room(
            max(self._taken.values(), key=len)
        ):
            return None
        place = Place(self._leave, key, self._order)
        self._taken.setdefault(key, []).append(place)
        return place

    def _leave(self, place: Place) -> None:
        own = self._taken[place.key]
        own.remove(place)
        if not own:
            del self._taken[place.key]


class Place:
    """Place of one connection, given back once.

    Attributes:
        key: of the address. mine: not given back yet.
        idle: since when it has been of no use, as a number that rises; None while it is used.
    """

    def __init__(self, give_back: Callable[[Place], None], key: str, order: count[int]) -> None:
        self._give_back, self._order, self._close = give_back, order, _nothing
        self.key, self.mine = key, True
        self.idle: int | None = None

    def rest(self, close: Callable[[], None]) -> None:
        """Say that the connection is idle, and how to end it."""
        self.idle, self._close = next(self._order), close

    def work(self) -> None:
        """Say that it is used."""
        self.idle = None

    def end(self) -> None:
        """Close the connection and give its place back."""
        self.leave()
        self._close()

    def leave(self) -> None:
        """Give the place back."""
        if self.mine:
            self.mine = False
            self._give_back(self)


def _nothing() -> None:
    pass


def _make_room(places: list[Place]) -> bool:
    idle = [place for place in places if place.idle is not None]
    if not idle:
        return False
    min(idle, key=lambda place: place.idle or 0).end()
    return True
