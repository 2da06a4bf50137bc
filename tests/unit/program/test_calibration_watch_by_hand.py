"""The watch of the calibration in figures by hand: one sample, the equations of a move, bounds to their last part.

The machine has round numbers: 100 sin x + 20 cos x N m, inertia 10 kg m2, 6 of them behind the mesh, a ratio of 7.
"""

from __future__ import annotations

import math
from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import pytest

from gantryctl.program.monitors import calibration_watch as module
from gantryctl.program.monitors.calibration_watch import CalibrationWatch, Finding
from gantryctl.program.settings import CalibrationWatchSettings

PERIOD_S = 0.004
RATIO = 7.0
# Its sine is 0.6 and its cosine 0.8.
POS_RAD = math.asin(0.6)
SETTINGS = CalibrationWatchSettings(
    identity="by hand",
    moment_sine_nm=100.0,
    moment_cosine_nm=20.0,
    inertia_kg_m2=10.0,
    inertia_load_kg_m2=6.0,
    windup_per_acc_s2=0.0,
    friction_nm=5.0,
    friction_load_nm=4.0,
    friction_load_ratio=0.1,
    friction_nm_s_per_rad=3.0,
    flank_nm=30.0,
    torque_spread_nm=2.0,
    residual_nm=20.0,
    speed_min_rad_s=0.5,
)
# The sums have a prior of (20 / 2)^2 = 100.
RIDGE = 100.0


def watch_of(period_s: float = PERIOD_S, load_side: bool = True, **changes: Any) -> CalibrationWatch:
    return CalibrationWatch(replace(SETTINGS, **changes), period_s, RATIO, load_side=load_side)


def kept(watch: CalibrationWatch, name: str) -> list[float]:
    found = watch.memory[name]
    assert isinstance(found, list)
    return found


def scanned(watch: CalibrationWatch, scans: int = 25, **at: float) -> None:
    """So many scans alike; a sample of the sums is 25 of them, a tenth of a second."""
    for _ in range(scans):
        watch.scan(
            at.get("pos", POS_RAD), at.get("vel", -2.0), at.get("acc", 0.0), at.get("torque", 10.0),
            at.get("apart", 0.0), at.get("followed", 0.0),
        )  # fmt: skip


def upper(row: tuple[float, ...]) -> list[float]:
    """One sample, and the upper triangle of its products."""
    return [1.0, *(a * b for i, a in enumerate(row) for b in row[i:])]


# --- one sample -----------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("pos", "left", "y", "mesh"),
    [
        # 130 sin + 40 cos = 110 are known by now, 76 by the calibration. Friction, -2 rad/s: 5 + 0.1 (110 + 5) = 16.5.
        # 7 x 10 - 110 - 5 + 3 x 2 + 16.5 = -22.5; to what is calibrated -22.5 + 110 - 76. Gears: 110 - 4 + 6 x 0.5.
        (POS_RAD, -22.5, 11.5, 109.0),
        # On the other side of the turn -46 and -44: friction 5 + 0.1 x 41, 70 + 46 - 5 + 6 + 9.1 = 126.1; -46 - 4 + 3.
        (-POS_RAD, 126.1, 124.1, -47.0),
    ],
)
def test_a_sample_is_the_torque_that_the_calibration_leaves(
    pos: float, left: float, y: float, mesh: float
) -> None:
    watch, taken = watch_of(), []
    watch._moment = (130.0, 40.0)
    stub: Any = SimpleNamespace(sample=lambda *row: taken.append(row))
    watch._swing = stub
    scanned(watch, pos=pos, acc=0.5)
    sine = math.sin(pos)
    assert kept(watch, "torque") == pytest.approx(upper((sine, 0.8, -1.0, y)))
    # The swing is looked at five times as often as the sums are made.
    assert taken == [pytest.approx((0.5, mesh, left))] * 5


@pytest.mark.parametrize(
    ("pos", "flank"),
    # 100 x 0.6 + 20 x 0.8 - 4 = 72 N m lie on one flank, -60 + 16 - 4 = -48 on the other one.
    [(POS_RAD, 1.0), (-POS_RAD, -1.0)],
)
def test_the_encoders_lie_apart_by_the_flank_and_by_what_the_laws_have_followed(
    pos: float, flank: float
) -> None:
    watch = watch_of()
    scanned(watch, pos=pos, apart=5e-4, followed=2e-4)
    y = 5e-4 - 1e-4 * flank
    assert kept(watch, "ring") == pytest.approx(upper((1.0, math.sin(pos), 0.8, flank, y)))


