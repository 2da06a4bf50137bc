"""Retained memory: two copies of one record, written in turn, so that a power cut never takes both."""

from __future__ import annotations

import json
import zlib
from operator import itemgetter
from pathlib import Path
from typing import Final

from gantryctl.errors import StateError
from gantryctl.files import indented_json, write_whole
from gantryctl.runtime.retained import Retained, from_json_values, to_json_values

COPIES: Final = ("retain.a.json", "retain.b.json")
FORMAT: Final = "gantryctl retained memory, version 1"


class _Damaged(StateError):
    """Torn or changed copy: the other one counts. No other StateError may be bridged."""


def encode(record: Retained, sequence: int) -> bytes:
    """Copy as it stands in the file: JSON in one fixed form, so that every changed bit shows."""
    body = {"format": FORMAT, "sequence": sequence, "record": to_json_values(record)}
    return _text({"crc32": _crc(body), **body})


def decode(data: bytes) -> tuple[int, Retained]:
    """Sequence number and record of a copy; StateError for one that cannot be used."""
    try:
        values = json.loads(data)
    except (ValueError, RecursionError) as fault:
        raise _Damaged(f"cut off or damaged ({fault})") from fault
    if not isinstance(values, dict):
        raise _Damaged("damaged (no record in it)")
    body = {key: value for key, value in values.items() if key != "crc32"}
    # The bytes must be exactly what the content would be written as: so every changed bit shows, also one in white
    # space or in the CRC itself (decision 0006).
    try:
        whole = values.get("crc32") == _crc(body) and _text(values) == data
    except RecursionError:  # read, but too deep to be written
        whole = False
    if not whole:
        raise _Damaged("damaged (the check sum does not fit)")
    sequence, record = values.get("sequence"), values.get("record")
    # A whole copy of another version is an error at once, never bridged with the older data of the other copy.
    if values.get("format") != FORMAT or not isinstance(sequence, int) or not isinstance(record, dict):
        raise StateError(f"of another version of gantryctl: {values.get('format')!r}, wanted {FORMAT!r}")
    return sequence, from_json_values(record)


def _text(values: object) -> bytes:
    return (indented_json(values) + "\n").encode()


def _crc(body: object) -> str:
    return f"{zlib.crc32(_text(body)):08x}"


class RetainedMemory:
    """Retained memory of one state directory. Hold a `StateLock` on the directory while using it.

    Attributes:
        notes: what `load()` found wrong but could bridge, in words; empty when all was well.
    """

    def __init__(self, directory: str | Path) -> None:
        self.directory = Path(directory)
        self.notes: tuple[str, ...] = ()

    def load(self) -> Retained | None:
        """Read the newest valid copy; None when there is no copy yet.

        Raises:
            StateError: there are copies, but none is valid.
        """
        copies = self._copies()
        return max(copies.values(), key=itemgetter(0))[1] if copies else None

    def store(self, record: Retained) -> None:
        """Write the record over the older copy; it is on the disk when this returns.

        Raises:
            StateError: a value that may not be stored, a disk that does not take it, or damage that `load`
                refuses. The newest copy so far is safe.
        """
        copies = self._copies()
        newest = max(copies, key=lambda name: copies[name][0], default=COPIES[1])
        sequence = copies[newest][0] + 1 if copies else 1
        # In turn, so that a write that is torn by a power cut never hits the newest copy.
        older = COPIES[1 - COPIES.index(newest)]
        write_whole(self.directory / older, encode(record, sequence), make_folder=True)

    def _copies(self) -> dict[str, tuple[int, Retained]]:
        """Read the valid copies by file name, and fill `notes`."""
        copies: dict[str, tuple[int, Retained]] = {}
        notes, missing = [], []
        for name in COPIES:
            path = self.directory / name
            try:
                copies[name] = decode(path.read_bytes())
            except FileNotFoundError:
                missing.append(name)
            except OSError as fault:
                raise StateError(f"{path}: cannot be read: {fault.strerror or fault}") from fault
            except _Damaged as fault:
                notes.append(f"{name} is {fault}")
            except StateError as fault:
                raise StateError(f"{path}: {fault}") from fault
        if notes and not copies:
            raise StateError(
                f"retained memory in {self.directory} cannot be used: {'; '.join(notes)}. Zero offset and "
                "rest position are lost: move the files away, compare the encoder with a mark, set the zero"
            )
        if missing and any(sequence > 1 for sequence, _ in copies.values()):
            notes.append(f"{missing[0]} is missing")
        self.notes = tuple(f"{note}; the other copy is used" for note in notes)
        return copies
