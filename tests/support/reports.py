"""Head of reports in tests."""

from gantryctl.engineering.report.head import Head, Made, MeasuredBy

MADE = Made("2026-11-22 10:00 UTC", "0.1", "gantryctl accuracy run", "A. Operator", "W. Witness")
HEAD = Head("m", (("Machine", "m"),), MADE, MeasuredBy("tracker AT-1", "DKD 7"), "contract 4711")
