"""The newest event once more: two copies in a file, written in turn, each on the disk before an event counts as kept.

A journal that ends before the event in its mirror has lost events, whatever its own chain says.
"""

from __future__ import annotations

import json
import os
import zlib
from collections.abc import Callable
from operator import itemgetter
from pathlib import Path
from typing import Any, Final, NamedTuple, Protocol

from gantryctl.files import write_whole
from gantryctl.service.recorder.journal.chain import Anchor
from gantryctl.service.recorder.journal.key import Key

# One sector for a copy, and the copies in different pages of the disk.
COPY_BYTES: Final = 512
_OFFSETS: Final = (0, 4096)
_SIZE: Final = _OFFSETS[1] + COPY_BYTES


class Newest(NamedTuple):
    """The newest event, and the one that has locked the journal.

    Attributes:
        lock: number of the event that service has not acknowledged yet, 0 for none.
    """

    anchor: Anchor
    lock: int


class Reflection(NamedTuple):
    """What a mirror shows.

    Attributes:
        newest: None without a copy that can be used.
        turn: which writing it is from.
        damaged: a copy is torn, changed, or sealed with another key.
    """

    newest: Newest | None
    turn: int
    damaged: bool


class OpenFile(Protocol):
    """A file that is written in place."""

    def write(self, offset: int, data: bytes) -> None:
        """Write; it is on the disk when this returns. OSError otherwise."""

    def close(self) -> None:
        """Close it."""


class SystemFile:
    """A file of the operating system that is there."""

    def __init__(self, path: Path) -> None:
        self._handle = os.open(path, os.O_WRONLY | os.O_NOFOLLOW | os.O_CLOEXEC)

    def write(self, offset: int, data: bytes) -> None:
        """Write; it is on the disk when this returns."""
        os.pwrite(self._handle, data, offset)
        os.fdatasync(self._handle)

    def close(self) -> None:
        """Close it."""
        os.close(self._handle)


class Mirror:
    """One mirror, for its writer.

    Args:
        opened: opens the file; a test puts a failing disk under it.

    Raises:
        OSError, StateError: the file cannot be read or made.
    """

    def __init__(self, path: Path, key: Key, opened: Callable[[Path], OpenFile] = SystemFile) -> None:
        self.path, self._key, self._opened = path, key, opened
        self.shown = read_mirror(path, key)
        self._turn = self.shown.turn
        self._file: OpenFile | None = None

    def write(self, newest: Newest) -> None:
        """Keep the newest event over the older copy; OSError or StateError when the disk does not take it."""
        turn = self._turn + 1
        copy, offset = _encoded(newest, turn, self._key), _OFFSETS[turn % 2]
        if self._file is None:
            if self.shown.damaged or not self.path.exists():
                whole = bytearray(_SIZE)
                whole[offset : offset + COPY_BYTES] = copy
                write_whole(self.path, bytes(whole), private=True, make_folder=True)
            self._file = self._opened(self.path)
        # In turn, so that a write that is torn by a power cut never hits the newer copy.
        self._file.write(offset, copy)
        self._turn = turn

    def close(self) -> None:
        """Close the file; the next writing opens it by its name."""
        if self._file is not None:
            self._file.close()
            self._file = None


def read_mirror(path: Path, key: Key | None) -> Reflection:
    """Read what a mirror shows; nothing of a file that is not there. Seals are checked with a key only.

    Raises:
        OSError: it is there and cannot be read.
    """
    try:
        data = path.read_bytes()
    except FileNotFoundError:
        return Reflection(None, 0, damaged=False)
    copies: list[tuple[int, Newest]] = []
    damaged = len(data) != _SIZE
    for offset in _OFFSETS:
        piece = data[offset : offset + COPY_BYTES]
        try:
            copies.append(_decoded(piece, key))
        except (ValueError, KeyError, TypeError, RecursionError):
            damaged = damaged or any(piece)
    if not copies:
        return Reflection(None, 0, damaged)
    turn, newest = max(copies, key=itemgetter(0))
    return Reflection(newest, turn, damaged)


def _encoded(newest: Newest, turn: int, key: Key) -> bytes:
    body = {"turn": turn, "lock": newest.lock, **newest.anchor._asdict()}
    return _text({**body, "seal": key.seal("newest", _plain(body))})


def _decoded(data: bytes, key: Key | None) -> tuple[int, Newest]:
    values = json.loads(data)
    del values["crc32"]
    # The bytes must be exactly what the content would be written as, so that every changed bit shows.
    if _text(values) != data:
        raise ValueError("torn or changed")
    seal, turn, lock = values.pop("seal"), values["turn"], values["lock"]
    if key is not None and seal != key.seal("newest", _plain(values)):
        raise ValueError("sealed with another key")
    seq, texts = values["seq"], (values["hash"], values["utc"], values["journal"])
    if not (all(type(n) is int for n in (turn, lock, seq)) and all(isinstance(text, str) for text in texts)):
        raise ValueError("of another form")
    return turn, Newest(Anchor(seq, *texts), lock)


def _plain(body: dict[str, Any]) -> bytes:
    return json.dumps(body, separators=(",", ":")).encode()


def _text(body: dict[str, Any]) -> bytes:
    crc = f"{zlib.crc32(_plain(body)):08x}"
    return _plain({**body, "crc32": crc}).ljust(COPY_BYTES - 1) + b"\n"
