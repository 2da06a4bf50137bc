"""The table of alarms and refusals: what is said, what is done, what to do. `docs/reference/alarms.md` comes from it.

The texts are templates; the numbers are filled in where the alarm is raised. Angles in deg, speeds in deg/s.
"""

from __future__ import annotations

from typing import Final, NamedTuple

from gantryctl.program.codes import Code, Reaction, Severity


class Definition(NamedTuple):
    """One row: `message` names what was measured against which limit."""

    code: Code
    title: str
    severity: Severity
    reaction: Reaction
    message: str
    cause: str
    to_do: str
    lock: bool = False
    """Only the service role may reset it."""
    blocks_motion: bool = False
    """No motion while it is active, though it does not stop the axis."""


_STOP, _WARN, _INFO, _REF = Severity.STOP, Severity.WARNING, Severity.INFO, Severity.REFUSED
_QS, _TO, _HOLD = Reaction.QUICK_STOP, Reaction.TORQUE_OFF, Reaction.HOLD

_CALL: Final = "Do not reset. Check encoder cable and plug, then call service."
_CHECK_DRIVE: Final = "Read the drive's own fault display, remove the cause, then reset."

_ENCODER: Final = (
    Definition(
        Code.ENC_01, "Position jumped", _STOP, _TO,
        "Position jumped {measured:.4f} deg in one scan, limit {limit:.4f} deg",
        "The encoder reading changed by more than the axis can move in a scan. The position is not valid any more.",
        _CALL, lock=True,
    ),
    Definition(
        Code.ENC_02, "Encoder frozen", _STOP, _TO,
        "Encoder value unchanged for {time_ms:.0f} ms while {measured:.2f} deg/s was commanded",
        "The encoder, its cable or its evaluation has stopped, or the motor is blocked.",
        _CALL, lock=True,
    ),
    Definition(
        Code.ENC_03, "One bad encoder reading", _WARN, Reaction.W,
        "{measured} bad encoder reading, used prediction",
        "A reading came with a checksum error. One is bridged; the count is kept.",
        "If it comes back: check the encoder cable's screen and plug.",
    ),
    Definition(
        Code.ENC_04, "Too many bad encoder readings", _STOP, _TO,
        "{measured} bad encoder readings within {time_ms:.0f} ms, limit {limit}",
        "Checksum errors in a row: cable, screen, plug or encoder.",
        _CALL, lock=True,
    ),
    Definition(
        Code.ENC_05, "Encoder alarm", _STOP, _TO,
        "The encoder reports an alarm of its own",
        "Lamp, signal amplitude, position error or supply inside the encoder.",
        "Do not reset. Read the encoder's alarm word with the drive's tool and call service.", lock=True,
    ),
    Definition(
        Code.ENC_06, "Encoder warning", _WARN, Reaction.W,
        "The encoder reports a warning: lamp reserve, temperature or battery",
        "The encoder still measures well, but will not for ever.",
        "Plan its service. The axis goes on.",
    ),
    Definition(
        Code.ENC_13, "Position not valid", _REF, Reaction.REF,
        "The position is not valid since {measured}",
        "After an encoder fault nobody knows where the axis is.",
        "Let service compare the angle with a witness mark and reset.",
    ),
    Definition(
        Code.CAN_07, "Reading too old", _STOP, _QS,
        "The drive's reading is {measured:.0f} ms old, limit {limit:.0f} ms",
        "The drive's telegrams come late or not at all.",
        "Check bus cable, terminators and load, then reset.",
    ),
)  # fmt: skip

