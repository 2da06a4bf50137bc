"""The drive's own encoder, read as if it measured the gantry."""

from __future__ import annotations

from collections.abc import Sequence


class MotorSide:
    """The motor angle divided by the gear ratio: blind to gear error, wind-up and lost motion.

    Its readings are labelled "motor side" and get no accuracy verdict.
    """

    name = "motor side"
    measures_load = False

    def reading_rad(self, samples_rad: Sequence[float]) -> float:
        """The motor's mean angle at the gantry, rad; it is the last of the dwell's angles."""
        return samples_rad[-1]
