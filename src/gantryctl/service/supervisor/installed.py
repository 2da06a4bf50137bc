"""Whether the program's files are those that were installed: by RECORD of its distribution (PEP 376, PEP 427)."""

from __future__ import annotations

import csv
import hashlib
from base64 import urlsafe_b64encode
from importlib.machinery import all_suffixes
from importlib.metadata import Distribution
from pathlib import Path
from typing import Final, NamedTuple

_CACHE: Final = "__pycache__"


class InstalledFiles(NamedTuple):
    """What was found.

    Attributes:
        checked: number of files with a hash.
        changed: names of those that are missing or differ, and of modules that were put among them; sorted.
    """

    checked: int
    changed: tuple[str, ...]


def check_installed(installed: Distribution, package: Path) -> InstalledFiles | None:
    """Compare the files of a distribution with its RECORD.

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
