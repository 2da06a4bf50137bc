"""Steps for what a drive lacks: its own quick-stop ramp, a torque limit of the maker's tool, a pulse without limits."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest

from gantryctl.commissioning import Outcome
from gantryctl.drives.virtual.node import DriveNode
from gantryctl.drives.virtual.personality import PERSONALITIES, Personality
from gantryctl.operation.ledger.rows import INCREMENTS_PER_TURN, RAMP_DEG_S2, TORQUE_LIMIT_NM
from gantryctl.operation.proofs import load_record
from unit.commissioning.virtual_commissioning import BRAKE_BY_60FE, MACHINE, VirtualCommissioning

pytestmark = pytest.mark.can

QUICK_DEG_S2 = MACHINE.virtual_axis.quick_dec_deg_s2


@pytest.fixture
def commission(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> VirtualCommissioning:
    lacks = (("no-ramp", (0x6085,)), ("no-limits", (0x6072, 0x6080)), ("no-counts", (0x608F,)))
    for name, absent in (*lacks, ("no-counts-no-ceiling", (0x608F, 0x6080))):
        monkeypatch.setitem(PERSONALITIES, name, Personality(name, "", absent=absent))
    return VirtualCommissioning(tmp_path, monkeypatch)


def own_ramp(share: float):
    """A drive whose ramp is that part of the machine's."""

    def spoil(node: DriveNode) -> None:
        node.axis.reference._kind = replace(node.kind, quick_stop_ramp_share=share)

    return spoil


# --- the drive's own ramp -----------------------------------------------------------------------------------------


def test_the_own_ramp_is_measured_and_kept_in_the_record(commission: VirtualCommissioning) -> None:
    done = commission("no-ramp", "ramp")
    assert done.result.outcome is Outcome.PASSED, done.result.proof
    # The virtual drive has the ramp of the machine file; 5 % is the uncertainty that the step admits.
    assert done.result.number(RAMP_DEG_S2) == pytest.approx(QUICK_DEG_S2, rel=0.05)
    record = load_record(done.work.record())
    assert record is not None
    assert record.measured[RAMP_DEG_S2] == done.result.number(RAMP_DEG_S2)


@pytest.mark.parametrize(
    ("share", "words"),
    [
        (1.6, "beyond the ratings"),
        (4.0, "too hard"),
        (100.0, "too hard"),
        (0.3, "too long"),
        (0.8, "computed with"),
    ],
)
def test_a_ramp_that_does_not_fit_is_refused(
    commission: VirtualCommissioning, share: float, words: str
) -> None:
    done = commission("no-ramp", "ramp", spoil=own_ramp(share))
    assert done.result.outcome is Outcome.FAILED
    assert words in done.result.proof
    if share > 1.0:
        # Seen at 0.3 deg/s already: 0.05 deg of acceleration, half a second of cruise, the stop.
        assert done.way_deg < 0.3
        assert set(done.result.figures) <= {"ramp_0p3_deg_s2", "torque_at_top_nm", "reducer_at_top_nm"}


def test_a_ramp_of_a_fixed_time_is_extrapolated(
    commission: VirtualCommissioning, monkeypatch: pytest.MonkeyPatch
) -> None:
    """1.2 deg/s2 from 0.3 and 2.4 from 0.6 deg/s are 24 from 6 deg/s: refused long before a speed that hurts."""

    def fixed_time(node: DriveNode) -> None:
        reference = node.axis.reference
        begun: list[float] = []

        def deceleration(_ramp: object) -> float:
            if not begun or abs(node.plant.vel_rad_s) > begun[0]:
                begun[:] = [abs(node.plant.vel_rad_s)]
            return begun[0] / 0.25

        reference.deceleration = deceleration  # type: ignore[method-assign]

    done = commission(
        "no-ramp", "ramp", spoil=fixed_time, changes={"virtual_axis.jog_release_dec_deg_s2": 1.0}
    )
    assert done.result.outcome is Outcome.FAILED
    assert "beyond the ratings" in done.result.proof
    assert done.way_deg < 1.0


def test_the_quick_stop_of_a_liar_is_refused_by_the_ramp_too(commission: VirtualCommissioning) -> None:
    def off_at_once(node: DriveNode) -> None:
        node.axis._kind = replace(node.kind, quick_stop_option_ignored=True)

    done = commission("no-ramp", "ramp", spoil=off_at_once)
    assert done.result.outcome is Outcome.FAILED
    assert "605A" in done.result.proof
    # From 0.3 deg/s on the brake alone, which closes after 0.15 s: 0.05 and 0.15 deg before it.
    assert done.way_deg < 0.3


def test_the_steps_appear_where_the_drive_needs_them(commission: VirtualCommissioning) -> None:
    assert not {"ramp", "torque"} & {step.key for step in commission("", "identity").work.steps}
    steps = {step.key for step in commission("no-ramp", "identity").work.steps}
    assert "ramp" in steps
    assert "torque" not in steps
    limit = {"can.torque_limit_in_drive_nm": 385.0}
    steps = {step.key for step in commission("no-limits", "identity", changes=limit).work.steps}
    assert "torque" in steps
    assert "ramp" not in steps


# --- the torque limit of the maker's tool -------------------------------------------------------------------------


def with_limit(torque_nm: float) -> dict[str, object]:
    return {**BRAKE_BY_60FE, "can.torque_limit_in_drive_nm": torque_nm}


