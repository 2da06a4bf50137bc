"""The steps of commissioning in their order, each with what it does and what could move."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Final

from gantryctl.commissioning import steps_bus, steps_motion, steps_power
from gantryctl.commissioning.results import Context, Outcome, StepResult


@dataclass(frozen=True)
class Step:
    """One step.

    Attributes:
        moves: what could move, and how far; "" when nothing can.
        required: without it there is no commissioning record.
    """

    key: str
    title: str
    does: str
    moves: str
    run: Callable[[Context], StepResult]
    required: bool = True


# What moves nothing comes first, what turns the whole travel last: each step rests on those before it.
STEPS: Final = (
    Step("identity", "Identity", "reads who the drive is and pins it", "", steps_bus.identity),
    Step("encoder", "Absolute reference", "checks the zero offset and the wrap margins before any limit is trusted", "",
         steps_bus.encoder),
    Step("defaults", "Dangerous defaults", "compares the drive as it comes with what it must be", "",
         steps_bus.defaults),
    Step("parameters", "Parameters", "writes the parameters, reads them back, keeps a backup", "",
         steps_bus.parameters),
    Step("pdo", "Process data", "compares telegrams with SDO reads, counts what is missed", "", steps_bus.process_data),
    Step("sync", "SYNC and dead time", "measures answers to SYNC and scans from command to statusword", "",
         steps_bus.sync),
    Step("silence", "Silence", "stops commands, then the heartbeat, each alone, enabled at standstill",
         "the gantry may sag by less than 0.05 deg when the brake closes", steps_power.silence),
    Step("brake", "Brake", "pushes against the closed brake with the proof torque", "less than 0.02 deg",
         steps_power.brake),
    Step("sign", "Sign and scale", "a brief speed pulse with the position loop open, torque and speed limits lowered",
         "at most 0.05 deg", steps_power.sign),
    Step("velocity", "Velocity step", "a step to creep speed, position loop open", "at most 1 deg",
         steps_power.velocity),
    Step("loop", "Position loop", "closes the position loop: 1 deg forward and back at the lowest speed",
         "1 deg and back", steps_motion.loop),
    Step("stops", "Stops", "jog release, quick stop, silence: the angle measured against the computed one",
         "about 10 deg forward and back", steps_motion.stops),
    Step("turn", "Slow turn", "one turn each way: eccentric moment and friction", "the whole travel",
         steps_motion.slow_turn),
    Step("bands", "Bands", "proposes in-position and following-error bands from what was measured", "",
         steps_motion.bands),
    Step("accuracy", "Accuracy", "the chord test by an instrument", "the whole travel", steps_motion.accuracy,
         required=False),
)  # fmt: skip


def complete(results: Mapping[str, StepResult]) -> bool:
    """True when every required step has passed, or cannot be tested on this machine."""
    return all(
        step.key in results and results[step.key].outcome is not Outcome.FAILED
        for step in STEPS
        if step.required
    )
