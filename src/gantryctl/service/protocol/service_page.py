"""The reference page of the service: `python -m gantryctl.service.protocol.service_page FILE` writes it."""

# ruff: noqa: E501  (rows of Markdown tables)

from __future__ import annotations

import sys
from collections.abc import Iterable, Sequence
from pathlib import Path
from string import Template
from typing import Any, Final

from gantryctl.program.alarms.service import SERVICE
from gantryctl.service.protocol import limits
from gantryctl.service.protocol.messages import COMMON, MESSAGES
from gantryctl.service.protocol.roles import RIGHTS, Role
from gantryctl.service.protocol.tags import ALARM_ROW, TAGS, Tag

_YES: Final = {True: "yes", False: "-"}
_NUMBERS: Final = {
    "message_kib": limits.MESSAGE_MAX // 1024,
    "frame_ms": round(limits.FRAME_S * 1e3),
    "renew_ms": round(limits.RENEW_S * 1e3),
    "stale_ms": round(limits.STALE_S * 1e3),
    "frames_max": limits.FRAMES_MAX,
    "frames_max_jog": limits.FRAMES_MAX_JOG,
    "commands_per_s": round(limits.COMMANDS_PER_S),
    "silence_s": round(limits.SILENCE_S),
    "held_s": round(limits.HELD_S),
    "armed_s": round(limits.ARMED_S),
}

_HEAD: Final = """\
# The service: tags, messages, routes, roles

Written by `python -m gantryctl.service.protocol.service_page docs/reference/service.md`; do not edit, a test compares.
`gantryctl serve` runs it. Page, REST, OPC UA and the local socket show the same tags under the same names.

Numbers are plain JSON numbers in the unit of the table; what is unknown, or no number, is `null`. Enums are words.
"""

_SOCKET: Final = Template("""\
## WebSocket: `/api/v1/socket`

One JSON object in one text frame, at most $message_kib KiB. The session cookie says who it is; `Origin` must be the address of
the page. Refused with HTTP 401 (not logged in) or 403 (foreign `Origin` or `Host`) before it opens. Close codes:
4401 the session has ended, 4408 too slow or silent, 4429 too many messages, 1008 not understood, 1012 restart.

### From the service

| type | when | keys |
|---|---|---|
| `welcome` | first | `client` (your own id), `user`, `role`, `place` (`local`, `loopback` or `remote`: those move above `speed_cap_deg_s` with the enabling switch only), `may` (actions of the role), `version`, `frame_ms` ($frame_ms), `lease_ms` (`[monitors] lease_ms`, 250 as shipped), `renew_ms` ($renew_ms), `frames_max_jog` ($frames_max_jog), `frames_max` ($frames_max), `stale_ms` ($stale_ms) |
| `status` | every $frame_ms ms | `frame`, `fresh` (false: the controller is silent), `age_ms` (of the snapshot), `tags` (those of 20 Hz always, the others in the first frame and when one of them changed: merge them) |
| `reply` | once for every command with a `seq` | `seq`, `ok`, `code` (stable, empty when ok), `text` (why not), `values` (those in the message of the code), `epoch` (the newest), `journal` (number of the event, 0 when none) |

A slow reader loses status frames, never the newest one, and never a reply. Data are stale when no `status` came for
$stale_ms ms, or `fresh` is false, or `age_ms` is above $stale_ms: show it, and disable every motion button. Stop stays enabled.

### To the service

Every message: `type`, `seq` (whole number, above all before it on this connection), `frame` (the newest
`status.frame` received), and, but for `stop`, `quick_stop` and `alive`, `epoch` (the newest `tags.epoch`). A frame number more
than $frames_max behind ($frames_max_jog for `jog` and `renew`) is refused as SEC-02, another epoch as SEC-03, a `seq` not above the last as
SEC-04. Unknown types and keys, strings for numbers, nan and inf are refused as SEC-05. At most $commands_per_s commands a second
(SEC-06); `renew`, `release`, `stop` and `quick_stop` do not count.

$messages
`ok` means that the scan has carried it out, or begun to. A refusal changes nothing.

An epoch ends with `stop`, `quick_stop`, `reset`, every change of control and every start of the controller. Nothing
that was sent before is carried out after.

### Hold-to-run

1. Press: make a random lease, send `jog`. 2. Every $renew_ms ms send `renew` with that lease, a new `seq`, and the newest
`frame` and `epoch`. 3. Send `release` on pointerup, pointercancel, lostpointercapture, blur, visibilitychange, pagehide and key up, and
stop renewing. The lease is `lease_ms` long, checked in the scan. A lease that ended once (released, late, stopped, refused,
disconnected) is never valid again: to go on, the person presses again. `lease_left_ms` shows what is left. No key is held for longer
than $held_s s (CTL-21): a page that is stuck may go on renewing.

### Enabling switch

Above `speed_cap_deg_s` keys and increments need the enabling switch, and moves too when they were begun from a remote screen or
a remote screen has control. It is checked when they begin and in every scan: let go, the axis stops on the jog-release ramp
(INT-05), power stays on. The speed setting counts, not the override.

### Arm, then execute

Two things take two steps: the brake test, and the reset of something locked. `arm` with the action; then `brake_test` or
`reset` within $armed_s s, over the same connection. What is armed shows in `armed_action`, `armed_by` and `armed_left_s`. It is executed
once. It is gone after its time, with its connection, and with its epoch: every stop, reset and change of control ends it.
Arming something else takes its place.

With `gantryctl serve --second-person` the one who executes must be another user than the one who armed (`second_person` is
true): the first arms from any connection, without control; the second has control already, because taking it would begin a new
epoch, and executes.

A brake test that is under way ends with its epoch too: by `stop` or `quick_stop` from anybody, and when the user who began it loses
control or the connection. The torque is taken back, the drive is disabled, the brake has stayed closed.

### Codes of the service

$codes
`gantryctl explain CODE` knows these and all others (CTL-.., LIM-.., PWR-.., INT-..).
""")