def test_what_a_pulse_shows_of_the_limit_is_kept(commission: VirtualCommissioning) -> None:
    """0.6 x 70 N m of the brake test, less the 14 N m that hold the load, are 28 N m."""
    done = commission("no-limits", "brake", "torque", changes=with_limit(385.0))
    assert done.result.outcome is Outcome.PASSED, done.result.proof
    # 6077 counts in 0.257 N m.
    assert done.result.number(TORQUE_LIMIT_NM) == pytest.approx(28.0, abs=0.5)
    assert "is not shown" in done.result.proof
    assert done.way_deg < 0.02


def test_a_drive_that_gives_less_than_it_is_asked_for_is_refused(commission: VirtualCommissioning) -> None:
    """The maker's tool has set 20 N m, or the scale of 6077 is another: neither is the limit that was entered."""
    opened: list[DriveNode] = []

    def limited(node: DriveNode) -> None:
        opened.append(node)
        # The brake test wants 70 N m: only the step's own opening, the last one, finds the limit set.
        if len(opened) > 3:
            node.plant.limit_torque(20.0)
            node.axis.limit_torque = lambda _: None  # type: ignore[method-assign]

    done = commission("no-limits", "brake", "torque", changes=with_limit(385.0), spoil=limited)
    assert done.work.progress.results["brake"].outcome is Outcome.PASSED
    assert done.result.outcome is Outcome.FAILED
    assert done.result.number("pushed_most_nm") < 20.5
    assert done.way_deg < 0.02


def test_a_brake_that_slips_in_the_push_is_refused(commission: VirtualCommissioning) -> None:
    """The speed loop of the drive stands against its own preload: the torque stays at what the brake bears."""
    opened: list[DriveNode] = []

    def weak(node: DriveNode) -> None:
        opened.append(node)
        if len(opened) > 3:
            node.plant.change_plant("brake_torque_nm", 20.0)

    done = commission("no-limits", "brake", "torque", changes=with_limit(385.0), spoil=weak)
    assert done.result.outcome is Outcome.FAILED
    assert done.way_deg < 0.02


def test_without_a_brake_test_nothing_is_pushed(commission: VirtualCommissioning) -> None:
    done = commission("no-limits", "torque", changes=with_limit(385.0))
    assert done.result.outcome is Outcome.FAILED
    assert "the step brake" in done.result.to_do
    assert done.way_deg == 0.0


def test_a_drive_that_works_its_brake_is_not_pushed(commission: VirtualCommissioning) -> None:
    done = commission("no-limits", "torque", changes={"can.torque_limit_in_drive_nm": 385.0})
    assert done.result.outcome is Outcome.NOT_TESTABLE


# --- the sign pulse without limits --------------------------------------------------------------------------------


def test_a_pulse_without_6072_and_6080_has_a_leash_of_its_own(commission: VirtualCommissioning) -> None:
    limit = {"can.torque_limit_in_drive_nm": 385.0}
    done = commission("no-limits", "sign", changes=limit)
    assert done.result.outcome is Outcome.PASSED, done.result.proof
    assert "no 6072, 6080 in this drive" in done.result.proof

    def too_fast(node: DriveNode) -> None:
        node.scaling.per_rad_s /= 50.0

    done = commission("no-limits", "sign", changes=limit, spoil=too_fast)
    assert done.result.outcome is Outcome.FAILED
    # 0.05 deg, and what the brake takes from 0.5 deg/s at most.
    assert done.way_deg < 0.2


# --- increments of a turn in a drive without 608F -----------------------------------------------------------------

TURN = MACHINE.can.increments_per_turn


def half_the_counts(node: DriveNode) -> None:
    """The encoder has half of what the machine file says; position and speed agree with each other all the same."""
    node.scaling.counts_per_turn //= 2
    if node.kind.velocity_unit == "inc/s":
        node.scaling.per_rad_s /= 2.0


@pytest.mark.parametrize("unit", ["inc/s", "0.1 r/min"])
def test_the_increments_of_a_turn_are_shown_by_the_sign(
    commission: VirtualCommissioning, monkeypatch: pytest.MonkeyPatch, unit: str
) -> None:
    kind = Personality("no-counts", "", absent=(0x608F,), velocity_unit=unit)  # type: ignore[arg-type]
    monkeypatch.setitem(PERSONALITIES, "no-counts", kind)
    changes = {"can.velocity_unit": unit}
    done = commission("no-counts", "sign", changes=changes)
    assert done.result.outcome is Outcome.PASSED, done.result.proof
    # A whole number of r/min at the ceiling, or 0.1 r/min of 60FF in the pulse.
    assert done.result.number(INCREMENTS_PER_TURN) == pytest.approx(TURN, rel=0.03)
    done = commission("no-counts", "sign", changes=changes, spoil=half_the_counts)
    assert done.result.outcome is Outcome.FAILED
    assert done.way_deg < 0.15


def test_where_nothing_shows_the_increments_a_name_must_stand_for_them(
    commission: VirtualCommissioning,
) -> None:
    done = commission("no-counts-no-ceiling", "sign", spoil=half_the_counts)
    assert done.result.outcome is Outcome.PASSED, "nothing in this drive could show it"
    assert "nothing in this drive shows" in done.result.proof
    row = next(row for row in done.work.ledger if row.what == "knows_counts")
    assert row.lacking
    assert row.acceptable
