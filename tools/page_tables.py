"""Write the tables of the service as TypeScript: tags, roles, commands; and the Chinese of all codes.

    python tools/page_tables.py hmi/src/lib      # tables.ts and codes.ts

The page is type-checked against it, so a tag that is renamed in Python breaks the build of the page.
"""

import json
import sys
from collections.abc import Iterator
from pathlib import Path
from string import Formatter
from typing import Any

from gantryctl.program import ALARMS, Code
from gantryctl.program.alarms.words import Words
from gantryctl.service.protocol.messages import MESSAGES
from gantryctl.service.protocol.roles import RIGHTS, Action, Role
from gantryctl.service.protocol.tags import ALARM_ROW, TAGS, Tag

HEADER = "// Written by tools/page_tables.py; do not edit, a test compares.\n"
NUMBERS = {"float": "number", "int": "number", "bool": "boolean", "text": "string", "rows": "AlarmRow[]"}
NUMBERS["pairs"] = "[number, number][]"
NUMBERS["messages"] = "Message[]"
NUMBERS["values"] = "Values"
# What the page refuses itself, before it sends a target: the codes of the service, in its words.
_REFUSED = (Code.CTL_01, Code.CTL_09, Code.CTL_18)
_REFUSED_WORDS = (Words.NAME_TARGET, Words.WITHIN_TRAVEL, Words.ANGLE, Words.NO_WAY_ROUND, Words.WAY_ROUND)
_MESSAGE = """\
/** A code or words with values, a reason against power, or a text that has none. */
export type Message =
  | { code: string; values: Values }
  | { reason: string; values: Values }
  | { words: string; values: Values }
  | string;
export type Values = Record<string, number | Message | Message[]>;
"""


def _union(words: tuple[str, ...]) -> str:
    return " | ".join(f"'{word}'" for word in words)


def _type(tag: Tag) -> str:
    return f"{_union(tag.labels)}" if tag.kind == "enum" else NUMBERS[tag.kind]


def _tags() -> Iterator[str]:
    yield "export interface AlarmRow {"
    for key, row in ALARM_ROW.items():
        null = " | null" if row.null else ""
        yield f"  /** {row.meaning} */\n  {key}: {NUMBERS[row.kind]}{null};"
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


def _with_formats(english: str, chinese: str) -> str:
    """The Chinese template with the number formats of the English one."""
    formats = {name: digits for _, name, digits, _ in Formatter().parse(english) if name and digits}
    for name, digits in formats.items():
        chinese = chinese.replace(f"{{{name}}}", f"{{{name}:{digits}}}")
    return chinese


def _codes() -> Iterator[str]:
    yield "/** Chinese of every code: title, message, cause, what to do. English comes from the service. */"
    yield "export const CODES: Record<string, Record<'title' | 'message' | 'cause' | 'to_do', string>> = {"
    for code, row in ALARMS.items():
        texts = row.chinese._replace(message=_with_formats(row.english.message, row.chinese.message))
        yield f"  '{code}': {json.dumps(texts._asdict(), ensure_ascii=False)},"
    yield "};\n\n/** Chinese of the words that stand in messages. */"
    yield "export const WORDS: Record<string, string> = {"
    for words in Words:
        yield f"  {words.name}: {json.dumps(_with_formats(words.english, words.chinese), ensure_ascii=False)},"
    yield "};\n\n/** English of what the page itself refuses: codes, and the words that stand in them. */"
    yield "export const ENGLISH: Record<string, string> = {"
    english = {code.value: ALARMS[code].english.message for code in _REFUSED}
    for name, text in (english | {words.name: words.english for words in _REFUSED_WORDS}).items():
        yield f"  '{name}': {json.dumps(text)},"
    yield "};\n"


def _messages() -> Iterator[str]:
    """Commands from the JSON schema of the messages; the link adds the keys of every message."""
    yield "/** Commands with the keys that are theirs; the link adds type, seq, frame and epoch. */"
    yield "export interface Commands {"
    timeless = []
    for schema in MESSAGES.json_schema()["$defs"].values():
        keys = schema["properties"]
        kind = keys["type"]["const"]
        asked = schema["required"]
        own = [
            f"{name}{'' if name in asked else '?'}: {_ts(keys[name])}"
            for name in keys
            if name not in ("type", "seq", "frame", "epoch")
        ]
        yield f"  {kind}: {{ {'; '.join(own)} }};" if own else f"  {kind}: Record<string, never>;"
        if "epoch" not in schema["required"]:
            timeless.append(kind)
    yield "}\n\n/** Never too late: sent without an epoch. */"
    yield f"export const WITHOUT_EPOCH = new Set<keyof Commands>({json.dumps(timeless)});\n"


def _ts(schema: dict[str, Any]) -> str:
    if "enum" in schema:
        return _union(tuple(schema["enum"]))
    return "number" if schema["type"] == "integer" else str(schema["type"])


def texts() -> dict[str, str]:
    """The files by name."""
    return {
        "tables.ts": "\n".join([HEADER, _MESSAGE, *_tags(), *_roles(), *_messages()]),
        "codes.ts": "\n".join([HEADER, *_codes()]),
    }


if __name__ == "__main__":
    for name, text in texts().items():
        (Path(sys.argv[1]) / name).write_text(text, encoding="utf-8")
