"""What a step gets and gives: its context, its result, and the file by which an interrupted commissioning resumes."""

from __future__ import annotations

import hashlib
import json
import math
from collections.abc import Callable, Mapping
from dataclasses import asdict, dataclass, field, replace
from enum import StrEnum
from pathlib import Path
from typing import TypeAlias

from pydantic import TypeAdapter

from gantryctl.commissioning.watch import StepWatch
from gantryctl.drives.od.verdicts import ParameterRow
from gantryctl.engineering.instruments import Instrument
from gantryctl.engineering.report.pictures import Picture
from gantryctl.errors import StateError
from gantryctl.files import write_whole
from gantryctl.machine import Machine
from gantryctl.operation.run import AxisRun
from gantryctl.operation.store import StateStore


class Outcome(StrEnum):
    """Outcome of a step."""

    PASSED = "passed"
    FAILED = "failed"
    NOT_TESTABLE = "not testable here"


@dataclass(frozen=True)
class Figure:
    """One number of a step, and the limits that it is held against; its name ends with the unit.

    Attributes:
        value: None where nothing could be measured.
        low, high: smallest and largest value that passes; None where there is no such limit.
    """

    value: float | None
    low: float | None = None
    high: float | None = None

    @property
    def limited(self) -> bool:
        """It is held against a limit; else it only informs."""
        return self.low is not None or self.high is not None

    @property
    def within(self) -> bool:
        """Inside its limits; what could not be measured is not."""
        if not self.limited:
            return True
        low = -math.inf if self.low is None else self.low
        high = math.inf if self.high is None else self.high
        return self.value is not None and low <= self.value <= high


@dataclass(frozen=True)
class StepTable:
    """A table of words that a step leaves for the report."""

    heads: tuple[str, ...]
    rows: tuple[tuple[str, ...], ...]


@dataclass(frozen=True)
class StepResult:
    """Result of one step.

    Attributes:
        proof: the observation, in a sentence.
        figures: by name, with the unit at its end; a passed step has none outside of its limits.
        to_do: what a person has to do, "" for nothing.
        seconds: how long it took. axis_s: time of the axis in it; in virtual time the person waits less.
        by: user of the computer who ran it.
        pictures: of what moved. table: what was written or read, for the report.
    """

    key: str
    outcome: Outcome
    proof: str
    figures: dict[str, Figure] = field(default_factory=dict)
    to_do: str = ""
    seconds: float = 0.0
    axis_s: float = 0.0
    at: str = ""
    by: str = ""
    pictures: tuple[Picture, ...] = ()
    table: StepTable | None = None

    def number(self, name: str) -> float:
        """The value of a figure that was measured."""
        value = self.figures[name].value
        assert value is not None
        return value


@dataclass(frozen=True)
class Progress:
    """All results so far, of one machine in one configuration."""

    machine: str
    proven_hash: str
    drive: str = ""
    software: str = ""
    nodes: tuple[str, ...] = ()
    results: dict[str, StepResult] = field(default_factory=dict)

    @property
    def hash(self) -> str:
        """Hash over everything but persons, dates and durations: two equal commissionings have the same."""
        # Dates and durations differ between two commissionings that showed the same.
        plain = {
            k: {**asdict(r), "seconds": 0, "axis_s": 0, "at": "", "by": ""} for k, r in self.results.items()
        }
        own = self.machine, self.proven_hash, self.drive, self.software, self.nodes
        text = json.dumps([*own, plain], sort_keys=True)
        return hashlib.sha256(text.encode()).hexdigest()


def load_progress(path: Path) -> Progress | None:
    """Load the results of an earlier run; None without one.

    Raises:
        StateError: the file is damaged.
    """
    if not path.exists():
        return None
    try:
        # A stored hash is not read: it follows from the results, and could only disagree.
        return TypeAdapter(Progress).validate_python(json.loads(path.read_text(encoding="utf-8")))
    except (OSError, ValueError, TypeError, AttributeError) as fault:
        raise StateError(
            f"{path}: cannot be read ({fault}); remove it to commission from the start"
        ) from None


def store_progress(path: Path, progress: Progress) -> None:
    """Store the results, whole or not at all."""
    data = {**asdict(progress), "hash": progress.hash}
    write_whole(path, json.dumps(data, indent=1, allow_nan=False) + "\n")


InstrumentMaker: TypeAlias = Callable[[AxisRun], Instrument]


@dataclass(frozen=True)
class Context:
    """Commissioning in progress.

    Attributes:
        folder: for files that steps write.
        results: of the steps before.
        as_found: parameters of the drive before this commissioning wrote any.
        say: a line for the person who watches.
        watch: progress and pictures of this step.
        instrument: makes the instrument at the load, once the axis is open; None without one.
        certificate: of its calibration; "" where nobody has named one.
        speed_max_deg_s: nothing moves faster, by what the drive lacks; inf where nothing limits it.
    """

    machine: Machine
    store: StateStore
    folder: Path
    results: Mapping[str, StepResult]
    as_found: tuple[ParameterRow, ...]
    say: Callable[[str], None]
    watch: StepWatch
    instrument: InstrumentMaker | None
    certificate: str
    speed_max_deg_s: float = math.inf


def figure_text(value: float, decimals: int, *, signed: bool = False) -> str:
    """A figure for people, with so many decimals; in two digits where they would leave one."""
    sign = "+" if signed else ""
    return f"{value:{sign}.{decimals}f}" if abs(value) >= 10.0 ** (1 - decimals) else f"{value:{sign}.2g}"


def at_most(value: float) -> str:
    """A permitted figure for people, in two digits and never below what is permitted."""
    unit = 10.0 ** (math.floor(math.log10(value)) - 1)
    # What is 0.05 stays 0.05.
    return f"{math.ceil(value / unit - 1e-6) * unit:.2g}"


def torque_text(torque_nm: float) -> str:
    """A torque of the motor for people."""
    return f"{figure_text(torque_nm, 0)} N m"


def passed(key: str, proof: str, **figures: float | Figure) -> StepResult:
    """Result of a proof that succeeded."""
    return judged(True, key, proof, "", **figures)


def failed(key: str, proof: str, to_do: str, **figures: float | Figure) -> StepResult:
    """Result of a proof that failed."""
    return judged(False, key, proof, to_do, **figures)


def judged(ok: bool, key: str, proof: str, to_do: str, **figures: float | Figure) -> StepResult:
    """Result by the outcome of a proof and by the limits of its figures, whichever is worse.

    Args:
        to_do: for a person, where it failed.
        figures: by name; a number alone has no limits. What is not finite was not measured.
    """
    named = {name: _figure(value) for name, value in figures.items()}
    good = ok and all(figure.within for figure in named.values())
    return StepResult(key, Outcome.PASSED if good else Outcome.FAILED, proof, named, "" if good else to_do)


def _figure(value: float | Figure) -> Figure:
    figure = value if isinstance(value, Figure) else Figure(value)
    known = figure.value is not None and math.isfinite(figure.value)
    return figure if known else replace(figure, value=None)
