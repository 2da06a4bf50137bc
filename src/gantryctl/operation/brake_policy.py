"""Brake tests over the runs of a machine: the date of the next one, and the retained result of the last."""

from __future__ import annotations

import json
import math
from dataclasses import replace
from datetime import UTC, datetime, timedelta
from typing import Final

from gantryctl.machine import Machine
from gantryctl.operation.client import BrakeDue
from gantryctl.operation.store import TIME_FORMAT, time_text
from gantryctl.program import ALARMS, Axis, BrakeTestOutcome, BrakeTestResult, Code
from gantryctl.program.alarms.log import from_wire, messages_to_wire
from gantryctl.program.alarms.reason import ClearedBy, Reason
from gantryctl.program.alarms.words import Said, Words
from gantryctl.program.monitors.torque_model import TorqueModel
from gantryctl.runtime import Retained
from gantryctl.units import deg, rad
from gantryctl.wiring.program import speed_settings, untestable

LOCKED: Final = frozenset(str(code) for code, row in ALARMS.items() if row.lock)
"""Codes that only service may reset, also when they are of an earlier run."""


def brake_words(machine: Machine, retained: Retained, now: datetime) -> str:
    """The last test and the next one, for people; of a machine that is not running."""
    if retained.brake_failed:
        return f"failed {retained.brake_tested_at}: {retained.brake_failed}"
    due = brake_due(machine, untestable(machine), retained, retained.power_ups, now)
    last = f"passed {retained.brake_tested_at}; " if retained.brake_tested_at else ""
    return f"{last}{due.words}"


def brake_due(
    machine: Machine, reason: Words | Said | None, retained: Retained, power_ups: int, now: datetime
) -> BrakeDue:
    """When the next test is due, by what is retained and the power-ups so far.

    Args:
        reason: why it cannot be tested here, or None.
    """
    if reason:
        return BrakeDue("", None, overdue=False)
    # Seven days or 100 power-ups unless the machine file says otherwise, whichever comes first (decision 0014).
    brake, slow_deg_s = machine.brake, deg(speed_settings(machine).brake_overdue_rad_s)
    left = brake.test_interval_power_ups - (power_ups - retained.brake_tested_power_ups)
    tested = _time(retained.brake_tested_at)
    if tested is None:
        # A new simulated machine is delivered with a tested brake, so its power-ups count from the first. A real
        # one that was never tested is overdue; commissioning tests it (decision 0014).
        overdue = left <= 0 or not machine.plant_is_local or bool(retained.brake_tested_at)
        return BrakeDue("", max(0, left), overdue, slow_deg_s)
    due = tested + timedelta(days=brake.test_interval_days)
    return BrakeDue(time_text(due), max(0, left), left <= 0 or now >= due, slow_deg_s)


def judge_due(machine: Machine, axis: Axis, retained: Retained, power_ups: int) -> BrakeDue:
    """When the next test is due as of now; an overdue one slows the axis down."""
    # The program has no calendar: whoever runs it tells it that the test is overdue (decision 0014).
    due = brake_due(machine, axis.settings.power.untestable, retained, power_ups, datetime.now(UTC))
    axis.judge_brake(overdue=due.overdue)
    return due


def locked_code(retained: Retained | None) -> str:
    """Code of what only service may reset of what is retained, or ""."""
    if retained is None:
        return ""
    if retained.error_stop in LOCKED:
        return retained.error_stop
    return str(Code.BRK_08) if retained.brake_failed else ""


def _time(text: str) -> datetime | None:
    try:
        return datetime.strptime(text, TIME_FORMAT).replace(tzinfo=UTC)
    except ValueError:
        return None


def after_test(retained: Retained, result: BrakeTestResult, power_ups: int, now: datetime) -> Retained:
    """The memory after a test."""
    shown = replace(
        retained,
        brake_test_outcome=result.outcome.name.lower(),
        brake_test_text=result.text,
        brake_test_words=json.dumps(messages_to_wire(result.words)),
        brake_plus_nm=_known(result.plus_nm),
        brake_minus_nm=_known(result.minus_nm),
    )
    # What cannot be judged (stopped, an alarm, a reading that is no number) leaves verdict and date as they were.
    if result.outcome is BrakeTestOutcome.ABORTED:
        return shown
    failed = result.outcome is BrakeTestOutcome.FAILED
    return replace(
        shown,
        brake_tested_at=time_text(now),
        brake_tested_power_ups=power_ups,
        brake_failed=result.text if failed else "",
        brake_tests=retained.brake_tests + 1,
        brake_tests_failed=retained.brake_tests_failed + failed,
    )


def why_brake_failed(retained: Retained) -> Reason | None:
    """The failed test of an earlier run as a reason, or None."""
    if not retained.brake_failed:
        return None
    return Reason(Code.BRK_08, {"measured": _measured(retained)}, ClearedBy.SERVICE)


def last_test(retained: Retained) -> list[object]:
    """The sentence of the last test as messages; [] for none, or one of an older version."""
    found = json.loads(retained.brake_test_words or "[]")
    return found if isinstance(found, list) else []


def _measured(retained: Retained) -> object:
    # The words are those of the last test; an aborted one leaves the text of the failure before it.
    same = retained.brake_test_outcome == BrakeTestOutcome.FAILED.name.lower()
    found = last_test(retained) if same else []
    return from_wire(found[0]) if found else retained.brake_failed


def restore_failure(axis: Axis, retained: Retained) -> None:
    """Raise the alarm of a failed test of an earlier run."""
    # A failed test is kept over power-off: no power, no motion, until a test passes or service resets.
    if retained.brake_failed:
        axis.alarms.raise_(Code.BRK_08, measured=_measured(retained))


def restore_learned(axis: Axis, retained: Retained) -> None:
    """Give the axis what earlier runs have learned of its torque and its calibration, and the brake stops counted."""
    seen = _plain(retained.calibration_watch)
    _restore_weights(axis.monitors.drag.model, retained)
    axis.power.wear.restore(retained.emergency_brake_stops)
    if isinstance(seen, dict) and axis.load_side is not None and axis.load_side.watch is not None:
        axis.load_side.watch.restore(seen)
        axis.load_side.warn_stale()


def turned_weights(machine: Machine, retained: Retained, by_deg: float | None) -> str:
    """The learned torque behind a new zero, by which every angle is so much more; "" where nobody knows how much."""
    in_wind = machine.monitors.wind_torque_nm > 0.0
    model = TorqueModel(machine.axis.ratio, machine.motor.torque_rated_nm, in_wind=in_wind)
    _restore_weights(model, retained)
    if by_deg is None or not model.learned:
        return ""
    model.turn(rad(by_deg))
    return json.dumps(model.weights)


def _restore_weights(model: TorqueModel, retained: Retained) -> None:
    weights = _plain(retained.torque_weights)
    if isinstance(weights, list) and all(isinstance(weight, float) for weight in weights):
        model.restore(weights)


def _plain(text: str) -> object:
    """JSON values; None where there are none, or the text is no JSON."""
    try:
        return json.loads(text or "null")
    except ValueError:
        return None


def still_failed(axis: Axis, retained: Retained) -> str:
    """Measurement of a failed test, unless one has passed or service has reset since; else ""."""
    return retained.brake_failed if Code.BRK_08 in axis.alarms.active else ""


def _known(value: float) -> float | None:
    return value if math.isfinite(value) else None
