"""The watch of the calibration: what it names, what it leaves alone, what it keeps, and what it costs."""

from __future__ import annotations

import json
import math
from dataclasses import replace
from typing import Any

import pytest

from gantryctl.machine import Machine, Unknown, with_values
from gantryctl.operation.brake_policy import restore_learned
from gantryctl.program import Code
from gantryctl.program.alarms.log import AlarmLog
from gantryctl.program.axis.load_side import stale_words
from gantryctl.program.monitors.calibration_watch import (
    NAMES,
    CalibrationWatch,
    Finding,
    _Running,
)
from gantryctl.program.monitors.flank_swing import FlankSwing, gap_of
from gantryctl.program.monitors.running_fit import RunningFit
from gantryctl.program.settings import CalibrationWatchSettings
from gantryctl.runtime import Retained
from gantryctl.units import rad
from gantryctl.wiring.calibration_watch import calibration_watch, what_is_not_watched
from gantryctl.wiring.compensation import compensation_settings
from gantryctl.wiring.engine import build_engine
from parity.test_engine_parity import powered
from support.improved import improved_machine

PERIOD_S = 0.004
AT = "control.compensation.calibration_watch."


def settings_of(machine: Machine | None = None) -> CalibrationWatchSettings:
    machine = machine or improved_machine()
    assert machine.calibration is not None
    found = calibration_watch(machine, machine.calibration)
    assert found is not None
    return found


def torque_of(
    s: CalibrationWatchSettings, pos: float, vel: float, acc: float, more: dict[str, float]
) -> float:
    """Motor torque times the ratio of a machine that is as calibrated but for `more`."""
    held = s.moment_sine_nm * math.sin(pos) + s.moment_cosine_nm * math.cos(pos) + s.inertia_kg_m2 * acc
    friction = s.friction_nm + s.friction_load_ratio * abs(held) + more.get("friction", 0.0)
    z = math.copysign(1.0, vel)
    return held + s.friction_nm_s_per_rad * vel + z * friction + more.get("moment", 0.0) * math.sin(pos)


def turned(
    watch: CalibrationWatch,
    moves: int = 4,
    ring_rad: float = 0.0,
    wave_rad: float = 0.0,
    followed_rad: float = 0.0,
    **more: float,
) -> None:
    """Moves to and fro between -120 and 120 deg at 6 deg/s; a wave of 3 kN m that no calibration has lies on top."""
    s, vel = watch.settings, rad(6.0)
    for move in range(moves):
        z = 1.0 if move % 2 == 0 else -1.0
        for k in range(round(rad(240.0) / vel / PERIOD_S)):
            pos = z * (k * PERIOD_S * vel - rad(120.0))
            torque = torque_of(s, pos, z * vel, 0.0, more) + 3e3 * math.sin(37.0 * pos)
            apart = 0.5 * ring_rad * z + wave_rad * math.sin(pos)
            watch.scan(pos, z * vel, 0.0, torque / 1144.0, apart, followed_rad)
        watch.rest()


def new_watch(*, used_s: float = 0.0, **changes: Any) -> CalibrationWatch:
    """A watch behind which there are so many seconds of motion in which nothing was left of the torque."""
    watch = CalibrationWatch(replace(settings_of(), **changes), PERIOD_S, 1144.0, load_side=True)
    # A sample of 0.1 s fades over 1200 s.
    samples = 12e3 * (1.0 - math.exp(-used_s / 1200.0))
    watch.restore({**watch.memory, "torque": [samples, *[0.0] * 10]})
    return watch


def sums(watch: CalibrationWatch, name: str = "torque") -> list[float]:
    kept = watch.memory[name]
    assert isinstance(kept, list)
    return kept


@pytest.mark.parametrize("cosine_nm", [2.0, 9e3, -9e3])
def test_a_machine_as_it_was_calibrated_is_left_alone(cosine_nm: float) -> None:
    watch = new_watch(moment_cosine_nm=cosine_nm)
    turned(watch)
    assert watch.found == {}
    assert watch.seen["moment"].measured < 0.1 * watch.seen["moment"].bound


