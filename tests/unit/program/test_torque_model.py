"""Expected torque and eccentric moment, learned from the motor's torque: beside the truth of the virtual gantry."""

from __future__ import annotations

import math
import random
from collections.abc import Iterator
from typing import NamedTuple

import numpy as np
import pytest

from gantryctl.image import InputImage
from gantryctl.machine import default_machine
from gantryctl.program import Axis, AxisProgram
from gantryctl.program.blocks import MoveAbsolute, Power
from gantryctl.program.monitors.torque_model import TorqueModel
from gantryctl.units import deg, rad
from gantryctl.wiring.engine import build_engine
from gantryctl.wiring.simulator import eccentric_moment_nm

MACHINE = default_machine()
RATIO, RATED_NM = 1144.0, MACHINE.motor.torque_rated_nm
SAMPLE_SCANS = 50
"""The service learns from every 50th scan."""


class Sample(NamedTuple):
    pos_rad: float
    vel_rad_s: float
    acc_rad_s2: float
    torque_nm: float


class Tour(AxisProgram):
    """One move after the other at 6 deg/s."""

    def __init__(self, axis: Axis, angles_deg: list[float]) -> None:
        super().__init__(axis)
        self.power, self.move, self.left = Power(axis), MoveAbsolute(axis), angles_deg

    def logic(self, image: InputImage) -> None:
        self.power(enable=True)
        going = self.power.status and bool(self.left) and not self.move.done
        self.move(
            execute=going, position_rad=rad(self.left[0] if self.left else 0.0), velocity_rad_s=rad(6.0)
        )
        if self.move.done:
            self.left.pop(0)


def on_the_gantry(*angles_deg: float) -> list[Sample]:
    """What the controller of the virtual gantry knows of these moves."""
    left = list(angles_deg)
    engine = build_engine(MACHINE, program=lambda axis: Tour(axis, left))
    samples = []
    while left:
        engine.run_for(SAMPLE_SCANS * engine.period_s)
        axis = engine.program.axis
        virtual = axis.virtual
        samples.append(
            Sample(axis.pos_act_rad, virtual.vel_ref_rad_s, virtual.acc_ref_rad_s2, axis.feedback.torque_nm)
        )
    engine.close()
    return samples


@pytest.fixture(scope="module")
def there_and_back() -> list[Sample]:
    return on_the_gantry(90.0, -90.0, 0.0)


def learn(samples: list[Sample], model: TorqueModel | None = None) -> TorqueModel:
    model = model or TorqueModel(RATIO, RATED_NM)
    for sample in samples:
        model.add(*sample)
    return model


def swings(
    seconds: float,
    width_deg: float = 90.0,
    moment_nm: float = 16e3,
    angle_deg: float = 0.0,
    noise_nm: float = 5.0,
) -> Iterator[Sample]:
    """To and fro at 3 deg/s on an axis of known moment, 12 N m of friction and 50 N m s of it per rad/s."""
    noise, angle, direction = random.Random(1), 0.0, 1.0
    for _ in range(round(20 * seconds)):
        angle += direction * 3.0 / 20
        direction = -math.copysign(1.0, angle) if abs(angle) > width_deg else direction
        vel = direction * rad(3.0)
        load = moment_nm / RATIO * math.sin(rad(angle - angle_deg))
        yield Sample(rad(angle), vel, 0.0, load + 12.0 * direction + 50.0 * vel + noise.gauss(0.0, noise_nm))


def test_eccentric_moment_of_the_virtual_gantry(there_and_back: list[Sample]) -> None:
    """The reducer loses a tenth of what it carries (`load_ratio`), and the motor cannot tell that from load: what is
    learned lies between the truth and a tenth above it. The angle is free of that: 5 deg are the waves of the base.
    """
    truth_nm = abs(eccentric_moment_nm(MACHINE))
    moment_nm, angle_rad = learn(there_and_back).eccentric()
    load_ratio = MACHINE.plant.motor_friction.load_ratio
    assert truth_nm * 0.98 < moment_nm < truth_nm * (1.0 + load_ratio)
    assert deg(angle_rad) == pytest.approx(MACHINE.plant.load.eccentric_angle_deg, abs=5.0)


