"""Each fault of the catalogue in each phase, at each speed, angle and scan period, on each bench: the simulated drive,
the virtual one on its bus, and that with nodes beside it, where the I/O node has the brake.

The cells are numbered with a stride, so that every part of the matrix is a sample of the whole: run k is cell k times
the stride. A cell that makes no sense has a row with its reason; none is missing.
"""

from __future__ import annotations

import hashlib
import math
from dataclasses import replace
from typing import Any, Final, NamedTuple

from gantryctl.engineering.fault_campaign.judging.judge import STOPPING
from gantryctl.engineering.fault_campaign.judging.ways import seen_in_motion
from gantryctl.engineering.faults.bench import BrakeOwner
from gantryctl.engineering.faults.case import FaultCase, Phase
from gantryctl.engineering.faults.catalogue import CATALOGUE
from gantryctl.engineering.faults.oracle.excused import EXCUSED
from gantryctl.engineering.faults.oracle.taps import Oracle, tapped, watching
from gantryctl.engineering.faults.run import DriveKind, FaultResult, FaultRun, run_fault
from gantryctl.errors import ConfigError, UsageError
from gantryctl.program.alarms.codes import Code

BENCHES: Final[tuple[tuple[DriveKind, bool], ...]] = (("sim", False), ("bus", False), ("bus", True))
"""Drive, and whether it has nodes beside it."""
PHASES: Final = tuple(Phase)
SPEEDS_DEG_S: Final = (6.0, 4.5, 3.0, 1.0, 0.6)
ANGLES_DEG: Final = tuple(-165.0 + 30.0 * number for number in range(12))
SCANS_MS: Final = (1.0, 4.0, 10.0)
CELLS: Final = (
    len(CATALOGUE) * len(BENCHES) * len(PHASES) * len(SPEEDS_DEG_S) * len(ANGLES_DEG) * len(SCANS_MS)
)
UNSOUND: Final = "the checks of the machine refuse it"
"""Reason of a run that is refused."""
# A prime far from every divisor of the number of cells: each cell comes once.
_STRIDE: Final = 100_003
_OF_THEIR_ROWS: Final = (Phase.HOLD, Phase.BRAKE_TEST)
# 0.64 of the rated torque at the place where the load is put on, by its lever there: at 15 deg from the balance that is
# 750 kN m. A moving axis would take it to where neither motor nor brake holds it.
_AT_STANDSTILL: Final = frozenset({"B7"})


class Cell(NamedTuple):
    """One place of the matrix; the sign of the speed is the direction, the other one at every second angle."""

    case: FaultCase
    drive: DriveKind
    phase: Phase
    speed_deg_s: float
    angle_deg: float
    scan_ms: float
    brake_owner: BrakeOwner
    beside: bool = False

    @property
    def text(self) -> str:
        """For people."""
        return (
            f"{self.case.number} in '{self.phase.value}', {self.drive}{' with nodes' if self.beside else ''}, "
            f"{self.speed_deg_s:g} deg/s at "
            f"{self.angle_deg:g} deg, scan {self.scan_ms:g} ms"
        )

    @property
    def moves(self) -> bool:
        """The phase has a speed."""
        return self.phase.moves or self.phase is Phase.FIRST_MOVE


def cell(number: int) -> Cell:
    """Run `number` of the matrix.

    Raises:
        UsageError: there is none.
    """
    if not 0 <= number < CELLS:
        raise UsageError(f"the matrix has cells 0 to {CELLS - 1}, got {number}")
    left = number * _STRIDE % CELLS
    left, scan = divmod(left, len(SCANS_MS))
    left, angle = divmod(left, len(ANGLES_DEG))
    left, speed = divmod(left, len(SPEEDS_DEG_S))
    left, phase = divmod(left, len(PHASES))
    row, bench = divmod(left, len(BENCHES))
    case, (drive, beside) = CATALOGUE[row], BENCHES[bench]
    sign = 1.0 if angle % 2 == 0 else -1.0
    owner: BrakeOwner = "object_60FE" if drive == "bus" and not beside and (angle + speed) % 2 else "drive"
    return Cell(
        case,
        drive,
        PHASES[phase],
        sign * SPEEDS_DEG_S[speed],
        ANGLES_DEG[angle],
        SCANS_MS[scan],
        owner,
        beside,
    )


