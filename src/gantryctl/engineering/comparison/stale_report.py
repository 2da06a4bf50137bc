"""Days in use of sound machines or of the rows of a drift file: computed once, kept in a file, told as a table."""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final, NamedTuple

from gantryctl.engineering.comparison.drift_file import Drift, DriftRow
from gantryctl.engineering.comparison.drift_report import WITHOUT_ENCODER
from gantryctl.engineering.comparison.stale_days import CHAIN_DAYS, MOVES, Day, chain_of_days
from gantryctl.engineering.comparison.variants import Variant, without_load_encoder
from gantryctl.engineering.report.text import TextTable, figure
from gantryctl.machine import Machine, config_hash
from gantryctl.program.monitors.calibration_watch import Finding
from gantryctl.units import deg
from gantryctl.wiring.calibration_watch import calibration_identity
from gantryctl.wiring.compensation import check_calibration

FILE: Final = "stale_days.jsonl"
SOUND: Final = "sound"
_TORQUES: Final = ("moment", "friction")


class DaysInUse(NamedTuple):
    """One plant under one control.

    Attributes:
        days: that were simulated. found: by name, the moves of its chain after which each chain found it.
        largest: by name, what came closest to its bound, or went furthest beyond.
    """

    days: int
    found: Mapping[str, tuple[int, ...]]
    largest: Mapping[str, Finding]


@dataclass(frozen=True)
class StaleReport:
    """What the watch of the calibration said.

    Attributes:
        rows: name and meaning. figures: by name of the control, one per row.
    """

    machine: str
    days: int
    rows: tuple[tuple[str, str], ...]
    figures: Mapping[str, tuple[DaysInUse, ...]]

    @property
    def passed(self) -> bool:
        """No sound machine was warned of."""
        sound = [k for k, (name, _) in enumerate(self.rows) if name == SOUND]
        return not any(rows[k].found for rows in self.figures.values() for k in sound)


def stale_report(
    machine: Machine,
    days: int,
    drift: Drift | None = None,
    *,
    folder: Path | None = None,
    progress: Callable[[int], None] | None = None,
) -> StaleReport:
    """Let the machine be used, with its encoder on the ring, where it has one, and without.

    Args:
        days: of each plant, in chains of ten that share a memory.
        drift: its rows are the plants; else a sound machine.
        folder: where `FILE` lies. Chains that stand in it are not computed again, new ones are added.
        progress: called with the number of days that are done, of `days_of`.

    Raises:
        UsageError, ConfigError: as of `chain_of_days`. OSError: the file cannot be read or written.
    """
    rows = _rows(drift)
    kept = _Kept(None if folder is None else folder / FILE)
    figures, done = {}, 0
    for control in _controls(machine):
        told = []
        for row in rows:
            chains = []
            for chain, length in enumerate(_lengths(days)):
                chains.append(kept.chain(control, row, chain, length))
                done += length
                if progress is not None:
                    progress(done)
            told.append(_in_use(chains))
        figures[control.name] = tuple(told)
    names = tuple((SOUND, "nothing changes") if row is None else (row.name, row.meaning) for row in rows)
    return StaleReport(machine.name, days, names, figures)


def days_of(machine: Machine, days: int, drift: Drift | None) -> int:
    """How many days are simulated."""
    return days * len(_rows(drift)) * len(_controls(machine))


def _rows(drift: Drift | None) -> tuple[DriftRow | None, ...]:
    return (None,) if drift is None else drift.rows


def _controls(machine: Machine) -> tuple[Variant, ...]:
    own = Variant(machine.name, machine)
    if not machine.control.compensation.load_encoder.active:
        return (own,)
    return Variant(WITHOUT_ENCODER, without_load_encoder(machine)), own


def _lengths(days: int) -> list[int]:
    """Days of each chain."""
    return [min(CHAIN_DAYS, days - first) for first in range(0, days, CHAIN_DAYS)]