def test_expected_torque_is_that_of_the_next_moves(there_and_back: list[Sample]) -> None:
    """The base rocks and the torque ripples, 5 N m (root of the mean square); a tenth of the load comes on top."""
    model = learn(there_and_back)
    moving = [sample for sample in on_the_gantry(60.0, -30.0) if abs(sample.vel_rad_s) > 0.01]
    errors = [sample.torque_nm - model.expected_nm(*sample[:3]) for sample in moving]
    torques = [sample.torque_nm for sample in moving]
    assert math.hypot(*errors) / math.sqrt(len(errors)) < 5.0 + 0.1 * max(torques)
    assert math.hypot(*errors) < 0.5 * math.hypot(*torques)


def test_one_way_over_a_quarter_turn_teaches_nothing(there_and_back: list[Sample]) -> None:
    """Friction and the cosine cannot be told apart there: nothing is shown rather than something wrong."""
    first = next(i for i, sample in enumerate(there_and_back) if sample.vel_rad_s < 0.0)
    model = learn(there_and_back[:first])
    assert not model.learned
    assert all(math.isnan(value) for value in (*model.eccentric(), model.expected_nm(0.1, 0.1, 0.0)))


def test_moment_angle_and_the_sign_of_friction() -> None:
    """Known numbers and no noise: what is left is the pull of the start towards zero, some thousandths."""
    model = learn(list(swings(300.0, angle_deg=30.0, noise_nm=0.1)))
    moment_nm, angle_rad = model.eccentric()
    assert moment_nm == pytest.approx(16e3, rel=0.01)
    assert deg(angle_rad) == pytest.approx(30.0, abs=0.5)
    vel = rad(3.0)
    level = rad(30.0)  # no load there: what is left is friction, against the motion
    assert model.expected_nm(level, vel, 0.0) == pytest.approx(12.0 + 50.0 * vel, abs=0.2)
    assert model.expected_nm(level, -vel, 0.0) == pytest.approx(-12.0 - 50.0 * vel, abs=0.2)
    assert model.expected_nm(level, 0.0, 0.0) == pytest.approx(0.0, abs=0.2)


def test_hours_at_standstill_change_nothing(there_and_back: list[Sample]) -> None:
    model = learn(there_and_back)
    before = model.eccentric(), model.expected_nm(0.3, 0.0, 0.0)
    for _ in range(20 * 3600):
        model.add(0.3, 0.0, 0.0, 100.0)
    assert (model.eccentric(), model.expected_nm(0.3, 0.0, 0.0)) == before


def test_an_hour_of_small_motions_neither_forgets_nor_blows_up() -> None:
    """Within 5 deg and at one speed most directions are not excited. 10 %: noise of 5 N m on 14 N m, averaged."""
    model = learn(list(swings(300.0)))
    for sample in swings(3600.0, width_deg=5.0):
        model.add(*sample)
    moment_nm, angle_rad = model.eccentric()
    assert moment_nm == pytest.approx(16e3, rel=0.1)
    assert deg(angle_rad) == pytest.approx(0.0, abs=5.0)
    assert model.expected_nm(0.0, rad(3.0), 0.0) == pytest.approx(14.6, abs=1.5)


def test_another_load_is_learned_within_minutes() -> None:
    model = learn(list(swings(300.0)))
    moment_nm, angle_rad = learn(list(swings(900.0, moment_nm=8e3, angle_deg=40.0)), model).eccentric()
    assert moment_nm == pytest.approx(8e3, rel=0.1)
    assert deg(angle_rad) == pytest.approx(40.0, abs=5.0)


def test_a_balanced_gantry_has_no_angle() -> None:
    moment_nm, angle_rad = learn(list(swings(300.0, moment_nm=0.0))).eccentric()
    assert moment_nm < 1e3
    assert math.isnan(angle_rad)


@pytest.mark.parametrize("bad", [math.nan, math.inf, -math.inf])
@pytest.mark.parametrize("field", Sample._fields)
def test_what_is_no_number_is_not_learned(field: str, bad: float) -> None:
    model = learn(list(swings(300.0)))
    before = model.eccentric()
    model.add(*Sample(0.1, 0.1, 0.0, 10.0)._replace(**{field: bad}))
    assert model.eccentric() == before


def test_a_load_is_known_after_a_hundred_samples_that_agree() -> None:
    """A machine that needs no torque at all, to and fro."""
    model = TorqueModel(1144.0, 257.0)
    for sample in range(1, 101):
        model.add(rad(3.0 * sample), rad(3.0 if sample % 2 else -3.0), 0.0, 0.0)
        assert model.learned is (sample == 100)


