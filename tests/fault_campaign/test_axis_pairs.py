"""Pairs of faults on other axes: within half a second of each other, the first at its moment of the sound session."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import pytest

from gantryctl.engineering.fault_campaign import axis_pairs
from gantryctl.engineering.fault_campaign.axis_pairs import MOMENTS, axis_pair_scenario
from gantryctl.engineering.fault_campaign.draw import Drive, drawable
from gantryctl.engineering.fault_campaign.kinds import campaign_of
from gantryctl.engineering.fault_campaign.machines import machine_of
from gantryctl.engineering.fault_campaign.person import changes_of
from gantryctl.engineering.fault_campaign.play import KEEPS_RAMPS_DEG_S, play
from gantryctl.engineering.fault_campaign.scenario import Scenario
from gantryctl.engineering.faults.bench import FaultBench
from gantryctl.engineering.faults.case import Phase
from gantryctl.image import Mode
from gantryctl.program import PowerPhase
from gantryctl.units import deg

pytestmark = pytest.mark.can


def moment(scenario: Scenario) -> str:
    return scenario.name.partition(", ")[2]


def test_a_seed_is_a_pair_on_every_computer() -> None:
    """Written down once: another Python, another processor, the same numbers."""
    drawn = axis_pair_scenario(1, 20, drive="bus")
    assert (drawn.name, drawn.label) == ("axis-pairs 1 20, stop", "D11+E4b")
    assert (drawn.template, drawn.scan_ms, drawn.faults[0].at_s) == ("rotary_table", 1.0, 2.686135)
    assert drawn == axis_pair_scenario(1, 20, drive="bus")
    assert drawn == campaign_of("axis-pairs", drive="bus").scenario(20)


def test_every_pair_is_within_half_a_second_and_any_range_is_a_sample(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    # One draft serves all of them.
    monkeypatch.setattr(axis_pairs, "other_axis", lambda draw, drive: {"template": "tilt_table"})
    drawn = [axis_pair_scenario(1, seed, drive="bus") for seed in range(45)]
    assert {moment(each) for each in drawn} == set(MOMENTS)
    assert {each.inverted for each in drawn} == {False, True}
    for each in drawn:
        first, second = each.faults
        assert 0.0 <= second.at_s - first.at_s <= 0.5 + 1e-9
        # A stop and its telling are played to their end.
        assert each.duration_s >= second.at_s + 3.999
        assert not each.beside
    # 73 rows of a bus, of which each comes first, and each second, as often as any other.
    rows = {case.number for case in drawable("bus")}
    assert len({each.faults[0].number for each in drawn}) > 20
    assert {fault.number for each in drawn for fault in each.faults} <= rows


class Seen(NamedTuple):
    """The sound axis where the first fault would begin, and one scan before."""

    vel_deg_s: float
    before_deg_s: float
    left_deg: float
    phase: PowerPhase


_SWITCHES = {phase for phase in PowerPhase if phase not in (PowerPhase.OFF, PowerPhase.ON)}
# By the speed that was asked for.
AT: dict[str, Callable[[Seen, float], bool]] = {
    "power on": lambda seen, _: seen.phase in _SWITCHES,
    "brake opens for a move": lambda seen, _: seen.phase in _SWITCHES,
    "gains speed": lambda seen, top: abs(seen.before_deg_s) < abs(seen.vel_deg_s) < top,
    "at speed": lambda seen, top: abs(seen.vel_deg_s) >= 0.95 * top,
    "slows down": lambda seen, top: top > abs(seen.before_deg_s) > abs(seen.vel_deg_s),
    "last degree": lambda seen, _: seen.vel_deg_s != 0.0 and abs(seen.left_deg) <= 1.0,
    "stop": lambda seen, top: seen.phase is PowerPhase.QUICK_STOPPING or 0.0 < abs(seen.vel_deg_s) <= top,
    "power off": lambda seen, _: seen.phase in _SWITCHES,
    "recovery": lambda seen, _: seen.phase is PowerPhase.OFF or seen.phase in _SWITCHES,
}


def sound(scenario: Scenario) -> Seen:
    """Play the session without its faults, up to the first of them."""
    bench = FaultBench(machine_of(scenario), Phase.OFF, KEEPS_RAMPS_DEG_S, scenario.angle_deg)
    bench.command(mode=Mode.CONTINUOUS)
    changes, operator, axis, before = (
        list(changes_of(scenario.actions)),
        bench.target.operator,
        bench.axis,
        0.0,
    )
    while bench.time_s < scenario.faults[0].at_s - 1e-9:
        while changes and changes[0].at_s <= bench.time_s:
            operator.command = changes.pop(0).on(operator.command)
        before = deg(axis.virtual.vel_ref_rad_s)
        bench.step()
    target = next((each.target_deg for each in scenario.actions if each.do == "move"), 0.0)
    left = target - deg(axis.virtual.pos_ref_rad)
    return Seen(deg(axis.virtual.vel_ref_rad_s), before, left, axis.power.phase)


# One of each moment, at the scan that is the cheapest to play.
@pytest.mark.parametrize("seed", [15, 121, 107, 55, 3, 56, 60, 57, 131])
def test_the_first_fault_begins_at_its_moment(seed: int) -> None:
    drawn = axis_pair_scenario(1, seed, 10.0)
    speeds = [abs(each.speed_deg_s) for each in drawn.actions if each.do in ("move", "jog")]
    seen = sound(drawn)
    assert AT[moment(drawn)](seen, max(speeds, default=0.0)), (moment(drawn), seen)


def test_the_moments_tried_are_all_of_them() -> None:
    assert set(AT) == set(MOMENTS)


def test_a_pair_is_played_to_the_same_bits() -> None:
    drawn = axis_pair_scenario(1, 24, 10.0)
    first = play(drawn)
    assert first.axis_s == pytest.approx(drawn.duration_s, abs=0.011)
    assert first.trace_sha256 == play(drawn).trace_sha256


# 16: 0.683 of 0.682 deg, a fault of the drive in the quick stop of a crane: open (decision 0027).
@pytest.mark.slow
@pytest.mark.parametrize(("drive", "still_open"), [("sim", []), ("bus", [16])])
def test_a_hundred_pairs_hold_but_for_what_is_open(drive: Drive, still_open: list[int]) -> None:
    broken = [seed for seed in range(100) if not play(axis_pair_scenario(1, seed, drive=drive)).ok]
    assert broken == still_open
