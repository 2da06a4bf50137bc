"""The numbers of a calibration on their way to laws and watch: each figure by hand, from one made-up machine."""

from __future__ import annotations

import math
from types import SimpleNamespace
from typing import Any

import pytest

from gantryctl.engineering.comparison.variants import without_load_encoder
from gantryctl.errors import ConfigError
from gantryctl.machine import Calibration, Machine, Unknown, default_machine, with_values
from gantryctl.program.settings import CalibrationWatchSettings
from gantryctl.wiring import compensation as wiring
from gantryctl.wiring.calibration_watch import calibration_identity, calibration_watch, what_is_not_watched
from gantryctl.wiring.compensation import (
    _identified,
    _numbers,
    compensation,
    compensation_settings,
    flank_torque_nm,
    lead_deg,
)
from gantryctl.wiring.simulator import delivered_zero_counts
from support.improved import improved_machine

approx = pytest.approx
WATCH = "control.compensation.calibration_watch."
# Nothing of the machine file allows more than the intervals.
BARE = with_values(
    improved_machine(), {WATCH + name: 0.0 for name in ("friction_ratio", "backlash_deg", "lost_motion_deg")}
)
FOLLOWING = with_values(
    improved_machine(),
    {f"control.compensation.{name}_observer.active": True for name in ("moment", "backlash")},
)
NUMBERS = {
    "moment_sine_nm": 12e3, "moment_cosine_nm": 16e3, "inertia_kg_m2": 2.5e6, "motor_inertia_kg_m2": 0.25,
    "friction_nm": 10e3, "friction_load_nm": 4e3, "friction_load_ratio": 0.1, "friction_nm_s_per_rad": 50e3,
    "stiffness_nm_per_rad": 4e8, "windup_per_acc_s2": 0.006, "swing_hz": 2.0, "backlash_rad": 3e-5,
}  # fmt: skip
HALF = {
    "moment_sine_nm": 30.0, "moment_cosine_nm": 40.0, "friction_nm": 100.0, "friction_load_ratio": 0.001,
    "friction_nm_s_per_rad": 500.0, "stiffness_nm_per_rad": 4e6, "backlash_rad": 1e-6, "friction_load_nm": 50.0,
}  # fmt: skip


def calibration(left_out: str = "", **numbers: float | None) -> Calibration:
    """The made-up machine, one number of it left out or others changed."""
    base = improved_machine().calibration
    assert base is not None
    given = {**NUMBERS, **numbers} | ({left_out: None} if left_out else {})
    half = {name: value for name, value in {**base.half_width, **HALF}.items() if name != left_out}
    maps = base.maps.model_copy(update={"reversal_rad": (-2e-5, *base.maps.reversal_rad[1:])})
    return base.model_copy(
        update={
            "identified": base.identified.model_copy(update=given),
            "half_width": half,
            "unknown": {},
            "maps": maps,
        }
    )


def watched(machine: Machine = BARE, left_out: str = "", **numbers: float | None) -> CalibrationWatchSettings:
    found = calibration_watch(machine, calibration(left_out, **numbers))
    assert found is not None
    return found


# --- what is watched --------------------------------------------------------------------------------------------------


def test_the_numbers_of_the_watch_are_those_of_the_calibration() -> None:
    found = watched()
    assert (found.moment_sine_nm, found.moment_cosine_nm, found.inertia_kg_m2) == (12e3, 16e3, 2.5e6)
    assert found.inertia_load_kg_m2 == approx(2_172_816.0)  # less 1144^2 x 0.25
    assert (found.friction_nm, found.friction_load_nm, found.friction_load_ratio) == (10e3, 4e3, 0.1)
    assert (found.friction_nm_s_per_rad, found.windup_per_acc_s2) == (50e3, 0.006)
    assert (found.flank_nm, found.residual_nm) == approx((5e3, 3.5e3))  # half and 0.35 of the friction
    assert found.torque_spread_nm == approx(294_008.0)  # 257 N m x 1144
    assert found.speed_min_rad_s == approx(1.047198e-3)  # a tenth of 0.6 deg/s
    lighter = watched(inertia_kg_m2=3e5)
    assert lighter.inertia_load_kg_m2 == 0.0
    assert watched(friction_nm=-10.0).flank_nm == 0.0


@pytest.mark.parametrize(
    "name", ["moment_sine_nm", "moment_cosine_nm", "friction_load_ratio", "friction_nm_s_per_rad"]
)
def test_a_number_that_is_known_to_be_0_is_watched_as_0(name: str) -> None:
    assert getattr(watched(**{name: 0.0}), name) == 0.0


