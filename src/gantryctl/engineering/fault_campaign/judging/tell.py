"""Tells the oracle of an axis what has just been injected: what the axis may do because of it, and for how long."""

from __future__ import annotations

import math

from gantryctl.drives.virtual.node import DriveNode
from gantryctl.engineering.fault_campaign.judging.effects import effect_of, hides_state
from gantryctl.engineering.faults.bench import FaultBench
from gantryctl.engineering.faults.injection import Injection
from gantryctl.engineering.faults.kinds.kind import Place
from gantryctl.engineering.faults.oracle.axis_oracle import AxisOracle


def plant_of(bench: FaultBench) -> object:
    """By what the oracle knows the axis of a bench: a drive alone has no controller yet."""
    device = bench.device
    return device.plant if isinstance(device, DriveNode) else device


def tell(axis: AxisOracle, each: Injection, bench: FaultBench) -> None:
    """Tell the oracle of this axis of an injection that acts from now on."""
    known, now, effect = axis.known, axis.now(), effect_of(each)
    watchdog_s = bench.machine.can.watchdog_ms * 1e-3
    if each.kind == "slow":
        known.brake_late_s = each.values["late_s"]
    if (each.where, each.kind) == (Place.BRAKE, "torque"):
        known.brake_share = each.values["share"]
    if each.kind == "outputs_dead" or (each.kind == "silent" and each.values["which"] == "io"):
        # The brake that it works falls with the watchdog relay, which waits for an edge that does not come.
        known.brake_late_s = max(known.brake_late_s, watchdog_s)
    if each.kind == "readings_late":
        known.reading_late_s = each.values["late_s"]
    if each.kind == "contact":
        known.contact_lies = each.values["open"]
    if each.kind == "inputs_stuck":
        # The contact of the brake among them keeps its level, and comes when they live again.
        known.contact_lies = True
    if hides_state(each):
        lasts_s = math.inf if each.for_s is None else each.for_s
        known.state_seen_ms = max(known.state_seen_ms, now.ms + 1e3 * lasts_s)
    if each.kind == "load_shift":
        known.load_share = lambda motor_rad: load_share(bench, motor_rad)
    if each.kind == "stall":
        known.hold(now, each.values["late_s"])
    if each.kind in ("drive_silent", "rpdo_lost"):
        # Nobody reaches the drive either, until the watchdog relay has fallen, or its own deadline has passed.
        known.hold(now, watchdog_s)
    known.inject(
        now, feedback=effect.feedback, at_once=effect.at_once, no_ramp=effect.no_ramp, late_s=effect.late_s
    )


def load_share(bench: FaultBench, motor_rad: float) -> float:
    """What the eccentric load asks for at a motor angle, in parts of what the brake has."""
    target, machine = bench.target, bench.machine
    ratio = machine.axis.ratio
    lever = math.sin(motor_rad / ratio - math.radians(machine.plant.load.eccentric_angle_deg))
    moment_nm = target.plant_value("eccentric_moment_nm") * lever / ratio
    return abs(moment_nm) / target.plant_value("brake_torque_nm")
