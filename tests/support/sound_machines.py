"""Random sequences of an operator on sound machines: nothing may happen that nobody caused.

`python -m support.sound_machines --first 1 --count 1000` (with `tests` on PYTHONPATH) runs seeds one by one and prints
those that fail; `--first N --count 1 --tell` runs one again and tells what was done.
"""

from __future__ import annotations

import argparse
import random
import sys
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Final

from gantryctl.engineering.comparison.ensemble import random_plant
from gantryctl.engineering.faults.oracle.taps import Oracle, tapped, watching
from gantryctl.image import Mode, OperatorCommand
from gantryctl.machine import Machine, default_machine, with_values
from gantryctl.program import GantryProgram, PowerPhase
from gantryctl.program.alarms.codes import Code, Severity
from gantryctl.runtime import Engine, FixedOperator
from gantryctl.units import deg, rad
from gantryctl.wiring.engine import build_engine, drive_of

SCANS_MS: Final = (1.0, 4.0, 10.0)
DRIVES: Final = ("sim", "drive", "object_60FE")
"""The simulator, and the virtual drive on its bus with each owner of the brake."""
ACTIONS: Final = 10
# s: a power-up with proof and release takes 0.9 s, a brake that lets go and a sag watch included 2.
_POWER_S: Final = 3.0
_QUICK_STOP_S: Final = 4.0


@dataclass
class Sequence:
    """What one seed did and what came of it.

    Attributes:
        done: what the operator did, with times.
        nuisances: what nobody caused; empty on a sound machine.
    """

    seed: int
    machine: str
    done: list[str] = field(default_factory=list)
    nuisances: list[str] = field(default_factory=list)
    axis_s: float = 0.0

    def __str__(self) -> str:
        return f"seed {self.seed}: {self.machine}: " + ("; ".join(self.nuisances) or "sound")


