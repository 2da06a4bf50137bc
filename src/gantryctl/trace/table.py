"""`Trace`: a recording in memory. A row holds the state at its `time_s`: one per scan, fewer where the axis rests."""

from __future__ import annotations

import hashlib
import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Final, NamedTuple

import numpy as np

from gantryctl.errors import UsageError
from gantryctl.extras import need
from gantryctl.files import check_place
from gantryctl.notebook import table_html
from gantryctl.trace.columns import SPACING_COLUMN, TIME_COLUMN, degree_factor, in_degrees, unit_of
from gantryctl.trace.files import (
    Floats,
    Metadata,
    arrow_schema,
    record_batch,
    rows_per_group,
    write_csv,
    write_parquet,
)
from gantryctl.units import Dial

if TYPE_CHECKING:
    import pandas as pd
    import polars as pl

    from gantryctl.trace.figure import Picture

# Columns that a notebook shows of a trace; the rest is counted.
_SHOWN: Final = 12


class TraceHash:
    """SHA-256 over the column names and the rows, each value as its eight bytes; grows with the recording."""

    def __init__(self, columns: Sequence[str]) -> None:
        self._digest = hashlib.sha256("\n".join(columns).encode() + b"\0")
        self._width = len(columns)

    def update(self, rows: Floats) -> None:
        """Add whole rows, an array of shape (rows, columns)."""
        if rows.ndim != 2 or rows.shape[1] != self._width:
            raise UsageError(f"trace hash: rows of {self._width} values expected, got shape {rows.shape}")
        # Row by row, so that the hash can grow with a recording that is not kept (0006); little-endian, so that it
        # is the same on every machine.
        self._digest.update(np.ascontiguousarray(rows, dtype="<f8").tobytes())

    def hexdigest(self) -> str:
        """Hash of all rows so far."""
        return self._digest.hexdigest()


