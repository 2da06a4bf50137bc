"""Text of an EDS or DCF: bytes to sections and keys, each with its line.

Tolerant of careless files (encoding, stray lines, doubled keys), strict about anything that is not an EDS.
"""

from __future__ import annotations

import re
from dataclasses import dataclass, field
from typing import Final, NamedTuple

from gantryctl.drives.od.model import EdsError, Note

# Our own parser instead of configparser, which stops at the first doubled key and forgets lines, or canopen's
# import_od: nine of twelve usable files with the habits of real ones failed there or came out wrong, and no error
# named a line (decision 0008).
MAX_BYTES: Final = 1_000_000
_SHOWN: Final = 40
_LINE_END: Final = re.compile(r"\r\n|\r|\n")
_UTF16: Final = (b"\xff\xfe", b"\xfe\xff")


class Key(NamedTuple):
    """Text behind `name =`, and its line."""

    text: str
    line: int


@dataclass(slots=True)
class Section:
    """Section with its keys by lower-case name."""

    # Of a doubled key the first counts, as Windows reads INI files (decision 0008).

    name: str
    line: int
    keys: dict[str, Key] = field(default_factory=dict)

    def text(self, key: str) -> str:
        """Text of a key; empty for a missing key."""
        found = self.keys.get(key.lower())
        return found.text if found else ""

    def line_of(self, key: str) -> int:
        """Line of a key; that of the section for a missing key."""
        found = self.keys.get(key.lower())
        return found.line if found else self.line


class Notes:
    """Collection of oddities, bounded for a file full of them."""

    limit: Final = 200

    def __init__(self) -> None:
        self.found: list[Note] = []
        self.more = 0

    def add(self, line: int, text: str) -> None:
        """Add one oddity."""
        if len(self.found) < self.limit:
            self.found.append(Note(line, text))
        else:
            self.more += 1

    def all(self) -> tuple[Note, ...]:
        """All oddities in the order of lines."""
        rest = [Note(0, f"{self.more} more oddities")] if self.more else []
        return (*sorted(self.found, key=lambda note: note.line), *rest)


def read_sections(data: bytes, source: str, notes: Notes) -> dict[str, Section]:
    """Sections by lower-case name without blanks, in the order of the file.

    Raises:
        EdsError: empty, too large, binary, XML, or without any section.
    """
    if len(data) > MAX_BYTES:
        raise EdsError(source, 0, f"{len(data)} bytes; an EDS of more than {MAX_BYTES} bytes is not read")
    text = _decoded(data, source, notes)
    if not text.strip():
        raise EdsError(source, 0, "the file is empty")
    sections: dict[str, Section] = {}
    current: Section | None = None
    for number, raw in enumerate(_LINE_END.split(text), start=1):
        line = raw.strip()
        if not line or line[0] in ";#":
            continue
        if line[0] == "[":
            current = _open_section(line, number, sections, notes)
        elif current is None:
            _before_first_section(line, number, source, notes)
        else:
            _add_key(line, number, current, notes)
    if not sections:
        raise EdsError(source, 1, "no EDS: there is no [section] in it")
    return sections


def _decoded(data: bytes, source: str, notes: Notes) -> str:
    if data.startswith(_UTF16):
        notes.add(1, "written in UTF-16; CiA 306 asks for ASCII")
        return data.decode("utf-16", errors="replace")
    if b"\0" in data:
        line = data.count(b"\n", 0, data.index(b"\0")) + 1
        raise EdsError(source, line, "no EDS: binary data")
    try:
        return data.decode("utf-8-sig")
    except UnicodeDecodeError as wrong:
        line = data.count(b"\n", 0, wrong.start) + 1
        notes.add(line, f"byte {data[wrong.start]:02X} is not UTF-8; the file is read as Windows-1252")
        return data.decode("cp1252", errors="replace")


def _open_section(line: str, number: int, sections: dict[str, Section], notes: Notes) -> Section:
    name, closed, _ = line[1:].partition("]")
    if not closed:
        notes.add(number, f"{shown(line)}: the ] is missing")
    key = "".join(name.split()).lower()
    if key in sections:
        notes.add(
            number, f"[{name.strip()}] is there twice (first in line {sections[key].line}); read as one"
        )
        return sections[key]
    sections[key] = Section(name.strip(), number)
    return sections[key]


def _before_first_section(line: str, number: int, source: str, notes: Notes) -> None:
    if line[0] == "<":
        raise EdsError(source, number, "no EDS: this looks like XML (an XDD is not read; ask for the EDS)")
    if notes.found and len(notes.found) > 20:
        raise EdsError(source, number, f"no EDS: expected a [section], found {shown(line)}")
    notes.add(number, f"{shown(line)} stands before the first [section]; ignored")


def _add_key(line: str, number: int, section: Section, notes: Notes) -> None:
    name, equals, text = line.partition("=")
    if not equals:
        if section.name.lower() != "comments":
            notes.add(number, f"{shown(line)} is no key=value; ignored")
        return
    key = "".join(name.split()).lower()
    value = _without_comment(text)
    if key in section.keys:
        if section.keys[key].text != value:
            first = section.keys[key]
            notes.add(
                number, f"{name.strip()} is there twice; {shown(first.text)} of line {first.line} counts"
            )
        return
    section.keys[key] = Key(value, number)


def _without_comment(text: str) -> str:
    for blank in (" ;", "\t;"):
        text = text.partition(blank)[0]
    text = text.strip()
    return text[1:-1] if len(text) > 1 and text[0] == text[-1] == '"' else text


def shown(text: str) -> str:
    """Excerpt of a foreign file for a message, short and printable."""
    clean = "".join(c if c.isprintable() else "?" for c in text)
    return repr(clean if len(clean) <= _SHOWN else clean[:_SHOWN] + "...")
