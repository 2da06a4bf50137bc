"""Steps with the position loop closed (loop, stops, slow turn), then bands from data and the accuracy test."""

from __future__ import annotations

import math
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Final

import numpy as np

from gantryctl.commissioning.open_loop_axis import open_loop_axis
from gantryctl.commissioning.results import Context, Figure, Outcome, StepResult, failed, judged, passed
from gantryctl.commissioning.steps_power import reset
from gantryctl.engineering.accuracy.procedure.on_engine import run_on_engine
from gantryctl.engineering.accuracy.procedure.procedures import chord_procedure, evaluate
from gantryctl.engineering.accuracy.statistics import accuracy_a
from gantryctl.errors import AlarmStop
from gantryctl.image import DriveRequest, DriveState
from gantryctl.machine.derived import rigid_stop
from gantryctl.machine.rules.reaction import REACTION_S
from gantryctl.operation.run import AxisRun
from gantryctl.runtime.recorder import MemoryRecorder
from gantryctl.trace.table import Trace
from gantryctl.units import deg

_SMALL_DEG: Final = 1.0
_STOP_SPEEDS: Final = (1.0, 3.0)
_STOP_ACC: Final = 1.0
_TURN_SPEED: Final = 3.0
_MARGIN_DEG: Final = 2.0
# Over less than this a sine and a constant cannot be told apart well.
_WHOLE_DEG: Final = 300.0


@contextmanager
def _recorded_run(c: Context) -> Iterator[tuple[AxisRun, MemoryRecorder]]:
    """A run and its recorder, powered down at its end."""
    run = AxisRun(c.machine, c.store, recorder=MemoryRecorder, commissioning=True)
    recorder = run.engine.recorder
    assert isinstance(recorder, MemoryRecorder)
    alarm = None
    try:
        yield run, recorder
        run.power_down()
    except AlarmStop as stopped:
        # An alarm holds the axis until it is acknowledged, as in operation.
        alarm = stopped
        raise
    finally:
        run.close("commissioning", alarm)


def _move(c: Context, targets: tuple[float, ...], speed_deg_s: float, by: bool = False) -> tuple[Trace, bool]:
    """Power up, move to every target, power down; the trace, and whether every move was done."""
    done = True
    with _recorded_run(c) as (run, recorder):
        start = run.angle_deg
        for target in targets:
            done = run.move(start + target if by else target, speed_deg_s).done and done
    return recorder.trace(), done


def loop(c: Context) -> StepResult:
    """Move a degree there and back with the position loop closed."""
    speed = c.machine.speed.setting_min_deg_s
    trace, done = _move(c, (_SMALL_DEG, 0.0), speed, by=True)
    error = deg(float(np.max(np.abs(trace["pos_err_rad"]))))
    band = (
        c.machine.monitors.following_error_base_deg + c.machine.monitors.following_error_per_speed_s * speed
    )
    rest = _rest_error_deg(trace)
    proof = f"largest following error {error:.5f} deg at {speed:g} deg/s (band {band:.3f}), {rest:.6f} deg at rest"
    to_do = "gains of the drive, [control] kpp_per_s, dead time"
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
    virtual, can = c.machine.virtual_axis, c.machine.can
    figures: dict[str, float] = {}
    wrong = []
    direction = 1.0
    for speed in _STOP_SPEEDS:
        # A silent controller stops the axis after the deadline of the process data, at full speed until then.
        for what, delay_s in (("quick stop", 0.0), ("silence", can.rpdo_deadline_ms * 1e-3)):
            measured = _measured_stop(c, what, direction * speed)
            # Forward and back: the gantry ends near where it began.
            direction = -direction
            computed = speed * delay_s + rigid_stop(speed, virtual.quick_dec_deg_s2, math.inf)[0]
            figures |= _figures(f"{what} {speed:g} deg/s", measured, computed)
            if not 0.0 < measured <= computed + speed * REACTION_S:
                wrong.append(f"{what} at {speed:g} deg/s")
            c.say(f"  {what} from {speed:g} deg/s: {measured:.3f} deg, computed {computed:.3f} deg")
    speed = c.machine.speed.setting_min_deg_s
    measured = _jog_release(c, speed)
    computed = rigid_stop(speed, virtual.jog_release_dec_deg_s2, virtual.jog_release_jerk_deg_s3)[0]
    figures |= _figures(f"jog release {speed:g} deg/s", measured, computed)
    c.say(f"  jog release from {speed:g} deg/s: {measured:.3f} deg, computed {computed:.3f} deg")
    if measured > computed + speed * REACTION_S:
        wrong.append("jog release")
    proof = f"{len(figures) // 2} stops, largest {max(figures.values()):.3f} deg"
    to_do = f"too long: {', '.join(wrong)}; 6085, torque limit, [virtual_axis] quick_dec_deg_s2"
    return judged(not wrong, "stops", proof, to_do, **figures)


def _figures(name: str, measured: float, computed: float) -> dict[str, float]:
    key = name.replace(" deg/s", "").replace(" ", "_").replace(".", "p")
    return {f"{key}_measured_deg": measured, f"{key}_computed_deg": computed}


