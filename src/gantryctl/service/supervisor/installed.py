"""Whether the program's files are those that were installed: by RECORD of its distribution (PEP 376, PEP 427)."""

from __future__ import annotations

import csv
import hashlib
import marshal
import struct
from base64 import urlsafe_b64encode
from collections.abc import Callable
from importlib.machinery import all_suffixes
from importlib.metadata import Distribution
from importlib.util import MAGIC_NUMBER, cache_from_source
from pathlib import Path
from typing import Final, NamedTuple

_CACHE: Final = "__pycache__"
# Magic number, flags, then time and size of the source or its hash (PEP 552).
_HEAD: Final = struct.Struct("<4sIII")


class InstalledFiles(NamedTuple):
    """What was found.

    Attributes:
        checked: number of files with a hash.
        changed: names of those that are missing or differ, of compiled copies that differ from their source, and of
            modules that were put among them; sorted.
    """

    checked: int
    changed: tuple[str, ...]


def check_installed(
    installed: Distribution, package: Path, watch: Callable[[float], None] = lambda part: None
) -> InstalledFiles | None:
    """Compare the files of a distribution with its RECORD; `watch` is told the part that is done, 0 to 1.

    None when there is nothing to compare with: `package`, the folder that runs, is no part of it (sources, or an
    editable install), or it has no RECORD.
    """
    root = Path(str(installed.locate_file("")))
    recorded = {
        row[0]: row[1] for row in csv.reader((installed.read_text("RECORD") or "").splitlines()) if row
    }
    first = root / package.name / "__init__.py"
    if (
        f"{package.name}/__init__.py" not in recorded
        or not first.exists()
        or not first.samefile(package / first.name)
    ):
        return None
    hashed = {name: digest for name, digest in recorded.items() if digest}
    changed = {name for name, digest in hashed.items() if _digest(root / name) != digest}
    # Python runs the compiled copy of a source, and RECORD has no hash of it.
    alike = hashed.keys() - changed
    for number, name in enumerate(alike, 1):
        watch(number / len(alike))
        if name.endswith(".py") and name.startswith(f"{package.name}/"):
            copy = Path(cache_from_source(str(root / name)))
            if not _compiled_from(root / name, copy):
                changed.add(copy.relative_to(root).as_posix() if copy.is_relative_to(root) else str(copy))
    # A module that is not in RECORD may be found before the one that is: an extension comes before a source.
    suffixes = tuple(all_suffixes())
    for path in package.rglob("*"):
        name = path.relative_to(package.parent).as_posix()
        if path.name.endswith(suffixes) and path.parent.name != _CACHE and name not in hashed:
            changed.add(name)
    return InstalledFiles(len(hashed), tuple(sorted(changed)))


def _digest(path: Path) -> str:
    """As RECORD writes it; empty for a file that cannot be read."""
    try:
        digest = hashlib.sha256(path.read_bytes()).digest()
    except OSError:
        return ""
    return f"sha256={urlsafe_b64encode(digest).rstrip(b'=').decode()}"


def _compiled_from(source: Path, copy: Path) -> bool:
    """Whether a compiled copy, if Python would run it, is what its source gives."""
    try:
        text, data, found = source.read_bytes(), copy.read_bytes(), source.stat()
    except OSError:
        return True  # there is none
    if len(data) < _HEAD.size:
        return True
    magic, flags, changed_s, size = _HEAD.unpack_from(data)
    stale = not flags and (changed_s, size) != (int(found.st_mtime) & 0xFFFFFFFF, found.st_size & 0xFFFFFFFF)
    if magic != MAGIC_NUMBER or stale:
        return True  # Python compiles the source again
    try:
        ran = marshal.loads(data[_HEAD.size :])  # noqa: S302 - what an import would read anyway
    except (EOFError, ValueError, TypeError):
        return False
    return bool(ran == compile(text, str(source), "exec", dont_inherit=True))
