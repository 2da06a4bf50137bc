"""Where the figures of a report come from."""

from __future__ import annotations

from enum import StrEnum


class Origin(StrEnum):
    """Origin of a figure: nobody shall take one of a model for one of the machine."""

    MEASURED = "measured"
    SIMULATED = "simulated"
    COMPUTED = "computed"
