"""Simulated instruments: tracker, encoder on the ring, motor side."""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum

import numpy as np

from gantryctl.engineering.accuracy.noise import Distribution, chord_result
from gantryctl.engineering.accuracy.procedure.on_batch import Readings
from gantryctl.engineering.accuracy.procedure.procedures import Procedure, evaluate
from gantryctl.engineering.accuracy.table import ErrorTable
from gantryctl.engineering.instruments import LoadEncoder, MotorSide
from gantryctl.machine import Machine
from gantryctl.units import rad


class InstrumentKind(Enum):
    """Measuring instruments."""

    TRACKER = "tracker"
    LOAD_ENCODER = "load-encoder"
    MOTOR_SIDE = "motor-side"


@dataclass(frozen=True)
class MeasuredRun:
    """Error table of a run through one instrument.

    Attributes:
        sigma_m: its noise per coordinate, None for an angle encoder.
        a_measured, a_floor: A over many draws of its noise, and of the noise alone; None where there is one draw.
    """

    source: str
    measures_load: bool
    table: ErrorTable
    sigma_m: float | None = None
    a_measured: Distribution | None = None
    a_floor: Distribution | None = None


def measure(
    machine: Machine, kind: InstrumentKind, procedure: Procedure, readings: Readings, seed: int
) -> MeasuredRun:
    """Measure the first plant of `readings`, with noise drawn from `seed`."""
    radius_m = machine.accuracy.chord_radius_m
    if kind is InstrumentKind.TRACKER:
        sigma_m = machine.accuracy.tracker_noise_um * 1e-6
        chord = chord_result(procedure, readings.load_rad[0], radius_m, sigma_m, seed)
        source = "simulated tracker"
        return MeasuredRun(source, True, chord.measured, sigma_m, chord.a_measured, chord.a_floor)
    instrument = _encoder(machine, kind, procedure, seed)
    dwells = zip(readings.load_rad[0], readings.ring_rad[0], readings.motor_rad[0], strict=True)
    angles = [instrument.reading_rad([float(a) for a in dwell]) for dwell in dwells]
    source = f"{instrument.name} of the simulated axis"
    return MeasuredRun(source, instrument.measures_load, evaluate(procedure, angles, radius_m))


def _encoder(
    machine: Machine, kind: InstrumentKind, procedure: Procedure, seed: int
) -> LoadEncoder | MotorSide:
    # Gear error, wind-up and lost motion lie behind this encoder: it shows how the loop works, not where the
    # gantry is.
    if kind is InstrumentKind.MOTOR_SIDE:
        return MotorSide()
    ring = machine.plant.load_encoder
    # Its scale error is zero where the run starts.
    rng = np.random.default_rng(seed)
    return LoadEncoder(ring.bits, ring.noise_rad, ring.scale_error_rad, rng, rad(procedure.start_deg))
