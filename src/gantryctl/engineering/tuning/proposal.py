"""The proposal: a whole machine file with the gains found, never the one that is in use."""

from __future__ import annotations

from pathlib import Path

from gantryctl.engineering.tuning.gains import machine_with
from gantryctl.engineering.tuning.result import Tuning
from gantryctl.engineering.tuning.text import before_after_table
from gantryctl.errors import UsageError
from gantryctl.machine import Machine, short_hash
from gantryctl.machine.effective import to_toml
from gantryctl.machine.schema import MACHINE_LINE, put_schemas


def proposed_machine(tuning: Tuning) -> Machine:
    """The user's machine with the gains found.

    Raises:
        ConfigError: the gains break a rule of the machine file.
    """
    return machine_with(tuning.machine, tuning.proposal.gains)


def proposal_text(tuning: Tuning) -> str:
    """A machine file; the table of before and after stands above it as comment."""
    table = before_after_table(tuning)
    width = max(len(row[0]) for row in table.rows)
    lines = [
        f"# Proposal of `gantryctl tune --method {tuning.method}` for {tuning.machine.name} "
        f"({short_hash(tuning.machine)}).",
        "# Simulated; try it with --config, compare it with `gantryctl config diff`. Kvp and Tvi belong to the drive:",
        "# a real one keeps its own, enter them there.",
        "#",
        f"# {'':{width}} " + "".join(f"{head:>12}" for head in table.heads[1:]),
        *(f"# {row[0]:{width}} " + "".join(f"{cell:>12}" for cell in row[1:]) for row in table.rows),
        "",
    ]
    return MACHINE_LINE + "\n".join(lines) + "\n" + to_toml(proposed_machine(tuning))


def write_proposal(tuning: Tuning, path: Path, in_use: Path) -> list[Path]:
    """Write the proposal, and beside it its schema and a copy of the calibration file that the machine names.

    Args:
        tuning: the result. path: where to. in_use: the machine file that was tuned.

    Raises:
        UsageError: the file is the one in use, or cannot be written.
    """
    text = proposal_text(tuning)
    try:
        # Gains belong to a person's decision: the file in use is never written.
        if path.exists() and path.samefile(in_use):
            raise UsageError(f"{path}: is the machine file in use; choose another --out")
        path.write_text(text, encoding="utf-8")
        # A machine file names its calibration relative to itself; beside the proposal there is none yet.
        named = tuning.machine.control.compensation.calibration
        calibration = in_use.parent / named
        if not named or not calibration.is_file():
            return [path, *put_schemas([path])]
        copy = path.parent / named
        if not (copy.exists() and copy.samefile(calibration)):
            copy.write_bytes(calibration.read_bytes())
    except OSError as fault:
        raise UsageError(f"{path}: cannot be written: {fault.strerror or fault}") from None
    return [path, copy, *put_schemas([path])]
