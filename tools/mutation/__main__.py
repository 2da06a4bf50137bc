"""Commands about the power of the tests; CONTRIBUTING.md says when to use which."""

from __future__ import annotations

import argparse
import json
import os
import random
import subprocess
import sys
from collections import defaultdict
from pathlib import Path
from typing import Any

from mutation import branches, evidence, planted
from mutation.areas import AREAS, CORE_AREAS, ROOT, area_files
from mutation.campaign import digest_of, read_results, run_all
from mutation.core_campaign import is_core, record_core, run_core
from mutation.cpp_operators import cpp_mutants
from mutation.mutant import Change
from mutation.operators import mutants
from mutation.page_campaign import is_page, run_page
from mutation.record import FOLDER_VARIABLE, PART_VARIABLE
from mutation.trial import FOUND, Fate, Trial

BUILD = ROOT / "build" / "mutation"
CORE_BUILD = BUILD / "core"
_AREAS = (*AREAS, *CORE_AREAS)


def main() -> int:
    """Run one command; 1 where a change was not found that should be."""
    parser = argparse.ArgumentParser(prog="python -m mutation", description=__doc__)
    commands = parser.add_subparsers(dest="command", required=True)
    record = commands.add_parser("record", help="run tests once and keep which line each of them runs")
    record.add_argument("part", help="name of this part; a part of the same name is replaced")
    record.add_argument("tests", nargs="+", help="files, folders or options of pytest")
    record.add_argument(
        "--core", action="store_true", help="which change of the core (C++) each of them passes"
    )
    plant = commands.add_parser(
        "planted", help="try the bugs of tests/planted; 1 when one survives or is stale"
    )
    plant.add_argument(
        "areas", nargs="*", help="names of files in tests/planted without .toml; all when none"
    )
    run = commands.add_parser("run", help="try mutants of the syntax tree")
    show = commands.add_parser("show", help="survivors that are not argued; 1 when there is one")
    write = commands.add_parser("write", help="write docs/evidence/mutation.json")
    argue = commands.add_parser("argue", help="put a survivor on the list of those that change nothing")
    argue.add_argument("name", help="as `show` names it")
    argue.add_argument("reason", help="why nobody could see the change")
    for each in (run, show, write):
        each.add_argument("areas", nargs="*", metavar="AREA", help=f"{', '.join(_AREAS)}; all when none")
        each.add_argument(
            "--severe", action="store_true", help="only what could move, drop or mislead people"
        )
        each.add_argument("--file", action="append", default=[], help="only sources with this in their path")
        each.add_argument("--sample", type=int, help="so many, drawn in proportion to each source")
        each.add_argument("--seed", type=int, default=1)
    run.add_argument("--again", action="store_true", help="try survivors again: tests were added")
    branch = commands.add_parser(
        "branches",
        help="write rows of docs/evidence/branch_coverage.json from all recorded parts; 1 when a branch is not run",
    )
    branch.add_argument(
        "areas", nargs="*", metavar="AREA", help=f"{', '.join(branches.COUNTED)}; all when none"
    )
    branch.add_argument("--file", default="", help="list only sources with this in their path")
    for each in (plant, run):
        each.add_argument("--workers", type=int, default=2)
        each.add_argument(
            "--seconds", type=float, default=60.0, help="recorded time of the tests of one change"
        )
    for each in (record, plant, run, branch):
        each.add_argument("--coverage", type=Path, default=BUILD / "coverage", help="folder of `record`")
    for each in (plant, run, show, write):
        each.add_argument("--results", type=Path, default=BUILD / "results.jsonl")
    arguments, rest = parser.parse_known_args()
    if rest and arguments.command != "record":
        parser.error(f"unknown: {' '.join(rest)}")
    if arguments.command == "record":
        # A part is one file, whose name may be that of an area.
        arguments.part = arguments.part.replace("/", "_")
        tests = [*arguments.tests, *rest]
        if arguments.core:
            return record_core(ROOT, CORE_BUILD, arguments.coverage / "core", arguments.part, tests)
        return _record(arguments.coverage, arguments.part, tests)
    if arguments.command in _SIMPLE:
        return _SIMPLE[arguments.command](arguments)
    arguments.results.parent.mkdir(parents=True, exist_ok=True)
    if arguments.command == "planted":
        return _planted(arguments)
    chosen = _chosen(arguments)
    if arguments.command == "run":
        return _run(arguments, chosen)
    if arguments.command == "show":
        return _show(arguments, chosen)
    argued, trials = evidence.read_argued(ROOT), read_results(arguments.results)
    rows = {area: evidence.summary(area, found, trials, argued) for area, found in chosen.items()}
    bugs = {area: _planted_row(area, path, trials) for area, path in _planted_files().items()}
    evidence.write(
        ROOT,
        {area: row for area, row in rows.items() if row["mutants"]},
        {area: row for area, row in bugs.items() if row["tried"]},
    )
    print(*rows.values(), *bugs.values(), sep="\n")
    return 0


