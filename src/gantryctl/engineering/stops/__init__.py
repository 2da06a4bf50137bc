"""Stops on the full plant: angle, time, torque, reducer, base, brake of every stop class.

`stop_table` measures, `check_quick_stop` holds the machine file to it, `find_quick_dec` finds the largest quick-stop
deceleration that the machine of the file can give, `certify` the one that every plant of [plant.uncertainty] can give.
"""

from gantryctl.engineering.stops.certify import Certificate, certify
from gantryctl.engineering.stops.limits import check_quick_stop, find_quick_dec
from gantryctl.engineering.stops.run import StopClass, run_stop, stop_table, worst_stop

__all__ = [
    "Certificate",
    "StopClass",
    "certify",
    "check_quick_stop",
    "find_quick_dec",
    "run_stop",
    "stop_table",
    "worst_stop",
]
