"""Head of reports in tests, and a campaign that is done in a second."""

from gantryctl.engineering.report.head import Head, Made, MeasuredBy

MADE = Made("2026-11-22 10:00 UTC", "0.1", "gantryctl accuracy run", "A. Operator", "W. Witness")
HEAD = Head("m", (("Machine", "m"),), MADE, MeasuredBy("tracker AT-1", "DKD 7"), "contract 4711")

CAMPAIGN = """\
[campaign]
name = "small"
description = "short moves"
tests = ["move"]
outputs = ["move_load_error_deg_s", "move_base_um"]
sampling = "sensitivity"
count = 8

[move]
from_deg = 0.0
to_deg = 0.2

[vary.inertia]
law = "uniform"
keys = ["plant.load.inertia_kg_m2"]
relative = true
low = 0.8
high = 1.2

[vary.gear]
law = "phases"

[limits]
move_load_error_deg_s = [0.4, 0.002]
"""
