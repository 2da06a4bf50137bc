"""Places for connections, limited for each address and in all."""

from __future__ import annotations

from collections import Counter

from gantryctl.gateway.settings import is_loopback, neighbourhood


class Places:
    """Places for connections.

    Args:
        most: of all addresses together. loopback: of this machine. remote: of any other address.
    """

    def __init__(self, most: int, *, loopback: int, remote: int) -> None:
        self._taken: Counter[str] = Counter()
        self._most, self._loopback, self._remote = most, loopback, remote

    def take(self, address: str) -> Place | None:
        """A place, or None when there is none for this address."""
        key = neighbourhood(address)
        most = self._loopback if is_loopback(address) else self._remote
        if self._taken[key] >= most or self._taken.total() >= self._most:
            return None
        self._taken[key] += 1
        return Place(self._taken, key)


class Place:
    """Place of one connection, given back once.

    Attributes:
        mine: not given back yet.
    """

    def __init__(self, taken: Counter[str], key: str) -> None:
        self._taken, self._key, self.mine = taken, key, True

    def leave(self) -> None:
        """Give the place back."""
        if self.mine:
            self.mine = False
            self._taken[self._key] -= 1
            if not self._taken[self._key]:
                del self._taken[self._key]