def _planted_files() -> dict[str, Path]:
    return {
        path.stem: path for path in sorted((ROOT / planted.FOLDER).glob("*.toml")) if path.stem != "argued"
    }


def _planted_row(area: str, path: Path, trials: dict[str, Trial]) -> dict[str, Any]:
    rows: list[tuple[Change, Trial | None]] = []
    for bug in planted.read_bugs(path):
        try:
            change = planted.change_of(bug, area, ROOT)
        except planted.StaleBug:  # counted, and not tried
            rows.append((Change(bug["name"], bug["file"], 0, 0, b"", 1, 1, severe=bug["severe"]), None))
            continue
        trial = trials.get(change.name)
        current = trial is not None and trial.digest == digest_of(ROOT, change)
        rows.append((change, trial if current else None))
    return evidence.planted_summary(area, rows)


def _record(folder: Path, part: str, tests: list[str]) -> int:
    folder.mkdir(parents=True, exist_ok=True)
    paths = [str(ROOT / "tools"), str(ROOT / "src"), str(ROOT / "tests")]
    environment = os.environ | {
        FOLDER_VARIABLE: str(folder.resolve()),
        PART_VARIABLE: part,
        "PYTHONPATH": os.pathsep.join(paths),
    }
    options = ["-q", "-p", "mutation.record", "-p", "no:cacheprovider", "-p", "no:xdist", "--timeout", "900"]
    return subprocess.call([sys.executable, "-m", "pytest", *options, *tests], cwd=ROOT, env=environment)  # noqa: S603


def _branches(arguments: argparse.Namespace) -> int:
    unknown = [area for area in arguments.areas if area not in branches.COUNTED]
    if unknown:
        raise SystemExit(f"no area {unknown[0]}: {', '.join(branches.COUNTED)}")
    rows, missing = branches.branches(arguments.coverage, arguments.areas or branches.COUNTED)
    branches.write(rows)
    for file, ways in missing.items():
        if arguments.file in file:
            print(f"{file}: {', '.join(' to '.join(map(str, way)) for way in ways)}")
    print(*rows.values(), sep="\n")
    return 1 if missing else 0


def _argue(arguments: argparse.Namespace) -> int:
    evidence.argue(ROOT, arguments.name, arguments.reason)
    return 0


_SIMPLE = {"branches": _branches, "argue": _argue}


def _planted(arguments: argparse.Namespace) -> int:
    files = _planted_files()
    changes, harms, stale = [], {}, []
    for area in arguments.areas or files:
        for bug in planted.read_bugs(files[area]):
            try:
                change = planted.change_of(bug, area, ROOT)
            except planted.StaleBug as why:
                stale.append(str(why))
            else:
                changes.append(change)
                harms[change.name] = bug["harm"]
    kept = read_results(arguments.results)
    survivors = {change.name for change in changes} & {
        name for name, trial in kept.items() if trial.fate not in FOUND
    }
    _forget(arguments.results, survivors)
    _try(arguments, changes)
    trials = read_results(arguments.results)
    lost = [trials[change.name] for change in changes if trials[change.name].fate not in FOUND]
    print(
        f"\n{len(changes) - len(lost)} of {len(changes)} planted bugs found by the tests, {len(stale)} stale"
    )
    for trial in lost:
        print(
            f"{trial.fate}: {trial.name} ({trial.tests} tests): {trial.shown}\n    harm: {harms[trial.name]}"
        )
    print(*(f"stale: {why}" for why in stale), sep="\n")
    return 1 if lost or stale else 0


