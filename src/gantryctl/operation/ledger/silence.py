"""Rows of a silent controller: what stops the axis when its commands, or all that it sends, end."""

from __future__ import annotations

import math
from typing import Final

from gantryctl.machine.rules.reaction import silent_angle_deg, silent_speed_max_deg_s
from gantryctl.operation.ledger.rows import SILENT_STOP_S, LedgerRow, Question, Standing

COMMANDS: Final = "stops_without_commands"
CONTROLLER: Final = "stops_without_controller"
SILENCE_STEP: Final = "silence"
WATCHDOG_STEP: Final = "watchdog"
_DEADLINE: Final = "1400:05"
_HEARTBEAT: Final = "1016:01"
_RAMP: Final = (False,)
_BRAKE: Final = (True,)


def silence_rows(q: Question) -> tuple[LedgerRow, LedgerRow]:
    """Stop without commands, and without a controller."""
    can = q.machine.can
    deadline, heartbeat = q.has(_DEADLINE), q.has(_HEARTBEAT)
    if not deadline and not heartbeat:
        return _by_watchdog(q, COMMANDS), _by_watchdog(q, CONTROLLER)
    # A dead controller sends neither commands nor heartbeat: the shorter watch acts.
    delay_ms = can.rpdo_deadline_ms if deadline else can.heartbeat_timeout_ms
    if not deadline:
        # Both go out in the same scan, so that commands end alone only where telegrams are lost on their way.
        cost = f"{q.why_not(_DEADLINE)}: it misses the controller, not single commands"
        return _row(q, COMMANDS, _HEARTBEAT, delay_ms, cost), _row(q, CONTROLLER, _HEARTBEAT, delay_ms)
    if not heartbeat:
        cost = f"{q.why_not(_HEARTBEAT)}: a dead controller sends no commands either"
        return _row(q, COMMANDS, _DEADLINE, delay_ms), _row(q, CONTROLLER, _DEADLINE, delay_ms, cost)
    return _row(q, COMMANDS, _DEADLINE, delay_ms), _row(q, CONTROLLER, _HEARTBEAT, delay_ms)


def _row(q: Question, what: str, by: str, delay_ms: float, cost: str = "") -> LedgerRow:
    """Row of a watch in the drive; `cost` where it makes up for the one that is meant for this."""
    angle, fastest = _way(q, delay_ms, _reaction(q))
    detail = "; ".join(part for part in (cost, angle) if part)
    if SILENCE_STEP in q.proofs.failed:
        return LedgerRow(what, Standing.LACKING, "", f"step {SILENCE_STEP} has failed", SILENCE_STEP)
    if SILENCE_STEP not in q.proofs.passed:
        return LedgerRow(
            what, Standing.LACKING, "", f"{by} is to be proven; {detail}", SILENCE_STEP, False, fastest
        )
    standing = Standing.MADE_UP if cost else Standing.PROVEN
    return LedgerRow(what, standing, f"{by}, step {SILENCE_STEP}", detail, SILENCE_STEP, False, fastest)


def _reaction(q: Question) -> tuple[bool, ...]:
    """Ways in which the drive stops by itself, True for torque off and brake."""
    # Lost communication is a fault: with 605E = 2 it ramps, with 0 it does not, and without 605E nobody knows.
    return _RAMP if q.has("605E:00") else _BRAKE if q.value("605E:00") == 0 else (*_RAMP, *_BRAKE)


def _way(q: Question, delay_ms: float, ways: tuple[bool, ...]) -> tuple[str, float | None]:
    """Delay and way in words, and the highest speed where the way is too long."""
    m, dec = q.machine, ramp_deg_s2(q)
    angle = max(silent_angle_deg(m, delay_ms, brake=brake, dec_deg_s2=dec) for brake in ways)
    how = " or ".join("torque off and brake" if brake else "its ramp" for brake in ways)
    text = f"{delay_ms:g} ms, then {how}: {angle:.2f} deg from {m.speed.setting_max_deg_s:g} deg/s"
    permitted = m.axis.stopping_angle_max_deg
    if angle <= permitted:
        return text, None
    speed = min(silent_speed_max_deg_s(m, delay_ms, brake=brake, dec_deg_s2=dec) for brake in ways)
    fastest = math.floor(10.0 * speed) / 10.0
    text += f", permitted {permitted:g} deg: not faster than {fastest:.1f} deg/s"
    # Where drive and computer hold a shorter one, it gives the speed back.
    top = m.speed.setting_max_deg_s
    stop = max(silent_angle_deg(m, 0.0, brake=brake, dec_deg_s2=dec) for brake in ways)
    longest_ms = math.floor(1e3 * (permitted - stop) / top)
    return (f"{text}; {longest_ms} ms allow {top:g} deg/s" if longest_ms > 0 else text), fastest


def ramp_deg_s2(q: Question) -> float:
    """Quick-stop ramp of the drive: that of the machine file where the drive takes it, else the measured one."""
    if q.has("6085:00"):
        return q.machine.virtual_axis.quick_dec_deg_s2
    return q.proofs.measured.get("quick_stop_dec_deg_s2", q.machine.virtual_axis.quick_dec_deg_s2)


def _by_watchdog(q: Question, what: str) -> LedgerRow:
    missing = (
        f"{q.why_not(_DEADLINE, _HEARTBEAT)}: the drive goes on at its last speed when its controller is gone"
    )
    can, proofs = q.machine.can, q.proofs
    relay, enable = can.output_place("watchdog"), can.output_place("drive_enable")
    if not (relay or enable):
        to_do = (
            "only a watchdog outside of it makes up for that: a relay that the controller toggles, or the enable of "
            "the drive on a node that takes it off by itself ([can.io.outputs] watchdog, drive_enable)"
        )
        return LedgerRow(what, Standing.LACKING, "", f"{missing}; {to_do}")
    if WATCHDOG_STEP in proofs.failed:
        detail = f"{missing}; step {WATCHDOG_STEP} has failed"
        return LedgerRow(what, Standing.LACKING, "", detail, WATCHDOG_STEP)
    proven = WATCHDOG_STEP in proofs.passed
    # Its contact lies in the safe-torque-off circuit: it takes the torque off, and the brake falls.
    shown_s = proofs.measured.get(SILENT_STOP_S) if proven else None
    set_ms = can.watchdog_ms if relay else can.heartbeat_timeout_ms
    way, fastest = _way(q, set_ms if shown_s is None else 1e3 * shown_s, _BRAKE)
    dog = f"the watchdog relay at {relay}" if relay else f"the enable relay at {enable} (1016, 6206, 6207)"
    if not proven:
        detail = f"{missing}; {dog} is to be proven; {way}"
        return LedgerRow(what, Standing.LACKING, "", detail, WATCHDOG_STEP, False, fastest)
    by = f"{dog}, step {WATCHDOG_STEP}"
    return LedgerRow(what, Standing.MADE_UP, by, f"{missing}; {way}", WATCHDOG_STEP, False, fastest)


def watch_step(q: Question) -> str:
    """Step that shows what the axis of a silent controller does: of the drive's own watch, or of one beside it."""
    return SILENCE_STEP if q.has(_DEADLINE) or q.has(_HEARTBEAT) else WATCHDOG_STEP