@pytest.mark.parametrize(
    ("changes", "acc", "taken"),
    [
        ({"flank_nm": 71.5}, 0.0, 1.0),
        ({"flank_nm": 72.0}, 0.0, 0.0),  # nearer to 0 the flank is not known
        ({"flank_nm": 1.0}, 1e-9, 0.0),  # a change of speed winds the gears up
        ({"flank_nm": 1.0, "load_side": False}, 0.0, 0.0),
    ],
)
def test_what_says_nothing_of_the_gears(changes: dict[str, Any], acc: float, taken: float) -> None:
    watch = watch_of(**changes)
    scanned(watch, acc=acc)
    assert kept(watch, "ring")[0] == taken
    assert kept(watch, "torque")[0] == 1.0


def test_only_who_has_a_load_side_encoder_watches_it() -> None:
    watch = CalibrationWatch(SETTINGS, PERIOD_S, RATIO)
    scanned(watch)
    assert kept(watch, "ring")[0] == 0.0


@pytest.mark.parametrize(("period_s", "scans", "middle"), [(0.001, 100, 89), (0.05, 5, 4)])
def test_a_sample_is_of_20_ms_and_one_scan_at_least(period_s: float, scans: int, middle: int) -> None:
    """Twenty scans of 1 ms, five times: the tenth of the last twenty. A scan of 50 ms is one by itself."""
    watch = watch_of(period_s)
    for k in range(scans):
        assert kept(watch, "torque")[0] == 0.0
        watch.scan(0.01 * k, 2.0, 0.0, 10.0, 0.0)
    assert kept(watch, "torque")[:2] == pytest.approx([1.0, math.sin(0.01 * middle) ** 2])


def test_a_sample_has_the_mean_of_its_torques() -> None:
    """5, 6, 7, 8 and 14 N m are 8, times the ratio 56; the calibration has 60 + 16 and friction 3 x 2 + 5 + 7.6."""
    watch = watch_of()
    for _ in range(5):
        for torque in (5.0, 6.0, 7.0, 8.0, 14.0):
            watch.scan(POS_RAD, 2.0, 0.0, torque, 0.0)
    assert kept(watch, "torque") == pytest.approx(upper((0.6, 0.8, 1.0, 56.0 - 76.0 - 18.6)))
    # Encoders that agree, and laws that have followed nothing.
    assert kept(watch, "ring") == pytest.approx(upper((1.0, 0.6, 0.8, 1.0, 0.0)))


def test_what_a_move_leaves_of_a_sample_belongs_to_no_other_move() -> None:
    taken: list[tuple[float, ...]] = []
    stub: Any = SimpleNamespace(sample=lambda *row: taken.append(row), abandon=lambda: None)
    watch, alone = watch_of(), watch_of()
    watch._swing = alone._swing = stub
    scanned(watch, scans=3, torque=1000.0)
    assert not watch.rest()
    for each in (watch, alone):
        scanned(each, scans=4)
        assert len(taken) == (each is alone)
        scanned(each, scans=1)
    assert taken[0] == taken[1]


def test_every_fifth_sample_goes_into_the_sums() -> None:
    watch = watch_of()
    for scans, samples in ((25, 1.0), (20, 1.0), (5, 2.0), (20, 2.0), (5, 3.0)):
        scanned(watch, scans=scans)
        # The memory loses 8e-5 of each with the next one.
        assert kept(watch, "torque")[0] == pytest.approx(samples, rel=1e-3)


def test_motion_that_is_too_slow_ends_the_swing_that_is_watched() -> None:
    calls: list[str] = []
    watch = watch_of()
    stub: Any = SimpleNamespace(sample=lambda *_: calls.append("sample"), abandon=lambda: calls.append("end"))
    watch._swing = stub
    scanned(watch, scans=5, vel=0.5)
    scanned(watch, scans=5, vel=-0.51)
    watch.rest()
    assert calls == ["end", "sample", "end"]


def test_gaps_that_the_swing_shows_are_counted_and_others_are_not() -> None:
    watch, gaps = watch_of(), iter((None, 2e-4, None, 4e-4, None))
    stub: Any = SimpleNamespace(sample=lambda *_: next(gaps))
    watch._swing = stub
    scanned(watch)
    # 2 and 4: the mean is 3 and the mean square of what is left 1.
    assert kept(watch, "gap") == pytest.approx([2, 3e-4, 1e-8])


