"""Rows of the safety inputs, and of the bit by which a drive says that it follows the command."""

from __future__ import annotations

from typing import Final

from gantryctl.drives.od.facts import DriveFacts
from gantryctl.machine import Machine
from gantryctl.machine.rules.reaction import driven_acc_deg_s2
from gantryctl.operation.ledger.rows import LedgerRow, Standing
from gantryctl.program.alarms.words import Clauses, Said, Words

# Inputs of [can.inputs] that count as good where they are not wired. The others are options that a site may have.
SAFETY_INPUTS: Final = (
    "estop_ok", "enabling_switch", "mains_ready", "brake_open", "limit_minus", "limit_plus",
)  # fmt: skip


def input_row(machine: Machine, name: str, facts: DriveFacts | None) -> LedgerRow:
    """Row of one input; `facts` None before the drive was asked, which counts as if it had 60FD."""
    if machine.can.io.node and getattr(machine.can.io.inputs, name) >= 0:
        # The set-up proves that the node has 6000 and sends it.
        return LedgerRow(name, Standing.OBJECT, machine.can.input_place(name))
    bit = getattr(machine.can.inputs, name)
    fact = None if facts is None else facts.objects.get((0x60FD, 0))
    sent = facts is None or (fact is not None and fact.mappable)
    if bit >= 0 and sent:
        return LedgerRow(name, Standing.OBJECT, f"60FD bit {bit}")
    detail = Clauses() if sent else Clauses((Words.LEDGER_NO_60FD,))
    return LedgerRow(name, Standing.LACKING, "", detail, "", True)


def following_row(machine: Machine) -> LedgerRow:
    """Whether the drive says that it follows the command."""
    if machine.can.follows_bit:
        return LedgerRow("drive_follows_command", Standing.OBJECT, "6041 bit 12")
    cost = Clauses((without_following_bit(machine),))
    return LedgerRow("drive_follows_command", Standing.MADE_UP, "velocity_deviation_deg_s", cost)


def without_following_bit(machine: Machine) -> Said:
    """Cost of a drive that does not say that it follows the command."""
    monitors = machine.monitors
    # A drive that ignores the command and drives the axis away shows it by its speed.
    seen_ms = (
        monitors.velocity_deviation_time_ms
        + 1e3 * monitors.velocity_deviation_deg_s / driven_acc_deg_s2(machine)
    )
    return Words.LEDGER_SEEN_LATER(time_ms=seen_ms, scan_ms=machine.control.scan_period_ms)
