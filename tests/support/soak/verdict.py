"""Judges the log of a soak: memory, stops, rows, clocks, pages. Pure functions of what the log says."""

from __future__ import annotations

import json
import math
from collections.abc import Iterable, Mapping, Sequence
from itertools import pairwise
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

SLOPE_MAX_MB_H = 1.0
WARM_UP_S = 1800.0
"""Caches, pools and the first files: not judged. A shorter run leaves out its first quarter."""
BLOCK_S = 600.0
"""The least memory of each ten minutes is judged: what pools of buffers hold now and then is no leak. The recorder's
goes up by some MB with every file that it closes."""
HANDLES_MORE = 2
"""A page more or less, at the least moment of ten minutes."""
BLOCKS_LEAST = 6
"""A slope over less than an hour says nothing of an hour."""
NORMAL_95 = 1.96

UNASKED = ("hold-to-run: ", "control is free: the holder was silent", "SYS-", "JRN-", "the drive could not")
"""Beginnings of what the journal says when something stops, or starts again, that nobody asked to."""

Line = Mapping[str, Any]


class Slope(NamedTuple):
    """A slope with the ends of its 95 % interval."""

    value: float
    low: float
    high: float

    def __str__(self) -> str:
        return f"{self.value:+.2f} MB/h, 95 % between {self.low:+.2f} and {self.high:+.2f}"


class Finding(NamedTuple):
    """One criterion. `passed` is None while the log cannot tell."""

    what: str
    passed: bool | None
    why: str


def slope_of(time_s: Sequence[float], values: Sequence[float]) -> Slope:
    """Median of the slopes of all pairs of points (Theil 1950), with the interval of Sen (1968), per hour.

    Outliers do not move it: up to 29 % of the points may be wrong.
    """
    t, v = np.asarray(time_s) / 3600.0, np.asarray(values)
    one, other = np.triu_indices(len(t), 1)
    slopes = np.sort((v[other] - v[one]) / (t[other] - t[one]))
    n = len(t)
    half = NORMAL_95 * math.sqrt(n * (n - 1) * (2 * n + 5) / 18.0)
    low = max(0, math.floor((len(slopes) - half) / 2.0))
    high = min(len(slopes) - 1, math.ceil((len(slopes) + half) / 2.0))
    return Slope(float(np.median(slopes)), float(slopes[low]), float(slopes[high]))


def unasked(kind: str, text: str) -> bool:
    """Whether an event of the journal is a stop or an alarm that nobody asked for: a soak asks for none."""
    return kind == "alarm" or text.startswith(UNASKED)


def missing_numbers(numbers: Iterable[tuple[int, int, int]]) -> int:
    """How many events are missing between the first and the last of each source.

    Args:
        numbers: boot, source and number of every event of a journal.
    """
    found: dict[tuple[int, int], set[int]] = {}
    for boot, source, number in numbers:
        found.setdefault((boot, source), set()).add(number)
    return sum(max(each) - min(each) + 1 - len(each) for each in found.values())


def missing_scans(time_s: Sequence[float], spacing_s: Sequence[float], period_s: float) -> int:
    """How many scans of a recording stand for no row: a step of time that is longer than the row's spacing."""
    steps, spacing = np.diff(np.asarray(time_s)), np.asarray(spacing_s)[1:]
    return int(np.sum(np.maximum(0, np.round((steps - spacing) / period_s))))


def clock_steps(events: Iterable[tuple[float, float]], least_s: float = 60.0) -> list[float]:
    """Steps of the wall clock that the journal shows, s.

    Args:
        events: wall clock and monotonic clock of each event, s, in the order in which the events were written.
    """
    found, before = [], None
    for wall_s, monotonic_s in sorted(events, key=lambda each: each[1]):
        ahead = wall_s - monotonic_s
        if before is not None and abs(ahead - before) > least_s:
            found.append(round(ahead - before))
        before = ahead
    return [float(step) for step in found]


def line_of(values: Line) -> str:
    """One line of a log."""
    return json.dumps(values, separators=(",", ":"))


def read_log(path: Path) -> list[dict[str, Any]]:
    """All whole lines of a log, also of one that is being written, or was kept with its verdict."""
    text = path.read_text(encoding="utf-8")
    return [
        json.loads(line) for line in text[: text.rfind("\n") + 1].splitlines() if not line.startswith("#")
    ]


def judge(log: Sequence[Line]) -> list[Finding]:
    """Every criterion of the soak."""
    minutes = [line for line in log if line["kind"] == "minute"]
    ends = [line for line in log if line["kind"] == "end"]
    if len(minutes) < 2:
        return [Finding("run", None, "less than two minutes are in the log")]
    end = ends[-1] if ends else None
    return [
        *_memory(minutes),
        *_handles(minutes),
        *_motion(log, minutes),
        *_kept(minutes, end),
        *_clock(log, end),
    ]


def floor_of(time_s: Sequence[float], values: Sequence[float]) -> tuple[list[float], list[float]]:
    """The least value of each whole block of ten minutes, and the middle of the block."""
    least: dict[int, float] = {}
    for at_s, value in zip(time_s, values, strict=True):
        block = math.floor(at_s / BLOCK_S)
        least[block] = np.minimum(least.get(block, math.inf), value)  # NaN stays
    least.pop(math.floor(max(time_s, default=0.0) / BLOCK_S), None)  # not whole yet
    return [(block + 0.5) * BLOCK_S for block in least], list(least.values())


