"""What a recording is: column names, `Trace`, reading and exporting."""

from gantryctl.trace.columns import TIME_COLUMN, Unit, in_degrees, unit_of, validate_columns
from gantryctl.trace.files import Floats, Metadata
from gantryctl.trace.reader import read_trace
from gantryctl.trace.table import Trace, TraceHash

__all__ = [
    "TIME_COLUMN",
    "Floats",
    "Metadata",
    "Trace",
    "TraceHash",
    "Unit",
    "in_degrees",
    "read_trace",
    "unit_of",
    "validate_columns",
]
