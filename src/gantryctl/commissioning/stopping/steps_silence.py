"""Steps of a silent controller: the drive's own watch, and a watchdog beside the drive; enabled at standstill."""

from __future__ import annotations

import math
from typing import NamedTuple

from gantryctl.commissioning.open_loop_axis import OpenLoopAxis, open_loop_axis, state_name
from gantryctl.commissioning.results import Context, Figure, Outcome, StepResult, failed, passed
from gantryctl.commissioning.room import sag_deg, stand_deg
from gantryctl.commissioning.stopping.controller_death import can_be_killed, kill_controller
from gantryctl.commissioning.stopping.silence import (
    Silence,
    SilentDrive,
    Way,
    fall_silent,
    seen_by_s,
    watched_ways,
)
from gantryctl.machine import Machine
from gantryctl.operation.proofs import silent_master_proof_path, store_silent_master_proof


def silence(c: Context) -> StepResult:
    """Stop commands, then the heartbeat, each alone; the drive must switch itself off and brake."""
    figures: dict[str, Figure] = {}
    lacking, times_s = [], []
    most_deg = sag_deg(c.machine)
    for way in Way:
        with open_loop_axis(c, stand_deg(c.machine), f"{way} silent") as axis:
            if way not in watched_ways(axis):
                lacking.append(f"{way.place} ({way})")
                continue
            axis.enable()
            seen = fall_silent(axis, Silence((way,), way.limit_s(axis.drive), most_deg))
            if seen.stopped:
                axis.wake()
        key = way.replace(" ", "_")
        most_ms = 1e3 * seen_by_s(way.limit_s(axis.drive), axis.period_s)
        figures[f"{key}_ms"] = Figure(1e3 * seen.stopped_s, high=most_ms)
        figures[f"{key}_moved_deg"] = Figure(seen.way_deg, high=most_deg)
        said = f"{way} silent: {_told(seen)}"
        c.say(f"  {said}")
        # One liar is enough: nothing that such a drive shows afterwards can be believed.
        if not seen.stopped:
            to_do = f"the drive does not stop a silent controller's axis ({way}): 6007, 605E, {way.place}"
            return failed("silence", said, to_do, **figures)
        times_s.append(seen.stopped_s)
    if not times_s:
        # The ledger refuses such a drive without a watchdog, which has a step of its own.
        why = f"this drive has no {', '.join(lacking)}"
        return StepResult(
            "silence", Outcome.NOT_TESTABLE, why, to_do="a watchdog beside the drive, and the step watchdog"
        )
    marker = _keep_proof(c)
    proof = ", ".join(f"{key} {figure.value:.4g}" for key, figure in figures.items())
    if lacking:
        proof += f"; this drive has no {', '.join(lacking)}"
    if marker is None:
        proof += "; this drive takes no marker: a restart between two runs is not noticed"
    return passed("silence", proof, **figures, silent_stop_s=min(times_s))


def _keep_proof(c: Context) -> int | None:
    """Keep that this drive was seen to stop; the marker that was left in it, None where it takes none."""
    with open_loop_axis(c, stand_deg(c.machine)) as axis:
        # Some drives answer SDO in PRE-OPERATIONAL only.
        axis.drive.node.enter_pre_operational()
        key, marker = axis.drive.opened.identity.key, axis.drive.leave_restart_marker()
        store_silent_master_proof(silent_master_proof_path(c.store.directory, c.machine), key, marker)
    return marker


def _told(seen: SilentDrive) -> str:
    """What a drive did in the silence, for people."""
    complained = (
        "no EMCY" if math.isnan(seen.complained_s) else f"EMCY after {1e3 * seen.complained_s:.0f} ms"
    )
    if seen.broken_off:
        return f"{complained}, {seen.broken_off}"
    brake = "open" if seen.brake_open else "closed"
    return (
        f"left operation enabled after {1e3 * seen.stopped_s:.0f} ms ({complained}), moved {seen.way_deg:.4f} deg, "
        f"{state_name(seen.state)}, brake {brake}"
    )


# --- a watchdog beside the drive -----------------------------------------------------------------------------------


class _Fall(NamedTuple):
    """One silence before a watchdog.

    Attributes:
        name: of its figures. ways: what falls silent.
        limit_s: time within which the watchdog acts.
    """

    name: str
    ways: tuple[Way, ...]
    limit_s: float


class _Watchdog(NamedTuple):
    """What stops the axis of a dead controller from outside of the drive, and the silences that prove it.

    Attributes:
        what: for people, with its place.
        falls: the last one is that of a controller that is killed.
        to_do: where it does not act in time.
    """

    what: str
    falls: tuple[_Fall, ...]
    to_do: str