def machine_of(seed: int) -> tuple[Machine, float, str]:
    """Machine, angle at the start in deg, and what it is; each combination of drive and scan every ninth seed."""
    kind, scan_ms = DRIVES[seed % 3], SCANS_MS[seed // 3 % 3]
    rng = random.Random(f"machine {seed}")
    changes: dict[str, object] = {"control.scan_period_ms": scan_ms}
    if kind != "sim":
        changes |= {"drive.kind": "canopen", "brake.owner": kind, "can.answer_ms": min(2.0, 0.5 * scan_ms)}
    if rng.random() < 0.25:
        changes |= {"brake.hold": "brake", "brake.hold_brake_after_s": rng.uniform(0.5, 3.0)}
    angle = rng.uniform(-170.0, 170.0)
    machine = random_plant(with_values(default_machine(), changes), seed)
    return machine, angle, f"{kind}, {scan_ms:g} ms, {angle:.1f} deg"


class _Hand:
    """The operator of one sequence."""

    def __init__(self, engine: Engine, rng: random.Random, told: Sequence) -> None:
        self.engine, self.rng, self._told = engine, rng, told
        assert isinstance(engine.program, GantryProgram)
        self.program = engine.program
        self.axis = engine.program.axis
        self.quick_stops = 0

    @property
    def _operator(self) -> FixedOperator:
        assert isinstance(self.engine.operator, FixedOperator)
        return self.engine.operator

    def op(self, **levels: object) -> None:
        self._operator.command = self._operator.command._replace(**levels)
        self.engine.step()

    def wait(self, low_s: float, high_s: float) -> None:
        self.engine.run_for(self.rng.uniform(low_s, high_s))

    def tell(self, what: str) -> None:
        here = f"{self.engine.time_s:.3f} s at {deg(self.axis.pos_act_rad):.3f} deg"
        self._told.done.append(f"{here}: {what}")

    def until_rest(self, timeout_s: float = 120.0) -> None:
        self.engine.run_until(lambda _: self.axis.at_rest and not self.axis.motion.waiting, timeout_s)

    # --- actions ------------------------------------------------------------------------------------------------

    def power_up(self) -> None:
        self.tell("power on")
        self.op(power=True)
        self.engine.run_for(_POWER_S)
        if self.axis.power.phase not in {PowerPhase.ON, PowerPhase.PARKED} and not self.axis.power.status:
            self._told.nuisances.append(f"power is not on after {_POWER_S:g} s: {self.axis.power.phase.name}")

    def speed(self) -> float:
        return self.rng.choice((0.6, 1.0, 3.0, 6.0, self.rng.uniform(0.6, 6.0)))

    def begin_move(self) -> None:
        here = deg(self.axis.virtual.pos_ref_rad)
        step = self.rng.choice((0.01, 0.3, 3.0, 15.0)) * self.rng.uniform(0.3, 1.0) * self.rng.choice((-1, 1))
        target, speed = max(-179.0, min(179.0, here + step)), self.speed()
        self.tell(f"move to {target:.4f} deg at {speed:.2f} deg/s")
        self.op(move=True, target_rad=rad(target), speed_rad_s=rad(speed))
        self.op(move=False)

    def move(self) -> None:
        self.begin_move()
        self.until_rest()

    def move_and_another(self) -> None:
        self.begin_move()
        self.wait(0.1, 4.0)
        self.move()

    def move_and_halt(self) -> None:
        self.begin_move()
        self.wait(0.0, 5.0)
        self.tell("halt")
        self.op(halt=True)
        self.op(halt=False)
        self.until_rest()

    def move_and_stop(self) -> None:
        self.begin_move()
        self.wait(0.0, 5.0)
        self.tell("stop")
        self.op(stop=True)
        self.wait(0.0, 3.0)
        self.op(stop=False)
        self.until_rest()

    def move_with_override(self) -> None:
        self.begin_move()
        for override in (self.rng.random(), 0.0, self.rng.random(), 1.0):
            self.wait(0.1, 2.0)
            self.tell(f"override {override:.2f}")
            self.op(override=override)
        self.until_rest()

    def jog(self) -> None:
        self.op(mode=Mode.CONTINUOUS, speed_rad_s=rad(self.speed()))
        key = self.rng.choice(("forward", "reverse"))
        loses_the_lease = self.rng.random() < 0.3
        self.tell(f"key {key}" + (", and the lease is lost" if loses_the_lease else ""))
        for _ in range(self.rng.randint(1, 100)):
            self.op(lease=self._operator.command.lease + 1, **{key: True})
            self.engine.run_for(0.03)
        if loses_the_lease:
            self.wait(0.3, 4.0)
        self.op(forward=False, reverse=False)
        self.until_rest()

    def increment(self) -> None:
        self.op(mode=Mode.INCREMENTAL, increment_rad=rad(self.rng.uniform(0.01, 3.0)))
        key = self.rng.choice(("forward", "reverse"))
        self.tell(f"increment {key}")
        self.op(**{key: True})
        self.op(forward=False, reverse=False)
        self.until_rest()

    def power_cycle(self) -> None:
        self.tell("power off")
        self.op(power=False)
        self.wait(1.5, 5.0)
        self.power_up()

    def power_off_in_motion(self) -> None:
        self.begin_move()
        self.wait(0.0, 4.0)
        self.tell("power off in motion")
        self.op(power=False)
        self.engine.run_until(lambda _: self.axis.is_off, 20.0)
        self.wait(0.0, 3.0)
        self.power_up()

    def power_off_on_the_way_up(self) -> None:
        self.op(power=False)
        self.engine.run_until(lambda _: self.axis.is_off, 5.0)
        self.tell("power on, and off again")
        self.op(power=True)
        self.wait(0.0, 1.0)
        self.op(power=False)
        self.engine.run_until(lambda _: self.axis.is_off, 5.0)
        self.wait(0.0, 1.0)
        self.power_up()

    def quick_stop(self) -> None:
        if self.rng.random() < 0.8:
            self.begin_move()
            self.wait(0.0, 6.0)
        self.tell("quick stop")
        self.quick_stops += 1
        self.op(quick_stop=True)
        self.engine.run_for(_QUICK_STOP_S)
        self.op(quick_stop=False, power=False)
        if self.axis.alarms.first_out is None or not self.axis.is_off:
            self._told.nuisances.append(f"a quick stop ends in {self.axis.power.phase.name}")
        self.op(reset=True)
        self.op(reset=False)
        self.engine.run_for(0.3)
        self.power_up()

    def idle(self) -> None:
        self.tell("nothing")
        self.wait(0.5, 6.0)


_ACTIONS: Final[tuple[Callable[[_Hand], None], ...]] = (
    _Hand.move, _Hand.move, _Hand.move_and_another, _Hand.move_and_halt, _Hand.move_and_stop, _Hand.move_with_override,
    _Hand.jog, _Hand.jog, _Hand.increment, _Hand.power_cycle, _Hand.power_off_in_motion, _Hand.power_off_on_the_way_up,
    _Hand.quick_stop, _Hand.quick_stop, _Hand.idle,
)  # fmt: skip


def run_sequence(seed: int, oracle: Oracle, actions: int = ACTIONS) -> Sequence:
    """One random sequence on one random machine, watched by the oracle; fewer actions are the first ones of more."""
    machine, angle, words = machine_of(seed)
    rng = random.Random(seed)
    told = Sequence(seed, words)
    engine = build_engine(machine, drive_of(machine, angle))
    engine.operator.command = OperatorCommand()
    hand = _Hand(engine, rng, told)
    engine.run_for(0.1)
    hand.power_up()
    for _ in range(actions):
        if told.nuisances:
            break
        rng.choice(_ACTIONS)(hand)
        _judge(hand, told)
    hand.tell("power off")
    hand.op(power=False)
    engine.run_for(5.0)
    _judge(hand, told)
    if not hand.axis.is_off:
        told.nuisances.append(f"power does not go off: {hand.axis.power.phase.name}")
    told.nuisances += map(str, oracle.violations)
    oracle.violations.clear()
    told.axis_s = engine.time_s
    engine.close()
    return told


def _judge(hand: _Hand, told: Sequence) -> None:
    """Alarms that nobody caused. A quick stop by a person is caused; a refusal and a note are no alarms."""
    quick_stops = 0
    for alarm in hand.axis.alarms.history:
        if alarm.code is Code.INT_06:
            quick_stops += 1
        elif alarm.definition.severity in {Severity.STOP, Severity.WARNING}:
            told.nuisances.append(alarm.text)
    if quick_stops > hand.quick_stops:
        told.nuisances.append(f"{quick_stops} quick stops, {hand.quick_stops} asked for")
    hand.axis.alarms.history.clear()
    hand.quick_stops = 0


def main() -> int:
    """Run seeds; 1 when one of them has a nuisance."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--first", type=int, default=1)
    parser.add_argument("--count", type=int, default=1000)
    parser.add_argument("--tell", action="store_true", help="tell what was done")
    asked = parser.parse_args()
    failed, axis_s = [], 0.0
    with tapped():
        for seed in range(asked.first, asked.first + asked.count):
            oracle = Oracle()
            with watching(oracle):
                told = run_sequence(seed, oracle)
            axis_s += told.axis_s
            if asked.tell:
                print(*told.done, sep="\n")
            if told.nuisances or asked.tell:
                print(told, flush=True)
            if told.nuisances:
                failed.append(seed)
            if (seed - asked.first) % 50 == 49:
                print(f"{seed - asked.first + 1} seeds, {len(failed)} failed", flush=True)
    print(
        f"{asked.count} seeds from {asked.first}, {axis_s / 3600:.2f} h of axis time: {len(failed)} failed {failed}"
    )
    return 1 if failed else 0


if __name__ == "__main__":
    sys.exit(main())
