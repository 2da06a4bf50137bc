"""Rows of the alarm table: brake, drive, interlocks, supply."""

from __future__ import annotations

from typing import Final

from gantryctl.program.alarms.codes import Code, Reaction, Severity
from gantryctl.program.alarms.definition import Definition

_STOP, _WARN = Severity.STOP, Severity.WARNING
_QS, _TO, _HOLD = Reaction.QUICK_STOP, Reaction.TORQUE_OFF, Reaction.HOLD

_CHECK_DRIVE: Final = "Read the drive's own fault display, remove the cause, then reset."

POWER: Final = (
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
        Code.BRK_08, "Brake test failed", _WARN, Reaction.W,
        "Brake test failed: {measured}",
        "The brake slips below its test torque, or the motor does not give it (then nothing moved).",
        "Nothing moves until a brake test passes, or service resets. Inspect the brake and the motor's torque.",
        lock=True, blocks_motion=True, before_motion="a brake test must pass, or service must reset",
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
