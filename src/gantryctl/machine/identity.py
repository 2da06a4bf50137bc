"""Identity of a machine: a hash of the parts that make it another one; a calibration carries it."""

from __future__ import annotations

import hashlib
import json

from gantryctl.errors import ConfigError
from gantryctl.machine.calibration import Calibration
from gantryctl.machine.reading import printable
from gantryctl.machine.tables.model import Machine


def identity_hash(machine: Machine) -> str:
    """Hash of ratios, motor, reducer and encoder; not of gains, limits or [plant]."""
    # Gains, limits and [plant] may change without a new calibration; what was measured hangs on these parts.
    ratios = {"reducer_ratio": machine.axis.reducer_ratio, "ring_ratio": machine.axis.ring_ratio}
    tables = {
        name: getattr(machine, name).model_dump(mode="json") for name in ("motor", "reducer", "encoder")
    }
    text = json.dumps({"axis": ratios, **tables}, sort_keys=True, allow_nan=False)
    return hashlib.sha256(text.encode("ascii")).hexdigest()[:16]


def check_belongs(calibration: Calibration, machine: Machine, encoder_serial: str | None = None) -> None:
    """Refuse a calibration of another machine.

    Args:
        encoder_serial: what the drive says about its encoder; None where there is no drive to ask.

    Raises:
        ConfigError: ratios, motor, reducer or encoder differ, or the encoder has another serial number.
    """
    origin, wanted = calibration.origin, identity_hash(machine)
    if origin.identity != wanted:
        wrong = (
            f"on another machine (identity {origin.identity}, this one is {wanted}: ratios, motor, reducer or encoder "
            "differ)"
        )
    elif encoder_serial is not None and encoder_serial != origin.encoder_serial:
        known, found = printable(origin.encoder_serial), printable(encoder_serial)
        wrong = f"with encoder {known!r}, the drive has {found!r}"
    else:
        return
    what = f"calibration of {printable(origin.machine)}, {origin.date}"
    raise ConfigError([f"{what}: measured {wrong}; run `gantryctl identify` on this machine"])
