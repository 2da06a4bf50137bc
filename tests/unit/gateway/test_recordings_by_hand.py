"""Recordings and the page at their door, by hand: lists, lengths, names."""

from __future__ import annotations

import asyncio
import os
import time
from asyncio.subprocess import DEVNULL, PIPE
from pathlib import Path
from typing import Any

import pytest
from starlette.requests import Request

from gantryctl.gateway import rest as rest_module
from gantryctl.gateway import static as static_module
from gantryctl.gateway import traces as traces_module
from gantryctl.gateway.static import Page
from gantryctl.gateway.traces import Content, Recorded, Traces
from gantryctl.service.recorder.journal.reading import Entry
from support.gateway_by_hand import scope
from unit.gateway.test_rest_by_hand import asked, routes


def test_recordings_have_world_time_and_those_under_way_are_not_listed(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    for name in ("000001_x.parquet", "000002_x.parquet.part", "000003_x.txt"):
        (tmp_path / name).write_bytes(b"abc")
    os.utime(tmp_path / "000001_x.parquet", (0.0, 86_400.0))
    monkeypatch.setenv("TZ", "Asia/Tokyo")
    time.tzset()
    try:
        (row,) = Traces(tmp_path).rows()
    finally:
        monkeypatch.undo()
        time.tzset()
    assert (row["name"], row["size"]) == ("000001_x.parquet", 3)
    assert row["modified"] == "1970-01-02T00:00:00+00:00"


def test_nobody_can_guess_the_id_of_a_recording(tmp_path: Path) -> None:
    """Of 128 bits, and another one after each start."""
    (tmp_path / "000001_x.parquet").write_bytes(b"abc")
    ids = [row["id"] for _ in range(2) for row in Traces(tmp_path).rows()]
    assert [len(each) for each in ids] == [32, 32]
    assert ids[0] != ids[1]


def test_a_reader_that_was_ended_is_waited_for(monkeypatch: pytest.MonkeyPatch) -> None:
    """Else the system keeps it for as long as the gateway runs."""
    did: list[str] = []

    class Process:
        returncode = None

        async def communicate(self) -> tuple[bytes, None]:
            raise TimeoutError

        def kill(self) -> None:
            did.append("killed")

        async def wait(self) -> None:
            did.append("waited for")

    async def started(*_: Any, **how: Any) -> Process:
        # It has the recording alone, and no way to the terminal but its answer.
        assert [how[end] for end in ("stdin", "stdout", "stderr")] == [DEVNULL, PIPE, DEVNULL]
        assert how["pass_fds"] == (7,)
        return Process()

    monkeypatch.setattr(traces_module.asyncio, "create_subprocess_exec", started)
    reader = Recorded()
    assert asyncio.run(reader.columns(7, "one", 0, 1)) is None
    assert (did, reader.busy) == (["killed", "waited for"], False)


@pytest.mark.parametrize("size", [0, 1, 256 * 1024, 256 * 1024 + 1])
def test_a_recording_is_read_to_its_last_byte_and_no_further(tmp_path: Path, size: int) -> None:
    (tmp_path / "one").write_bytes(b"x" * (size + 5))  # it has grown meanwhile
    content = Content(os.open(tmp_path / "one", os.O_RDONLY), size)
    parts = [*content]
    content.close()
    assert sum(map(len, parts)) == size
    assert max(map(len, parts), default=0) <= 256 * 1024


def test_a_download_names_its_size_and_a_note_its_time(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    made = routes(tmp_path)
    (tmp_path / "one").write_bytes(b"four")
    four = Content(os.open(tmp_path / "one", os.O_RDONLY), 4)
    made._files.open = lambda wanted: ("one.parquet", 4, four)  # type: ignore[method-assign]
    answer = asyncio.run(made._trace(Request({**scope(), "path_params": {"id": "x"}})))
    four.close()
    assert answer.headers["content-length"] == "4"
    assert answer.headers["content-disposition"] == 'attachment; filename="one.parquet"'
    row = Entry(3, {"utc": "2026-01-02", "user": "anna", "text": "a note", "place": "console"}, "")
    monkeypatch.setattr(rest_module, "read_journal", lambda *_, **__: [row])
    assert asked(made._notes)[1] == [{"seq": 3, "utc": "2026-01-02", "user": "anna", "text": "a note"}]


@pytest.mark.parametrize("leaves", ["at once", "at the head", "after the whole"])
def test_a_recording_is_closed_whenever_its_client_leaves(tmp_path: Path, leaves: str) -> None:
    """Found by a client that asks for recordings and goes: each left a file open, 4096 of which are all there are."""
    folder = tmp_path / "traces"
    folder.mkdir()
    (folder / "service-000001-20261122T151537123.parquet").write_bytes(b"x" * 600_000)
    made, said = routes(tmp_path), []

    async def check() -> None:
        gone = asyncio.Event()
        if leaves == "at once":
            gone.set()

        async def receive() -> dict[str, Any]:
            await gone.wait()
            return {"type": "http.disconnect"}

        async def send(message: Any) -> None:
            said.append(message)
            if leaves == "at the head":
                gone.set()
                await asyncio.sleep(0.0)

        (row,) = await asyncio.to_thread(made._files.rows)
        asked_for = {**scope(), "path_params": {"id": row["id"]}}
        answer = await made._trace(Request(asked_for))
        assert opened(folder) == 1
        await answer(asked_for, receive, send)

    asyncio.run(check())
    assert opened(folder) == 0
    sent = sum(len(each.get("body", b"")) for each in said)
    assert (sent == 600_000) is (leaves == "after the whole")


def opened(folder: Path) -> int:
    """Files of a folder that this process has open."""
    there = [
        os.readlink(f"/proc/self/fd/{number}") for number in os.listdir("/proc/self/fd") if alive(number)
    ]
    return sum(name.startswith(str(folder)) for name in there)


def alive(number: str) -> bool:
    """Whether a descriptor is still there; that of the list itself is not."""
    return os.path.lexists(f"/proc/self/fd/{number}")


def test_the_page_is_a_page_by_its_folder_too(tmp_path: Path) -> None:
    (tmp_path / "index.html").write_text("<html>", encoding="utf-8")
    page = Page(tmp_path)
    kinds = {
        path: page.answer(Request(scope(path=path))).headers["content-type"] for path in ("/", "/index.html")
    }
    assert kinds == dict.fromkeys(("/", "/index.html"), "text/html; charset=utf-8")


def test_no_question_leaves_a_file_open(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Neither the folder, nor what a file has become since it was listed."""
    (tmp_path / "one.parquet").write_bytes(b"abc")
    (tmp_path / "two.parquet").mkdir()
    made = Traces(tmp_path)
    monkeypatch.setattr(
        made, "_files", lambda: [(f"{name}.parquet", 3, 0.0) for name in ("one", "two", "none")]
    )
    before = sorted(os.listdir("/proc/self/fd"))
    for name, there in (("one", True), ("two", False), ("none", False)):
        found = made.handle(made._id(f"{name}.parquet"))
        assert (found is not None) is there
        if found is not None:
            os.close(found[2])
    assert sorted(os.listdir("/proc/self/fd")) == before


def test_what_is_packed_for_one_browser_is_not_kept_for_another(tmp_path: Path) -> None:
    (tmp_path / "index.html").write_text("<html>" * 100, encoding="utf-8")
    page = Page(tmp_path)
    for accepts, packed in ((b"gzip, br", "gzip"), (b"br", None)):
        answer = page.answer(Request(scope(headers=[(b"accept-encoding", accepts)])))
        assert (answer.headers["vary"], answer.headers.get("content-encoding")) == ("accept-encoding", packed)


def test_a_file_has_its_kind_whatever_the_system_knows(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A browser is told to guess nothing: a script of another kind does not run, and what is unknown is no page."""
    monkeypatch.setattr(static_module.mimetypes, "guess_type", lambda _: (None, None))
    wanted = {
        "one.js": "text/javascript; charset=utf-8", "app.webmanifest": "application/manifest+json",
        "one.bin": "application/octet-stream",
    }  # fmt: skip
    for name in wanted:
        (tmp_path / name).write_text("x", encoding="utf-8")
    page = Page(tmp_path)
    answers = {name: page.answer(Request(scope(path=f"/{name}"))) for name in wanted}
    assert {name: each.headers["content-type"] for name, each in answers.items()} == wanted


def test_a_browser_that_has_a_file_is_told_how_long_it_is_good_for(tmp_path: Path) -> None:
    """Its tag has 128 bits of the content."""
    (tmp_path / "index.html").write_text("<html>", encoding="utf-8")
    page = Page(tmp_path)
    first = page.answer(Request(scope()))
    tag = first.headers["etag"]
    assert len(tag.strip('"')) == 32
    again = page.answer(Request(scope(headers=[(b"if-none-match", tag.encode())])))
    names = ("etag", "cache-control", "vary")
    assert (again.status_code, [again.headers[name] for name in names]) == (
        304,
        [first.headers[n] for n in names],
    )
