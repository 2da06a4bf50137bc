"""What a scenario led to, for people and for JSON."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

from gantryctl.engineering.fault_campaign.matrix import Cell
from gantryctl.engineering.fault_campaign.play import Played
from gantryctl.engineering.fault_campaign.scenario import Scenario
from gantryctl.engineering.faults.figure import Watched
from gantryctl.engineering.faults.run import Moment


def scenario_words(scenario: Scenario) -> str:
    """Machine and place in one line."""
    drive = "simulated drive" if scenario.drive == "sim" else f"bus, brake by {scenario.brake_owner}"
    if scenario.beside:
        drive = "bus with nodes beside the drive"
    drive += ", motor the other way round" * scenario.inverted
    axis = "improved gantry, " if scenario.improved else ""
    if scenario.template:
        answers = ", ".join(f"{name} {value:g}" for name, value in sorted(scenario.answers.items()))
        axis = f"{scenario.template} ({answers or 'its own answers'}), "
    plant = "plant of the machine file" if scenario.plant_seed is None else f"plant {scenario.plant_seed}"
    plant += ", each value 20 % off" * scenario.edge + ", second pinion" * scenario.second_pinion
    return f"{axis}{drive}, scan {scenario.scan_ms:g} ms, {plant}, begins at {scenario.angle_deg:g} deg"


def played_lines(played: Played) -> list[str]:
    """What happened, line by line."""
    scenario = played.scenario
    lines = [f"{scenario.name}: {scenario_words(scenario)}, faults {scenario.label}"]
    if played.refused:
        return [*lines, f"refused: {played.refused}"]
    lines += [f"{event.time_s:8.3f} s  {event.text}" for event in played.events]
    if played.fault:
        lines.append(f"way of {played.fault}  {played.way_deg:.3f} deg, permitted {played.limit_deg:.3f}")
    lines.append(f"trace  sha256 {played.trace_sha256}")
    lines.append("everything held" if played.ok else f"{len(played.violations)} broken")
    return lines


def played_data(played: Played) -> dict[str, Any]:
    """A played scenario for JSON; a number that is not finite is null."""
    return {
        "scenario": played.scenario.model_dump(mode="json"),
        "refused": played.refused,
        "ok": played.ok,
        "violations": [each._asdict() for each in played.violations],
        "trace_sha256": played.trace_sha256,
        "stops": list(played.stops),
        "nuisances": played.nuisances,
        "way_of": played.fault,
        "way_deg": _finite(played.way_deg),
        "limit_deg": _finite(played.limit_deg),
        "axis_s": played.axis_s,
        "events": [{"time_s": event.time_s, "text": event.text} for event in played.events],
    }


def cell_lines(at: Cell, row: Mapping[str, Any]) -> list[str]:
    """What came of a cell of the matrix (`matrix.run_cell`), line by line."""
    if row["refused"]:
        return [at.text, f"refused: {row['refused']}"]
    lines = [at.text, f"stopped by  {row['stops'] or 'nothing'}"]
    if row["way_of"]:
        lines.append(f"way of {row['way_of']}  {row['way_deg']:.3f} deg, permitted {row['limit_deg']:.3f}")
    lines += [f"trace  sha256 {row['trace_sha256']}", *(f"BROKEN: {each}" for each in row["violations"])]
    return [*lines, f"{len(row['violations'])} broken" if row["violations"] else "everything held"]


def cell_data(at: Cell, row: Mapping[str, Any]) -> dict[str, Any]:
    """The same for JSON, with the names of a scenario; a number that is not finite is null."""
    return {
        "cell": at.text,
        "refused": row["refused"],
        "ok": not row["violations"],
        "violations": row["violations"],
        "trace_sha256": row.get("trace_sha256", ""),
        "stops": row.get("stops", "").split(),
        "way_of": row.get("way_of", ""),
        "way_deg": _finite(row.get("way_deg", math.nan)),
        "limit_deg": _finite(row.get("limit_deg", math.nan)),
        "axis_s": row.get("axis_s", 0.0),
    }


def watched(played: Played) -> Watched:
    """What a picture of a recorded run needs."""
    assert played.log is not None
    alarms = [event for event in played.events if event.text.startswith("alarm: ")]
    moments = tuple(Moment(event.time_s, event.text.split()[1]) for event in alarms)
    onset_s = float(played.log["time_s"][0]) if played.onset_s is None else played.onset_s
    return Watched(played.log, onset_s, math.inf, moments)


def _finite(value: float) -> float | None:
    return value if math.isfinite(value) else None
