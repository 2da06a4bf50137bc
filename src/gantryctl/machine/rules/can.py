"""Rules of [can]: bus, times, units; they hold only where the drive is on a bus."""

from __future__ import annotations

from collections.abc import Callable
from functools import wraps

from gantryctl.machine.rules.book import RATIO, Broken, Check, at_least, at_most, below, rule
from gantryctl.machine.tables.model import Machine

_TRAVEL = ("axis.pos_min_deg", "axis.pos_max_deg", "encoder.wrap_margin_min_deg")
# Drives take their limit as a current in whole per cent.
_LIMIT_PART = 0.95
# A deadline shorter than this trips on an ordinary late scan.
_FEWEST_SCANS = 3.0


def bus_rule(*paths: str) -> Callable[[Check], Check]:
    """Register a check of a machine whose drive is on a bus."""

    def register(check: Check) -> Check:
        @wraps(check)
        def on_bus(m: Machine) -> Broken:
            return check(m) if m.on_bus else None

        return rule(*paths, "drive.kind")(on_bus)

    return register


@bus_rule("can.node", "can.master_node")
def nodes_differ(m: Machine) -> Broken:
    """Drive and controller have different node ids."""
    return "must differ from the controller's" if m.can.node == m.can.master_node else None


@bus_rule("can.interface")
def interface_is_named(m: Machine) -> Broken:
    """A CAN machine names its interface."""
    return None if m.can.interface else 'must name a python-can interface, or "simulated"'


@bus_rule("can.heartbeat_ms", "can.heartbeat_timeout_ms")
def heartbeat_within_timeout(m: Machine) -> Broken:
    """At least two heartbeats fit into the time-out."""
    return at_most(m.can.heartbeat_ms, m.can.heartbeat_timeout_ms / 2.0, "half its time-out")


@bus_rule("can.rpdo_deadline_ms", "control.scan_period_ms")
def deadline_outlasts_scans(m: Machine) -> Broken:
    """The drive's deadline is longer than a few scans."""
    return at_least(m.can.rpdo_deadline_ms, _FEWEST_SCANS * m.control.scan_period_ms, "three scans")


@bus_rule("can.answer_ms", "control.scan_period_ms")
def answers_fit_a_scan(m: Machine) -> Broken:
    """Waiting for answers leaves time for the program."""
    return below(m.can.answer_ms, 0.75 * m.control.scan_period_ms, "three quarters of the scan")


@bus_rule("can.increments_per_turn", *RATIO, *_TRAVEL)
def position_fits_32_bits(m: Machine) -> Broken:
    """6064 has 32 bits: travel and wrap margins lie inside them."""
    travel = m.axis.pos_max_deg - m.axis.pos_min_deg + 2.0 * m.encoder.wrap_margin_min_deg
    most = 2.0**32 / (travel / 360.0 * m.axis.ratio)
    return at_most(m.can.increments_per_turn, most, "or the 32 bits of 6064 wrap within the travel")


@bus_rule("can.torque_limit_in_drive_nm", "motor.torque_max_nm")
def limit_in_drive_is_that_of_the_machine(m: Machine) -> Broken:
    """A torque limit set with the maker's tool is the machine's, or up to 5 % below it."""
    limit, most = m.can.torque_limit_in_drive_nm, m.motor.torque_max_nm
    if limit == 0.0:
        return None
    why = "the stops and the reducer are computed with [motor] torque_max_nm; set the same in the drive and here"
    return at_most(limit, most, why) or at_least(limit, _LIMIT_PART * most, why)


@bus_rule("plant.switches.second_pinion")
def one_drive_on_the_bus(m: Machine) -> Broken:
    """A second pinion has a second drive, and an axis on a bus has one."""
    if not m.plant.switches.second_pinion:
        return None
    return 'must be false with [drive] kind = "canopen": two drives of one axis are simulated with "sim" only'


@bus_rule("can.side_channel", "can.commissioning_required")
def truth_is_for_virtual_drives(m: Machine) -> Broken:
    """A machine with a side channel is virtual."""
    if m.can.side_channel and m.can.commissioning_required:
        return "must be empty on a real drive; a virtual one has commissioning_required = false"
    return None


@bus_rule("control.scan_period_ms")
def sync_period_fits_60c2(m: Machine) -> Broken:
    """60C2 takes 1 to 255 steps of a power of ten."""
    if m.control.scan_period_ms in range(1, 256):
        return None
    return "must be whole milliseconds, 1 to 255, as SYNC period"
