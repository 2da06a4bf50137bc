"""Rows of a silent controller: what stops the axis when its commands, or all that it sends, end."""

from __future__ import annotations

import math
from typing import Final

from gantryctl.machine.rules.reaction import permitted_speed_deg_s, silent_angle_deg, silent_speed_max_deg_s
from gantryctl.operation.ledger.rows import (
    SILENT_STOP_S,
    LedgerRow,
    Question,
    Standing,
    costs,
    step_failed,
)
from gantryctl.program.alarms.words import Clauses, Said, Words

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
    held = q.value(_HEARTBEAT)
    delay_ms = (
        can.rpdo_deadline_ms if deadline else can.heartbeat_timeout_ms if held is None else held & 0xFFFF
    )
    if not deadline:
        # Both go out in the same scan, so that commands end alone only where telegrams are lost on their way.
        cost = costs(q.why_not(_DEADLINE), Words.LEDGER_MISSES_CONTROLLER)
        return _row(q, COMMANDS, _HEARTBEAT, delay_ms, cost), _row(q, CONTROLLER, _HEARTBEAT, delay_ms)
    if not heartbeat:
        cost = costs(q.why_not(_HEARTBEAT), Words.LEDGER_DEAD_SENDS_NOTHING)
        return _row(q, COMMANDS, _DEADLINE, delay_ms), _row(q, CONTROLLER, _DEADLINE, delay_ms, cost)
    return _row(q, COMMANDS, _DEADLINE, delay_ms), _row(q, CONTROLLER, _HEARTBEAT, delay_ms)


def _row(q: Question, what: str, by: str, delay_ms: float, cost: Said | None = None) -> LedgerRow:
    """Row of a watch in the drive; `cost` where it makes up for the one that is meant for this."""
    angle, fastest = _way(q, delay_ms, _reaction(q))
    detail = angle if cost is None else (cost, *angle)
    if SILENCE_STEP in q.proofs.failed:
        return LedgerRow(what, Standing.LACKING, "", Clauses((step_failed(SILENCE_STEP),)), SILENCE_STEP)
    if SILENCE_STEP not in q.proofs.passed:
        to_prove = Clauses((Words.LEDGER_TO_PROVE(by=by), *detail))
        return LedgerRow(what, Standing.LACKING, "", to_prove, SILENCE_STEP, False, fastest)
    standing = Standing.MADE_UP if cost else Standing.PROVEN
    shown = Words.LEDGER_BY_STEP(by=by, step=SILENCE_STEP)
    return LedgerRow(what, standing, shown, Clauses(detail), SILENCE_STEP, False, fastest)


def _reaction(q: Question) -> tuple[bool, ...]:
    """Ways in which the drive stops by itself, True for torque off and brake."""
    # Lost communication is a fault: with 605E = 2 it ramps, with 0 it does not, and without 605E nobody knows.
    return _RAMP if q.has("605E:00") else _BRAKE if q.value("605E:00") == 0 else (*_RAMP, *_BRAKE)


def _way(q: Question, delay_ms: float, ways: tuple[bool, ...]) -> tuple[tuple[Said, ...], float | None]:
    """Delay and way in words, and the highest speed where the way is too long."""
    m, dec = q.machine, ramp_deg_s2(q)
    angle = max(silent_angle_deg(m, delay_ms, brake=brake, dec_deg_s2=dec) for brake in ways)
    how = Words.LEDGER_BRAKE if ways == _BRAKE else Words.LEDGER_RAMP
    if len(ways) > 1:
        how = Words.LEDGER_RAMP_OR_BRAKE
    way = Words.LEDGER_WAY(time_ms=delay_ms, how=how, angle=angle, speed=m.speed.setting_max_deg_s)
    permitted = m.required.stopping_angle_deg
    if angle <= permitted:
        return (way,), None
    speed = min(silent_speed_max_deg_s(m, delay_ms, brake=brake, dec_deg_s2=dec) for brake in ways)
    fastest = permitted_speed_deg_s(speed)
    slower = Words.LEDGER_NOT_FASTER(limit=permitted, speed=fastest)
    # Where drive and computer hold a shorter one, it gives the speed back.
    top = m.speed.setting_max_deg_s
    stop = max(silent_angle_deg(m, 0.0, brake=brake, dec_deg_s2=dec) for brake in ways)
    longest_ms = math.floor(1e3 * (permitted - stop) / top)
    if longest_ms <= 0:
        return (way, slower), fastest
    return (way, slower, Words.LEDGER_SHORTER_ALLOWS(time_ms=longest_ms, speed=top)), fastest


def ramp_deg_s2(q: Question) -> float:
    """Quick-stop ramp of the drive: that of the machine file where the drive takes it, else the measured one."""
    if q.has("6085:00"):
        return q.machine.virtual_axis.quick_dec_deg_s2
    return q.proofs.measured.get("quick_stop_dec_deg_s2", q.machine.virtual_axis.quick_dec_deg_s2)


def _by_watchdog(q: Question, what: str) -> LedgerRow:
    missing = costs(q.why_not(_DEADLINE, _HEARTBEAT), Words.LEDGER_GOES_ON)
    can, proofs = q.machine.can, q.proofs
    relay, enable = can.output_place("watchdog"), can.output_place("drive_enable")
    if not (relay or enable):
        return LedgerRow(what, Standing.LACKING, "", Clauses((missing, Words.LEDGER_WATCHDOG_WANTED)))
    if WATCHDOG_STEP in proofs.failed:
        return LedgerRow(
            what, Standing.LACKING, "", Clauses((missing, step_failed(WATCHDOG_STEP))), WATCHDOG_STEP
        )
    proven = WATCHDOG_STEP in proofs.passed
    # Its contact lies in the safe-torque-off circuit: it takes the torque off, and the brake falls.
    shown_s = proofs.measured.get(SILENT_STOP_S) if proven else None
    set_ms = can.watchdog_ms if relay else can.heartbeat_timeout_ms
    way, fastest = _way(q, set_ms if shown_s is None else 1e3 * shown_s, _BRAKE)
    dog = Words.LEDGER_WATCHDOG_RELAY(place=relay) if relay else Words.LEDGER_ENABLE_RELAY(place=enable)
    if not proven:
        detail = Clauses((missing, Words.LEDGER_TO_PROVE(by=dog), *way))
        return LedgerRow(what, Standing.LACKING, "", detail, WATCHDOG_STEP, False, fastest)
    by = Words.LEDGER_BY_STEP(by=dog, step=WATCHDOG_STEP)
    return LedgerRow(what, Standing.MADE_UP, by, Clauses((missing, *way)), WATCHDOG_STEP, False, fastest)


def watch_step(q: Question) -> str:
    """Step that shows what the axis of a silent controller does: of the drive's own watch, or of one beside it."""
    return SILENCE_STEP if q.has(_DEADLINE) or q.has(_HEARTBEAT) else WATCHDOG_STEP
