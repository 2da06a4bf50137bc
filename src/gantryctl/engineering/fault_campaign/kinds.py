"""The kinds of campaigns: which runs there are, by number."""

from __future__ import annotations

import hashlib
import json
from dataclasses import dataclass
from typing import Final, Literal

from gantryctl.engineering.fault_campaign.axis_pairs import axis_pair_scenario
from gantryctl.engineering.fault_campaign.draw import (
    DURATION_S,
    axis_scenario,
    pair_scenario,
    random_scenario,
    wide_scenario,
)
from gantryctl.engineering.fault_campaign.matrix import CELLS, SCANS_MS
from gantryctl.engineering.fault_campaign.scenario import Scenario
from gantryctl.engineering.faults.injection import finite
from gantryctl.engineering.faults.run import DriveKind
from gantryctl.errors import UsageError

Kind = Literal["random", "pairs", "wide", "axes", "axis-pairs", "matrix"]
KINDS: Final[tuple[Kind, ...]] = ("random", "pairs", "wide", "axes", "axis-pairs", "matrix")
# Of the way scenarios of a kind are drawn: another number gives other scenarios, and no result goes on with them.
_DRAWING: Final[dict[Kind, int]] = {
    "random": 1, "pairs": 2, "wide": 2, "axes": 1, "axis-pairs": 1, "matrix": 2,
}  # fmt: skip
_DRAWS: Final = {
    "random": random_scenario,
    "pairs": pair_scenario,
    "wide": wide_scenario,
}
# One drive for all runs, since other axes are drawn with or without a bus.
_ON_OTHER_AXES: Final = {"axes": axis_scenario, "axis-pairs": axis_pair_scenario}


@dataclass(frozen=True)
class FaultCampaign:
    """Which runs there are; the number of a run is its seed.

    Attributes:
        series: other scenarios of the same kind. scan_ms: of all runs; None: drawn, or of the cell. drive: of all runs;
            None: both, but the simulated one of other axes. Cells of the matrix with another scan period, and runs on
            the other drive, are left out.
    """

    kind: Kind
    series: int = 1
    scan_ms: float | None = None
    drive: DriveKind | None = None

    @property
    def name(self) -> str:
        """For people."""
        scan = "" if self.scan_ms is None else f", scan {self.scan_ms:g} ms"
        drive = "" if self.drive is None else f", {self.drive} alone"
        return f"{self.kind}, series {self.series}{scan}{drive}"

    @property
    def hash(self) -> str:
        """Of what decides a scenario; the code that plays it stands beside each row."""
        return self._hash(self.drawing)

    @property
    def drawing(self) -> int:
        """Number of the way in which this version draws the scenarios of the kind."""
        return _DRAWING[self.kind]

    def earlier_drawing(self, campaign_hash: str) -> int | None:
        """Number of the drawing that an earlier version made this campaign with, by its hash; None: of another one."""
        return next(
            (number for number in range(1, self.drawing) if self._hash(number) == campaign_hash), None
        )

    def _hash(self, drawing: int) -> str:
        given: list[object] = [drawing, self.kind, self.series, self.scan_ms, DURATION_S]
        if self.drive is not None:
            given.append(self.drive)
        return hashlib.sha256(json.dumps(given).encode()).hexdigest()

    def check_seeds(self, first: int, count: int) -> None:
        """Refuse numbers that no run has.

        Raises:
            UsageError: they go beyond the last cell of the matrix; every other kind has a run of each number.
        """
        if self.kind == "matrix" and first + count > CELLS:
            raise UsageError(
                f"the matrix has cells 0 to {CELLS - 1}; runs {first} to {first + count - 1} go beyond: give "
                "--first and --count within it"
            )

    def left_out(self, drive: DriveKind, scan_ms: float) -> str:
        """Why a run is not wanted; "" if it is."""
        if self.drive not in (None, drive):
            return f"left out: {self.drive} alone is played"
        if self.scan_ms not in (None, scan_ms):
            return f"left out: {self.scan_ms:g} ms alone is played"
        return ""

    def scenario(self, seed: int) -> Scenario:
        """The scenario of a seed; not for the matrix, whose cells are runs of a row."""
        if self.kind in _ON_OTHER_AXES:
            return _ON_OTHER_AXES[self.kind](self.series, seed, self.scan_ms, self.drive or "sim")
        return _DRAWS[self.kind](self.series, seed, self.scan_ms)


def campaign_of(
    kind: str, series: int = 1, scan_ms: float | None = None, drive: DriveKind | None = None
) -> FaultCampaign:
    """A campaign from words of a person.

    Raises:
        UsageError: no such kind, a scan period that no machine has, or one that no cell of the matrix has.
    """
    for known in KINDS:
        if known == kind:
            scan = None if scan_ms is None else finite(scan_ms, "scan period in ms", 0.5, 20.0)
            if kind == "matrix" and scan not in (None, *SCANS_MS):
                raise UsageError(
                    f"scan period of the matrix must be one of {', '.join(f'{each:g}' for each in SCANS_MS)} ms, "
                    f"got {scan:g}"
                )
            return FaultCampaign(known, series, scan, drive)
    raise UsageError(f"kind of a campaign must be one of {', '.join(KINDS)}, got '{kind}'")
