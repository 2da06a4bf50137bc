"""Rows of the comparison: the paper's loop, the other profile alone, each compensation alone, all together."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

from gantryctl.errors import UsageError
from gantryctl.machine import Machine, diff_machines, with_values

_AT: Final = "control.compensation."
_ENCODER: Final = ("load_encoder.active", "load_encoder.own_errors", "damping.active")
# One row per law of docs/explanation/compensation.md, in its order.
_ALONE: Final = (
    ("torque of the eccentric moment", ("torque.eccentric",)),
    ("torque of the acceleration", ("torque.acceleration",)),
    ("gear map", ("gear_map.active",)),
    ("wind-up", ("windup.active",)),
    ("wind-up, moment followed", ("windup.active", "moment_observer.active")),
    ("lost motion", ("windup.reversal",)),
    ("load encoder", ("load_encoder.active",)),
    ("load encoder, own errors out", ("load_encoder.active", "load_encoder.own_errors")),
    ("swing damping", ("load_encoder.active", "damping.active")),
    ("dead time", ()),
)
_SWITCHES: Final = tuple(dict.fromkeys(key for _, keys in _ALONE for key in keys))


@dataclass(frozen=True)
class Variant:
    """One row of the comparison."""

    name: str
    machine: Machine


def check_same_plant(first: Machine, second: Machine) -> None:
    """Refuse two machines with different plants.

    Raises:
        UsageError: a key of [plant], [motor], [axis] ... differs; only what controls may differ.
    """
    # Where a requirement comes from changes nothing; the requirement itself does.
    free = (
        "machine.",
        "required.source",
        "control.",
        "virtual_axis.",
        "monitors.",
        "plant.load_encoder.fitted",
    )
    other = [d.path for d in diff_machines(first, second) if not d.path.startswith(free)]
    if other:
        raise UsageError(
            f"{first.name} and {second.name} are different machines, they cannot be compared: {', '.join(other[:5])} "
            "differ; only [control], [virtual_axis], [monitors] and [plant.load_encoder] fitted may"
        )


def without_load_encoder(machine: Machine) -> Machine:
    """The machine as it would be without an encoder on its ring."""
    return with_values(machine, dict.fromkeys((_AT + key for key in _ENCODER), False))


def moment_followed(machine: Machine, *, followed: bool = True) -> Machine:
    """The machine with its eccentric moment, and no backlash, followed by the torque of the motor, or as calibrated."""
    return with_values(
        machine, {_AT + "moment_observer.active": followed, _AT + "backlash_observer.active": False}
    )


def backlash_followed(machine: Machine, *, followed: bool = True) -> Machine:
    """The machine with its backlash followed, by the encoder on its ring if it has one, or as calibrated."""
    return with_values(machine, {_AT + "backlash_observer.active": followed})


def ending_gently(machine: Machine, *, gently: bool = True) -> Machine:
    """The machine with a gentle end of its moves, or without one."""
    return with_values(machine, {"virtual_axis.gentle_end": gently})


def may_follow_backlash(machine: Machine) -> bool:
    """A person has set how large the backlash may be, and what says where its flank lies may be followed."""
    laws = machine.control.compensation
    return laws.backlash_observer.limit_deg > 0.0 and may_follow_moment(machine) and laws.windup.reversal


def may_follow_moment(machine: Machine) -> bool:
    """A person has set how far the moment may be followed, and its wind-up is compensated."""
    laws = machine.control.compensation
    return laws.moment_observer.limit_nm > 0.0 and laws.windup.active


def variants(paper: Machine, improved: Machine) -> list[Variant]:
    """The rows: both machines, and on the profile of the second each compensation that it uses, alone.

    Swing damping is shown with the encoder it reads but with its integral next to nothing.
    """
    compensation = improved.control.compensation
    off: dict[str, object] = {_AT + key: False for key in _SWITCHES} | {_AT + "latency_us": 0.0}
    rows = [Variant(f"{paper.name}, as it is", paper), Variant("profile alone", with_values(improved, off))]
    for name, keys in _ALONE:
        if not all(_is_on(improved, key) for key in keys):
            continue
        changes = off | {_AT + key: True for key in keys}
        if name == "swing damping":
            # Damping reads the encoder; its integral would hide what the damping does.
            changes[_AT + "load_encoder.integral_per_s"] = 0.01
        if name == "dead time":
            if compensation.latency_us == 0.0:
                continue
            changes[_AT + "latency_us"] = compensation.latency_us
        rows.append(Variant(f"{name} alone", with_values(improved, changes)))
    if compensation.load_encoder.active:
        rows.append(Variant("all without the load encoder", without_load_encoder(improved)))
    return [*rows, Variant(f"{improved.name}, as it is", improved)]


def _is_on(machine: Machine, key: str) -> bool:
    table, name = key.split(".")
    return bool(getattr(getattr(machine.control.compensation, table), name))