def _measured_stop(c: Context, what: str, speed: float) -> float:
    """Ramp up with the position loop open, stop, and measure the motor-side way from the last command to rest."""
    way = 2.0 * (speed * speed / (2.0 * _STOP_ACC) + 2.0 * abs(speed))
    with open_loop_axis(c.machine, c.store, way + 2.0) as axis:
        axis.enable()
        axis.ramp_to(speed, _STOP_ACC)
        axis.run(0.5, speed_deg_s=speed)
        begun = axis.angle_deg
        if what == "silence":
            axis.fall_silent(process_data=True, heartbeat=True)
            axis.wake()
            if axis.feedback.state is DriveState.FAULT:
                reset(axis)
        else:
            axis.run(abs(speed) / c.machine.virtual_axis.quick_dec_deg_s2 + 1.0, DriveRequest.QUICK_STOP)
        return abs(axis.angle_deg - begun)


def _jog_release(c: Context, speed: float) -> float:
    """Measure a jog release: from the end of constant speed to rest."""
    with _recorded_run(c) as (run, recorder):
        run.jog(run.angle_deg < 0.0, speed, 3.0)
    trace = recorder.trace()
    vel, pos = np.abs(trace["vel_ref_rad_s"]), trace["pos_act_rad"]
    # From the last scan at full speed, as the jog key is let go there.
    cruising = np.flatnonzero(vel >= np.max(vel) * (1.0 - 1e-9))
    return abs(deg(float(pos[-1] - pos[cruising[-1]])))


def slow_turn(c: Context) -> StepResult:
    """Fit friction and eccentric moment to the torque over the angle, both ways."""
    low, high = c.machine.axis.pos_min_deg + _MARGIN_DEG, c.machine.axis.pos_max_deg - _MARGIN_DEG
    speed = min(_TURN_SPEED, c.machine.speed.setting_max_deg_s)
    trace, _ = _move(c, (low, high, low, 0.0), speed)
    ratio = c.machine.axis.ratio
    vel = trace["vel_ref_rad_s"]
    # Constant speed only: inertia has no part in it.
    steady = np.abs(vel) > np.max(np.abs(vel)) * (1.0 - 1e-6)
    angle, torque = trace["pos_act_rad"][steady], trace["torque_act_nm"][steady] * ratio
    direction = np.sign(vel[steady])
    # Torque at the gantry over the angle: friction changes sign with the direction, the moment is sine and
    # cosine.
    model = np.column_stack((direction, np.sin(angle), np.cos(angle), np.ones_like(angle)))
    (friction, sine, cosine, constant), *_ = np.linalg.lstsq(model, torque, rcond=None)
    rest = float(np.std(torque - model @ np.array((friction, sine, cosine, constant))))
    whole = c.machine.axis.pos_max_deg - c.machine.axis.pos_min_deg >= _WHOLE_DEG
    moment = math.hypot(sine, cosine)
    error = deg(float(np.max(np.abs(trace["pos_err_rad"]))))
    figures = {
        "friction_nm": float(friction),
        "remainder_nm": rest,
        "following_error_deg": error,
        "speed_deg_s": speed,
    }
    proof = f"friction {friction / 1e3:.2f} kN m at {speed:g} deg/s; the travel is too short for the eccentric moment"
    if whole:
        figures |= {"moment_sine_nm": float(sine), "moment_cosine_nm": float(cosine)}
        proof = (
            f"eccentric moment {moment / 1e3:.2f} kN m (sine {sine / 1e3:+.2f}, cosine {cosine / 1e3:+.2f}), friction "
            f"{friction / 1e3:.2f} kN m at {speed:g} deg/s, remainder {rest / 1e3:.2f} kN m rms, at the gantry"
        )
    return passed("turn", proof, **figures)


# Bands are proposed at twice what was measured, and refused below one and a half.
_RESERVE: Final = 2.0
_LEAST: Final = 1.5
# The paper's table 1.
_CRITERION_DEG: Final = 0.1


def bands(c: Context) -> StepResult:
    """Propose bands of twice the measured errors, beside those of the machine file."""
    # Errors at rest come from `loop`, those at speed from `turn`.
    if not {"loop", "turn"} <= set(c.results):
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


def accuracy(c: Context) -> StepResult:
    """Run the chord test where the truth is known; a real machine needs the operator's instrument."""
    if not c.machine.plant_is_local:
        proof = "needs an instrument at the load"
        to_do = "gantryctl accuracy report --measured FILE, with the readings of a tracker"
        return StepResult("accuracy", Outcome.NOT_TESTABLE, proof, to_do=to_do)
    procedure = chord_procedure("A")
    readings = run_on_engine(c.machine, procedure)
    table = evaluate(procedure, readings.load_rad[0], c.machine.accuracy.chord_radius_m)
    a = float(accuracy_a(table.errors_deg))
    proof = f"chord test A over the bus: A = {a:.4f} deg (limit {_CRITERION_DEG:g} deg), true load angle"
    return judged(
        True, "accuracy", proof, "gear, bearings, calibration", a_deg=Figure(a, high=_CRITERION_DEG)
    )
