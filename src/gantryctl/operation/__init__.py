"""One machine in operation: its state between runs, and one run of its axis."""

from gantryctl.operation.brake_policy import locked_code
from gantryctl.operation.bus import bus_lines
from gantryctl.operation.motions import Motion, Snapshot, Stop
from gantryctl.operation.notices import all_codes, explain
from gantryctl.operation.programs import load_program
from gantryctl.operation.session import AxisSession
from gantryctl.operation.state import (
    encoder_report,
    machine_status,
    read_retained,
    reset_machine,
    reset_simulation,
    retained_rows,
    set_encoder_zero,
)
from gantryctl.operation.store import StateStore, last_recording
from gantryctl.operation.summary import MotionSummary, summarise, way_note
from gantryctl.wiring.engine import ProgramFactory

__all__ = [
    "AxisSession",
    "Motion",
    "MotionSummary",
    "ProgramFactory",
    "Snapshot",
    "StateStore",
    "Stop",
    "all_codes",
    "bus_lines",
    "encoder_report",
    "explain",
    "last_recording",
    "load_program",
    "locked_code",
    "machine_status",
    "read_retained",
    "reset_machine",
    "reset_simulation",
    "retained_rows",
    "set_encoder_zero",
    "summarise",
    "way_note",
]
