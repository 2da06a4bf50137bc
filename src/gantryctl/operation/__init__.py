"""One machine in operation: its state between runs, and one run of its axis."""

from gantryctl.operation.programs import load_program
from gantryctl.operation.session import AxisSession, Motion, Snapshot, Stop
from gantryctl.operation.state import (
    encoder_report,
    machine_status,
    read_retained,
    reset_machine,
    reset_simulation,
    retained_rows,
    set_encoder_zero,
)
from gantryctl.operation.store import StateStore
from gantryctl.operation.summary import MotionSummary, summarise
from gantryctl.wiring import ProgramFactory

__all__ = [
    "AxisSession",
    "Motion",
    "MotionSummary",
    "ProgramFactory",
    "Snapshot",
    "StateStore",
    "Stop",
    "encoder_report",
    "load_program",
    "machine_status",
    "read_retained",
    "reset_machine",
    "reset_simulation",
    "retained_rows",
    "set_encoder_zero",
    "summarise",
]
