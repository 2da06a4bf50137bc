"""Routes of REST by hand, behind their check: what they ask for, in which order they answer, and what they may cost."""

from __future__ import annotations

import asyncio
import json
import os
import threading
import time
from collections.abc import Callable, Coroutine
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest
from starlette.requests import Request
from starlette.responses import Response

from gantryctl.errors import DeviceError
from gantryctl.gateway import rest, traces
from gantryctl.gateway.rest import Rest
from gantryctl.gateway.traces import Content, Traces
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
    # Who asks without a number waits for news, and gets no old rows.
    assert asked(routes(tmp_path)._samples)[1]["first"] == 999_999_999_999


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


def read_by_anna(made: Rest) -> list[Any]:
    """What the journal gets of it."""
    told: list[Any] = []
    made._access.session = lambda _: SimpleNamespace(user="anna", role=Role.SERVICE)  # type: ignore[method-assign, assignment, return-value]
    made._access.place = lambda _: "console"  # type: ignore[method-assign]
    made._hub.events = SimpleNamespace(put=lambda *what: told.append(what))  # type: ignore[assignment]
    return told


ANNA = Identity("", "anna", Role.SERVICE, "console")


@pytest.mark.parametrize(
    ("answer", "told"), [(b"[]", [("read", "recording one was read", ANNA)]), (None, [])]
)
def test_who_looks_at_a_recording_stands_in_the_journal(
    tmp_path: Path, answer: bytes | None, told: list[Any]
) -> None:
    made = routes(tmp_path)
    said = read_by_anna(made)
    made._recorded = Recorded(busy=False, answer=answer)  # type: ignore[assignment]
    made._files.handle = lambda wanted: ("one", 4, os.open(tmp_path, os.O_RDONLY))  # type: ignore[method-assign]
    asked(made._columns, "from=200&to=900", id="x")
    assert said == told


