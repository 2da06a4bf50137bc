"""What stands on every report: machine, instrument, requirement, verdict, people, program and command."""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum
from typing import NamedTuple


class Judged(StrEnum):
    """What a figure or a report has shown; the values are the style classes of the page."""

    PASS = "pass"  # noqa: S105 - a verdict
    FAIL = "fail"
    # Not judged, or neither passed nor failed.
    OPEN = "none"


def judged_as(passed: bool | None) -> Judged:
    """Result of a criterion; None where nothing is judged."""
    return Judged.OPEN if passed is None else Judged.PASS if passed else Judged.FAIL


class Made(NamedTuple):
    """How a report came about; the reports take it as it is and read no clock.

    Attributes:
        date: date and time for the page.
        version: of the program. command: the command line that made the report.
        operator, witness: who ran it, who watched; "" leaves room for a name.
    """

    date: str
    version: str
    command: str
    operator: str = ""
    witness: str = ""


class MeasuredBy(NamedTuple):
    """What measured: type and serial number, and its certificate of calibration ("" without one)."""

    instrument: str
    certificate: str = ""


class Verdict(NamedTuple):
    """The verdict of a report: a word or two for the badge, and a sentence."""

    word: str
    judged: Judged
    text: str


class Required(NamedTuple):
    """A required value beside what was found, in words with units."""

    name: str
    limit: str
    found: str
    judged: Judged


@dataclass(frozen=True)
class Head:
    """Identity of a report.

    Attributes:
        machine: name, or names, for the head of every printed page.
        facts: name and value of what tells this machine from others.
        made: how it came about.
        measured_by: None where nothing was measured.
        required_source: where the required values come from; "" where nobody has said so.
    """

    machine: str
    facts: tuple[tuple[str, str], ...]
    made: Made
    measured_by: MeasuredBy | None = None
    required_source: str = ""