def _watchdog_of(machine: Machine, by_node_s: float) -> _Watchdog | None:
    """The watchdog of a machine; None without one.

    Args:
        by_node_s: time after which the I/O node takes its outputs off when everything is silent.
    """
    can = machine.can
    if place := can.output_place("watchdog"):
        relay_s = 1e-3 * can.watchdog_ms
        to_do = f"the relay at {place} does not take the torque off within {can.watchdog_ms:g} ms: its time, its wires"
        return _Watchdog(f"the relay at {place}", (_Fall("watchdog", tuple(Way), relay_s),), to_do)
    if place := can.output_place("drive_enable"):
        # 1016 is proven alone: with 1400:05 beside it a whole silence would show the shorter of the two only.
        heartbeat = _Fall("watchdog_heartbeat", (Way.HEARTBEAT,), 1e-3 * can.heartbeat_timeout_ms)
        to_do = (
            f"node {can.io.node} does not take {place} off when the controller is gone (1016, 6206, 6207), or the "
            "relay behind it does not take the torque off: another node, its wires"
        )
        falls = (heartbeat, _Fall("watchdog", tuple(Way), by_node_s))
        return _Watchdog(f"the enable relay at {place}", falls, to_do)
    return None


def watchdog(c: Context) -> StepResult:
    """Kill the controller, or fall silent whole: the watchdog beside the drive must take the torque off.

    On a bus of the kernel a copy of this process runs the axis and gets SIGKILL; elsewhere silence stands for it.
    An output that an I/O node takes off by itself is shown by a silent heartbeat first, alone.
    """
    if _watchdog_of(c.machine, 0.0) is None:
        return StepResult("watchdog", Outcome.NOT_TESTABLE, "no output works a watchdog")
    figures: dict[str, Figure] = {}
    proofs: list[str] = []
    with open_loop_axis(c, stand_deg(c.machine), "all silent") as axis:
        io, own = axis.drive.beside.io, watched_ways(axis)
        dog = _watchdog_of(c.machine, 0.0 if io is None else io.ask_silence_limit_s())
        assert dog is not None
        seen_s = 0.0
        for fall in dog.falls:
            result, seen_s = _fall(c, axis, dog, fall, figures, proofs, own=bool(own))
            if result is not None:
                return result
    if not own:
        _keep_proof(c)
    shown = "the drive has no watch of its own" if not own else "its contact is open"
    # The last sign of the controller may have been older when it was silenced: the longest time is that of the setting.
    longest_s = max(seen_s, dog.falls[-1].limit_s)
    return passed("watchdog", f"{'; '.join(proofs)}; {shown}", **figures, silent_stop_s=longest_s)


def _fall(
    c: Context,
    axis: OpenLoopAxis,
    dog: _Watchdog,
    fall: _Fall,
    figures: dict[str, Figure],
    proofs: list[str],
    *,
    own: bool,
) -> tuple[StepResult | None, float]:
    """One silence; the result where it has failed, and the time until the drive was off."""
    beside = axis.drive.beside
    axis.enable()
    if beside.inputs.watchdog_contact() is False:
        proof = f"the drive is enabled, and the contact of {dog.what} shows open"
        return failed("watchdog", proof, "look at the bit watchdog_closed and its wire"), math.nan
    killed = len(fall.ways) > 1 and can_be_killed(c.machine)
    if killed:
        kill_controller(axis)
    seen = fall_silent(axis, Silence(fall.ways, fall.limit_s, sag_deg(c.machine)))
    closed = beside.ask_watchdog_contact()
    if seen.stopped:
        axis.wake()
    what = "all silent" if len(fall.ways) > 1 else f"{fall.ways[0]} silent"
    said = f"{'controller killed' if killed else what}: {_told(seen)}"
    c.say(f"  {said}")
    figures[f"{fall.name}_ms"] = Figure(
        1e3 * seen.stopped_s, high=1e3 * seen_by_s(fall.limit_s, axis.period_s)
    )
    figures[f"{fall.name}_moved_deg"] = Figure(seen.way_deg, high=sag_deg(c.machine))
    if not seen.stopped:
        return failed("watchdog", said, dog.to_do, **figures), math.nan
    if closed:
        to_do = f"{dog.what} has not opened: it hangs, or watchdog_closed is wired to something else"
        return failed("watchdog", f"{said}; its contact still shows closed", to_do, **figures), math.nan
    # The drive's own watch may have been earlier: then the contact alone shows what the watchdog did.
    if own and closed is None:
        to_do = f"wire the contact of {dog.what}: [can.inputs] or [can.io.inputs] watchdog_closed"
        return failed("watchdog", f"{said}, perhaps by the drive's own watch", to_do, **figures), math.nan
    proofs.append(said)
    return None, seen.stopped_s
