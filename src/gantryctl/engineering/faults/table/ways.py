"""Measured ways of the catalogue: `python -m gantryctl.engineering.faults.table.ways FILE` runs every row.

`ways FILE A2 A2b` runs these only and leaves the others in the file as they were.
"""

from __future__ import annotations

import json
import math
import sys
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import Any, Final, NamedTuple

from gantryctl.engineering.faults.bench import BrakeOwner
from gantryctl.engineering.faults.case import FaultCase
from gantryctl.engineering.faults.catalogue import CATALOGUE
from gantryctl.engineering.faults.run import DriveKind, FaultRun, run_fault
from gantryctl.errors import GantryctlError

SPEEDS_DEG_S: Final = (6.0, 3.0, 1.0)
ANGLE_DEG: Final = 90.0


class Setup(NamedTuple):
    """What the axis is made of in one run."""

    kind: DriveKind
    scan_ms: float
    brake_owner: BrakeOwner


_IN_PROCESS: Final = (Setup("sim", 1.0, "drive"), Setup("sim", 10.0, "drive"))
_ON_BUS: Final = (Setup("bus", 4.0, "object_60FE"),)
_WITH_NODES: Final = (Setup("bus", 4.0, "controller_output"),)
_CONDITIONS: Final = (
    "Conditions: the reference machine with its eccentric moment of 16 kN m at 90 deg; the simulated drive with scans "
    "of 1 and 10 ms, and the virtual drive behind its bus with scans of 4 ms and its brake worked by the controller "
    "(60FE), at 6 deg/s, and at every speed for what only a bus has; nodes beside the drive have the brake on the I/O "
    "node. The worst of these counts. Measured by "
    "`python -m gantryctl.engineering.faults.table.ways docs/evidence/fault_ways.json`; every other scan period, "
    "speed and owner of the brake is run by the slow tests, which hold the same limits."
)


def setups(case: FaultCase, speed_deg_s: float) -> tuple[Setup, ...]:
    """Setups in which a case is run at a speed."""
    if case.beside:
        return _WITH_NODES
    if "sim" not in case.buses:
        return _ON_BUS
    with_bus = "bus" in case.buses and (speed_deg_s == SPEEDS_DEG_S[0] or not case.phase.moves)
    return (*_IN_PROCESS, *_ON_BUS) if with_bus else _IN_PROCESS


def measure(cases: Iterable[FaultCase] = CATALOGUE) -> dict[str, Any]:
    """Worst way of each case, by speed, with what was against it."""
    found = {case.number: _case(case) for case in cases}
    return {"conditions": _CONDITIONS, "cases": found}


def _case(case: FaultCase) -> dict[str, Any]:
    speeds = SPEEDS_DEG_S if case.phase.moves else SPEEDS_DEG_S[-1:]
    return {f"{speed:g}" if case.phase.moves else "still": _worst(case, speed) for speed in speeds}


def _worst(case: FaultCase, speed_deg_s: float) -> dict[str, Any]:
    """The longest way of all setups at one speed."""
    runs = list(_runs(case, speed_deg_s))
    worst = max(runs, key=lambda run: run["way_deg"])
    return {**worst, "against": sorted({each for run in runs for each in run["against"]})}


def _runs(case: FaultCase, speed_deg_s: float) -> Iterator[dict[str, Any]]:
    for setup in setups(case, speed_deg_s):
        try:
            result = run_fault(
                FaultRun(
                    case,
                    kind=setup.kind,
                    brake_owner=setup.brake_owner,
                    speed_deg_s=speed_deg_s,
                    angle_deg=ANGLE_DEG,
                    scan_ms=setup.scan_ms,
                )
            )
        except GantryctlError as refused:
            yield {"way_deg": -1.0, "limit_deg": None, "setup": list(setup), "against": [str(refused)]}
            continue
        yield {
            "way_deg": round(result.way_deg, 3),
            "limit_deg": round(result.limit_deg, 3) if math.isfinite(result.limit_deg) else None,
            "first_out": result.first_out,
            "setup": list(setup),
            "against": [
                f"{setup.kind} {setup.scan_ms:g} ms {setup.brake_owner}: {each}" for each in result.faults
            ],
        }


if __name__ == "__main__":
    file, wanted = Path(sys.argv[1]), sys.argv[2:]
    fresh = measure(case for case in CATALOGUE if not wanted or case.number in wanted)
    if wanted:
        fresh["cases"] = json.loads(file.read_text(encoding="utf-8"))["cases"] | fresh["cases"]
    file.write_text(json.dumps(fresh, indent=1, allow_nan=False) + "\n", encoding="utf-8")
