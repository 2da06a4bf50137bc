"""Python's own loader for the packages of a door, in place of the one that an editable install puts around it.

atheris counts the branches of what it can load itself. scikit-build-core wraps the loaders of an editable install, and
behind a wrapper atheris counts nothing: a run of ten minutes then is ten minutes of chance.
"""

from __future__ import annotations

import sys
from collections.abc import Sequence
from importlib.abc import MetaPathFinder
from importlib.machinery import ModuleSpec, SourceFileLoader
from types import ModuleType


class PlainLoaders:
    """For a `with` block: finders that wrap loaders hand out plain ones for these packages.

    Args:
        packages: names; what lies below them is theirs too. Others keep the loader that they have.
    """

    def __init__(self, packages: Sequence[str]) -> None:
        self._packages = tuple(packages)
        self._before: list[object] = []

    def __enter__(self) -> None:
        self._before = list(sys.meta_path)
        sys.meta_path[:] = [
            _Unwrapped(finder, self._packages) if "ScikitBuild" in type(finder).__name__ else finder
            for finder in sys.meta_path
        ]

    def __exit__(self, *_: object) -> None:
        sys.meta_path[:] = self._before


class _Unwrapped(MetaPathFinder):
    def __init__(self, finder: MetaPathFinder, packages: Sequence[str]) -> None:
        self._finder, self._packages = finder, packages

    def find_spec(
        self, fullname: str, path: Sequence[str] | None, target: ModuleType | None = None
    ) -> ModuleSpec | None:
        spec = self._finder.find_spec(fullname, path, target)
        counted = any(fullname == name or fullname.startswith(f"{name}.") for name in self._packages)
        if spec is not None and counted and spec.origin is not None and spec.origin.endswith(".py"):
            spec.loader = SourceFileLoader(fullname, spec.origin)
        return spec
