"""Pieces of constant jerk; Ruckig finds their durations."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from typing import Any, Final, NamedTuple

import ruckig

from gantryctl._core import Segments
from gantryctl.errors import CommandRefused
from gantryctl.motion.types import MotionLimits, SetPoint

# Ruckig plans for one axis; its cycle time plays no part in `calculate`.
_PLANNER: Final = ruckig.Ruckig(1, 0.001)
# An acceleration of rounding errors: over an hour it changes the speed by less than 1e-9 rad/s.
_CRUISE_RAD_S2: Final = 1e-13


class Piece(NamedTuple):
    """Constant jerk for `duration_s`; `acc_rad_s2` None: the acceleration goes on from the piece before."""

    duration_s: float
    jerk_rad_s3: float
    acc_rad_s2: float | None


def after(start: SetPoint, pieces: Iterable[Piece]) -> SetPoint:
    """State at the end of `pieces`."""
    pos, vel, acc = start
    for piece in pieces:
        pos, vel, acc = _advance(pos, vel, acc if piece.acc_rad_s2 is None else piece.acc_rad_s2, piece)
    return SetPoint(pos, vel, acc)


def segments(
    start: SetPoint, pieces: Sequence[Piece], pos_end_rad: float | None, vel_end_rad_s: float
) -> Segments:
    """Table of a plan; `pos_end_rad` None takes the end that the pieces lead to."""
    rows: list[tuple[float, float, float, float, float]] = []
    t = 0.0
    pos, vel, acc = start
    for piece in pieces:
        # Shorter than the resolution of time.
        if t + piece.duration_s == t:
            continue
        acc = acc if piece.acc_rad_s2 is None else piece.acc_rad_s2
        rows.append((t, pos, vel, acc, piece.jerk_rad_s3))
        pos, vel, acc = _advance(pos, vel, acc, piece)
        t += piece.duration_s
    t_start, pos_start, vel_start, acc_start, jerk = ([row[index] for row in rows] for index in range(5))
    pos_end = pos if pos_end_rad is None else pos_end_rad
    return Segments(t_start, pos_start, vel_start, acc_start, jerk, t, pos_end, vel_end_rad_s)


def to_state(start: SetPoint, end: SetPoint, limits: MotionLimits, direction: float) -> list[Piece]:
    """Pieces from `start` to `end`, travelling in `direction` (+1, -1) only."""
    question = _question(start, limits, direction)
    question.target_position = [end.pos_rad]
    question.target_velocity = [end.vel_rad_s]
    question.target_acceleration = [end.acc_rad_s2]
    question.max_velocity = [limits.vel_rad_s]
    return _fitted(start, _answer(question, start, limits), end.pos_rad)


def to_velocity(
    start: SetPoint, vel_rad_s: float, limits: MotionLimits, direction: float, acc_rad_s2: float = 0.0
) -> list[Piece]:
    """Pieces from `start` to a speed, and an acceleration there, travelling in `direction` (+1, -1) only."""
    question = _question(start, limits, direction)
    question.control_interface = ruckig.ControlInterface.Velocity
    question.target_velocity = [vel_rad_s]
    question.target_acceleration = [acc_rad_s2]
    return _answer(question, start, limits)


def _advance(pos: float, vel: float, acc: float, piece: Piece) -> tuple[float, float, float]:
    dt = piece.duration_s
    jerk = piece.jerk_rad_s3
    return (
        pos + dt * (vel + dt * (acc * 0.5 + dt * (jerk / 6.0))),
        vel + dt * (acc + dt * (jerk * 0.5)),
        acc + dt * jerk,
    )


def _question(start: SetPoint, limits: MotionLimits, direction: float) -> Any:
    question = ruckig.InputParameter(1)
    question.current_position = [start.pos_rad]
    question.current_velocity = [start.vel_rad_s]
    question.current_acceleration = [start.acc_rad_s2]
    # Slowing down is negative acceleration when travelling forward and positive when travelling back.
    forward = direction > 0.0
    question.max_acceleration = [limits.acc_rad_s2 if forward else limits.dec_rad_s2]
    question.min_acceleration = [-limits.dec_rad_s2 if forward else -limits.acc_rad_s2]
    question.max_jerk = [limits.jerk_rad_s3]
    return question


def _answer(question: Any, start: SetPoint, limits: MotionLimits) -> list[Piece]:
    trajectory = ruckig.Trajectory(1)
    try:
        _PLANNER.calculate(question, trajectory)
    except ruckig.RuckigError as error:
        raise CommandRefused(
            f"no motion plan from {question.current_position[0]:.6g} rad at "
            f"{question.current_velocity[0]:.6g} rad/s to {question.target_position[0]:.6g} rad; "
            "nothing changed, try another target or speed"
        ) from error
    profile = trajectory.profiles[0][0]
    brake = profile.brake
    rows = zip((*brake.t, *profile.t), (*brake.a, *profile.a[:7]), (*brake.j, *profile.j), strict=True)
    if math.isinf(limits.jerk_rad_s3):
        return [Piece(dt, 0.0, acc) for dt, acc, _ in rows if dt > 0.0]
    pieces = [Piece(dt, jerk, None) for dt, _, jerk in rows if dt > 0.0]
    # The acceleration starts afresh: a rounding error of pieces before would add up over a long way.
    return [piece._replace(acc_rad_s2=start.acc_rad_s2) for piece in pieces[:1]] + pieces[1:]


def _fitted(start: SetPoint, pieces: list[Piece], target_rad: float) -> list[Piece]:
    """Take what Ruckig's tolerance leaves at the end (1e-8 rad at most) out of the time at constant speed."""
    cruise, cruise_vel, longest_s = -1, 0.0, 0.0
    state = start
    for index, piece in enumerate(pieces):
        acc = state.acc_rad_s2 if piece.acc_rad_s2 is None else piece.acc_rad_s2
        if piece.jerk_rad_s3 == 0.0 and abs(acc) < _CRUISE_RAD_S2 and piece.duration_s > longest_s:
            cruise, cruise_vel, longest_s = index, state.vel_rad_s, piece.duration_s
        state = after(state, [piece])
    if cruise < 0 or cruise_vel == 0.0:
        return pieces
    pieces[cruise] = Piece(longest_s, 0.0, 0.0)
    duration_s = longest_s + (target_rad - after(start, pieces).pos_rad) / cruise_vel
    if duration_s > 0.0:
        pieces[cruise] = Piece(duration_s, 0.0, 0.0)
    return pieces