_CONTROL: Final = (
    Definition(
        Code.CTL_02, "A value that is no number", _STOP, _QS,
        "{measured} is not a finite number",
        "A reading or a computed command was not finite. It never reaches the drive.",
        "Keep the trace and report it; reset when the cause is known.",
    ),
    Definition(
        Code.CTL_03, "Following error", _STOP, _QS,
        "Following error {measured:.3f} deg, limit {limit:.3f} deg at {speed:.2f} deg/s",
        "The axis does not follow its set-point: load, friction, torque limit or gains.",
        "Look at torque and following error in the trace, remove the cause, then reset.",
    ),
    Definition(
        Code.CTL_04, "Overspeed", _STOP, _QS,
        "Speed {measured:.2f} deg/s, limit {limit:.2f} deg/s",
        "The axis runs faster than it was told: drive scaling, gains, or a load that pushes.",
        "Check the drive's speed scaling and ceiling, then reset.",
    ),
    Definition(
        Code.CTL_05, "Moves against command", _STOP, _TO,
        "Speed {measured:.2f} deg/s while {command:.2f} deg/s was commanded, limit of the difference {limit:.2f} deg/s",
        "The drive does not obey its speed command: sign, scaling or speed feedback.",
        "Do not move again before sign and scaling of the speed have been tested.",
    ),
    Definition(
        Code.CTL_07, "Torque saturated", _STOP, _QS,
        "Torque limit reached for {time_ms:.0f} ms while the following error grew to {measured:.3f} deg",
        "The load needs more torque than the drive may give.",
        "Check balance, friction and overload of the drive, then reset.",
    ),
    Definition(
        Code.CTL_13, "Standstill lost", _STOP, _QS,
        "Moved {measured:.4f} deg at standstill, window {limit:.4f} deg",
        "Something moves the axis while it should stand.",
        "Check load, brake and drive, then reset.",
    ),
    Definition(
        Code.CTL_10, "Stop point beyond travel", _STOP, _QS,
        "From {measured:.2f} deg/s the axis would come to rest at {position:.2f} deg, limit {limit:.2f} deg",
        "The measured angle and speed would carry the axis over its travel.",
        "Move back inward at low speed; check why the axis ran ahead of its set-point.",
    ),
    Definition(
        Code.CTL_11, "Not in position", _WARN, Reaction.W,
        "Not in position {time_s:.1f} s after the end of the motion: error {measured:.4f} deg, window {limit:.4f} deg",
        "The set-point has arrived, the axis has not: friction, gains or torque.",
        "Do not use this angle. Move again; if it comes back, call service.",
    ),
    Definition(
        Code.CTL_12, "Following error high", _WARN, Reaction.W,
        "Following error {measured:.3f} deg, warning at {limit:.3f} deg, stop at {trip:.3f} deg",
        "The axis follows worse than usual.",
        "Look at the trend in the trace; plan service.",
    ),
    Definition(
        Code.LIM_02, "Over-travel", _STOP, _QS,
        "Angle {measured:.2f} deg, limit {limit:.2f} deg",
        "The measured angle passed the over-travel limit.",
        "Reset, then move back inward: the way back is open.",
    ),
    Definition(
        Code.LIM_03, "Limit switch", _STOP, _QS,
        "The {side} limit switch opened at {measured:.2f} deg",
        "The axis is at the hardware limit, or the switch's wire is broken.",
        "Reset, then move back inward: the way back is open. Check the switch if the angle is well inside.",
    ),
    Definition(
        Code.LIM_04, "Both limit switches", _STOP, _QS,
        "Both limit switches are open at {measured:.2f} deg",
        "The axis cannot be at both ends: common wire or supply.",
        "Repair the wiring, then reset.",
    ),
)  # fmt: skip

