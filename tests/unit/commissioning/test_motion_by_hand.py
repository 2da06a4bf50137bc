"""Steps with motion by hand: leashes, ways of a stop, the fit of the slow turn, bands."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from gantryctl.commissioning import steps_lacks, steps_motion
from gantryctl.commissioning.results import Figure, Outcome, StepResult
from gantryctl.errors import AlarmStop
from gantryctl.runtime.recorder import MemoryRecorder
from unit.commissioning.hand_drive import MACHINE, HandDrive, axis_of, context

pytestmark = pytest.mark.can


@pytest.mark.parametrize("speed", [3.0, -3.0])
def test_the_leash_of_a_stop_ends_with_the_way_that_it_may_take(
    monkeypatch: pytest.MonkeyPatch, speed: float
) -> None:
    """1 deg/s2: 4.5 deg to 3 deg/s, 1.5 at it, 2 of the stop, and 0.3 to spare."""
    asked: list[Any] = []

    @contextmanager
    def opened(c: object, leash_deg: float, part: str, **_: object) -> Iterator[SimpleNamespace]:
        asked.append(leash_deg)
        yield SimpleNamespace(
            enable=lambda: asked.append("enable"),
            ramp_to=lambda *to: asked.append(to),
            run=lambda seconds, speed_deg_s: asked.append((seconds, speed_deg_s)),
        )

    monkeypatch.setattr(steps_motion, "open_loop_axis", opened)
    with steps_motion._at_speed(context(), "stop", speed, 2.0):
        assert asked == [pytest.approx(8.3), "enable", (speed, 1.0), (0.5, speed)]


class Moves:
    """A run of the axis: what it was told, and the trace that it leaves."""

    speed_max_deg_s = 6.0

    def __init__(self, monkeypatch: pytest.MonkeyPatch, angle_deg: float, **trace: Any) -> None:
        self.angle_deg, self.told = angle_deg, list[tuple[Any, ...]]()
        recorder = SimpleNamespace(trace=lambda: {name: np.array(rows) for name, rows in trace.items()})

        @contextmanager
        def recorded(c: object, part: str) -> Iterator[tuple[Moves, SimpleNamespace]]:
            yield self, recorder

        monkeypatch.setattr(steps_motion, "_recorded_run", recorded)

    def observe(self, look: Any) -> None:
        self.look = look

    def move(self, *target: float) -> SimpleNamespace:
        self.told.append(target)
        return SimpleNamespace(done=True)

    def jog(self, *how: Any) -> None:
        self.told.append(how)


@pytest.mark.parametrize(("angle_deg", "forward"), [(10.0, False), (-10.0, True)])
def test_a_jog_goes_to_the_middle_and_its_release_is_measured_from_its_last_scan_at_speed(
    monkeypatch: pytest.MonkeyPatch, angle_deg: float, forward: bool
) -> None:
    sign = 1.0 if forward else -1.0
    moves = Moves(
        monkeypatch, angle_deg,
        vel_ref_rad_s=[0.0, sign * 0.5, sign, sign, sign * 0.5, 0.0],
        pos_act_rad=np.radians(sign * np.array([0.0, 0.1, 0.3, 0.6, 0.8, 0.85])),
    )  # fmt: skip
    assert steps_motion._jog_release(context(), 0.6) == pytest.approx(0.25)
    assert moves.told == [(forward, 0.6, 3.0)]


def turned(monkeypatch: pytest.MonkeyPatch) -> Moves:
    """5 kN m of friction, 3 kN m of sine and 1 kN m of cosine, and 1 kN m more in the ramps, at the ring."""
    there = np.arange(-178.0, 179.0)
    angle = np.concatenate((there, there[::-1]))
    way = np.concatenate((np.ones(len(there)), -np.ones(len(there))))
    ramp = np.abs(angle) > 170.0
    torque = 5e3 * way + 3e3 * np.sin(np.radians(angle)) + 1e3 * np.cos(np.radians(angle)) + 1e3 * ramp
    return Moves(
        monkeypatch, 0.0,
        vel_ref_rad_s=np.radians(3.0) * way * np.where(ramp, 0.5, 1.0), pos_act_rad=np.radians(angle),
        torque_act_nm=torque / 1144.0, pos_err_rad=np.radians(np.where(angle == 175.0, -0.01, 0.004)),
    )  # fmt: skip


def test_the_slow_turn_fits_friction_and_moment_at_constant_speed(monkeypatch: pytest.MonkeyPatch) -> None:
    moves = turned(monkeypatch)
    monkeypatch.setattr(steps_motion, "reach_deg", lambda _: (-180.0, 180.0))
    found = steps_motion.slow_turn(context())
    assert moves.told == [(178.0, 3.0), (-178.0, 3.0), (0.0, 3.0)]
    assert {name: found.number(name) for name in found.figures} == pytest.approx(
        {
            "friction_nm": 5e3, "moment_sine_nm": 3e3, "moment_cosine_nm": 1e3, "remainder_nm": 0.0,
            "following_error_deg": 0.01, "speed_deg_s": 3.0,
        },
        abs=1e-6,
    )  # fmt: skip
    assert "eccentric moment 3.16 kN m (sine +3.00, cosine +1.00), friction 5.00 kN m" in found.proof


def test_a_picture_of_a_run_shows_its_way_from_where_it_began() -> None:
    """2 deg from 10 deg on, 3 deg/s commanded, 2.9 seen; 3,000 scans become one in each, half a picture."""

    class Rows(dict[str, Any]):
        def __len__(self) -> int:
            return len(self["time_s"])

    def samples(count: int) -> Any:
        there = np.arange(count)
        return steps_motion._samples(
            Rows(
                time_s=there * 0.004, vel_ref_rad_s=np.radians(3.0 + 0.0 * there), torque_act_nm=there * 1.0,
                vel_act_rad_s=np.radians(2.9 + 0.0 * there), pos_act_rad=np.radians(10.0 + 2.0 * there / (count - 1)),
            )  # type: ignore[arg-type]
        )  # fmt: skip

    first, *_, last = samples(5)
    assert first == pytest.approx((0.0, 3.0, 2.9, 0.0, 0.0))
    assert last == pytest.approx((0.016, 3.0, 2.9, 2.0, 4.0))
    # 2,400 points are four in each of those that are drawn.
    assert [len(samples(count)) for count in (2399, 4799, 4800)] == [2399, 4799, 2400]
    assert steps_motion._samples(Rows(time_s=[])) == []  # type: ignore[arg-type]


def test_the_slow_turn_is_watched_and_both_encoders_are_looked_at(monkeypatch: pytest.MonkeyPatch) -> None:
    moves, seen = turned(monkeypatch), list[object]()
    monkeypatch.setattr(
        steps_motion, "BothEncoders", lambda _: SimpleNamespace(look=lambda: seen.append("both"))
    )
    c = context()
    monkeypatch.setattr(c.watch, "observer", lambda: seen.append)
    steps_motion.slow_turn(c)
    moves.look("a picture")
    assert seen == ["a picture", "both"]


@pytest.mark.parametrize(("most_deg", "whole"), [(150.0, True), (149.9, False)])
def test_less_than_300_deg_tell_no_moment(
    monkeypatch: pytest.MonkeyPatch, most_deg: float, whole: bool
) -> None:
    turned(monkeypatch)
    monkeypatch.setattr(steps_motion, "reach_deg", lambda _: (-150.0, most_deg))
    found = steps_motion.slow_turn(context())
    assert ("moment_sine_nm" in found.figures) is whole
    assert ("too short for the eccentric moment" in found.proof) is not whole


def test_bands_are_proposed_at_twice_what_was_measured() -> None:
    results = {
        "loop": StepResult("loop", Outcome.PASSED, "", {"rest_error_deg": Figure(0.004)}),
        "turn": StepResult(
            "turn", Outcome.PASSED, "", {"following_error_deg": Figure(0.01), "speed_deg_s": Figure(3.0)}
        ),
    }
    found = steps_motion.bands(context(MACHINE, **results))
    assert found.number("in_position_proposed_deg") == pytest.approx(0.008)
    assert found.number("following_error_proposed_deg") == pytest.approx(0.02)


@pytest.mark.parametrize("direction", [1.0, -1.0])
def test_what_a_drive_gives_before_a_push_is_no_part_of_it(direction: float) -> None:
    """2 N m of its own, one way or the other: 20 N m are given, and 21 may be."""
    axis = axis_of(HandDrive(torque_nm=2.0 * direction), following=False)
    assert steps_lacks._push(axis, 20.0, 21.0) == pytest.approx(20.0)


def test_a_drive_that_takes_no_torque_is_not_pushed(step: Any) -> None:
    drive = HandDrive()
    drive.torque_preload = False
    held = {"plus_nm": Figure(70.0), "minus_nm": Figure(-70.0)}
    found = step(steps_lacks, "torque", drive, brake=StepResult("brake", Outcome.PASSED, "", held))
    assert found.outcome is Outcome.NOT_TESTABLE
    assert "60B2" in found.proof
    assert not drive.wrote


def test_a_move_is_made_without_the_record_that_it_is_for_and_is_watched(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    opened: list[dict[str, Any]] = []

    def run(*_: object, **how: Any) -> None:
        opened.append(how)
        raise AlarmStop("enough")

    monkeypatch.setattr(steps_motion, "AxisRun", run)
    c = context()
    monkeypatch.setattr(c.watch, "observer", lambda: "who watches")
    with pytest.raises(AlarmStop, match="enough"):
        steps_motion.loop(c)
    assert opened == [{"recorder": MemoryRecorder, "commissioning": True, "observer": "who watches"}]
