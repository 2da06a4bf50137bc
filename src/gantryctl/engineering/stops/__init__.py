"""What every stop class costs on the full plant: angle, time, torque, reducer, base, brake.

`stop_table` measures, `check_quick_stop` holds the machine file to it, `find_quick_dec` finds the largest quick-stop
deceleration that the machine can give.
"""

from gantryctl.engineering.stops.limits import check_quick_stop, find_quick_dec
from gantryctl.engineering.stops.run import StopClass, StopResult, run_stop, worst_stop
from gantryctl.engineering.stops.table import REACTION_S, StopRow, stop_table

__all__ = [
    "REACTION_S",
    "StopClass",
    "StopResult",
    "StopRow",
    "check_quick_stop",
    "find_quick_dec",
    "run_stop",
    "stop_table",
    "worst_stop",
]
