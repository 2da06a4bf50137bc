"""The paper's tuning order as a sequence of trials: inner loop before outer, feedback before feed-forward, then the
acceleration. Every value is raised from a poor one until its stop criterion is reached; every trial is logged.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Final, NamedTuple

from gantryctl.engineering.report.meter import Watch, nobody
from gantryctl.engineering.tuning.bench import Bench
from gantryctl.engineering.tuning.gains import POOR, Gains
from gantryctl.errors import UsageError
from gantryctl.units import behind

# A quarter up until the criterion breaks, then halved steps: the edge is known within 2 %.
_GROWTH: Final = 1.25
_RESOLUTION: Final = 1.02
_MOST_TRIALS: Final = 60
_KVF_STEPS: Final = 10
# 87 on the reference machine, 118 on the rotary table: for the time that is left.
_USUAL_TRIALS: Final = 100


# The paper's own criteria are words: while stable, just before vibration, just before the base shakes. The
# third version of these limits is in force, each change made after seeing what the one before ended in.
class Criteria(NamedTuple):
    """Stop criteria: our choices, settled with the paper's gains in sight (docs/explanation/tuning.md).

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


# The criteria unless a caller states others: a quarter of the step, twice.
QUARTERS: Final = Criteria()


class Trial(NamedTuple):
    """One line of the log.

    Attributes:
        phase: which value is raised. value: it, in `unit`. measured, limit: the quantity of the criterion, in
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
    """Start and end of a procedure, and every trial between them."""

    start: Gains
    gains: Gains
    log: tuple[Trial, ...]

    def phase(self, name: str) -> list[Trial]:
        """The trials of one phase."""
        return [trial for trial in self.log if trial.phase == name]


PHASES: Final = ("Kvp", "Tvi", "Kpp", "Kvf", "acceleration")
# What was measured, and a note when the trial counts as too much anyway.
Outcome = tuple[float, str]


def paper_procedure(
    bench: Bench, start: Gains = POOR, criteria: Criteria = QUARTERS, watch: Watch = nobody
) -> Tuned:
    """Run the sequence.

    Args:
        bench: the axis. start: poor gains, every value below (Tvi: above) what the axis bears.
        criteria: see `Criteria`. watch: is told the part that is done, about.

    Raises:
        UsageError: the axis does not even bear the first value of a phase.
    """
    # The paper's order: inner loop before outer, feedback before feed-forward, then the acceleration.
    kvp, tvi, kpp, acceleration = _raised_phases(bench, criteria)
    log = _Watched(watch)
    gains = replace(start, kvf=0.0)
    for phase in (kvp, tvi, kpp):
        gains = _raised(phase, gains, log)
    gains = _feed_forward(bench, gains, criteria, log)
    gains = _raised(acceleration, gains, log)
    return Tuned(start, gains.rounded(), tuple(log))


class _Watched(list[Trial]):
    """A log whose length tells how far the procedure has got."""

    def __init__(self, watch: Watch) -> None:
        super().__init__()
        self._watch = watch

    def append(self, trial: Trial) -> None:
        """Keep a trial, and tell it."""
        super().append(trial)
        self._watch(min(1.0, len(self) / _USUAL_TRIALS))


class _Phase(NamedTuple):
    """A value that is raised until its criterion breaks.

    Attributes:
        value, with_value: of gains, and gains with another value. attempt: experiment and outcome.
        logged: the value as the log shows it.
    """

    name: str
    unit: str
    limit: float
    measured_unit: str
    value: Callable[[Gains], float]
    with_value: Callable[[Gains, float], Gains]
    attempt: Callable[[Gains], Outcome]
    logged: Callable[[float], float] = float


def _raised_phases(bench: Bench, criteria: Criteria) -> tuple[_Phase, _Phase, _Phase, _Phase]:
    machine = bench.machine
    most = machine.virtual_axis.jog_release_dec_deg_s2

    def speed(gains: Gains) -> Outcome:
        step = bench.speed_step(gains)
        return 100.0 * step.overshoot, _limited(step.limited)

    # The load, because the motor shows nothing: with the paper's gains the load overshoots a small step by a
    # third, the motor by less than 1 %.
    def load(gains: Gains) -> Outcome:
        step = bench.position_step(gains)
        return 100.0 * step.load_overshoot, _limited(step.limited)

    def base(gains: Gains) -> Outcome:
        """Raise until the base moves as much as it may, or torque limit, reducer or the other ramps are reached."""
        if gains.acc_deg_s2 > most:
            return 0.0, f"above the jog-release ramp of {most:g} deg/s2"
        move = bench.move(gains)
        if move.reducer_nm > machine.reducer.torque_rated_nm:
            return move.base_um, f"reducer {move.reducer_nm / 1e3:.4g} kN m"
        # The paper does not say how far its base moved: its 0.393 deg/s2 makes 165 um on this plant.
        return move.base_um, _limited(move.limited)

    return (
        _Phase(
            "Kvp", "N m s/rad", 100.0 * criteria.speed_overshoot, "% speed overshoot",
            lambda gains: gains.kvp_nm_s_per_rad, lambda gains, kvp: replace(gains, kvp_nm_s_per_rad=kvp), speed,
        ),
        # Tvi is shortened, so 1/Tvi is raised.
        _Phase(
            "Tvi", "ms", 100.0 * criteria.integral_overshoot, "% speed overshoot",
            lambda gains: 1.0 / gains.tvi_s, lambda gains, inverse: replace(gains, tvi_s=1.0 / inverse), speed,
            lambda inverse: 1e3 / inverse,
        ),
        _Phase(
            "Kpp", "1/s", 100.0 * criteria.load_overshoot, "% load overshoot",
            lambda gains: gains.kpp_per_s, lambda gains, kpp: replace(gains, kpp_per_s=kpp), load,
        ),
        _Phase(
            "acceleration", "deg/s2", criteria.base_um, "um base motion",
            lambda gains: gains.acc_deg_s2, lambda gains, acc: replace(gains, acc_deg_s2=acc), base,
        ),
    )  # fmt: skip


def _feed_forward(bench: Bench, gains: Gains, criteria: Criteria, log: list[Trial]) -> Gains:
    """In steps of 10 %; above 100 % the axis would run ahead of its set-point."""
    best, limit = 0.0, 100.0 * criteria.feed_forward_overshoot
    # Above 100 % the axis would run ahead of its set-point.
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


def _raised(phase: _Phase, gains: Gains, log: list[Trial]) -> Gains:
    """Raise by a quarter until the criterion breaks, then halve the step until the edge is known within 2 %."""

    def keeps(value: float) -> bool:
        measured, note = phase.attempt(phase.with_value(gains, value))
        kept = measured <= phase.limit and not note and math.isfinite(measured)
        shown = phase.logged(value)
        log.append(
            Trial(phase.name, shown, phase.unit, measured, phase.limit, phase.measured_unit, kept, note)
        )
        return kept

    good = bad = phase.value(gains)
    if not keeps(good):
        last = log[-1]
        why = f"; {last.note}" if last.note else ""
        raise UsageError(
            f"the axis does not bear the starting value: {last.phase} = {last.value:.4g}{behind(last.unit)} gives "
            f"{last.measured:.3g}{behind(last.measured_unit)}, permitted {last.limit:.3g}{why}; start with "
            "poorer gains or permit more"
        )
    for _ in range(_MOST_TRIALS):
        bad = good * _GROWTH
        if not keeps(bad):
            break
        good = bad
    else:
        raise UsageError(f"{phase.name} can be raised without end: the criterion is never reached")
    while bad / good > _RESOLUTION:
        middle = math.sqrt(good * bad)
        good, bad = (middle, bad) if keeps(middle) else (good, middle)
    return phase.with_value(gains, good)


def _limited(limited: bool) -> str:
    return "the torque limit acted" if limited else ""
