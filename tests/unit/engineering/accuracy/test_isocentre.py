"""Way of the isocentre: weight and tracks by their closed forms, and the smallest circle of a star shot."""

from __future__ import annotations

import math
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from scipy.optimize import linprog

from gantryctl.engineering.accuracy import isocentre as module
from gantryctl.engineering.accuracy.isocentre import isocentre, isocentre_text, smallest_star
from gantryctl.errors import UsageError
from gantryctl.machine import configs_folder, default_machine, load_machine, with_values
from gantryctl.units import SIGNED, Dial

ANGLES = np.arange(-180.0, 180.0, 15.0)
ROUND = {"front_track_um": (0.0,), "rear_track_um": (0.0,)}


def found(changes: dict[str, Any]) -> Any:
    return isocentre(
        with_values(default_machine(), {f"plant.structure.{key}": value for key, value in changes.items()}),
        ANGLES,
    )


def test_weight_alone_sags_and_goes_round_twice_a_turn_and_the_star_shot_sees_none_of_it() -> None:
    """1e5 kg on 1e9 and 2e9 N/m: z = -W (cos^2/kr + sin^2/kt), x = W sin cos (1/kt - 1/kr)."""
    changes = ROUND | {
        "tube_mass_kg": 1e5, "tube_stiffness_radial_n_per_m": 1e9, "tube_stiffness_tangential_n_per_m": 2e9,
        "nozzle_mass_kg": 0.0,
    }  # fmt: skip
    iso, t, weight = found(changes), np.deg2rad(ANGLES), 9.81e5
    x = weight * np.sin(t) * np.cos(t) * (1 / 2e9 - 1 / 1e9)
    z = -weight * (np.cos(t) ** 2 / 1e9 + np.sin(t) ** 2 / 2e9)
    assert np.allclose(iso.shift_mm, 1e3 * np.stack([x, 0 * x, z], axis=1), atol=1e-12)
    assert iso.star_radius_mm < 1e-12
    assert not np.any(iso.tilt_mrad)
    # All beams cross where the tangential sag has put them: z = -W/kt.
    assert iso.star_centre_mm == pytest.approx((0.0, -1e3 * weight / 2e9), abs=1e-12)


def test_the_nozzle_tilts_by_the_moment_of_its_centre_of_mass() -> None:
    """At 90 deg its weight of 1 kN pulls along u_t: 1 m further in and 0.5 m along the axis, on 1e6 N m/rad."""
    changes = ROUND | {
        "tube_mass_kg": 0.0, "nozzle_mass_kg": 1e3 / 9.81, "nozzle_reach_m": 1.0, "nozzle_overhang_m": 0.5,
        "nozzle_tilt_stiffness_nm_per_rad": 1e6, "nozzle_radius_m": 2.0,
        "nozzle_stiffness_radial_n_per_m": 2e10, "nozzle_stiffness_tangential_n_per_m": 2e10,
    }  # fmt: skip
    iso = found(changes)
    side = iso.tilt_mrad[ANGLES == 90.0][0]
    assert side == pytest.approx([0.0, -1.0, -0.5], abs=1e-9)
    # Turned by -1 mrad about y, the isocentre 2 m further in goes 2 mm along u_t, which is downwards there, as the
    # mount gives way under 1 kN.
    sag_mm = 1e3 * 1e3 / 2e10
    assert iso.shift_mm[ANGLES == 90.0][0] == pytest.approx([0.0, 0.0, -2.0 - sag_mm], abs=1e-6)
    top = iso.tilt_mrad[ANGLES == 0.0][0]
    assert top == pytest.approx([-0.5, 0.0, 0.0], abs=1e-9)
    assert iso.shift_mm[ANGLES == 0.0][0] == pytest.approx([0.0, -1.0, -sag_mm], abs=1e-6)


