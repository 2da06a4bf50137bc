"""Experiments on several plants at once: each has the bits that it has alone, and one that fails stops no other."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

from gantryctl.engineering.batch import ClosedLoop, Leg, Runner, alone, expected, in_lockstep, log_legs
from gantryctl.machine import default_machine, with_values
from gantryctl.motion import SetPoint, hold, plan_move
from gantryctl.units import rad
from gantryctl.wiring.program import motion_limits, position_law
from gantryctl.wiring.simulator import gantry_sim

COLUMNS = ("pos_load_rad", "torque_act_nm")


def loop(friction_nm: float = 5.5) -> ClosedLoop:
    machine = with_values(default_machine(), {"plant.motor_friction.coulomb_nm": friction_nm})
    return ClosedLoop.standing_at(gantry_sim(machine), position_law(machine), 0.0)


def leg(to_deg: float, duration_s: float) -> Leg:
    return Leg(plan_move(SetPoint(0.0, 0.0, 0.0), rad(to_deg), motion_limits(default_machine())), duration_s)


def wandering(plant: int) -> Callable[[Runner], np.ndarray]:
    """Runs whose number, length and direction depend on what was seen before."""

    def experiment(run: Runner) -> np.ndarray:
        axis, seen = loop(4.5 + 0.1 * plant), []
        for k in range(2 + plant % 3):
            log = run(axis, [leg(0.1 * (plant + 1), 0.2 * (k + 1)), leg(-0.1, 0.1)], COLUMNS)
            seen.append(np.concatenate([log[name] for name in COLUMNS]))
            if log["torque_act_nm"][-1] > 0.0:
                seen.append(run(axis, [leg(0.0, 0.05)], COLUMNS[:1])["pos_load_rad"])
        return np.concatenate(seen)

    return experiment


def test_each_has_the_bits_that_it_has_alone() -> None:
    experiments = [wandering(plant) for plant in range(19)]  # more than go at once
    together = expected(in_lockstep(experiments))
    assert [each.tobytes() for each in together] == [
        experiment(alone).tobytes() for experiment in experiments
    ]
    assert len({len(each) for each in together}) > 2


def test_a_log_is_that_of_the_closed_loop() -> None:
    """The same columns by the loop that keeps all of them, with a plan that has begun and a signal on the command."""
    begun = Leg(leg(1.0, 1.0).plan, 1.5, passed_scans=1000)
    first, second = log_legs(
        [loop(), loop()], [[leg(1.0, 1.0), begun], [leg(1.0, 1.0), leg(0.5, 1.5)]], COLUMNS
    )
    whole = loop().run(leg(1.0, 1.0).plan, 2.5)
    for name in COLUMNS:
        assert first[name].tobytes() == whole[name].tobytes()
    assert len(second) == 2500
    assert second["pos_load_rad"].tobytes() != first["pos_load_rad"].tobytes()


def test_what_is_added_to_the_command_is_what_a_program_would_add() -> None:
    """Scan by scan through the calls of a program: law, its command and the signal over and over, drive and plant."""
    signal = [20.0] * 10 + [0.0] * 10
    pulses = Leg(hold(0.0), 0.2, added_rad_s=signal)
    columns = ("vel_cmd_rad_s", "vel_report_rad_s", "torque_act_nm", "pos_err_rad")
    log, _ = log_legs([loop(), loop()], [[pulses], [Leg(hold(0.0), 0.2)]], columns)
    axis, rows = loop(), []
    for k in range(200):
        counts, speed, torque, *_ = axis.sim.feedback(axis.law.rad_per_count)
        command, _, error = axis.law.scan(0.0, 0.0, counts - axis.zero_counts)
        rows.append((command, speed, torque, error))
        axis.sim.scan(1, command + signal[k % 20], 0.0, True)
    for name, wanted in zip(columns, np.array(rows).T, strict=True):
        assert log[name].tobytes() == wanted.tobytes(), name
    assert np.abs(log["torque_act_nm"]).max() > 100.0


def test_an_experiment_that_fails_is_an_exception_in_its_place() -> None:
    def fails(run: Runner) -> np.ndarray:
        run(loop(), [leg(0.1, 0.1)], COLUMNS)
        raise ArithmeticError("no figure")

    good, bad, other = in_lockstep([wandering(0), fails, wandering(2)])
    assert isinstance(bad, ArithmeticError)
    assert isinstance(good, np.ndarray)
    assert isinstance(other, np.ndarray)
    assert good.tobytes() == wandering(0)(alone).tobytes()
    with pytest.raises(ArithmeticError, match="no figure"):
        expected([good, bad, other])


def test_a_run_that_the_core_refuses_comes_back_to_those_who_asked() -> None:
    """Whoever computes the runs of all must not leave the others waiting without end."""
    axis = loop()

    def refused(run: Runner) -> None:
        run(axis, [leg(0.1, 0.1)], COLUMNS)  # the same plant for two of them

    def fine(run: Runner) -> int:
        return len(run(loop(), [leg(0.1, 0.5)], COLUMNS)) + len(run(loop(), [leg(0.1, 0.5)], COLUMNS))

    first, second, third = in_lockstep([refused, refused, fine])
    assert isinstance(first, ValueError)
    assert isinstance(second, ValueError)
    assert third == 1000


def test_only_one_experiment_works_at_a_time() -> None:
    at_work: list[int] = []

    def experiment(number: int) -> Callable[[Runner], bool]:
        def work(run: Runner) -> bool:
            ok = True
            for _ in range(3):
                at_work.append(number)
                total = sum(k * k for k in range(20_000))  # long enough for another thread to be let in
                ok = ok and total > 0 and at_work[-1] == number
                run(loop(), [leg(0.1, 0.01)], COLUMNS)
            return ok

        return work

    assert expected(in_lockstep([experiment(k) for k in range(4)])) == [True] * 4
