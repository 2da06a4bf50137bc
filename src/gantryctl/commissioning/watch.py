"""What a person sees of a step while it runs, and what it leaves to be drawn."""

from __future__ import annotations

from collections.abc import Sequence

from gantryctl.commissioning.pictures import MotionSample, motion_picture
from gantryctl.engineering.report.meter import Meter
from gantryctl.engineering.report.pictures import Picture


class StepWatch:
    """Watch over one step.

    Attributes:
        meter: its progress, told of the time of the axis.
        pictures: what the report draws.
    """

    def __init__(self, meter: Meter) -> None:
        self.meter, self.pictures = meter, list[Picture]()

    def draw(self, part: str, samples: Sequence[MotionSample]) -> None:
        """Keep a picture of a motion."""
        picture = motion_picture(part, samples)
        if picture is not None:
            self.pictures.append(picture)
