"""The reference machine as an axis that turns without end, with an encoder that wraps often."""

from __future__ import annotations

import re
from pathlib import Path

from gantryctl.machine import Machine, configs_folder, load_calibration, with_values
from gantryctl.machine.loading import parse_machine

# 64 motor turns are 20.1 deg of the axis: a wrap every 3.4 s at 6 deg/s. The wrap margin is 5 deg, so 32 are enough.
ENCODER_TURNS = 64


def modulo_machine(changes: dict[str, object] | None = None, name: str = "hust_gantry") -> Machine:
    """A delivered machine without ends of travel; that of the reference wraps often, and has short ramps.

    A machine with a calibration keeps its encoder and gear: the calibration is theirs.
    """
    text = (configs_folder() / f"{name}.toml").read_text(encoding="utf-8")
    text = text.replace('kind = "linear"\n', "").replace("[axis]\n", '[axis]\nkind = "modulo"\n')
    text = re.sub(r'name = ".*"', 'name = "endless"', text, count=1)
    text = re.sub(r"(over_travel|limit_switch|mechanical_stop)_(min|max)_deg = .*\n", "", text)
    quick: dict[str, object] = {
        "encoder.turns": ENCODER_TURNS,
        "plant.encoder.mounting_turns": ENCODER_TURNS // 2,
        "virtual_axis.acc_deg_s2": 3.0,
        "virtual_axis.dec_deg_s2": 1.9,
    }
    calibration: Path = configs_folder() / f"{name}.calibration.toml"
    if calibration.exists():
        machine = with_values(parse_machine(text), changes or {})
        return machine.calibrated(load_calibration(calibration))
    return with_values(parse_machine(text), quick | (changes or {}))
