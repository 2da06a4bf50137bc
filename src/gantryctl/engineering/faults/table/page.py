"""The reference page of the fault catalogue: `python -m gantryctl.engineering.faults.table.page FILE WAYS`.

WAYS is what `gantryctl.engineering.faults.table.ways` has measured.
"""

from __future__ import annotations

import json
import re
import sys
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any, Final

from gantryctl.engineering.faults.case import FaultCase, ReactionClass
from gantryctl.engineering.faults.catalogue import cases_of
from gantryctl.engineering.faults.table.row import Row, State
from gantryctl.engineering.faults.table.table import GROUPS, ROWS
from gantryctl.program.alarms.codes import Code
from gantryctl.program.alarms.table import ALARMS

REACTIONS_TEST: Final = "faults/test_reactions.py"

_HEAD: Final = """\
# Faults

Written by `python -m gantryctl.engineering.faults.table.page docs/reference/faults.md docs/evidence/fault_ways.json`;
do not edit, a test compares.

Every fault of the catalogue: what notices it, what is done about it, what a person reads, the tests that inject it, and
how far the axis turns at most. `gantryctl faults run --fault A2` injects a row into the simulator and shows its plot;
the classes of reaction and the words of the alarms are in [alarms](alarms.md).

**Worst angle** is the true angle of the motor, at the gantry, from the fault until it stands, at 6, 3 and 1 deg/s, or
the same for a row that begins at standstill, with its limit behind the stroke. It holds for the conditions below and
for the simulated plant, not for a gantry: there `gantryctl stops` and the commissioning measure.

{conditions}

**State**: yes = detected, answered, and injected by the tests named; partly and no have their reason. {counts}
"""
_TABLE: Final = (
    "| # | fault | detected by | reaction | worst angle, deg | the operator reads | tests | state |\n"
    "|---|---|---|---|---|---|---|---|\n"
)


def page(ways: Mapping[str, Any]) -> str:
    """The whole page.

    Args:
        ways: measured ways, as `measure` makes them.
    """
    states = [_state(row, ways["cases"])[0] for row in ROWS.values()]
    counts = f"Of {len(states)} rows {states.count(State.YES)} are yes"
    counts += "".join(
        f", {states.count(state)} {state}" for state in (State.PARTLY, State.NO) if state in states
    )
    head = _HEAD.format(conditions=ways["conditions"], counts=f"{counts}.")
    parts = [head]
    for title, rows in GROUPS:
        parts.append(f"## {title}\n\n{_TABLE}" + "".join(_lines(row, ways["cases"]) for row in rows))
    return "\n".join(parts)


def _lines(row: Row, ways: Mapping[str, Any]) -> str:
    """The line of a row, and one for each of its variants."""
    variants = cases_of(row)
    own = next((case for case in variants if case.number == row.number), None)
    tests = [f"`{name}`" for name in row.tests]
    if own is not None:
        tests.append(f"`{REACTIONS_TEST}`")
    state, why = _state(row, ways)
    note = f" ({row.why})" if row.why and row.state is State.YES else ""
    cells = (
        row.number, row.fault, row.detected_by, row.reaction + note,
        _way(own, ways), _read(row.codes), "<br>".join(tests), f"{state}: {why}" if why else state.value,
    )  # fmt: skip
    lines = [_line(cells)]
    for case in variants:
        if case is not own:
            lines.append(_line(_variant(case, ways)))
    return "".join(lines)


def _state(row: Row, ways: Mapping[str, Any]) -> tuple[State, str]:
    """State of a row and its reason: a row whose runs were not as they must be is not done, whatever the table says."""
    if row.state is State.NO:
        return row.state, row.why
    wrong = [
        f"{case.number}{f' at {speed} deg/s' if case.phase.moves else ''}, {each}"
        for case in cases_of(row)
        for speed, one in ways.get(case.number, {}).items()
        for each in one["against"]
    ]
    measured = (
        f"measured: {wrong[0]}{f' (and {len(wrong) - 1} more)' if len(wrong) > 1 else ''}" if wrong else ""
    )
    reason = row.why if row.state is State.PARTLY else ""
    return (State.PARTLY if wrong else row.state), "; ".join(part for part in (reason, measured) if part)


def _variant(case: FaultCase, ways: Mapping[str, Any]) -> tuple[str, ...]:
    reaction = "" if case.reaction is ReactionClass.NONE else case.reaction.value
    test = f"`{REACTIONS_TEST}`"
    way = _way(case, ways)
    return (case.number, case.title, case.detected_by, reaction, way, _read(case.codes[:1]), test, "")


def _way(case: FaultCase | None, ways: Mapping[str, Any]) -> str:
    """Worst way and limit at each speed: "2.36 / 4.50 at 6"."""
    found = ways.get(case.number) if case is not None else None
    # A motion that goes on has no way to rest.
    if case is None or found is None or case.reaction in (ReactionClass.WARNING, ReactionClass.NONE):
        return "-"
    return "<br>".join(
        _angle(one) + (f" at {speed}" if case.phase.moves else "") for speed, one in found.items()
    )


def _angle(one: Mapping[str, Any]) -> str:
    limit = "" if one["limit_deg"] is None else f" / {one['limit_deg']:.2f}"
    return f"{one['way_deg']:.2f}{limit}"


def _read(codes: Iterable[Code]) -> str:
    # Number formats mean nothing to a reader.
    return "<br>".join(f"{code} {re.sub(r'{[^}]*}', '...', ALARMS[code].english.message)}" for code in codes)


def _line(cells: Iterable[str]) -> str:
    return "| " + " | ".join(cell.replace("|", "\\|") or "-" for cell in cells) + " |\n"


if __name__ == "__main__":
    measured = json.loads(Path(sys.argv[2]).read_text(encoding="utf-8"))
    Path(sys.argv[1]).write_text(page(measured), encoding="utf-8")
