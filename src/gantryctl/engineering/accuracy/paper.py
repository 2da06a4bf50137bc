"""Figures printed in the source paper, its table 2 above all: constants for comparison."""

from __future__ import annotations

from typing import Final

from gantryctl.engineering.accuracy.table import ErrorTable, table_from_rows

# The paper gives neither the radius of the chords nor the instrument.
PAPER_NAME: Final = "Sun, Gong, Cai, DOI 10.19457/j.1001-2095.dqcd24023, table 2"

# The six rows as printed, deg.
PAPER_TABLE: Final[ErrorTable] = table_from_rows(
    [
        (90.0, "ccw", (0.0, -0.0002, 0.0005, 0.0020, 0.0012)),
        (90.0, "cw", (0.0, -0.0010, -0.0012, 0.0005, 0.0030)),
        (0.0, "ccw", (0.0, 0.0002, 0.0000, -0.0006, -0.0016)),
        (0.0, "cw", (0.0, 0.0005, -0.0016, 0.0001, -0.0002)),
        (-90.0, "ccw", (0.0, -0.0002, 0.0027, 0.0020, -0.0005)),
        (-90.0, "cw", (0.0, 0.0009, 0.0020, 0.0042, 0.0001)),
    ],
    (0.0, 5.0, 10.0, 15.0, 20.0),
)

# As printed. 3 S at 5 deg and X - 3 S at 20 deg differ in the last digit from what the printed rows give:
# both within the rounding of the rows.
PAPER_MEAN_DEG: Final = (0.0, 0.0000, 0.0004, 0.0014, 0.0003)
PAPER_THREE_S_DEG: Final = (0.0, 0.0019, 0.0051, 0.0052, 0.0048)
PAPER_UPPER_DEG: Final = 0.0066
PAPER_LOWER_DEG: Final = -0.0047
# Eq. (6) as printed. A figure to compare with, never a criterion: the simulator's gear phases are fitted to this
# table.
PAPER_A_DEG: Final = 0.0113
