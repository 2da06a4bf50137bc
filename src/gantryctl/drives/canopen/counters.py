"""Live figures of the bus."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

from gantryctl.drives.canopen.bus.node import RemoteNode
from gantryctl.drives.canopen.diagnostics import TpdoWatch


class BusCounters(NamedTuple):
    """Live figures of the bus; ages in scans."""

    scans: int
    received: tuple[int, ...]
    missed: tuple[int, ...]
    late: tuple[int, ...]
    duplicated: tuple[int, ...]
    wrong_length: tuple[int, ...]
    longest_age: tuple[int, ...]
    emergencies: int
    boots: int
    others: int
    strange: int
    refused: int

    def lines(self) -> tuple[str, ...]:
        """For people: a row per telegram, and what else was on the bus."""
        tpdos = zip(self.received, self.missed, self.late, self.duplicated, self.longest_age, strict=True)
        rows = [
            f"TPDO {n}: {got} of {self.scans} in time or late, {missed} missed, {late} late, {twice} twice, "
            f"oldest {age} scans"
            for n, (got, missed, late, twice, age) in enumerate(tpdos, start=1)
        ]
        rest = f"emergency messages {self.emergencies}, telegrams refused by the bus {self.refused}"
        return (*rows, rest)


def bus_counters(scans: int, watches: Sequence[TpdoWatch], node: RemoteNode) -> BusCounters:
    """The figures of this moment."""
    return BusCounters(
        scans,
        tuple(w.received for w in watches),
        tuple(w.missed for w in watches),
        tuple(w.late for w in watches),
        tuple(w.duplicated for w in watches),
        tuple(w.wrong_length for w in watches),
        tuple(w.longest_age for w in watches),
        node.emergencies.count,
        node.boots,
        node.others,
        node.strange,
        node.link.refused,
    )
