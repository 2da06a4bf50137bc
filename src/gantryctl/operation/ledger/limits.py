"""Rows of limits, ramp and brake: torque, speed, quick stop, and who commands the brake."""

from __future__ import annotations

from typing import Final

from gantryctl.drives.od.verdicts import ParameterVerdict
from gantryctl.machine.rules.reaction import (
    REACTION_S,
    driven_acc_deg_s2,
    permitted_speed_deg_s,
    ramp_angle_deg,
    ramp_speed_max_deg_s,
)
from gantryctl.operation.ledger.rows import (
    RAMP_DEG_S2,
    TORQUE_LIMIT_NM,
    LedgerRow,
    Question,
    Standing,
    costs,
    step_failed,
)
from gantryctl.operation.ledger.silence import watch_step
from gantryctl.program.alarms.words import Clauses, Said, Words
from gantryctl.units import DEG_S_PER_R_MIN

TORQUE: Final = "limits_torque"
SPEED: Final = "limits_speed"
RAMP: Final = "ramps_quick_stop"
BRAKE: Final = "keeps_brake"
TORQUE_STEP: Final = "torque"
RAMP_STEP: Final = "ramp"
# Option codes of 605A that ramp down with 6085 (CiA 402): then torque off, or held.
_BY_6085: Final = (2, 6)


def torque_row(q: Question) -> LedgerRow:
    """Torque limit: 6072, or a limit of the maker's tool that a pulse has shown and a person has accepted."""
    most, entered = q.machine.motor.torque_max_nm, q.machine.can.torque_limit_in_drive_nm
    if q.has("6072:00"):
        return LedgerRow(TORQUE, Standing.OBJECT, "6072")
    why = q.why_not("6072:00")
    if q.verdict("6072:00") is not ParameterVerdict.ABSENT:
        detail = Clauses((*why, Words.LEDGER_COMPUTED_TORQUE(torque=most)))
        return LedgerRow(TORQUE, Standing.LACKING, "", detail, by_file=True)
    if entered == 0.0:
        detail = Clauses((*why, Words.LEDGER_ENTER_LIMIT))
        return LedgerRow(TORQUE, Standing.LACKING, "", detail, by_file=True)
    if TORQUE_STEP in q.proofs.failed:
        return LedgerRow(TORQUE, Standing.LACKING, "", Clauses((*why, step_failed(TORQUE_STEP))), TORQUE_STEP)
    shown = q.proofs.measured.get(TORQUE_LIMIT_NM, 0.0) if TORQUE_STEP in q.proofs.passed else 0.0
    if shown >= entered:
        detail = Clauses((*why, Words.LEDGER_ENTERED(torque=entered)))
        return LedgerRow(TORQUE, Standing.PROVEN, _by(TORQUE_STEP), detail, TORQUE_STEP)
    # A pulse is held by the brake and reaches a part of its torque: what lies above, nothing shows.
    open_nm = Clauses((*why, Words.LEDGER_NOT_SHOWN(torque=entered, shown=shown)))
    return LedgerRow(TORQUE, Standing.LACKING, "", open_nm, "", True)


def speed_row(q: Question) -> LedgerRow:
    """Speed ceiling: 6080, or the overspeed monitor of the controller."""
    if q.has("6080:00"):
        return LedgerRow(SPEED, Standing.OBJECT, "6080")
    m, monitors = q.machine, q.machine.monitors
    ceiling_r_min, why = q.value("6080:00"), q.why_not("6080:00")
    top_deg_s = m.speed.setting_max_deg_s
    if ceiling_r_min is not None and ceiling_r_min * DEG_S_PER_R_MIN / m.axis.ratio < top_deg_s:
        detail = Clauses((costs(why, Words.LEDGER_TOO_SLOW(speed=top_deg_s)),))
        return LedgerRow(SPEED, Standing.LACKING, "", detail, by_file=True)
    # A drive that runs away at its torque limit passes the trip and goes on until the monitor has seen it.
    acc = driven_acc_deg_s2(m)
    above = acc * (monitors.overspeed_time_ms + m.control.scan_period_ms) * 1e-3
    seen_ms = 1e3 * (m.speed.overspeed_trip_deg_s - top_deg_s) / acc + monitors.overspeed_time_ms
    seen = Words.LEDGER_OVERSPEED_SEEN(time_ms=seen_ms, speed=m.speed.overspeed_trip_deg_s + above)
    return LedgerRow(SPEED, Standing.MADE_UP, "overspeed_trip_deg_s", Clauses((*why, seen)))


def ramp_row(q: Question) -> LedgerRow:
    """Quick-stop ramp: 6085 with 605A, or the drive's own, measured."""
    option = q.value("605A:00")
    if q.has("6085:00") and (q.has("605A:00") or option in _BY_6085):
        return LedgerRow(RAMP, Standing.OBJECT, "6085, 605A", q.why_not("605A:00"))
    why = q.why_not("6085:00", "605A:00")
    if RAMP_STEP in q.proofs.failed:
        return LedgerRow(RAMP, Standing.LACKING, "", Clauses((*why, step_failed(RAMP_STEP))), RAMP_STEP)
    dec = q.proofs.measured.get(RAMP_DEG_S2)
    if RAMP_STEP not in q.proofs.passed or dec is None:
        return LedgerRow(RAMP, Standing.LACKING, "", Clauses((*why, Words.LEDGER_RAMP_UNKNOWN)), RAMP_STEP)
    m, reaction_ms = q.machine, 1e3 * REACTION_S
    angle = ramp_angle_deg(m, reaction_ms, dec)
    top = m.speed.setting_max_deg_s
    own = Words.LEDGER_OWN_RAMP(acceleration=dec, angle=angle, speed=top, time_ms=reaction_ms)
    detail = Clauses((*why, own))
    permitted, fastest = m.required.stopping_angle_deg, None
    if angle > permitted:
        fastest = permitted_speed_deg_s(ramp_speed_max_deg_s(m, reaction_ms, dec))
        detail = Clauses((*detail, Words.LEDGER_NOT_FASTER(limit=permitted, speed=fastest)))
    return LedgerRow(RAMP, Standing.PROVEN, _by(RAMP_STEP), detail, RAMP_STEP, False, fastest)


def brake_row(q: Question) -> LedgerRow:
    """Who commands the brake, shown or not."""
    owner = q.machine.brake.owner
    if owner == "object_60FE":
        if q.facts.has(0x60FE, 1):
            return LedgerRow(BRAKE, Standing.OBJECT, "60FE:01")
        return LedgerRow(BRAKE, Standing.LACKING, "", Clauses((Words.LEDGER_NOBODY_BRAKES,)))
    if owner == "controller_output":
        return LedgerRow(BRAKE, Standing.OBJECT, q.machine.can.output_place("brake_release"))
    # No object says that a drive works a brake: it closes it when it is made to fault, or it does not.
    why = q.why_not("605C:00", "605E:00")
    order = (costs(why, Words.LEDGER_TORQUE_FIRST),) if why else ()
    step = watch_step(q)
    if step in q.proofs.failed:
        return LedgerRow(BRAKE, Standing.LACKING, "", Clauses((step_failed(step),)), step)
    if step not in q.proofs.passed:
        return LedgerRow(BRAKE, Standing.LACKING, "", Clauses((Words.LEDGER_BRAKE_TO_PROVE, *order)), step)
    return LedgerRow(BRAKE, Standing.PROVEN, _by(step), Clauses(order), step)


def _by(step: str) -> Said:
    return Words.LEDGER_STEP(step=step)
