"""Last steps: bands from data, and the accuracy test."""

from __future__ import annotations

from typing import Final

from gantryctl.commissioning.context import Context, failed, judged
from gantryctl.commissioning.results import Outcome, StepResult
from gantryctl.engineering.accuracy.procedure.on_engine import run_on_engine
from gantryctl.engineering.accuracy.procedure.procedures import chord_procedure, evaluate
from gantryctl.engineering.accuracy.statistics import accuracy_a

# Bands are proposed at twice what was measured, and refused below one and a half.
_RESERVE: Final = 2.0
_LEAST: Final = 1.5
# The paper's table 1.
_CRITERION_DEG: Final = 0.1


def bands(c: Context) -> StepResult:
    """Propose bands of twice the measured errors, beside those of the machine file."""
    # Errors at rest come from `loop`, those at speed from `turn`.
    if not {"loop", "turn"} <= set(c.results):
        return failed("bands", "nothing to propose from", "run the steps loop and turn first")
    rest = c.results["loop"].figures["rest_error_deg"]
    turn = c.results["turn"].figures
    monitors = c.machine.monitors
    window = max(_RESERVE * rest, 0.0005)
    following = max(_RESERVE * turn["following_error_deg"], 0.005)
    limit = monitors.following_error_base_deg + monitors.following_error_per_speed_s * turn["speed_deg_s"]
    proof = (
        f"in position: {window:.4f} deg from data, [monitors] in_position_window_deg = "
        f"{monitors.in_position_window_deg:g}; following error at {turn['speed_deg_s']:g} deg/s: {following:.4f} deg "
        f"from data, {limit:.4f} deg in force"
    )
    ok = _LEAST * rest <= monitors.in_position_window_deg and _LEAST * turn["following_error_deg"] <= limit
    to_do = "widen the bands of [monitors], or find out why the axis follows so badly"
    return judged(ok, "bands", proof, to_do, in_position_deg=window, following_error_deg=following)


def accuracy(c: Context) -> StepResult:
    """Run the chord test where the truth is known; a real machine needs the operator's instrument."""
    if not c.machine.plant_is_local:
        proof = "needs an instrument at the load"
        to_do = "gantryctl accuracy report --measured FILE, with the readings of a tracker"
        return StepResult("accuracy", Outcome.NOT_TESTABLE, proof, to_do=to_do)
    procedure = chord_procedure("A")
    readings = run_on_engine(c.machine, procedure)
    table = evaluate(procedure, readings.load_rad[0], c.machine.accuracy.chord_radius_m)
    a = float(accuracy_a(table.errors_deg))
    proof = f"chord test A over the bus: A = {a:.4f} deg (limit {_CRITERION_DEG:g} deg), true load angle"
    return judged(a <= _CRITERION_DEG, "accuracy", proof, "gear, bearings, calibration", a_deg=a)