def test_the_swing_is_that_of_the_load_behind_the_mesh(monkeypatch: pytest.MonkeyPatch) -> None:
    made: list[tuple[float, ...]] = []
    monkeypatch.setattr(module, "FlankSwing", lambda *given: made.append(given))
    watch_of(windup_per_acc_s2=0.01, backlash_bound_rad=1e-4)
    assert made == [pytest.approx((6.0, 0.01, 30.0, 0.020))]


# --- the equations at the end of a move -----------------------------------------------------------------


def judged(watch: CalibrationWatch, **memory: Any) -> bool:
    """Whether something no longer fits after a move whose sums are these."""
    watch.restore({**watch.memory, **memory})
    scanned(watch, scans=1)
    return watch.rest()


def torques(samples: float, alike: float) -> list[float]:
    """Sums in which 30 N m of sine, 40 of cosine and -7 of friction are more than calibrated; each with its prior.

    Every product of two unknowns is 0. What is left has a variance of 10 over so many samples alike: the standard
    deviations are sqrt(10 / 1200), sqrt(10 / 800) and sqrt(10 / 500), 0.0913, 0.1118 and 0.1414 N m.
    """
    sine, cosine, friction = 1200.0, 800.0, 500.0
    square = 30.0 * 30.0 * sine + 40.0 * 40.0 * cosine + 49.0 * friction + samples * 10.0 / alike
    return [
        samples, sine - RIDGE, 0.0, 0.0, 30.0 * sine, cosine - RIDGE, 0.0, 40.0 * cosine,
        friction - RIDGE, -7.0 * friction, square,
    ]  # fmt: skip


ANGLES = [
    # The same in microradians, with an offset of 9 and no prior.
    2000.0, 2000.0, 0.0, 0.0, 0.0, 9e-6 * 2000.0, 1200.0, 0.0, 0.0, 30e-6 * 1200.0, 800.0, 0.0, 40e-6 * 800.0,
    500.0, -7e-6 * 500.0,
    1e-12 * (81.0 * 2000.0 + 900.0 * 1200.0 + 1600.0 * 800.0 + 49.0 * 500.0 + 10.0 / 2.5 * 2000.0),
]  # fmt: skip


@pytest.mark.parametrize(
    ("windup", "alike"),
    # A sample is 0.1 s. Half a swing: 2 pi sqrt(windup) / 2 = 0.4 s; without windup 0.25 s; never less than one.
    [(0.0, 2.5), ((0.4 / math.pi) ** 2, 4.0), (1e-6, 1.0)],
)
def test_a_moment_is_another_one_4_5_standard_deviations_beyond_its_bound(
    windup: float, alike: float
) -> None:
    """50 N m of the two; the larger of both deviations counts: 50 - 4.5 x 0.1118 = 49.497."""
    for bound, found in ((49.49, True), (49.51, False)):
        watch = watch_of(windup_per_acc_s2=windup, moment_bound_nm=bound)
        assert judged(watch, torque=torques(2000.0, alike)) is found
        assert watch.seen["moment"] == pytest.approx((50.0, bound))
        assert watch.found == ({"moment": pytest.approx((50.0, bound))} if found else {})
        assert watch._moment == pytest.approx((130.0, 60.0))


def test_friction_is_another_one_beyond_its_bound_in_either_direction() -> None:
    """7 - 4.5 x 0.1414 = 6.364."""
    for bound, found in ((6.35, True), (6.38, False)):
        watch = watch_of(friction_bound_nm=bound)
        assert judged(watch, torque=torques(2000.0, 2.5)) is found
        assert watch.seen["friction"] == pytest.approx((-7.0, bound))


def test_the_maps_are_others_beyond_their_bound() -> None:
    for bound, found in ((49.49e-6, True), (49.51e-6, False)):
        watch = watch_of(scale_bound_rad=bound)
        assert judged(watch, torque=torques(2000.0, 2.5), ring=ANGLES) is found
        assert watch.seen["scale"] == pytest.approx((50e-6, bound))
        assert "lost_motion" not in watch.seen, "a session may be a morning"