_POWER: Final = (
    Definition(
        Code.BRK_01, "Brake does not release", _STOP, _TO,
        "Brake still closed {time_ms:.0f} ms after the release command, limit {limit:.0f} ms",
        "Brake supply, coil or feedback contact.",
        "Check the brake's supply and contact, then reset.",
    ),
    Definition(
        Code.BRK_03, "Brake does not hold", _STOP, _HOLD,
        "Moved {measured:.4f} deg while the torque was taken off, limit {limit:.4f} deg",
        "The brake slips under the load; the motor holds it.",
        "Do not switch off. Secure the load and call service.", lock=True,
    ),
    Definition(
        Code.BRK_04, "Brake slips", _STOP, _HOLD,
        "Moved {measured:.4f} deg while switched off, limit {limit:.4f} deg",
        "The closed brake lets the load move; the motor holds it where it can.",
        "Keep people away. Secure the load and call service.", lock=True,
    ),
    Definition(
        Code.BRK_05, "Brake closed in motion", _STOP, _QS,
        "Brake feedback says closed at {measured:.2f} deg/s, following error {error:.3f} deg",
        "Brake supply lost, or the brake command failed.",
        "Check the brake's supply and wiring; inspect the brake, then reset.",
    ),
    Definition(
        Code.BRK_06, "Brake feedback contradicts", _WARN, Reaction.W,
        "Brake feedback says {measured} for {time_ms:.0f} ms, commanded {command}",
        "Feedback contact or its wire, or the brake does not do what it is told.",
        "Check contact and wire, then reset. No motion before.", blocks_motion=True,
    ),
    Definition(
        Code.BRK_07, "Torque not proven", _STOP, _TO,
        "Torque {measured:.1f} N m after {time_ms:.0f} ms, at least {limit:.1f} N m wanted before the brake opens",
        "The drive is enabled but gives no torque: motor cable, current limit, torque scaling.",
        "The brake stayed closed. Check the motor cable and the drive's torque limit, then reset.",
    ),
    Definition(
        Code.BRK_10, "Sag after release", _STOP, _QS,
        "Moved {measured:.4f} deg after the brake opened, limit {limit:.4f} deg",
        "The drive does not hold the load: preload, gains or torque limit.",
        "The brake was closed again. Check the learned holding torque and the drive's gains, then reset.",
    ),
    Definition(
        Code.BRK_11, "Load still moving", _STOP, _HOLD,
        "Still {measured:.2f} deg/s, {time_s:.1f} s after torque off and brake",
        "The brake does not stop the load.",
        "Keep people away. Secure the load and call service.", lock=True,
    ),
    Definition(
        Code.DRV_01, "Drive fault", _STOP, _TO,
        "The drive reports a fault: {measured}",
        "The drive switched itself off.",
        _CHECK_DRIVE,
    ),
    Definition(
        Code.DRV_02, "Drive warning", _WARN, Reaction.W,
        "The drive reports a warning",
        "Temperature, overload or supply near its limit.",
        "Read the drive's display. The axis goes on.",
    ),
    Definition(
        Code.DRV_03, "Drive stuck", _STOP, _TO,
        "Drive stuck in {measured} for {time_ms:.0f} ms, wanted {command}",
        "The drive does not make the step it was asked for: missing release, local control, wrong parameter.",
        _CHECK_DRIVE,
    ),
    Definition(
        Code.DRV_04, "Drive lost its enable", _STOP, _TO,
        "Drive went to {measured} without being asked",
        "Someone or something else switched the drive off: release input, tool, supply.",
        _CHECK_DRIVE,
    ),
    Definition(
        Code.DRV_07, "Quick stop not obeyed", _STOP, _TO,
        "Speed {measured:.2f} deg/s in a quick stop, ramp allows {limit:.2f} deg/s",
        "The drive does not brake as set, or its speed feedback is wrong.",
        _CHECK_DRIVE,
    ),
    Definition(
        Code.INT_03, "Emergency stop", _STOP, _TO,
        "The emergency-stop chain opened at {measured:.2f} deg",
        "A button was pressed or the chain is broken. The hardware acts; this mirrors it.",
        "Release the button when it is safe, reset, switch on again.",
    ),
    Definition(
        Code.INT_06, "Quick stop asked for", _STOP, _QS,
        "Quick stop by the operator at {measured:.2f} deg, {speed:.2f} deg/s",
        "The operator asked for it.",
        "Reset, switch on again.",
    ),
    Definition(
        Code.PWR_01, "Mains lost", _STOP, _TO,
        "Mains no longer ready at {measured:.2f} deg, {speed:.2f} deg/s",
        "Supply switched off or failed.",
        "Restore the supply, reset, switch on again.",
    ),
    Definition(
        Code.THM_01, "Overload high", _WARN, Reaction.W,
        "{measured:.0f} % of the drive's overload budget used, warning at {limit:.0f} %",
        "More torque than rated for too long.",
        "Move less or slower; check balance and friction.",
    ),
)  # fmt: skip

_MESSAGES: Final = (
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
        Code.LIM_05, "Only inward", _REF, Reaction.REF,
        "at {measured:.2f} deg only motion {side} is open",
        "The axis is outside its travel or at a limit switch.",
        "Move back inward.",
    ),
    Definition(
        Code.INT_05, "Enabling switch", _REF, Reaction.HLT,
        "the enabling switch is off: hold-to-run and increments up to {limit:.2f} deg/s only, asked for {measured:.2f} deg/s",
        "Faster motion by hand needs the enabling switch.",
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

ALARMS: Final[dict[Code, Definition]] = {row.code: row for row in (*_ENCODER, *_CONTROL, *_POWER, *_MESSAGES)}
"""Every code with its definition."""
