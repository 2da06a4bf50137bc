"""Codes of alarms and refusals, what the axis does about them, and a row of the alarm table."""

from __future__ import annotations

from enum import Enum, IntEnum, StrEnum
from typing import NamedTuple

from gantryctl.program.alarms.words import Words


class Reaction(IntEnum):
    """What an alarm makes the axis do; the larger one wins.

    QUICK_STOP is for what leaves the feedback believable and the drive obedient; anything that puts either
    in doubt is TORQUE_OFF: on a wrong feedback the drive's own ramp runs away.
    """

    # The numbers are an order: `max` of two reactions is the one that counts.
    W = 0
    """Warning or note: keep going."""
    REF = 1
    """Refuse the command, with the reason; nothing changes."""
    HLT = 2
    """Stop on the jog-release ramp, stay enabled."""
    QUICK_STOP = 3
    """The drive's quick-stop ramp, then brake, then torque off: ErrorStop."""
    TORQUE_OFF = 4
    """Torque off and brake at once: ErrorStop."""
    HOLD = 5
    """Keep or restore torque at zero speed, because the brake is not trusted: ErrorStop."""


class Severity(Enum):
    """Urgency of a message."""

    INFO = "INFO"
    WARNING = "WARNING"
    REFUSED = "REFUSED"
    STOP = "STOP"


