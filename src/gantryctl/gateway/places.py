"""Places for connections, limited for each address and in all, and the room in which connections wait for one."""

from __future__ import annotations

import socket
import time
from collections import OrderedDict, deque
from collections.abc import Callable
from dataclasses import dataclass, field
from itertools import count
from typing import NamedTuple

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


class Arrival(NamedTuple):
    """A connection, the address at its other end, and since when it waits."""

    connection: socket.socket
    address: str
    since_s: float


@dataclass
class _Party:
    waiting: deque[Arrival] = field(default_factory=deque)
    newest: bool = False


class Waiting:
    """Connections by party: a session, a user of this machine, or a remote address.

    Parties take turns, so that a crowd of one delays nobody else. Of one party the newest and the oldest are next in
    turn: whoever comes once need not wait behind the whole crowd, and nobody waits without end.

    Args:
        most: connections of all parties; beyond it the oldest of the party that has most is ended.
        patience_s: who has waited for longer is ended.
        now: the monotonic time, s.
    """

    def __init__(self, most: int, patience_s: float, now: Callable[[], float] = time.monotonic) -> None:
        self._most, self._patience_s, self._now = most, patience_s, now
        self._parties: OrderedDict[str, _Party] = OrderedDict()
        self._count = 0

    def __len__(self) -> int:
        return self._count

    def add(self, connection: socket.socket, address: str, party: str) -> None:
        """Let one wait."""
        own = self._parties.setdefault(party, _Party())
        own.waiting.append(Arrival(connection, address, self._now()))
        self._count += 1
        if self._count > self._most:
            self._end_oldest(max(self._parties, key=lambda each: len(self._parties[each].waiting)))

    def next(self) -> Arrival | None:
        """Whose turn it is, or None when nobody waits."""
        while self._parties:
            party, own = next(iter(self._parties.items()))
            if self._now() - own.waiting[0].since_s > self._patience_s:
                self._end_oldest(party)
                continue
            own.newest = not own.newest
            found = own.waiting.pop() if own.newest else own.waiting.popleft()
            self._count -= 1
            self._parties.move_to_end(party)
            if not own.waiting:
                del self._parties[party]
            return found
        return None

    def close(self) -> None:
        """End them all."""
        while self._parties:
            self._end_oldest(next(iter(self._parties)))

    def _end_oldest(self, party: str) -> None:
        own = self._parties[party]
        own.waiting.popleft().connection.close()
        self._count -= 1
        if not own.waiting:
            del self._parties[party]
