"""Catalogue and runs as text and as plain data for JSON."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any, Final

from gantryctl.engineering.faults.case import FaultCase
from gantryctl.engineering.faults.run import FaultResult
from gantryctl.engineering.faults.seams import KINDS
from gantryctl.engineering.report.text import TextTable

_LEFT: Final = (0, 1, 2, 3, 4)


def catalogue_text(cases: Sequence[FaultCase]) -> TextTable:
    """One row per fault."""
    rows = [
        {
            "fault": case.number,
            "what happens": case.title,
            "reaction": case.reaction.value,
            "first alarm": " ".join(case.codes[:3]) or "-",
            "state": case.done.value,
        }
        for case in cases
    ]
    return TextTable.of("", rows)._replace(left=_LEFT)


def kinds_text() -> TextTable:
    """One row per kind that a file of injections may have."""
    rows = [
        {
            "where": row.place.value,
            "kind": row.name,
            "args": " ".join(row.arguments) or "-",
            "": "bus" if row.needs_bus else "",
            "what it does": row.words,
        }
        for row in KINDS.values()
    ]
    return TextTable.of("", rows)._replace(left=_LEFT)


def case_lines(case: FaultCase) -> list[str]:
    """Everything about a row, line by line."""
    lines = [
        f"{case.number}  {case.title}",
        f"begins in    {case.phase.value}",
        f"detected by  {case.detected_by}",
        f"reaction     {case.reaction.value}",
        f"first alarm  {' or '.join(case.codes) or 'none'}",
        f"told         {case.reads or '-'}",
        f"injected on  {' and '.join(case.buses) if case.injectable else 'no axis'}",
    ]
    lines += [f"injection    {each.text}" for each in case.injections]
    lines += [f"test         {test}" for test in case.tests]
    lines.append(f"state        {case.done.value}{f': {case.why}' if case.why else ''}")
    if case.failing:
        lines.append(f"waits for    {case.failing}")
    return lines


def case_data(case: FaultCase) -> dict[str, Any]:
    """A row for JSON."""
    return {
        "number": case.number,
        "title": case.title,
        "phase": case.phase.value,
        "detected_by": case.detected_by,
        "reaction": case.reaction.value,
        "codes": list(case.codes),
        "reads": case.reads,
        "on": list(case.buses) if case.injectable else [],
        "injections": [each.model_dump(mode="json") for each in case.injections],
        "tests": list(case.tests),
        "state": case.done.value,
        "why": case.why,
        "waits_for": case.failing,
    }


def result_lines(result: FaultResult) -> list[str]:
    """What a run led to, line by line."""
    limit = f", permitted {result.limit_deg:.3f}" if math.isfinite(result.limit_deg) else ""
    rest = f"at rest after {result.rest_s:.3f} s" if math.isfinite(result.rest_s) else "it still moves"
    validity = "valid" if result.position_valid else "not valid"
    held = "held by torque" if result.held else "torque off"
    lines = [
        f"true way     {result.way_deg:.3f} deg{limit} (motor side), {rest}, at most {result.vel_peak_deg_s:.2f} deg/s",
        f"first alarm  {result.first_out or 'none'}",
        f"all alarms   {' '.join(result.codes) or 'none'}",
        f"told angle   {result.told_deg:.3f} deg, {validity}; true {result.true_deg:.3f} deg",
        f"at the end   {held}; enabled {result.enables} times after the alarm",
    ]
    lines += [f"told         {text}" for text in result.texts]
    lines += [f"WRONG        {fault}" for fault in result.faults]
    lines.append("as it must be" if result.ok else "not as it must be")
    return lines


def result_data(result: FaultResult) -> dict[str, Any]:
    """A run for JSON; a number that is not finite is null."""
    return {
        "number": result.number,
        "drive": result.kind,
        "brake_owner": result.brake_owner,
        "scan_ms": result.scan_ms,
        "speed_deg_s": result.speed_deg_s,
        "angle_deg": result.angle_deg,
        "onset_s": _finite(result.onset_s),
        "way_deg": result.way_deg,
        "limit_deg": _finite(result.limit_deg),
        "rest_s": _finite(result.rest_s),
        "vel_peak_deg_s": result.vel_peak_deg_s,
        "first_out": result.first_out,
        "codes": list(result.codes),
        "told_deg": result.told_deg,
        "true_deg": result.true_deg,
        "position_valid": result.position_valid,
        "enables": result.enables,
        "held": result.held,
        "texts": list(result.texts),
        "faults": list(result.faults),
        "ok": result.ok,
    }


def _finite(value: float) -> float | None:
    return value if math.isfinite(value) else None