_HTTP: Final = """\
## HTTP

JSON in and out, UTF-8. Bodies at most 64 KiB. Errors: status 4xx or 5xx and
`{"error": {"code": "SEC-01", "text": "log in first"}}`. A `POST` needs `Origin` of the page (or none, from a script
with a cookie) and `Content-Type: application/json`.

| route | who | what |
|---|---|---|
| `GET /` and files beside it | anyone | the page; 503 with a text when it is not built |
| `POST /api/v1/login` | anyone | `{"user", "password"}` -> 200 `{"user", "role"}` and the cookie `gantryctl_session` (HttpOnly, SameSite=Strict, Secure with TLS); 401 wrong (SEC-01), 429 locked out, with `Retry-After` |
| `POST /api/v1/logout` | logged in | 204; ends the session and its WebSockets |
| `GET /api/v1/session` | anyone | 200 `{"user", "role", "may"}`, or 401 |
| `GET /api/v1/tags` | `view` | the tag table: list of `{"name", "unit", "type", "direction", "rate", "role", "meaning", "labels"}` |
| `GET /api/v1/status` | `view` | one `status` object with all tags |
| `GET /api/v1/alarms` | `view` | `{"active": [...], "history": [...]}` |
| `GET /api/v1/traces` | `traces` | list of `{"id", "name", "size", "modified"}`, newest first; `id` is opaque |
| `GET /api/v1/traces/{id}` | `traces` | the Parquet file; 404 for every other id |
| `GET /api/v1/journal?from=N&limit=N` | `journal` | JSON lines of events, at most 10 000 |
| `GET /api/v1/openapi.json` | anyone | this table as OpenAPI 3.1 |
| `GET /api/v1/health` | anyone | 200 `{"controller": "ok" or "silent"}` |

The rate limit is 10 requests a second and address, with a reserve of 40 (429 with `Retry-After`). A session ends after 15 min without a message
of its user, after 8 h, at logout, when the role changes, and when the gateway starts again. Five wrong passwords lock the pair of account and address for 1 s, then 2, 4
... 15 min.

Headers: `Content-Security-Policy: default-src 'none'; script-src 'self'; style-src 'self'; img-src 'self' data:;
connect-src 'self'; font-src 'self'; manifest-src 'self'; base-uri 'none'; form-action 'none'; frame-ancestors 'none'`. So the page has no
inline script, no inline style (neither `<style>` nor `style=` in markup; setting `element.style` by script is allowed)
and no address of another host. The built page is package data in `src/gantryctl/gateway/page/` (`index.html` and
`assets/`).

The address is `http://127.0.0.1:8650` unless `--listen` says otherwise; another host than loopback needs TLS and users.
"""