def test_bounds_are_twice_what_the_intervals_may_be_wrong_by() -> None:
    """The moment of 20 kN m: hypot(30, 40) = 50 N m, and 0.001 of it that friction takes, 20 N m. Friction: 100 N m,
    500 x 0.10472 at 6 deg/s, and 20 N m times 2/pi over a turn. The ring: 1 % of 20 kN m and 70 N m over 4e8.
    """
    found = watched()
    assert found.moment_bound_nm == approx(140.0)
    assert found.friction_bound_nm == approx(2.0 * (100.0 + 52.3599 + 12.7324), rel=1e-6)
    assert found.scale_bound_rad == approx(1.35e-6)
    assert found.backlash_bound_rad == approx(3.2e-5)  # beyond the gap itself
    assert found.lost_motion_bound_rad == approx(2e-6)
    assert watched(left_out="stiffness_nm_per_rad").scale_bound_rad == math.inf
    # At least a part of all friction at 6 deg/s: 10 kN m and 50 kN m s/rad times 0.10472 rad/s.
    machine = with_values(BARE, {WATCH + "friction_ratio": 0.1})
    assert watched(machine).friction_bound_nm == approx(1523.599, rel=1e-6)


@pytest.mark.parametrize(("least_deg", "bound"), [(0.0001, 3.2e-5), (0.001, 4.745329e-5)])
def test_a_growth_of_the_backlash_counts_from_the_backlash(least_deg: float, bound: float) -> None:
    machine = with_values(BARE, {WATCH + "backlash_deg": least_deg})
    assert watched(machine).backlash_bound_rad == approx(bound)


@pytest.mark.parametrize(("least_deg", "bound"), [(0.0, 4e-5), (0.01, 1.745329e-4)])
def test_a_backlash_that_is_not_known_is_at_most_all_lost_motion(least_deg: float, bound: float) -> None:
    """2e-5 rad each way; what may change is twice that."""
    machine = with_values(BARE, {WATCH + "backlash_deg": least_deg})
    found = watched(machine, left_out="backlash_rad")
    assert found.backlash_bound_rad == approx(bound)
    assert found.lost_motion_bound_rad == approx(8e-5)


def test_without_a_windup_no_gap_is_watched() -> None:
    found = watched(left_out="windup_per_acc_s2")
    assert (found.backlash_bound_rad, found.lost_motion_bound_rad) == (math.inf, math.inf)


def test_what_lacks_the_windup_alone_is_told_of_the_backlash() -> None:
    lacking = calibration("windup_per_acc_s2")
    machine = improved_machine()
    base = machine.calibration
    assert base is not None
    told = what_is_not_watched(
        machine.calibrated(lacking.model_copy(update={"unknown": {"windup_per_acc_s2": Unknown.NO_WINDUP}}))
    )
    assert len(told) == 1
    assert "no longer fits in backlash: windup_per_acc_s2" in told[0]


# --- what the laws are given ------------------------------------------------------------------------------------------


def laws(machine: Machine | None = None, **numbers: float | None) -> dict[str, float]:
    return _identified(machine or improved_machine(), calibration(**numbers))


def test_the_numbers_of_the_laws_are_those_of_the_calibration() -> None:
    """A swing of 2 Hz is 12.566 rad/s. In a scan of 1 ms: 1 - exp(-0.001 x 2 / 4), and four times as fast and slow."""
    found = laws()
    assert improved_machine().control.scan_period_ms == 1.0
    expected = {
        "moment_sine_nm": 12e3, "moment_cosine_nm": 16e3, "inertia_kg_m2": 2.5e6,
        "inertia_load_kg_m2": 2_172_816.0, "friction_load_nm": 4e3, "backlash_rad": 3e-5,
        "compliance_rad_per_nm": 2.5e-9, "windup_per_acc_s2": 0.006, "swing_rad_s": 12.566371,
        "friction_nm": 10e3, "friction_load_ratio": 0.1, "friction_nm_s_per_rad": 50e3,
        "friction_spread_nm": 5e3, "observer_rate": 4.9987502e-4, "observer_calm_s": 2.0,
        "observer_weight": 2.0 * 0.001 * 2.0 / 3500.0**2, "backlash_held_rad": 3e-5,
        "backlash_fast": 0.04902308, "backlash_slow": 0.003136665,
    }  # fmt: skip
    assert {name: found[name] for name in expected} == approx(expected, rel=1e-5)