@pytest.mark.parametrize(
    ("name", "more", "measured"),
    [
        ("moment", {"moment": 20e3}, 20e3),
        ("friction", {"friction": 6e3}, 6e3),
        ("friction", {"friction": -6e3}, -6e3),
        ("lost_motion", {"ring_rad": 8e-5}, 8e-5),
        ("scale", {"wave_rad": 6e-5}, 6e-5),
    ],
)
def test_what_has_changed_is_named_with_what_was_measured(
    name: str, more: dict[str, float], measured: float
) -> None:
    # The load must lie on one flank each way for an encoder to show the way between them: without a moment it does.
    flat = {"moment_sine_nm": 0.0, "flank_nm": 1e3} if name == "lost_motion" else {}
    watch = new_watch(used_s=1400.0 if name == "lost_motion" else 0.0, **flat)
    turned(watch, **more)
    assert set(watch.found) == {name}
    # 3 % for the wave on top, and the fading memory.
    assert watch.found[name].measured == pytest.approx(measured, rel=0.03)
    assert abs(watch.found[name].measured) > watch.found[name].bound


def test_a_gap_that_the_laws_have_followed_is_judged_as_one_that_they_have_not() -> None:
    flat = {"used_s": 1400.0, "moment_sine_nm": 0.0, "flank_nm": 1e3}
    left, followed = new_watch(**flat), new_watch(**flat)
    turned(left, ring_rad=-8e-5)
    turned(followed, followed_rad=8e-5)
    assert followed.found["lost_motion"].measured == pytest.approx(
        left.found["lost_motion"].measured, rel=1e-6
    )
    within = new_watch(**flat, lost_motion_bound_rad=1e-4)
    turned(within, followed_rad=8e-5)
    assert within.found == {}


def test_what_the_laws_follow_is_named_as_well() -> None:
    """A load that is another one, or a gear that wears, is told although the angle is right: how much may change
    without a word is a person's `moment_nm` and `lost_motion_deg`, not how far the laws may go.
    """
    switches = [f"control.compensation.{name}_observer.active" for name in ("moment", "backlash")]
    off, on = (
        settings_of(with_values(improved_machine(), dict.fromkeys(switches, active)))
        for active in (False, True)
    )
    assert off == on


def test_short_first_moves_leave_no_friction_of_a_moment_that_they_cannot_tell() -> None:
    """7 s one way, in which torque goes from 6 kN m too few to 6 too many, as waves of the gears do, fit 33 kN m."""
    watch = new_watch()
    s, vel, way = watch.settings, rad(3.0), rad(21.0)
    scans = round(way / vel / PERIOD_S)
    for k in range(scans):
        pos = rad(-67.0) - k * PERIOD_S * vel
        torque = torque_of(s, pos, -vel, 0.0, {}) + 12e3 * (k / scans - 0.5)
        watch.scan(pos, -vel, 0.0, torque / 1144.0, 0.0)
    watch.rest()
    turned(watch)
    # 7 of 167 s are 40 N m; 500 with the friction of the 33 kN m in the sums of the next move.
    assert abs(watch.seen["moment"].measured) < 150.0


@pytest.mark.parametrize(("share", "samples"), [(0.99, 0.0), (1.01, 1.0), (-0.99, 0.0), (-1.01, 1.0)])
def test_motion_that_is_too_slow_teaches_no_friction(share: float, samples: float) -> None:
    """Its torque lies anywhere between the frictions of both ways; a sample is taken every 0.1 s."""
    watch = new_watch()
    vel = share * watch.settings.speed_min_rad_s
    for k in range(round(0.1 / PERIOD_S)):
        watch.scan(k * PERIOD_S * vel, vel, 0.0, 10.0, 0.0)
    assert sums(watch)[0] == samples


@pytest.mark.parametrize(
    ("apart_rad", "samples"), [(math.nextafter(1.0, 0.0), 1.0), (1.0, 0.0), (-1.0, 0.0), (math.nan, 0.0)]
)
def test_encoders_that_are_a_radian_apart_say_nothing_of_the_gears(apart_rad: float, samples: float) -> None:
    watch, vel = new_watch(moment_sine_nm=50e3), rad(6.0)
    for k in range(round(0.1 / PERIOD_S)):
        watch.scan(1.5 + k * PERIOD_S * vel, vel, 0.0, 40.0, apart_rad)
    assert sums(watch, "ring")[0] == samples


def test_a_sample_belongs_to_the_angle_in_its_middle() -> None:
    """Blocks of five scans, of which every fifth is taken: the 23rd angle of 25."""
    watch, angles = new_watch(), [0.04 * k for k in range(25)]
    for pos in angles:
        watch.scan(pos, rad(6.0), 0.0, 10.0, 0.0)
    assert sums(watch)[1] == pytest.approx(math.sin(angles[22]) ** 2)