_VALUES: Final = """\
### Values and messages

`values` of an alarm row and of a reply are the fields of the message of its code (`gantryctl explain CODE`), so that a client can say it in
another language. A tag of type `messages` is a list; each message, and each value that is not a number or a name, has one of these forms:

| form | is |
|---|---|
| `{"code": "CTL-04", "values": {...}}` | the message of a code |
| `{"reason": "ENC-10", "values": {...}}` | a reason against power: code, message, what to do |
| `{"words": "ESTOP_OPEN", "values": {...}}` | words of `program/alarms/words.py` |
| text | English without values |
"""


def reference_page() -> str:
    """Write the page."""
    socket = _SOCKET.substitute(_NUMBERS, messages=_messages(), codes=_codes())
    rows = _table(("key", "meaning"), ((f"`{key}`", words) for key, words in ALARM_ROW.items()))
    alarms = f"### Rows of `alarms` and `alarm_history`\n\n{rows}"
    return "\n".join([_HEAD, _tags(), alarms, _VALUES, socket, _HTTP, _roles()])


def _table(head: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    lines = [head, *rows]
    lines.insert(1, ["---"] * len(head))
    # The ruler stands without spaces, as everywhere in the documents.
    return "".join(f"|{'|'.join(row)}|\n" if row[0] == "---" else f"| {' | '.join(row)} |\n" for row in lines)


def _tags() -> str:
    rows = (
        (f"`{tag.name}`", tag.unit or "-", tag.kind, tag.direction, tag.rate, tag.role, _meaning(tag))
        for tag in TAGS
    )
    return "## Tags\n\n" + _table(("name", "unit", "type", "direction", "rate", "role", "meaning"), rows)


def _meaning(tag: Tag) -> str:
    return f"{tag.meaning} One of: {', '.join(tag.labels)}." if tag.labels else tag.meaning


def _messages() -> str:
    definitions = MESSAGES.json_schema()["$defs"].values()
    rows = (
        (
            f"`{each['properties']['type']['const']}`",
            _keys(each["properties"]),
            " ".join(each["description"].split()),
        )
        for each in definitions
    )
    return _table(("type", "more keys", "does"), sorted(rows))


def _keys(properties: dict[str, Any]) -> str:
    words = {
        name: each.get("description") or ", ".join(each.get("enum", ())) or each["type"]
        for name, each in properties.items()
        if name not in COMMON
    }
    return "; ".join(f"`{name}`: {text}" for name, text in words.items()) or "-"


def _codes() -> str:
    rows = ((row.code, f"{row.english.title}: {row.english.cause}") for row in SERVICE)
    return _table(("code", "why"), rows)


def _roles() -> str:
    rows = (
        (
            f"`{action}`", right.words, *(_YES[role in right.roles] for role in Role), _YES[right.control],
        )
        for action, right in RIGHTS.items()
    )  # fmt: skip
    return (
        "## Roles: who may what\n\nDeny is the default. *Control* says that the action also needs the control authority.\n\n"
        + _table(("action", "what", *Role, "control"), rows)
    )


if __name__ == "__main__":
    Path(sys.argv[1]).write_text(reference_page(), encoding="utf-8")
