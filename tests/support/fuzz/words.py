"""What hostile clients write: values that no reader expects, and damage to texts that were sound."""

from __future__ import annotations

import json
from random import Random
from typing import Any

# As JSON texts: what `json.dumps` cannot write is among them.
HOSTILE_JSON = (
    "null",
    "true",
    "false",
    "0",
    "-0",
    "-1",
    "1",
    "0.5",
    "1e308",
    "1e309",
    "-1e309",
    "1e-400",
    "NaN",
    "Infinity",
    "-Infinity",
    "9007199254740992",
    "9007199254740993",
    "18446744073709551616",
    "9" * 400,
    "9" * 5000,
    "0." + "1" * 3000,
    "1E+2147483647",
    "01",
    "0x10",
    "1_000",
    '""',
    '" "',
    '"\\u0000"',
    '"\\ud800"',
    '"\\udfff\\ud800"',
    '"\\uFEFF"',
    '"' + "A" * 300 + '"',
    '"' + "\\n" * 300 + '"',
    '"../../etc/passwd"',
    '"%s%n%x"',
    '"__proto__"',
    "[]",
    "{}",
    "[[]]",
    '{"type":"stop"}',
    "[" * 60 + "]" * 60,
    "[" * 3000,
    '{"a":' * 200 + "1" + "}" * 200,
    '"positive"',
    '"stop"',
    '"0000000000000000"',
    '"ffffffffffffffff"',
    "[1,2,3]",
    '"1"',
    '"true"',
    "1.0",
    "180.00000000000001",
    "-180.1",
)
BYTES = (
    b"",
    b"\x00",
    b"\xff" * 8,
    b"\xc0\x80",
    b"\xed\xa0\x80",
    b"\xf5\x80\x80\x80",
    b"\r\n",
    b"\n",
    b"\x1b[2J",
)


def object_text(pairs: list[tuple[str, str]]) -> str:
    """A JSON object of texts, in that order and with keys that come twice."""
    return "{" + ",".join(f"{json.dumps(name)}:{value}" for name, value in pairs) + "}"


def mutated_object(random: Random, values: dict[str, Any]) -> str:
    """A message with up to three things wrong."""
    pairs = [(name, json.dumps(value)) for name, value in values.items()]
    for _ in range(random.choice((0, 1, 1, 1, 2, 3))):
        at = random.randrange(len(pairs)) if pairs else 0
        what = random.randrange(7)
        if not pairs or what == 0:
            pairs.insert(
                at, (random.choice(("x", "", "type", "seq", "frame", "\ud800", "A" * 200)), hostile(random))
            )
        elif what == 1:
            del pairs[at]
        elif what == 2:
            pairs.append((pairs[at][0], hostile(random)))
        elif what == 3:
            pairs[at] = (pairs[at][0].upper(), pairs[at][1])
        else:
            pairs[at] = (pairs[at][0], hostile(random))
    text = object_text(pairs)
    return damaged(random, text) if random.random() < 0.1 else text


def hostile(random: Random) -> str:
    """A JSON text that is no good value, as a rule."""
    return random.choice(HOSTILE_JSON)


def damaged(random: Random, text: str) -> str:
    """A text with one damage."""
    at = random.randrange(len(text) + 1)
    return random.choice(
        (
            text[:at],
            text[at:],
            text[:at] + random.choice('{}[]",:\\\0\ufeff ') + text[at:],
            text + text,
            "\ufeff" + text,
            " " * 9000 + text,
            text[:at] + " " * 20_000 + text[at:],
        )
    )


def damaged_bytes(random: Random, data: bytes) -> bytes:
    """Bytes with one to four damages."""
    made = bytearray(data)
    for _ in range(random.randrange(1, 5)):
        at = random.randrange(len(made) + 1)
        what = random.randrange(6)
        if what == 0 and made:
            made[at % len(made)] ^= 1 << random.randrange(8)
        elif what == 1:
            made[at:at] = random.choice(BYTES)
        elif what == 2:
            del made[at : at + random.randrange(1, 9)]
        elif what == 3:
            made[at : at + 4] = random.choice((0, 1, 2**31 - 1, 2**31, 2**32 - 1)).to_bytes(4, "little")
        elif what == 4:
            made[at:at] = made[at : at + random.randrange(1, 200)]
        else:
            made[at : at + 1] = bytes([random.randrange(256)])
    return bytes(made)