def test_friction_is_judged_by_the_load_that_the_moves_have_shown() -> None:
    """A tenth of the load rubs: of 60 kN m more, 4.3 kN m look like friction until the load is known, and then fade."""
    watch = new_watch(friction_load_ratio=0.1)
    loaded = replace(watch.settings, moment_sine_nm=watch.settings.moment_sine_nm + 60e3)
    vel = rad(6.0)
    for move in range(12):
        z = 1.0 if move % 2 == 0 else -1.0
        for k in range(10_000):
            pos = z * (k * PERIOD_S * vel - rad(120.0))
            watch.scan(pos, z * vel, 0.0, torque_of(loaded, pos, z * vel, 0.0, {}) / 1144.0, 0.0)
        watch.rest()
    assert set(watch.found) == {"moment"}
    assert watch.found["moment"].measured == pytest.approx(60e3, rel=0.03)
    assert abs(watch.seen["friction"].measured) < 2e3


def test_a_finding_lies_beyond_its_bound_and_not_on_it() -> None:
    watch = new_watch()
    for measured, found in ((1e-4, False), (-1e-4, False), (math.nextafter(-1e-4, -1.0), True)):
        watch._weigh("scale", measured, 1e-4, 0.0)
        assert ("scale" in watch.found) is found


def test_gears_without_windup_swing_behind_no_gap() -> None:
    """There is no period to look for, whatever bound a person gives."""
    assert new_watch(windup_per_acc_s2=0.0, backlash_bound_rad=1e-4)._swing is None
    assert new_watch(backlash_bound_rad=1e-4)._swing is not None
    assert new_watch(backlash_bound_rad=math.inf)._swing is None, "nobody asks"


def test_motion_one_way_names_nothing_that_it_cannot_tell_apart() -> None:
    """Over 20 deg one way a moment and friction are the same torque; so no warning names either."""
    watch, s = new_watch(), settings_of()
    for k in range(1000):
        pos = rad(80.0) + k * PERIOD_S * rad(5.0)
        watch.scan(pos, rad(5.0), 0.0, (torque_of(s, pos, rad(5.0), 0.0, {}) + 6e3) / 1144.0, 0.0)
    assert not watch.rest()


@pytest.mark.parametrize("reading", [math.nan, math.inf, -math.inf])
def test_readings_that_are_no_numbers_say_nothing(reading: float) -> None:
    watch = new_watch()
    turned(watch, moves=2)
    before = json.dumps(watch.memory)
    for _ in range(100):
        watch.scan(0.1, 0.1, 0.0, reading, reading)
    watch.rest()
    assert json.dumps(watch.memory) == before


class TestMemory:
    def test_what_was_found_survives_a_power_cycle_and_goes_with_another_calibration(self) -> None:
        watch = new_watch()
        turned(watch, moment=20e3)
        kept = json.loads(json.dumps(watch.memory))
        again, other = new_watch(), new_watch(identity="another")
        again.restore(kept)
        other.restore(kept)
        assert again.found == watch.found
        assert again.memory == watch.memory
        assert other.found == {}

    def test_the_gap_goes_on_from_its_changes_its_mean_and_its_variance(self) -> None:
        watch = new_watch()
        watch.restore({**watch.memory, "gap": [12.0, 1e-3, 1e-9]})
        assert watch.memory["gap"] == [12, 1e-3, 1e-9]

    @pytest.mark.parametrize(("square", "told"), [(0.0, True), (-1e6, False)])
    def test_sums_that_no_motion_makes_tell_nothing(self, square: float, *, told: bool) -> None:
        """A sum of squares below zero has no solution."""
        watch = new_watch()
        watch.restore({**watch.memory, "torque": [12e3, *[square] * 10]})
        watch.scan(0.0, 0.0, 0.0, 0.0, 0.0)
        assert not watch.rest()
        assert ("moment" in watch.seen) is told

    def test_it_has_always_the_same_size(self) -> None:
        watch = new_watch()
        turned(watch, moves=1)
        first = len(watch.memory["torque"]), len(watch.memory["ring"])  # type: ignore[arg-type]
        turned(watch, moves=4)
        assert (len(watch.memory["torque"]), len(watch.memory["ring"])) == first  # type: ignore[arg-type]


