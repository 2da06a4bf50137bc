"""One machine in operation: its state between runs, and one run of its axis."""

from gantryctl.operation.state import (
    encoder_report,
    machine_status,
    read_retained,
    reset_machine,
    reset_simulation,
    retained_rows,
    set_encoder_zero,
)

__all__ = [
    "encoder_report",
    "machine_status",
    "read_retained",
    "reset_machine",
    "reset_simulation",
    "retained_rows",
    "set_encoder_zero",
]