def test_a_track_lifts_its_ring_over_two_rollers() -> None:
    """Two waves of 100 um on both rings, rollers at 45 deg: sum and difference of the two heights, by phase."""
    changes = {"front_track_um": (100.0,), "rear_track_um": (0.0,), "tube_mass_kg": 0.0, "nozzle_mass_kg": 0.0,
               "roller_angle_deg": 45.0, "nozzle_place": 0.0, "ring_distance_m": 5.0}  # fmt: skip
    iso = found(changes)
    # Rollers 90 deg apart are half a wave of two: their heights are opposite, so z stays and x has 100/sin 45.
    assert np.max(np.abs(iso.shift_mm[:, 2])) < 1e-12
    fine = np.max(np.abs(iso.shift_mm[:, 0]))
    assert 0.95 * 0.1 * math.sqrt(2.0) < fine <= 0.1 * math.sqrt(2.0) + 1e-12
    # The rear ring stays: the tube turns about the vertical by x / 5 m.
    assert iso.tilt_mrad[ANGLES == 0.0][0, 2] == pytest.approx(
        iso.shift_mm[ANGLES == 0.0][0, 0] / 5.0, abs=1e-12
    )
    assert iso.star_radius_mm > 0.01


@pytest.mark.parametrize(
    ("part", "waves_um", "shift_mm"),
    [
        # Two waves begin at 45 deg: the rollers at +-45 deg see sin 135 and sin -45 deg.
        (0.125, (100.0,), [0.1, 0.0, 0.0]),
        # Three begin at 90 deg: both rollers see sin 45 deg.
        (0.25, (0.0, 100.0), [0.0, 0.0, 0.1]),
    ],
)
def test_the_phase_of_a_track_is_drawn_from_a_whole_turn(
    part: float, waves_um: tuple[float, ...], shift_mm: list[float], monkeypatch: pytest.MonkeyPatch
) -> None:
    drawn = SimpleNamespace(random=lambda: part)
    monkeypatch.setattr(module.random, "Random", lambda seed: drawn)
    changes = {"front_track_um": waves_um, "rear_track_um": (0.0,), "tube_mass_kg": 0.0, "nozzle_mass_kg": 0.0,
               "roller_angle_deg": 45.0, "nozzle_place": 0.0}  # fmt: skip
    assert found(changes).shift_mm[ANGLES == 0.0][0] == pytest.approx(shift_mm, abs=1e-12)


def test_a_track_turns_with_the_axis(monkeypatch: pytest.MonkeyPatch) -> None:
    """Two waves that begin at 45 deg, the axis at 45 deg: the rollers see sin 45 and sin 225 deg."""
    drawn = SimpleNamespace(random=lambda: 0.125)
    monkeypatch.setattr(module.random, "Random", lambda seed: drawn)
    changes = {"front_track_um": (100.0,), "rear_track_um": (0.0,), "tube_mass_kg": 0.0, "nozzle_mass_kg": 0.0,
               "roller_angle_deg": 45.0, "nozzle_place": 0.0}  # fmt: skip
    assert found(changes).shift_mm[ANGLES == 45.0][0] == pytest.approx([0.1, 0.0, 0.0], abs=1e-12)


