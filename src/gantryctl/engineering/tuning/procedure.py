"""The paper's tuning order as a sequence of trials: inner loop before outer, feedback before feed-forward, then the
acceleration. Every value is raised from a poor one until its stop criterion is reached; every trial is logged.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Final, NamedTuple

from gantryctl.engineering.tuning.bench import Bench
from gantryctl.engineering.tuning.gains import POOR, Gains
from gantryctl.errors import UsageError

_GROWTH: Final = 1.25
_RESOLUTION: Final = 1.02
_MOST_TRIALS: Final = 60
_KVF_STEPS: Final = 10


class Criteria(NamedTuple):
    """Where raising a value stops: our choices, settled with the paper's gains in sight (docs/explanation/tuning.md).

    Attributes:
        speed_overshoot: of the motor speed behind a step, while the integral is slow: exp(-pi) = 4.3 % belongs to a
            damping ratio of 1/sqrt(2), the amplitude optimum.
        integral_overshoot: the same while the integral is shortened: a quarter of the step.
        load_overshoot: of the load behind a step of the set-point: a quarter of the step.
        feed_forward_overshoot: of the motor speed over the highest speed of a move.
        base_um: peak to peak at the ring, in a move of 90 deg.
    """

    speed_overshoot: float = math.exp(-math.pi)
    integral_overshoot: float = 0.25
    load_overshoot: float = 0.25
    feed_forward_overshoot: float = 0.01
    base_um: float = 150.0


QUARTERS: Final = Criteria()
"""What is meant when nothing is said."""


class Trial(NamedTuple):
    """One line of the log.

    Attributes:
        phase: which value is raised. value: it, in `unit`. measured, limit: what the criterion looks at, in
            `measured_unit`. kept: the criterion holds. note: why a trial counts as too much although it does.
    """

    phase: str
    value: float
    unit: str
    measured: float
    limit: float
    measured_unit: str
    kept: bool
    note: str = ""


@dataclass(frozen=True)
class Tuned:
    """Where a procedure started, where it ended, and every trial on the way."""

    start: Gains
    gains: Gains
    log: tuple[Trial, ...]

    def phase(self, name: str) -> list[Trial]:
        """The trials of one phase."""
        return [trial for trial in self.log if trial.phase == name]


PHASES: Final = ("Kvp", "Tvi", "Kpp", "Kvf", "acceleration")
Outcome = tuple[float, str]
"""What was measured, and a note when the trial counts as too much anyway."""


def paper_procedure(bench: Bench, start: Gains = POOR, criteria: Criteria = QUARTERS) -> Tuned:
    """Run the sequence.

    Args:
        bench: the axis. start: poor gains, every value below (Tvi: above) what the axis bears.
        criteria: see `Criteria`.

    Raises:
        UsageError: the axis does not even bear the first value of a phase.
    """
    log: list[Trial] = []
    gains = replace(start, kvf=0.0)
    gains = _kvp(bench, gains, criteria, log)
    gains = _tvi(bench, gains, criteria, log)
    gains = _kpp(bench, gains, criteria, log)
    gains = _kvf(bench, gains, criteria, log)
    gains = _acceleration(bench, gains, criteria, log)
    return Tuned(start, gains.rounded(), tuple(log))


def _kvp(bench: Bench, gains: Gains, criteria: Criteria, log: list[Trial]) -> Gains:
    def attempt(kvp: float) -> Outcome:
        step = bench.speed_step(replace(gains, kvp_nm_s_per_rad=kvp))
        return 100.0 * step.overshoot, _limited(step.limited)

    limit = 100.0 * criteria.speed_overshoot
    line = _Line("Kvp", "N m s/rad", limit, "% speed overshoot")
    return replace(gains, kvp_nm_s_per_rad=_raised(attempt, gains.kvp_nm_s_per_rad, line, log))


def _tvi(bench: Bench, gains: Gains, criteria: Criteria, log: list[Trial]) -> Gains:
    """Shortened, so 1/Tvi is raised; what is logged is Tvi in ms."""

    def attempt(inverse: float) -> Outcome:
        step = bench.speed_step(replace(gains, tvi_s=1.0 / inverse))
        return 100.0 * step.overshoot, _limited(step.limited)

    limit = 100.0 * criteria.integral_overshoot
    line = _Line("Tvi", "ms", limit, "% speed overshoot", lambda inverse: 1e3 / inverse)
    return replace(gains, tvi_s=1.0 / _raised(attempt, 1.0 / gains.tvi_s, line, log))


def _kpp(bench: Bench, gains: Gains, criteria: Criteria, log: list[Trial]) -> Gains:
    def attempt(kpp: float) -> Outcome:
        step = bench.position_step(replace(gains, kpp_per_s=kpp))
        return 100.0 * step.load_overshoot, _limited(step.limited)

    limit = 100.0 * criteria.load_overshoot
    line = _Line("Kpp", "1/s", limit, "% load overshoot")
    return replace(gains, kpp_per_s=_raised(attempt, gains.kpp_per_s, line, log))


def _kvf(bench: Bench, gains: Gains, criteria: Criteria, log: list[Trial]) -> Gains:
    """In steps of 10 %; above 100 % the axis would run ahead of its set-point."""
    best, limit = 0.0, 100.0 * criteria.feed_forward_overshoot
    for k in range(_KVF_STEPS + 1):
        kvf = k / _KVF_STEPS
        move = bench.move(replace(gains, kvf=kvf))
        overshoot = 100.0 * move.speed_overshoot
        kept = overshoot <= limit and not move.limited
        note = f"following error {1e3 * move.cruise_error_deg:.3g} mdeg" if kept else _limited(move.limited)
        log.append(Trial("Kvf", 100.0 * kvf, "%", overshoot, limit, "% speed overshoot", kept, note))
        if not kept:
            break
        best = kvf
    return replace(gains, kvf=best)


def _acceleration(bench: Bench, gains: Gains, criteria: Criteria, log: list[Trial]) -> Gains:
    """Until the base moves as much as it may, or the torque limit, the reducer or the other ramps are reached."""
    machine = bench.machine
    most = machine.virtual_axis.jog_release_dec_deg_s2

    def attempt(acc: float) -> Outcome:
        if acc > most:
            return 0.0, f"above the jog-release ramp of {most:g} deg/s2"
        move = bench.move(replace(gains, acc_deg_s2=acc))
        if move.reducer_nm > machine.reducer.torque_rated_nm:
            return move.base_um, f"reducer {move.reducer_nm / 1e3:.1f} kN m"
        return move.base_um, _limited(move.limited)

    line = _Line("acceleration", "deg/s2", criteria.base_um, "um base motion")
    return replace(gains, acc_deg_s2=_raised(attempt, gains.acc_deg_s2, line, log))


class _Line(NamedTuple):
    """How a phase is logged."""

    phase: str
    unit: str
    limit: float
    measured_unit: str
    shown: Callable[[float], float] = float


def _raised(attempt: Callable[[float], Outcome], start: float, line: _Line, log: list[Trial]) -> float:
    """Raise by a quarter until the criterion breaks, then halve the step until the edge is known within 2 %."""

    def keeps(value: float) -> bool:
        measured, note = attempt(value)
        kept = measured <= line.limit and not note and math.isfinite(measured)
        log.append(
            Trial(
                line.phase,
                line.shown(value),
                line.unit,
                measured,
                line.limit,
                line.measured_unit,
                kept,
                note,
            )
        )
        return kept

    good, bad = start, start
    if not keeps(start):
        last = log[-1]
        why = f"; {last.note}" if last.note else ""
        raise UsageError(
            f"the axis does not bear the starting value: {line.phase} = {last.value:.4g} {line.unit} gives "
            f"{last.measured:.3g} {line.measured_unit}, permitted {line.limit:.3g}{why}; start with poorer gains or "
            "permit more"
        )
    for _ in range(_MOST_TRIALS):
        bad = good * _GROWTH
        if not keeps(bad):
            break
        good = bad
    else:
        raise UsageError(f"{line.phase} can be raised without end: the criterion is never reached")
    while bad / good > _RESOLUTION:
        middle = math.sqrt(good * bad)
        if keeps(middle):
            good = middle
        else:
            bad = middle
    return good


def _limited(limited: bool) -> str:
    return "the torque limit acted" if limited else ""
