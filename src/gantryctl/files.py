"""Writing a file so that a power cut leaves the old one or the new one, whole; its text where that is JSON."""

from __future__ import annotations

import contextlib
import errno
import json
import os
import secrets
import sys
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Final

from gantryctl.errors import DeviceError, GantryctlError, StateError, UsageError

# A disk that stalls takes some seconds (fault F12); nothing that is younger than this is taken for left behind.
DRAFT_S: Final = 60.0
# The disk or the process is in trouble, whatever name was given.
_TROUBLE: Final = {errno.ENOSPC, errno.EDQUOT, errno.EIO, errno.EMFILE, errno.ENFILE, errno.ENOMEM}


def unwritable(path: Path, fault: OSError) -> GantryctlError:
    """Error for a file that somebody named and that cannot be written: of the name, or of the disk."""
    kind = DeviceError if fault.errno in _TROUBLE else UsageError
    return kind(f"{path}: cannot be written: {fault.strerror or fault}")


def unreadable(path: Path, fault: OSError) -> GantryctlError:
    """Error for a file that somebody named and that cannot be read: of the name, or of the disk."""
    kind = DeviceError if fault.errno in _TROUBLE else UsageError
    return kind(f"{path}: cannot be read: {fault.strerror or fault}")


def check_place(path: Path) -> None:
    """Refuse the name of a file that cannot be written, before any work is done for it.

    Raises:
        UsageError: it is a folder, there is no such folder, or this user may not write there.
    """
    folder = path.parent
    why = ""
    if path.is_dir():
        why = "is a folder"
    elif not folder.is_dir():
        why = f"cannot be written: there is no folder {folder}"
    elif not os.access(path if path.exists() else folder, os.W_OK):
        why = "cannot be written: no right to"
    if why:
        raise UsageError(f"{path}: {why}")


def indented_json(value: object, *, allow_nan: bool = True, depth: int = 0) -> str:
    """JSON text, one value a line, as `json.dumps(value, indent=1)` writes it; keys are strings.

    The encoder of the standard library leaves 22 objects that refer to each other behind with every call, 2.6 kB
    (CPython 3.11): only a collection of garbage takes them, and the process of the scan has none. Seven calls at each
    power-off were 1 MB an hour.

    Args:
        allow_nan: write numbers that JSON does not know as NaN and Infinity.
        depth: spaces in front of the closing bracket.

    Raises:
        ValueError: a number that JSON does not know. TypeError: a value that JSON does not know.
    """
    if isinstance(value, dict):
        brackets = "{}"
        parts = [
            f"{json.dumps(key)}: {indented_json(each, allow_nan=allow_nan, depth=depth + 1)}"
            for key, each in value.items()
        ]
    elif isinstance(value, list | tuple):
        brackets = "[]"
        parts = [indented_json(each, allow_nan=allow_nan, depth=depth + 1) for each in value]
    else:
        return json.dumps(value, allow_nan=allow_nan)
    if not parts:
        return brackets
    line = "\n" + " " * depth
    return f"{brackets[0]}{line} {f',{line} '.join(parts)}{line}{brackets[1]}"


def write_whole(path: Path, data: bytes | str, *, private: bool = False, make_folder: bool = False) -> None:
    """Replace a file, or leave it as it was; it is on the disk when this returns.

    Args:
        path: the file.
        data: its content, text as UTF-8.
        private: only the user of this process may read it.
        make_folder: make the folder of the file where it is missing.

    Raises:
        StateError: the disk does not take it. The old file is whole, and nothing is left beside it.
    """
    mode = 0o600 if private else 0o666
    with (
        # A name of its own for each writer: two at once must not write into one draft.
        replacing(path, f".{secrets.token_hex(4)}.part", make_folder=make_folder) as draft,
        open(draft, "xb", opener=lambda name, flags: os.open(name, flags, mode)) as file,
    ):
        file.write(data.encode() if isinstance(data, str) else data)


@contextlib.contextmanager
def replacing(path: Path, ending: str = ".part", *, make_folder: bool = False) -> Iterator[Path]:
    """Give the name of a draft in the same folder, and put what was written there in the place of `path`.

    Args:
        path: the file.
        ending: of the draft's name; with the same one the next writer goes over the draft of one that was killed.
        make_folder: make the folder of the file where it is missing.

    Raises:
        StateError: as `write_whole`.
    """
    draft = path.with_name(path.name + ending)
    try:
        if make_folder:
            path.parent.mkdir(parents=True, exist_ok=True)
        yield draft
        with draft.open("rb+") as written:
            os.fsync(written.fileno())
        draft.replace(path)
        _sync_folder(path.parent)
    except BaseException as fault:
        with contextlib.suppress(OSError):
            draft.unlink()
        if isinstance(fault, OSError):
            raise StateError(f"{path}: cannot be written: {fault.strerror or fault}") from fault
        raise


def remove_drafts(folder: Path) -> None:
    """Remove what killed writers have left behind in a folder; drafts that may still be written stay."""
    now_s = time.time()
    for draft in folder.glob("*.part"):
        # Another process may have finished or removed it meanwhile.
        with contextlib.suppress(OSError):
            if now_s - draft.stat().st_mtime > DRAFT_S:
                draft.unlink()


def _sync_folder(folder: Path) -> None:
    # A rename is an entry of the folder: without this it may be lost although the file itself was synchronised.
    if sys.platform != "win32":  # Windows cannot open a folder
        handle = os.open(folder, os.O_RDONLY)
        try:
            os.fsync(handle)
        finally:
            os.close(handle)
