"""A C compiler for the peers that need one."""

from __future__ import annotations

import os
import shutil
import subprocess
from pathlib import Path
from typing import Final

from gantryctl.errors import UsageError

# The core is compiled so too: no contraction to fused multiply-add, which would change bits and speed.
FLAGS: Final = ("-O3", "-ffp-contract=off")


def compiler() -> str:
    """The C compiler: CC, cc or gcc.

    Raises:
        UsageError: there is none.
    """
    found = os.environ.get("CC") or shutil.which("cc") or shutil.which("gcc")
    if found is None:
        raise UsageError("no C compiler: install gcc, or name one in CC")
    return found


def build(source: Path, target: Path, *more: str) -> Path:
    """Compile one C file.

    Raises:
        UsageError: no compiler, or it refuses the file.
    """
    done = subprocess.run(  # noqa: S603 - the user's own compiler, no shell
        [compiler(), *FLAGS, str(source), "-o", str(target), *more, "-lm"],
        capture_output=True,
        text=True,
        check=False,
    )
    if done.returncode:
        raise UsageError(f"{compiler()} does not compile {source.name}: {done.stderr.strip()[:400]}")
    return target


def compiler_version() -> str:
    """What the compiler says of itself, in one line; "no C compiler" without one."""
    try:
        done = subprocess.run(  # noqa: S603 - as above
            [compiler(), "--version"], capture_output=True, text=True, check=False
        )
    except (UsageError, OSError):
        return "no C compiler"
    return (done.stdout.splitlines() or ["a compiler without a version"])[0]
