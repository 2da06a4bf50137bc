"""Rules of a draft by hand: each on a basis of the few numbers that it needs."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from gantryctl.engineering.accuracy.procedure.procedures import chord_procedure
from gantryctl.engineering.drafting import choice, open_items, plant
from gantryctl.engineering.drafting.draft import _accuracy
from gantryctl.engineering.drafting.gains import DraftGains
from gantryctl.engineering.drafting.gear_errors import graded_values
from gantryctl.engineering.drafting.loops import following_error_deg
from gantryctl.engineering.drafting.origin import Drafted, Origin
from gantryctl.engineering.drafting.plant import _encoder
from gantryctl.engineering.drafting.sheets import Answered, _from, sheet_values
from gantryctl.engineering.drafting.templates import load_template
from gantryctl.machine import Machine, default_machine
from gantryctl.machine.rules.reaction import REACTION_S


def test_a_draft_dwells_for_twelve_swings_and_averages_the_last_four() -> None:
    """Of a mode of 2 Hz 6 and 2 s."""
    sheet = SimpleNamespace(
        structure=SimpleNamespace(first_mode_hz=2.0),
        required=SimpleNamespace(angle_deg=0.1),
        teeth=SimpleNamespace(ring_radius_m=2.4),
    )
    basis: Any = SimpleNamespace(sheet=sheet)
    found = _accuracy(basis)
    assert (found["accuracy.dwell_s"].value, found["accuracy.average_s"].value) == (6.0, 2.0)


@pytest.mark.parametrize(("stiff", "taken"), [(3.0, 3.0), (None, 1.0)])
def test_of_motors_whose_loop_is_too_soft_the_smallest_is_drafted(
    monkeypatch: pytest.MonkeyPatch, stiff: float | None, taken: float
) -> None:
    """1, 2 and 3 kW fit, in any order: the first that is stiff enough, and the smallest where none is."""

    def drafted(fitted: Any, name: str) -> Any:
        power_kw = fitted.motor.motor.power_rated_kw
        return SimpleNamespace(
            power_kw=power_kw, machine=lambda: None, soft_loop=None if power_kw == stiff else "soft"
        )

    monkeypatch.setattr(choice, "fit", lambda _, motor: SimpleNamespace(fits=True, motor=motor))
    monkeypatch.setattr(choice, "draft", drafted)
    monkeypatch.setattr(choice, "check_quick_stop", lambda _: None)
    motors: Any = [
        SimpleNamespace(name=f"{power_kw} kW", motor=SimpleNamespace(power_rated_kw=power_kw))
        for power_kw in (2.0, 3.0, 1.0)
    ]
    sheet: Any = None
    made: Any = choice.draft_with(sheet, motors, "axis")
    assert made.power_kw == taken


def test_the_middle_of_an_encoder_lies_at_the_middle_of_a_travel_that_is_not_centred() -> None:
    """0 to 360 deg behind 1000: 500 turns to the middle, so that 2048 of 4096 lie there."""
    basis: Any = SimpleNamespace(
        ratio=1000.0,
        motor=SimpleNamespace(encoder=SimpleNamespace(turns=4096)),
        sheet=SimpleNamespace(
            range=SimpleNamespace(kind="linear", pos_min_deg=0.0, pos_max_deg=360.0),
            sheet=SimpleNamespace(name="a"),
        ),
    )
    assert _encoder(basis)["encoder.mounting_turns"].value == 1548


def test_a_pinion_is_a_grade_better_than_its_ring() -> None:
    """Module 10 mm and 200 mm: F_p = (0.3 x 10 + 1.25 sqrt(200) + 7) x 2 for grade 7; half of 0.8 of it are 22.1 um."""
    basis: Any = SimpleNamespace(
        module_m=0.01,
        sheet=SimpleNamespace(
            teeth=SimpleNamespace(ring_radius_m=1.0),
            gears=SimpleNamespace(ring_ratio=10.0),
            sheet=SimpleNamespace(name="a"),
        ),
    )
    assert graded_values(basis, 8.0)["plant.gear_error.pinion_1x_um"].value == 22.1


def test_what_follows_of_an_answer_and_a_guess_is_a_guess() -> None:
    answered: Any = SimpleNamespace(given=frozenset({"unbalance_nm", "wind_nm"}))
    assert _from(answered, 1.0, "", "unbalance_nm", "wind_nm").origin is Origin.COMPUTED
    assert _from(answered, 1.0, "", "unbalance_nm", "inertia_kg_m2").origin is Origin.GUESS


@pytest.mark.parametrize(("move", "release"), [(10.0, 2.0), (2.0, 10.0)])
def test_the_larger_jerk_makes_the_following_error(move: float, release: float) -> None:
    """Js Tvi j / (Kpp Kvp) = 1.9 x 0.01 x 10 / 777 deg, of a move or of a key that is let go."""
    basis: Any = SimpleNamespace(
        jerk_deg_s3=move, release_jerk_deg_s3=release, reversal_torque_nm=0.0, ratio=1144.0,
        train=SimpleNamespace(inertia_kg_m2=1.9),
    )  # fmt: skip
    assert following_error_deg(basis, DraftGains(77.7, 0.01, 10.0)) == pytest.approx(2.445e-4, rel=1e-3)


def test_the_brake_that_a_reducer_bears_lies_on_the_line_through_two_brakes(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """400 N m put 44 kN m on 35.2, half of it 24: 0.1 kN m for each, so 8.8 kN m less are 312 N m."""

    def stopped(machine: Machine, *_: object) -> Any:
        return SimpleNamespace(torque_reducer_nm=4000.0 + 100.0 * machine.plant.brake.torque_share * 400.0)

    monkeypatch.setattr(open_items, "worst_stop", stopped)
    found = open_items.brake_overload(default_machine())
    assert found is not None
    assert found.torque_nm == pytest.approx(44_000.0)
    assert found.brake_within_nm == pytest.approx(312.0)


def test_an_answer_is_no_guess_and_what_nobody_answered_is_one() -> None:
    answered = Answered.of(load_template("gantry"), {"first_mode_hz": 2.5})
    values = sheet_values(answered, "axis")
    assert values["structure.first_mode_hz"] == Drafted(2.5, Origin.SHEET, "answered")
    assert values["load.inertia_kg_m2"].origin is Origin.GUESS
    assert "structure.first_mode_hz" not in values["sheet.guesses"].value


def test_what_gears_of_a_grade_keep_is_kept_by_ninety_five_of_a_hundred(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """0.001 to 0.101 deg in steps of 0.001: 95 of the hundred steps lie below 0.096."""
    monkeypatch.setattr(open_items, "errors_from_points", lambda *_: None)
    monkeypatch.setattr(open_items, "accuracy_a", lambda _: np.arange(1.0, 102.0) / 1000.0)
    assert open_items._kept_deg(chord_procedure("A"), np.zeros((1, 1))) == pytest.approx(0.096)


def test_backlash_is_a_share_of_the_module_in_mm(monkeypatch: pytest.MonkeyPatch) -> None:
    """2 % of a module of 5 mm are 0.1 mm."""
    monkeypatch.setattr(plant, "_followed_length_rad", lambda _: 0.0)
    basis: Any = SimpleNamespace(
        sheet=SimpleNamespace(
            gears=SimpleNamespace(ring_ratio=10.0, torque_rated_nm=100.0),
            teeth=SimpleNamespace(backlash_ratio=0.02),
        ),
        stiffness_nm_per_rad=1e6,
        base_stiffness_nm_per_rad=1e7,
        module_m=0.005,
        follows=lambda value, *_: Drafted(value, Origin.COMPUTED),
        of_sheet=lambda _: Drafted(0.0, Origin.SHEET),
    )
    assert plant._transmission(basis)["transmission.backlash_mm"].value == pytest.approx(0.1)


def test_a_quick_stop_has_what_the_reaction_leaves_of_its_way() -> None:
    """0.1 rad/s, 0.05 rad behind the reaction: 0.1^2 / (2 x 0.05) = 0.1 rad/s2."""
    answers = SimpleNamespace(stopping_angle_deg=np.degrees(0.1 * REACTION_S + 0.05))
    answered: Any = SimpleNamespace(speed_rad_s=0.1, answers=answers)
    assert Answered.quick_dec_rad_s2.fget(answered) == pytest.approx(0.1)  # type: ignore[attr-defined]
