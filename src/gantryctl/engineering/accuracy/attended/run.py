"""The run of a chord test on a machine: move, dwell until settled, read, keep, go on; resumes after any kill."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Final

from gantryctl.engineering.accuracy.attended.session import (
    ChordSession,
    RestartCheck,
    measured_stops,
    store_session,
)
from gantryctl.engineering.instruments import Instrument, Reading
from gantryctl.errors import DeviceError, InstrumentError
from gantryctl.operation.client import Ending, Stop
from gantryctl.operation.run import AxisRun
from gantryctl.operation.store import now_text
from gantryctl.runtime import Engine

# A dwell is lengthened up to this many times until the axis has settled.
_DWELLS: Final = 5
# Beam interrupted, target lost: asked again this often before the test stops with what it has.
_ATTEMPTS: Final = 3
# A gantry that comes back to a stop from the same side repeats within some 0.0002 deg (docs/explanation/accuracy.md,
# procedure C); the rest is left for a day between two starts.
_REPEAT_DEG: Final = 0.002


class AttendedTest:
    """A chord test under way on an open axis.

    Args:
        run: powered up by the first move; the caller closes it.
        session: as far as it has got.
        path: where it is kept after every reading.
        instrument: gives the angle of the load.
        say: a line for the person who watches.
    """

    def __init__(
        self,
        run: AxisRun,
        session: ChordSession,
        path: Path,
        instrument: Instrument,
        say: Callable[[str], None],
    ) -> None:
        self.session = session
        self._run, self._path, self._instrument, self._say = run, path, instrument, say
        self._stops = session.procedure.stops
        self._measured = frozenset(measured_stops(session.procedure))

    def go_on(self) -> ChordSession:
        """Visit what is left; returns early where the operator has stopped the axis.

        Raises:
            InstrumentError: no reading that can be used, or the instrument has moved; what was read is kept.
            DeviceError: the axis does not settle. AlarmStop: an alarm ended it.
        """
        if self.session.readings and not self.session.complete:
            self._return()
        dial = self._run.machine.axis.dial
        for index in range(self.session.next_stop, len(self._stops)):
            if self.session.complete or not self._visit(index):
                break
            if index not in self._measured:
                continue
            read = self._read(index, partial(self.session.with_reading, index, dial=dial))
            if read is None:
                break
            self._keep(read)
        return self.session

    def _return(self) -> None:
        """Come back to the last stop that was read, from the side it was reached from, and read it again."""
        last = self.session.readings[-1]
        # The stop before it gives the side: lost motion is taken up as it was.
        for index in range(max(0, last.stop - 1), last.stop + 1):
            if not self._visit(index):
                return
        self._say(f"reads {self._as_read(last.target_deg)} deg again: has the instrument moved?")
        read = self._read(last.stop, lambda seen, motor: self._checked(seen))
        if read is not None:
            self._keep(read)

    def _checked(self, seen: Reading) -> ChordSession:
        """The test with this check of the instrument.

        Raises:
            InstrumentError: it has moved.
        """
        last = self.session.readings[-1]
        difference = seen.angle_deg - last.angle_deg
        # k = 3: in one of some hundred restarts the two readings alone differ by more than k = 2 allows 5 of.
        allowed = _REPEAT_DEG + 3.0 * math.hypot(seen.uncertainty_deg, last.uncertainty_deg)
        if not abs(difference) <= allowed:
            raise InstrumentError(
                f"the instrument has moved: {self._as_read(last.target_deg)} deg read {last.angle_deg:.5f} deg on "
                f"{last.at} and reads {seen.angle_deg:.5f} deg now, {allowed:.5f} deg are allowed between them; set it "
                "as it was, or --again begins the test anew"
            )
        check = RestartCheck(last.stop, difference, allowed, now_text())
        return replace(self.session, checks=(*self.session.checks, check))

    def _visit(self, index: int) -> bool:
        """Move to a stop and let it settle; False where the operator has stopped the axis."""
        target = self._stops[index].target_deg
        self._say(f"stop {index + 1} of {len(self._stops)}: {self._as_read(target, '.1f')} deg")
        report = self._run.move(target)
        if report.stopped:
            return False
        if report.ending is Ending.NOT_IN_POSITION:
            raise DeviceError(
                f"the axis stands at {self._as_read(report.end_deg, '.4f')} deg and not in position at "
                f"{self._as_read(target)} deg"
            )
        return True

    def _as_read(self, angle_deg: float, spec: str = "g") -> str:
        return self._run.machine.axis.dial.text(angle_deg, spec)

    def _settled_deg(self, index: int) -> float:
        """Dwell; mean motor angle over its end."""
        accuracy, engine = self._run.machine.accuracy, self._run.engine
        window_deg = self._run.machine.monitors.in_position_window_deg
        spread = math.inf
        engine.run_for(accuracy.dwell_s - accuracy.average_s)
        for _ in range(_DWELLS):
            seen = self._angles_deg(accuracy.average_s)
            spread = max(seen) - min(seen)
            if spread <= window_deg:
                return sum(seen) / len(seen)
        raise DeviceError(
            f"stop {index + 1}: the axis does not settle: it moves by {spread:.5f} deg within "
            f"{accuracy.average_s:g} s, [monitors] in_position_window_deg = {window_deg:g}"
        )

    def _angles_deg(self, seconds: float) -> list[float]:
        """Motor angle, scan by scan."""
        seen: list[float] = []

        def look(_: Engine) -> bool:
            seen.append(self._run.angle_deg)
            return False

        self._run.engine.run_until(look, seconds)
        return seen

    def _read(self, index: int, take: Callable[[Reading, float], ChordSession]) -> ChordSession | None:
        """Dwell, read, and take the reading in; None where the operator has stopped the axis."""
        motor_deg = self._settled_deg(index)
        self._run.while_standing(self._run.rest_keeper(), finish=True)
        for attempt in range(1, _ATTEMPTS + 1):
            try:
                reading = self._run.while_standing(partial(self._instrument.read, self._run.engine.time_s))
                return None if self._run.stop is not Stop.NO or reading is None else take(reading, motor_deg)
            except InstrumentError as fault:
                if attempt == _ATTEMPTS:
                    raise
                self._say(f"{fault} · asked again")
        return None

    def _keep(self, session: ChordSession) -> None:
        # A disk that stalls must not hold up a scan: the drive would miss its commands.
        self._run.while_standing(partial(store_session, self._path, session), finish=True)
        self.session = session
