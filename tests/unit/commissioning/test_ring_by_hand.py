"""The ring against the motor by hand: each way has its own ratio, and what is left after both is slip."""

from __future__ import annotations

import math
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from gantryctl.commissioning.load_side.ring import (
    BothEncoders,
    _judged,
    _Standing,
    _standing,
    over_the_travel,
    zero_proposed,
)
from gantryctl.commissioning.results import Outcome
from gantryctl.drives.canopen.nodes.ring_encoder import RingAngle
from gantryctl.drives.canopen.settings import LoadEncoderSettings
from gantryctl.machine import with_values
from unit.commissioning.hand_drive import MACHINE, HandDrive, axis_of

RING = with_values(MACHINE, {"can.load_encoder.source": "node", "can.load_encoder.node": 4})


def test_each_way_has_its_own_ratio() -> None:
    """Motor 0, 10, 0 deg; ring 0, 10, 5 deg: 1 forward, 0.5 back, 5 deg of slip."""
    found = _judged(MACHINE, _Standing(0.0, 0.0), _Standing(10.0, 10.0), _Standing(0.0, 5.0))
    names = ("ratio_forward", "ratio_back", "slip_deg")
    assert [found.number(name) for name in names] == pytest.approx([1.0, 0.5, 5.0])


@pytest.mark.parametrize("side", [1.0, -1.0])
def test_a_ring_on_the_other_side_of_its_half_turn_stands_where_the_motor_does(side: float) -> None:
    """Motor at 179.99 deg, ring at -179.99: 0.02 deg apart, and no turn."""
    motor, ring = (side * deg for deg in (179.99, -179.99))
    found = _judged(RING, *(_Standing(motor + way, ring + way) for way in (0.0, -1.5 * side, 0.0)))
    assert found.number("apart_deg") == pytest.approx(0.02 * side)
    assert found.outcome is Outcome.PASSED


@pytest.mark.parametrize("inverted", [False, True])
def test_with_the_proposed_zero_the_ring_shows_what_the_motor_shows(inverted: bool) -> None:
    """At 12 deg by the motor, whichever way the ring counts."""
    raw, turn = 123_456, 1 << 20
    was = LoadEncoderSettings(4, turn, 1000, inverted)

    def shown(settings: LoadEncoderSettings) -> float:
        angle = RingAngle(settings, turn, 0.004)
        angle.take(raw, 1)
        return math.degrees(angle.after(0))

    changes = {"counts_per_turn": turn, "zero_counts": was.zero_counts, "inverted": inverted}
    machine = with_values(RING, {f"can.load_encoder.{name}": value for name, value in changes.items()})
    zero = zero_proposed(machine, math.remainder(shown(was) - 12.0, 360.0))
    # Half a step of 2^20.
    assert shown(was._replace(zero_counts=zero)) == pytest.approx(12.0, abs=180.0 / turn)


def test_how_far_both_are_apart_is_seen_before_anything_turns() -> None:
    """0.02 deg at the start, 0.05 deg 10 deg further on, 0.03 deg back again."""
    found = _judged(MACHINE, _Standing(0.0, 0.02), _Standing(10.0, 10.05), _Standing(0.0, 0.03))
    assert found.number("apart_deg") == pytest.approx(0.02)


@pytest.mark.parametrize("start_deg", [90.0, -90.0])
def test_the_motor_stands_where_it_was_and_as_far_as_it_has_turned(start_deg: float) -> None:
    drive = HandDrive()
    drive.deg = -7.0  # whatever its counts are
    axis = axis_of(drive, start_deg=start_deg)
    axis.enable()
    drive.spoil = lambda seen: seen._replace(pos_ring_rad=math.radians(start_deg + 0.4))
    drive.deg += 0.3
    axis._begun_deg = axis.angle_deg + 0.3
    assert _standing(axis) == pytest.approx((start_deg + 0.3, start_deg + 0.4), abs=1e-6)


def travel() -> tuple[Any, Any, Any]:
    """Motor, ring and way: the ring 0.01 deg ahead, 50 ppm longer, 0.004 deg further forward than back."""
    there = np.linspace(-170.0, 170.0, 35)
    motor = np.concatenate((there, there[::-1]))
    forward = np.arange(70) < 35
    return motor, motor * (1.0 + 50e-6) + 0.01 + np.where(forward, 0.002, -0.002), forward


