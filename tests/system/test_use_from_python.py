"""What the table of docs/how-to/use-from-python.md says one gets; its programs run in test_client.py."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

import pytest

import gantryctl
from gantryctl.trace.table import Trace
from support.command_line import done

GUIDE = Path(__file__).parents[2] / "docs" / "how-to" / "use-from-python.md"
STAND_INS = {
    "30.0": "1.0",
    "20.0": "0.5",
    "slice(3.0, 6.0)": "slice(0.1, 0.3)",
    'read_trace(path, ["time_s"': 'read_trace("file.parquet", ["time_s"',
    "program=MyProgram": "program=AxisProgram",
    "run_for": "engine.run_for",
    "`build_engine": "`engine = build_engine",
}
"""Shorter motions, and names of the reader's own."""


def test_every_line_of_the_table_gives_what_it_says(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    done("config", "init", "my.toml")
    known: dict[str, Any] = {name: getattr(gantryctl, name) for name in gantryctl.__all__}
    known["machine"] = gantryctl.default_machine()
    run = 0
    for row in GUIDE.read_text(encoding="utf-8").splitlines():
        cells = row.split("|")
        if len(cells) != 5:
            continue
        code = cells[3]
        for theirs, ours in STAND_INS.items():
            code = code.replace(theirs, ours)
        for line in re.findall(r"`([^`]+)`", code):
            exec(compile(line, GUIDE.name, "exec"), known)  # noqa: S102 - what the reader does
            run += 1
            trace = known["trace"]
            assert isinstance(trace, Trace)
            if not Path("file.parquet").exists():
                trace.to_parquet("file.parquet")
    assert run >= 13
    assert Path("torque.svg").read_text(encoding="utf-8").lstrip().startswith("<?xml")
