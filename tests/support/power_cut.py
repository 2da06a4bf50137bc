# ruff: noqa: N802  (names of the VFS)
"""A file system that remembers every write and sync, so that a test can cut the power at any of them.

After a cut a file holds what was there at its last sync; of each write since then all, some sectors, or nothing.
"""

from __future__ import annotations

import random
from collections import defaultdict
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import Any, NamedTuple

import apsw

from gantryctl.service.recorder.journal.mirror import SystemFile

SECTOR = 512


class Step(NamedTuple):
    """One thing that happened: `write`, `truncate`, `sync`, `delete`, or `kept` with the number of an event."""

    kind: str
    file: str
    offset: int = 0
    data: bytes = b""


class _File(apsw.VFSFile):
    def __init__(self, disk: Disk, name: Any, flags: list[int]) -> None:
        self._disk = disk
        self._name = disk.named(name.filename() if isinstance(name, apsw.URIFilename) else name)
        super().__init__(disk.base, name, flags)

    def xWrite(self, data: bytes, offset: int) -> None:
        self._disk.steps.append(Step("write", self._name, offset, bytes(data)))
        super().xWrite(data, offset)

    def xTruncate(self, size: int) -> None:
        self._disk.steps.append(Step("truncate", self._name, size))
        super().xTruncate(size)

    def xSync(self, flags: int) -> None:
        self._disk.steps.append(Step("sync", self._name))
        super().xSync(flags)


class _InPlace:
    """A file that is written in place, each time on the disk when that returns: a mirror of the journal."""

    def __init__(self, disk: Disk, path: Path) -> None:
        self._disk, self._name, self._file = disk, disk.named(path), SystemFile(path)
        disk.steps += [Step("write", self._name, 0, path.read_bytes()), Step("sync", self._name)]

    def write(self, offset: int, data: bytes) -> None:
        self._disk.steps += [Step("write", self._name, offset, data), Step("sync", self._name)]
        self._file.write(offset, data)

    def close(self) -> None:
        self._file.close()


class Disk(apsw.VFS):
    """Remembers; `connect` gives a database on it that looks like one of the sqlite3 module.

    Args:
        root: folder of everything that is on it.
    """

    def __init__(self, root: Path) -> None:
        self.steps: list[Step] = []
        self.base, self.root = "", root.resolve()
        super().__init__(f"remembers-{id(self)}", self.base)

    def xOpen(self, name: Any, flags: list[int]) -> _File:
        return _File(self, name, flags)

    def xDelete(self, filename: str, syncdir: bool) -> None:
        self.steps.append(Step("delete", self.named(filename)))
        super().xDelete(filename, syncdir)

    def named(self, path: str | Path) -> str:
        """Name below the root."""
        return str(Path(path).resolve().relative_to(self.root))

    def opened(self, path: Path) -> _InPlace:
        """Open a file that is written in place."""
        return _InPlace(self, path)

    def connect(self, path: Path, synchronous: str = "") -> Connection:
        return Connection(apsw.Connection(str(path), vfs=f"remembers-{id(self)}"), synchronous)

    def after_cuts(self, cuts: Iterable[int], root: Path, chance: random.Random) -> Iterator[int]:
        """Write below another root what a disk may hold when power goes off after so many steps; for each of them.

        Args:
            cuts: in ascending order.
        """
        whole: dict[str, bytearray] = defaultdict(bytearray)
        synced: dict[str, bytes] = {}
        loose: dict[str, list[Step]] = defaultdict(list)
        done = 0
        for cut in cuts:
            for step in self.steps[done:cut]:
                if step.kind == "sync":
                    synced[step.file], loose[step.file] = bytes(whole[step.file]), []
                elif step.kind == "delete":
                    for kept in (whole, synced, loose):
                        kept.pop(step.file, None)
                elif step.kind != "kept":
                    _apply(whole[step.file], step)
                    loose[step.file].append(step)
            done = cut
            for name in whole:
                content = bytearray(synced.get(name, b""))
                for step in loose[name]:
                    _apply(content, step, chance)
                (root / name).parent.mkdir(parents=True, exist_ok=True)
                (root / name).write_bytes(content)
            yield cut


def _apply(content: bytearray, step: Step, chance: random.Random | None = None) -> None:
    """One write, or with `chance` what is left of one that was never synced."""
    fate = chance.choice(["all", "some", "none"]) if chance is not None else "all"
    if fate == "none":
        return
    if step.kind == "truncate":
        del content[step.offset :]
        return
    for at in range(0, len(step.data), SECTOR):
        if fate == "some" and chance is not None and chance.random() < 0.5:
            continue
        piece, begin = step.data[at : at + SECTOR], step.offset + at
        if len(content) < begin:
            content.extend(bytes(begin - len(content)))
        content[begin : begin + len(piece)] = piece


class Connection:
    """As much of a sqlite3 connection as the journal uses."""

    def __init__(self, made: apsw.Connection, synchronous: str) -> None:
        self._made, self._synchronous = made, synchronous
        made.execute("PRAGMA locking_mode = EXCLUSIVE")  # WAL without shared memory

    def execute(self, query: str, values: tuple[Any, ...] = ()) -> Any:
        if self._synchronous and "synchronous" in query:
            query = f"PRAGMA synchronous = {self._synchronous}"
        return self._made.execute(query, values)

    def executescript(self, script: str) -> None:
        self._made.execute(script)

    def __enter__(self) -> Connection:
        return self

    def __exit__(self, kind: type[BaseException] | None, *_: object) -> None:
        self._made.execute("COMMIT" if kind is None else "ROLLBACK")

    def close(self) -> None:
        self._made.close()