def _memory(minutes: Sequence[Line]) -> list[Finding]:
    warm_s = min(WARM_UP_S, minutes[-1]["t_s"] / 4.0)
    used = [line for line in minutes if line["t_s"] >= warm_s]
    series = {name: [line["own_kb"][name] / 1024 for line in used] for name in minutes[0]["own_kb"]}
    series["all processes"] = [sum(line["own_kb"].values()) / 1024 for line in used]
    series["page that stays open"] = [line["page_kb"] / 1024 for line in used]
    found = []
    for name, values in series.items():
        time_s, least = floor_of([line["t_s"] for line in used], values)
        if len(least) < BLOCKS_LEAST:
            why = (
                f"{len(least)} blocks of ten minutes are no slope; {min(values):.1f} to {max(values):.1f} MB"
            )
            found.append(Finding(f"memory: {name}", None, why))
            continue
        slope = slope_of(time_s, least)
        # Below the limit by value but not by its interval: only a longer run can tell.
        holds = slope.high < SLOPE_MAX_MB_H or (None if slope.value < SLOPE_MAX_MB_H else False)
        why = f"{slope}; {min(values):.1f} to {max(values):.1f} MB, {len(least)} blocks"
        found.append(Finding(f"memory: {name}", holds, why))
    return found


def _handles(minutes: Sequence[Line]) -> list[Finding]:
    """Open files, sockets and mapped files: least number of the last whole ten minutes against the first ones."""
    found = []
    for name in minutes[0]["handles"]:
        _, least = floor_of([line["t_s"] for line in minutes], [line["handles"][name] for line in minutes])
        holds = None if len(least) < BLOCKS_LEAST else bool(least[-1] <= least[0] + HANDLES_MORE)
        found.append(Finding(f"handles: {name}", holds, f"{' '.join(f'{each:g}' for each in least)}"))
    return found


def _motion(log: Sequence[Line], minutes: Sequence[Line]) -> list[Finding]:
    troubles = [line for line in log if line["kind"] == "trouble"]
    last = minutes[-1]
    stops = [line["what"] for line in troubles if line["of"] == "stop"]
    stuck = [line["what"] for line in troubles if line["of"] == "stuck"]
    silent = sum(after["opcua"] <= before["opcua"] for before, after in pairwise(minutes))
    others = {str(sorted(line["processes"].items())) for line in minutes}
    return [
        Finding(
            "stops that nobody asked for",
            not stops and last["unasked"] == 0,
            f"{len(stops)} seen, {last['unasked']} in the journal, of {last['gestures']} gestures; {stops[:3]}",
        ),
        Finding("pages that hang", not stuck, f"{len(stuck)}; {stuck[:3]}"),
        Finding("OPC UA", silent == 0, f"{silent} minutes without news; {last['opcua']} changes came"),
        Finding("processes that ended", len(others) == 1, f"{len(others) - 1}"),
    ]


def _kept(minutes: Sequence[Line], end: Line | None) -> list[Finding]:
    last = minutes[-1]
    lost = last["rows_lost"] + last["events_lost"]
    found = [Finding("rows and events without a place", lost == 0, f"{lost}")]
    if end is None:
        return [*found, Finding("journal and recordings", None, "they are read at the end")]
    return [
        *found,
        Finding(
            "journal",
            end["journal_wrong"] == "" and end["journal_missing"] == 0 and end["journal_rows"] > 0,
            f"{end['journal_rows']} events, {end['journal_missing']} missing, {end['journal_wrong'] or 'intact'}",
        ),
        Finding(
            "recordings",
            end["recordings"] >= end["power_ups"] > 0
            and end["recordings_missing"] == end["scans_missing"] == end["unfinished"] == 0,
            f"{end['recordings']} of {end['power_ups']} power-ups with {end['recorded_rows']} rows: "
            f"{end['recordings_missing']} recordings and {end['scans_missing']} scans missing, "
            f"{end['unfinished']} files not finished",
        ),
    ]


def _clock(log: Sequence[Line], end: Line | None) -> list[Finding]:
    done = [line["step_s"] for line in log if line["kind"] == "step"]
    if end is None:
        return [Finding("steps of the wall clock", None, f"{len(done)} so far")]
    seen = end["clock_steps_s"]
    both = any(step > 0 for step in done) and any(step < 0 for step in done)
    return [
        Finding(
            "steps of the wall clock", both and seen == done, f"{done} s were made, the journal shows {seen}"
        )
    ]


def words(findings: Sequence[Finding]) -> str:
    """One line a criterion, and the verdict."""
    marks = {True: "pass", False: "FAIL", None: "  - "}
    lines = [f"{marks[each.passed]}  {each.what}: {each.why}" for each in findings]
    so_far = "" if all(each.passed is not None for each in findings) else " of what can be told"
    return "\n".join([*lines, f"verdict{so_far}: {'pass' if passed(findings) else 'FAIL'}"])


def passed(findings: Sequence[Finding]) -> bool:
    """Whether nothing failed; what the log cannot tell yet does not fail."""
    return all(each.passed is not False for each in findings)


def kept(log: Sequence[Line]) -> str:
    """A log with its verdict above it, as it is kept as evidence."""
    verdict = "".join(f"# {line}\n" for line in words(judge(log)).splitlines())
    return verdict + "".join(f"{line_of(line)}\n" for line in log)
