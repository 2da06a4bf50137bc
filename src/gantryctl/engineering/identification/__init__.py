"""Identification of one machine: slow turns, swings, a creep, an excited speed loop, and the numbers fitted to them.

The controller's compensations live on these numbers and on nothing else. The runs use the public position loop
with all compensations off; the truth of a simulated plant is read only to say how wrong the numbers are.
"""

from gantryctl.engineering.identification.fit import (
    CalibrationFit,
    calibrate,
    calibration_of,
    check_valid,
    fit,
)
from gantryctl.engineering.identification.measure import AxisUnderTest, record
from gantryctl.engineering.identification.on_batch import LoadInstrument, SimulatedAxis, calibrate_each
from gantryctl.engineering.identification.on_engine import EngineAxis
from gantryctl.engineering.identification.truth import Comparison, comparisons

__all__ = [
    "AxisUnderTest",
    "CalibrationFit",
    "Comparison",
    "EngineAxis",
    "LoadInstrument",
    "SimulatedAxis",
    "calibrate",
    "calibrate_each",
    "calibration_of",
    "check_valid",
    "comparisons",
    "fit",
    "record",
]
