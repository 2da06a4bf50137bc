"""One page of numbers: what was run, the worst way of each fault, nuisances, and the power of the tests."""

from __future__ import annotations

import json
import math
from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from itertools import zip_longest
from pathlib import Path
from typing import Any, Final

from gantryctl.engineering.campaign.job import INDEX, REFUSED
from gantryctl.engineering.fault_campaign.job import FaultJob, Row
from gantryctl.engineering.fault_campaign.kinds import FaultCampaign
from gantryctl.engineering.fault_campaign.result import FaultResult
from gantryctl.engineering.faults.catalogue import CATALOGUE
from gantryctl.engineering.scheduler.identity import identity

MUTATION_FILE: Final = "mutation.json"
COVERAGE_FILE: Final = "branch_coverage.json"
_SHOWN: Final = 20


@dataclass(slots=True)
class Worst:
    """The largest part of its limit that the way of a fault has taken; the numbers of that run."""

    way_deg: float
    limit_deg: float
    seed: int
    runs: int = 1


@dataclass(slots=True)
class Tally:
    """What one campaign has shown.

    Attributes:
        played, refused, over_bus: runs. reasons: of the refused ones. axis_s: virtual time.
        stops: alarms that stopped. sources: versions of the code that played it. worst: by number of the row.
        broken: rows in which something broke. now: the same runs, played again by `replayed`; None before that.
    """

    campaign: FaultCampaign
    played: int = 0
    refused: int = 0
    over_bus: int = 0
    nuisances: int = 0
    axis_s: float = 0.0
    with_faults: Counter[int] = field(default_factory=Counter)
    stops: Counter[str] = field(default_factory=Counter)
    reasons: Counter[str] = field(default_factory=Counter)
    sources: Counter[str] = field(default_factory=Counter)
    worst: dict[str, Worst] = field(default_factory=dict)
    broken: list[Row] = field(default_factory=list)
    now: list[Row] | None = None


def tally(result: FaultResult) -> Tally:
    """Count the rows of a result."""
    found = Tally(result.campaign)
    for row in result.rows():
        if row[REFUSED]:
            found.refused += 1
            found.reasons[row[REFUSED]] += 1
            continue
        found.played += 1
        found.over_bus += row["drive"] == "bus"
        found.nuisances += row["nuisances"]
        found.axis_s += row["axis_s"]
        found.sources[row["sources"]] += 1
        found.with_faults[0 if row["faults"] == "none" else row["faults"].count("+") + 1] += 1
        found.stops.update(row["stops"].split())
        if row["violations"]:
            found.broken.append(row)
        _keep_worst(found.worst, row)
    return found


def replayed(found: Tally, say: Callable[[str], None]) -> None:
    """Play what broke again, with the code of today.

    Args:
        say: a line for the person who waits.
    """
    job = FaultJob(found.campaign)
    found.now = []
    for row in found.broken:
        say(f"{found.campaign.name}: {row[INDEX]} again")
        columns = job.rows(row[INDEX], 1)
        found.now.append({name: values[0] for name, values in columns.items()})


def _keep_worst(worst: dict[str, Worst], row: Row) -> None:
    if not row["way_of"] or not math.isfinite(row["limit_deg"]):
        return
    now = Worst(row["way_deg"], row["limit_deg"], row[INDEX])
    before = worst.get(row["way_of"])
    if before is None:
        worst[row["way_of"]] = now
        return
    if now.way_deg * before.limit_deg > before.way_deg * now.limit_deg:
        before.way_deg, before.limit_deg, before.seed = now.way_deg, now.limit_deg, now.seed
    before.runs += 1


def report_data(tallies: Sequence[Tally]) -> list[dict[str, Any]]:
    """For JSON."""
    return [
        {
            "campaign": each.campaign.name,
            "played": each.played,
            "refused": each.refused,
            "over_bus": each.over_bus,
            "axis_h": each.axis_s / 3600.0,
            "broken": len(each.broken),
            "broken_now": None if each.now is None else sum(bool(row["violations"]) for row in each.now),
            "nuisances_per_1000_h": _per_1000_h(each),
            "worst": {
                number: {"way_deg": worst.way_deg, "limit_deg": worst.limit_deg, "seed": worst.seed}
                for number, worst in sorted(each.worst.items())
            },
        }
        for each in tallies
    ]


def _per_1000_h(each: Tally) -> float | None:
    # A cell of the matrix begins with its fault: what stops there without a cause is a violation.
    counted = each.axis_s > 0.0 and each.campaign.kind != "matrix"
    return 3.6e6 * each.nuisances / each.axis_s if counted else None


