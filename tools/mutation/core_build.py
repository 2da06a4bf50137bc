"""The core with all its changes behind switches: built once, in a copy of the repository, for its tests."""

from __future__ import annotations

import hashlib
import json
import os
import platform
import re
import shutil
import subprocess
import sys
import time
from collections.abc import Iterable, Sequence
from functools import cached_property
from pathlib import Path
from typing import Final

from mutation.areas import SOURCES
from mutation.campaign import digest_of
from mutation.cpp_switch import HEADER, SOURCE, Switched, numbered
from mutation.mutant import Change
from mutation.private_tree import PrivateTree

_ROUNDS: Final = 8
_HEADER_FILE: Final = "core/mutation_switch.hpp"
# CMakeLists.txt takes every source of these two kinds.
_SOURCE_FILES: Final = ("core/tests/mutation_switch.cpp", "core/bindings_mutation_switch.cpp")
# But for the tests of packs in the form of other compilers, whose sources it names one by one.
_LOOP_PACKS: Final = "core_tests_loop_packs"
_NAMED: Final = f"add_executable({_LOOP_PACKS} "
# Optimised enough to be quick; the numbers are the same bits at every level. GCC 12 fails on a choice between two masks
# of the first x86-64, which has no comparison of whole numbers of 64 bits.
_FLAGS: Final = "-O1 -w -DGANTRY_INLINE=inline" + (" -msse4.2" if platform.machine() == "x86_64" else "")


class CoreBuild:
    """One build of all changes.

    Args:
        root: of the repository.
        folder: kept from run to run: only what has changed is compiled again.
        changes: numbered from 1 in this order.

    Attributes:
        numbers: by name of the change; those that do not compile behind a switch have none.
    """

    def __init__(self, root: Path, folder: Path, changes: Sequence[Change]) -> None:
        folder.mkdir(parents=True, exist_ok=True)
        self._root, self._folder = root, folder
        self._changes = list(changes)
        self._by_file = numbered(self._changes)
        self.tree = PrivateTree(root, folder / "tree")
        self._build_folder = folder / "build"
        left_out = self._known_left_out()
        files = {file: Switched((root / file).read_bytes(), some) for file, some in self._by_file.items()}
        for _ in range(_ROUNDS):
            self._write(files, left_out)
            errors = self._compile()
            if not errors:
                break
            fresh = self._at_fault(errors) - left_out
            if not fresh:
                raise SystemExit("the core does not compile with its switches:\n" + "\n".join(errors[:20]))
            left_out |= fresh
        else:
            raise SystemExit("the core does not compile with its switches")
        alone = left_out | {number for each in files.values() for number in each.alone}
        self.numbers = {
            change.name: number for number, change in enumerate(self._changes, 1) if number not in alone
        }
        kept = {self._changes[number - 1].name: self._digest(number) for number in left_out}
        (folder / "left_out.json").write_text(json.dumps(kept, indent=1), encoding="utf-8")
        for module in self._build_folder.glob("_core*.so"):
            shutil.copy2(module, self.tree.root / SOURCES / module.name)

    @property
    def programs(self) -> tuple[Path, ...]:
        """The core's own tests: all, and those of packs again in the form that other compilers get."""
        return self._build_folder / "core_tests", self._build_folder / _LOOP_PACKS

    @cached_property
    def module(self) -> Path:
        """The extension, as the tests in Python import it."""
        (module,) = (self.tree.root / SOURCES).glob("_core*.so")
        return module

    @property
    def count(self) -> int:
        """One more than the largest number."""
        return len(self._changes) + 1

    def place(self, number: int) -> tuple[str, int]:
        """Source and line of a change."""
        change = self._changes[number - 1]
        return change.file, change.line

    def _digest(self, number: int) -> str:
        return digest_of(self._root, self._changes[number - 1])

    def _known_left_out(self) -> set[int]:
        path = self._folder / "left_out.json"
        kept = json.loads(path.read_text(encoding="utf-8")) if path.exists() else {}
        return {
            number
            for number, change in enumerate(self._changes, 1)
            if change.name in kept and kept[change.name] == self._digest(number)
        }

    def _write(self, files: dict[Path, Switched], left_out: set[int]) -> None:
        for file, switched in files.items():
            text = switched.text(left_out)
            (self.tree.root / file).write_bytes(text.encode("latin-1"))
        (self.tree.root / _HEADER_FILE).write_text(HEADER, encoding="utf-8")
        for name in _SOURCE_FILES:
            text = SOURCE % {"count": self.count}
            (self.tree.root / name).write_text(text, encoding="utf-8")
        text = (self._root / "CMakeLists.txt").read_text(encoding="utf-8")
        named = text.replace(_NAMED, f"{_NAMED}{_SOURCE_FILES[0]} ")
        (self.tree.root / "CMakeLists.txt").write_text(named, encoding="utf-8")
        self._stamp()

    def _stamp(self) -> None:
        """A source that is as it was built last keeps the time that it had then: it is not compiled again."""
        path = self._folder / "stamps.json"
        kept = json.loads(path.read_text(encoding="utf-8")) if path.exists() else {}
        now = time.time()
        stamps: dict[str, tuple[str, float]] = {}
        for file in [*sorted((self.tree.root / "core").rglob("*.*pp")), self.tree.root / "CMakeLists.txt"]:
            name = str(file.relative_to(self.tree.root))
            sha = hashlib.sha256(file.read_bytes()).hexdigest()
            last_sha, last_s = kept.get(name, ("", now))
            stamps[name] = (sha, last_s if last_sha == sha else now)
            os.utime(file, (stamps[name][1], stamps[name][1]))
        path.write_text(json.dumps(stamps), encoding="utf-8")

    def _compile(self) -> list[str]:
        """Builds; the lines of the compiler that name an error."""
        build, tree = str(self._build_folder), str(self.tree.root)
        flags = f"{_FLAGS} -include {self.tree.root / _HEADER_FILE}"
        options = {
            "CMAKE_BUILD_TYPE": "Debug",
            "CMAKE_CXX_FLAGS_DEBUG": flags,
            "Python_EXECUTABLE": sys.executable,
            "GANTRYCTL_CORE_TESTS": "ON",
            "SKBUILD": "1",
        }
        given = [f"-D{key}={value}" for key, value in options.items()]
        told = subprocess.run(  # noqa: S603
            ["cmake", "-S", tree, "-B", build, "-G", "Ninja", *given],  # noqa: S607
            capture_output=True, text=True, check=False,
        )  # fmt: skip
        if told.returncode:
            raise SystemExit(told.stderr)
        told = subprocess.run(  # noqa: S603
            ["cmake", "--build", build, "--target", "core_tests", _LOOP_PACKS, "_core", "-j", "2", "--", "-k", "0"],  # noqa: S607
            capture_output=True, text=True, check=False,
        )  # fmt: skip
        errors = [line for line in told.stdout.splitlines() if " error: " in line]
        return errors or ([told.stdout[-2000:]] if told.returncode else [])

    def _at_fault(self, errors: Iterable[str]) -> set[int]:
        """Numbers of the changes that stand where the compiler stopped."""
        found = set()
        for error in errors:
            place = re.match(r"(.*?):(\d+):\d+: error: ", error)
            if place and Path(place[1]).is_file():
                lines = Path(place[1]).read_text(encoding="latin-1").splitlines()
                number = re.search(r"gantry_mutation::on\((\d+)\)", lines[int(place[2]) - 1])
                if number:
                    found.add(int(number[1]))
        return found