class TestFlankSwing:
    INERTIA, WINDUP, FLANK, SAMPLE_S, JERK = 2.2e6, 0.006, 3e3, 0.02, 0.0234

    @pytest.mark.parametrize("gap_rad", [1e-5, 2e-5, 8e-5])
    def test_the_gap_that_a_swing_tells_is_the_one_that_makes_it(self, gap_rad: float) -> None:
        """The equations of `flank_swing` backwards: the time by bisection, then the swing of that time."""
        low, high = 0.0, 2.0
        for _ in range(60):
            t = 0.5 * (low + high)
            low, high = (t, high) if self.JERK * t * (self.WINDUP + t * t / 6.0) < gap_rad else (low, t)
        swing = self.INERTIA * math.hypot(self.WINDUP**-0.5 * self.JERK * low**2 / 2.0, self.JERK * low)
        assert gap_of(swing, self.JERK, self.INERTIA, self.WINDUP) == pytest.approx(gap_rad, rel=1e-6)

    def told(self, *, crossing: bool = True, swing_nm: float = 5e3, again: float = 0.0) -> list[float | None]:
        """A ramp of 0.5 s and what follows, with a swing on a slope that the plan does not know."""
        swing, acc, told = FlankSwing(self.INERTIA, self.WINDUP, self.FLANK, self.SAMPLE_S), 0.0, []
        begin = 10e3 if crossing else -10e3
        told.append(swing.sample(0.0, begin, 0.0))
        for _ in range(25):
            acc -= self.JERK * self.SAMPLE_S
            told.append(swing.sample(acc, begin + self.INERTIA * acc, 0.0))
        for k in range(60):
            if k == 10:
                acc += again * self.JERK * self.SAMPLE_S
            left = 500.0 + 900.0 * k * self.SAMPLE_S
            left += swing_nm * math.cos(self.WINDUP**-0.5 * k * self.SAMPLE_S + 0.3)
            told.append(swing.sample(acc, begin + self.INERTIA * acc, left))
        return told

    def test_a_swing_after_the_flank_has_changed_is_a_gap(self) -> None:
        gaps = [gap for gap in self.told() if gap is not None]
        # A period of 24 samples instead of 24.3: 2 % of the amplitude.
        assert gaps == [pytest.approx(gap_of(5e3, self.JERK, self.INERTIA, self.WINDUP), rel=0.03)]

    def test_over_a_whole_period_the_slope_is_told_from_the_swing(self) -> None:
        """A period of 24 samples to the bit: what is left is the amplitude itself."""
        sample_s = 2.0 * math.pi * math.sqrt(self.WINDUP) / 24.0
        swing = FlankSwing(self.INERTIA, self.WINDUP, self.FLANK, sample_s)
        jerk = 500.0 / (self.INERTIA * sample_s)
        swing.sample(0.0, 10e3, 0.0)
        for k in range(1, 41):
            swing.sample(-jerk * k * sample_s, 10e3 - 500.0 * k, 0.0)
        told = [
            swing.sample(
                -jerk * 40 * sample_s, -10e3, 500.0 + 4e3 * k + 5e3 * math.cos(2.0 * math.pi * k / 24.0 + 0.3)
            )
            for k in range(24)
        ]
        assert told[:-1] == [None] * 23
        assert told[-1] == pytest.approx(gap_of(5e3, jerk, self.INERTIA, self.WINDUP), rel=1e-6)

    @pytest.mark.parametrize("way", [1.0, -1.0])
    @pytest.mark.parametrize(("beyond_nm", "known"), [(0.0, False), (1.0, True)])
    def test_the_flank_is_known_beyond_its_torque_and_not_at_it(
        self, beyond_nm: float, known: bool, way: float
    ) -> None:
        """On one side exactly, on the other far beyond; at the end of a ramp that fades, of either direction."""
        for begin, end in ((self.FLANK + beyond_nm, -9e3), (9e3, -self.FLANK - beyond_nm)):
            swing = FlankSwing(self.INERTIA, self.WINDUP, self.FLANK, self.SAMPLE_S)
            acc = -way * self.JERK * self.SAMPLE_S
            swing.sample(0.0, way * begin, 0.0)
            swing.sample(acc, way * end, 0.0)
            swing.sample(1.1 * acc, way * end, 0.0)
            told = [swing.sample(1.1 * acc, way * end, math.cos(k)) for k in range(60)]
            assert any(gap is not None for gap in told) is known

    def test_a_ramp_that_stays_on_its_flank_tells_nothing(self) -> None:
        assert set(self.told(crossing=False)) == {None}

    @pytest.mark.parametrize("again", [1.0, -1.0])
    def test_a_ramp_that_is_followed_by_another_tells_nothing(self, again: float) -> None:
        assert set(self.told(again=again)) == {None}


