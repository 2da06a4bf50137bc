"""The readings of a chord test on a machine, on disk before the axis goes on: a kill loses none."""

from __future__ import annotations

import json
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Final

import numpy as np
from pydantic import TypeAdapter

from gantryctl.engineering.accuracy.procedure.plan import ChordPlan
from gantryctl.engineering.accuracy.procedure.procedures import Chord, Procedure, StopRole
from gantryctl.engineering.accuracy.table import FloatArray
from gantryctl.engineering.instruments import Reading
from gantryctl.errors import InstrumentError, StateError, UsageError
from gantryctl.files import write_whole
from gantryctl.machine import Machine, config_hash
from gantryctl.operation.store import StateStore, now_text
from gantryctl.units import SIGNED, Dial

# An instrument that counts the other way, or in another unit, is further off after the shortest chord of 5 deg; a
# gantry never is.
PLAUSIBLE_DEG: Final = 1.0


@dataclass(frozen=True)
class StopReading:
    """What was read at one stop.

    Attributes:
        stop: index in the procedure.
        angle_deg, uncertainty_deg: of the instrument, standard uncertainty.
        motor_deg: mean angle by the drive's encoder over the end of the dwell.
        at: date and time, UTC.
    """

    stop: int
    target_deg: float
    angle_deg: float
    uncertainty_deg: float
    motor_deg: float
    at: str


@dataclass(frozen=True)
class RestartCheck:
    """The last stop, read again when the test went on: the instrument still stands where it stood.

    Attributes:
        difference_deg: new reading minus the old one. allowed_deg: largest difference that was accepted.
    """

    stop: int
    difference_deg: float
    allowed_deg: float
    at: str


@dataclass(frozen=True)
class ChordOrder:
    """What a chord test is asked to do; another order begins another test."""

    plan: ChordPlan
    procedure: str = "A"
    runs: int = 1
    chord: Chord = Chord.BASE

    def made(self) -> Procedure:
        """The stops."""
        return self.plan.procedure(self.procedure, self.runs, self.chord)


@dataclass(frozen=True)
class ChordSession:
    """One chord test on one machine in one configuration, as far as it has got.

    Attributes:
        instrument: what it called itself at each start of the test.
        readings: in the order of the procedure.
    """

    machine: str
    config_hash: str
    order: ChordOrder
    begun: str
    instruments: tuple[str, ...] = ()
    readings: tuple[StopReading, ...] = ()
    checks: tuple[RestartCheck, ...] = ()

    @property
    def procedure(self) -> Procedure:
        """The stops."""
        return self.order.made()

    @property
    def next_stop(self) -> int:
        """Index of the stop to visit next."""
        return self.readings[-1].stop + 1 if self.readings else 0

    @property
    def complete(self) -> bool:
        """Nothing is left to read."""
        return self.next_stop > max(measured_stops(self.procedure))

    @property
    def text(self) -> str:
        """How far it has got, for `status`."""
        return f"chord test: {len(self.readings)} of {len(measured_stops(self.procedure))} readings"

    def with_reading(
        self, stop: int, reading: Reading, motor_deg: float, dial: Dial = SIGNED
    ) -> ChordSession:
        """The test with one reading more; the refusal names angles as `dial` reads them.

        Raises:
            InstrumentError: it has not gone with the axis since the first one.
        """
        target_deg = self.procedure.stops[stop].target_deg
        if self.readings:
            first = self.readings[0]
            way, seen = target_deg - first.target_deg, reading.angle_deg - first.angle_deg
            if not abs(seen - way) <= PLAUSIBLE_DEG:
                raise InstrumentError(
                    f"reading {reading.angle_deg:.4f} deg at {dial.text(target_deg)} deg: the axis has gone "
                    f"{way:+.3f} deg since the first reading and the instrument {seen:+.3f} deg; check its sign "
                    "(counter-clockwise is positive), its unit and the reading; --again begins the test anew"
                )
        made = StopReading(
            stop, target_deg, reading.angle_deg, reading.uncertainty_deg, motor_deg, now_text()
        )
        return replace(self, readings=(*self.readings, made))

    def angles_deg(self) -> FloatArray:
        """Angle of every stop by the instrument, deg, shape (stops,); of stops that are not read the target."""
        return self._by_stop([(r.stop, r.angle_deg) for r in self.readings])

    def motor_deg(self) -> FloatArray:
        """The same by the drive's encoder."""
        return self._by_stop([(r.stop, r.motor_deg) for r in self.readings])

    def uncertainties_deg(self) -> FloatArray:
        """Standard uncertainty of every stop's angle, deg, shape (stops,); 0 where nothing is read."""
        values = np.zeros(len(self.procedure.stops))
        for reading in self.readings:
            values[reading.stop] = reading.uncertainty_deg
        return values

    def _by_stop(self, values: list[tuple[int, float]]) -> FloatArray:
        angles = np.degrees(self.procedure.targets_rad)
        for stop, value in values:
            angles[stop] = value
        return angles


def measured_stops(procedure: Procedure) -> tuple[int, ...]:
    """Indices of the stops that a chord begins or ends at; the others are only passed."""
    read = (StopRole.BASE, StopRole.POINT)
    return tuple(k for k, stop in enumerate(procedure.stops) if stop.role in read)


def session_path(store: StateStore) -> Path:
    """File of the test, beside the retained memory of the machine; removed when its report is written."""
    return store.directory / "chord_test.json"


def new_session(machine: Machine, order: ChordOrder) -> ChordSession:
    """A test that has not begun."""
    return ChordSession(machine.name, config_hash(machine), order, now_text())


def load_session(path: Path) -> ChordSession | None:
    """The test that was under way; None without one.

    Raises:
        StateError: the file is damaged.
    """
    if not path.exists():
        return None
    try:
        return TypeAdapter(ChordSession).validate_json(path.read_bytes())
    except (OSError, ValueError, UsageError) as fault:
        raise StateError(f"{path}: cannot be read ({fault}); --again begins the test anew") from None


def store_session(path: Path, session: ChordSession) -> None:
    """Keep the test, whole or not at all; it is on the disk when this returns."""
    data = asdict(session)
    data["order"]["chord"] = session.order.chord.value
    write_whole(path, json.dumps(data, indent=1, allow_nan=False) + "\n")


def session_to_go_on_with(path: Path, machine: Machine, order: ChordOrder) -> ChordSession | None:
    """The test in the file, if it is this one; a finished one lacks its report.

    Raises:
        UsageError: another one is under way.
        StateError: the file is damaged.
    """
    kept = load_session(path)
    if kept is None:
        return None
    if kept.order != order or kept.config_hash != config_hash(machine):
        what = "another configuration" if kept.order == order else "another procedure"
        raise UsageError(
            f"a chord test of {what}, begun {kept.begun}, has {len(kept.readings)} readings: finish it as it was "
            "begun, or --again leaves it"
        )
    return kept