def no_sense(at: Cell) -> str:
    """Why a cell makes no sense, known before it is run; "" if it does."""
    if at.drive not in at.case.buses:
        return "only on a bus" if at.drive == "sim" else "only on the simulated drive"
    if at.case.beside and not at.beside:
        return "only with nodes beside the drive"
    if at.case.number == "E13b" and at.beside and at.scan_ms == min(SCANS_MS):
        # With the half of the bus that controller and drive need at 1 ms its 40 % are room; the nodes need that.
        return "the nodes leave no room for these frames: that is E13"
    if at.phase in _OF_THEIR_ROWS and at.phase is not at.case.phase:
        return f"phase '{at.phase.value}': for its own rows"
    if at.moves and at.case.number in _AT_STANDSTILL:
        return "the load is of the place where it is put on: at standstill only"
    if not at.moves and abs(at.speed_deg_s) != SPEEDS_DEG_S[0]:
        return "a phase at standstill has no speed: run once"
    return ""


def run_cell(at: Cell) -> dict[str, Any]:
    """Columns of a row that the cell decides (`job.row`)."""
    about: dict[str, Any] = {
        "drive": at.drive, "scan_ms": at.scan_ms, "faults": at.case.number, "refused": no_sense(at), "violations": [],
    }  # fmt: skip
    if about["refused"]:
        return about
    own = at.phase is at.case.phase
    case = replace(at.case, phase=at.phase, judged=at.case.judged and own)
    with tapped(), watching(Oracle()) as oracle:
        try:
            result = run_fault(
                FaultRun(
                    case,
                    kind=at.drive,
                    brake_owner=at.brake_owner,
                    beside=at.beside,
                    speed_deg_s=at.speed_deg_s,
                    angle_deg=at.angle_deg,
                    scan_ms=at.scan_ms,
                )
            )
        except UsageError as wrong:
            return about | {"refused": _reason(str(wrong))}
        except ConfigError:
            return about | {"refused": UNSOUND}
    violations = [*result.faults]
    if violations and violations[0].startswith("the fault was never injected"):
        return about | {"refused": "the moment of the fault does not come in this phase"}
    if at.case.judged:
        # The way of a row that is run in its own phase is judged by its own limit.
        excused = (*(("INV-1",) if own else ()), *EXCUSED.get(at.case.number, ()))
        violations += [str(each) for each in oracle.violations if each.invariant not in excused]
    violations += _elsewhere(at, result) if at.case.judged and not own else []
    # A stop was under way where the phase is one, and a motion on its ramp may end by itself.
    moving = seen_in_motion(at.case) and at.phase is Phase.CRUISE
    return about | {
        "violations": [f"{at.text}: {each}" for each in violations],
        "stops": result.first_out,
        "way_of": at.case.number if moving else "",
        "way_deg": result.way_deg,
        "limit_deg": result.limit_deg,
        "axis_s": float(result.log["time_s"][-1]),
        "trace_sha256": hashlib.sha256(result.log.table.tobytes()).hexdigest(),
    }


def _reason(text: str) -> str:
    if "would start at" in text:
        return "the run-up does not fit into the travel"
    if "does not come into the phase" in text:
        return "the sound axis does not come into the phase"
    return text


def _elsewhere(at: Cell, result: FaultResult) -> list[str]:
    """What is demanded of a row in a phase that is not its own.

    A stop ends at rest, nothing enables by itself, no warning stops.
    """
    found = []
    if result.first_out and at.case.rests and not math.isfinite(result.rest_s):
        found.append("the load still moves")
    holds = Code.BRK_03 in result.codes or Code.BRK_04 in result.codes
    if result.enables > int(at.case.hold or holds):
        found.append(f"the drive was enabled {result.enables} times after the alarm; nobody asked for it")
    if (
        result.first_out
        and at.case.reaction not in STOPPING
        and at.phase is not Phase.QUICK_STOP
        and not at.case.codes
    ):
        found.append(f"stopped by {result.first_out}; nothing should have")
    return found