class Trace:
    """Columns by name: `trace["pos_ref_rad"]` is a numpy array.

    Attributes:
        columns: the names, `time_s` first.
        metadata: what the recording says about itself.
        complete: False when the recording was never closed (a killed process): the rows up to there are good.
    """

    def __init__(
        self, data: Mapping[str, Floats], metadata: Metadata | None = None, *, complete: bool = True
    ) -> None:
        self._data = {name: np.asarray(values, dtype=np.float64) for name, values in data.items()}
        if len({values.shape for values in self._data.values()}) > 1:
            lengths = ", ".join(f"{name} {len(values)}" for name, values in self._data.items())
            raise UsageError(f"columns of a trace must be equally long, got {lengths}")
        self.columns = tuple(self._data)
        self.metadata = dict(metadata or {})
        self.complete = complete

    @property
    def dial(self) -> Dial:
        """How people read its angles."""
        return Dial.of_recording(self.metadata)

    @classmethod
    def from_rows(cls, columns: Sequence[str], rows: Floats, metadata: Metadata | None = None) -> Trace:
        """Make a trace of an array of shape (rows, columns)."""
        return cls(dict(zip(columns, np.ascontiguousarray(rows.T), strict=True)), metadata)

    def __getitem__(self, name: str) -> Floats:
        try:
            return self._data[name]
        except KeyError:
            raise UsageError(
                f"the trace has no column {name!r}; there are: {', '.join(self.columns)}"
            ) from None

    def __contains__(self, name: object) -> bool:
        return name in self._data

    def __len__(self) -> int:
        return len(next(iter(self._data.values()))) if self._data else 0

    def __repr__(self) -> str:
        return f"<Trace {len(self)} rows, {self.duration_s:.3f} s, {len(self.columns)} columns>"

    @property
    def time_s(self) -> Floats:
        """Nominal time of every row, s."""
        return self[TIME_COLUMN]

    @property
    def duration_s(self) -> float:
        """Time from the first row to the last, s."""
        return float(self.time_s[-1] - self.time_s[0]) if len(self) else 0.0

    @property
    def period_s(self) -> float | None:
        """Scan period, s; None where the metadata does not say."""
        period_s = self.metadata.get("period_s")
        return float(period_s) if isinstance(period_s, int | float) and period_s > 0 else None

    @property
    def spacing_s(self) -> Floats | None:
        """Time for which each row stands, s, shape (rows,): weights of a mean over time.

        None where neither the rows nor the metadata say: then all rows count alike.
        """
        if self.recorded_spacing_s is not None or self.period_s is None:
            return self.recorded_spacing_s
        return np.full(len(self), self.period_s)

    @property
    def recorded_spacing_s(self) -> Floats | None:
        """The column `spacing_s`; None where the recording has one row per scan."""
        return self._data.get(SPACING_COLUMN)

    @property
    def rest_rows(self) -> int:
        """Rows that stand for more than one scan, because the axis rested."""
        spacing_s, period_s = self.spacing_s, self.period_s
        if spacing_s is None or period_s is None:
            return 0
        return int(np.count_nonzero(spacing_s > 1.5 * period_s))

    def gaps(self) -> list[tuple[float, float]]:
        """Gaps in the recording: times of the rows before and after, s. Needs `period_s` in the metadata."""
        spacing_s, period_s = self.spacing_s, self.period_s
        if spacing_s is None or period_s is None or len(self) < 2:
            return []
        time_s = self.time_s
        # Half a period of tolerance: times are k x period, so a step is a whole number of periods.
        (before,) = np.nonzero(np.diff(time_s) > spacing_s[1:] + 0.5 * period_s)
        return [(float(time_s[k]), float(time_s[k + 1])) for k in before]

    def every_scan(self) -> Trace:
        """Make one row per scan: a row at rest is repeated for the scans before it that it stands for.

        For spectra, and whatever else needs rows at equal times. Gaps remain gaps.

        Raises:
            UsageError: the metadata does not tell the scan period.
        """
        spacing_s, period_s = self.spacing_s, self.period_s
        if spacing_s is None or period_s is None:
            raise UsageError("the recording does not tell its scan period: it has no rows at equal times")
        counts = np.maximum(1, np.round(spacing_s / period_s)).astype(int)
        back = np.repeat(np.cumsum(counts), counts) - 1 - np.arange(counts.sum())
        data = {
            name: np.repeat(values, counts) for name, values in self._data.items() if name != SPACING_COLUMN
        }
        data[TIME_COLUMN] = data[TIME_COLUMN] - back * period_s
        return Trace(data, self.metadata, complete=self.complete)

    def slice(self, start_s: float, end_s: float) -> Trace:
        """Take the rows with `start_s <= time_s <= end_s`."""
        kept = (self.time_s >= start_s) & (self.time_s <= end_s)
        data = {name: values[kept] for name, values in self._data.items()}
        return Trace(data, self.metadata, complete=self.complete)

    def in_degrees(self) -> Trace:
        """Convert every angle to degrees, column names included: for people and for export."""
        data = {in_degrees(name): values * degree_factor(name) for name, values in self._data.items()}
        return Trace(data, self.metadata, complete=self.complete)

    def rows(self, start: int = 0, stop: int | None = None) -> Floats:
        """Rows `start` to `stop` as one array of shape (rows, columns)."""
        return np.column_stack([values[start:stop] for values in self._data.values()])

    def hash(self) -> str:
        """SHA-256 over names and values, bit for bit: the same seed gives the same hash."""
        digest = TraceHash(self.columns)
        for start in range(0, len(self), 10_000):
            digest.update(self.rows(start, start + 10_000))
        return digest.hexdigest()

    def to_csv(self, path: str | Path) -> None:
        """Export with one header line; numbers read back to the same value."""
        write_csv(Path(path), self._data)

    def to_parquet(self, path: str | Path) -> None:
        """Export with the metadata; `read_trace` reads it back.

        Raises:
            UsageError: there is no place of this name. DeviceError: the disk does not take it.
        """
        check_place(Path(path))
        schema = arrow_schema(self.columns, self.metadata)
        step = rows_per_group(schema)
        batches = (
            record_batch(schema, self.rows(start, start + step)) for start in range(0, len(self), step)
        )
        write_parquet(Path(path), schema, batches)

    def to_pandas(self) -> pd.DataFrame:
        """Copy the columns into a data frame of pandas, `time_s` as any other; the metadata is in its `attrs`.

        Raises:
            UsageError: pandas is not installed.
        """
        need("pandas")
        import pandas as pd

        frame = pd.DataFrame({name: values.copy() for name, values in self._data.items()})
        frame.attrs.update(self.metadata)
        return frame

    def to_polars(self) -> pl.DataFrame:
        """Copy the columns into a data frame of polars, which holds no metadata.

        Raises:
            UsageError: polars is not installed.
        """
        need("polars")
        import polars as pl

        return pl.DataFrame({name: values.copy() for name, values in self._data.items()})

    def plot(self, *columns: str, title: str = "") -> Picture:
        """Draw angle, speed, their errors and torque over time, or the columns that are named, in degrees.

        A notebook shows what is returned, and its `save` writes PNG or SVG; no window is opened.

        Raises:
            UsageError: no such column, no row, nothing of what is drawn without names, or no matplotlib.
        """
        need("matplotlib")
        from gantryctl.trace.figure import Picture, chosen, draw, overview

        panels = chosen(self, columns) if columns else overview(self)
        return Picture(draw(self, panels, title or str(self.metadata.get("machine", ""))))

    def _repr_html_(self) -> str:
        shown = self.in_degrees()
        part = Trace({name: shown[name] for name in shown.columns[:_SHOWN]})
        rows = [(each.name, each.unit, each.minimum, each.maximum, each.rms) for each in summarize(part)]
        left = len(self.columns) - len(rows)
        note = f"and {left} more columns: trace.columns" if left > 0 else ""
        return table_html(f"Trace: {self._said()}", ("column", "unit", "min", "max", "rms"), rows, note)

    def _said(self) -> str:
        """Size, machine and state in one line."""
        words = [f"{len(self)} rows", f"{len(self.columns)} columns", f"{self.duration_s:.3f} s"]
        if "machine" in self.metadata:
            words.insert(0, str(self.metadata["machine"]))
        gaps = len(self.gaps())
        return ", ".join(
            [*words, *([f"{gaps} gaps"] if gaps else []), *([] if self.complete else ["cut off"])]
        )


class ColumnSummary(NamedTuple):
    """Extremes and root mean square of one column over its finite values, in the unit of the column.

    The mean is over time: a row at rest counts for all scans that it stands for.
    """

    name: str
    unit: str
    minimum: float | None
    maximum: float | None
    rms: float | None
    not_finite: int
    """Values that are NaN or infinite."""


def summarize(trace: Trace) -> list[ColumnSummary]:
    """Summarise every column, in their order; None where there is no finite value."""
    weights = trace.recorded_spacing_s
    return [_summary(name, trace[name], weights) for name in trace.columns]


def _summary(name: str, values: Floats, weights: Floats | None) -> ColumnSummary:
    known = np.isfinite(values)
    finite = values[known]
    missing = len(values) - len(finite)
    unit = unit_of(name).symbol
    if not len(finite):
        return ColumnSummary(name, unit, None, None, None, missing)
    # Squares of large values would overflow.
    scale = float(np.max(np.abs(finite))) or 1.0
    squares = (finite / scale) ** 2
    mean = np.mean(squares) if weights is None else np.average(squares, weights=weights[known])
    rms = scale * math.sqrt(float(mean))
    return ColumnSummary(name, unit, float(finite.min()), float(finite.max()), rms, missing)
