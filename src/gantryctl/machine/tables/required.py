"""Table [required], of the machine file and of the requirement sheet: what the axis must do, and who asks for it."""

from __future__ import annotations

from gantryctl.machine.tables.fields import Table, number, text


class RequiredTable(Table):
    """[required]: what every verdict holds the axis against, and where the requirement comes from."""

    # The paper's table 1.
    angle_deg: float = number(0.1, 1e-5, 5.0, "Required accuracy of the angle.", "paper")
    # The paper's figure 5: 0.01 deg/s at every speed up to 6 deg/s.
    speed_error_ratio: float = number(
        0.01 / 6.0,
        1e-6,
        0.05,
        "Largest speed error of a move, as part of the highest speed setting.",
        "paper",
    )
    stopping_angle_deg: float = number(
        4.0, 0.01, 90.0, "Permitted quick-stop angle from the highest speed, reaction included."
    )
    source: str = text("", 200, "Where the requirement comes from; stands beside every verdict.")