def test_the_numbers_of_the_laws_are_those_of_the_file() -> None:
    """No two of them alike; 1 deg is 0.0174533 rad, a scan 1 ms. A load that swings after a stop has up to 1 deg/s."""
    keys = {
        "torque.limit_nm": 300.0, "windup.reversal_length_deg": 0.02, "gear_map.fade_hz": 3.0,
        "gear_map.limit_deg": 0.5, "load_encoder.integral_per_s": 0.7, "load_encoder.dead_band_deg": 0.004,
        "load_encoder.limit_deg": 0.25, "damping.gain": 0.2, "damping.filter_ms": 20.0, "damping.slow_s": 0.5,
        "latency_us": 1500.0,
    }  # fmt: skip
    machine = with_values(
        improved_machine(), {f"control.compensation.{key}": value for key, value in keys.items()}
    )
    expected = {
        "period_s": 0.001, "torque_limit_nm": 300.0, "reversal_length_rad": 3.49066e-4, "fade_rad_s": 18.849556,
        "pos_limit_rad": 0.00872665, "encoder_gain_per_s": 0.7, "encoder_dead_band_rad": 6.98132e-5,
        "encoder_limit_rad": 0.00436332, "swing_speed_max_rad_s": 0.0174533, "damping_gain": 0.2,
        "damping_filter": 0.0487706, "damping_slow": 0.001998, "latency_s": 0.0015,
        # 1.82 deg/s3, and a hundredth.
        "jerk_max_rad_s3": 0.0320826,
    }  # fmt: skip
    found = wiring._numbers(machine)
    assert {name: found[name] for name in expected} == approx(expected, rel=1e-5)


@pytest.mark.parametrize(
    ("changes", "name", "value"),
    [
        ({"friction_nm": 0.0}, "observer_weight", 0.0),
        ({"stiffness_nm_per_rad": None}, "compliance_rad_per_nm", 0.0),
        ({"inertia_kg_m2": 3e5}, "inertia_load_kg_m2", 0.0),
        ({"friction_load_nm": None}, "friction_load_nm", 0.0),
        ({"backlash_rad": None}, "backlash_rad", 0.0),
        *(
            ({name: None}, name, 0.0)
            for name in (
                "moment_sine_nm",
                "moment_cosine_nm",
                "inertia_kg_m2",
                "friction_load_ratio",
                "friction_nm_s_per_rad",
                "windup_per_acc_s2",
                "friction_nm",
            )
        ),
        ({"swing_hz": None}, "swing_rad_s", 0.0),
        ({"swing_hz": None}, "observer_rate", 0.0),
        ({"swing_hz": None}, "observer_calm_s", 0.0),
        # All lost motion, 2e-5 rad each way.
        ({"backlash_rad": None}, "backlash_held_rad", 4e-5),
    ],
)
def test_what_is_not_known_is_nothing(changes: dict[str, Any], name: str, value: float) -> None:
    assert laws(**changes)[name] == approx(value)


def test_an_observer_of_the_backlash_takes_half_of_the_friction_where_its_part_is_not_known() -> None:
    assert laws(FOLLOWING)["friction_load_nm"] == 4e3
    assert laws(FOLLOWING, friction_load_nm=None)["friction_load_nm"] == 5e3


def test_a_stop_is_planned_with_half_of_the_friction_where_backlash_is_followed_by_an_encoder_on_the_ring() -> (
    None
):
    assert laws()["flank_friction_share"] == 1.0
    assert laws(FOLLOWING)["flank_friction_share"] == 0.5
    assert laws(without_load_encoder(FOLLOWING))["flank_friction_share"] == 1.0


@pytest.mark.parametrize(
    ("law", "number"),
    [
        ("torque.eccentric", "moment_cosine_nm"),
        ("torque.acceleration", "inertia_kg_m2"),
        ("windup.active", "stiffness_nm_per_rad"),
        ("damping.active", "swing_hz"),
        ("moment_observer.active", "friction_load_ratio"),
    ],
)
def test_a_law_is_refused_without_the_number_that_it_lives_on(law: str, number: str) -> None:
    switched = (
        "torque.eccentric",
        "torque.acceleration",
        "windup.active",
        "damping.active",
        "moment_observer.active",
    )
    alone = {f"control.compensation.{each}": each == law for each in switched}
    machine = with_values(improved_machine(), alone)
    lacking = calibration(number).model_copy(update={"unknown": {number: Unknown.TOO_WIDE}})
    with pytest.raises(ConfigError, match=f"{law} lives on {number}"):
        _identified(machine, lacking)
    _identified(with_values(machine, {f"control.compensation.{law}": False}), lacking)


def test_an_observer_of_the_backlash_is_refused_without_the_windup() -> None:
    lacking = calibration("windup_per_acc_s2")
    lacking = lacking.model_copy(update={"unknown": {"windup_per_acc_s2": Unknown.NO_WINDUP}})
    with pytest.raises(ConfigError, match=r"backlash_observer\.active lives on windup_per_acc_s2"):
        _identified(FOLLOWING, lacking)


