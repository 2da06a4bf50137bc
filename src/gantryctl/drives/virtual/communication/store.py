"""Stored parameters (1010, 1011), in a file or in memory."""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Final

from gantryctl.drives.virtual.communication.dictionary import Key
from gantryctl.files import write_whole

_FORMAT: Final = 1


class ParameterStore:
    """Values by index and sub-index that survive a reset, and in a file the end of the process.

    Args:
        path: the file; None keeps them in memory.
    """

    def __init__(self, path: Path | None = None) -> None:
        self._path = path
        self._values: dict[Key, int] = {}
        self.damaged = False
        """The file exists but could not be read: defaults are in force."""
        if path is not None:
            self._load(path)

    def values(self) -> Mapping[Key, int]:
        """Stored values."""
        return self._values

    def save(self, values: Mapping[Key, int], first: int, last: int) -> None:
        """Replace the stored values of a range of indices.

        Raises:
            StateError: the file cannot be written.
        """
        self._replace(
            {key: v for key, v in self._values.items() if not first <= key[0] <= last} | dict(values)
        )

    def drop(self, first: int, last: int) -> None:
        """Delete the stored values of a range of indices.

        Raises:
            StateError: the file cannot be written.
        """
        self._replace({key: v for key, v in self._values.items() if not first <= key[0] <= last})

    def _replace(self, values: dict[Key, int]) -> None:
        if self._path is not None:
            text = {f"{index:04X}:{sub:02X}": value for (index, sub), value in sorted(values.items())}
            write_whole(self._path, json.dumps({"format": _FORMAT, "values": text}, indent=1))
        self._values = values

    def _load(self, path: Path) -> None:
        try:
            data = json.loads(path.read_text())
            if data["format"] != _FORMAT:
                raise ValueError
            self._values = {_key(place): int(value) for place, value in data["values"].items()}
        except FileNotFoundError:
            return
        except (OSError, ValueError, KeyError, TypeError, AttributeError):
            # As a real drive with a damaged memory: defaults are in force, and EMCY 6310 tells (CiA 402).
            self.damaged = True


def _key(place: str) -> Key:
    index, _, sub = place.partition(":")
    return int(index, 16), int(sub, 16)