def test_over_the_travel_offset_scale_and_reversal_are_told_apart() -> None:
    text, figures = over_the_travel(MACHINE, *travel())
    assert figures["ring_offset_deg"].value == pytest.approx(0.01)
    assert figures["ring_reversal_deg"].value == pytest.approx(0.004)
    assert figures["ring_most_apart_deg"].value == pytest.approx(0.01 + 170.0 * 50e-6 + 0.002)
    assert "ring minus motor +0.0100 deg, +50 ppm of the angle, +0.0040 deg between both ways" in text
    # 0.01 deg of 67 108 864 increments in a turn.
    assert figures["ring_zero_proposed_counts"].value == 1864
    assert text.endswith("zero_counts = 1864 is proposed")


@pytest.mark.parametrize(("sign", "within"), [(1.0, 0.25), (-1.0, 0.25), (1.0, 0.26), (-1.0, 0.26)])
def test_a_ring_may_be_as_far_behind_the_motor_as_ahead(sign: float, within: float) -> None:
    """0.255 deg both ways, all along the travel."""
    machine = with_values(MACHINE, {"control.compensation.load_encoder.disagreement_deg": within})
    motor, _, forward = travel()
    most = over_the_travel(machine, motor, motor + sign * 0.255, forward)[1]["ring_most_apart_deg"]
    assert most.value == pytest.approx(0.255)
    assert most.within is (within > 0.255)


def test_a_ring_without_an_angle_on_the_way_has_shown_nothing() -> None:
    motor, ring, forward = travel()
    ring[7] = math.nan
    text, figures = over_the_travel(MACHINE, motor, ring, forward)
    assert text == "; the ring shows no angle on the way"
    assert {name: figure.within for name, figure in figures.items()} == {"ring_most_apart_deg": False}


def test_only_constant_speed_is_compared_over_the_travel() -> None:
    """What lies between both encoders in a ramp, or at rest, is no part of it."""
    motor, ring, forward = travel()
    image = SimpleNamespace(drive=SimpleNamespace(pos_ring_rad=0.0))
    axis = SimpleNamespace(pos_act_rad=0.0, virtual=SimpleNamespace(vel_ref_rad_s=0.0))
    run: Any = SimpleNamespace(machine=MACHINE, axis=axis, engine=SimpleNamespace(image=image))
    encoders = BothEncoders(run)
    rows = [(m, r, 0.05 if f else -0.05) for m, r, f in zip(motor, ring, forward, strict=True)]
    for motor_deg, ring_deg, vel in [(-175.0, -150.0, 0.0), *rows, (-175.0, -150.0, -0.02)]:
        axis.pos_act_rad, axis.virtual.vel_ref_rad_s = math.radians(motor_deg), vel
        image.drive.pos_ring_rad = math.radians(ring_deg)
        encoders.look()
    figures = encoders.compared()[1]
    assert figures["ring_reversal_deg"].value == pytest.approx(0.004)
    assert figures["ring_most_apart_deg"].value == pytest.approx(0.0205)


@pytest.mark.parametrize(
    ("ring_deg", "passes", "words"),
    [
        ((10.0, 11.5, 10.0), True, "is proposed"),
        ((370.0, 371.5, 370.0), True, "is proposed"),
        ((10.0, 8.5, 10.0), False, "inverted"),
        ((10.0, 11.535, 10.0), False, "counts_per_turn"),
        ((10.0, 11.45, 10.0), False, "counts_per_turn"),
        # Forward only; slip to either side; a zero that is off to either side by more than 0.025 deg.
        ((10.0, 11.5, 11.5), False, "counts_per_turn"),
        ((10.0, 11.5, 13.0), False, "counts_per_turn"),
        ((10.0, 11.51, 10.02), False, "counts_per_turn"),
        ((10.0, 11.49, 9.98), False, "counts_per_turn"),
        ((10.03, 11.53, 10.03), False, "is proposed"),
        ((9.97, 11.47, 9.97), False, "is proposed"),
        ((10.0, math.nan, 10.0), False, "counts_per_turn"),
    ],
)
def test_the_ring_turns_with_the_motor(
    ring_deg: tuple[float, float, float], passes: bool, words: str
) -> None:
    motor = (10.0, 11.5, 10.0)
    found = _judged(RING, *(_Standing(m, r) for m, r in zip(motor, ring_deg, strict=True)))
    assert (found.outcome is Outcome.PASSED) is passes
    assert passes or words in found.to_do


def test_the_proposed_zero_takes_the_difference_out() -> None:
    """The ring shows 0.9 deg more than the motor: its zero lies 0.0025 of a turn higher."""
    machine = with_values(RING, {"can.load_encoder.zero_counts": 1000})
    assert zero_proposed(machine, 0.9) == 1000 + round(0.0025 * RING.can.load_encoder.counts_per_turn)
