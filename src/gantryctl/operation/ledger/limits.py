"""Rows of limits, ramp and brake: torque, speed, quick stop, and who commands the brake."""

from __future__ import annotations

import math
from typing import Final

from gantryctl.drives.od.verdicts import ParameterVerdict
from gantryctl.machine.rules.reaction import (
    REACTION_S,
    driven_acc_deg_s2,
    silent_angle_deg,
    silent_speed_max_deg_s,
)
from gantryctl.operation.ledger.rows import RAMP_DEG_S2, TORQUE_LIMIT_NM, LedgerRow, Question, Standing
from gantryctl.operation.ledger.silence import watch_step
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
        to_do = f"the stops are computed with [motor] torque_max_nm = {most:g}: give there what the drive has"
        return LedgerRow(TORQUE, Standing.LACKING, "", f"{why}; {to_do}", by_file=True)
    if entered == 0.0:
        to_do = "set the limit with the maker's tool and give it as [can] torque_limit_in_drive_nm"
        return LedgerRow(TORQUE, Standing.LACKING, "", f"{why}; {to_do}", by_file=True)
    if TORQUE_STEP in q.proofs.failed:
        return LedgerRow(TORQUE, Standing.LACKING, "", f"{why}; step {TORQUE_STEP} has failed", TORQUE_STEP)
    shown = q.proofs.measured.get(TORQUE_LIMIT_NM, 0.0) if TORQUE_STEP in q.proofs.passed else 0.0
    if shown >= entered:
        detail = f"{why}; {entered:g} N m set with the maker's tool"
        return LedgerRow(TORQUE, Standing.PROVEN, f"step {TORQUE_STEP}", detail, TORQUE_STEP)
    # A pulse is held by the brake and reaches a part of its torque: what lies above, nothing shows.
    open_nm = (
        f"{why}; {entered:g} N m set with the maker's tool, what lies above {shown:.0f} N m is not shown"
    )
    return LedgerRow(TORQUE, Standing.LACKING, "", open_nm, "", True)


def speed_row(q: Question) -> LedgerRow:
    """Speed ceiling: 6080, or the overspeed monitor of the controller."""
    if q.has("6080:00"):
        return LedgerRow(SPEED, Standing.OBJECT, "6080")
    m, monitors = q.machine, q.machine.monitors
    ceiling_r_min, why = q.value("6080:00"), q.why_not("6080:00")
    top_deg_s = m.speed.setting_max_deg_s
    if ceiling_r_min is not None and ceiling_r_min * DEG_S_PER_R_MIN / m.axis.ratio < top_deg_s:
        detail = f"{why}: the drive does not reach [speed] setting_max_deg_s = {top_deg_s:g}"
        return LedgerRow(SPEED, Standing.LACKING, "", detail, by_file=True)
    # A drive that runs away at its torque limit passes the trip and goes on until the monitor has seen it.
    acc = driven_acc_deg_s2(m)
    above = acc * (monitors.overspeed_time_ms + m.control.scan_period_ms) * 1e-3
    seen_ms = 1e3 * (m.speed.overspeed_trip_deg_s - top_deg_s) / acc + monitors.overspeed_time_ms
    cost = f"{why}; seen after {seen_ms:.0f} ms at {m.speed.overspeed_trip_deg_s + above:.1f} deg/s"
    return LedgerRow(SPEED, Standing.MADE_UP, "overspeed_trip_deg_s", cost)


def ramp_row(q: Question) -> LedgerRow:
    """Quick-stop ramp: 6085 with 605A, or the drive's own, measured."""
    option = q.value("605A:00")
    if q.has("6085:00") and (q.has("605A:00") or option in _BY_6085):
        return LedgerRow(
            RAMP, Standing.OBJECT, "6085, 605A", "" if q.has("605A:00") else q.why_not("605A:00")
        )
    why = q.why_not("6085:00", "605A:00")
    if RAMP_STEP in q.proofs.failed:
        return LedgerRow(RAMP, Standing.LACKING, "", f"{why}; step {RAMP_STEP} has failed", RAMP_STEP)
    dec = q.proofs.measured.get(RAMP_DEG_S2)
    if RAMP_STEP not in q.proofs.passed or dec is None:
        return LedgerRow(
            RAMP, Standing.LACKING, "", f"{why}; the drive's own ramp is to be measured", RAMP_STEP
        )
    m, reaction_ms = q.machine, 1e3 * REACTION_S
    angle = silent_angle_deg(m, reaction_ms, dec_deg_s2=dec)
    top = m.speed.setting_max_deg_s
    detail = f"{why}; {dec:.2f} deg/s2: {angle:.2f} deg from {top:g} deg/s with {reaction_ms:g} ms"
    permitted, fastest = m.axis.stopping_angle_max_deg, None
    if angle > permitted:
        fastest = math.floor(10.0 * silent_speed_max_deg_s(m, reaction_ms, dec_deg_s2=dec)) / 10.0
        detail += f", permitted {permitted:g} deg: not faster than {fastest:.1f} deg/s"
    return LedgerRow(RAMP, Standing.PROVEN, f"step {RAMP_STEP}", detail, RAMP_STEP, False, fastest)


def brake_row(q: Question) -> LedgerRow:
    """Who commands the brake, shown or not."""
    owner = q.machine.brake.owner
    if owner == "object_60FE":
        if q.facts.has(0x60FE, 1):
            return LedgerRow(BRAKE, Standing.OBJECT, "60FE:01")
        return LedgerRow(
            BRAKE, Standing.LACKING, "", "no 60FE: nobody commands the brake; another [brake] owner does"
        )
    if owner == "controller_output":
        return LedgerRow(BRAKE, Standing.OBJECT, q.machine.can.output_place("brake_release"))
    # No object says that a drive works a brake: it closes it when it is made to fault, or it does not.
    why = q.why_not("605C:00", "605E:00")
    order = f"{why}: the torque may go before the brake has closed" if why else ""
    step = watch_step(q)
    if step in q.proofs.failed:
        return LedgerRow(BRAKE, Standing.LACKING, "", f"step {step} has failed", step)
    if step not in q.proofs.passed:
        detail = "the drive works the brake, which is to be proven" + (f"; {order}" if order else "")
        return LedgerRow(BRAKE, Standing.LACKING, "", detail, step)
    return LedgerRow(BRAKE, Standing.PROVEN, f"step {step}", order, step)
