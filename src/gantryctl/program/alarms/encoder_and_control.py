"""The table of alarms and refusals: what is said, what is done, what to do.

The texts are templates; the numbers are filled in where the alarm is raised. Angles in deg, speeds in deg/s.
`docs/reference/alarms.md` is made from it.
"""

from __future__ import annotations

from typing import Final

from gantryctl.program.alarms.bus import BUS
from gantryctl.program.alarms.codes import Code, Reaction, Severity
from gantryctl.program.alarms.definition import Definition
from gantryctl.program.alarms.power import POWER
from gantryctl.program.alarms.refusals import REFUSALS
from gantryctl.program.alarms.start import START

_STOP, _WARN = Severity.STOP, Severity.WARNING
_QS, _TO = Reaction.QUICK_STOP, Reaction.TORQUE_OFF

_CALL: Final = "Do not reset. Check encoder cable and plug, then call service."

_ENCODER: Final = (
    Definition(
        Code.ENC_01, "Position jumped", _STOP, _TO,
        "Position jumped {measured:.4f} deg in one scan, limit {limit:.4f} deg",
        "The reading changed by more than the axis can move in a scan. The position is not valid any more.",
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
        Code.ENC_07, "Encoders disagree", _STOP, _TO,
        "Load-side encoder {measured:.4f} deg away from motor encoder and maps, limit {limit:.4f} deg",
        "One of the two encoders is wrong, the calibration belongs to another machine, or something between "
        "motor and ring has slipped or broken.",
        "Compare the angle with the marks. Find out which encoder is right before anything moves.", lock=True,
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
        "Speed {measured:.2f} deg/s while {command:.2f} deg/s was commanded, "
        "limit of the difference {limit:.2f} deg/s",
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
        "Not in position {time_s:.1f} s after the end of the motion: "
        "error {measured:.4f} deg, window {limit:.4f} deg",
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

ALARMS: Final[dict[Code, Definition]] = {
    row.code: row for row in (*_ENCODER, *BUS, *_CONTROL, *POWER, *REFUSALS, *START)
}
"""Every code with its definition."""
