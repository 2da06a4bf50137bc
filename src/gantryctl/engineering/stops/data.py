"""The table of stops as plain data for JSON."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from gantryctl.engineering.report.data import plain
from gantryctl.engineering.report.origin import Origin
from gantryctl.engineering.stops.held_key import key_rows
from gantryctl.engineering.stops.measured import MeasuredStops
from gantryctl.engineering.stops.run import StopRow
from gantryctl.engineering.stops.silence import watch_rows
from gantryctl.machine import Machine, required_stopping_angle


def stops_data(machine: Machine, rows: Sequence[StopRow], measured: MeasuredStops | None) -> dict[str, Any]:
    """Everything `stops --json` prints."""
    return {
        "machine": machine.name,
        "origin": Origin.SIMULATED.value,
        "measured": None if measured is None else measured._asdict(),
        "required": plain(required_stopping_angle(machine)),
        "rows": [
            {
                **{name: plain(value) for name, value in row.stop._asdict().items()},
                "angle_with_reaction_deg": row.angle_with_reaction_deg,
                "inspect": row.inspect,
            }
            for row in rows
        ],
        "held_key": [row._asdict() for row in key_rows(machine, rows)],
        "silent_controller": [row._asdict() for row in watch_rows(machine, rows)],
    }
