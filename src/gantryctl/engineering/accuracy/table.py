"""The error table of a chord test, before any statistics."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from enum import Enum
from itertools import pairwise
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from gantryctl.errors import UsageError

FloatArray = NDArray[np.float64]


class Direction(Enum):
    """Direction of motion, seen from the front: counter-clockwise is positive."""

    CCW = "ccw"
    CW = "cw"

    @property
    def sign(self) -> int:
        """+1 counter-clockwise, -1 clockwise."""
        return 1 if self is Direction.CCW else -1


class Layout(Enum):
    """Positions of the stops behind the rows of a table."""

    # ccw rows at base + d, cw rows at base - d: no position is reached from both sides (procedures A, B, D).
    APART = "apart"
    # ccw rows at base + d, cw rows on the way back from the farthest of these stops (procedure C).
    RETURN = "return"
    # Every column is the error of the one step to it from the stop before (chords between adjacent stops).
    STEPS = "steps"


class RowKey(NamedTuple):
    """One series of a table."""

    base_deg: float
    direction: Direction
    run: int = 1


@dataclass(frozen=True, eq=False)
class ErrorTable:
    """Chord errors, one row per series and one column per displacement.

    Attributes:
        rows: base, direction and run of every row; any order, no duplicates.
        displacements_deg: columns, ascending, the zero column (the base itself) included as the first.
        errors_deg: shape (rows, columns), measured minus nominal displacement, deg, positive = moved too far;
            the zero column is exactly zero. Not writeable.
        layout: where the stops lie.
    """

    rows: tuple[RowKey, ...]
    displacements_deg: tuple[float, ...]
    errors_deg: FloatArray = field(repr=False)
    layout: Layout = Layout.APART

    def __post_init__(self) -> None:
        errors = np.array(self.errors_deg, dtype=np.float64)
        if errors.shape != (len(self.rows), len(self.displacements_deg)):
            raise UsageError(
                f"error table: {errors.shape} values for {len(self.rows)} rows "
                f"x {len(self.displacements_deg)} columns"
            )
        self._check(errors)
        # Reports cache the statistics of their tables, so a table never changes.
        errors.setflags(write=False)
        object.__setattr__(self, "errors_deg", errors)

    def _check(self, errors: FloatArray) -> None:
        columns = self.displacements_deg
        if not self.rows or not columns or columns[0] != 0.0:
            raise UsageError("error table: needs at least one row and 0 deg as its first column")
        if any(b <= a for a, b in pairwise(columns)):
            raise UsageError(f"error table: displacements must ascend, got {columns}")
        if len(set(self.rows)) != len(self.rows):
            raise UsageError("error table: the same base, direction and run twice")
        if not np.all(np.isfinite(errors)):
            raise UsageError("error table: a value is not finite")
        if np.any(errors[:, 0] != 0.0):
            raise UsageError("error table: the zero column must be zero, the base is measured against itself")

    def __eq__(self, other: object) -> bool:
        if not isinstance(other, ErrorTable):
            return NotImplemented
        same_shape = (self.rows, self.displacements_deg, self.layout) == (
            other.rows,
            other.displacements_deg,
            other.layout,
        )
        return same_shape and bool(np.array_equal(self.errors_deg, other.errors_deg))

    __hash__ = None  # type: ignore[assignment]  # equal by its array: no key of a dict; typeshed knows no such class

    @property
    def bases_deg(self) -> tuple[float, ...]:
        """The base positions in the order of the rows."""
        return tuple(dict.fromkeys(row.base_deg for row in self.rows))

    @property
    def directions(self) -> tuple[Direction, ...]:
        """The directions present, ccw first."""
        present = {row.direction for row in self.rows}
        return tuple(d for d in Direction if d in present)

    @property
    def runs(self) -> int:
        """Runs of the least measured series; ISO 230-2 asks for five."""
        # A standard that asks for five approaches asks for five of every position.
        counts: dict[tuple[float, Direction], int] = {}
        for row in self.rows:
            counts[row[:2]] = counts.get(row[:2], 0) + 1
        return min(counts.values())

    def select(
        self, bases_deg: Sequence[float] | None = None, direction: Direction | None = None
    ) -> FloatArray:
        """Errors of the rows with these bases and this direction, shape (selected rows, columns), deg."""
        keep = [
            (bases_deg is None or row.base_deg in bases_deg)
            and (direction is None or row.direction is direction)
            for row in self.rows
        ]
        return self.errors_deg[np.array(keep, dtype=np.bool_)]

    def mean_of_runs(self) -> ErrorTable:
        """The table with one row per base and direction: the mean over the runs."""
        keys = tuple(dict.fromkeys(row[:2] for row in self.rows))
        means = [self.select([base], direction).mean(axis=0) for base, direction in keys]
        rows = tuple(RowKey(base, direction) for base, direction in keys)
        return ErrorTable(rows, self.displacements_deg, np.array(means), self.layout)


def table_from_rows(
    rows: Sequence[tuple[float, str, Sequence[float]]], displacements_deg: Sequence[float]
) -> ErrorTable:
    """A table from (base_deg, "ccw" | "cw", errors_deg) triples, one run each: for tables typed in."""
    keys = tuple(RowKey(base, Direction(direction)) for base, direction, _ in rows)
    return ErrorTable(keys, tuple(displacements_deg), np.array([errors for *_, errors in rows]))
