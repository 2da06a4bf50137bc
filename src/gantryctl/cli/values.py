"""Types of arguments and options: names of files, finite numbers, whole numbers."""

from __future__ import annotations

import os
import re
import shutil
import sys
from collections.abc import Callable, Mapping
from pathlib import Path
from tempfile import TemporaryDirectory
from types import MappingProxyType
from typing import Any, Final

import click

_STANDARD_INPUT: Final = "-"
_STANDARD_INPUT_NAME: Final = "standard input"
# Where the context of a command line notes that standard input was read.
_TAKEN: Final = "gantryctl.standard_input"
# Python's float() and int() read other scripts' digits and "1_0" as well; a typing error must not become a motion.
_NUMBER: Final = re.compile(r"[+-]?([0-9]+\.?[0-9]*|\.[0-9]+)([eE][+-]?[0-9]+)?")
_WHOLE: Final = re.compile(r"[+-]?[0-9]{1,18}[0-9]?")


def number_of(text: str) -> float:
    """Number in decimal digits 0 to 9, with a point, perhaps with an exponent; it may be infinite.

    Raises:
        ValueError: the text is no such number.
    """
    if not _NUMBER.fullmatch(text):
        raise ValueError(text)
    return float(text)


class NamedPath(click.Path):
    """A file or directory name that can be printed and stored: not empty, and in the system's encoding."""

    # click takes any bytes: a lone surrogate or a NUL would raise deep inside a command, not at the option.

    def convert(
        self, value: str | os.PathLike[str], param: click.Parameter | None, ctx: click.Context | None
    ) -> Path:
        """The path, or a usage error that names it."""
        name = os.fspath(value)
        if not name:
            self.fail("an empty name", param, ctx)
        if "\0" in name or name != name.encode(errors="ignore").decode():
            self.fail(f"{name!a} is not a name in UTF-8", param, ctx)
        return Path(name)


PATH = NamedPath()


class InputPath(NamedPath):
    """Name of a file that is read; `-` is standard input.

    Args:
        words: what else may stand for a file, and where that file is.
    """

    # Standard input goes into a file that lives as long as the command: what reads a recording, a table or a machine
    # file reads a name, jumps about in it, and says it in its messages.

    def __init__(self, words: Mapping[str, Callable[[], Path]] = MappingProxyType({})) -> None:
        super().__init__()
        self._words = words

    def convert(
        self, value: str | os.PathLike[str], param: click.Parameter | None, ctx: click.Context | None
    ) -> Path:
        """The path, or a usage error that names it."""
        stands_for = self._words.get(os.fspath(value))
        if stands_for is not None:
            return stands_for()
        if value != _STANDARD_INPUT or ctx is None:
            return super().convert(value, param, ctx)
        root = ctx.find_root()
        if root.meta.get(_TAKEN):
            self.fail("standard input can be read once only", param, ctx)
        root.meta[_TAKEN] = True
        if sys.stdin is None:
            self.fail("standard input is closed", param, ctx)
        path = Path(root.with_resource(TemporaryDirectory(prefix="gantryctl-"))) / _STANDARD_INPUT_NAME
        with path.open("wb") as file:
            shutil.copyfileobj(sys.stdin.buffer, file)
        return path


INPUT = InputPath()


def check_lasting(path: Path | None, what: str) -> None:
    """Refuse standard input where a file is written beside the one that was read, or is read again later.

    Raises:
        UsageError: it is standard input.
    """
    from gantryctl.errors import UsageError

    if path is not None and path.name == _STANDARD_INPUT_NAME:
        raise UsageError(f"{what}: standard input has no place; give the name of a file")


class LogPath(NamedPath):
    """Name of a log of a bus that is to be written."""

    def convert(
        self, value: str | os.PathLike[str], param: click.Parameter | None, ctx: click.Context | None
    ) -> Path:
        """The path, or a usage error that names the formats."""
        from gantryctl.errors import UsageError
        from gantryctl.trace.frames.files import check_log_name

        try:
            return check_log_name(super().convert(value, param, ctx))
        except UsageError as wrong:
            self.fail(str(wrong), param, ctx)


class FiniteFloat(click.ParamType[float]):
    """A number that is neither nan nor inf."""

    # Python reads "nan" and "1e400" as floats, and no comparison with a limit catches the first.

    name = "number"

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> float:
        """The number, or a usage error that names it."""
        import math

        try:
            number = number_of(value) if isinstance(value, str) else float(value)
        except (TypeError, ValueError):
            if value in ("nan", "inf", "-inf", "+inf", "-nan", "infinity", "-infinity"):
                self.fail(f"{value!r} is not a finite number", param, ctx)
            self.fail(f"{value!a} is not a number", param, ctx)
        if not math.isfinite(number):
            self.fail(f"{value!r} is not a finite number", param, ctx)
        return number


FINITE = FiniteFloat()


class Whole(click.IntRange):
    """A whole number in a range."""

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> Any:
        """The number, or a usage error that names it."""
        if isinstance(value, str) and not _WHOLE.fullmatch(value):
            self.fail(f"{value!a} is not a whole number", param, ctx)
        return super().convert(value, param, ctx)