def report_page(tallies: Sequence[Tally], evidence: Path) -> str:
    """The page, in Markdown.

    Args:
        evidence: folder with `mutation.json` and `branch_coverage.json`, where they have been made.
    """
    lines = [
        "# Fault campaigns in numbers",
        "",
        "Written by `gantryctl faults report RESULT... --replay --page docs/reference/fault-campaigns.md`;",
        "do not edit.",
        "",
        "How a scenario is drawn and judged: [the decision](../decisions/0027-fault-campaigns.md). All of it is",
        "simulated: the reference gantry and, in rows of `axes` and `axis-pairs`, others, their plants within 20 %;",
        "none is of steel.",
        "",
        "## What was run",
        "",
        "| campaign | runs | over the bus | no, one, two, three faults | refused | axis time, h | broken | "
        "nuisance stops per 1,000 h | versions of the code |",
        "|---|---|---|---|---|---|---|---|---|",
    ]  # fmt: skip
    for each in tallies:
        shares = ", ".join(str(each.with_faults[count]) for count in range(4))
        rate = _per_1000_h(each)
        lines.append(
            f"| {each.campaign.name} | {each.played} | {each.over_bus} | {shares} | {each.refused} | "
            f"{each.axis_s / 3600.0:.1f} | {len(each.broken)} | {'-' if rate is None else f'{rate:.1f}'} | "
            f"{len(each.sources)} |"
        )
    lines += [
        "",
        "The same again: `gantryctl faults campaign` with `--kind`, `--series`, `--scan` and `--drive` of the row, and",
    ]
    lines += ["`--count`; one seed: `gantryctl faults replay SEED` with the same options.", ""]
    lines += _reasons(tallies) + _broken(tallies) + _ways(tallies) + _mutation(evidence) + _coverage(evidence)
    return "\n".join(lines).rstrip() + "\n"


def _reasons(tallies: Sequence[Tally]) -> list[str]:
    reasons: Counter[str] = sum((each.reasons for each in tallies), Counter())
    if not reasons:
        return []
    lines = ["## Refused runs", "", "| reason | runs |", "|---|---|"]
    return [*lines, *(f"| {reason} | {count} |" for reason, count in reasons.most_common()), ""]


def _broken(tallies: Sequence[Tally]) -> list[str]:
    lines = ["## What broke", ""]
    again = any(each.now is not None for each in tallies)
    rows = [
        (each.campaign.name, row, now)
        for each in tallies
        for row, now in zip_longest(each.broken, each.now or ())
    ]
    if not rows:
        return [*lines, "Nothing.", ""]
    if again:
        lines += [f"Played again for this page, with sources {identity().sources}: the last column.", ""]
    lines += [
        "| campaign | seed | faults | first that broke | sources |" + " now |" * again,
        "|---|---|---|---|---|" + "---|" * again,
    ]
    for name, row, now in rows[:_SHOWN]:
        line = f"| {name} | {row[INDEX]} | {row['faults']} | {_first(row)} | {row['sources']} |"
        lines.append(line + (f" {_now(now)} |" if again else ""))
    if len(rows) > _SHOWN:
        lines.append(f"\n{len(rows) - _SHOWN} more.")
    return [*lines, ""]


def _first(row: Row) -> str:
    return str(json.loads(row["violations"])[0]).replace("|", "/")


def _now(row: Row | None) -> str:
    if row is None:
        return "not played"
    if row[REFUSED]:
        return f"refused: {row[REFUSED]}"
    return f"**{_first(row)}**" if row["violations"] else "holds"


def _ways(tallies: Sequence[Tally]) -> list[str]:
    """Worst ways of all campaigns together, by row of the catalogue."""
    lines = [
        "## Worst way of each fault",
        "",
        "True motor side, from the fault to rest, where the fault was alone and began in motion; of its runs the one",
        "that took most of its limit.",
        "",
        "| fault | way, deg | limit, deg | part | runs | seed |",
        "|---|---|---|---|---|---|",
    ]
    found = False
    for case in CATALOGUE:
        known = [(each, each.worst[case.number]) for each in tallies if case.number in each.worst]
        if not known:
            continue
        found = True
        of, worst = max(known, key=lambda pair: pair[1].way_deg / pair[1].limit_deg)
        runs = sum(each.runs for _, each in known)
        part = 100.0 * worst.way_deg / worst.limit_deg
        lines.append(
            f"| {case.number} {case.title} | {worst.way_deg:.3f} | {worst.limit_deg:.3f} | {part:.0f} % | {runs} | "
            f"{of.campaign.kind} {worst.seed} |"
        )
    return [*lines, ""] if found else []


def _areas(path: Path) -> list[Mapping[str, Any]]:
    """Areas of an evidence file; none where it has not been made."""
    try:
        areas = json.loads(path.read_text("utf-8"))["areas"]
    except (OSError, ValueError, KeyError, TypeError):
        return []
    return [area for area in areas if isinstance(area, dict)] if isinstance(areas, list) else []


def _mutation(evidence: Path) -> list[str]:
    areas = _areas(evidence / MUTATION_FILE)
    lines = ["## Planted bugs", "", "`make mutants` plants them.", ""]
    if not areas:
        return [*lines, "Not measured yet.", ""]
    names = ("mutants", "killed", "argued", "survived", "severe", "severe_killed")
    lines += [
        "| area | planted | found | argued | lived | severe | severe found |",
        "|---|---|---|---|---|---|---|",
    ]
    for area in areas:
        lines.append("| " + " | ".join(str(area.get(name, "-")) for name in ("name", *names)) + " |")
    return [*lines, ""]


def _coverage(evidence: Path) -> list[str]:
    areas = _areas(evidence / COVERAGE_FILE)
    lines = ["## Branches that the tests take", "", "`make coverage` counts them.", ""]
    if not areas:
        return [*lines, "Not measured yet.", ""]
    lines += ["| area | branches | taken |", "|---|---|---|"]
    for area in areas:
        lines.append(
            f"| {area.get('name', '-')} | {area.get('branches', '-')} | {area.get('covered', '-')} |"
        )
    return [*lines, ""]