def test_lost_motion_is_another_one_both_ways_together() -> None:
    """-14 urad, and twice the deviation: 14 - 4.5 x 2 x 0.1414 = 12.727."""
    for bound, found in ((12.71e-6, True), (12.74e-6, False)):
        watch = watch_of(lost_motion_bound_rad=bound)
        # 8,200 samples fill 68.3 % of a memory of 12,000.
        assert judged(watch, torque=torques(8200.0, 2.5), ring=ANGLES) is found
        assert watch.seen["lost_motion"] == pytest.approx((-14e-6, bound))


def test_a_machine_without_a_load_side_encoder_judges_no_angles() -> None:
    watch = watch_of(load_side=False, scale_bound_rad=1e-6, lost_motion_bound_rad=1e-6)
    assert not judged(watch, torque=torques(8200.0, 2.5), ring=ANGLES)


@pytest.mark.parametrize(
    ("changes", "variance"),
    # The deviation of the mean is 1 urad: 16 of 17 values, and of a hundred 79 that count.
    [(17, 16e-12), (100, 79e-12)],
)
def test_a_gap_is_another_one_beyond_its_bound(changes: int, variance: float) -> None:
    for bound, found in ((45.49e-6, True), (45.51e-6, False)):
        watch = watch_of(backlash_bound_rad=bound)
        memory = {"torque": torques(8200.0, 2.5), "gap": [float(changes), 50e-6, variance]}
        assert judged(watch, **memory) is found
        assert watch.seen["backlash"] == pytest.approx((50e-6, bound))


@pytest.mark.parametrize(("samples", "seen"), [(1190.0, False), (1210.0, True)])
def test_nothing_is_judged_before_two_minutes_of_motion(samples: float, seen: bool) -> None:
    """A tenth of the memory of 12,000 samples."""
    watch = watch_of(moment_bound_nm=1.0)
    assert judged(watch, torque=torques(samples, 2.5)) is seen
    assert bool(watch.seen) is seen


def test_what_was_found_first_stays_and_what_is_seen_goes_on() -> None:
    watch = watch_of()
    for measured in (2.0, -3.0):
        watch._weigh("friction", measured, 1.0, 0.0)
    assert watch.found == {"friction": Finding(2.0, 1.0)}
    assert watch.seen == {"friction": Finding(-3.0, 1.0)}


def test_what_is_retained_is_judged_by_the_first_move_and_not_before() -> None:
    watch = watch_of(moment_bound_nm=1.0)
    watch.restore({**watch.memory, "torque": torques(2000.0, 2.5)})
    assert not watch.rest()
    scanned(watch, scans=1)
    assert watch.rest()


def test_an_axis_at_rest_has_no_move_that_ends_again() -> None:
    watch = watch_of(moment_bound_nm=1.0)
    assert judged(watch, torque=torques(2000.0, 2.5))
    assert not watch.rest(), "told once a move"


# --- what is retained -----------------------------------------------------------------------------------


@pytest.mark.parametrize(
    "broken",
    [
        {"gap": [-1.0, 0.0, 0.0]},
        {"gap": [1.0, 0.0, -1.0]},
        {"gap": [1.0, math.nan, 0.0]},
        {"gap": [1.0, "2", 0.0]},
        {"gap": [1.0, 2.0]},
        {"gap": [1.0, 0.0, 0.0, 0.0]},
        {"gap": {"0": 1.0}},
        {"ring": [0.0]},
        {"ring": [math.inf] * 16},
        {"ring": "x"},
        {"torque": [1.0] * 12},
        {"torque": None},
        {"found": {"weather": [1.0, 2.0]}},
        {"found": {"moment": [1.0, 2.0], "weather": [1.0, 2.0]}},
        {"found": {"moment": [1.0]}},
        {"found": {"moment": [1.0, 2.0, 3.0]}},
        {"found": {"moment": [1.0, math.nan]}},
        {"found": []},
        {"found": None},
        {"calibration": "another"},
    ],
    ids=str,
)
def test_a_broken_memory_is_left_whole(broken: dict[str, Any]) -> None:
    sound = {
        "calibration": "by hand", "torque": torques(2000.0, 2.5), "ring": ANGLES, "gap": [3.0, 2.0, 1.0],
        "found": {"scale": [2.0, 1.0]},
    }  # fmt: skip
    watch = watch_of()
    watch.restore({**sound, **broken})
    assert watch.memory == watch_of().memory
    watch.restore(sound)
    assert watch.memory == sound
    assert watch.found == {"scale": Finding(2.0, 1.0)}
