"""Machine file: a typed, immutable description of one gantry, strictly checked.

`load_machine` reads a file, `with_values` varies a machine, `derived` computes what follows from it.
Only `plant` is the simulated world; nothing that controls may read it.
"""

from __future__ import annotations

from gantryctl.machine.calibration import (
    NUMBERS,
    Calibration,
    Identified,
    Maps,
    Number,
    Unknown,
    calibration_toml,
    load_calibration,
)
from gantryctl.machine.effective import (
    check_belongs,
    config_hash,
    diff_machines,
    effective_values,
    identity_hash,
    origins,
    short_hash,
)
from gantryctl.machine.loading import (
    configs_folder,
    default_machine,
    default_machine_path,
    load_machine,
    load_table,
    load_uncalibrated,
    parse_machine,
    with_values,
)
from gantryctl.machine.problems import ADVICE, RULES, show_value, warnings_of
from gantryctl.machine.reference import is_reference_machine
from gantryctl.machine.requirement import (
    Requirement,
    required_angle,
    required_speed_error,
    required_stopping_angle,
)
from gantryctl.machine.specs import FieldSpec, field_specs
from gantryctl.machine.tables.model import Machine

__all__ = [
    "ADVICE",
    "NUMBERS",
    "RULES",
    "Calibration",
    "FieldSpec",
    "Identified",
    "Machine",
    "Maps",
    "Number",
    "Requirement",
    "Unknown",
    "calibration_toml",
    "check_belongs",
    "config_hash",
    "configs_folder",
    "default_machine",
    "default_machine_path",
    "diff_machines",
    "effective_values",
    "field_specs",
    "identity_hash",
    "is_reference_machine",
    "load_calibration",
    "load_machine",
    "load_table",
    "load_uncalibrated",
    "origins",
    "parse_machine",
    "required_angle",
    "required_speed_error",
    "required_stopping_angle",
    "short_hash",
    "show_value",
    "warnings_of",
    "with_values",
]
