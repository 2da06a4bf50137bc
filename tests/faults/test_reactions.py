"""Every row of the fault catalogue that acts on an axis: way to rest, first alarm, position, enables, told words.

A row is run on the engine and the program of the product; the true plant is watched every millisecond. What must
happen stands in the row itself (`engineering/faults/rows`), the permitted way in `engineering/faults/limits.py`.
"""

from __future__ import annotations

from collections.abc import Iterable
from itertools import product
from typing import NamedTuple

import pytest

from gantryctl.engineering.faults import bench
from gantryctl.engineering.faults.bench import BrakeOwner
from gantryctl.engineering.faults.case import FaultCase
from gantryctl.engineering.faults.catalogue import CATALOGUE, fault_case
from gantryctl.engineering.faults.oracle.taps import Oracle
from gantryctl.engineering.faults.run import DriveKind, FaultRun, run_fault
from support.fault_rows import seen_by

ANGLE_DEG = 90.0
"""Where the eccentric moment is largest: it helps or hinders a stop most."""


class Variant(NamedTuple):
    """One way to run a row."""

    kind: DriveKind
    brake_owner: BrakeOwner
    scan_ms: float
    speed_deg_s: float

    @property
    def text(self) -> str:
        where = self.kind if self.kind == "sim" else f"bus, brake by {self.brake_owner}"
        return f"{where}, scan {self.scan_ms:g} ms, {self.speed_deg_s:g} deg/s"


DRIVES: tuple[tuple[DriveKind, BrakeOwner], ...] = (
    ("sim", "drive"),
    ("bus", "drive"),
    ("bus", "object_60FE"),
)
SIM = (Variant("sim", "drive", 1.0, 6.0), Variant("sim", "drive", 10.0, 1.0))
BUS = (Variant("bus", "drive", 4.0, 6.0), Variant("bus", "object_60FE", 10.0, 3.0))
"""With `SIM` each scan period, speed, drive and owner of the brake once."""
SHORT, DEAR = SIM[1], (SIM[0], *BUS)
"""A run at 10 ms without a bus costs 0.05 s of a processor, the others 0.4 to 1.2 s. So these take turns over the
rows: rows of brake, drive and bus have all of them but one, the others one; the slow test has every variant."""
ONCE = (Variant("sim", "drive", 4.0, 6.0), Variant("bus", "object_60FE", 10.0, 3.0))
"""For rows whose answer is one comparison of one input or state."""
PLAIN = (
    "A4",
    "A5",
    "A6",
    "A7",
    "B1",
    "B10",
    "C1",
    "C11",
    "C12",
    "D2",
    "D3",
    "E3",
    "E5",
    "E6",
    "E13",
    "G3",
    "G4",
    "G15",
)
ALL = tuple(
    Variant(kind, owner, scan_ms, speed)
    for (kind, owner), scan_ms, speed in product(DRIVES, (1.0, 4.0, 10.0), (1.0, 3.0, 6.0))
)


def against(case: FaultCase, variants: Iterable[Variant]) -> list[str]:
    """What is against a row, over all its variants."""
    found = []
    if case.beside:  # the brake is an output of the I/O node, whoever owns it else
        variants = {(each.kind, each.scan_ms, each.speed_deg_s): each for each in variants}.values()
    for variant in variants:
        if variant.kind not in case.buses:
            continue
        result = run_fault(
            FaultRun(
                case,
                kind=variant.kind,
                brake_owner=variant.brake_owner,
                speed_deg_s=variant.speed_deg_s,
                angle_deg=ANGLE_DEG,
                scan_ms=variant.scan_ms,
            )
        )
        found += [f"{variant.text}: {fault}" for fault in result.faults]
    return found


def brief(case: FaultCase) -> tuple[Variant, ...]:
    """The variants of the fast test."""
    if case.number in PLAIN:
        return ONCE
    turn = [each.number for each in CATALOGUE].index(case.number)
    if case.beside:
        # The brake is of the I/O node, whoever owns it else: scan and speed alone differ, and take turns over 12 rows.
        return (BUS[turn % 2],)
    dear = [each for each in DEAR if each.kind in case.buses]
    count = max(1, len(dear) - 1) if case.number[0] in "CDE" else 1
    return (SHORT, *(dear[(turn + each) % len(dear)] for each in range(count)))


def rows() -> list[object]:
    """The rows that are judged."""
    return [pytest.param(case, id=case.number) for case in CATALOGUE if case.judged]


pytestmark = pytest.mark.can


@pytest.mark.parametrize("case", rows())
def test_a_fault_is_answered_in_time_and_told_truly(
    case: FaultCase, oracle: Oracle, monkeypatch: pytest.MonkeyPatch
) -> None:
    # s: the way into the phase costs more than what is judged; the slow test has the ramp of the bench.
    monkeypatch.setattr(bench, "_RAMP_UP_S", 4.0)
    found = against(case, brief(case))
    assert found + seen_by(oracle, case) == []


@pytest.mark.slow
@pytest.mark.parametrize("case", rows())
def test_a_fault_is_answered_at_every_scan_period_speed_and_drive(case: FaultCase, oracle: Oracle) -> None:
    assert against(case, ALL) + seen_by(oracle, case) == []


@pytest.mark.slow
@pytest.mark.parametrize("speed_deg_s", [0.6, 0.8, 3.0])
def test_an_encoder_on_the_ring_shows_a_coupling_that_slips(speed_deg_s: float) -> None:
    """A tenth slips, so both encoders differ by 0.05 deg after half a degree; it is told 20 ms and some scans later."""
    found = run_fault(
        FaultRun(
            fault_case("A17"),
            kind="bus",
            beside=True,
            speed_deg_s=speed_deg_s,
            angle_deg=ANGLE_DEG,
            scan_ms=4.0,
        )
    )
    assert found.first_out == "ENC-07"
    assert found.moments[0].time_s - found.onset_s <= 0.05 / (0.1 * speed_deg_s) + 0.020 + 3.0 * 0.004
    assert not found.position_valid


def test_without_it_the_oracle_finds_the_wrong_angle(oracle: Oracle) -> None:
    run_fault(FaultRun(fault_case("A17"), speed_deg_s=0.8, angle_deg=ANGLE_DEG, scan_ms=10.0))
    assert oracle.caught("INV-7")
