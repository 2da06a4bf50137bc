"""What must hold in every scan from every reachable state: the invariants 4, 5, 6 and 10, and what follows from them.

`Before` is what was known when the scan began; each property looks at it, at the event, and at the world after it.
"""

from __future__ import annotations

import math
from typing import Final, NamedTuple

from gantryctl.image import DriveRequest, DriveState
from gantryctl.program import AxisState, PowerPhase, Reaction
from gantryctl.program.alarms.codes import Code
from gantryctl.program.power.phases import RISING, Proof
from gantryctl.service.protocol.messages import Identity
from states.people import PANEL, SERVICE, Event
from states.stub_drive import ENABLED
from states.world import World

_MOVING: Final = (
    AxisState.DISCRETE_MOTION,
    AxisState.CONTINUOUS_MOTION,
    AxisState.STOPPING,
    AxisState.HOMING,
)
# Rounding of the position law with a following error of 0.
_NO_SPEED_RAD_S: Final = 1e-6
# Commands of a person that may lead to torque: power, a brake test, and a motion that wakes a parked axis.
_BEGINS: Final = ("power", "brake_test", "move", "jog", "increment", "set")
# On the way up the brake is not released before these end; unloading has shown that it holds.
_BRAKE_HOLDS: Final = (PowerPhase.ENABLING, PowerPhase.PROVING, PowerPhase.SETTLING, PowerPhase.UNLOADING)
_TORQUE: Final = (DriveRequest.ENABLE, DriveRequest.QUICK_STOP)


class Before(NamedTuple):
    """The state that a scan begins with."""

    phase: PowerPhase
    request: DriveRequest
    brake_open: bool
    first_out: Code | None
    locked: bool
    resetting: bool
    holder: Identity | None
    reactions: dict[Code, Reaction]
    at_rest: bool
    status: bool
    waiting: bool


def look(world: World) -> Before:
    axis, alarms = world.axis, world.axis.alarms
    return Before(
        axis.power.phase,
        axis.power.request,
        axis.power.brake_open,
        None if alarms.first_out is None else alarms.first_out.code,
        any(alarm.definition.lock for alarm in alarms.active.values()),
        axis.recovery.resetting,
        world.holder,
        {alarm.code: alarm.reaction for alarm in alarms.active.values()},
        axis.virtual.at_rest,
        axis.power.status,
        axis.motion.waiting is not None,
    )


def violations(before: Before, event: Event, world: World) -> list[str]:
    """Every property that this scan has broken, in words."""
    return [
        f"{judge.__name__}: {said}"
        for judge in (
            clean_wire,
            latched,
            asked_for,
            load_held,
            doubted,
            torque_off_stays,
            stop_accepted,
            told,
        )
        for said in judge(before, event, world)
    ]


def clean_wire(_: Before, __: Event, world: World) -> list[str]:
    """INV-4: the speed command is finite, and 0 unless the axis is in a state of motion and enabled."""
    output, axis = world.output, world.axis
    speed = output.vel_cmd_rad_s
    if not math.isfinite(speed) or not math.isfinite(output.torque_ff_nm):
        return [f"the command is {output}"]
    if abs(speed) > _NO_SPEED_RAD_S and (
        axis.state not in _MOVING or output.request is not DriveRequest.ENABLE
    ):
        return [f"speed command {speed:.3g} rad/s in {axis.state.name} with {output.request.name}"]
    return []


def latched(before: Before, event: Event, world: World) -> list[str]:
    """INV-5: a stop is latched until a reset by somebody who may, and nothing moves while it is."""
    found = []
    axis = world.axis
    first = axis.alarms.first_out
    if first is not None and abs(world.output.vel_cmd_rad_s) > 0.0:
        found.append(f"speed command {world.output.vel_cmd_rad_s:.3g} rad/s with {first.code} latched")
    if (first is not None) != (axis.state is AxisState.ERROR_STOP):
        found.append(f"{axis.state.name} with {first and first.code} latched")
    resets = before.resetting or event.kind == "reset"
    if before.first_out is not None and (first is None or first.code is not before.first_out) and not resets:
        found.append(f"{before.first_out} is latched no more, and nobody has reset it")
    if (
        event.kind == "reset"
        and axis.recovery.resetting
        and event.who not in (SERVICE, PANEL)
        and before.locked
    ):
        found.append(f"{event.who} resets what only service may")
    # Reset never shortens a stop.
    if resets and before.phase.name in ("QUICK_STOPPING", "TORQUE_OFF") and first is None:
        found.append(f"a reset ended {before.phase.name}")
    return found


def asked_for(before: Before, event: Event, world: World) -> list[str]:
    """INV-5, INV-10: the drive is enabled when the holder of control asks for it now, or to hold the load (HOLD)."""
    now, phase = world.output.request, world.axis.power.phase
    if now is not DriveRequest.ENABLE or before.request is DriveRequest.ENABLE:
        return []
    if phase is PowerPhase.TORQUE_HOLD:
        return []
    if before.first_out is not None and not before.resetting:
        return [f"enabled in {phase.name} with {before.first_out} latched"]
    # A motion that was asked for while the brake was closing, and that nothing has ended since.
    if before.waiting and before.phase in (PowerPhase.DISABLING, PowerPhase.PARKED):
        return []
    if event.kind not in _BEGINS:
        return [f"enabled in {phase.name}, and nobody has asked for it"]
    if event.who != before.holder:
        return [f"enabled for {event.who}, and {before.holder} has control"]
    return []


