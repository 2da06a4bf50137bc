"""Days of a machine in use, simulated: does the watch of its calibration warn of what has changed, and of nothing else?

A day has 60 moves to angles and at speeds that are drawn, in six sessions with the power off between them. A sound
machine has a temperature that goes up and down by 5 K in the day, friction of 90 to 110 %, and noise in the torque
reading; a row of a drift file has that and its change from the first move on. Ten days in a row share one memory. The
plant runs in the compiled loop at scans of 4 ms, the watch is that of the program.
"""

from __future__ import annotations

import json
import math
from collections.abc import Iterator
from typing import Final, NamedTuple

import numpy as np

from gantryctl.engineering.batch import ClosedLoop, Leg, Log, log_legs
from gantryctl.engineering.comparison.drift_file import DriftRow
from gantryctl.errors import UsageError
from gantryctl.machine import Machine, with_values
from gantryctl.machine.places import reach_deg
from gantryctl.motion import SetPoint, plan_move
from gantryctl.program.monitors.calibration_watch import CalibrationWatch, Finding
from gantryctl.units import rad
from gantryctl.wiring.calibration_watch import calibration_watch
from gantryctl.wiring.compensation import check_calibration, compensation
from gantryctl.wiring.program import motion_limits, position_law
from gantryctl.wiring.simulator import gantry_sim

MOVES: Final = 60
_SESSIONS: Final = 6
CHAIN_DAYS: Final = 10
_SCAN_MS: Final = 4.0
# From the ends of the way a day begins, and ends its moves, so many degrees at most, or a part of the way.
_AWAY: Final = ((10.0, 30.0), (5.0, 60.0))
_REST_S: Final = 2.0
_SWING_K: Final = 5.0
_FRICTION: Final = 0.1
_WARM_MOTOR_K: Final = 30.0
# Reading of the torque: noise of 1 % of the rated torque, in steps of 0.1 % (CiA 402 object 6077).
_NOISE: Final = 0.01
_STEP: Final = 0.001
_FRICTION_KEYS: Final = (
    "plant.roller_friction.coulomb_nm", "plant.roller_friction.breakaway_nm",
    "plant.roller_friction.viscous_nm_s_per_rad", "plant.motor_friction.coulomb_nm",
    "plant.motor_friction.breakaway_nm", "plant.motor_friction.viscous_nm_s_per_rad",
)  # fmt: skip
_COLUMNS: Final = (
    "pos_ref_rad", "vel_ref_rad_s", "acc_ref_rad_s2", "torque_act_nm", "counts", "pos_ring_rad",
)  # fmt: skip


class Session(NamedTuple):
    """Moves of one power-up: the plant they run on, what they are, and the seed of the torque noise."""

    machine: Machine
    start_rad: float
    legs: list[Leg]
    seed: tuple[int, ...]


class Day(NamedTuple):
    """What the watch has said by the end of a day.

    Attributes:
        found: by name, the move of the chain after which it was found. seen: by name, what the last move left.
    """

    found: dict[str, int]
    seen: dict[str, Finding]


