"""Permission to give torque: None, or the reason against it. Nothing here changes anything."""

from __future__ import annotations

from typing import Final

from gantryctl.image import DriveState
from gantryctl.program.alarms.codes import Code
from gantryctl.program.alarms.log import AlarmLog, Refusal, refusal
from gantryctl.program.feedback import Feedback
from gantryctl.program.power.phases import PowerPhase
from gantryctl.program.power.sequence import PowerSequence
from gantryctl.program.settings import PowerSettings

_NO_POWER: Final = (DriveState.FAULT, DriveState.FAULT_REACTION_ACTIVE, DriveState.UNKNOWN)


def why_no_torque(feedback: Feedback, alarms: AlarmLog, but: Code | None = None) -> Refusal | None:
    """Why the drive may not be enabled now; the alarm `but` does not count."""
    first, blocking = alarms.first_out, alarms.blocking(but)
    if first is not None:
        reason = f"{first.code} is latched ({first.measured}): reset first"
    elif blocking is not None:
        reason = f"{blocking.code} is active ({blocking.measured}): {blocking.definition.before_motion}"
    elif not feedback.inputs.estop_ok:
        reason = "the emergency-stop chain is open"
    elif not feedback.inputs.mains_ready:
        reason = "the mains are not ready"
    elif feedback.state in _NO_POWER:
        reason = "the drive is in fault or its state is unknown: reset first"
    elif not feedback.position_valid:
        reason = "the position is not valid: service must compare the angle and reset"
    else:
        return None
    return refusal(Code.PWR_04, measured=reason)


def why_no_brake_test(
    settings: PowerSettings, power: PowerSequence, feedback: Feedback, alarms: AlarmLog
) -> Refusal | None:
    """Why a brake test may not begin now."""
    level_nm = power.brake_test.level_nm
    if power.brake_test.under_way:
        reason = "a brake test is under way already"
    elif settings.untestable:
        reason = f"not testable here: {settings.untestable}"
    elif power.phase is not PowerPhase.OFF:
        reason = "a brake test begins with power off: switch it off first"
    # The level comes on top of the torque that holds the load (decision 14).
    elif not level_nm <= settings.torque_max_nm - abs(power.holding.mean_nm):
        reason = f"a brake test with {level_nm:.1f} N m and the load are more than the motor's torque limit"
    else:
        # A test that passes clears BRK-08, so BRK-08 does not stand against it.
        return why_no_torque(feedback, alarms, but=Code.BRK_08)
    return refusal(Code.CTL_14, measured=reason)
