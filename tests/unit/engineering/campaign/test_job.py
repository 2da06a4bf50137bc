"""Rows of a campaign: each the figures of its plant, in whatever chunk, and a name where there are none."""

from __future__ import annotations

import pickle
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
import pytest

from gantryctl.engineering.accuracy.procedure.on_batch import run_procedure
from gantryctl.engineering.accuracy.procedure.procedures import chord_procedure, evaluate
from gantryctl.engineering.accuracy.speed_test import speed_test
from gantryctl.engineering.accuracy.statistics import accuracy_a
from gantryctl.engineering.campaign import job as job_module
from gantryctl.engineering.campaign.job import CampaignJob
from gantryctl.engineering.campaign.population import Campaign
from gantryctl.engineering.comparison.key_figures import Move, move_figures, moves_figures
from gantryctl.engineering.identification import SimulatedAxis, calibrate
from gantryctl.engineering.scheduler.job import Chunk, collected
from gantryctl.engineering.stops.limits import hardest_quick_stop
from gantryctl.machine import Machine, default_machine, with_values
from gantryctl.machine.rules.reaction import REACTION_S
from gantryctl.machine.specs import value_at
from support.improved import improved_machine

from .conftest import INERTIA, ORDER

Made = Callable[..., Campaign]

FRICTION = """
[vary.friction]
law = "normal"
keys = ["plant.motor_friction.coulomb_nm", "plant.motor_friction.breakaway_nm"]
relative = true
mean = 1.0
deviation = 0.2
"""
PHASES = '[vary.gear]\nlaw = "phases"\n'


def same(ours: dict[str, Any], theirs: dict[str, Any]) -> bool:
    """Equal bit for bit, NaN included."""
    return list(ours) == list(theirs) and all(
        ours[name].tolist() == theirs[name].tolist()
        if ours[name].dtype == object
        else ours[name].tobytes() == theirs[name].tobytes()
        for name in ours
    )


def test_rows_are_the_same_in_any_chunks_and_after_a_journey(made: Made) -> None:
    job = CampaignJob(made(INERTIA + FRICTION + PHASES))
    whole = job.rows(0, 8)
    parts = [(Chunk(5, 3), job.rows(5, 3)), (Chunk(0, 1), job.rows(0, 1)), (Chunk(1, 4), job.rows(1, 4))]
    assert same(collected(parts), whole)
    assert same(pickle.loads(pickle.dumps(job)).rows(0, 8), whole)
    assert len(set(whole["move_load_error_deg_s"])) == 8


def test_a_row_is_what_a_machine_file_with_its_values_gives(made: Made) -> None:
    campaign = made(INERTIA + FRICTION + PHASES)
    rows = CampaignJob(campaign).rows(0, 3)
    for plant in campaign.plants(0, 3):
        machine = with_values(default_machine(), plant.values)
        assert move_figures(machine, 0.0, 0.2).load_error_deg_s == rows["move_load_error_deg_s"][plant.row]
        assert rows["plant.load.inertia_kg_m2"][plant.row] == value_at(machine, "plant.load.inertia_kg_m2")


def test_keys_of_one_table_move_together(made: Made) -> None:
    for plant in made(FRICTION).plants(0, 20):
        coulomb, breakaway = (
            float(str(plant.values[f"plant.motor_friction.{key}_nm"])) for key in ("coulomb", "breakaway")
        )
        assert coulomb / 5.5 == pytest.approx(breakaway / 6.5)
        assert coulomb != 5.5


def test_a_plant_that_the_checks_refuse_has_a_row_with_the_name_of_the_key_or_rule(made: Made) -> None:
    limits = '[vary.x]\nlaw = "normal"\nkeys = ["plant.load.mass_kg"]\nmean = 2e5\ndeviation = 2e5\n'
    rule = INERTIA.replace("0.8", "0.1").replace("inertia_kg_m2", "eccentric_check_moment_nm")
    for rest, name in (
        (limits, "plant.load.mass_kg: limits"),
        (rule, "plant.load.eccentric_check_moment_nm: check_moment_covers_nominal"),
    ):
        order = ORDER.replace("count = 8", "count = 40")
        rows = CampaignJob(made(rest, order)).rows(0, 40)
        refused = rows["refused_by"] == name
        assert 2 <= int(refused.sum()) <= 30, rows["refused_by"]
        assert np.array_equal(np.isnan(rows["move_load_error_deg_s"]), rows["refused_by"] != "")


