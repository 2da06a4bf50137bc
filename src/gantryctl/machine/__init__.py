"""The machine file: a typed, immutable description of one gantry, strictly checked."""

from __future__ import annotations

from gantryctl.machine.loading import default_machine, default_machine_path, load_machine, parse_machine
from gantryctl.machine.model import Machine

__all__ = ["Machine", "default_machine", "default_machine_path", "load_machine", "parse_machine"]