def test_the_weights_are_those_of_least_squares_that_forget() -> None:
    """Beside the information form, which inverts what the recursion carries along: each reading adds x x' of weight 1,
    and between readings the variance of a weight grows by 5e-7 below its bound (0.01 of sine and cosine, 100 of
    the others). The two differ by rounding alone.
    """
    model, bounds = TorqueModel(RATIO, RATED_NM), np.array([0.01, 0.01, 100.0, 100.0, 100.0])
    cov, weights = 100.0 * np.eye(5), np.zeros(5)
    for pos, vel, _, torque in swings(60.0):
        acc = 2e-3 * math.sin(3.0 * pos)
        model.add(pos, vel, acc, torque)
        x = np.array([math.sin(pos), math.cos(pos), math.copysign(1.0, vel), vel / 0.1, acc / 1e-3])
        information = np.linalg.inv(cov)
        cov = np.linalg.inv(information + np.outer(x, x))
        weights = cov @ (information @ weights + x * torque)
        cov += np.diag(np.where(np.diag(cov) < bounds, 5e-7, 0.0))
    assert model.learned
    assert model.weights == pytest.approx(weights, rel=1e-6)


@pytest.mark.parametrize(("angle_deg", "missing"), [(0.0, "sine"), (90.0, "cosine")])
def test_a_load_of_which_one_part_was_not_seen_is_not_known(angle_deg: float, missing: str) -> None:
    """1 deg to and fro: at 0 deg the sine is hardly seen, at 90 deg the cosine; the other one soon is."""
    model = TorqueModel(RATIO, RATED_NM)
    for sample in swings(20.0, width_deg=1.0, moment_nm=0.0):
        model.add(sample.pos_rad + rad(angle_deg), *sample[1:])
    assert not model.learned
    assert model._cov[0][0] > model._cov[1][1] if missing == "sine" else model._cov[1][1] > model._cov[0][0]


@pytest.mark.parametrize("place", range(4))
def test_a_sample_that_is_no_number_teaches_nothing(place: int) -> None:
    """Angle, speed, acceleration or torque: one of them would make every weight no number, for good."""
    model = TorqueModel(RATIO, RATED_NM)
    sample = [0.5, rad(3.0), 0.0, 12.0]
    model.add(*sample)
    before = list(model._weights)
    sample[place] = math.nan if place != 1 else math.inf
    model.add(*sample)
    assert model._weights == before


@pytest.mark.parametrize("by_deg", [90.0, -37.0, 180.0, 400.0])
def test_a_new_zero_turns_what_was_learned_to_the_same_places(
    there_and_back: list[Sample], by_deg: float
) -> None:
    """As if it had been learned with the new zero, also what a further sample teaches.

    Within 0.02 N m: what may wander is added to sine and cosine by themselves, whichever these are.
    """
    old, new = TorqueModel(RATIO, RATED_NM), TorqueModel(RATIO, RATED_NM)
    for pos, vel, acc, torque in there_and_back:
        old.add(pos, vel, acc, torque)
        new.add(pos + math.radians(by_deg), vel, acc, torque)
    old.turn(math.radians(by_deg))
    assert old.weights == pytest.approx(new.weights, abs=0.02)
    for model in (old, new):
        model.add(0.3, 0.05, 0.001, 50.0)
    assert old.weights == pytest.approx(new.weights, abs=0.02)
    assert old.expected_nm(0.4, 0.05, 0.0) == pytest.approx(new.expected_nm(0.4, 0.05, 0.0), abs=0.02)


@pytest.mark.parametrize(("share", "told"), [(0.011, True), (0.009, False)])
def test_the_angle_of_a_moment_is_told_from_a_hundredth_of_the_rated_torque_on(
    share: float, told: bool
) -> None:
    model = TorqueModel(RATIO, 257.0)
    model.restore([0.0, -share * 257.0, 0.0, 0.0, 0.0])
    moment_nm, angle_rad = model.eccentric()
    assert moment_nm == pytest.approx(share * 257.0 * RATIO)
    assert math.isnan(angle_rad) is not told
    assert not told or deg(angle_rad) == pytest.approx(90.0)


@pytest.mark.parametrize(("in_wind", "kept"), [(True, 5), (False, 6)])
def test_weights_of_still_air_and_of_wind_are_not_those_of_the_other_model(in_wind: bool, kept: int) -> None:
    """Wind was given to the machine file, or taken from it, since they were learned."""
    model = TorqueModel(RATIO, RATED_NM, in_wind=in_wind)
    model.restore([30.0] * kept)
    assert not model.learned
    assert math.isnan(model.expected_nm(0.5, 0.1, 0.0))
    model.restore([30.0] * (11 - kept))
    assert model.learned