@pytest.mark.parametrize(
    ("number", "value"),
    [("friction_load_nm", -291.0), ("friction_load_nm", 0.0), ("friction_nm", 0.0), ("inertia_kg_m2", 1.0)],
)
def test_an_observer_of_the_backlash_is_refused_without_friction_and_a_load(
    number: str, value: float
) -> None:
    """It computes where the load lies: from a calibration by hand or of an odd machine it gets an answer, no crash."""
    with pytest.raises(ConfigError, match=r"backlash_observer\.active lives on friction and a load"):
        compensation(FOLLOWING.calibrated(calibration(**{number: value})))


def test_the_flank_changes_at_a_part_of_the_rated_torque() -> None:
    """0.0034 x 257 N m x 1144."""
    assert flank_torque_nm(improved_machine()) == approx(999.6272)


@pytest.mark.parametrize(("active", "limit"), [(True, 30e3), (False, math.inf)])
def test_what_follows_the_moment_may_go_to_its_limit(active: bool, limit: float) -> None:
    machine = with_values(improved_machine(), {"control.compensation.moment_observer.active": active})
    found = compensation_settings(machine)
    assert found is not None
    assert found.moment_limit_nm == limit


def test_an_ideal_drive_has_no_laws_and_no_calibration_leaves_nothing_to_watch() -> None:
    improved = improved_machine()
    assert compensation(improved) is not None
    assert compensation(with_values(improved, {"drive.kind": "ideal"})) is None
    assert compensation(default_machine()) is None
    assert what_is_not_watched(default_machine()) == ()
    assert what_is_not_watched(improved.calibrated(None)) == ()


@pytest.mark.parametrize(("limit_deg", "step_rad"), [(0.007, 1.745329e-5), (0.0, 1.0)])
def test_the_step_between_models_of_the_backlash_is_never_nothing(limit_deg: float, step_rad: float) -> None:
    """Eight models: seven steps."""
    machine = with_values(improved_machine(), {"control.compensation.backlash_observer.limit_deg": limit_deg})
    assert _numbers(machine)["backlash_step_rad"] == approx(step_rad)


def test_the_lead_is_an_angle_at_an_angle_in_degrees(monkeypatch: pytest.MonkeyPatch) -> None:
    """2 mrad at 30 deg are 0.1146 deg at 0.5236 rad; the zero of a new machine lies so much further back."""
    seen: list[float] = []
    laws: Any = SimpleNamespace(lead=lambda at: (seen.append(at), 0.002)[1])
    monkeypatch.setattr(wiring, "compensation", lambda _: laws)
    machine = improved_machine()
    assert lead_deg(machine, 30.0) == approx(0.1145916)
    assert seen == [approx(0.5235988)]
    led = delivered_zero_counts(machine, 30.0)
    laws.lead = lambda _: 0.0
    per_rad = machine.counts_per_turn * machine.axis.ratio / math.tau
    assert delivered_zero_counts(machine, 30.0) - led == approx(0.002 * per_rad, abs=1.0)  # a count


def test_a_law_that_needs_a_calibration_is_refused_without_one() -> None:
    with pytest.raises(ConfigError, match="run `gantryctl identify` first"):
        compensation(improved_machine().calibrated(None))


def test_a_calibration_is_watched_unless_the_file_says_otherwise_or_an_interval_is_nothing() -> None:
    machine = improved_machine()
    found = compensation_settings(machine)
    assert found is not None
    assert found.watch is not None
    assert calibration_watch(with_values(machine, {WATCH + "active": False}), calibration()) is None
    bare = calibration()
    bare = bare.model_copy(update={"half_width": {**bare.half_width, "moment_sine_nm": 0.0}})
    assert calibration_watch(machine, bare) is None
    told = what_is_not_watched(machine.calibrated(bare))
    assert len(told) == 1
    assert "moment_sine_nm: its 95 % interval is 0" in told[0]


def test_a_load_that_leans_on_a_flank_is_led_by_it() -> None:
    leaning = calibration()
    maps = leaning.maps.model_copy(update={"lean_rad_per_nm": 3e-9})
    found = _identified(improved_machine(), leaning.model_copy(update={"maps": maps}))
    assert found["lean_rad_per_nm"] == 3e-9


def test_where_no_law_needs_a_calibration_nothing_is_missed_in_it() -> None:
    lacking = calibration("friction_nm").model_copy(update={"unknown": {"friction_nm": Unknown.TOO_WIDE}})
    assert len(what_is_not_watched(improved_machine().calibrated(lacking))) == 1
    assert what_is_not_watched(default_machine().calibrated(lacking)) == ()


def test_a_calibration_is_known_by_16_digits_of_its_own() -> None:
    one, other = (calibration_identity(calibration(friction_nm=value)) for value in (10e3, 10001.0))
    assert one != other
    assert len(one) == len(other) == 16
    assert set(one + other) <= set("0123456789abcdef")
