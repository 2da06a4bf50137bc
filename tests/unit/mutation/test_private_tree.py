"""Processes that a test starts run the changed sources, also where the package is installed as editable."""

from __future__ import annotations

import importlib
import runpy
import sys
from pathlib import Path
from types import SimpleNamespace

import pytest


class RedirectingFinder:
    """Stands for that of an editable install."""

    def find_spec(self, *_: object) -> None:
        return None


def test_the_module_that_python_imports_first_lets_the_copy_be_found(
    mutation_tool: None, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    tree = importlib.import_module("mutation.private_tree")
    core = tmp_path / "_core.so"
    core.touch()
    # No files but these: neither git nor a built core is asked.
    monkeypatch.setattr(tree.subprocess, "run", lambda *_, **__: SimpleNamespace(stdout=b""))
    monkeypatch.setattr(tree.importlib.util, "find_spec", lambda _: SimpleNamespace(origin=str(core)))
    copy = tmp_path / "copy"
    (copy / "src" / "gantryctl").mkdir(parents=True)
    monkeypatch.setattr(tree.shutil, "rmtree", lambda *_, **__: None)
    tree.PrivateTree(tmp_path, copy)
    others = [finder for finder in sys.meta_path if "Redirecting" not in type(finder).__name__]
    monkeypatch.setattr(sys, "meta_path", [RedirectingFinder(), *others])
    runpy.run_path(str(copy / tree._FIRST / "sitecustomize.py"))
    assert sys.meta_path == others
