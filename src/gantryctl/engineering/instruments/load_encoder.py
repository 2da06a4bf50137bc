"""An encoder on the ring: fine, but with a scale of its own."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from gantryctl.errors import UsageError
from gantryctl.machine.tables.plant import SCALE_TERMS

MAX_BITS = 32


class LoadEncoder:
    """Reads the ring against its base: steps, noise and a fixed scale error; its zero is where it was zeroed.

    Args:
        bits: 2^bits steps per turn.
        noise_rad: rms noise of one reading.
        scale_error_rad: amplitude of the first term of the scale error (`SCALE_TERMS`).
        rng: source of the noise.
        zero_rad: angle at which the scale error was zeroed.
    """

    name = "load encoder"
    measures_load = True

    def __init__(
        self,
        bits: int,
        noise_rad: float,
        scale_error_rad: float,
        rng: np.random.Generator,
        zero_rad: float = 0.0,
    ) -> None:
        if not 1 <= bits <= MAX_BITS:
            raise UsageError(f"load encoder: bits = {bits}: 1 to {MAX_BITS}")
        if not (math.isfinite(noise_rad) and noise_rad >= 0.0 and math.isfinite(scale_error_rad)):
            raise UsageError("load encoder: noise must be 0 or above, the scale error finite, rad")
        # All of the load encoder is an estimate: docs/explanation/plant.md, Load-side encoder.
        self.step_rad = 2.0 * math.pi / 2.0**bits
        self.noise_rad = noise_rad
        self.scale_error_rad = scale_error_rad
        self._rng = rng
        self._zero_error_rad = self._scale(zero_rad)

    def _scale(self, angle_rad: float) -> float:
        """Error of the scale at this angle, rad."""
        terms = (gain * math.sin(waves * angle_rad + phase) for waves, gain, phase in SCALE_TERMS)
        return self.scale_error_rad * sum(terms)

    def reading_rad(self, samples_rad: Sequence[float]) -> float:
        """One reading of a dwell, rad: the ring's mean angle where it is given, else the load's (base at
        rest).
        """
        angle = samples_rad[1] if len(samples_rad) > 1 else samples_rad[0]
        noise = float(self._rng.normal(0.0, self.noise_rad)) if self.noise_rad > 0.0 else 0.0
        seen = angle + self._scale(angle) - self._zero_error_rad + noise
        # Rounded last: noise and scale error lie before the counting.
        return self.step_rad * round(seen / self.step_rad)
