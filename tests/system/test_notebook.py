"""The notebook of the tutorial runs from the first cell to the last, and shows what its text says."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest
from IPython.core.interactiveshell import InteractiveShell
from traitlets.config import Config

NOTEBOOKS = sorted((Path(__file__).parents[2] / "docs" / "tutorials").glob("*.ipynb"))


def cells(path: Path) -> list[dict[str, Any]]:
    found: list[dict[str, Any]] = json.loads(path.read_text(encoding="utf-8"))["cells"]
    return found


def shown(path: Path, folder: Path, monkeypatch: pytest.MonkeyPatch) -> list[dict[str, Any]]:
    """What each code cell displays by media type, as IPython makes it for a notebook."""
    # Settings of a new user, and no history.
    monkeypatch.setenv("IPYTHONDIR", str(folder))
    monkeypatch.chdir(folder)
    settings = Config()
    settings.HistoryManager.enabled = False
    shell = InteractiveShell(user_ns={}, config=settings)
    made = []
    for cell in cells(path):
        if cell["cell_type"] == "code":
            done = shell.run_cell("".join(cell["source"]), store_history=False, silent=False)
            done.raise_error()
            # A bare terminal shows text only; a notebook asks for all of them.
            shell.display_formatter.active_types = shell.display_formatter.format_types
            data, _ = shell.display_formatter.format(done.result) if done.result is not None else ({}, {})
            made.append(data)
    return made


def test_there_is_one_and_it_is_kept_without_outputs() -> None:
    assert NOTEBOOKS
    for path in NOTEBOOKS:
        for cell in cells(path):
            assert not cell.get("outputs"), f"{path.name}: strip the outputs"
            assert cell.get("execution_count") is None


def test_it_runs_and_shows_tables_and_pictures(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    (path,) = (path for path in NOTEBOOKS if path.name == "first-notebook.ipynb")
    data = shown(path, tmp_path, monkeypatch)
    tables = "".join(each.get("text/html", "") for each in data)
    for words in ("Machine: hust_gantry", "Motion", "Trace: ", "Engine", "Stops", "Accuracy: hust_gantry"):
        assert words in tables
    assert sum("image/png" in each for each in data) == 3
    assert "mdeg from its set-point" in capsys.readouterr().out
