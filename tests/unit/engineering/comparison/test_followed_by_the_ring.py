"""What an encoder on the ring shows of a machine that has changed, and what it cannot show: on the whole plant."""

from __future__ import annotations

import math

import numpy as np
import pytest

from gantryctl import _core
from gantryctl.engineering.batch import ClosedLoop, Log
from gantryctl.engineering.comparison.variants import backlash_followed, moment_followed
from gantryctl.machine import Machine, with_values
from gantryctl.motion import SetPoint, hold, plan_move
from gantryctl.units import deg, rad
from gantryctl.wiring.compensation import compensation
from gantryctl.wiring.program import motion_limits, position_law
from gantryctl.wiring.simulator import gantry_sim
from support.improved import improved_machine

REST_S = 4.0


def followed() -> Machine:
    return backlash_followed(moment_followed(improved_machine()))


class Run:
    """The compiled loop of a machine that stands at 0 deg, and its laws."""

    def __init__(self, machine: Machine) -> None:
        laws = compensation(machine)
        assert laws is not None
        self.laws = laws
        self.loop = ClosedLoop.standing_at(gantry_sim(machine), position_law(machine), 0.0, laws)


def moved(machine: Machine, *places_deg: float) -> tuple[_core.Compensation, list[Log]]:
    """Moves from 0 deg with a rest after each; the laws, and the logs of the rests."""
    run, at, rests = Run(machine), 0.0, []
    for place in map(rad, places_deg):
        plan = plan_move(SetPoint(at, 0.0, 0.0), place, motion_limits(machine))
        run.loop.run(plan, plan.duration + 0.01)
        rests.append(run.loop.run(hold(place), REST_S))
        at = place
    return run.laws, rests


def gap_mm(machine: Machine, change_rad: float) -> float:
    return change_rad * machine.plant.gear_error.ring_radius_m * 1e3


@pytest.mark.parametrize("more_mm", [0.0, 0.15])
def test_the_gap_is_found_by_some_moves_and_no_wider_one_is_believed(more_mm: float) -> None:
    """The delivered calibration knows 0.05 mm. In use is what is sure: three standard deviations less,
    some 0.03 mm of the waves that no map has.
    """
    machine = followed()
    wider = with_values(machine, {"plant.transmission.backlash_mm": 0.05 + more_mm})
    laws, _ = moved(wider, 110.0, -110.0, 110.0, -110.0)
    assert gap_mm(machine, laws.backlash_change_rad) == pytest.approx(more_mm, abs=0.04)


def test_a_change_of_the_gap_in_use_moves_nothing() -> None:
    """The same axis with a limit that permits no change has the same motion until the next move begins."""
    machine = with_values(followed(), {"plant.transmission.backlash_mm": 0.2})
    assert machine.calibration is not None
    limit = {"control.compensation.backlash_observer.limit_deg": deg(machine.calibration.backlash_held_rad)}
    runs = [Run(machine), Run(with_values(machine, limit))]
    at = 0.0
    for place in map(rad, (110.0, -110.0, 110.0)):
        plan = plan_move(SetPoint(at, 0.0, 0.0), place, motion_limits(machine))
        legs = [(run.loop.run(plan, plan.duration + 0.1), run.loop.run(hold(place), REST_S)) for run in runs]
        for name in ("vel_cmd_rad_s", "pos_motor_rad", "pos_load_rad"):
            for own, other in zip(*legs, strict=True):
                # Rounding of angles of 2000 rad at the motor, times Kpp.
                assert np.max(np.abs(own[name] - other[name])) < 1e-9, name
        at = place
        if runs[0].laws.backlash_change_rad > 1e-5:
            break
    assert runs[0].laws.backlash_change_rad > 1e-5
    assert abs(runs[1].laws.backlash_change_rad) < 1e-9


def test_the_lean_of_the_base_under_another_moment_is_taken_off_the_ring() -> None:
    """Reversed, 16 kN m lean the base by 14 urad the other way: 28 urad, 0.0016 deg, which no encoder on it sees."""
    reversed_nm = {"plant.load.eccentric_sign": 1.0}
    places = (110.0, -110.0, 90.0)
    errors = {}
    for name, machine in (
        ("calibrated", moment_followed(improved_machine(), followed=False)),
        ("followed", followed()),
    ):
        _, rests = moved(with_values(machine, reversed_nm), *places)
        errors[name] = abs(math.degrees(float(np.mean(rests[-1]["pos_load_rad"][-1000:])) - rad(90.0)))
    assert errors["calibrated"] == pytest.approx(0.0016, abs=0.0003)
    # The limit of 30 of 32 kN m, and what the observer has not learnt after three moves.
    assert errors["followed"] < 0.0004
