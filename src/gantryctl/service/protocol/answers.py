"""JSON schemas of what the service tells: tags, status, alarms, events, people, recordings (JSON Schema 2020-12)."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any, Final

from gantryctl.service.protocol.roles import Action, Role
from gantryctl.service.protocol.tags import ALARM_ROW, TAGS, Tag

Schema = dict[str, Any]

_TEXT: Final = {"type": "string"}
_COUNT: Final = {"type": "integer", "minimum": 0}
_FLAG: Final = {"type": "boolean"}
# Any JSON value: fields of the message of a code.
_VALUES: Final = {"type": "object"}


def refer(name: str) -> Schema:
    """Refer to a schema of `SCHEMAS`."""
    return {"$ref": f"#/components/schemas/{name}"}


def list_of(name: str) -> Schema:
    """List of things that `SCHEMAS` describes."""
    return {"type": "array", "items": refer(name)}


def exactly(keys: Mapping[str, Schema], optional: Iterable[str] = ()) -> Schema:
    """Object with these keys and no others."""
    left_out = set(optional)
    return {
        "type": "object",
        "properties": dict(keys),
        "required": [key for key in keys if key not in left_out],
        "additionalProperties": False,
    }


def _or_null(schema: Schema, null: bool) -> Schema:
    return {**schema, "type": [schema["type"], "null"]} if null else schema


_KINDS: Final[dict[str, Schema]] = {
    "float": {"type": "number"},
    "int": {"type": "integer"},
    "bool": _FLAG,
    "text": _TEXT,
    "pairs": {
        "type": "array",
        "items": {"type": "array", "items": {"type": "number"}, "minItems": 2, "maxItems": 2},
    },
    "rows": list_of("AlarmRow"),
    "messages": list_of("Message"),
    "values": _VALUES,
}


def _of_tag(tag: Tag) -> Schema:
    kind = {"type": "string", "enum": list(tag.labels)} if tag.kind == "enum" else _KINDS[tag.kind]
    unit = {"x-unit": tag.unit} if tag.unit else {}
    return {**_or_null(kind, tag.null), "description": tag.meaning, **unit}


_TAG_ROW: Final = exactly(
    {
        **{key: _TEXT for key in ("name", "unit")},
        "type": {"enum": [*(kind for kind in _KINDS if kind != "values"), "enum"]},
        "direction": {"enum": ["out", "both"]},
        "rate": {"enum": ["20 Hz", "1 Hz", "on change"]},
        "role": {"enum": list(Role)},
        "meaning": _TEXT,
        "labels": {"type": "array", "items": _TEXT},
        "null": _FLAG,
    }
)
# Without `required`: before the controller has begun there is no tag but the lists of alarms.
_TAGS: Final = exactly({tag.name: _of_tag(tag) for tag in TAGS}, optional=(tag.name for tag in TAGS))
# Those that a recording has as columns.
_SAMPLED: Final = exactly(
    {
        tag.name: {"type": "array", "items": {"type": ["number", "null"]}, "description": tag.meaning}
        for tag in TAGS
        if tag.kind in ("float", "int", "bool", "enum")
    },
    optional=(tag.name for tag in TAGS),
)
_EVENT: Final = exactly(
    {
        "seq": {**_COUNT, "description": "number in the journal"},
        "boot": {"type": "integer", "description": "of the start of the service"},
        "source": {"type": "integer", "description": "of the process"},
        "number": {**_COUNT, "description": "of the event at its source"},
        "utc": _TEXT,
        "monotonic_ns": _COUNT,
        "kind": {
            **_TEXT,
            "description": "one word: command, alarm, authority, setting, login, user, service, ...",
        },
        **{key: _TEXT for key in ("user", "role", "client", "place", "text")},
        "detail": {
            **_TEXT,
            "contentMediaType": "application/json",
            "description": "values, a JSON object as text",
        },
        "hash": {**_TEXT, "pattern": "^[0-9a-f]+$", "description": "of the chain up to this event"},
    }
)

SCHEMAS: Final[dict[str, Schema]] = {
    "Error": exactly({"error": exactly({"code": {**_TEXT, "pattern": "^[A-Z]"}, "text": _TEXT})}),
    "Person": exactly(
        {
            "user": _TEXT,
            "person": {**_TEXT, "description": "whose account it is"},
            "role": {"enum": list(Role)},
            "may": {"type": "array", "items": {"enum": list(Action)}},
        }
    ),
    "TagRow": _TAG_ROW,
    "Message": {
        "description": "a code, a reason or words with values, or English without",
        "anyOf": [
            *(exactly({key: _TEXT, "values": _VALUES}) for key in ("code", "reason", "words")),
            _TEXT,
        ],
    },
    "AlarmRow": exactly(
        {
            key: {**_or_null(_KINDS[row.kind], row.null), "description": row.meaning}
            for key, row in ALARM_ROW.items()
        }
    ),
    "Tags": _TAGS,
    "Status": exactly(
        {
            "type": {"const": "status"},
            "fresh": {**_FLAG, "description": "false: the controller is silent"},
            "age_ms": {"type": ["number", "null"], "description": "of the snapshot; null before the first"},
            "tags": refer("Tags"),
        }
    ),
    "Samples": exactly(
        {
            "period_s": {
                "type": ["number", "null"],
                "description": "of the scan; null before the first start",
            },
            "from": {
                **_COUNT,
                "description": "number of the first row: a later one than asked for where older ones are gone",
            },
            "next": {**_COUNT, "description": "number to ask from next time"},
            "newest": {**_COUNT, "description": "number of the row that comes next"},
            "newest_s": {
                "type": ["number", "null"],
                "description": "`time_s` of the row before it, if there is one",
            },
            "utc_s": {"type": "number", "description": "wall clock of the machine then, s since 1970"},
            "tags": _SAMPLED,
        }
    ),
    "Commissioning": exactly(
        {
            "machine": _TEXT,
            "drive": {
                **_TEXT,
                "description": "vendor, product, revision and serial number; empty before it was read",
            },
            "complete": {
                **_FLAG,
                "description": "all that is required has passed: the end writes the record",
            },
            "note": {**_TEXT, "description": "why no step can be begun, or why the last one was stopped"},
            "steps": list_of("CommissioningStep"),
            "ledger": {"type": "array", "items": _TEXT, "description": "what gives each safety property"},
            "open": {"type": "array", "items": _TEXT, "description": "of the ledger, what is not proven"},
        }
    ),
    "CommissioningStep": exactly(
        {
            "key": _TEXT,
            "title": _TEXT,
            "does": _TEXT,
            "moves": {**_TEXT, "description": "what could move, and how far; empty for nothing"},
            "offered": {**_FLAG, "description": "false: by `gantryctl commission --only` alone"},
            "outcome": {"enum": ["", "passed", "failed", "not_testable"]},
            "proof": _TEXT,
            "to_do": _TEXT,
            "at": _TEXT,
            "by": _TEXT,
            "figures": {
                "type": "object",
                "additionalProperties": exactly(
                    {key: {"type": ["number", "null"]} for key in ("value", "low", "high")}
                ),
            },
        }
    ),
    "Alarms": exactly({"active": list_of("AlarmRow"), "history": list_of("AlarmRow")}),
    "Recording": exactly({"id": _TEXT, "name": _TEXT, "size": _COUNT, "modified": _TEXT}),
    "Columns": exactly(
        {
            "name": _TEXT,
            "machine": _TEXT,
            "utc_s": {
                "type": ["number", "null"],
                "description": "wall clock at the first row, s since 1970; null where the name has no date",
            },
            "end_s": {"type": "number", "description": "time of the last row, from the first"},
            "columns": {
                "type": "array",
                "items": exactly(
                    {
                        "name": {**_TEXT, "description": "that of the tag where there is one"},
                        "unit": _TEXT,
                        "x": {
                            "type": "array",
                            "items": {"type": "number"},
                            "description": "s from the first row",
                        },
                        "y": {"type": "array", "items": {"type": ["number", "null"]}},
                    }
                ),
            },
        }
    ),
    "Event": _EVENT,
    "Note": exactly(
        {
            "seq": {**_COUNT, "description": "number in the journal"},
            **{key: _TEXT for key in ("utc", "user", "text")},
        }
    ),
    "Visitor": exactly(
        {
            "client": {
                **_TEXT,
                "description": "one page; that of the holder of control is `authority_client`",
            },
            "user": _TEXT,
            "person": {**_TEXT, "description": "whose account it is"},
            "role": {"enum": list(Role)},
            "place": {"enum": ["console", "remote"]},
        }
    ),
    "Health": exactly({"controller": {"enum": ["ok", "silent"]}}),
    "Description": {"type": "object", "required": ["openapi", "info", "paths", "components"]},
}
"""By name, for `components.schemas` of the OpenAPI description."""
