"""A copy of the repository for one worker: changes go into its sources, never into the work tree."""

from __future__ import annotations

import importlib.util
import os
import runpy
import shutil
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from mutation.areas import SOURCES
from mutation.mutant import Change

_NOT_COPIED = ("hmi/", "docs/hmi/", "docs/tutorials/")
"""Large, and read by tests of `tests/system` alone."""
_FIRST = "build/first"
"""Folder on the path of every process that is started here, for the module that Python imports first."""
_COPY_FIRST = """import sys

# An editable install would find the work tree first.
sys.meta_path[:] = [finder for finder in sys.meta_path if "Redirecting" not in type(finder).__name__]
"""


class PrivateTree:
    """The files that git knows of, or would add, and the compiled core that is used here.

    Args:
        root: of the repository.
        folder: the copy; made anew.
    """

    def __init__(self, root: Path, folder: Path) -> None:
        self.root = folder
        shutil.rmtree(folder, ignore_errors=True)
        listed = subprocess.run(
            ["git", "ls-files", "-z", "--cached", "--others", "--exclude-standard"],  # noqa: S607
            cwd=root,
            capture_output=True,
            check=True,
        ).stdout.decode()
        for name in filter(None, listed.split("\0")):
            source, target = root / name, folder / name
            if source.is_file() and not name.startswith(_NOT_COPIED):
                target.parent.mkdir(parents=True, exist_ok=True)
                shutil.copy2(source, target, follow_symlinks=True)
        core = importlib.util.find_spec("gantryctl._core")
        if core is None or core.origin is None:
            raise SystemExit("the core is not built: make core")
        shutil.copy2(core.origin, folder / SOURCES / Path(core.origin).name)
        configs = folder / SOURCES / "configs"
        if not configs.exists():
            configs.symlink_to(folder / "configs")
        first = folder / _FIRST / "sitecustomize.py"
        first.parent.mkdir(parents=True, exist_ok=True)
        first.write_text(_COPY_FIRST, encoding="utf-8")
        self._changes = 0

    def enter(self) -> None:
        """Make this process, and those that it starts, use the copy."""
        os.chdir(self.root)
        paths = [str(self.root / name) for name in ("src", "tests", _FIRST)]
        os.environ["PYTHONPATH"] = os.pathsep.join(paths)
        os.environ["PYTHONDONTWRITEBYTECODE"] = "1"
        sys.dont_write_bytecode = True
        sys.path[:0] = paths
        runpy.run_path(str(self.root / _FIRST / "sitecustomize.py"))
        for name in [name for name in sys.modules if name.partition(".")[0] == "gantryctl"]:
            del sys.modules[name]
        found = importlib.util.find_spec("gantryctl")
        if found is None or not str(found.origin).startswith(str(self.root)):
            raise SystemExit(f"gantryctl is imported from {found and found.origin}, not from {self.root}")

    @contextmanager
    def changed(self, change: Change) -> Iterator[bytes]:
        """The changed text, for as long as it stands in its file."""
        path = self.root / change.file
        source, times = path.read_bytes(), path.stat()
        text = change.applied(source)
        path.write_bytes(text)
        # Bytecode is judged by seconds and size: no two changes share a second.
        self._changes += 1
        os.utime(path, (times.st_atime, times.st_mtime + 10 * self._changes))
        try:
            yield text
        finally:
            path.write_bytes(source)
            os.utime(path, ns=(times.st_atime_ns, times.st_mtime_ns))
