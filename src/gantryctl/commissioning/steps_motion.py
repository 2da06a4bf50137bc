"""Steps with the position loop closed (loop, stops, slow turn), then bands from data."""

from __future__ import annotations

import math
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Final

import numpy as np

from gantryctl.commissioning.load_side.ring import BothEncoders, has_ring
from gantryctl.commissioning.open_loop_axis import OpenLoopAxis, open_loop_axis, state_name
from gantryctl.commissioning.pictures import POINTS, MotionSample
from gantryctl.commissioning.results import Context, Figure, Outcome, StepResult, failed, figure_text, judged
from gantryctl.commissioning.stopping.quick_stop import (
    CRUISE_S,
    computed_way_deg,
    measure_quick_stop,
    permitted_way_deg,
    trial_acc_deg_s2,
    trial_speed_deg_s,
)
from gantryctl.commissioning.stopping.silence import Silence, Way, fall_silent, watched_ways
from gantryctl.engineering.report.pictures import Panel, Picture, line
from gantryctl.errors import AlarmStop
from gantryctl.machine import Machine
from gantryctl.machine.derived import rigid_stop
from gantryctl.machine.places import reach_deg
from gantryctl.machine.rules.reaction import REACTION_S, silent_way_deg
from gantryctl.operation.client import Snapshot
from gantryctl.operation.ledger.rows import RAMP_DEG_S2, SILENT_STOP_S
from gantryctl.operation.run import AxisRun
from gantryctl.runtime.recorder import MemoryRecorder
from gantryctl.trace.table import Trace
from gantryctl.units import deg

_SMALL_DEG: Final = 1.0
# As far as the axis may turn so fast, and stops near enough.
_STOP_SPEEDS: Final = (1.0, 3.0)
# Beyond ramp, cruise and permitted stop: lag of the drive, sag when the brake opens and closes.
_LEASH_SPARE_DEG: Final = 0.3
# A key is held for so long, or for so far.
_JOG_S: Final = 3.0
_JOG_WAY_DEG: Final = 8.0
# Of the deceleration that was set: ripple of the ramp as the virtual drive shows it, 3 % at 1 deg/s.
_HARDER: Final = 1.15
_TOO_LONG: Final = "605A, 6085, torque limit, [virtual_axis] quick_dec_deg_s2; nothing faster before"
_NOT_THERE: Final = "gains of the drive, [control] kpp_per_s, dead time"
_TURN_DEG_S: Final = 3.0
_MARGIN_DEG: Final = 2.0
# Over less than this a sine and a constant cannot be told apart well.
_WHOLE_DEG: Final = 300.0


@contextmanager
def _recorded_run(c: Context, part: str) -> Iterator[tuple[AxisRun, MemoryRecorder]]:
    """A run and its recorder, powered down at its end; `part` is the title of its picture.

    Raises:
        StepStopped: a person has stopped the step.
    """
    run = AxisRun(
        c.machine, c.store, recorder=MemoryRecorder, commissioning=True, observer=c.watch.observer()
    )
    recorder = run.engine.recorder
    assert isinstance(recorder, MemoryRecorder)
    alarm = None
    try:
        with c.watch.halt.stops(run):
            yield run, recorder
        run.power_down()
    except AlarmStop as stopped:
        # An alarm holds the axis until it is acknowledged, as in operation.
        alarm = stopped
        raise
    finally:
        run.close("commissioning", alarm)
        c.watch.draw(part, _samples(recorder.trace()))