def test_the_uncertainty_of_a_running_fit_is_that_of_its_samples() -> None:
    """Of y = 2 + e with e = +-1 in turns, alike 4 at a time, 400 samples are 100: a tenth."""
    fit = RunningFit(1, 0.0, 1.0, 4.0)
    for k in range(400):
        fit.add((1.0,), 2.0 + (-1.0) ** (k // 4))
    solved = fit.solved()
    assert solved is not None
    assert (solved.values[0], solved.deviations[0]) == (pytest.approx(2.0), pytest.approx(0.1))


def test_one_sample_of_one_unknown_has_no_uncertainty_and_two_have() -> None:
    """As many samples as unknowns leave nothing to judge them by: 1 and 3 are 2 with a standard deviation."""
    fit = RunningFit(1, 0.0, 1.0, 1.0)
    fit.add((1.0,), 1.0)
    assert fit.solved() is None
    fit.add((1.0,), 3.0)
    solved = fit.solved()
    assert solved is not None
    # The mean square of what is left is 1, of two samples.
    assert (solved.values[0], solved.deviations[0]) == pytest.approx((2.0, math.sqrt(0.5)))


class TestBounds:
    def test_they_are_twice_the_intervals_of_the_calibration(self) -> None:
        machine = improved_machine()
        assert machine.calibration is not None
        half = machine.calibration.half_width
        moment = machine.calibration.number("moment_sine_nm")
        wanted = 2.0 * (
            math.hypot(half["moment_sine_nm"], half["moment_cosine_nm"])
            + half["friction_load_ratio"] * moment
        )
        # The cosine part of the moment is 2 N m of 16 kN m.
        assert settings_of(machine).moment_bound_nm == pytest.approx(wanted, rel=1e-6)

    @pytest.mark.parametrize(
        ("key", "value", "bound", "wanted"),
        [
            ("moment_nm", 9e3, "moment_bound_nm", 9e3),
            # Beside the backlash that the calibration has.
            ("backlash_deg", 0.01, "backlash_bound_rad", 1.991e-5 + rad(0.01)),
            ("lost_motion_deg", 0.01, "lost_motion_bound_rad", rad(0.01)),
            # Of 12.35 kN m of Coulomb friction and 58 kN m s/rad at 6 deg/s.
            ("friction_ratio", 0.5, "friction_bound_nm", 0.5 * (12350.0 + 58000.0 * rad(6.0))),
        ],
    )
    def test_a_person_may_allow_more(self, key: str, value: float, bound: str, wanted: float) -> None:
        assert getattr(
            settings_of(with_values(improved_machine(), {AT + key: value})), bound
        ) == pytest.approx(wanted, rel=1e-5)

    def test_without_an_interval_nothing_is_watched_and_the_start_says_so(self) -> None:
        machine = improved_machine()
        calibration = machine.calibration
        assert calibration is not None
        bare = calibration.model_copy(update={"half_width": {**calibration.half_width, "friction_nm": 0.0}})
        unknown = calibration.model_copy(
            update={
                "identified": calibration.identified.model_copy(update={"inertia_kg_m2": None}),
                "half_width": {k: v for k, v in calibration.half_width.items() if k != "inertia_kg_m2"},
                "unknown": {**calibration.unknown, "inertia_kg_m2": Unknown.TOO_WIDE},
            }
        )
        for lacking, name in ((bare, "friction_nm"), (unknown, "inertia_kg_m2")):
            assert calibration_watch(machine, lacking) is None
            (line,) = what_is_not_watched(machine.calibrated(lacking))
            assert name in line
        assert what_is_not_watched(machine) == ()

    def test_switched_off_it_watches_nothing(self) -> None:
        off = compensation_settings(with_values(improved_machine(), {AT + "active": False}))
        assert off is not None
        assert off.watch is None


def test_every_finding_has_words_in_both_languages() -> None:
    alarms = AlarmLog()
    alarms.raise_(Code.CTL_22, measured=stale_words({name: Finding(2.0, 1.0) for name in NAMES}))
    (alarm,) = alarms.active.values()
    for word in ("moment", "friction", "backlash", "lost motion", "ring"):
        assert word in alarm.text


def test_the_axis_warns_goes_on_and_warns_again_after_a_reset() -> None:
    rig = powered(improved_machine(), 0.0)
    load_side = rig.program.axis.load_side
    assert load_side is not None
    assert load_side.watch is not None
    load_side.watch.found["moment"] = Finding(20e3, 1.7e3)
    for target in (1.0, 0.0):
        rig.command(move=True, target_rad=rad(target), speed_rad_s=rad(3.0))
        rig.engine.run_for(6.0)
        assert set(rig.program.axis.alarms.active) == {Code.CTL_22}
        assert rig.program.axis.virtual.following
        rig.program.axis.alarms.clear()
        rig.command(move=False)
        rig.engine.run_for(0.1)


@pytest.mark.parametrize(
    ("text", "warned"),
    [("as kept", True), ("", False), ("{", False), ("[1.0]", False), ('{"found": {}}', False)],
)
def test_the_warning_comes_back_with_the_next_start(text: str, *, warned: bool) -> None:
    axis = build_engine(improved_machine()).program.axis
    assert axis.load_side is not None
    assert axis.load_side.watch is not None
    found = {"moment": Finding(20e3, 1.7e3)}
    axis.load_side.watch.found = dict(found)
    kept = json.dumps(axis.calibration_memory) if text == "as kept" else text
    again = build_engine(improved_machine()).program.axis
    restore_learned(again, Retained("hust_improved", "0", calibration_watch=kept))
    assert again.load_side is not None
    assert again.load_side.watch is not None
    assert again.load_side.watch.found == (found if warned else {})
    assert set(again.alarms.active) == ({Code.CTL_22} if warned else set())


def test_a_machine_whose_gears_are_stiff_is_watched_without_their_swing() -> None:
    watch = new_watch(windup_per_acc_s2=0.0)
    for vel in (0.0, 0.05):
        for _ in range(100):
            watch.scan(0.1, vel, 0.0, 0.0, 0.0)
    assert not watch.rest()
    assert watch.seen == {}, "two seconds say nothing"


def test_ten_gaps_beyond_the_bound_are_a_finding_and_nine_are_none() -> None:
    watch = new_watch(used_s=1400.0, backlash_bound_rad=1e-4)
    for gaps in range(1, 11):
        watch._gap.add(5e-4)
        watch.scan(0.1, 0.05, 0.0, 0.0, 0.0)
        assert watch.rest() is (gaps == 10)
    assert watch.found["backlash"] == pytest.approx((5e-4, 1e-4))


@pytest.mark.parametrize(("used_s", "judged"), [(1360.0, False), (1375.0, True)])
def test_what_follows_the_temperature_of_the_gears_is_judged_after_a_day(used_s: float, judged: bool) -> None:
    """A memory of 1200 s is 68 % full after 1200 s ln(1 / 0.32) = 1367 s: some 40 moves."""
    watch = new_watch(used_s=used_s, backlash_bound_rad=1e-4)
    for _ in range(30):
        watch._gap.add(5e-4)
    watch.scan(0.1, 0.05, 0.0, 0.0, 0.0)
    assert watch.rest() is judged
    assert ("backlash" in watch.seen) is judged


def test_the_mean_of_three_gaps_is_as_sure_as_three_values_make_it() -> None:
    """1, 2 and 3: mean 2, and a standard deviation of the mean of 1 / sqrt(3)."""
    running = _Running()
    for value in (1.0, 2.0, 3.0):
        running.add(value)
    assert (running.count, running.mean) == (3, pytest.approx(2.0))
    assert running.deviation == pytest.approx(3.0**-0.5)


def test_the_gaps_of_long_ago_count_less_than_the_last_forty() -> None:
    """After 200 of nothing 40 of 1 leave (1 - 1/40)^40 = 0.363 of the old mean; all alike would be 1/6."""
    running = _Running()
    for value in (*(0.0,) * 200, *(1.0,) * 40):
        running.add(value)
    assert running.mean == pytest.approx(1.0 - 0.3632, abs=1e-3)
