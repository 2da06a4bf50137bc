"""Scenarios of a fault campaign: drawn the same everywhere, played to the same bits, judged by the true plant."""

from __future__ import annotations

from collections import Counter
from itertools import product
from pathlib import Path

import pytest

from gantryctl.engineering.fault_campaign.draw import (
    axis_scenario,
    drawable,
    pair_scenario,
    random_scenario,
    wide_scenario,
)
from gantryctl.engineering.fault_campaign.machines import base_of, machine_of
from gantryctl.engineering.fault_campaign.play import play
from gantryctl.engineering.fault_campaign.scenario import (
    Action,
    PlannedFault,
    Scenario,
    load_scenario,
    scenario_toml,
)
from gantryctl.engineering.faults.oracle.taps import Oracle
from gantryctl.errors import UsageError
from gantryctl.machine.places import reach_deg

pytestmark = pytest.mark.can
TURNING = (Action(at_s=0.1, do="power"), Action(at_s=1.6, do="move", target_deg=60.0, speed_deg_s=3.0))


def scenario(*faults: PlannedFault, **others: object) -> Scenario:
    given = {"actions": TURNING, "ramp_deg_s2": 1.0, "duration_s": 7.0, "scan_ms": 10.0, **others}
    return Scenario.model_validate({**given, "faults": faults})


def test_shares_of_faults_and_drives_are_those_that_were_asked_for() -> None:
    drawn = [random_scenario(1, seed) for seed in range(800)]
    faulty = Counter(len(each.faults) for each in drawn)
    some = 800 - faulty[0]
    assert faulty[0] / 800 == pytest.approx(0.1, abs=0.03)
    assert faulty[1] / some == pytest.approx(0.4, abs=0.05)
    assert faulty[2] / some == pytest.approx(0.4, abs=0.05)
    assert faulty[3] / some == pytest.approx(0.2, abs=0.05)
    assert sum(each.drive == "bus" for each in drawn) / 800 >= 0.2
    deeds = Counter(action.do for each in drawn for action in each.actions)
    assert len(deeds) == 11, "every deed but a bare reset is drawn"
    numbers = Counter(fault.number for each in drawn for fault in each.faults)
    every = {case.number for case in (*drawable("sim"), *drawable("bus", beside=True))}
    assert set(numbers) == every
    assert {each.scan_ms for each in drawn} == {1.0, 4.0, 10.0}


def test_wide_scenarios_have_every_scan_period_and_plants_at_the_edge() -> None:
    drawn = [wide_scenario(1, seed) for seed in range(200)]
    assert {each.scan_ms for each in drawn} == {1.0, 2.0, 4.0, 10.0}
    assert {(each.edge, each.second_pinion) for each in drawn} == set(product((False, True), repeat=2))
    base = base_of(drawn[0])
    at_edge = machine_of(drawn[0].model_copy(update={"edge": True, "second_pinion": False}))
    off = at_edge.plant.load.inertia_kg_m2 / base.plant.load.inertia_kg_m2
    assert abs(off - 1.0) == pytest.approx(0.2)


def test_scenarios_of_other_axes_are_within_their_travel_and_speed() -> None:
    drawn = [axis_scenario(1, seed) for seed in range(12)]
    assert len({each.template for each in drawn}) > 4
    assert any(each.improved for each in drawn)
    for each in drawn:
        machine = base_of(each)
        low, high = reach_deg(machine)
        assert each.drive == "sim"
        assert machine.control.scan_period_ms == each.scan_ms
        assert low <= each.angle_deg <= high
        fastest = [abs(action.speed_deg_s) for action in each.actions if action.do in ("move", "jog")]
        assert max(fastest, default=0.0) <= machine.speed.setting_max_deg_s * (1.0 + 1e-9)
    # The improved gantry has the plant of its calibration.
    assert {each.plant_seed for each in drawn if each.improved} == {None}


def test_an_axis_on_the_bus_is_the_same_axis() -> None:
    """Axis, loops and plant of the draft; telegrams, inputs and times of the bus of the reference gantry."""
    for seed in range(8):
        simulated, drawn = axis_scenario(1, seed), axis_scenario(1, seed, drive="bus")
        assert (drawn.drive, drawn.beside) == ("bus", False)
        if simulated.improved:
            assert drawn.template
            continue
        assert (drawn.template, drawn.answers) == (simulated.template, simulated.answers)
        there, here = base_of(drawn), base_of(simulated)
        assert there.on_bus
        assert not here.on_bus
        assert (there.axis, there.plant, there.speed, there.motor) == (
            here.axis,
            here.plant,
            here.speed,
            here.motor,
        )
        assert there.can.inputs.brake_open >= 0
        assert there.brake.owner == drawn.brake_owner
    assert {axis_scenario(1, seed, drive="bus").inverted for seed in range(8)} == {False, True}
    turned = machine_of(Scenario(template="crane_slew", drive="bus", inverted=True))
    assert turned.can.inverted


