"""A new reference by hand: where the encoder would wrap, what a count is worth, and when none is taken.

Ten turns of the motor are one of the gantry; the encoder has 1000 counts a turn and 20 turns, 720 deg of the gantry.
"""

from __future__ import annotations

import math
from types import SimpleNamespace
from typing import Any

import pytest

from gantryctl.program.alarms.codes import Code
from gantryctl.program.axis.reference import Reference
from gantryctl.program.settings import TravelSettings
from gantryctl.units import rad

CREEP_DEG_S = 0.1


def reference(
    raw_deg: float,
    vel_deg_s: float = 0.0,
    *,
    valid: bool = True,
    lead_deg: float | None = None,
    margin_deg: float = 5.0,
) -> Reference:
    """Of an axis of +-180 deg whose encoder stands so far from its own zero, at the gantry."""
    law = SimpleNamespace(ratio=10.0, counts_per_turn=1000, turns=20, wrap_margin_rad=rad(margin_deg))
    travel = TravelSettings(rad(-180.0), rad(180.0), rad(-190.0), rad(190.0))
    settings: Any = SimpleNamespace(
        travel=travel, law=law, speed=SimpleNamespace(creep_rad_s=rad(CREEP_DEG_S))
    )
    feedback: Any = SimpleNamespace(
        counts=raw_deg / 36.0 * 1000.0, vel_rad_s=rad(vel_deg_s), position_valid=valid
    )
    side: Any = SimpleNamespace(new_reference=lambda pos: pos + rad(lead_deg or 0.0))
    return Reference(settings, feedback, None if lead_deg is None else side)


@pytest.mark.parametrize(
    ("position_deg", "raw_deg", "taken"),
    # 180 deg to either end, and 5 deg more before the encoder begins anew at 0 or at 720 deg.
    [
        (0.0, 184.9, False), (0.0, 185.1, True), (0.0, 534.9, True), (0.0, 535.1, False),
        (90.0, 274.9, False), (90.0, 275.1, True), (90.0, 624.9, True), (90.0, 625.1, False),
        (-180.0, 4.9, False), (-180.0, 5.1, True), (180.0, 714.9, True), (180.0, 715.1, False),
    ],
)  # fmt: skip
def test_the_encoder_may_not_wrap_within_5_deg_of_the_travel(
    position_deg: float, raw_deg: float, taken: bool
) -> None:
    assert (reference(raw_deg).check(rad(position_deg), standing=True) is None) is taken


@pytest.mark.parametrize(("raw_deg", "taken"), [(189.9, False), (190.1, True), (529.9, True), (530.1, False)])
def test_the_margin_to_the_wrap_is_that_of_the_machine(raw_deg: float, taken: bool) -> None:
    assert (reference(raw_deg, margin_deg=10.0).check(0.0, standing=True) is None) is taken


@pytest.mark.parametrize(
    ("position_deg", "code"),
    [(180.1, Code.CTL_01), (-180.1, Code.CTL_01), (math.nan, Code.CTL_01), (180.0, None), (-180.0, None)],
)
def test_a_reference_lies_within_the_travel(position_deg: float, code: Code | None) -> None:
    # The middle of the encoder is at 0 deg.
    raw_deg = 360.0 + (position_deg if math.isfinite(position_deg) else 0.0)
    refused = reference(raw_deg).check(rad(position_deg), standing=True)
    assert (None if refused is None else refused.code) is code


@pytest.mark.parametrize(
    ("vel_deg_s", "valid", "standing", "taken"),
    [
        (0.0, True, True, True), (0.0, True, False, False), (0.0, False, True, False),
        (0.0999, True, True, True), (-0.0999, True, True, True), (0.1001, True, True, False),
        (-0.1001, True, True, False), (math.nan, True, True, False),
    ],
)  # fmt: skip
def test_a_reference_is_taken_of_an_axis_that_stands_and_is_believed(
    vel_deg_s: float, valid: bool, standing: bool, taken: bool
) -> None:
    assert (reference(360.0, vel_deg_s, valid=valid).check(0.0, standing) is None) is taken


@pytest.mark.parametrize(
    ("position_deg", "lead_deg", "zero"),
    # 1000 counts are 36 deg: at 36 deg the zero lies 1000 counts lower. With a lead of 3.6 deg the motor stands at
    # 39.6 deg, 100 counts more.
    [(36.0, None, 9000.0), (-36.0, None, 11000.0), (0.0, None, 10000.0), (36.0, 3.6, 8900.0), (36.0, -3.6, 9100.0)],
)  # fmt: skip
def test_the_zero_lies_where_the_motor_would_stand_at_0_deg(
    position_deg: float, lead_deg: float | None, zero: float
) -> None:
    assert reference(360.0, lead_deg=lead_deg).zero_counts(rad(position_deg)) == pytest.approx(zero)
