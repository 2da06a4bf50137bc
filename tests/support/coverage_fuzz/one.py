"""One target under atheris, in its own process: `python -m support.coverage_fuzz.one TARGET [libFuzzer options]`."""

from __future__ import annotations

import importlib
import sys

import atheris

from support.coverage_fuzz.packages import PACKAGES
from support.coverage_fuzz.plain_loaders import PlainLoaders

# Compiled parsers (pydantic, Arrow, SQLite) are not seen.
_DOOR = PACKAGES[sys.argv[1]]
with PlainLoaders(_DOOR), atheris.instrument_imports(include=list(_DOOR)):
    # Also what the door loads only when it is first used.
    for _name in _DOOR:
        importlib.import_module(_name)
    from support.coverage_fuzz.run import CPU_MAX_S, judge
    from support.coverage_fuzz.targets import TARGETS

# Counting branches takes Python code three times as long; without it the fast tests judge by the limit itself.
_COUNTED = 5.0


def main() -> None:
    """Fuzz until the time is over, or to the first finding."""
    target = TARGETS[sys.argv[1]]

    def one(data: bytes) -> None:
        judge(target, data, CPU_MAX_S * _COUNTED)

    atheris.Setup([sys.argv[0], *sys.argv[2:]], one)
    atheris.Fuzz()


if __name__ == "__main__":
    main()