def test_a_plant_that_a_test_cannot_judge_is_named_by_the_test(
    made: Made, monkeypatch: pytest.MonkeyPatch
) -> None:
    def swings_up(moves: Sequence[Move]) -> list[Any]:
        good = moves_figures(moves)
        return [ValueError("not finite"), *good[1:]]

    monkeypatch.setattr("gantryctl.engineering.campaign.measures.moves_figures", swings_up)
    assert CampaignJob(made()).rows(0, 3)["refused_by"].tolist() == ["move", "", ""]


def test_a_fault_of_the_program_is_no_plant_that_cannot_be_judged(
    made: Made, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(
        "gantryctl.engineering.campaign.measures.moves_figures",
        lambda moves: [TypeError("a fault")] * len(moves),
    )
    with pytest.raises(TypeError, match="a fault"):
        CampaignJob(made()).rows(0, 2)


# A chord test of 40 s instead of 537 s: harder ramps, shorter rests.
QUICK = """
[set]
"accuracy.dwell_s" = 0.5
"accuracy.average_s" = 0.2
"virtual_axis.acc_deg_s2" = 2.0
"virtual_axis.dec_deg_s2" = 2.0
"""
GAIN = '[vary.gain]\nlaw = "discrete"\nkeys = ["control.kpp_per_s"]\nrelative = true\nvalues = [1.0, 0.9]\n'


def test_the_chord_test_of_a_campaign_is_that_of_each_plant_alone(made: Made) -> None:
    order = 'tests = ["chord_test"]\ncount = 3\nseed = 5'
    campaign = made(QUICK + PHASES + GAIN, order)
    rows = CampaignJob(campaign).rows(0, 3)
    assert len(set(rows["control.kpp_per_s"])) == 2  # different controllers in one chunk
    procedure = chord_procedure("A")
    for plant in campaign.plants(0, 3):
        machine = with_values(campaign.controls[0].machine, plant.values)
        angles = run_procedure([machine], procedure, threads=1).load_rad[0]
        errors = evaluate(procedure, angles, machine.accuracy.chord_radius_m).errors_deg
        assert rows["a_true_deg"][plant.row] == float(accuracy_a(errors))


def test_stops_and_speed_test_of_a_campaign_are_those_of_each_plant_alone(made: Made) -> None:
    speeds = "\n[speed_test]\nspeeds_r_min = [0.5, 1.0]\n"
    campaign = made(INERTIA + GAIN + PHASES + speeds, 'tests = ["stops", "speed_test"]\ncount = 3')
    rows = CampaignJob(campaign).rows(0, 3)
    for plant in campaign.plants(0, 3):
        machine = with_values(campaign.controls[0].machine, plant.values)
        stop = hardest_quick_stop(machine)
        assert rows["quick_stop_load_angle_deg"][plant.row] == stop.load_angle_deg
        assert rows["quick_stop_reducer_nm"][plant.row] == stop.torque_reducer_nm
        assert rows["quick_stop_angle_deg"][plant.row] == stop.angle_deg + 6.0 * REACTION_S
        runs = speed_test(machine, [3.0, 6.0])
        assert len(runs) == 4
        assert rows["speed_error_load_deg_s"][plant.row] == max(run.load_error_deg_s or 0.0 for run in runs)
    assert len(set(rows["quick_stop_reducer_nm"])) == 3


IMPROVED = """
[improved]
machine = "hust_improved.toml"
variants = ["hust_gantry_as_it_is", "gear_map_alone", "hust_improved_as_it_is"]

[drift.stiffness]
law = "discrete"
keys = ["plant.transmission.rest_stiffness_nm_per_rad"]
relative = true
values = [0.8]
"""


def test_a_plant_is_identified_before_it_drifts_and_measured_after(
    made: Made, monkeypatch: pytest.MonkeyPatch
) -> None:
    known = improved_machine().calibration
    assert known is not None
    identified: list[Machine] = []

    def recorded(machines: Sequence[Machine], seeds: Sequence[int]) -> list[Any]:
        identified.extend(machines)
        assert list(seeds) == [0, 1]
        return [known] * len(machines)

    monkeypatch.setattr(job_module, "calibrate_each", recorded)
    campaign = made(INERTIA + IMPROVED)
    rows = CampaignJob(campaign).rows(0, 2)
    assert not any(rows["refused_by"]), rows["refused_by"]
    key = "plant.transmission.rest_stiffness_nm_per_rad"
    assert rows[key].tolist() == [1.2e9, 1.2e9], "0.8 of 1.5e9: a row shows the plant that ran"
    for plant, machine in zip(campaign.plants(0, 2), identified, strict=True):
        assert value_at(machine, key) == 1.5e9
        assert value_at(machine, "plant.load.inertia_kg_m2") == plant.values["plant.load.inertia_kg_m2"]
        drifted = plant.values | {key: 0.8 * 1.5e9}
        paper = with_values(default_machine(), drifted)
        improved = with_values(improved_machine(), drifted).calibrated(known)
        for name, control in (("hust_gantry_as_it_is", paper), ("hust_improved_as_it_is", improved)):
            wanted = move_figures(control, 0.0, 0.2).load_error_deg_s
            assert rows[f"{name}.move_load_error_deg_s"][plant.row] == wanted


def test_a_plant_that_its_drift_makes_impossible_is_named_by_the_drift(
    made: Made, monkeypatch: pytest.MonkeyPatch
) -> None:
    """An eccentric moment to check against that falls to a tenth covers the nominal one no more."""
    known = improved_machine().calibration
    monkeypatch.setattr(job_module, "calibrate_each", lambda machines, _: [known] * len(machines))
    key = "plant.load.eccentric_check_moment_nm"
    drift = IMPROVED.replace("plant.transmission.rest_stiffness_nm_per_rad", key).replace("[0.8]", "[0.1]")
    assert CampaignJob(made(INERTIA + drift)).rows(0, 1)["refused_by"].tolist() == [
        f"drift: {key}: check_moment_covers_nominal"
    ]
    # A plant that is impossible as it is has nothing to do with its drift.
    wrong = INERTIA.replace("inertia_kg_m2", "eccentric_check_moment_nm")
    wrong = wrong.replace("0.8", "0.1").replace("1.2", "0.11")
    assert CampaignJob(made(wrong)).rows(0, 1)["refused_by"].tolist() == [
        f"{key}: check_moment_covers_nominal"
    ]


def test_what_a_campaign_sets_holds_under_every_control(made: Made) -> None:
    settings = '[set]\n"control.kpp_per_s" = 8.0\n"virtual_axis.acc_deg_s2" = 0.3\n'
    controls = made(settings + INERTIA + IMPROVED).controls
    assert len(controls) == 3
    for each in controls:
        assert each.machine.control.kpp_per_s == 8.0, each.name
        assert each.machine.virtual_axis.acc_deg_s2 == 0.3, each.name


def test_a_plant_that_cannot_be_identified_is_named(made: Made, monkeypatch: pytest.MonkeyPatch) -> None:
    known = improved_machine().calibration

    def fails(machines: Sequence[Machine], seeds: Sequence[int]) -> list[Any]:
        return [np.linalg.LinAlgError("singular"), known]

    monkeypatch.setattr(job_module, "calibrate_each", fails)
    assert CampaignJob(made(INERTIA + IMPROVED)).rows(3, 2)["refused_by"].tolist() == ["identification", ""]


@pytest.mark.slow
def test_identification_in_a_campaign_is_that_of_the_plant_alone(made: Made) -> None:
    campaign = made(INERTIA + IMPROVED)
    rows = CampaignJob(campaign).rows(0, 1)
    (plant,) = campaign.plants(0, 1)
    own = with_values(improved_machine(), plant.values)
    drifted = with_values(improved_machine(), plant.drifted).calibrated(calibrate(SimulatedAxis(own, seed=0)))
    wanted = move_figures(drifted, 0.0, 0.2).load_error_deg_s
    assert rows["hust_improved_as_it_is.move_load_error_deg_s"][0] == wanted


def test_the_hash_knows_what_decides_a_row(made: Made) -> None:
    plain = made()
    assert made().hash == plain.hash
    # A longer campaign goes on with the rows of the shorter one.
    assert made(order=ORDER.replace("count = 8", "count = 80")).hash == plain.hash
    assert made(INERTIA + "[limits]\nmove_load_error_deg_s = [0.1]").hash == plain.hash
    others = [
        made(INERTIA.replace("1.2", "1.3")),
        made(INERTIA.replace("vary.inertia", "vary.load")),
        made(order=ORDER + "\nseed = 1"),
        made(order=ORDER + '\nsampling = "sobol"'),
        made(order=ORDER.replace("load", "motor")),
        made('[set]\n"plant.load.mass_kg" = 1.9e5\n' + INERTIA),
        made(order=ORDER + '\nsampling = "latin_hypercube"'),
        made(order=ORDER.replace("count = 8", "count = 16") + '\nsampling = "latin_hypercube"'),
    ]
    assert len({each.hash for each in (plain, *others)}) == 1 + len(others)
