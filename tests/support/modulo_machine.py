"""The reference machine as an axis that turns without end, with an encoder that wraps often."""

from __future__ import annotations

import re

from gantryctl.machine import Machine, configs_folder, with_values
from gantryctl.machine.loading import parse_machine

# 64 motor turns are 20.1 deg of the axis: a wrap every 3.4 s at 6 deg/s. The wrap margin is 5 deg, so 32 are enough.
ENCODER_TURNS = 64


def modulo_machine(changes: dict[str, object] | None = None) -> Machine:
    """The reference machine without ends of travel; its ramps are shorter, so that a test takes less axis time."""
    text = (configs_folder() / "hust_gantry.toml").read_text(encoding="utf-8")
    text = text.replace('kind = "linear"', 'kind = "modulo"').replace("hust_gantry", "endless")
    text = re.sub(r"(over_travel|limit_switch|mechanical_stop)_(min|max)_deg = .*\n", "", text)
    quick = {
        "encoder.turns": ENCODER_TURNS,
        "plant.encoder.mounting_turns": ENCODER_TURNS // 2,
        "virtual_axis.acc_deg_s2": 3.0,
        "virtual_axis.dec_deg_s2": 1.9,
    }
    return with_values(parse_machine(text), quick | (changes or {}))