class _Kept:
    """Chains in a file, a line of JSON each, by plant, control, calibration and number."""

    def __init__(self, file: Path | None) -> None:
        self._file = file
        self._chains: dict[str, list[Day]] = {}
        if file is None or not file.exists():
            return
        text = file.read_text("utf-8")
        # A line that a kill cut short is computed again.
        whole = text[: text.rfind("\n") + 1]
        if whole != text:
            file.write_text(whole, "utf-8")
        for line in whole.splitlines():
            data = json.loads(line)
            self._chains[data["key"]] = [_day(each) for each in data["days"]]

    def chain(self, control: Variant, row: DriftRow | None, chain: int, length: int) -> list[Day]:
        plant = control.machine if row is None else row.on(control.machine)
        calibration = calibration_identity(check_calibration(control.machine))
        key = f"{config_hash(plant)[:16]} {calibration} {chain}"
        found = self._chains.get(key, [])
        if len(found) < length:
            found = chain_of_days(control.machine, row, chain, length)
            self._chains[key] = found
            if self._file is not None:
                name = SOUND if row is None else row.name
                days = [day._asdict() for day in found]
                with self._file.open("a", encoding="utf-8") as file:
                    file.write(
                        json.dumps({"key": key, "control": control.name, "row": name, "days": days}) + "\n"
                    )
        return found[:length]


def _day(data: Mapping[str, Any]) -> Day:
    return Day(data["found"], {name: Finding(*pair) for name, pair in data["seen"].items()})


def _in_use(chains: Sequence[Sequence[Day]]) -> DaysInUse:
    found: dict[str, list[int]] = {}
    largest: dict[str, Finding] = {}
    for chain in chains:
        for name, move in chain[-1].found.items():
            found.setdefault(name, []).append(move)
        for name, seen in (pair for day in chain for pair in day.seen.items()):
            if name not in largest or _share(seen) > _share(largest[name]):
                largest[name] = seen
    return DaysInUse(
        sum(map(len, chains)), {name: tuple(sorted(moves)) for name, moves in found.items()}, largest
    )


def _share(finding: Finding) -> float:
    return abs(finding.measured) / finding.bound


def stale_table(report: StaleReport) -> TextTable:
    """What was named after how many moves, and how near to their bounds the others came, by plant and control."""
    rows = []
    for k, (name, _) in enumerate(report.rows):
        for control, figures in report.figures.items():
            use = figures[k]
            rows.append({
                "": name, "control": control, "days": f"{use.days}", "named by the warning": _found(use),
                "largest, of its bound": ", ".join(_seen(*pair) for pair in use.largest.items()),
            })  # fmt: skip
    return TextTable.of(f"{report.machine} in use, {MOVES} moves a day", rows)._replace(left=(0, 1, 3, 4))


def _found(use: DaysInUse) -> str:
    told = []
    for name, moves in use.found.items():
        after = (
            f"{moves[0]} moves" if len(moves) == 1 else f"{moves[0]} to {moves[-1]} moves, {len(moves)} times"
        )
        told.append(f"{name.replace('_', ' ')} after {after}")
    return ", ".join(told) or "nothing"


def _seen(name: str, finding: Finding) -> str:
    if name in _TORQUES:
        measured, bound = (figure(torque / 1e3, 1) for torque in finding)
        return f"{name} {measured} of {bound} kN m"
    return f"{name.replace('_', ' ')} {deg(finding.measured):.4f} of {deg(finding.bound):.4f} deg"


def stale_data(report: StaleReport) -> dict[str, Any]:
    """Everything `compare --stale-days N --json` prints; N m, and deg for angles."""
    return {
        "machine": report.machine,
        "days": report.days,
        "moves_a_day": MOVES,
        "passed": report.passed,
        "rows": [
            {
                "name": name,
                "meaning": meaning,
                "controls": {control: _use_data(figures[k]) for control, figures in report.figures.items()},
            }
            for k, (name, meaning) in enumerate(report.rows)
        ],
    }


def _use_data(use: DaysInUse) -> dict[str, Any]:
    return {
        "days": use.days,
        "found_after_moves": {name: list(moves) for name, moves in use.found.items()},
        "largest": {
            name: dict(
                zip(
                    ("measured", "bound", "unit"),
                    (*seen, "N m") if name in _TORQUES else (deg(seen.measured), deg(seen.bound), "deg"),
                    strict=True,
                )
            )
            for name, seen in use.largest.items()
        },
    }