def _samples(trace: Trace) -> list[MotionSample]:
    if not len(trace):
        return []
    way = trace["pos_act_rad"] - trace["pos_act_rad"][0]
    columns = (*(np.degrees(trace[name]) for name in ("vel_ref_rad_s", "vel_act_rad_s")), np.degrees(way))
    rows = np.column_stack((trace["time_s"], *columns, trace["torque_act_nm"]))
    return [MotionSample(*row) for row in rows[:: max(1, len(rows) // (4 * POINTS))].tolist()]


def _there_and_back(c: Context, part: str, way_deg: float, speed_deg_s: float) -> tuple[Trace, bool]:
    """Power up, move by a way and back, power down; the trace, and whether both moves were done."""
    with _recorded_run(c, part) as (run, recorder):
        # Away from the end of the travel; by ways, for back to an angle a modulo axis may go round.
        way = math.copysign(way_deg, c.machine.axis.start_angle_deg - run.angle_deg)
        done = [run.move_by(each, speed_deg_s).done for each in (way, -way)]
    return recorder.trace(), all(done)


def loop(c: Context) -> StepResult:
    """Move a degree there and back with the position loop closed."""
    speed = c.machine.speed.setting_min_deg_s
    trace, done = _there_and_back(c, "1 deg and back", _SMALL_DEG, speed)
    error = deg(float(np.max(np.abs(trace["pos_err_rad"]))))
    band = (
        c.machine.monitors.following_error_base_deg + c.machine.monitors.following_error_per_speed_s * speed
    )
    rest = _rest_error_deg(trace)
    proof = f"largest following error {error:.5f} deg at {speed:g} deg/s (band {band:.3f}), {rest:.6f} deg at rest"
    to_do = _NOT_THERE
    following = Figure(error, high=band)
    return judged(done, "loop", proof, to_do, following_error_deg=following, rest_error_deg=rest)


def _rest_error_deg(trace: Trace) -> float:
    """Largest error in the last second before power went down, after the set-point had come to rest."""
    at_rest = np.flatnonzero(np.abs(trace["vel_ref_rad_s"]) == 0.0)
    moving = np.flatnonzero(trace["vel_ref_rad_s"])
    after = at_rest[at_rest > moving[-1]] if len(moving) else at_rest
    tail = after[len(after) // 2 :]
    return deg(float(np.max(np.abs(trace["pos_err_rad"][tail])))) if len(tail) else 0.0


def stops(c: Context) -> StepResult:
    """Measure quick stop and silence from two speeds and jog release from one, against the computed angles."""
    figures: dict[str, Figure] = {}
    decs: list[float] = []
    direction = 1.0
    for speed in _stop_speeds(c):
        for stop in (_quick_stop, _silent_stop):
            try:
                what, measured, computed = stop(c, direction * speed, decs)
            # What is too long at one speed is not tried at a higher one.
            except AlarmStop as stopped:
                return failed("stops", str(stopped), _TOO_LONG, **figures)
            # Forward and back: the gantry ends near where it began.
            direction = -direction
            _add(c, figures, what, speed, measured, computed)
    speed = c.machine.speed.setting_min_deg_s
    virtual = c.machine.virtual_axis
    computed = rigid_stop(speed, virtual.jog_release_dec_deg_s2, virtual.jog_release_jerk_deg_s3)[0]
    _add(c, figures, "jog release", speed, _jog_release(c, speed), computed)
    longest = max(figure.value or 0.0 for key, figure in figures.items() if "measured" in key)
    figures["slowest_ramp_deg_s2"] = Figure(min(decs, default=math.nan))
    proof = f"{len(figures) // 2} stops, largest {longest:.3f} deg"
    return judged(True, "stops", proof, _TOO_LONG, **figures)


def _stop_speeds(c: Context) -> tuple[float, float]:
    """1 and 3 deg/s; where the axis is not so fast, or stops too far, what it permits, and half of that at most."""
    slow, fast = _STOP_SPEEDS
    fast = min(fast, trial_speed_deg_s(c.machine), c.speed_max_deg_s)
    return min(slow, 0.5 * fast), fast


def _add(
    c: Context, figures: dict[str, Figure], what: str, speed: float, measured: float, computed: float
) -> None:
    """Tell a stop, and add it to the figures."""
    c.say(f"  {what} from {speed:g} deg/s: {measured:.3f} deg, computed {computed:.3f} deg")
    key = f"{what}_{speed:g}".replace(" ", "_").replace(".", "p")
    figures[f"{key}_measured_deg"] = Figure(measured, high=computed + speed * REACTION_S)
    figures[f"{key}_computed_deg"] = Figure(computed)


@contextmanager
def _at_speed(c: Context, what: str, speed: float, way_deg: float) -> Iterator[OpenLoopAxis]:
    """The axis at a speed, with the position loop open, on a leash that ends with the permitted stop."""
    acc = trial_acc_deg_s2(c.machine)
    leash = speed * speed / (2.0 * acc) + CRUISE_S * abs(speed) + way_deg + _LEASH_SPARE_DEG
    with open_loop_axis(c, leash, f"{what} from {speed:+g} deg/s", way=speed) as axis:
        axis.enable()
        axis.ramp_to(speed, acc)
        axis.run(CRUISE_S, speed_deg_s=speed)
        yield axis


def _ramp_deg_s2(c: Context) -> float:
    """Quick-stop deceleration: that which the drive was given, or its own as it was measured."""
    own = c.results.get("ramp")
    measured = own is not None and own.outcome is Outcome.PASSED
    return (
        own.number(RAMP_DEG_S2) if own is not None and measured else c.machine.virtual_axis.quick_dec_deg_s2
    )


def _quick_stop(c: Context, speed: float, decs: list[float]) -> tuple[str, float, float]:
    """Name, measured and computed way of a quick stop; its deceleration is added to `decs`."""
    dec = _ramp_deg_s2(c)
    with _at_speed(c, "quick stop", speed, permitted_way_deg(speed, dec)) as axis:
        seen = measure_quick_stop(axis, speed, dec)
    # Reducer and motor are checked with the ramp of the machine file, and a harder one loads them more (NaN: too hard).
    if not seen.dec_deg_s2 - seen.uncertainty_deg_s2 <= _HARDER * dec:
        raise AlarmStop(
            f"quick stop from {abs(speed):g} deg/s is too hard: {seen.dec_deg_s2:.2f} deg/s2, {dec:.2f} deg/s2 were set"
        )
    decs.append(seen.dec_deg_s2)
    return "quick stop", seen.way_deg, computed_way_deg(speed, dec)


def _silent_stop(c: Context, speed: float, _decs: list[float]) -> tuple[str, float, float]:
    """Name, measured and computed way of the stop by the drive alone, its controller silent in every way.

    Raises:
        AlarmStop: the drive did not stop, or not within the permitted way: it was broken off.
    """
    dec = _ramp_deg_s2(c)
    with _at_speed(c, "silence", speed, c.machine.required.stopping_angle_deg) as axis:
        own = watched_ways(axis)
        if own:
            # The way that acts first counts.
            delay_s = min(way.limit_s(axis.drive) for way in own)
            computed = silent_way_deg(c.machine, speed, 1e3 * delay_s, dec_deg_s2=dec)
        else:
            # A watchdog beside the drive takes the torque off, and there is no ramp.
            delay_s = _watchdog_s(c)
            computed = silent_way_deg(c.machine, speed, 1e3 * delay_s, brake=True)
        permitted = computed + abs(speed) * REACTION_S
        silence = Silence(tuple(Way), delay_s, permitted, abs(speed) / dec)
        seen = fall_silent(axis, silence, speed)
        if not seen.stopped:
            ended = seen.broken_off or f"{state_name(seen.state)}, brake open: {seen.brake_open}"
            raise AlarmStop(f"silence at {abs(speed):g} deg/s: {ended}")
        axis.wake()
    return "silence", seen.way_deg, computed


def _watchdog_s(c: Context) -> float:
    """Time after which the watchdog beside the drive acts, as its step has shown it.

    Raises:
        AlarmStop: it has not passed.
    """
    shown = c.results.get("watchdog")
    if shown is None or shown.outcome is not Outcome.PASSED:
        raise AlarmStop("nothing in this drive watches the controller, and the step watchdog has not passed")
    return shown.number(SILENT_STOP_S)


def _jog_release(c: Context, speed: float) -> float:
    """Measure a jog release: from the end of constant speed to rest."""
    with _recorded_run(c, f"jog release from {speed:g} deg/s") as (run, recorder):
        run.jog(run.angle_deg < c.machine.axis.start_angle_deg, speed, min(_JOG_S, _JOG_WAY_DEG / speed))
    trace = recorder.trace()
    vel, pos = np.abs(trace["vel_ref_rad_s"]), trace["pos_act_rad"]
    # From the last scan at full speed, as the jog key is let go there.
    cruising = np.flatnonzero(vel >= np.max(vel) * (1.0 - 1e-9))
    return abs(deg(float(pos[-1] - pos[cruising[-1]])))


def turn_speed_deg_s(machine: Machine) -> float:
    """Speed of the slow turn: 3 deg/s, or the speed setting that is nearest to it."""
    return min(max(_TURN_DEG_S, machine.speed.setting_min_deg_s), machine.speed.setting_max_deg_s)


def slow_turn(c: Context) -> StepResult:
    """Fit friction and eccentric moment to the torque over the angle, both ways."""
    least, most = reach_deg(c.machine)
    low, high = least + _MARGIN_DEG, most - _MARGIN_DEG
    # Forward to the end and from the other end back to where it began: both ways are whole.
    with _recorded_run(c, "the whole travel") as (run, recorder):
        # What the drive lacks may make the axis slower than its machine file does.
        speed = min(turn_speed_deg_s(c.machine), run.speed_max_deg_s)
        encoders, progress = BothEncoders(run), c.watch.observer()

        def look(snapshot: Snapshot) -> None:
            progress(snapshot)
            encoders.look()

        run.observe(look)
        done = [run.move(target, speed).done for target in (high, low, c.machine.axis.start_angle_deg)]
    if not all(done):
        return failed("turn", "a move of the travel did not end in position", _NOT_THERE, speed_deg_s=speed)
    trace = recorder.trace()
    ratio = c.machine.axis.ratio
    vel = trace["vel_ref_rad_s"]
    # Constant speed only: inertia has no part in it.
    steady = np.abs(vel) > np.max(np.abs(vel)) * (1.0 - 1e-6)
    angle, torque = trace["pos_act_rad"][steady], trace["torque_act_nm"][steady] * ratio
    direction = np.sign(vel[steady])
    error = deg(float(np.max(np.abs(trace["pos_err_rad"]))))
    beside, compared = encoders.compared() if has_ring(c.machine) else ("", {})
    to_do = "[can.load_encoder]: zero_counts as proposed, counts_per_turn, its coupling to the ring"
    # A drive without 6077 shows no torque in any scan.
    if not np.any(torque):
        proof = f"the whole travel at {speed:g} deg/s; the drive tells no torque: moment and friction are not measured"
        return judged(
            True, "turn", proof + beside, to_do, following_error_deg=error, speed_deg_s=speed, **compared
        )
    # Torque at the gantry over the angle: friction changes sign with the direction, the moment is sine and
    # cosine.
    model = np.column_stack((direction, np.sin(angle), np.cos(angle), np.ones_like(angle)))
    (friction, sine, cosine, constant), *_ = np.linalg.lstsq(model, torque, rcond=None)
    rest = float(np.std(torque - model @ np.array((friction, sine, cosine, constant))))

    def knm(torque_nm: float, *, signed: bool = False) -> str:
        return figure_text(torque_nm / 1e3, 2, signed=signed)

    whole = most - least >= _WHOLE_DEG
    moment = math.hypot(sine, cosine)
    figures = {
        "friction_nm": float(friction),
        "remainder_nm": rest,
        "following_error_deg": error,
        "speed_deg_s": speed,
    }
    proof = (
        f"friction {knm(friction)} kN m at {speed:g} deg/s; the travel is too short for the eccentric moment"
    )
    if whole:
        figures |= {"moment_sine_nm": float(sine), "moment_cosine_nm": float(cosine)}
        proof = (
            f"eccentric moment {knm(moment)} kN m (sine {knm(sine, signed=True)}, cosine {knm(cosine, signed=True)}), "
            f"friction {knm(friction)} kN m at {speed:g} deg/s, remainder {knm(rest)} kN m rms, at the load"
        )
    order = np.argsort(angle)
    both = [(way, order[direction[order] == sign]) for way, sign in (("forward", 1.0), ("back", -1.0))]
    degrees = np.degrees(angle)
    lines = [line(way, degrees[chosen], torque[chosen] / 1e3, POINTS) for way, chosen in both]
    fitted = model @ np.array((friction, sine, cosine, constant)) / 1e3
    lines += [line(f"{way}, fitted", degrees[chosen], fitted[chosen], POINTS) for way, chosen in both]
    panel = Panel("angle, deg", "torque at the load, kN m", tuple(lines), x_dial=c.machine.axis.dial)
    c.watch.pictures.append(Picture("torque over the angle", (panel,)))
    return judged(True, "turn", proof + beside, to_do, **figures, **compared)


# Bands are proposed at twice what was measured, and refused below one and a half.
_RESERVE: Final = 2.0
_LEAST: Final = 1.5


def bands(c: Context) -> StepResult:
    """Propose bands of twice the measured errors, beside those of the machine file."""
    # Errors at rest come from `loop`, those at speed from `turn`.
    shown = {key for key, result in c.results.items() if result.outcome is Outcome.PASSED}
    if not {"loop", "turn"} <= shown:
        return failed("bands", "nothing to propose from", "run the steps loop and turn first")
    rest, turn = c.results["loop"].number("rest_error_deg"), c.results["turn"]
    seen, speed = turn.number("following_error_deg"), turn.number("speed_deg_s")
    monitors = c.machine.monitors
    window = max(_RESERVE * rest, 0.0005)
    following = max(_RESERVE * seen, 0.005)
    limit = monitors.following_error_base_deg + monitors.following_error_per_speed_s * speed
    proof = (
        f"in position: {window:.4f} deg from data, [monitors] in_position_window_deg = "
        f"{monitors.in_position_window_deg:g}; following error at {speed:g} deg/s: {following:.4f} deg "
        f"from data, {limit:.4f} deg in force"
    )
    to_do = "widen the bands of [monitors], or find out why the axis follows so badly"
    return judged(
        True, "bands", proof, to_do,
        rest_error_deg=Figure(rest, high=monitors.in_position_window_deg / _LEAST),
        following_error_deg=Figure(seen, high=limit / _LEAST),
        in_position_proposed_deg=window, following_error_proposed_deg=following,
    )  # fmt: skip
