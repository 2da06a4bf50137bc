"""The reference page of the service: `python -m gantryctl.service.protocol.service_page FILE` writes it."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Final

from gantryctl.service.protocol.reference_text import HEAD, HTTP, SOCKET
from gantryctl.service.protocol.roles import MAY, NEEDS_AUTHORITY, WORDS, Role
from gantryctl.service.protocol.tags import ALARM_ROW, TAGS, Tag

_YES: Final = {True: "yes", False: "-"}


def reference_page() -> str:
    """The whole page."""
    return "\n".join([HEAD, _tags(), _alarm_row(), SOCKET, HTTP, _roles()])


def _tags() -> str:
    lines = [
        "## Tags\n",
        "| name | unit | type | direction | rate | role | meaning |",
        "|---|---|---|---|---|---|---|",
        *(_tag(tag) for tag in TAGS),
    ]
    return "\n".join(lines) + "\n"


def _tag(tag: Tag) -> str:
    labels = f" One of: {', '.join(tag.labels)}." if tag.labels else ""
    return (
        f"| `{tag.name}` | {tag.unit or '-'} | {tag.kind} | {tag.direction} | {tag.rate} | {tag.role} "
        f"| {tag.meaning}{labels} |"
    )


def _alarm_row() -> str:
    rows = [f"| `{key}` | {words} |" for key, words in ALARM_ROW.items()]
    return (
        "\n".join(["### Rows of `alarms` and `alarm_history`\n", "| key | meaning |", "|---|---|", *rows])
        + "\n"
    )


def _roles() -> str:
    lines = [
        "## Roles: who may what\n",
        "Deny is the default. *Control* says that the action also needs the control authority.\n",
        f"| action | what | {' | '.join(Role)} | control |",
        f"|---|---|{'---|' * len(Role)}---|",
        *(
            f"| `{action}` | {WORDS[action]} | {' | '.join(_YES[role in roles] for role in Role)} "
            f"| {_YES[action in NEEDS_AUTHORITY]} |"
            for action, roles in MAY.items()
        ),
    ]
    return "\n".join(lines) + "\n"


if __name__ == "__main__":
    Path(sys.argv[1]).write_text(reference_page(), encoding="utf-8")
