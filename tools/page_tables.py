"""Write the tables of the service as TypeScript: tags, enums, actions and roles; and its sentences in Chinese.

    python tools/page_tables.py hmi/src/lib      # tables.ts and phrases.ts

The page is type-checked against it, so a tag that is renamed in Python breaks the build of the page.
"""

import json
import sys
from collections.abc import Iterator
from pathlib import Path

from gantryctl.service.protocol.chinese import phrases
from gantryctl.service.protocol.roles import RIGHTS, Action, Role
from gantryctl.service.protocol.tags import ALARM_ROW, TAGS, Tag

HEADER = "// Written by tools/page_tables.py; do not edit, a test compares.\n"
NUMBERS = {"float": "number", "int": "number", "bool": "boolean", "text": "string", "rows": "AlarmRow[]"}
ROW_TYPES = {"id": "number", "time_s": "number", "pos_act_deg": "number", "active": "boolean"}
ROW_TYPES |= {"first_out": "boolean", "lock": "boolean"}


def _union(words: tuple[str, ...]) -> str:
    return " | ".join(f"'{word}'" for word in words)


def _type(tag: Tag) -> str:
    return f"{_union(tag.labels)}" if tag.kind == "enum" else NUMBERS[tag.kind]


def _tags() -> Iterator[str]:
    yield "export interface AlarmRow {"
    for key, meaning in ALARM_ROW.items():
        yield f"  /** {meaning} */\n  {key}: {ROW_TYPES.get(key, 'string')};"
    yield "}\n\nexport interface Tags {"
    for tag in TAGS:
        unit = f" [{tag.unit}]" if tag.unit else ""
        yield f"  /** {tag.meaning}{unit} */\n  {tag.name}: {_type(tag)} | null;"
    yield "}\n"


def _roles() -> Iterator[str]:
    yield f"export type Role = {_union(tuple(Role))};"
    yield f"export type Action = {_union(tuple(Action))};\n"
    yield "/** Who may do what, and whether it needs the control authority. */"
    yield "export const ROLES: Role[] = " + json.dumps(list(Role)) + ";"
    yield "export const RIGHTS: { action: Action; what: string; roles: Role[]; control: boolean }[] = ["
    for action in Action:
        right = RIGHTS[action]
        roles = json.dumps([role for role in Role if role in right.roles])
        control = "true" if right.control else "false"
        yield f"  {{ action: '{action}', what: {json.dumps(right.words)}, roles: {roles}, control: {control} }},"
    yield "];\n"


def _phrases() -> Iterator[str]:
    yield "/** Sentences of the service in Chinese, written in src/gantryctl/service/protocol/chinese.py. */"
    yield "export const PHRASES: Record<string, string> = {"
    for english, chinese in phrases().items():
        yield f"  {json.dumps(english)}: {json.dumps(chinese, ensure_ascii=False)},"
    yield "};\n"


def texts() -> dict[str, str]:
    """The files by name."""
    return {
        "tables.ts": "\n".join([HEADER, *_tags(), *_roles()]),
        "phrases.ts": "\n".join([HEADER, *_phrases()]),
    }


if __name__ == "__main__":
    for name, text in texts().items():
        (Path(sys.argv[1]) / name).write_text(text, encoding="utf-8")
