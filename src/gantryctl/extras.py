"""Packages that come with an extra of this program: which extra brings one, and what to type when it is missing."""

from __future__ import annotations

from importlib.util import find_spec
from typing import Final

from gantryctl.errors import UsageError

EXTRA_OF: Final = {
    "matplotlib": "reports",
    "scipy": "reports",
    "dask": "cluster",
    "distributed": "cluster",
    "asyncua": "opcua",
    "pandas": "notebook",
    "polars": "notebook",
}
"""Extra by package, as in pyproject.toml; packages of `bench` are left out by the comparison itself."""


class ExtraMissing(UsageError):
    """A package that an extra brings is not installed; the message has the command that installs it."""

    def __init__(self, package: str) -> None:
        super().__init__(f'{package} is not installed; type: pip install "gantryctl[{EXTRA_OF[package]}]"')


def need(*packages: str) -> None:
    """Check for packages of extras before a command begins its work, not when it comes to need them.

    Raises:
        ExtraMissing: one of them is not installed.
    """
    for package in packages:
        if find_spec(package) is None:
            raise ExtraMissing(package)
