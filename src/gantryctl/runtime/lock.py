"""One process at a time in a state directory."""

from __future__ import annotations

import os
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Final

from gantryctl.errors import StateError

_FILE: Final = "lock"
# The file is cut to nothing: it must not be a link to somewhere else.
_NO_LINK: Final = getattr(os, "O_NOFOLLOW", 0)
# Windows locks bytes, against reading too: one far behind the process number, which another run reads.
_LOCKED_BYTE: Final = 1 << 20


class StateLock:
    """Holds a state directory for one process: `with StateLock(directory):`.

    Args:
        advice: what a person can do when another process holds it.

    Raises:
        StateError: another run holds it, or the directory cannot be used.
    """

    def __init__(self, directory: str | Path, advice: Callable[[], str] = lambda: "wait for it") -> None:
        self.directory, self._advice = Path(directory), advice
        self._handle = -1

    def __enter__(self) -> StateLock:
        path = self.directory / _FILE
        try:
            self.directory.mkdir(parents=True, exist_ok=True)
            handle = os.open(path, os.O_RDWR | os.O_CREAT | _NO_LINK, 0o644)
        except OSError as fault:
            raise StateError(f"state directory {self.directory}: {fault.strerror or fault}") from fault
        try:
            _lock(handle)
        except OSError:
            holder = os.read(handle, 20).decode(errors="replace").strip() or "unknown"
            os.close(handle)
            raise StateError(
                f"state directory {self.directory} is in use by process {holder}; {self._advice()}"
            ) from None
        os.ftruncate(handle, 0)
        os.write(handle, f"{os.getpid()}\n".encode())
        self._handle = handle
        return self

    def check(self) -> None:
        """Check that the directory is still the one that is held; nothing where none is.

        Raises:
            StateError: it was moved away, removed or replaced while it was in use.
        """
        if self._handle < 0:
            return
        try:
            same = os.path.samestat(os.stat(self.directory / _FILE), os.fstat(self._handle))
        except OSError:
            same = False
        if not same:
            raise StateError(
                f"state directory {self.directory} was moved away or replaced while it was in use: put it back"
            )

    def __exit__(self, *_: object) -> None:
        # Closing frees the lock; the file stays, for removing it would race with the next run.
        os.close(self._handle)
        self._handle = -1


if sys.platform == "win32":
    import msvcrt

    def _lock(handle: int) -> None:
        os.lseek(handle, _LOCKED_BYTE, os.SEEK_SET)
        msvcrt.locking(handle, msvcrt.LK_NBLCK, 1)
        os.lseek(handle, 0, os.SEEK_SET)

else:
    import fcntl

    # The system frees it however the process ends (decision 0006).
    def _lock(handle: int) -> None:
        fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
