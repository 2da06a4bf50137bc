"""Routes of REST by hand, behind their check: what they ask for, in which order they answer, and what they may cost."""

from __future__ import annotations

import asyncio
import json
import os
from collections.abc import Callable, Coroutine
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest
from starlette.requests import Request
from starlette.responses import Response

from gantryctl.gateway import rest, traces
from gantryctl.gateway.rest import Rest
from gantryctl.gateway.traces import Traces, _chunks
from gantryctl.service.protocol.messages import Identity
from gantryctl.service.protocol.roles import Role
from gantryctl.service.recorder.journal.reading import Entry


def routes(tmp_path: Path, people: tuple[Identity, ...] = ()) -> Rest:
    """All of them, at one moment that does not pass."""
    access: Any = SimpleNamespace(settings=SimpleNamespace(directory=tmp_path), session=lambda _: None)
    clients = [SimpleNamespace(who=who) for who in people]
    hub: Any = SimpleNamespace(now=lambda: 100.0, clients=lambda: clients)
    samples: Any = SimpleNamespace(read=lambda first, limit: {"first": first, "limit": limit})
    return Rest(access, hub, samples)


def asked(handler: Callable[[Request], Coroutine[Any, Any, Response]], query: str = "", **path: str) -> Any:
    """Status and JSON of one answer."""
    scope = {
        "type": "http", "method": "GET", "path": "/", "query_string": query.encode(), "headers": [],
        "path_params": path,
    }  # fmt: skip
    answer = asyncio.run(handler(Request(scope)))
    return answer.status_code, json.loads(bytes(answer.body))


def test_notes_come_newest_first_and_are_read_four_times_a_second(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """`read_journal` gives the newest in the order of their numbers."""
    wanted: list[Any] = []

    def read(*what: object, **how: object) -> list[Entry]:
        wanted.append((what, how))
        return [Entry(n, {"utc": "", "user": "anna", "text": f"note {n}"}, "") for n in (3, 7)]

    monkeypatch.setattr(rest, "read_journal", read)
    found = [asked(routes_._notes) for routes_ in [routes(tmp_path)] for _ in range(6)]
    assert [status for status, _ in found] == [200] * 4 + [429] * 2
    assert [row["seq"] for row in found[0][1]] == [7, 3]
    assert wanted == [((tmp_path,), {"limit": 50, "newest": True, "kind": "note"})] * 4


def test_samples_are_answered_twenty_times_a_second_to_all_scopes_together(tmp_path: Path) -> None:
    made = routes(tmp_path)
    found = [asked(made._samples, "from=5&limit=7") for _ in range(22)]
    assert [status for status, _ in found] == [200] * 20 + [429] * 2
    assert found[0][1] == {"first": 5, "limit": 7}


@pytest.mark.parametrize(
    ("query", "status"),
    [
        ("from=999999999999", 200), ("from=1000000000000", 400), ("from=0000000000000", 400), ("from=", 400),
        ("from=-1", 400), ("from=1.0", 400), ("from=٣", 400),
    ],
)  # fmt: skip
def test_a_number_has_twelve_digits_at_most(tmp_path: Path, query: str, status: int) -> None:
    assert asked(routes(tmp_path)._samples, query)[0] == status


class Recorded:
    """Stands for the process that reads curves."""

    def __init__(self, *, busy: bool, answer: bytes | None = b"[]") -> None:
        self.busy, self.answer = busy, answer
        self.wanted: list[tuple[str, int, int]] = []

    async def columns(self, handle: int, name: str, from_ms: int, to_ms: int) -> bytes | None:
        os.fstat(handle)  # open
        self.wanted.append((name, from_ms, to_ms))
        return self.answer


@pytest.mark.parametrize(
    ("busy", "answer", "status"), [(False, b"[]", 200), (False, None, 422), (True, b"[]", 429)]
)
def test_curves_are_read_one_question_at_a_time_and_leave_no_file_open(
    tmp_path: Path, busy: bool, answer: bytes | None, status: int
) -> None:
    made, reader = routes(tmp_path), Recorded(busy=busy, answer=answer)
    made._recorded = reader  # type: ignore[assignment]
    handle = os.open(tmp_path, os.O_RDONLY)
    made._files.handle = lambda wanted: ("one", 4, handle)  # type: ignore[method-assign]
    assert asked(made._columns, "from=200&to=900", id="x")[0] == status
    assert reader.wanted == ([] if busy else [("one", 200, 900)])
    with pytest.raises(OSError, match="Bad file descriptor"):
        os.fstat(handle)


def test_who_is_at_the_page_is_told_with_role_and_place_in_the_order_of_names(tmp_path: Path) -> None:
    eve = Identity("c1", "eve", Role.VIEWER, "remote", "Eve")
    anna = [Identity(client, "anna", Role.OPERATOR, "console", "Anna") for client in ("c3", "c2")]
    status, found = asked(routes(tmp_path, (eve, *anna))._people)
    assert status == 200
    assert [tuple(row.values()) for row in found] == [
        ("c2", "anna", "Anna", "operator", "console"), ("c3", "anna", "Anna", "operator", "console"),
        ("c1", "eve", "Eve", "viewer", "remote"),
    ]  # fmt: skip


def test_of_many_recordings_the_newest_are_listed_first(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(traces, "_LISTED", 2)
    for number in (9, 10, 11):
        name = f"service-{number:06d}-20261122T1515{number}000.parquet"
        (tmp_path / name).write_bytes(b"x" * number)
    rows = Traces(tmp_path).rows()
    assert [(row["name"][8:14], row["size"]) for row in rows] == [("000011", 11), ("000010", 10)]


@pytest.mark.parametrize("more", [0, 5])
def test_a_recording_is_sent_as_long_as_it_was_when_its_length_was_told(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, more: int
) -> None:
    """Whole, in chunks; what is written behind it meanwhile is not sent, and the file is closed at the end."""
    monkeypatch.setattr(traces, "_CHUNK", 4)
    path, content = tmp_path / "one.parquet", b"0123456789"
    path.write_bytes(content + b"x" * more)
    handle = os.open(path, os.O_RDONLY)
    assert list(_chunks(handle, len(content))) == [b"0123", b"4567", b"89"]
    with pytest.raises(OSError, match="Bad file descriptor"):
        os.fstat(handle)


class Process:
    """Stands for the reader of one recording."""

    def __init__(self, code: int | None) -> None:
        self.returncode, self.killed = code, False

    async def communicate(self) -> tuple[bytes, None]:
        if self.returncode is None:
            await asyncio.Event().wait()
        return b"[1]", None

    def kill(self) -> None:
        self.killed, self.returncode = True, -9

    async def wait(self) -> None:
        pass


@pytest.mark.parametrize(("code", "answer"), [(0, b"[1]"), (2, None), (None, None)])
def test_half_of_an_answer_is_none_and_the_next_question_has_its_turn(
    monkeypatch: pytest.MonkeyPatch, code: int | None, answer: bytes | None
) -> None:
    """A reader that fails has said something as well; one that hangs is killed when its time is over."""
    process = Process(code)

    async def begin(*_: object, **__: object) -> Process:
        return process

    monkeypatch.setattr(asyncio, "create_subprocess_exec", begin)
    monkeypatch.setattr(traces, "TIME_MAX_S", 0.01)
    recorded = traces.Recorded()
    assert asyncio.run(recorded.columns(0, "one", 0, 1)) == answer
    assert (recorded.busy, process.killed) == (False, code is None)