class Code(StrEnum):
    """Stable codes: one cause, one page of the manual."""

    # A gap is a code of the fault catalogue that this version does not raise; no number is used twice.
    ENC_01 = "ENC-01"
    ENC_02 = "ENC-02"
    ENC_03 = "ENC-03"
    ENC_04 = "ENC-04"
    ENC_05 = "ENC-05"
    ENC_06 = "ENC-06"
    ENC_07 = "ENC-07"
    ENC_08 = "ENC-08"
    ENC_09 = "ENC-09"
    ENC_10 = "ENC-10"
    ENC_11 = "ENC-11"
    ENC_12 = "ENC-12"
    ENC_13 = "ENC-13"
    ENC_14 = "ENC-14"
    CTL_01 = "CTL-01"
    CTL_02 = "CTL-02"
    CTL_03 = "CTL-03"
    CTL_04 = "CTL-04"
    CTL_05 = "CTL-05"
    CTL_06 = "CTL-06"
    CTL_07 = "CTL-07"
    CTL_08 = "CTL-08"
    CTL_09 = "CTL-09"
    CTL_10 = "CTL-10"
    CTL_11 = "CTL-11"
    CTL_12 = "CTL-12"
    CTL_13 = "CTL-13"
    CTL_14 = "CTL-14"
    CTL_15 = "CTL-15"
    CTL_16 = "CTL-16"
    CTL_17 = "CTL-17"
    CTL_18 = "CTL-18"
    CTL_19 = "CTL-19"
    CTL_21 = "CTL-21"
    CTL_22 = "CTL-22"
    CTL_23 = "CTL-23"
    CAN_01 = "CAN-01"
    CAN_02 = "CAN-02"
    CAN_03 = "CAN-03"
    CAN_04 = "CAN-04"
    CAN_05 = "CAN-05"
    CAN_06 = "CAN-06"
    CAN_07 = "CAN-07"
    CAN_08 = "CAN-08"
    CAN_09 = "CAN-09"
    CAN_10 = "CAN-10"
    CAN_12 = "CAN-12"
    CAN_13 = "CAN-13"
    CAN_14 = "CAN-14"
    CAN_15 = "CAN-15"
    CAN_16 = "CAN-16"
    LIM_01 = "LIM-01"
    LIM_02 = "LIM-02"
    LIM_03 = "LIM-03"
    LIM_04 = "LIM-04"
    LIM_05 = "LIM-05"
    LIM_06 = "LIM-06"
    BRK_01 = "BRK-01"
    BRK_02 = "BRK-02"
    BRK_03 = "BRK-03"
    BRK_04 = "BRK-04"
    BRK_05 = "BRK-05"
    BRK_06 = "BRK-06"
    BRK_07 = "BRK-07"
    BRK_08 = "BRK-08"
    BRK_09 = "BRK-09"
    BRK_10 = "BRK-10"
    BRK_11 = "BRK-11"
    BRK_12 = "BRK-12"
    BRK_13 = "BRK-13"
    BRK_14 = "BRK-14"
    DRV_01 = "DRV-01"
    DRV_02 = "DRV-02"
    DRV_03 = "DRV-03"
    DRV_04 = "DRV-04"
    DRV_05 = "DRV-05"
    DRV_06 = "DRV-06"
    DRV_07 = "DRV-07"
    DRV_08 = "DRV-08"
    DRV_09 = "DRV-09"
    DRV_10 = "DRV-10"
    DRV_11 = "DRV-11"
    DRV_12 = "DRV-12"
    DRV_13 = "DRV-13"
    DRV_14 = "DRV-14"
    DRV_15 = "DRV-15"
    INT_01 = "INT-01"
    INT_02 = "INT-02"
    INT_03 = "INT-03"
    INT_04 = "INT-04"
    INT_05 = "INT-05"
    INT_06 = "INT-06"
    INT_07 = "INT-07"
    INT_08 = "INT-08"
    PWR_01 = "PWR-01"
    PWR_03 = "PWR-03"
    PWR_04 = "PWR-04"
    THM_01 = "THM-01"
    THM_02 = "THM-02"
    THM_03 = "THM-03"
    THM_04 = "THM-04"
    SYS_12 = "SYS-12"
    CFG_ENC_01 = "CFG-ENC-01"
    CFG_CAN_01 = "CFG-CAN-01"
    CFG_CAN_02 = "CFG-CAN-02"
    CFG_CAN_03 = "CFG-CAN-03"
    CFG_CAN_04 = "CFG-CAN-04"
    CFG_CAN_05 = "CFG-CAN-05"
    SYS_02 = "SYS-02"
    SYS_03 = "SYS-03"
    SYS_05 = "SYS-05"
    SYS_06 = "SYS-06"
    SYS_07 = "SYS-07"
    SYS_09 = "SYS-09"
    SYS_10 = "SYS-10"
    SYS_11 = "SYS-11"
    SYS_13 = "SYS-13"
    SEC_01 = "SEC-01"
    SEC_02 = "SEC-02"
    SEC_03 = "SEC-03"
    SEC_04 = "SEC-04"
    SEC_05 = "SEC-05"
    SEC_06 = "SEC-06"
    SEC_07 = "SEC-07"
    SEC_08 = "SEC-08"
    SEC_09 = "SEC-09"
    SEC_10 = "SEC-10"
    SEC_11 = "SEC-11"
    SEC_12 = "SEC-12"
    SEC_13 = "SEC-13"
    JRN_01 = "JRN-01"
    JRN_02 = "JRN-02"
    JRN_03 = "JRN-03"
    JRN_04 = "JRN-04"
    JRN_05 = "JRN-05"
    JRN_07 = "JRN-07"


class Text(NamedTuple):
    """The texts of a row in one language; `message` names what was measured against which limit."""

    title: str
    message: str
    cause: str
    to_do: str


class Definition(NamedTuple):
    """One row: number formats stand in the English message; the Chinese one has the same fields without them."""

    code: Code
    severity: Severity
    reaction: Reaction
    english: Text
    chinese: Text
    lock: bool = False
    """Only the service role may reset it."""
    blocks_motion: bool = False
    """No motion while it is active, though it does not stop the axis."""
    before_motion: Words = Words.RESET_FIRST
    """The condition for motion that a refused motion names then."""
    horn: bool = False
    """It sounds the horn (`OutputImage.horn`) until it is reset: the load moves by itself."""