def chain_of_days(
    machine: Machine, row: DriftRow | None, chain: int, days: int = CHAIN_DAYS, moves: int = MOVES
) -> list[Day]:
    """Days in a row with one memory, as simulated by the number of their chain.

    Raises:
        UsageError: the machine watches nothing. ConfigError: its calibration is missing or of another machine.
    """
    machine = with_values(machine, {"control.scan_period_ms": _SCAN_MS})
    law, settings = position_law(machine), calibration_watch(machine, check_calibration(machine))
    if settings is None:
        raise UsageError(
            f"{machine.name}: nothing of its calibration is watched; see [control.compensation.calibration_watch]"
        )
    ring = machine.control.compensation.load_encoder.active
    rng = np.random.default_rng((chain, 0 if row is None else 1))
    memory: dict[str, object] = {}
    found: dict[str, int] = {}
    made, told = 0, []
    for day in range(days):
        sessions = list(_sessions(machine, row, rng, (chain, day), moves))
        loops = [
            ClosedLoop.standing_at(gantry_sim(s.machine), law, s.start_rad, compensation(s.machine))
            for s in sessions
        ]
        logs = log_legs(loops, [session.legs for session in sessions], _COLUMNS)
        for session, log in zip(sessions, logs, strict=True):
            watch = CalibrationWatch(settings, _SCAN_MS * 1e-3, machine.axis.ratio, load_side=ring)
            # The power was off: what is not in the memory is forgotten.
            watch.restore(json.loads(json.dumps(memory)))
            for _ in _judged(watch, session, log, ring=ring):
                made += 1
                for name in watch.found:
                    found.setdefault(name, made)
            memory = watch.memory
        told.append(Day(dict(found), dict(watch.seen)))
    return told


def _sessions(
    machine: Machine, row: DriftRow | None, rng: np.random.Generator, seed: tuple[int, ...], moves: int
) -> Iterator[Session]:
    low, high = reach_deg(machine)
    begin, end = (min(most, (high - low) / part) for most, part in _AWAY)
    at = float(rng.uniform(low + begin, high - begin))
    phase, friction = float(rng.uniform(0.0, math.tau)), float(rng.uniform(1.0 - _FRICTION, 1.0 + _FRICTION))
    limits, speed = motion_limits(machine), machine.speed
    changed = machine if row is None else row.on(machine)
    for number in range(_SESSIONS):
        warm = math.sin(phase + math.tau * number / _SESSIONS)
        values: dict[str, object] = {"plant.switches.thermal": True}
        # A row that is warm or cold is so all day.
        for part, swing_k in (("gears", _SWING_K * warm), ("motor", _WARM_MOTOR_K * (1.0 + warm) / 2.0)):
            for key in (f"plant.thermal.{part}_{end}_k" for end in ("start", "end")):
                values[key] = swing_k + changed.plant.switches.thermal * _value(changed, key)
        values |= {key: friction * _value(changed, key) for key in _FRICTION_KEYS}
        start, legs = at, []
        for _ in range(moves // _SESSIONS):
            to = float(rng.uniform(low + end, high - end))
            vel = rad(float(rng.uniform(0.5, 1.0)) * speed.setting_max_deg_s)
            plan = plan_move(SetPoint(rad(at), 0.0, 0.0), rad(to), limits._replace(vel_rad_s=vel))
            legs.append(Leg(plan, plan.duration + _REST_S))
            at = to
        yield Session(with_values(changed, values), rad(start), legs, (*seed, number))


def _value(machine: Machine, path: str) -> float:
    found: object = machine
    for name in path.split("."):
        found = getattr(found, name)
    if not isinstance(found, float):
        raise TypeError(path)
    return found


def _judged(watch: CalibrationWatch, session: Session, log: Log, *, ring: bool) -> Iterator[None]:
    """Show the watch a session scan by scan, as the axis does; once per move that has ended."""
    rated = session.machine.motor.torque_rated_nm
    noise = np.random.default_rng(session.seed).normal(0.0, _NOISE * rated, len(log))
    torque = np.round((log["torque_act_nm"] + noise) / (_STEP * rated)) * (_STEP * rated)
    laws, law = compensation(session.machine), position_law(session.machine)
    columns = [log[name].tolist() for name in _COLUMNS]
    moving = False
    for pos, vel, acc, true_nm, counts, angle, seen_nm in zip(*columns, torque.tolist(), strict=True):
        apart = followed = 0.0
        if ring and laws is not None:
            apart = laws.scan(law, pos, vel, acc, counts, angle, true_nm)[4]
            followed = laws.backlash_change_rad
        if vel or acc:
            watch.scan(pos, vel, acc, seen_nm, apart, followed)
            moving = True
        elif moving:
            moving = False
            watch.rest()
            yield
