"""The table of stops as plain data for JSON."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

from gantryctl.engineering.report.data import plain
from gantryctl.engineering.report.origin import Origin
from gantryctl.engineering.stops.certify import Certificate, QuickStops
from gantryctl.engineering.stops.held_key import key_rows
from gantryctl.engineering.stops.measured import MeasuredStops
from gantryctl.engineering.stops.run import StopResult, StopRow
from gantryctl.engineering.stops.silence import watch_rows
from gantryctl.engineering.stops.uncertain import bands
from gantryctl.machine import Machine, required_stopping_angle


def quick_stops_data(machine: Machine, found: QuickStops) -> dict[str, Any]:
    """Everything `stops --find-quick --json` prints."""
    return {
        "machine": machine.name,
        "quick_dec_deg_s2": found.nominal_deg_s2,
        "configured_deg_s2": machine.virtual_axis.quick_dec_deg_s2,
        "identified_inertia_max_kg_m2": machine.plant.load.inertia_kg_m2 * (1.0 + found.identified_ratio),
        "bands": bands(machine),
        "certified": _certificate(found.certificate),
        "inertia_alone": None if found.inertia_alone is None else _certificate(found.inertia_alone),
    }


def _certificate(found: Certificate) -> dict[str, Any]:
    return {
        "dec_deg_s2": found.dec_deg_s2,
        "speed_max_deg_s": found.speed_deg_s,
        "worst": _stop(found.worst),
        "hardest_for_motor": found.hardest_motor._asdict(),
        "hardest_for_reducer": found.hardest_reducer._asdict(),
        "plants": found.plants,
        "stops": found.stops,
    }


def _stop(stop: StopResult) -> dict[str, Any]:
    """A stop; a load that never becomes calm has no time."""
    data = {name: plain(value) for name, value in stop._asdict().items()}
    return {**data, "settled_s": stop.settled_s if math.isfinite(stop.settled_s) else None}


def stops_data(machine: Machine, rows: Sequence[StopRow], measured: MeasuredStops | None) -> dict[str, Any]:
    """Everything `stops --json` prints."""
    return {
        "machine": machine.name,
        "origin": Origin.SIMULATED.value,
        "measured": None if measured is None else measured._asdict(),
        "required": plain(required_stopping_angle(machine)),
        "rows": [
            {
                **_stop(row.stop),
                "angle_with_reaction_deg": row.angle_with_reaction_deg,
                "inspect": row.inspect,
            }
            for row in rows
        ],
        "held_key": [row._asdict() for row in key_rows(machine, rows)],
        "silent_controller": [row._asdict() for row in watch_rows(machine, rows)],
    }
