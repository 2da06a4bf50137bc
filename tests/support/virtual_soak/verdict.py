"""Judges the log of a virtual soak: stops, warnings, drift, memory, journal. Pure functions of what the log says."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from typing import Any, Final

from support.soak.verdict import Finding, slope_of
from support.virtual_soak.climate import DAY_S
from support.virtual_soak.desk import POLICY

SLOPE_MAX_MB: Final = 1.0
"""Of memory, in 1,000 h of machine time."""
WARM_UP_DAYS: Final = 1
"""Caches and pools fill: not judged."""
_DAYS_LEAST: Final = 10
LIFE_WARM_UP_H: Final = 220.0
"""Of a controller without a start: until 1,000 leases are remembered (5 an hour, 230 bytes each) and SQLite's cache of
pages is full (2 MB, 45 h)."""
_LIFE_JUDGED_LEAST_H: Final = 48.0
DRIFT_MAX_COUNTS: Final = 0.5
"""Half a count of the absolute encoder: rounded, none. Errors within a signal period and a turn are below 0.2."""
# The database keeps the room of what was taken out, and the newest thousand events; its log is settled every second.
_JOURNAL_MAX_MB: Final = 2.5 * POLICY.journal_mb


def judge(lines: Sequence[dict[str, Any]]) -> list[Finding]:
    """Findings of a log, the head line first."""
    days = [line for line in lines if line["kind"] == "day"]
    if not days:
        return [Finding("days", None, "none yet")]
    return [
        _none("nuisance stops", Counter(), [line["stops"] for line in days]),
        _none("warnings", Counter(), [line["warnings"] for line in days]),
        _troubles(days),
        _drift(days),
        _memory(days),
        _journal(days),
    ]


def _none(what: str, total: Counter[str], each: Sequence[dict[str, int]]) -> Finding:
    for found in each:
        total.update(found)
    told = ", ".join(f"{code} x{number}" for code, number in sorted(total.items()))
    return Finding(what, not total, told or "none")


def _troubles(days: Sequence[dict[str, Any]]) -> Finding:
    found = [f"day {line['day']}: {text}" for line in days for text in line["troubles"]]
    found += [f"day {line['day']}: stuck: {line['stuck']}" for line in days if line["stuck"]]
    told = sum(line["told"] for line in days)
    words = f"{told}, the first: {'; '.join(found[:3])}" if found else "none"
    return Finding("refusals, targets missed, days broken off", not found, words)


def _drift(days: Sequence[dict[str, Any]]) -> Finding:
    worst = max((line["drift_counts"] for line in days), key=abs)
    return Finding(
        "drift of the encoder", round(worst) == 0, f"{worst:+.3f} counts at most, below {DRIFT_MAX_COUNTS}"
    )


def _memory(days: Sequence[dict[str, Any]]) -> Finding:
    if len(days) == 1 and days[0]["on_s"] > DAY_S:
        return _memory_of_a_life(days[0])
    # The least of each day, at its beginning: SQLite's cache of pages grows to 2 MB, and ends with the controller.
    least = [
        (line["machine_h"], min(mb for _, mb in line["memory"]))
        for line in days[WARM_UP_DAYS:]
        if line["memory"]
    ]
    if len(least) < _DAYS_LEAST:
        told = ", ".join(f"{mb:.1f}" for _, mb in least)
        return Finding(
            "memory",
            None,
            f"{len(least)} days after the first {WARM_UP_DAYS}, {_DAYS_LEAST} wanted: {told} MB",
        )
    return _slope(least)


def _memory_of_a_life(life: dict[str, Any]) -> Finding:
    """Of one controller that was started once, hour by hour: nothing is taken out of one process by a new one."""
    first_h = life["memory"][0][0]
    settled = [(hour, mb) for hour, mb in life["memory"] if hour - first_h >= LIFE_WARM_UP_H]
    if len(settled) < _LIFE_JUDGED_LEAST_H:
        told = f"{len(settled)} hours after the first {LIFE_WARM_UP_H:.0f}, {_LIFE_JUDGED_LEAST_H:.0f} wanted"
        return Finding("memory", None, told)
    return _slope(settled)


def _slope(memory: Sequence[tuple[float, float]]) -> Finding:
    slope = slope_of([hour * 3600.0 for hour, _ in memory], [mb for _, mb in memory])
    value, low, high = (1e3 * part for part in slope)
    words = f"{value:+.3f} MB in 1,000 h, 95 % between {low:+.3f} and {high:+.3f}"
    # Too short a soak cannot tell a slope from the steps of an allocator: its interval is wide.
    passed = True if high < SLOPE_MAX_MB else False if low > SLOPE_MAX_MB else None
    return Finding("memory", passed, words)


def _journal(days: Sequence[dict[str, Any]]) -> Finding:
    most = max(line["journal_mb"] for line in days)
    return Finding(
        "journal", most < _JOURNAL_MAX_MB,
        f"{most:.2f} MB at most, retention {POLICY.journal_mb} MB and {POLICY.journal_days} days",
    )  # fmt: skip


def words(lines: Sequence[dict[str, Any]]) -> str:
    """What was run, in figures, and the findings."""
    days = [line for line in lines if line["kind"] == "day"]
    total = {
        name: sum(line[name] for line in days)
        for name in (
            "moves", "jogs", "increments", "operator_stops", "power_ups", "starts", "brake_tests", "events", "cpu_s",
        )
    }  # fmt: skip
    on_h = sum(line["on_s"] for line in days) / 3600.0
    machine_h = days[-1]["machine_h"] if days else 0.0
    following = max((line["worst_following_deg"] for line in days), default=0.0)
    angle = max((line["worst_angle_deg"] for line in days), default=0.0)
    told = [
        f"{machine_h:.0f} h of machine time in {len(days)} days: {on_h:.1f} h computed scan by scan, "
        f"{machine_h - on_h:.1f} h switched off",
        f"{total['moves']} moves, {total['jogs']} jogs, {total['increments']} increments, "
        f"{total['operator_stops']} stopped on the way, {total['power_ups']} power-ups, {total['starts']} starts of "
        f"the controller, {total['brake_tests']} brake tests, {total['events']} events",
        f"largest following error {following:.4f} deg, largest angle error of the load after a move {angle:.4f} deg",
        f"{total['cpu_s'] / 3600.0:.2f} h of processor time: "
        f"{on_h * 3600.0 / max(1e-9, total['cpu_s']):.0f} times real time",
    ]
    mark = {True: "holds", False: "FAILS", None: "too early"}
    told += [f"{mark[each.passed]}: {each.what}: {each.why}" for each in judge(lines)]
    return "\n".join(told)