def test_answers_of_a_scenario_are_those_of_its_axis() -> None:
    """A crane of twice the inertia that the template has."""
    usual, heavy = (
        machine_of(Scenario(template="crane_slew", answers=answers))
        for answers in ({}, {"inertia_kg_m2": 2e7})
    )
    assert heavy.plant.load.inertia_kg_m2 == pytest.approx(2.0 * usual.plant.load.inertia_kg_m2)


def test_a_seed_is_a_scenario_on_every_computer() -> None:
    """Written down once: another Python, another processor, the same numbers."""
    first = random_scenario(1, 123, 4.0)
    assert first.label == "D6"
    assert (first.drive, first.angle_deg, first.faults[0].at_s) == ("bus", -156.143963, 22.447326)
    assert random_scenario(2, 123, 4.0) != first
    ordered = {
        (one.number, two.number) for one, two in (pair_scenario(1, seed).faults for seed in range(200))
    }
    assert len(ordered) > 150


def test_a_file_gives_the_same_scenario_again(tmp_path: Path) -> None:
    for seed in range(30):
        drawn = wide_scenario(1, seed) if seed else axis_scenario(1, 15)
        file = tmp_path / "scenario.toml"
        file.write_text(scenario_toml(drawn))
        assert load_scenario(file) == drawn


@pytest.mark.parametrize(
    ("text", "told"),
    [
        ("scan_ms = nan", "scan_ms"),
        ("speed = 1", "speed"),
        ('[[faults]]\nnumber = "Z9"\nat_s = 1.0', "Z9"),
        ('[[faults]]\nnumber = "A1"\nat_s = 1.0\nargs = { angle_deg = 1e9 }', "from -360 to 360"),
        ('[[actions]]\ndo = "fly"\nat_s = 1.0', "actions.0.do"),
        ("scan_ms = ", "scenario.toml"),
        ('template = "gantry"\nimproved = true', "of one kind"),
        ("improved = true\nsecond_pinion = true", "one pinion"),
        ('improved = true\ndrive = "bus"', "encoder on the ring"),
        ('template = "crane_slew"\ndrive = "bus"\nbeside = true', "without nodes"),
        ("inverted = true", "no mounting"),
        ("answers = { inertia_kg_m2 = nan }", "answers.inertia_kg_m2"),
    ],
)
def test_a_file_that_is_wrong_is_refused_by_its_place(tmp_path: Path, text: str, told: str) -> None:
    file = tmp_path / "scenario.toml"
    file.write_text(text)
    with pytest.raises(UsageError, match=told):
        load_scenario(file)


def test_the_same_scenario_gives_the_same_bits_and_another_gives_others() -> None:
    fault = PlannedFault(number="D1", at_s=4.0)
    first, again = play(scenario(fault)), play(scenario(fault))
    assert first.trace_sha256 == again.trace_sha256
    assert first.ok, first.violations
    assert first.stops == ("DRV-01",)
    assert (first.fault, first.way_deg < first.limit_deg) == ("D1", True)
    later = play(scenario(fault.model_copy(update={"at_s": 4.01})))
    assert later.trace_sha256 != first.trace_sha256


@pytest.mark.parametrize("number", ["A1", "C5", "G3", "G9"])
def test_a_fault_in_motion_keeps_the_way_of_its_class(number: str) -> None:
    played = play(scenario(PlannedFault(number=number, at_s=4.0)))
    assert played.ok, played.violations
    assert 0.0 < played.way_deg <= played.limit_deg


def test_a_stop_without_a_cause_is_a_nuisance(monkeypatch: pytest.MonkeyPatch) -> None:
    """The liar: an axis that switches itself off."""
    sound = play(scenario(duration_s=4.0))
    assert sound.ok, sound.violations
    monkeypatch.setattr(
        "gantryctl.engineering.fault_campaign.judging.judge.Judge.injected", lambda self, each: None
    )
    silent = play(scenario(PlannedFault(number="D1", at_s=3.0), duration_s=4.0))
    assert [each.invariant for each in silent.violations] == ["M2"]
    assert silent.nuisances == 1


def test_what_a_campaign_plays_is_judged_by_its_own_oracle(oracle: Oracle) -> None:
    """The oracle of the tests sees nothing of it: each axis has one judge."""
    play(scenario(PlannedFault(number="D1", at_s=3.0), duration_s=4.0))
    assert not oracle.axes
