"""The reference page of the service: `python -m gantryctl.service.protocol.service_page FILE` writes it.

Its prose is `service_page.md` beside this file, with places for tables and numbers of the protocol.
"""

from __future__ import annotations

import sys
from collections.abc import Iterable, Sequence
from pathlib import Path
from string import Template
from typing import Any, Final

from gantryctl.machine import default_machine
from gantryctl.program.alarms.service import SERVICE
from gantryctl.service.protocol import limits
from gantryctl.service.protocol.messages import COMMON, KEPT_FIRST, MESSAGES, SILENT
from gantryctl.service.protocol.roles import RIGHTS, Role
from gantryctl.service.protocol.tags import ALARM_ROW, TAGS, Tag

_YES: Final = {True: "yes", False: "-"}
# As shipped: `[monitors] lease_ms`.
_LEASE_S: Final = default_machine().monitors.lease_ms * 1e-3
_NUMBERS: Final = {
    "message_kib": limits.MESSAGE_MAX // 1024,
    "frame_ms": round(limits.FRAME_S * 1e3),
    "renew_ms": round(limits.RENEW_S * 1e3),
    "stale_ms": round(limits.STALE_S * 1e3),
    "key_frame_ms": round(limits.KEY_FRAME_S * 1e3),
    "view_max_ms": round(limits.VIEW_MAX_S * 1e3),
    "lease_ms": round(_LEASE_S * 1e3),
    "key_view_max_ms": round(limits.key_limits(_LEASE_S).view_max_s * 1e3),
    "round_trip_max_ms": round(limits.key_limits(_LEASE_S).round_trip_max_s * 1e3),
    "commands_per_s": round(limits.COMMANDS_PER_S),
    "silence_s": round(limits.SILENCE_S),
    "held_s": round(limits.HELD_S),
    "armed_s": round(limits.ARMED_S),
    "link_s": f"{limits.LINK_S:g}",
    "keep_s": f"{limits.KEEP_S:g}",
}


def reference_page() -> str:
    """Write the page."""
    prose = Template(Path(__file__).with_suffix(".md").read_text(encoding="utf-8"))
    alarms = _table(("key", "meaning"), ((f"`{key}`", row.meaning) for key, row in ALARM_ROW.items()))
    parts = {"tags": _tags(), "alarms": alarms, "messages": _messages(), "codes": _codes(), "roles": _roles()}
    return prose.substitute(_NUMBERS, **parts)


def _table(head: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    lines = [head, *rows]
    lines.insert(1, ["---"] * len(head))
    # The ruler stands without spaces, as everywhere in the documents.
    return "".join(f"|{'|'.join(row)}|\n" if row[0] == "---" else f"| {' | '.join(row)} |\n" for row in lines)


def _tags() -> str:
    rows = (
        (f"`{tag.name}`", tag.unit or "-", _kind(tag), tag.direction, tag.rate, tag.role, _meaning(tag))
        for tag in TAGS
    )
    return _table(("name", "unit", "type", "direction", "rate", "role", "meaning"), rows)


def _kind(tag: Tag) -> str:
    return f"{tag.kind} or null" if tag.null else tag.kind


def _meaning(tag: Tag) -> str:
    return f"{tag.meaning} One of: {', '.join(tag.labels)}." if tag.labels else tag.meaning


def _messages() -> str:
    definitions = MESSAGES.json_schema()["$defs"].values()
    rows = (
        (
            f"`{keys['type']['const']}`",
            _keys(keys, each["required"]),
            _waits(keys["type"]["const"]),
            " ".join(each["description"].split()),
        )
        for each in definitions
        for keys in [each["properties"]]
    )
    return _table(("type", "more keys", "kept first", "does"), sorted(rows))


def _waits(kind: str) -> str:
    if kind in SILENT:
        return "no reply"
    return "on: yes, off: -" if kind == "power" else _YES[kind in KEPT_FIRST]


def _keys(properties: dict[str, Any], required: list[str]) -> str:
    words = {
        name: each.get("description") or ", ".join(each.get("enum", ())) or each["type"]
        for name, each in properties.items()
        if name not in COMMON
    }
    left_out = {name: "" if name in required else " (may be left out)" for name in words}
    return "; ".join(f"`{name}`{left_out[name]}: {text}" for name, text in words.items()) or "-"


def _codes() -> str:
    rows = ((row.code, f"{row.english.title}: {row.english.cause}") for row in SERVICE)
    return _table(("code", "why"), rows)


def _roles() -> str:
    rows = (
        (f"`{action}`", right.words, *(_YES[role in right.roles] for role in Role), _YES[right.control])
        for action, right in RIGHTS.items()
    )
    return _table(("action", "what", *Role, "control"), rows)


if __name__ == "__main__":
    Path(sys.argv[1]).write_text(reference_page(), encoding="utf-8")
