"""Where the C++ compiler of the package index is: it builds for any processor, and for the browser."""

from __future__ import annotations

import importlib.util
from pathlib import Path


def zig() -> Path:
    """The program of the package `ziglang` in this environment.

    Raises:
        SystemExit: it is not installed.
    """
    found = importlib.util.find_spec("ziglang")
    if found is None or found.origin is None:
        raise SystemExit("ziglang is not installed: pip install --require-hashes -r requirements/dist.txt")
    return Path(found.origin).parent / "zig"
