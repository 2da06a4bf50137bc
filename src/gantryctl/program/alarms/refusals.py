"""Rows of the alarm table: refused commands and notes."""

from __future__ import annotations

from typing import Final

from gantryctl.program.alarms.codes import Code, Reaction, Severity
from gantryctl.program.alarms.definition import Definition

_INFO, _REF = Severity.INFO, Severity.REFUSED

REFUSALS: Final = (
    Definition(
        Code.CTL_01, "Value out of range", _REF, Reaction.REF,
        "{name} must be {allowed}, got {measured}",
        "A command with a number that cannot be used. Nothing was changed.",
        "Give a value within the range.",
    ),
    Definition(
        Code.CTL_09, "Target beyond travel", _REF, Reaction.REF,
        "target {measured:.2f} deg is beyond {limit:+.2f} deg; you are at {position:.2f} deg, "
        "so {left:.2f} deg are left",
        "The axis is linear with a cable: there is no way round.",
        "Give a target within the travel.",
    ),
    Definition(
        Code.CTL_14, "Not in this state", _REF, Reaction.REF,
        "{measured}",
        "The command does not fit what the axis is doing.",
        "Wait for standstill, or stop first.",
    ),
    Definition(
        Code.CTL_15, "Hold-to-run not renewed", _INFO, Reaction.HLT,
        "hold-to-run was not renewed for {measured:.0f} ms, limit {limit:.0f} ms",
        "The key's signal was lost: window left, connection slow or gone.",
        "Release the key and press it again.",
    ),
    Definition(
        Code.CTL_21, "Hold-to-run too long", _INFO, Reaction.HLT,
        "the key was held for {measured:.0f} s, limit {limit:.0f} s",
        "A page that is stuck can go on renewing by itself: nobody is believed to hold a key for longer.",
        "Release the key and press it again.",
    ),
    Definition(
        Code.CTL_16, "No mode chosen", _REF, Reaction.REF,
        "no motion mode is chosen",
        "After a start the mode is none and nothing moves.",
        "Choose continuous or incremental.",
    ),
    Definition(
        Code.CTL_17, "No plan", _REF, Reaction.REF,
        "{measured}",
        "No motion within the limits leads there from the present state.",
        "Wait for standstill and try again.",
    ),
    Definition(
        Code.LIM_01, "End of travel", _INFO, Reaction.HLT,
        "stopped at {measured:.2f} deg, the end of travel",
        "A motion with a speed only ran to the end of its way.",
        "Move the other way.",
    ),
    Definition(
        Code.BRK_12, "Brake test overdue", _REF, Reaction.REF,
        "the brake test is overdue: up to {limit:.2f} deg/s only, asked for {measured:.2f} deg/s",
        "The brake must be tested from time to time: [brake] test_interval_days, test_interval_power_ups.",
        "Switch power off and test the brake (`gantryctl brake-test`), or move slowly.",
    ),
    Definition(
        Code.LIM_05, "Only inward", _REF, Reaction.REF,
        "at {measured:.2f} deg only motion {side} is open",
        "The axis is outside its travel or at a limit switch.",
        "Move back inward.",
    ),
    Definition(
        Code.INT_05, "Enabling switch", _REF, Reaction.HLT,
        "the enabling switch is off: up to {limit:.2f} deg/s only, asked for {measured:.2f} deg/s",
        "Faster motion by hand or from a remote screen needs the enabling switch, from the start to the end.",
        "Press the enabling switch or lower the speed.",
    ),
    Definition(
        Code.PWR_03, "Power is off", _REF, Reaction.REF,
        "power is off",
        "The axis follows commands only when power is on.",
        "Switch power on and wait until it shows on.",
    ),
    Definition(
        Code.PWR_04, "Cannot switch on", _REF, Reaction.REF,
        "cannot switch on: {measured}",
        "Something that must be right before power is not.",
        "Remove the cause, then switch on again.",
    ),
)  # fmt: skip