def test_rings_that_move_alike_carry_the_nozzle_with_them_and_do_not_lean(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(module.random, "Random", lambda seed: SimpleNamespace(random=lambda: 0.125))
    changes = {"front_track_um": (100.0,), "rear_track_um": (100.0,), "tube_mass_kg": 0.0, "nozzle_mass_kg": 0.0,
               "roller_angle_deg": 45.0, "nozzle_place": 0.25}  # fmt: skip
    iso = found(changes)
    assert iso.shift_mm[ANGLES == 0.0][0] == pytest.approx([0.1, 0.0, 0.0], abs=1e-12)
    assert np.max(np.abs(iso.tilt_mrad)) < 1e-12


def test_the_star_shot_is_told_in_the_unit_of_the_beams() -> None:
    iso, t = found({}), np.deg2rad(ANGLES)
    x, z = iso.star_centre_mm
    assert abs(x) > 1e-3
    assert np.max(np.abs(x * np.cos(t) - z * np.sin(t) - iso.lateral_mm)) == pytest.approx(iso.star_radius_mm)


def test_the_second_number_of_a_track_is_three_waves() -> None:
    """Rollers at 60 deg are 120 deg apart, a whole wave of three: the ring goes up and down by 2 x 100 um, x stays."""
    changes = {"front_track_um": (0.0, 100.0), "rear_track_um": (0.0,), "tube_mass_kg": 0.0, "nozzle_mass_kg": 0.0,
               "roller_angle_deg": 60.0, "nozzle_place": 0.0}  # fmt: skip
    iso = found(changes)
    assert np.max(np.abs(iso.shift_mm[:, 0])) < 1e-12
    z = iso.shift_mm[:, 2]
    # Of 45 deg of the wave, which are 15 deg of the axis, one step lies within 22.5 deg of its top.
    assert 0.2 * math.cos(math.radians(22.5)) < np.max(np.abs(z)) <= 0.2 + 1e-12
    # It repeats every 120 deg, eight steps of 15 deg.
    assert z == pytest.approx(np.roll(z, 8), abs=1e-12)


@pytest.mark.parametrize("seed", range(12))
def test_the_smallest_circle_is_that_of_a_linear_programme(seed: int) -> None:
    """The least r with |u_t c - lateral| <= r for every line: three lines, or eight, at any angles."""
    rng = np.random.default_rng(seed)
    size = 3 if seed < 8 else 8
    angle, lateral = rng.uniform(0.0, 2.0 * math.pi, size), rng.normal(size=size)
    normal = np.stack([np.cos(angle), -np.sin(angle)], axis=1)
    ones = np.ones((size, 1))
    least = linprog(
        [0.0, 0.0, 1.0],
        np.vstack([np.hstack([normal, -ones]), np.hstack([-normal, -ones])]),
        np.concatenate([lateral, -lateral]),
        bounds=[(None, None), (None, None), (0.0, None)],
    )
    centre, radius = smallest_star(angle, lateral)
    assert radius == pytest.approx(least.fun, abs=1e-9)
    assert np.max(np.abs(normal @ np.array(centre) - lateral)) == pytest.approx(radius, abs=1e-9)


def test_the_smallest_circle_of_three_lines_is_the_one_inside_their_triangle() -> None:
    """Equal offsets at 0, 120 and 240 deg: radius = offset; a common shift of the centre changes nothing."""
    angle = np.deg2rad([0.0, 120.0, 240.0])
    centre, radius = smallest_star(angle, np.full(3, 0.7))
    assert radius == pytest.approx(0.7, rel=1e-12)
    assert centre == pytest.approx((0.0, 0.0), abs=1e-12)
    moved, same = smallest_star(angle, 0.7 + 0.3 * np.cos(angle) - 0.2 * -np.sin(angle))
    assert same == pytest.approx(0.7, rel=1e-12)
    assert moved == pytest.approx((0.3, -0.2), abs=1e-12)


@pytest.mark.parametrize("turned", [(), (0,), (1,), (2,), (0, 1), (0, 2), (1, 2), (0, 1, 2)])
def test_a_beam_from_the_other_side_is_the_same_line(turned: tuple[int, ...]) -> None:
    """Half a turn further its offset has the other sign."""
    angle, lateral = np.deg2rad([0.0, 120.0, 240.0]), np.full(3, 0.7)
    for k in turned:
        angle[k] += math.pi
        lateral[k] *= -1.0
    centre, radius = smallest_star(angle, lateral)
    assert radius == pytest.approx(0.7, rel=1e-12)
    assert centre == pytest.approx((0.0, 0.0), abs=1e-12)


def test_the_text_has_a_row_for_each_angle_and_the_star_below() -> None:
    iso = found({})
    text = isocentre_text(iso).splitlines()
    assert [float(row.split()[0]) for row in text[2:26]] == ANGLES.tolist()
    x, y, z = iso.span_mm
    assert text[26] == f"Range of the shift: {x:.3f} x {y:.3f} x {z:.3f} mm"
    assert text[27].startswith(f"Star shot: circle of {iso.star_radius_mm:.3f} mm radius")


def test_no_other_centre_has_a_smaller_circle() -> None:
    iso, t = found({}), np.deg2rad(ANGLES)
    x, z = iso.star_centre_mm
    for dx, dz in ((0.01, 0.0), (-0.01, 0.0), (0.0, 0.01), (0.0, -0.01), (0.001, 0.001)):
        worst = np.max(np.abs((x + dx) * np.cos(t) - (z + dz) * np.sin(t) - iso.lateral_mm))
        assert worst >= iso.star_radius_mm


def test_the_tube_leans_by_what_one_ring_lifts_and_the_nozzle_goes_with_it() -> None:
    """Rollers at 60 deg and three waves lift the front ring alone: z by up to 200 um, x stays; the rings are 5 m apart.

    A tube whose front goes up by z turns about x by -z / 5 m: at 0 deg that is about u_t, at 90 deg, where u_t points
    down, it is about u_r. The nozzle at the place of the rear ring stays, half way it has half of z.
    """
    changes = {"front_track_um": (0.0, 100.0), "rear_track_um": (0.0,), "tube_mass_kg": 0.0, "nozzle_mass_kg": 0.0,
               "roller_angle_deg": 60.0, "ring_distance_m": 5.0}  # fmt: skip
    at_front, between, at_rear = (found(changes | {"nozzle_place": place}) for place in (0.0, 0.5, 1.0))
    lifted_mm = at_front.shift_mm[:, 2]
    assert np.max(np.abs(lifted_mm)) > 0.1
    assert between.shift_mm[:, 2] == pytest.approx(0.5 * lifted_mm, abs=1e-12)
    assert at_rear.shift_mm[:, 2] == pytest.approx(0.0 * lifted_mm, abs=1e-12)
    lean_mrad = -lifted_mm / 5.0
    top, side = ANGLES == 0.0, ANGLES == 90.0
    assert between.tilt_mrad[top][0] == pytest.approx([lean_mrad[top][0], 0.0, 0.0], abs=1e-12)
    assert between.tilt_mrad[side][0] == pytest.approx([0.0, 0.0, lean_mrad[side][0]], abs=1e-12)


@pytest.mark.parametrize(
    ("travel", "step", "angles"),
    [
        ((-180.0, 180.0), 60.0, [-180.0, -120.0, -60.0, 0.0, 60.0, 120.0]),
        ((-90.0, 95.0), 45.0, [-90.0, -45.0, 0.0, 45.0, 90.0]),
        ((-5.0, 340.0), 60.0, [0.0, 60.0, 120.0, 180.0, 240.0, 300.0]),
        ((-3.0, 95.0), 10.0, [0.0, 10.0, 20.0, 30.0, 40.0, 50.0, 60.0, 70.0, 80.0, 90.0]),
        # Of several turns, one: the load comes round.
        ((-400.0, 400.0), 60.0, [-360.0, -300.0, -240.0, -180.0, -120.0, -60.0]),
    ],
)  # fmt: skip
def test_the_isocentre_is_told_where_the_axis_stands_and_nowhere_else(
    travel: tuple[float, float], step: float, angles: list[float]
) -> None:
    low, high = travel
    axis = SimpleNamespace(pos_min_deg=low, pos_max_deg=high, dial=SIGNED)
    assert module.angles_of(SimpleNamespace(axis=axis), step).tolist() == angles  # type: ignore[arg-type]


def test_a_star_shot_takes_three_angles_and_is_printed_as_the_display_has_them() -> None:
    axis = SimpleNamespace(pos_min_deg=-5.0, pos_max_deg=5.0, dial=Dial(0.0))
    with pytest.raises(UsageError, match=r"step-deg 10: travel, 355 to 5 deg, has 1 such angles"):
        module.angles_of(SimpleNamespace(axis=axis), 10.0)  # type: ignore[arg-type]
    lines = isocentre_text(isocentre(default_machine(), np.array([-90.0, 0.0, 60.0])), Dial(0.0)).splitlines()
    assert [line.split()[0] for line in lines[2:5]] == ["270.0", "0.0", "60.0"]


@pytest.mark.parametrize("name", ["hust_can", "hust_can_nodes", "hust_improved"])
def test_the_reference_gantry_has_its_isocentre_whatever_drives_it(name: str) -> None:
    """The same steel: its file need not say it again."""
    found = isocentre(load_machine(configs_folder() / f"{name}.toml"), ANGLES)
    assert found.star_radius_mm == isocentre(default_machine(), ANGLES).star_radius_mm > 0.0
