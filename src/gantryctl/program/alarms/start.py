"""Rows of the alarm table: why an axis is not switched on after a start."""

from __future__ import annotations

from typing import Final

from gantryctl.program.alarms.codes import Code, Reaction, Severity
from gantryctl.program.alarms.definition import Definition

_REF: Final = Severity.REFUSED
_SET_ZERO: Final = "Read the witness mark, then `gantryctl encoder set-zero --angle A --witness TEXT`."

START: Final = (
    Definition(
        Code.ENC_08, "Encoder off by whole turns", _REF, Reaction.REF,
        "the reading is off by {moved_deg:+.3f} deg, whole motor turns",
        "The multiturn part of the encoder lost turns, or the gantry was moved by exactly that while off.",
        _SET_ZERO,
    ),
    Definition(
        Code.ENC_09, "Moved while off", _REF, Reaction.REF,
        "the gantry moved {moved_deg:+.3f} deg while off (limit {limit_deg:g} deg)",
        "Somebody moved it, or the brake let it creep. Up to the limit is gears settling: accepted and recorded.",
        "Look at the gantry; `gantryctl reset` acknowledges it under your name.",
    ),
    Definition(
        Code.ENC_10, "Angle not valid", _REF, Reaction.REF,
        "the angle is not valid: {why}",
        "No zero offset, more than 1 deg moved while off, or a reading that cannot be true.",
        _SET_ZERO,
    ),
    Definition(
        Code.ENC_11, "Another encoder", _REF, Reaction.REF,
        "the encoder is {serial}, the stored zero offset belongs to another one",
        "The encoder or the motor was replaced, or the memory is of another machine.",
        _SET_ZERO,
    ),
    Definition(
        Code.CFG_ENC_01, "Encoder wraps near the travel", _REF, Reaction.REF,
        "the encoder's range ends {minus_deg:.1f} deg below and {plus_deg:.1f} deg above the travel, "
        "too near",
        "Zero is badly placed in the multiturn range: the reading would jump by the whole range in motion.",
        "Turn the encoder on its shaft or mount it with its range centred, then `gantryctl encoder set-zero`.",
    ),
    Definition(
        Code.CFG_CAN_01, "Drive parameters forbid enabling", _REF, Reaction.REF,
        "the drive's parameters forbid enabling it: {parameters}",
        "With these parameters the drive would not stop the axis by itself when the controller is gone.",
        "Correct the parameters in the drive or in the machine file, then start again.",
    ),
    Definition(
        Code.CFG_CAN_02, "Not commissioned", _REF, Reaction.REF,
        "the machine is not commissioned: {why}",
        "There is no commissioning record for this drive with this configuration: its stops are not proven.",
        "Run `gantryctl commission --config FILE`.",
    ),
    Definition(
        Code.CFG_CAN_03, "Stop without controller not proven", _REF, Reaction.REF,
        "the stop without a controller is not proven: {why}",
        "It is not proven that this drive, since its last restart, stops the axis when the controller falls silent.",
        "Run `gantryctl commission --only silence --config FILE`: some seconds, at standstill.",
    ),
    Definition(
        Code.SYS_12, "Earlier stop not acknowledged", _REF, Reaction.REF,
        "{stopped_by} stopped the axis in an earlier run and is not acknowledged",
        "Each stop by an alarm holds the axis until somebody has looked at it, also over a restart.",
        "Look at it (`gantryctl alarms --last`), then `gantryctl reset`.",
    ),
)  # fmt: skip
