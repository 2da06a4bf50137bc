"""Where the journal and what proves it stand: the machine's state directory, and a directory outside it."""

from __future__ import annotations

import os
from pathlib import Path
from typing import Final, NamedTuple

from gantryctl.errors import UsageError

KEYS_VARIABLE: Final = "GANTRYCTL_KEYS"
FILE: Final = "journal.sqlite"
KEY: Final = "journal.key"
MIRROR: Final = "journal.mirror"


class Places(NamedTuple):
    """Files of the journal of one machine.

    Attributes:
        directory: the machine's state directory.
        outside: of this machine, where whoever writes the state directory does not write.
    """

    directory: Path
    outside: Path

    @property
    def database(self) -> Path:
        """The events."""
        return self.directory / FILE

    @property
    def mirrors(self) -> tuple[Path, Path]:
        """The newest event once more, in both directories."""
        return self.directory / MIRROR, self.outside / MIRROR

    @property
    def key(self) -> Path:
        """The key that seals every event."""
        return self.outside / KEY

    @property
    def anchors(self) -> Path:
        """A line for every day."""
        return self.outside / "journal.anchors"


def places_of(directory: Path) -> Places:
    """Find the files of the machine with this state directory.

    What lies outside is in `$GANTRYCTL_KEYS/<machine>`, else beside the state root with `-keys` at the end of its name.

    Raises:
        UsageError: the variable names no absolute path: the processes of the service stand elsewhere.
    """
    root = directory.parent.resolve()
    named = os.environ.get(KEYS_VARIABLE)
    if named and not Path(named).is_absolute():
        raise UsageError(f"{KEYS_VARIABLE}={named}: write an absolute path")
    keys = Path(named).resolve() if named else root.with_name(f"{root.name or 'state'}-keys")
    return Places(root / directory.name, keys / directory.name)
