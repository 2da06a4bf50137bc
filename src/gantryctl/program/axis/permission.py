"""Permission to give torque and to test the brake: functions of feedback and alarms."""

from __future__ import annotations

from typing import Final

from gantryctl.image import DriveState
from gantryctl.program.alarms.codes import Code
from gantryctl.program.alarms.log import AlarmLog, Refusal, refusal
from gantryctl.program.alarms.words import Said, Words
from gantryctl.program.feedback import FAULTS, Feedback
from gantryctl.program.monitors.site import why_site_forbids
from gantryctl.program.power.phases import PowerPhase
from gantryctl.program.power.sequence import PowerSequence
from gantryctl.program.settings import PowerSettings

# UNKNOWN is a state of its own, and no permission.
_NO_POWER: Final = (*FAULTS, DriveState.UNKNOWN)


def why_no_torque(feedback: Feedback, alarms: AlarmLog, but: Code | None = None) -> Refusal | None:
    """Why the drive may not be enabled now; the alarm `but` does not count."""
    first, blocking = alarms.first_out, alarms.blocking(but)
    reason: Words | Said
    # A latched alarm is named before the input that caused it.
    if first is not None:
        reason = Words.LATCHED(code=first.code, measured=first.refusal)
    elif blocking is not None:
        reason = blocking.active_words
    elif not feedback.inputs.estop_closed:
        reason = Words.ESTOP_OPEN
    elif (opened := why_site_forbids(feedback.inputs)) is not None:
        reason = opened
    elif not feedback.inputs.mains_ready:
        reason = Words.MAINS_NOT_READY
    elif feedback.state in _NO_POWER:
        reason = Words.DRIVE_FAULT
    elif not feedback.position_valid:
        reason = Words.POSITION_NOT_VALID
    else:
        return None
    return refusal(Code.PWR_04, reason=reason)


def why_no_brake_test(
    settings: PowerSettings, power: PowerSequence, feedback: Feedback, alarms: AlarmLog
) -> Refusal | None:
    """Why a brake test may not begin now."""
    level_nm = power.brake_test.level_nm
    reason: Words | Said
    if power.brake_test.under_way:
        reason = Words.TEST_UNDER_WAY
    elif settings.untestable:
        reason = Words.NOT_TESTABLE(why=settings.untestable)
    elif power.phase is not PowerPhase.OFF:
        reason = Words.TEST_NEEDS_POWER_OFF
    # The level comes on top of the torque that holds the load (decision 14).
    elif not level_nm <= settings.torque_max_nm - abs(power.holding.mean_nm):
        reason = Words.TEST_TORQUE_TOO_HIGH(level=level_nm)
    else:
        # A test that passes clears BRK-08, so BRK-08 does not stand against it.
        return why_no_torque(feedback, alarms, but=Code.BRK_08)
    return refusal(Code.CTL_14, reason=reason)