def load_held(before: Before, _: Event, world: World) -> list[str]:
    """INV-6: the brake is commanded closed, or the drive is enabled and asked to stay so; it opens after a proof."""
    found = []
    output, drive, power = world.output, world.image.drive, world.axis.power
    if output.brake_open and (drive.state not in ENABLED or output.request not in _TORQUE):
        found.append(f"brake open with the drive in {drive.state.name} and {output.request.name}")
    opens = output.brake_open and not before.brake_open
    if opens and not drive.brake_open:
        proof_possible = world.axis.settings.power.torque_preload
        if power.proof is not Proof.PROVEN and (proof_possible or power.proof is not Proof.NOT_POSSIBLE):
            found.append(f"brake opens with its torque {power.proof.value}")
    # Torque was proven, and the release was decided in this scan before the stop came.
    released = before.phase in (PowerPhase.SETTLING, PowerPhase.ENABLING)
    if opens and world.axis.alarms.first_out is not None and not released:
        found.append(f"brake opens with {world.axis.alarms.first_out.code} latched")
    # Torque goes off behind a brake that says closed, or has been late and is said to be (BRK-06).
    goes_off = (
        before.request in _TORQUE and output.request not in _TORQUE and before.phase not in _BRAKE_HOLDS
    )
    contact_lies = Code.BRK_06 in world.axis.alarms.active or power._drive_owns_brake
    if goes_off and power.phase is not PowerPhase.TORQUE_OFF and drive.brake_open and not contact_lies:
        found.append(f"torque off in {power.phase.name} with the brake open")
    return found


def doubted(_: Before, __: Event, world: World) -> list[str]:
    """A reading in doubt: torque off and brake, in every phase, in the scan that doubts it."""
    output = world.output
    if world.axis.feedback.in_doubt and (output.brake_open or output.request in _TORQUE):
        return [f"{output.request.name} in {world.axis.power.phase.name} with the reading in doubt"]
    return []


def torque_off_stays(before: Before, _: Event, world: World) -> list[str]:
    """TORQUE OFF acts in the scan of its alarm, and nothing makes it weaker."""
    found = []
    power, output = world.axis.power, world.output
    if before.phase is PowerPhase.TORQUE_OFF and power.phase not in (PowerPhase.TORQUE_OFF, PowerPhase.OFF):
        found.append(f"TORQUE_OFF became {power.phase.name}")
    new = [
        alarm
        for alarm in world.axis.alarms.active.values()
        if alarm.reaction is Reaction.TORQUE_OFF
        and before.reactions.get(alarm.code) is not Reaction.TORQUE_OFF
    ]
    stronger = any(alarm.reaction is Reaction.HOLD for alarm in world.axis.alarms.active.values())
    if new and not stronger and output.request in _TORQUE:
        found.append(f"{new[0].code} is TORQUE OFF, and the drive is told {output.request.name}")
    if new and output.brake_open:
        found.append(f"{new[0].code} is TORQUE OFF, and the brake is told to open")
    return found


def stop_accepted(before: Before, event: Event, world: World) -> list[str]:
    """INV-10: a stop is accepted from everybody in every state."""
    axis = world.axis
    if event.kind == "quick_stop" and before.phase is not PowerPhase.OFF:
        # A second quick stop within two scans finds no new edge: then power that was rising goes down again.
        goes_down = axis.power.phase is PowerPhase.OFF or (before.phase in RISING and not world.wants_power)
        if axis.state is not AxisState.ERROR_STOP and not goes_down:
            return [f"no ErrorStop after a quick stop from {before.phase.name}, but {axis.state.name}"]
        if world.output.vel_cmd_rad_s != 0.0:
            return ["a speed command after a quick stop"]
    if event.kind == "stop":
        stands = axis.virtual.at_rest or axis.virtual.stopping
        if not stands and axis.state not in (AxisState.STOPPING, AxisState.ERROR_STOP):
            return [f"{axis.state.name} goes on after a stop"]
        if axis.motion.waiting is not None:
            return ["a motion still waits for the brake after a stop"]
        # From a page a stop takes back a power-up; the panel has a switch for that.
        if (
            world.operator is not None
            and axis.power.phase in RISING
            and world.wants_power
            and not before.status
        ):
            return [f"power goes on in {axis.power.phase.name} after a stop"]
    return []


def told(_: Before, __: Event, world: World) -> list[str]:
    """Power.Status and the state tell what is: on only with an enabled drive behind it or a brake that holds."""
    axis = world.axis
    if axis.power.phase is PowerPhase.ON and world.image.drive.state is not DriveState.OPERATION_ENABLED:
        return [f"ON with the drive in {world.image.drive.state.name}"]
    if axis.state is AxisState.STANDSTILL and not axis.power.status:
        return ["Standstill without power"]
    return []
