"""What the deeds of a scenario do to the levels of the operator, by virtual time."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any, Final, NamedTuple

from gantryctl.engineering.fault_campaign.scenario import Action
from gantryctl.image import Mode, OperatorCommand
from gantryctl.units import rad

# A level that is an edge to the program stands for some scans.
PULSE_S: Final = 0.03
_RENEWED_S: Final = 0.03
"""A page renews the lease of a held key so often."""
_LET_GO: Final = {
    "power": False, "quick_stop": False, "stop": False, "halt": False, "move": False, "forward": False,
    "reverse": False, "brake_test": False,
}  # fmt: skip


class Change(NamedTuple):
    """New levels from a moment on; a lease is renewed where `renews`."""

    at_s: float
    levels: dict[str, Any]
    renews: bool = False

    def on(self, command: OperatorCommand) -> OperatorCommand:
        """The command after it."""
        lease = command.lease + 1 if self.renews else command.lease
        return command._replace(lease=lease, **self.levels)


def changes_of(actions: tuple[Action, ...]) -> list[Change]:
    """Every change of a session, ascending."""
    found = [change for action in actions for change in _changes(action)]
    return sorted(found, key=lambda change: change.at_s)


def _changes(action: Action) -> Iterator[Change]:
    at_s = action.at_s
    match action.do:
        case "power":
            yield Change(at_s, {"power": True, "mode": Mode.CONTINUOUS})
        case "power_off":
            yield Change(at_s, {"power": False})
        case "move":
            levels = {"target_rad": rad(action.target_deg), "speed_rad_s": rad(abs(action.speed_deg_s))}
            yield from _pulse(at_s, "move", PULSE_S, levels)
        case "jog":
            yield from _jog(action)
        case "increment":
            key = "forward" if action.step_deg > 0.0 else "reverse"
            levels = {
                "mode": Mode.INCREMENTAL,
                "increment_rad": rad(abs(action.step_deg)),
                "speed_rad_s": rad(abs(action.speed_deg_s)),
            }
            yield Change(at_s, levels)
            yield from _pulse(at_s + PULSE_S, key, 0.1, {})
        case "halt" | "reset" | "brake_test":
            yield from _pulse(at_s, action.do, PULSE_S, {})
        case "stop" | "quick_stop":
            yield from _pulse(at_s, action.do, action.for_s, {})
        case "override":
            yield Change(at_s, {"override": action.value})
        case "recover":
            yield Change(at_s, dict(_LET_GO))
            yield from _pulse(at_s + 0.1, "reset", 0.1, {})
            yield Change(at_s + 0.6, {"power": True, "mode": Mode.CONTINUOUS, "override": 1.0})


def _pulse(at_s: float, level: str, for_s: float, others: dict[str, Any]) -> Iterator[Change]:
    yield Change(at_s, {level: True, **others})
    yield Change(at_s + max(for_s, PULSE_S), {level: False})


def _jog(action: Action) -> Iterator[Change]:
    key = "forward" if action.speed_deg_s > 0.0 else "reverse"
    begin_s, end_s = action.at_s + PULSE_S, action.at_s + PULSE_S + action.for_s
    levels = {"mode": Mode.CONTINUOUS, "speed_rad_s": rad(abs(action.speed_deg_s))}
    yield Change(action.at_s, {**levels, "lease_age_s": action.lease_age_s})
    yield Change(begin_s, {key: True}, renews=True)
    renewed_s = end_s if action.lease_s is None else min(end_s, begin_s + action.lease_s)
    for number in range(1, int((renewed_s - begin_s) / _RENEWED_S) + 1):
        yield Change(begin_s + number * _RENEWED_S, {}, renews=True)
    yield Change(end_s, {key: False})
