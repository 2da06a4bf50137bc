"""Identification of one machine: slow turns, fast moves, a creep, and the numbers fitted to them.

The controller's compensations live on these numbers and on nothing else. The runs use the public position loop
with all compensations off; the truth of a simulated plant is read only to say how wrong the numbers are.
"""

from gantryctl.engineering.identification.fit import CalibrationFit, calibrate, calibration_of, fit
from gantryctl.engineering.identification.measure import LoadInstrument, record
from gantryctl.engineering.identification.truth import Comparison, comparisons

__all__ = [
    "CalibrationFit",
    "Comparison",
    "LoadInstrument",
    "calibrate",
    "calibration_of",
    "comparisons",
    "fit",
    "record",
]
