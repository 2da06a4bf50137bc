"""Write the tags of the service as typed Python: `python tools/client_tags.py src/gantryctl/client/tags.py`.

A program that reads a tag which is renamed here does not pass its type check any more.
"""

import sys
import textwrap
from collections.abc import Iterator
from pathlib import Path

from gantryctl.service.protocol.tags import ALARM_ROW, TAGS, Tag

HEAD = '''"""Tags of the service by name. Written by tools/client_tags.py; do not edit, a test compares."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, fields
from functools import cache
from typing import Any, Literal, TypedDict

from gantryctl.errors import DeviceError

'''
TAIL = '''
    @classmethod
    def of(cls, values: Mapping[str, Any]) -> Tags:
        """Make them of what the service sends; tags that this version does not know are left out.

        Raises:
            DeviceError: the service lacks one: it is of another version.
        """
        try:
            return cls(**{name: values[name] for name in _names()})
        except KeyError as missing:
            version = values.get("version", "unknown")
            raise DeviceError(f"the service has no tag {missing}: it is of version {version}") from None


@cache
def _names() -> tuple[str, ...]:
    return tuple(field.name for field in fields(Tags))
'''
TYPES = {"float": "float", "int": "int", "bool": "bool", "text": "str", "pairs": "list[list[float]]"}
TYPES |= {"rows": "list[AlarmRow]", "messages": "list[Message]", "values": "dict[str, Any]"}


def module() -> str:
    """Return the text of the module."""
    return HEAD + "\n".join([*_alarm_row(), "", "", *_tags()]) + "\n" + TAIL


def _alarm_row() -> Iterator[str]:
    yield "# A code, a reason or words with values, or English without."
    yield "Message = str | dict[str, Any]\n\n"
    yield "class AlarmRow(TypedDict):"
    yield '    """Row of `alarms` and `alarm_history`."""\n'
    for key, row in ALARM_ROW.items():
        yield f"    {key}: {TYPES[row.kind]}{' | None' if row.null else ''}"
        yield from _doc(_sentence(row.meaning))


def _tags() -> Iterator[str]:
    yield "@dataclass(frozen=True, slots=True)"
    yield "class Tags:"
    yield '    """What the service shows in one status frame; None is unknown, not believed, or not fitted."""\n'
    for tag in TAGS:
        yield from _field(tag)


def _field(tag: Tag) -> Iterator[str]:
    kind = TYPES.get(tag.kind, "str")
    if tag.labels:
        words = ", ".join(f'"{word}"' for word in tag.labels)
        kind = f"Literal[{words}]"
        if len(kind) + len(tag.name) > 100:
            kind = "Literal[\n" + "".join(f'        "{word}",\n' for word in tag.labels) + "    ]"
    yield f"    {tag.name}: {kind}{' | None' if tag.null else ''}"
    unit = f" [{tag.unit}]" if tag.unit else ""
    yield from _doc(tag.meaning.replace("null", "None") + unit)


def _sentence(words: str) -> str:
    return words[0].upper() + words[1:] + "."


def _doc(words: str) -> Iterator[str]:
    lines = textwrap.wrap(
        f'"""{words}"""', 104, initial_indent="    ", subsequent_indent="    ", break_long_words=False
    )
    yield from lines


if __name__ == "__main__":
    Path(sys.argv[1]).write_text(module(), encoding="utf-8")
