"""What commissioning has measured of the stops of a machine, beside what the simulator says of them."""

from __future__ import annotations

from pathlib import Path
from typing import NamedTuple

from gantryctl.machine import Machine
from gantryctl.operation.ledger.acceptance import proven_hash
from gantryctl.operation.ledger.rows import RAMP_DEG_S2, SILENT_STOP_S
from gantryctl.operation.proofs import load_record, record_path


class MeasuredStops(NamedTuple):
    """Stops of the drive as commissioned; None where commissioning has not measured it.

    Attributes:
        date, by: of the commissioning.
        quick_stop_dec_deg_s2: deceleration of the drive's own ramp. silent_stop_s: until the drive acts in silence.
    """

    date: str
    by: str
    quick_stop_dec_deg_s2: float | None
    silent_stop_s: float | None


def measured_stops(machine: Machine, directory: Path) -> MeasuredStops | None:
    """The measured stops of a machine in its present configuration; None without them.

    Args:
        directory: of its retained state.

    Raises:
        StateError: the commissioning record is damaged.
    """
    record = load_record(record_path(directory, machine))
    if record is None or record.proven_hash != proven_hash(machine):
        return None
    return MeasuredStops(
        record.date, record.by, record.measured.get(RAMP_DEG_S2), record.measured.get(SILENT_STOP_S)
    )
