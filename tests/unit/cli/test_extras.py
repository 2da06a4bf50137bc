"""Commands without the extra that they need: one line with what to type, before any work."""

from __future__ import annotations

import re
import sys
import tomllib
from importlib.abc import MetaPathFinder
from pathlib import Path

import pytest

from gantryctl.cli import main
from gantryctl.extras import EXTRA_OF
from support.command_line import done, refused

ROOT = Path(__file__).parents[3]

NEEDS = {
    "trace plot run.parquet": "matplotlib",
    "accuracy run": "matplotlib",
    "accuracy measure --instrument simulated": "matplotlib",
    "accuracy report --measured table.csv": "matplotlib",
    "speed-test --out report": "matplotlib",
    "stops --out report": "matplotlib",
    "size --out report": "matplotlib",
    "tune": "matplotlib",
    "compare paper improved --out report": "matplotlib",
    "brake-test --out report": "matplotlib",
    "analyse --plot": "matplotlib",
    "faults run --fault A2 --out fault.png": "matplotlib",
    "commission --with-sim --out report": "matplotlib",
    "commission --with-sim": "matplotlib",
    "identify": "scipy",
    "compare paper improved --ensemble 4": "scipy",
    "compare paper improved --drift hust --identify": "scipy",
    "campaign run gears": "scipy",
    "campaign run gears --cluster tcp://127.0.0.1:1": "distributed",
    "campaign plot gears.result": "matplotlib",
    "serve --opcua 127.0.0.1:4840": "asyncua",
}
"""Command lines, and the package without which they do nothing."""


class NotInstalled(MetaPathFinder):
    """Finds no package of an extra."""

    def find_spec(self, name: str, *_: object) -> None:
        if name in EXTRA_OF:
            raise ModuleNotFoundError(f"No module named {name!r}", name=name)


@pytest.mark.parametrize("line", NEEDS)
def test_a_missing_extra_is_named_with_its_command(line: str, monkeypatch: pytest.MonkeyPatch) -> None:
    package = NEEDS[line]
    monkeypatch.setitem(sys.modules, package, None)
    said = refused(*line.split())
    wanted = f'error: {package} is not installed; type: pip install "gantryctl[{EXTRA_OF[package]}]"\n'
    assert said == wanted
    assert list(Path.cwd().iterdir()) == []


def test_an_import_that_nobody_asked_for_before_is_named_the_same_way(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setitem(sys.modules, "scipy", None)

    def begun(**_: object) -> int:
        import scipy.stats

        return len(scipy.stats.__name__)

    monkeypatch.setattr(main.cli, "main", begun)
    assert main.run(["status"]) == 2
    assert (
        capsys.readouterr().err == 'error: scipy is not installed; type: pip install "gantryctl[reports]"\n'
    )


def test_moving_and_reading_recordings_needs_no_extra(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    # Not None in their place: pyarrow, compiled, would take that for the pandas that it looks for once.
    for package in EXTRA_OF:
        monkeypatch.delitem(sys.modules, package, raising=False)
    monkeypatch.setattr(sys, "meta_path", [NotInstalled(), *sys.meta_path])
    done("move", "0.5")
    (file,) = tmp_path.rglob("*.parquet")
    done("trace", "show", str(file))
    done("trace", "export", str(file), "--format", "csv", "--degrees")


def test_every_package_is_brought_by_its_extra_and_by_nothing_else() -> None:
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]

    def names(requirements: list[str]) -> set[str]:
        return {name for each in requirements for name in re.findall(r"[a-z][a-z0-9-]+", each)}

    brought = {extra: names(wanted) for extra, wanted in project["optional-dependencies"].items()}
    for package, extra in EXTRA_OF.items():
        assert package in brought[extra]
        assert package not in names(project["dependencies"])
