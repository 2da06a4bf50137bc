"""What a person sees of a step while it runs, how it is ended by a person, and what it leaves to be drawn."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from typing import Final, NamedTuple

from gantryctl.commissioning.pictures import MotionSample, motion_picture
from gantryctl.engineering.report.meter import Meter
from gantryctl.engineering.report.pictures import Picture
from gantryctl.errors import GantryctlError
from gantryctl.image import DriveFeedback
from gantryctl.operation.client import Snapshot, Stop
from gantryctl.operation.run import AxisRun

# A listener looks a hundred times a second: one that was silent for longer does not hear a Stop.
LISTENER_S: Final = 0.5


class StepStopped(GantryctlError):
    """A step has shown nothing, and what was shown before stands: a person has ended it, or it had no room to begin."""

    exit_code = 3


class Halt:
    """The request of a person to end one step. Any thread may ask; the step looks in every scan.

    Args:
        listens: somebody takes requests and calls `listened` all the time; a step that nobody can stop ends.

    Attributes:
        urgency: the hardest stop that was asked for.
        why: the first request in words, "" for none.
    """

    def __init__(self, *, listens: bool = False, now_s: Callable[[], float] = time.monotonic) -> None:
        self.urgency, self.why = Stop.NO, ""
        self._now_s, self._listened_s = now_s, now_s() if listens else float("inf")
        self._run: AxisRun | None = None

    def listened(self) -> None:
        """The listener is alive."""
        self._listened_s = self._now_s()

    def ask(self, urgency: Stop, why: str) -> None:
        """End the step: an axis with its program stops by it, any other one with torque off and brake."""
        self.why = self.why or why
        self.urgency = max(self.urgency, urgency)
        if self._run is None:
            return
        if self.holds_load:
            # Whatever was asked for before, two requests from now on let the load go.
            self._run.stop = Stop.RAMP if self._run.stop is Stop.NO else Stop.QUICK
        else:
            self._run.stop = self.urgency

    @property
    def holds_load(self) -> bool:
        """Torque alone holds the load of the run: it goes on until it is asked twice to stop."""
        return self._run is not None and self._run.load_is_held()

    def asked(self) -> bool:
        """Whether the step is to end."""
        if not self._now_s() - self._listened_s <= LISTENER_S:
            self.ask(Stop.RAMP, f"nobody has listened for a Stop for {LISTENER_S:g} s")
        return self.urgency is not Stop.NO

    def check(self) -> None:
        """Let a step go on that nobody has stopped.

        Raises:
            StepStopped: somebody has.
        """
        if self.asked():
            raise StepStopped(self.why)

    @contextmanager
    def stops(self, run: AxisRun) -> Iterator[None]:
        """Hand requests to a run as they come, also while it is closed: it may hold the load then until it is asked.

        Raises:
            StepStopped: one has come, before it begins or while it ran; its axis is at rest then.
        """
        self.check()
        self._run = run
        # One that came between the two lines above.
        run.stop = self.urgency
        yield
        self.check()


class Seen(NamedTuple):
    """The axis as a step sees it: angle and speed as people read them, None where they are not known.

    Attributes:
        drive: what the drive shows; None while a program has the axis.
    """

    angle_deg: float | None
    speed_deg_s: float | None
    drive: DriveFeedback | None


class StepWatch:
    """Watch over one step.

    Args:
        halt: how a person ends it.

    Attributes:
        meter: its progress, told of the time of the axis.
        pictures: what the report draws.
        seen: the axis now; None before the step has opened it.
    """

    def __init__(self, meter: Meter, halt: Halt) -> None:
        self.meter, self.halt, self.pictures = meter, halt, list[Picture]()
        self.seen: Seen | None = None

    def observer(self) -> Callable[[Snapshot], None]:
        """An observer of a run of the axis."""
        progress = self.meter.observer()

        def observe(seen: Snapshot) -> None:
            progress(seen)
            self.seen = Seen(seen.angle_deg, seen.speed_deg_s, None)
            self.halt.asked()

        return observe

    def draw(self, part: str, samples: Sequence[MotionSample]) -> None:
        """Keep a picture of a motion."""
        picture = motion_picture(part, samples)
        if picture is not None:
            self.pictures.append(picture)
