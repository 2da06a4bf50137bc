"""A controller that misses scans while its axis goes on: nothing is lost, nothing jumps, nothing lasts longer."""

from __future__ import annotations

from itertools import pairwise
from math import inf, radians

from hypothesis import given, settings
from hypothesis import strategies as st

from gantryctl.image import InputImage, Mode, OutputImage
from gantryctl.program import Axis, GantryProgram, PowerPhase
from gantryctl.units import deg
from unit.program.rig import ZERO_COUNTS, Rig
from unit.program.rig import settings as rig_settings

PERIOD_S = 0.004
MOST = 7  # 28 ms: later than 30 ms is a quick stop
LONGEST_S = (MOST + 1) * PERIOD_S
ACC_DEG_S2 = 5.0  # of the jog-release ramp, the hardest of the set-point's
KPP = 10.0
# The speed command stands still for a stall, the set-point goes on: the speed is off by acc x stall and the way by half
# of that x stall. The loop brings it back; a second stall may come before. In steady acceleration it lags acc T / Kpp.
ERROR_DEG = ACC_DEG_S2 * (LONGEST_S**2 + PERIOD_S / KPP)
STEP_DEG_S = ACC_DEG_S2 * LONGEST_S + KPP * ERROR_DEG

stalls = st.lists(st.tuples(st.integers(3, 400), st.integers(1, MOST)), min_size=1, max_size=12)


def stalling(found: list[tuple[int, int]], **arguments: object) -> Rig:
    """A rig in power; then so many scans apart so many are missed, over and over. Everything is watched."""
    rig = Watched(config=rig_settings(period_s=PERIOD_S, jerk=inf, hold_brake_after_s=1.0), **arguments)
    rig.power_up()
    missed, scan = {}, rig.scan
    for k in range(60):
        apart, periods = found[k % len(found)]
        scan += apart
        missed[scan] = periods
        scan += periods
    rig.missed = lambda scan: missed.get(scan, 0)
    return rig


class Watched(Rig):
    """Every scan: the following error, the step of the speed command, the travel."""

    def step(self) -> None:
        before, on = self.output.vel_cmd_rad_s, self.axis.virtual.following
        super().step()
        if not (on and self.axis.virtual.following):
            return
        assert abs(deg(self.axis.pos_err_rad)) <= ERROR_DEG
        step = deg(self.output.vel_cmd_rad_s - before) / self.axis.settings.law.ratio
        assert abs(step) <= STEP_DEG_S
        assert abs(self.pos_deg) <= 180.0 + ERROR_DEG


@settings(max_examples=60)
@given(stalls, st.sampled_from([0.5, 4.0, 12.0]), st.sampled_from([1.0, 6.0]))
def test_a_move_arrives_where_and_when_it_would_have(
    found: list[tuple[int, int]], target: float, speed: float
) -> None:
    rig = stalling(found)
    begun, ref, act = rig.scan, [rig.ref_deg], [rig.pos_deg]
    rig.move(target, speed)
    while not rig.program.move.done:
        rig.step()
        ref.append(rig.ref_deg)
        act.append(rig.pos_deg)
        assert rig.scan < begun + 100 / PERIOD_S
    assert min(b - a for a, b in pairwise(ref)) >= 0.0
    assert min(b - a for a, b in pairwise(act)) >= -ERROR_DEG
    assert abs(ref[-1] - target) < 1e-9
    plan = rig.axis.virtual.plan.duration
    dwell = rig.axis.settings.monitors.in_position_dwell_s
    settling = 0.5  # the loop takes ln(ERROR / window) / Kpp to come into the window
    late = (rig.scan - begun) * PERIOD_S - plan - dwell
    assert -PERIOD_S < late < settling + 3 * LONGEST_S  # a stall in the window's first scan proves nothing
    assert not rig.codes