def _chosen(arguments: argparse.Namespace) -> dict[str, list[Change]]:
    found: dict[str, list[Change]] = {}
    for area in arguments.areas or _AREAS:
        if area not in _AREAS:
            raise SystemExit(f"no area {area}: {', '.join(_AREAS)}")
        mutants_of = cpp_mutants if area in CORE_AREAS else mutants
        changes = [
            change
            for file in area_files(area)
            if not arguments.file or any(part in str(file) for part in arguments.file)
            for change in mutants_of(str(file), (ROOT / file).read_bytes())
            if change.severe or not arguments.severe
        ]
        found[area] = changes
    if arguments.sample:
        return _sample(found, arguments.sample, arguments.seed)
    return found


def _sample(found: dict[str, list[Change]], size: int, seed: int) -> dict[str, list[Change]]:
    """As many of each source as its share of all, the same ones for the same sources."""
    everything = sum(map(len, found.values()))
    chosen: dict[str, list[Change]] = {}
    for area, changes in found.items():
        by_file: dict[str, list[Change]] = defaultdict(list)
        for change in changes:
            by_file[change.file].append(change)
        chosen[area] = []
        for file, group in by_file.items():
            draw = random.Random(f"{seed} {file}")  # noqa: S311 - a sample, no secret
            share = len(group) * size / everything
            count = min(len(group), int(share) + (draw.random() < share % 1.0))
            chosen[area] += draw.sample(group, count)
    return chosen


def _try(arguments: argparse.Namespace, changes: list[Change]) -> None:
    coverage, results = arguments.coverage.resolve(), arguments.results.resolve()
    limits = {"workers": arguments.workers, "budget_s": arguments.seconds}
    core = [change for change in changes if is_core(change)]
    page = [change for change in changes if is_page(change)]
    others = [change for change in changes if not (is_core(change) or is_page(change))]
    if core:
        run_core(ROOT, CORE_BUILD, core, coverage / "core", results, **limits)
    if page:
        run_page(ROOT, page, results, budget_s=arguments.seconds)
    if others:
        run_all(ROOT, others, coverage, results, **limits)


def _run(arguments: argparse.Namespace, chosen: dict[str, list[Change]]) -> int:
    changes = [change for found in chosen.values() for change in found]
    if arguments.again:
        kept = read_results(arguments.results)
        argued = evidence.read_argued(ROOT)
        names = {change.name for change in changes}
        _forget(
            arguments.results,
            {name for name in names if name in kept and name not in argued and kept[name].fate not in FOUND},
        )
        changes = [change for change in changes if change.name in kept]
    # Another order on every seed, so that a run that is cut short has seen something of every source.
    random.Random(arguments.seed).shuffle(changes)  # noqa: S311
    _try(arguments, changes)
    return _show(arguments, chosen)


def _forget(results: Path, names: set[str]) -> None:
    if names and results.exists():
        lines = results.read_text(encoding="utf-8").splitlines(keepends=True)
        results.write_text(
            "".join(line for line in lines if json.loads(line)["name"] not in names), encoding="utf-8"
        )


def _show(arguments: argparse.Namespace, chosen: dict[str, list[Change]]) -> int:
    trials, argued = read_results(arguments.results), evidence.read_argued(ROOT)
    lost: list[Trial] = []
    for area, changes in chosen.items():
        row = evidence.summary(area, changes, trials, argued)
        if row["mutants"]:
            print(row)
        lost += [
            trials[change.name]
            for change in changes
            if change.name in trials
            and trials[change.name].fate not in {*FOUND, Fate.STALE}
            and change.name not in argued
        ]
    for trial in lost:
        mark = "SEVERE " if trial.severe else ""
        print(f"{mark}{trial.fate}: {trial.name} ({trial.tests} tests): {trial.shown}")
    return 1 if lost else 0


if __name__ == "__main__":
    sys.exit(main())
