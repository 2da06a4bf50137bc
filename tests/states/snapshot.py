"""Keep and restore the state of objects in place, so that one program can go on from any state that it was in."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from operator import attrgetter
from typing import Any

_CONTAINERS = frozenset({"list", "dict", "set", "deque", "OrderedDict", "Counter"})


def names_of(each: object) -> tuple[str, ...]:
    """Every attribute of an object: the slots of its class and bases, and what its dictionary holds."""
    found = {name for base in type(each).__mro__ for name in getattr(base, "__slots__", ())}
    found |= set(getattr(each, "__dict__", ()))
    return tuple(sorted(name for name in found if not name.startswith("__")))


class Entry:
    """One object with its values, or one container (`names` is None) with its elements; `get` reads them."""

    __slots__ = ("get", "names", "target", "values")

    def __init__(
        self, target: Any, names: tuple[str, ...] | None, get: Callable[[Any], Any], values: Any
    ) -> None:
        self.target, self.names, self.get, self.values = target, names, get, values

    def restore(self) -> None:
        """Put the values back; the caller has seen that they are others."""
        target, names = self.target, self.names
        if names is not None:
            for name, value in zip(names, self.values, strict=True):
                setattr(target, name, value)
            return
        target.clear()
        if isinstance(target, (dict, set)):
            target.update(self.values)
        else:
            target.extend(self.values)


Snapshot = list[Entry]


class Keeper:
    """Takes and restores snapshots of everything mutable that is reachable from some roots.

    Args:
        roots: where to begin.
        kept: attributes of an object that are kept; None for what cannot change.
    """

    def __init__(self, roots: Iterable[object], kept: Callable[[object], tuple[str, ...] | None]) -> None:
        self._roots = tuple(roots)
        self._kept = kept
        self._kinds: dict[type, tuple[tuple[str, ...], Callable[[Any], Any]] | None] = {}

    def take(self, before: Snapshot) -> Snapshot:
        """State of now; entries that are as in `before` are shared with it."""
        old = {id(entry.target): entry for entry in before}
        seen: set[int] = set()
        waiting: list[Any] = list(self._roots)
        found: Snapshot = []
        kinds = self._kinds
        while waiting:
            each = waiting.pop()
            cls = type(each)
            if cls not in kinds:
                kinds[cls] = self._kind(each)
            kind = kinds[cls]
            if kind is None or id(each) in seen:
                continue
            seen.add(id(each))
            names, get = kind
            values = get(each)
            waiting.extend(values.values() if isinstance(values, dict) else values)
            entry = old.get(id(each))
            if entry is None or entry.target is not each or entry.values != values:
                entry = Entry(each, names or None, get, values)
            found.append(entry)
        return found

    @staticmethod
    def restore(snapshot: Snapshot) -> None:
        # Most objects are as they were: to look is a quarter of the work of writing.
        for entry in snapshot:
            if entry.get(entry.target) != entry.values:
                entry.restore()

    def _kind(self, each: object) -> tuple[tuple[str, ...], Callable[[Any], Any]] | None:
        cls = type(each)
        if cls.__name__ in _CONTAINERS:
            return (), dict if issubclass(cls, dict) else tuple
        names = self._kept(each)
        if not names:
            return None
        if len(names) == 1:
            get = attrgetter(names[0])
            return names, lambda one: (get(one),)
        return names, attrgetter(*names)