@settings(max_examples=60)
@given(stalls, st.floats(0.1, 2.5), st.sampled_from([1.0, 6.0]), st.booleans())
def test_a_jog_ends_with_its_key_or_its_lease(
    found: list[tuple[int, int]], held_s: float, speed: float, released: bool
) -> None:
    rig = stalling(found)
    rig.op(mode=Mode.CONTINUOUS, speed_rad_s=radians(speed))
    rig.op(forward=True, lease=1)
    rig.hold_key(held_s)
    rig.op(lease=rig.operator.lease + 1)
    renewed = rig.scan
    lease_s = rig.axis.settings.monitors.lease_s
    if released:
        rig.op(forward=False)
        lease_s = 0.0
    rig.until(lambda: rig.axis.virtual.stopping, 2.0)
    assert (rig.scan - renewed) * PERIOD_S <= lease_s + 3 * LONGEST_S
    before = rig.ref_deg
    rig.until(lambda: rig.axis.virtual.at_rest, 10.0)
    assert rig.ref_deg >= before
    rig.run(1.0)
    assert abs(rig.pos_deg - rig.ref_deg) < 0.001


@settings(max_examples=40)
@given(stalls, st.floats(0.1, 4.0))
def test_a_jog_into_the_end_of_the_travel_stays_inside(found: list[tuple[int, int]], away: float) -> None:
    rig = stalling(found, at_deg=180.0 - away)
    rig.op(mode=Mode.CONTINUOUS, speed_rad_s=radians(6.0))
    rig.op(forward=True, lease=1)
    for _ in range(70):
        rig.hold_key(0.03)
        assert rig.ref_deg <= 180.0 + 1e-9
    assert abs(rig.ref_deg - 180.0) < 1e-9


@settings(max_examples=40)
@given(stalls, st.floats(0.0, 4.0))
def test_a_quick_stop_and_its_brake_take_no_longer(found: list[tuple[int, int]], after_s: float) -> None:
    def time_to_off(rig: Rig) -> float:
        rig.move(60.0)
        rig.run(after_s)
        begun = rig.scan
        rig.op(quick_stop=True)
        rig.until(lambda: rig.axis.power.phase is PowerPhase.OFF, 10.0)
        assert not rig.drive.brake_open
        assert rig.codes == ["INT-06"]
        return (rig.scan - begun) * PERIOD_S

    phases = 5  # quick stopping, closing, unloading, disabling: each may end in a stall
    assert time_to_off(stalling(found)) < time_to_off(stalling([(400, 0)])) + phases * LONGEST_S


@settings(max_examples=40)
@given(stalls)
def test_power_goes_off_and_on_again_without_an_alarm(found: list[tuple[int, int]]) -> None:
    rig = stalling(found)
    stood = rig.pos_deg
    for _ in range(2):
        begun = rig.scan
        rig.op(power=False)
        rig.until(lambda: rig.axis.power.phase is PowerPhase.OFF, 5.0)
        rig.op(power=True)
        rig.until(lambda: rig.axis.power.phase is PowerPhase.ON, 5.0)
        assert (rig.scan - begun) * PERIOD_S < 1.5
    assert abs(rig.pos_deg - stood) < 1e-4
    assert not rig.codes


@settings(max_examples=15)
@given(stalls)
def test_the_same_images_make_the_same_outputs(found: list[tuple[int, int]]) -> None:
    """A recording of what the program saw, gaps and all, is enough to see again what it did."""
    images: list[InputImage] = []
    outputs: list[OutputImage] = []

    class Kept(Rig):
        def step(self) -> None:
            super().step()
            assert self.image is not None
            images.append(self.image)
            outputs.append(self.output)

    missed = dict.fromkeys(range(0), 0)
    scan = 300
    for apart, periods in found:
        scan += apart
        missed[scan] = periods
        scan += periods
    rig = Kept(config=rig_settings(period_s=PERIOD_S))
    rig.missed = lambda scan: missed.get(scan, 0)
    rig.power_up()
    rig.move(5.0)
    rig.run(4.0)
    again = GantryProgram(Axis(rig_settings(period_s=PERIOD_S), ZERO_COUNTS))
    assert [again.scan(image) for image in images] == outputs
