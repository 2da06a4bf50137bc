"""Reading of a machine file: bytes to plain data; whatever the bytes are, the result is data or one `ConfigError`."""

from __future__ import annotations

import os
import re
import stat
import tomllib
from pathlib import Path
from typing import Any, Final, TypeAlias

from gantryctl.errors import ConfigError

MAX_BYTES: Final = 256 * 1024
# The TOML reader needs quadratic time for a dotted key: 256 KB of one key keep it busy for minutes (decision 0004).
MAX_LINE: Final = 500
MAX_DEPTH: Final = 8

Data: TypeAlias = dict[str, Any]

_POSITION = re.compile(r"\s*\(at (line (?P<line>\d+), column (?P<column>\d+)|end of document)\)\s*$")
_MEANING: Final = {
    "Cannot overwrite a value": "the key is given twice",
    "Cannot declare": "the table is given twice",
    "Cannot mutate immutable namespace": "the table is closed, it was given in braces or twice",
    "Duplicate inline table key": "the key is given twice",
    "Invalid value": 'not a value; text stands in "quotes", a number has digits on both sides of its point',
    "Expected '=' after a key": "a key needs '=' and a value",
    "Invalid statement": "neither a key, a [table] nor a # comment",
}


def printable(text: object, longest: int = 80) -> str:
    """Make text safe for one line of a terminal or a log: nothing unprintable, at most `longest` long."""
    short = str(text)
    if len(short) > longest:
        short = short[: longest - 3] + "..."
    return "".join(
        c if c.isprintable() else c.encode("unicode_escape", "surrogatepass").decode() for c in short
    )


def read_text(path: Path, when_missing: str = "; `gantryctl config init` writes one to start from") -> str:
    """Read a file as text; never more than the permitted size, never from a device or a pipe.

    Args:
        path: the file. when_missing: what to do when there is none, the end of the message.
    """
    name = printable(path, 300)
    try:
        if not stat.S_ISREG(os.stat(path).st_mode):
            raise ConfigError([f"{name}: is not a file"])
        with open(path, "rb") as file:
            raw = file.read(MAX_BYTES + 1)
    except FileNotFoundError:
        raise ConfigError([f"{name}: does not exist{when_missing}"]) from None
    except (OSError, ValueError) as error:
        reason = error.strerror if isinstance(error, OSError) and error.strerror else error
        raise ConfigError([f"{name}: cannot be read: {printable(reason)}"]) from None
    return _decode(raw, name)


def _decode(raw: bytes, name: str) -> str:
    if len(raw) > MAX_BYTES:
        raise ConfigError([f"{name}: is larger than {MAX_BYTES // 1024} KB, so it is no file of this kind"])
    if raw.startswith((b"\xff\xfe", b"\xfe\xff")):
        raise ConfigError([f"{name}: is UTF-16 text, as its byte-order mark says; save it as UTF-8"])
    if b"\0" in raw:
        raise ConfigError([f"{name}: is binary (a zero byte at {raw.index(0)}), not a TOML text"])
    try:
        # Editors of Windows put a byte-order mark before UTF-8.
        return raw.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        line = raw.count(b"\n", 0, error.start) + 1
        raise ConfigError([f"{name}: line {line}: byte 0x{raw[error.start]:02x} is not UTF-8 text"]) from None


def parse_toml(text: str, name: str) -> Data:
    """Parse TOML text into tables, numbers, strings and arrays of bounded depth."""
    name = printable(name, 300)
    try:
        text = _decode(text.encode("utf-8"), name)
    except UnicodeEncodeError:
        raise ConfigError([f"{name}: is not a text that UTF-8 can hold"]) from None
    for number, line in enumerate(text.split("\n"), start=1):
        if len(line) > MAX_LINE:
            raise ConfigError([f"{name}: line {number} has {len(line)} characters, allowed {MAX_LINE}"])
    try:
        data = tomllib.loads(text)
    except tomllib.TOMLDecodeError as error:
        raise ConfigError([_syntax_problem(error, text, name)]) from None
    except RecursionError:
        raise ConfigError([f"{name}: is nested deeper than {MAX_DEPTH} levels"]) from None
    except ValueError as error:
        raise ConfigError([f"{name}: {printable(error, 200)}"]) from None
    if _deeper_than(data, MAX_DEPTH):
        raise ConfigError([f"{name}: is nested deeper than {MAX_DEPTH} levels"])
    return data


def _syntax_problem(error: tomllib.TOMLDecodeError, text: str, name: str) -> str:
    message = str(error)
    position = _POSITION.search(message)
    what = message[: position.start()] if position else message
    meanings = (meaning for words, meaning in _MEANING.items() if what.startswith(words))
    what = printable(next(meanings, what), 200)
    lines = text.rstrip().split("\n")
    if position is None or position["line"] is None:  # at the end
        return f"{name}: line {len(lines)}: {what}: {printable(lines[-1].strip())}"
    number = int(position["line"])
    line = printable(lines[number - 1].strip()) if number <= len(lines) else ""
    return f"{name}: line {number}, column {position['column']}: {what}: {line}"


def _deeper_than(data: Data, depth: int) -> bool:
    """Whether tables and arrays are nested deeper than `depth`; walks level by level, without recursion."""
    level: list[Any] = [data]
    for _ in range(depth):
        inside = (outer.values() if isinstance(outer, dict) else outer for outer in level)
        level = [inner for items in inside for inner in items if isinstance(inner, dict | list)]
        if not level:
            return False
    return True
