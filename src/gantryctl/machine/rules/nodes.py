"""Rules of the nodes beside the drive: digital inputs and outputs, watchdog relay, encoder on the ring."""

from __future__ import annotations

from typing import Final

from gantryctl.machine.rules.book import Broken, at_least
from gantryctl.machine.rules.can import bus_rule
from gantryctl.machine.tables.model import Machine

_ENCODER: Final = ("can.load_encoder.source", "can.load_encoder.node")
_OUTPUTS: Final = ("brake_release", "watchdog", "horn", "lamp", "in_position", "at_rest")
_NODE_OUTPUTS: Final = (*_OUTPUTS, "drive_enable")
# Edges come once in a few scans, and one late scan must not open the relay.
_FEWEST_SCANS: Final = 4.0


@bus_rule("can.io.node", "can.node", "can.master_node", *_ENCODER)
def node_ids_differ(m: Machine) -> Broken:
    """Drive, controller, I/O node and encoder node have different node ids."""
    ids = [m.can.node, m.can.master_node, m.can.io.node]
    if m.can.load_encoder.source == "node":
        ids.append(m.can.load_encoder.node)
    present = [each for each in ids if each]
    return None if len(set(present)) == len(present) else "must differ from every other node id"


@bus_rule(*_ENCODER)
def encoder_node_is_named(m: Machine) -> Broken:
    """An encoder node has a node id."""
    encoder = m.can.load_encoder
    return (
        "must go with the node id of the encoder" if encoder.source == "node" and not encoder.node else None
    )


@bus_rule("control.compensation.load_encoder.active", "can.load_encoder.source")
def load_encoder_has_a_source(m: Machine) -> Broken:
    """A load-side loop on a bus reads an encoder that is named."""
    wanted = m.control.compensation.load_encoder.active and m.can.load_encoder.source == "none"
    return "must stay false: no encoder on the ring is named" if wanted else None


@bus_rule("brake.owner", "can.io.node", "can.io.outputs.brake_release", "can.outputs.brake_release")
def brake_has_one_output(m: Machine) -> Broken:
    """A brake worked by the controller has one output, and any other has none."""
    # Written out, for a rule reads only keys that it names.
    places = (m.can.io.node > 0 and m.can.io.outputs.brake_release >= 0) + (m.can.outputs.brake_release >= 0)
    if m.brake.owner == "controller_output":
        return (
            None if places == 1 else "must go with one output brake_release, of the drive or of the I/O node"
        )
    return 'must be "controller_output" where an output releases the brake' if places else None


@bus_rule("can.io.node", *(f"can.io.outputs.{name}" for name in _NODE_OUTPUTS))
def io_outputs_have_a_node(m: Machine) -> Broken:
    """Outputs of an I/O node have that node."""
    wired = any(getattr(m.can.io.outputs, name) >= 0 for name in _NODE_OUTPUTS)
    return "must be the id of the node whose outputs are wired" if wired and not m.can.io.node else None


@bus_rule(*(f"can.outputs.{name}" for name in _OUTPUTS))
def outputs_leave_the_brake_bit(m: Machine) -> Broken:
    """Bit 0 of 60FE is the brake of CiA 402 and no output beside it."""
    used = [name for name in _OUTPUTS if getattr(m.can.outputs, name) == 0]
    return 'must leave bit 0 alone, which [brake] owner = "object_60FE" works' if used else None


@bus_rule(
    *(f"can.outputs.{name}" for name in _OUTPUTS), *(f"can.io.outputs.{name}" for name in _NODE_OUTPUTS)
)
def outputs_share_no_bit(m: Machine) -> Broken:
    """Each output of the drive, and of the I/O node, has its own bit: a lamp on that of the brake would open it."""
    of_drive = [getattr(m.can.outputs, name) for name in _OUTPUTS]
    of_node = [getattr(m.can.io.outputs, name) for name in _NODE_OUTPUTS]
    for bits in of_drive, of_node:
        wired = [bit for bit in bits if bit >= 0]
        if len(set(wired)) < len(wired):
            return "must have a bit that no other output has"
    return None


@bus_rule(
    "can.inputs.estop_ok",
    "can.inputs.estop_ok_2",
    "can.io.inputs.estop_ok",
    "can.io.inputs.estop_ok_2",
    "can.io.node",
)
def estop_channels_differ(m: Machine) -> Broken:
    """The two channels of the emergency-stop chain are two inputs: one that is read twice never differs from itself."""
    at_drive = m.can.inputs.estop_ok, m.can.inputs.estop_ok_2
    at_node = (m.can.io.inputs.estop_ok, m.can.io.inputs.estop_ok_2) if m.can.io.node else (-1, -1)
    # An input at the node is read there, whatever 60FD says.
    first, second = (
        (node >= 0, node if node >= 0 else bit) for node, bit in zip(at_node, at_drive, strict=True)
    )
    return "must be another input than estop_ok_2" if first == second != (False, -1) else None


@bus_rule("can.io.outputs.drive_enable", "can.io.outputs.watchdog", "can.outputs.watchdog")
def watchdog_is_one(m: Machine) -> Broken:
    """What stops the axis of a dead controller is one: a relay that wants edges, or an output that a node takes off."""
    relay = m.can.io.outputs.watchdog >= 0 or m.can.outputs.watchdog >= 0
    both = relay and m.can.io.outputs.drive_enable >= 0
    return "must stay -1 beside a watchdog relay: a proof of both shows neither" if both else None


@bus_rule("can.watchdog_ms", "control.scan_period_ms")
def watchdog_outlasts_scans(m: Machine) -> Broken:
    """The watchdog relay waits longer than a few scans for its next edge."""
    return at_least(m.can.watchdog_ms, _FEWEST_SCANS * m.control.scan_period_ms, "four scans")