def test_the_journal_is_read_behind_a_number_and_that_stands_in_it(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """10,000 lines at the most, each with number and hash."""
    wanted: list[Any] = []

    def read(*what: object) -> list[Entry]:
        wanted.append(what)
        return [Entry(6, {"text": "moved"}, "ab"), Entry(7, {"text": "stopped"}, "cd")]

    monkeypatch.setattr(rest, "read_journal", read)
    made = routes(tmp_path)
    said = read_by_anna(made)
    scope = {
        "type": "http",
        "method": "GET",
        "path": "/",
        "query_string": b"from=5&limit=20000",
        "headers": [],
    }
    answer = asyncio.run(made._journal(Request(scope)))
    assert wanted == [(tmp_path, 5, 10_000)]
    assert [json.loads(line) for line in bytes(answer.body).splitlines()] == [
        {"seq": 6, "text": "moved", "hash": "ab"}, {"seq": 7, "text": "stopped", "hash": "cd"},
    ]  # fmt: skip
    assert said == [("read", "journal was read from 5", ANNA)]


def test_a_journal_that_cannot_be_read_says_why(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def read(*_: object, **__: object) -> None:
        raise DeviceError("it is damaged")

    monkeypatch.setattr(rest, "read_journal", read)
    for handler in (routes(tmp_path)._journal, routes(tmp_path)._notes):
        status, said = asked(handler)
        assert (status, said["error"]["code"]) == (503, "JRN-02")
        assert "it is damaged" in said["error"]["text"]


def test_alarms_that_are_there_are_no_history(tmp_path: Path) -> None:
    made = routes(tmp_path)
    tags = {"alarms": ["now"], "alarm_history": ["before"]}
    made._hub.status = lambda: {"tags": tags}  # type: ignore[method-assign]
    assert asked(made._alarms) == (200, {"active": ["now"], "history": ["before"]})
    tags.clear()
    assert asked(made._alarms) == (200, {"active": [], "history": []})


@pytest.mark.parametrize(("fresh", "said"), [(True, "ok"), (False, "silent")])
def test_a_controller_without_news_is_silent(tmp_path: Path, fresh: bool, said: str) -> None:
    made = routes(tmp_path)
    made._hub.fresh = fresh  # type: ignore[misc]
    assert asked(made._health) == (200, {"controller": said})


@pytest.mark.parametrize("shown", [None, {"machine": "m"}])
def test_without_a_commissioning_there_is_none(tmp_path: Path, shown: Any) -> None:
    made = routes(tmp_path)
    made._hub.commissioning = lambda: shown  # type: ignore[method-assign]
    status, found = asked(made._commissioning)
    assert (status, found if shown else found["error"]["code"]) == (
        (200, shown) if shown else (404, "CTL-14")
    )


def test_a_recording_that_is_not_there_is_not_found(tmp_path: Path) -> None:
    made = routes(tmp_path)
    for handler in (made._trace, made._columns):
        status, found = asked(handler, id="x")
        assert (status, found["error"]["code"]) == (404, "SEC-12")


@pytest.mark.parametrize(
    ("body", "status"),
    [
        (b'{"user": "anna", "password": "p"}', 200), (b'{"user": "anna", "password": "p", "role": "service"}', 400),
        (b'{"user": "anna"}', 400), (b'{"user": 7, "password": "p"}', 400), (b'{"user": "anna", "password": 7}', 400),
        (b"[]", 400), (b"{", 400), (b"[" * 60_000, 400),
    ],
)  # fmt: skip
def test_a_login_has_a_name_and_a_password_and_nothing_else(tmp_path: Path, body: bytes, status: int) -> None:
    made, logged_in = routes(tmp_path), list[tuple[str, str]]()

    async def log_in(request: Request, name: str, password: str) -> Response:
        logged_in.append((name, password))
        return Response("{}")

    async def receive() -> dict[str, Any]:
        return {"type": "http.request", "body": body}

    made._access.log_in = log_in  # type: ignore[method-assign]
    answer = asyncio.run(made._login(Request({"type": "http", "method": "POST", "headers": []}, receive)))
    assert answer.status_code == status
    assert logged_in == ([("anna", "p")] if status == 200 else [])


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
    """Whole, in chunks; what is written behind it meanwhile is not sent."""
    monkeypatch.setattr(traces, "_CHUNK", 4)
    path, content = tmp_path / "one.parquet", b"0123456789"
    path.write_bytes(content + b"x" * more)
    handle = os.open(path, os.O_RDONLY)
    read = Content(handle, len(content))
    assert list(read) == [b"0123", b"4567", b"89"]
    read.close()
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


def test_what_reads_memory_or_disk_for_long_does_it_beside_the_loop(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Commands, a Stop above all, are taken there."""
    made, where = routes(tmp_path), dict[str, bool]()

    def reads(name: str, answer: Any) -> Callable[..., Any]:
        def read(*_: object, **__: object) -> Any:
            where[name] = threading.current_thread() is threading.main_thread()
            return answer

        return read

    made._scans = SimpleNamespace(read=reads("samples", {}))  # type: ignore[assignment]
    made._files = SimpleNamespace(  # type: ignore[assignment]
        rows=reads("traces", []), open=reads("trace", None), handle=reads("columns", None)
    )
    for handler, path in (
        (made._samples, {}),
        (made._traces, {}),
        (made._trace, {"id": "x"}),
        (made._columns, {"id": "x"}),
    ):
        asked(handler, **path)  # type: ignore[arg-type]
    for name, handler in (("journal", made._journal), ("notes", made._notes)):
        monkeypatch.setattr(rest, "read_journal", reads(name, []))
        asyncio.run(handler(Request({"type": "http", "method": "GET", "query_string": b"", "headers": []})))
    assert where == dict.fromkeys(("samples", "traces", "trace", "columns", "journal", "notes"), False)


def test_one_journal_is_read_at_a_time(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Of each thread beside it the loop waits 5 ms for the processor, whenever it has something to do."""
    reading, most = list[int](), list[int]()

    def read(*_: object) -> list[Entry]:
        reading.append(1)
        time.sleep(0.005)
        most.append(len(reading))
        reading.pop()
        return []

    monkeypatch.setattr(rest, "read_journal", read)
    made, scope = routes(tmp_path), {"type": "http", "method": "GET", "query_string": b"", "headers": []}

    async def check() -> None:
        await asyncio.gather(*(made._journal(Request(scope)) for _ in range(4)))

    asyncio.run(check())
    assert most == [1, 1, 1, 1]


def test_lines_of_the_journal_are_written_beside_the_loop_too(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """10 000 of them took the loop a tenth of a second, in which no Stop was taken."""
    where = list[bool]()

    class Row(SimpleNamespace):
        @property
        def values(self) -> dict[str, Any]:
            where.append(threading.current_thread() is threading.main_thread())
            return {"text": "moved"}

    monkeypatch.setattr(rest, "read_journal", lambda *_: [Row(seq=6, hash="ab")])
    scope = {"type": "http", "method": "GET", "query_string": b"", "headers": []}
    answer = asyncio.run(routes(tmp_path)._journal(Request(scope)))
    assert json.loads(bytes(answer.body)) == {"seq": 6, "text": "moved", "hash": "ab"}
    assert where == [False]


def test_who_asks_too_often_is_told_to_come_again_in_a_second(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    made = routes(tmp_path)
    made._recorded = Recorded(busy=True)  # type: ignore[assignment]
    made._files.handle = lambda wanted: ("one", 4, os.open(tmp_path, os.O_RDONLY))  # type: ignore[method-assign]
    monkeypatch.setattr(rest, "read_journal", lambda *_, **__: [])
    waits = []
    for handler in (made._samples, made._notes, made._columns):
        for _ in range(25):
            scope = {
                "type": "http",
                "method": "GET",
                "query_string": b"",
                "headers": [],
                "path_params": {"id": "x"},
            }
            answer = asyncio.run(handler(Request(scope)))
        waits.append((answer.status_code, answer.headers.get("retry-after")))
    assert waits == [(429, "1")] * 3
