"""Catalogue and runs as text and as plain data for JSON."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any, Final

from gantryctl.engineering.faults.case import FaultCase
from gantryctl.engineering.faults.catalogue import cases_of, fault_row
from gantryctl.engineering.faults.run import FaultResult
from gantryctl.engineering.faults.seams import KINDS
from gantryctl.engineering.faults.table.row import Row
from gantryctl.engineering.faults.table.table import ROWS
from gantryctl.engineering.report.text import TextTable
from gantryctl.program.alarms.codes import Code

_LEFT: Final = (0, 1, 2, 3, 4)


def catalogue_text() -> TextTable:
    """One line per fault, and one for each further way to inject it."""
    lines = []
    for row in ROWS.values():
        cases = cases_of(row)
        if not any(case.number == row.number for case in cases):
            lines.append(_line(row.number, row.fault, row.reaction, row.codes, row))
        lines += [_line(case.number, case.title, case.reaction.value, case.codes, row) for case in cases]
    return TextTable.of("", lines)._replace(left=_LEFT)


def _line(number: str, title: str, reaction: str, codes: Sequence[Code], row: Row) -> dict[str, str]:
    return {
        "fault": number,
        "what happens": title,
        "reaction": reaction,
        "first alarm": " ".join(codes[:3]) or "-",
        "state": row.state.value,
    }


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


def fault_lines(number: str) -> list[str]:
    """Everything about a fault, line by line.

    Raises:
        UsageError: there is none of this number.
    """
    row = fault_row(number)
    case = next((each for each in cases_of(row) if each.number.lower() == number.strip().lower()), None)
    lines = _row_lines(row) if case is None else _case_lines(case)
    lines += [f"test         {test}" for test in row.tests]
    lines.append(f"state        {row.state.value}")
    if row.why:
        lines.append(f"reason       {row.why}")
    return lines


def _row_lines(row: Row) -> list[str]:
    return [
        f"{row.number}  {row.fault}",
        f"detected by  {row.detected_by}",
        f"reaction     {row.reaction}",
        f"first alarm  {' or '.join(row.codes) or 'none'}",
        "injected on  no axis",
    ]


def _case_lines(case: FaultCase) -> list[str]:
    lines = [
        f"{case.number}  {case.title}",
        f"begins in    {case.phase.value}",
        f"detected by  {case.detected_by}",
        f"reaction     {case.reaction.value}",
        f"first alarm  {' or '.join(case.codes) or 'none'}",
        f"told         {case.reads or '-'}",
        f"injected on  {' and '.join(case.buses)}",
    ]
    lines += [f"elsewhere    {each.code} where {each.why}" for each in case.instead]
    lines += [f"injection    {each.text}" for each in case.injections]
    return lines


def row_data(row: Row) -> dict[str, Any]:
    """A row of the table for JSON, with the cases that inject it."""
    return {
        "number": row.number,
        "fault": row.fault,
        "detected_by": row.detected_by,
        "reaction": row.reaction,
        "codes": list(row.codes),
        "tests": list(row.tests),
        "state": row.state.value,
        "why": row.why,
        "cases": [_case_data(case) for case in cases_of(row)],
    }


def _case_data(case: FaultCase) -> dict[str, Any]:
    return {
        "number": case.number,
        "title": case.title,
        "phase": case.phase.value,
        "detected_by": case.detected_by,
        "reaction": case.reaction.value,
        "codes": list(case.codes),
        "instead": [{"code": each.code, "why": each.why} for each in case.instead],
        "reads": case.reads,
        "on": list(case.buses),
        "injections": [each.model_dump(mode="json") for each in case.injections],
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
