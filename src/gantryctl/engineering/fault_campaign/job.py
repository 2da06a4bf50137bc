"""Runs of a fault campaign, as a job of the scheduler."""

from __future__ import annotations

import json
import math
from dataclasses import dataclass
from typing import Any, ClassVar, Final

import numpy as np

from gantryctl.engineering.campaign.job import INDEX, REFUSED
from gantryctl.engineering.fault_campaign.kinds import FaultCampaign
from gantryctl.engineering.fault_campaign.matrix import UNSOUND, cell, run_cell
from gantryctl.engineering.fault_campaign.play import play
from gantryctl.engineering.fault_campaign.scenario import Scenario
from gantryctl.engineering.scheduler.identity import identity
from gantryctl.engineering.scheduler.job import Rows

Row = dict[str, Any]
COLUMNS: Final[dict[str, type]] = {
    REFUSED: str,
    "trace_sha256": str,
    "drive": str,
    "scan_ms": float,
    "faults": str,
    "stops": str,
    "nuisances": int,
    "violations": str,
    "way_of": str,
    "way_deg": float,
    "limit_deg": float,
    "axis_s": float,
    "sources": str,
}
"""Columns of a row: why it was refused ("" if it ran); the hash of its trace; drive and scan; its faults, "A2+C12"; the
alarms that stopped it; how many nobody caused; what broke, as a JSON list of texts, "" for nothing; row, way and limit
of a fault that was alone; time played; hash of the Python files that played it."""


@dataclass(frozen=True)
class FaultJob:
    """Row k is run k of a campaign."""

    campaign: FaultCampaign
    pack: ClassVar[int] = 1

    def rows(self, first: int, count: int) -> Rows:
        """Columns "row" and `COLUMNS`."""
        made = [self._row(number) for number in range(first, first + count)]
        found: Rows = {INDEX: np.arange(first, first + count)}
        for name, kind in COLUMNS.items():
            column = [row[name] for row in made]
            found[name] = np.array(column, dtype=object if kind is str else kind)
        return found

    def _row(self, number: int) -> Row:
        campaign = self.campaign
        if campaign.kind == "matrix":
            at = cell(number)
            left_out = campaign.left_out(at.drive, at.scan_ms)
            return (
                _left_out(at.drive, at.scan_ms, at.case.number, left_out) if left_out else row(**run_cell(at))
            )
        scenario = campaign.scenario(number)
        left_out = campaign.left_out(scenario.drive, scenario.scan_ms)
        if left_out:
            return _left_out(scenario.drive, scenario.scan_ms, scenario.label, left_out)
        return _played(scenario)


def _left_out(drive: str, scan_ms: float, faults: str, why: str) -> Row:
    return row(refused=why, violations=[], drive=drive, scan_ms=scan_ms, faults=faults)


def _played(scenario: Scenario) -> Row:
    played = play(scenario)
    return row(
        # One reason for all of them: values differ from plant to plant, and `replay` tells them.
        refused=UNSOUND if played.unsound else played.refused,
        trace_sha256=played.trace_sha256,
        drive=scenario.drive,
        scan_ms=scenario.scan_ms,
        faults=scenario.label,
        stops=" ".join(played.stops),
        nuisances=played.nuisances,
        violations=[str(each) for each in played.violations],
        way_of=played.fault,
        way_deg=played.way_deg,
        limit_deg=played.limit_deg,
        axis_s=played.axis_s,
    )


def row(*, refused: str, violations: list[str], **others: Any) -> Row:
    """One row; where nothing broke its list is empty text."""
    return {
        REFUSED: refused,
        "violations": json.dumps(violations) if violations else "",
        "sources": identity().sources,
        "nuisances": 0,
        "way_of": "",
        "way_deg": math.nan,
        "limit_deg": math.nan,
        "axis_s": 0.0,
        "stops": "",
        "trace_sha256": "",
        **others,
    }
