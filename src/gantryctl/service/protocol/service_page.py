"""The reference page of the service: `python -m gantryctl.service.protocol.service_page FILE` writes it."""

# ruff: noqa: E501  (rows of Markdown tables)

from __future__ import annotations

import sys
from pathlib import Path
from string import Template
from typing import Final

from gantryctl.service.protocol import limits
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
| `welcome` | first | `client` (one's own id), `user`, `role`, `place` (`local`, `loopback` or `remote`: those move above `speed_cap_deg_s` with the enabling switch only), `may` (actions of the role), `version`, `frame_ms` ($frame_ms), `lease_ms` (`[monitors] lease_ms`, 250 as shipped), `renew_ms` ($renew_ms), `frames_max_jog` ($frames_max_jog), `frames_max` ($frames_max), `stale_ms` ($stale_ms) |
| `status` | every $frame_ms ms | `frame`, `fresh` (false: the controller is silent), `age_ms` (of the snapshot), `tags` (those of 20 Hz always, the others in the first frame and when one of them changed: merge them) |
| `reply` | once for every command with a `seq` | `seq`, `ok`, `code` (stable, empty when ok), `text` (why not), `epoch` (the newest), `journal` (number of the event, 0 when none) |

A slow reader loses status frames, never the newest one, and never a reply. Data are stale when no `status` came for
$stale_ms ms, or `fresh` is false, or `age_ms` is above $stale_ms: show it, and disable every motion button. Stop stays enabled.

### To the service

Every message: `type`, `seq` (whole number, above all before it on this connection), `frame` (the newest
`status.frame` received), and, but for `stop`, `quick_stop` and `alive`, `epoch` (the newest `tags.epoch`). A frame number more
than $frames_max behind ($frames_max_jog for `jog` and `renew`) is refused as SEC-02, another epoch as SEC-03, a `seq` not above the last as
SEC-04. Unknown types and keys, strings for numbers, nan and inf are refused as SEC-05. At most $commands_per_s commands a second
(SEC-06); `renew`, `release`, `stop` and `quick_stop` do not count.

| type | more keys | does |
|---|---|---|
| `alive` | - | at least twice a second from whoever has control: silence of $silence_s s gives it back. No reply |
| `take` | `over`: bool | control authority; `over` takes it from somebody else, at standstill only |
| `give` | - | gives it back; a jog stops, a move goes on, one that stands still at override 0 ends. So it is when the holder is silent or gone |
| `power` | `on`: bool | on needs control, off does not |
| `mode` | `mode`: none, continuous, incremental | at standstill |
| `jog` | `lease`: 16 hex digits, random, new at every press; `direction`: forward, reverse | continuous mode: begins hold-to-run |
| `renew` | `lease` | every $renew_ms ms while the key is held. No reply but a refusal: then the lease is dead |
| `release` | `lease` | key let go: the jog-release ramp. Always accepted |
| `increment` | `direction` | incremental mode: one increment |
| `move` | `target_deg` | to an angle with the speed setting; never the shortest way |
| `halt` | - | ends the motion on the normal ramp |
| `stop` | - | jog-release ramp. Accepted from everyone, always |
| `quick_stop` | - | quick stop, ErrorStop. Accepted from everyone, always |
| `reset` | - | resets alarms whose cause is gone; never enables. Locked ones (`reset_locked` is true) need the service role, and `arm` first |
| `acknowledge` | `id` of the alarm row | marks it as seen. Needs no control |
| `set` | `tag`, `value` | one of the tags with direction `both`, but `mode`. An override raised from 0 while a motion stands still is refused as that motion would be |
| `arm` | `action`: brake_test, reset_locked | the first of two steps, see below. Needs no control |
| `brake_test` | - | power must be off; needs `arm`; refused where `brake_test_available` is false |

`ok` means that the scan has carried it out, or begun to. A refusal changes nothing.

An epoch ends with `stop`, `quick_stop`, `reset`, every change of control and every start of the controller. Nothing
that was sent before is carried out after.

### Hold-to-run

1. Press: make a random lease, send `jog`. 2. Every $renew_ms ms send `renew` with that lease, a new `seq`, and the newest
`frame` and `epoch`. 3. Send `release` on pointerup, pointercancel, lostpointercapture, blur, visibilitychange, pagehide and key up, and
stop renewing. The lease is `lease_ms` long, checked in the scan. A lease that ended once (released, late, stopped, refused,
disconnected) is dead for ever: to go on, the person presses again. `lease_left_ms` shows what is left. No key is held for longer
than $held_s s (CTL-21): a page that is stuck may go on renewing.

### Enabling switch

Above `speed_cap_deg_s` keys and increments need the enabling switch, and moves too when they were begun from a remote screen or
a remote screen has control. It is looked at when they begin and in every scan: let go, the axis stops on the jog-release ramp
(INT-05), power stays on. The speed setting counts, not the override.

### Arm, then execute

Two things take two steps: the brake test, and the reset of something locked. `arm` with the action; then `brake_test` or
`reset` within $armed_s s, over the same connection. What is armed shows in `armed_action`, `armed_by` and `armed_left_s`. It is executed
once. It is gone after its time, with its connection, and with its epoch: every stop, reset and change of control ends it.
Arming something else takes its place.

With `gantryctl serve --second-person` the one who executes must be another user than the one who armed (`second_person` is
true): the first arms from any connection, without control; the second has control already, because taking it would begin a new
epoch, and executes.

A brake test that is under way ends with its epoch too: by `stop` or `quick_stop` from anybody, and when whoever began it loses
control or the connection. The torque is taken back, the drive is disabled, the brake has stayed closed.

### Codes of refusals by the service

| code | why |
|---|---|
| SEC-01 | the role may not do it, or not logged in |
| SEC-02 | too old: the frame number is too far behind |
| SEC-03 | of another epoch |
| SEC-04 | sequence number used before |
| SEC-05 | not understood: unknown type or key, wrong type, not finite, too long |
| SEC-06 | too many commands |
| SEC-07 | needs control: nobody or somebody else has it |
| SEC-08 | control is held by somebody and the axis is moving |
| SEC-09 | the lease is dead or is not yours |
| SEC-10 | not armed: by nobody, too long ago, in another epoch, at another screen, or (second person) by the same user |
| SEC-11 | (event) a certificate of the page, of OPC UA or of one of its clients ends within 30 days, or has ended |
| SYS-11 | the controller does not answer |
| JRN-01 | (event) the disk is nearly full: nothing is recorded, or no new motion |
| JRN-02 | the journal is not able to keep events: no new motion |
| JRN-05 | (event) the journal was damaged and moved aside; service must reset |

All others (CTL-.., LIM-.., PWR-.., INT-..) are those of `gantryctl explain`.
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
of its user, after 8 h, at logout, when the role changes, and when the gateway starts anew. Five wrong passwords lock the pair of account and address for 1 s, then 2, 4
... 15 min.

Headers: `Content-Security-Policy: default-src 'none'; script-src 'self'; style-src 'self'; img-src 'self' data:;
connect-src 'self'; font-src 'self'; manifest-src 'self'; base-uri 'none'; form-action 'none'; frame-ancestors 'none'`. So the page has no
inline script, no inline style (neither `<style>` nor `style=` in markup; setting `element.style` by script is allowed)
and no address of another host. The built page is package data in `src/gantryctl/gateway/page/` (`index.html` and
`assets/`).

The address is `http://127.0.0.1:8650` unless `--listen` says otherwise; another host than loopback needs TLS and users.
"""


def reference_page() -> str:
    """The whole page."""
    return "\n".join([_HEAD, _tags(), _alarm_row(), _SOCKET.substitute(_NUMBERS), _HTTP, _roles()])


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
            f"| `{action}` | {right.words} | {' | '.join(_YES[role in right.roles] for role in Role)} "
            f"| {_YES[right.control]} |"
            for action, right in RIGHTS.items()
        ),
    ]
    return "\n".join(lines) + "\n"


if __name__ == "__main__":
    Path(sys.argv[1]).write_text(reference_page(), encoding="utf-8")
