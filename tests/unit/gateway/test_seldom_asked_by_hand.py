"""What a door is seldom asked: odd headers, addresses and files, a session that comes back, a second pause, by hand."""

from __future__ import annotations

import asyncio
import json
import logging
import os
import struct
import time
from collections.abc import Iterator
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest
from starlette.requests import Request
from starlette.responses import Response
from starlette.websockets import WebSocket

from gantryctl.gateway import __main__ as main_module
from gantryctl.gateway import access as access_module
from gantryctl.gateway import app as app_module
from gantryctl.gateway import door as door_module
from gantryctl.gateway import live as live_module
from gantryctl.gateway import peers as peers_module
from gantryctl.gateway import rest as rest_module
from gantryctl.gateway import server
from gantryctl.gateway import sessions as sessions_module
from gantryctl.gateway import settings as settings_module
from gantryctl.gateway import traces as traces_module
from gantryctl.gateway.access import CONSOLE_COOKIE, COOKIE, Access, person
from gantryctl.gateway.guard import error
from gantryctl.gateway.live import Live
from gantryctl.gateway.peers import local_user, user_of
from gantryctl.gateway.places import Place, Waiting
from gantryctl.gateway.routes import API, openapi
from gantryctl.gateway.server import PatientProtocol
from gantryctl.gateway.sessions import SESSIONS_OF_USER, Session, Sessions
from gantryctl.gateway.settings import Settings, neighbourhood
from gantryctl.gateway.static import Page
from gantryctl.gateway.traces import Recorded, Traces, _chunks
from gantryctl.program import Code
from gantryctl.program.alarms.log import refusal
from gantryctl.program.alarms.words import Words
from gantryctl.service.clients.console_link import LinkTaker
from gantryctl.service.clients.hub import Hub
from gantryctl.service.memory.memory import SharedMemory, Source, Word
from gantryctl.service.protocol.roles import Role
from gantryctl.service.recorder.journal.reading import Entry
from gantryctl.service.supervisor.users import User
from unit.gateway import test_patience
from unit.gateway.test_door_by_hand import Connection, with_door
from unit.gateway.test_doors_by_hand import HERE, JSON, Headers, guard, scope
from unit.gateway.test_patience import GET, Wire, connected
from unit.gateway.test_rest_by_hand import asked, routes
from unit.gateway.test_sessions import Clock

ANNA = User("anna", Role.OPERATOR, "Anna", "", "", 1, 1, 1, "")
BEN = ANNA._replace(name="ben", person="Ben")


@pytest.fixture
def access(tmp_path: Path) -> Iterator[Access]:
    memory = SharedMemory.create()
    settings = Settings("127.0.0.1", 1, -1, None, None, (), tmp_path, tmp_path)
    yield Access(settings, Hub(memory, Source.WEB), LinkTaker(memory.words))
    memory.close()


# --- sessions -------------------------------------------------------------------------------------------------------


def sessions(*users: User) -> tuple[Sessions, Clock, dict[str, User]]:
    """Sessions of users whose file is read in every request."""
    known, clock = {each.name: each for each in users}, Clock()
    stamps = iter(range(10**6))
    path = SimpleNamespace(stat=lambda: SimpleNamespace(st_mtime_ns=next(stamps), st_ino=1))
    return Sessions(SimpleNamespace(path=path, all=lambda: dict(known)), clock), clock, known  # type: ignore[arg-type]


def test_a_session_that_has_ended_does_not_come_back_with_its_role() -> None:
    made, _, known = sessions(ANNA)
    session = made.open(ANNA, "here")
    known["anna"] = ANNA._replace(role=Role.VIEWER)
    assert made.find(session.token) is None
    known["anna"] = ANNA
    assert made.find(session.token) is None


def test_a_session_that_was_idle_for_a_quarter_of_an_hour_has_ended() -> None:
    made, clock, _ = sessions(ANNA)
    session = made.open(ANNA, "here")
    clock.s += 899.5
    assert made.lives(session)
    clock.s += 0.5
    assert not made.lives(session)


def test_a_session_ends_with_its_eighth_hour() -> None:
    made, clock, _ = sessions(ANNA)
    session = made.open(ANNA, "here")
    clock.s += 28_799.5
    made.use(session)
    assert made.lives(session)
    clock.s += 0.5
    made.use(session)
    assert not made.lives(session)


def test_sessions_that_have_ended_take_no_room() -> None:
    """Fifteen, each of another peer; the one that lives has its place beside the next one."""
    made, clock, _ = sessions(ANNA)
    for n in range(SESSIONS_OF_USER - 1):
        made.open(ANNA, f"192.0.2.{n}")
    clock.s += 900.0
    own = made.open(ANNA, "here")
    made.open(ANNA, "here")
    assert made.lives(own)


def test_the_peer_that_has_most_sessions_makes_room_and_the_newcomer_counts_once() -> None:
    """Seven older ones of the newcomer are eight with the new one: fewer than the nine of the other peer."""
    made, clock, _ = sessions(ANNA)
    opened = []
    for peer in (*["here"] * 7, *["there"] * 9):
        clock.s += 1.0
        opened.append((peer, made.open(ANNA, peer)))
    made.open(ANNA, "here")
    ended = [(peer, n) for n, (peer, each) in enumerate(opened) if not made.lives(each)]
    assert ended == [("there", 7)]


def test_sixteen_sessions_of_one_user_end_none_of_another() -> None:
    made, clock, _ = sessions(ANNA, BEN)
    own = []
    for _ in range(SESSIONS_OF_USER):
        clock.s += 1.0
        own.append(made.open(ANNA, "here"))
    made.open(BEN, "here")
    assert all(map(made.lives, own))
    made.open(ANNA, "here")
    assert [made.lives(each) for each in own] == [False] + [True] * (SESSIONS_OF_USER - 1)


def test_the_file_of_users_is_read_when_it_has_changed() -> None:
    made, _, _ = sessions(ANNA)
    reads: list[int] = []
    stamp = SimpleNamespace(st_mtime_ns=7, st_ino=1)
    path: Any = SimpleNamespace(stat=lambda: stamp)
    made._users = SimpleNamespace(path=path, all=lambda: reads.append(1) or {"anna": ANNA})  # type: ignore[assignment, func-returns-value]
    session = made.open(ANNA, "here")
    for inode, count in ((1, 1), (1, 1), (2, 2), (2, 2)):
        stamp.st_ino = inode
        assert made.lives(session)
        assert len(reads) == count


def test_a_session_names_its_person_and_not_its_account() -> None:
    session = Session("t", "op1", Role.OPERATOR, "Anna", "k", "here", 0.0, 0.0)
    assert {key: person(session)[key] for key in ("user", "person", "role")} == {
        "user": "op1", "person": "Anna", "role": "operator",
    }  # fmt: skip


# --- requests -------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("kind", [b"application/json; charset=utf-8", b"Application/JSON ;x=1"])
def test_json_may_say_its_letters(access: Access, kind: bytes) -> None:
    assert access.refuse(Request(scope("POST", headers=[(b"content-type", kind)])), None) is None


def test_the_cookie_of_the_console_goes_with_the_browser(
    access: Access, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(access_module, "local_user", lambda _: 1000)
    monkeypatch.setattr(access.links, "take", lambda token, uid: True)
    said = access.open_console(Request(scope()), "0" * 16).headers["set-cookie"]
    assert said.startswith(f"{CONSOLE_COOKIE}=")
    assert "max-age" not in said.lower()


def test_who_could_not_log_in_has_no_role(access: Access, monkeypatch: pytest.MonkeyPatch) -> None:
    told: list[Any] = []

    async def check(name: str, password: str) -> None:
        return None

    monkeypatch.setattr(access, "_check", check)
    monkeypatch.setattr(access.hub.events, "put", lambda kind, text, who, **_: told.append(who))
    asyncio.run(access.log_in(Request(scope("POST")), "anna", "guess"))
    assert [who.role for who in told] == [Role.VIEWER]


@pytest.mark.parametrize(
    ("head", "key"), [(b"Cookie", "session t"), (b"cookie", "session t"), (b"X-Cookie", ""), (b"cookie2", "")]
)
def test_only_the_cookie_names_the_party_of_a_connection(access: Access, head: bytes, key: str) -> None:
    session = Session("t", "anna", Role.OPERATOR, "", "", "here", 0.0, 0.0)
    door = guard(access)
    door._session = lambda asked: session if asked.cookies.get(COOKIE) == "t" else None
    assert door.session_of(b"GET / HTTP/1.1\r\n" + head + b": " + f"{COOKIE}=t".encode() + b"\r\n") == key


def test_only_the_login_takes_from_the_reserve_of_logins(access: Access) -> None:
    door = guard(access)
    for path in (f"{API}/loginx", f"{API}/login/x", f"{API}/logout"):
        for _ in range(100):
            door._wait_s(scope(path=path))
    assert door._wait_s(scope(path=f"{API}/login")) == 0.0


def test_a_page_that_was_unused_for_a_minute_makes_room_for_the_seventeenth(
    access: Access, monkeypatch: pytest.MonkeyPatch
) -> None:
    asked: list[Any] = []
    monkeypatch.setattr(access.hub, "make_room", lambda *what: asked.append(what))
    session = access.sessions.open(ANNA, "here")
    monkeypatch.setattr(access, "session", lambda _: session)

    async def nothing(*_: Any) -> Any:
        return None

    headers: Headers = [(b"host", HERE), (b"origin", b"http://127.0.0.1:1"), JSON]
    socket = WebSocket({**scope(headers=headers), "type": "websocket", "extensions": {}}, nothing, nothing)
    asyncio.run(Live(access, access.hub).serve(socket))
    assert asked == [("anna", 16, 60.0)]


@pytest.mark.parametrize("extended", [True, False])
def test_a_websocket_at_another_host_is_denied_before_it_opens(access: Access, extended: bool) -> None:
    """With a status where the server can, else by closing it."""
    sent: list[Any] = []

    async def send(message: Any) -> None:
        sent.append(message)

    asked = scope(headers=[(b"host", b"evil.example")]) | {
        "type": "websocket", "extensions": {"websocket.http.response": {}} if extended else {}
    }  # fmt: skip
    asyncio.run(guard(access)(asked, None, send))  # type: ignore[arg-type]
    if extended:
        assert (sent[0]["type"], sent[0]["status"]) == ("websocket.http.response.start", 403)
    else:
        assert sent == [{"type": "websocket.close", "code": 1008}]


def test_who_logs_out_is_out_and_his_cookie_with_him(access: Access, monkeypatch: pytest.MonkeyPatch) -> None:
    told: list[Any] = []
    session = access.sessions.open(ANNA, "here")
    monkeypatch.setattr(access, "session", lambda _: session)
    monkeypatch.setattr(access.hub.events, "put", lambda kind, text, who: told.append((kind, text, who.user)))
    answer = access.log_out(Request(scope("POST")))
    assert (session.token in access.sessions._sessions, told) == (False, [("login", "logged out", "anna")])
    assert (answer.status_code, "max-age=0" in answer.headers["set-cookie"].lower()) == (204, True)


def test_an_error_has_the_letters_of_its_words() -> None:
    """Not their numbers: people read it in a terminal."""
    said = bytes(error(422, refusal(Code.SEC_05, reason=Words.NO_RECORDING(name="门"))).body)
    assert "门".encode() in said


def test_a_login_and_a_logout_need_a_body() -> None:
    """A form of another page cannot send JSON."""
    paths = openapi()["paths"]
    bodies = {path: each["post"]["requestBody"] for path, each in paths.items() if "post" in each}
    assert {path: body["required"] for path, body in bodies.items()} == {
        f"{API}/login": True, f"{API}/logout": True
    }  # fmt: skip


def test_one_password_is_checked_at_a_time_and_a_crowd_holds_no_other_peer_up(
    access: Access, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A check takes 32 MB and a tenth of a second: of eight guesses of one peer and one of another."""
    under_way, most, done = [0], [0], list[str]()

    async def check(name: str, password: str) -> None:
        under_way[0] += 1
        most[0] = max(most[0], under_way[0])
        await asyncio.sleep(0)
        under_way[0] -= 1

    monkeypatch.setattr(access, "_check", check)

    async def log_in(address: str, name: str) -> None:
        await access.log_in(Request({**scope("POST"), "client": (address, 1)}), name, "guess")
        done.append(address)

    async def all_at_once() -> None:
        crowd = [log_in("192.0.2.7", f"name{n}") for n in range(8)]
        await asyncio.gather(*crowd, log_in("192.0.2.8", "anna"))

    asyncio.run(all_at_once())
    assert (most, len(done)) == ([1], 9)
    assert done.index("192.0.2.8") <= 1


def test_who_opens_the_console_stands_in_the_journal(access: Access, monkeypatch: pytest.MonkeyPatch) -> None:
    told: list[Any] = []
    monkeypatch.setattr(access_module, "local_user", lambda _: 1000)
    monkeypatch.setattr(access.links, "take", lambda token, uid: True)
    monkeypatch.setattr(access.hub.events, "put", lambda *what: told.append(what))
    answer = access.open_console(Request(scope()), "0" * 16)
    assert told == [("login", "the page is open at the console, by user 1000 of the system")]
    # A browser must ask the next time, too; and without this path it takes no cookie with the prefix __Host-.
    assert (answer.status_code, answer.headers["location"]) == (303, "/")
    said = answer.headers["set-cookie"].lower().split("; ")
    assert {"path=/", "secure", "httponly", "samesite=strict"} <= set(said)


def test_a_link_that_is_dead_opens_no_console(access: Access, monkeypatch: pytest.MonkeyPatch) -> None:
    for uid, alive, status in ((1000, True, 303), (1000, False, 403), (None, True, 403)):
        monkeypatch.setattr(access_module, "local_user", lambda _, uid=uid: uid)
        monkeypatch.setattr(access.links, "take", lambda token, uid, alive=alive: alive)
        assert access.open_console(Request(scope()), "0" * 16).status_code == status


def test_strangers_on_this_machine_have_a_rate_too_for_what_is_no_file(access: Access) -> None:
    door, asked_for = guard(access), scope(path=f"{API}/status") | {"client": ("127.0.0.1", 1)}
    waits = [door._wait_s(asked_for) for _ in range(50)]
    assert waits[:40] == [0.0] * 40
    assert max(waits) > 0.0


def test_a_file_of_the_page_may_be_called_what_it_likes(access: Access) -> None:
    door = guard(access)
    asked = scope(path="/assets/api/one.js") | {"client": ("127.0.0.1", 1)}
    assert {door._wait_s(asked) for _ in range(200)} == {0.0}


@pytest.mark.parametrize(("own", "told"), [(b"max-age=7", "max-age=7"), (None, "no-store")])
def test_what_may_be_kept_is_said_by_the_answer_itself(access: Access, own: bytes | None, told: str) -> None:
    sent: list[Any] = []

    async def send(message: Any) -> None:
        sent.append(message)

    headers = [] if own is None else [(b"cache-control", own)]
    start = {"type": "http.response.start", "status": 200, "headers": headers}
    asyncio.run(guard(access)._with_headers(send)(start))
    assert [value for name, value in sent[0]["headers"] if name == b"cache-control"] == [told.encode()]


def test_each_route_is_described_with_the_answers_that_it_has() -> None:
    """Beside those of all routes: 403 foreign host, 413 too long, 429 too many requests."""
    found = {
        each["operationId"]: " ".join(sorted(set(each["responses"]) - {"403", "413", "429"}))
        for methods in openapi()["paths"].values()
        for each in methods.values()
    }
    assert found == {
        "login": "200 400 401 503", "logout": "204 400 401", "session": "200 401", "console": "303",
        "tags": "200 401", "status": "200 401", "samples": "200 400 401", "alarms": "200 401",
        "commissioning": "200 401 404", "traces": "200 401", "trace": "200 401 404",
        "columns": "200 400 401 404 422", "journal": "200 400 401 503", "notes": "200 401 503",
        "people": "200 401", "health": "200", "openapi": "200",
    }  # fmt: skip


@pytest.mark.parametrize(
    ("length", "status"),
    [
        (b"65536", None),
        (b"65537", 413),
        (b"-1", 413),
        (b"1e3", 413),
        (b"000000001", None),
        (b"0000000001", 413),
        (b"9" * 5000, 413),
    ],
)
def test_a_length_is_a_number_of_nine_digits_within_64_kib(
    access: Access, length: bytes, status: int | None
) -> None:
    answer = guard(access)._refuse(scope("POST", headers=[(b"host", HERE), (b"content-length", length)]))
    assert (None if answer is None else answer.status_code) == status


def test_an_application_has_the_page_of_the_installation(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Where it is given no other one."""

    class Installed:
        def answer(self, _: Request) -> Response:
            return Response("the page")

    monkeypatch.setattr(app_module, "Page", Installed)
    memory, sent = SharedMemory.create(), list[Any]()
    app = app_module.build_app(Settings("127.0.0.1", 1, -1, None, None, (), tmp_path, tmp_path), memory)

    async def receive() -> dict[str, Any]:
        return {"type": "http.request", "body": b""}

    async def send(message: Any) -> None:
        sent.append(message)

    asked = scope(headers=[(b"host", HERE)]) | {"root_path": "", "raw_path": b"/", "http_version": "1.1"}
    asyncio.run(app(asked, receive, send))
    assert (sent[0]["status"], sent[1]["body"]) == (200, b"the page")
    memory.close()


# --- addresses ------------------------------------------------------------------------------------------------------


def test_a_server_without_a_port_has_no_local_users() -> None:
    assert local_user({"client": ("127.0.0.1", 1), "server": ("/run/socket", None)}) is None


def test_a_network_of_ipv6_is_one_whatever_its_interface_is_called() -> None:
    assert {neighbourhood(each) for each in ("fe80::1%eth0", "fe80::2%7", "fe80::3")} == {"fe80::/64"}
    assert neighbourhood("192.0.2.7") == neighbourhood("::ffff:192.0.2.7") == "192.0.2.7"


def test_hosts_have_small_letters_and_brackets() -> None:
    made = Settings("2001:DB8::1", 443, -1, "c", "k", ("Gantry.Example",), Path(), Path())
    assert made.hosts == {"[2001:db8::1]:443", "[2001:db8::1]", "gantry.example:443", "gantry.example"}
    assert made._replace(port=80).hosts == {"[2001:db8::1]:80", "gantry.example:80"}
    plain = made._replace(certificate=None, port=80)
    assert plain.hosts == {"[2001:db8::1]:80", "[2001:db8::1]", "gantry.example:80", "gantry.example"}


def test_who_waits_for_too_long_is_ended_and_who_came_later_is_next() -> None:
    closed: list[str] = []
    clock = Clock()
    waiting = Waiting(10, 5.0, clock)
    for name in ("old", "new"):
        waiting.add(SimpleNamespace(close=lambda name=name: closed.append(name)), "192.0.2.7", "one")  # type: ignore[arg-type]
        clock.s += 4.0
    assert waiting.next() is not None
    assert (closed, len(waiting), waiting.next()) == (["old"], 0, None)


@pytest.mark.parametrize(
    ("state", "swapped", "kind", "uid"),
    [(1, False, 20, 1000), (10, False, 20, None), (1, True, 20, None), (1, False, 2, None)],
)
def test_only_an_established_connection_with_both_ends_names_its_user(
    monkeypatch: pytest.MonkeyPatch, state: int, swapped: bool, kind: int, uid: int | None
) -> None:
    """An answer of sock_diag, linux/inet_diag.h: where there is none, the system offers a socket that listens (10)."""
    ends = [(4711, b"\x7f\0\0\1"), (8650, b"\x7f\0\0\1")]
    (source, here), (target, there) = ends[::-1] if swapped else ends
    said = struct.pack("=IHHII", 104, kind, 0, 1, 0) + struct.pack("=BBBB", 2, state, 0, 0)
    said += struct.pack("!HH16s16s", source, target, here, there) + struct.pack("=III", 0, 7, 8)
    said += struct.pack("=IIIII", 0, 0, 0, 1000, 99)

    class System:
        def __enter__(self) -> System:
            return self

        def __exit__(self, *_: object) -> None:
            pass

        def settimeout(self, _: float) -> None:
            pass

        def send(self, _: bytes) -> None:
            pass

        def recv(self, _: int) -> bytes:
            return said

    monkeypatch.setattr(peers_module.socket, "socket", lambda *_: System())
    assert user_of(("127.0.0.1", 4711), ("127.0.0.1", 8650)) == uid


# --- recordings -----------------------------------------------------------------------------------------------------


def test_recordings_have_world_time_and_those_under_way_are_not_listed(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    for name in ("000001_x.parquet", "000002_x.parquet.part", "000003_x.txt"):
        (tmp_path / name).write_bytes(b"abc")
    monkeypatch.setenv("TZ", "Asia/Tokyo")
    time.tzset()
    try:
        (row,) = Traces(tmp_path).rows()
    finally:
        monkeypatch.undo()
        time.tzset()
    assert (row["name"], row["size"]) == ("000001_x.parquet", 3)
    assert row["modified"].endswith("+00:00")


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

    async def started(*_: Any, **__: Any) -> Process:
        return Process()

    monkeypatch.setattr(traces_module.asyncio, "create_subprocess_exec", started)
    reader = Recorded()
    assert asyncio.run(reader.columns(0, "one", 0, 1)) is None
    assert (did, reader.busy) == (["killed", "waited for"], False)


@pytest.mark.parametrize("size", [0, 1, 256 * 1024, 256 * 1024 + 1])
def test_a_recording_is_read_to_its_last_byte_and_no_further(tmp_path: Path, size: int) -> None:
    (tmp_path / "one").write_bytes(b"x" * (size + 5))  # it has grown meanwhile
    parts = [*_chunks(os.open(tmp_path / "one", os.O_RDONLY), size)]
    assert sum(map(len, parts)) == size
    assert max(map(len, parts), default=0) <= 256 * 1024


def test_a_download_names_its_size_and_a_note_its_time(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    made = routes(tmp_path)
    made._files.open = lambda wanted: ("one.parquet", 4, iter([b"four"]))  # type: ignore[method-assign]
    answer = asyncio.run(made._trace(Request({**scope(), "path_params": {"id": "x"}})))
    assert answer.headers["content-length"] == "4"
    assert answer.headers["content-disposition"] == 'attachment; filename="one.parquet"'
    row = Entry(3, {"utc": "2026-01-02", "user": "anna", "text": "a note", "place": "console"}, "")
    monkeypatch.setattr(rest_module, "read_journal", lambda *_, **__: [row])
    assert asked(made._notes)[1] == [{"seq": 3, "utc": "2026-01-02", "user": "anna", "text": "a note"}]


def test_the_page_is_a_page_by_its_folder_too(tmp_path: Path) -> None:
    (tmp_path / "index.html").write_text("<html>", encoding="utf-8")
    page = Page(tmp_path)
    kinds = {
        path: page.answer(Request(scope(path=path))).headers["content-type"] for path in ("/", "/index.html")
    }
    assert kinds == dict.fromkeys(("/", "/index.html"), "text/html; charset=utf-8")


# --- a websocket ----------------------------------------------------------------------------------------------------


def test_between_two_messages_of_a_page_others_have_their_turn(access: Access) -> None:
    """All of them are there already."""
    taken: list[str] = []

    async def receive() -> dict[str, str]:
        if len(taken) >= 100:
            return {"type": "websocket.disconnect"}
        return {"type": "websocket.receive", "text": "x"}

    socket, client = SimpleNamespace(receive=receive), SimpleNamespace(take=taken.append)

    async def whole() -> None:
        work = asyncio.create_task(Live(access, access.hub)._receive(socket, client))  # type: ignore[arg-type]
        for turn in range(1, 5):
            await asyncio.sleep(0)
            assert len(taken) == turn
        work.cancel()

    asyncio.run(whole())


def test_a_connection_whose_parts_have_failed_is_closed_without_a_code(
    access: Access, monkeypatch: pytest.MonkeyPatch
) -> None:
    live = Live(access, access.hub)

    async def fails(*_: Any) -> int:
        raise RuntimeError("gone")

    monkeypatch.setattr(live, "_receive", fails)
    monkeypatch.setattr(live, "_send", fails)
    monkeypatch.setattr(access, "place", lambda _: "remote")
    session = Session("t", "anna", Role.OPERATOR, "", "", "here", 0.0, 0.0)
    assert asyncio.run(live._run(SimpleNamespace(), session)) is None  # type: ignore[arg-type]
    assert not access.hub.clients()


def test_a_sign_of_life_is_given_twice_a_second(monkeypatch: pytest.MonkeyPatch) -> None:
    slept: list[float] = []

    async def sleep(time_s: float) -> None:
        slept.append(time_s)
        if len(slept) == 2:
            raise asyncio.CancelledError

    monkeypatch.setattr(app_module.asyncio, "sleep", sleep)
    memory: Any = SimpleNamespace(words={})
    with pytest.raises(asyncio.CancelledError):
        asyncio.run(app_module._beat(memory))
    assert (slept, list(memory.words)) == ([0.5, 0.5], [Word.GATEWAY_NS])


# --- a connection ---------------------------------------------------------------------------------------------------


def test_a_second_pause_of_an_answer_has_its_whole_time_and_its_end(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(server, "STUCK_S", 0.03)

    async def check(made: PatientProtocol, wire: Wire, place: Place) -> None:
        made.data_received(GET)
        made.pause_writing()
        made.pause_writing()
        made.resume_writing()
        await asyncio.sleep(0.05)
        assert wire.ended == ""
        made.pause_writing()
        await asyncio.sleep(0.05)
        assert wire.ended == "aborted"

    connected(check, [])


def test_the_time_of_the_first_request_begins_with_its_connection(monkeypatch: pytest.MonkeyPatch) -> None:
    """Whoever says nothing for four seconds has one left."""
    monkeypatch.setattr(server, "HEADER_S", 0.04)

    async def check(made: PatientProtocol, wire: Wire, place: Place) -> None:
        await asyncio.sleep(0.03)
        made.data_received(GET[:5])
        await asyncio.sleep(0.02)
        assert wire.ended == "aborted"

    connected(check, [])


def test_who_waits_for_a_body_that_is_no_http_is_told_that_it_ends(monkeypatch: pytest.MonkeyPatch) -> None:
    """A chunk without a length: the application gets no more of it, and must not wait."""
    got: list[str] = []

    async def app(_: Any, receive: Any, send: Any) -> None:
        while not got or got[-1] == "http.request":
            got.append((await receive())["type"])

    monkeypatch.setattr(test_patience, "app", app)

    async def check(made: PatientProtocol, wire: Wire, place: Place) -> None:
        made.data_received(b"POST / HTTP/1.1\r\nhost: x\r\ntransfer-encoding: chunked\r\n\r\n3\r\nabc\r\n")
        for _ in range(3):
            await asyncio.sleep(0)
        assert got == ["http.request"]
        made.data_received(b"no length\r\n")
        for _ in range(3):
            await asyncio.sleep(0)
        assert got == ["http.request", "http.disconnect"]
        assert b" 400 " in wire.wrote.partition(b"\r\n")[0]

    connected(check, [])


def test_a_storm_of_connections_leaves_the_loop_to_others_after_sixteen() -> None:
    async def check(door: Any, _: Any) -> None:
        taken: list[int] = []

        def accept() -> tuple[Any, tuple[str, int]]:
            if len(taken) >= 200:
                raise asyncio.CancelledError
            taken.append(1)
            return Connection(), ("192.0.2.7", 1)

        async def sock_accept(listener: Any) -> Any:
            return listener.accept()

        asyncio.get_running_loop().sock_accept = sock_accept  # type: ignore[method-assign, assignment]
        work = asyncio.create_task(door._take(SimpleNamespace(accept=accept)))
        for turn in (1, 2):
            await asyncio.sleep(0)
            assert len(taken) == 16 * turn
        work.cancel()

    with_door(check)


def test_a_cookie_behind_long_headers_names_the_party() -> None:
    """4 KiB of a request are looked at."""

    class Head(Connection):
        def recv(self, size: int, flags: int) -> bytes:
            return super().recv(size, flags)[:size]

    async def check(door: Any, room: Any) -> None:
        for length in (4090, 4100):
            door._add(Head(b"x" * length + b"cookie"), ("192.0.2.7", 9))
        door._sort()
        assert [party for _, _, party in room.added] == ["session 1", "192.0.2.7"]

    with_door(check, lambda head: "session 1" if head.endswith(b"cookie") else "")


# --- the process ----------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("refused", [False, True])
def test_the_process_ends_with_its_parent_and_comes_behind_the_scan(
    monkeypatch: pytest.MonkeyPatch, refused: bool
) -> None:
    """Where the system does not let it step back it serves all the same."""
    did: list[Any] = []

    def nice(by: int) -> None:
        did.append(f"nice {by}")
        if refused:
            raise OSError

    memory = SimpleNamespace(words={Word.SUPERVISOR: 4711})
    monkeypatch.setattr(main_module, "SharedMemory", lambda handle: did.append(handle) or memory)
    monkeypatch.setattr(main_module, "die_with_parent", did.append)
    monkeypatch.setattr(main_module.os, "nice", nice)
    monkeypatch.setattr(main_module, "build_app", lambda settings, _: f"app at {settings.port}")
    monkeypatch.setattr(main_module, "run_server", lambda app, settings: did.append(app))
    said = {
        "host": "127.0.0.1", "port": 8650, "listener": 3, "certificate": None, "key": None, "names": [],
        "root": "r", "directory": "d",
    }  # fmt: skip
    assert main_module.main([json.dumps(said), "7"]) == 0
    assert did == [7, 4711, "nice 5", "app at 8650"]


# --- the server -----------------------------------------------------------------------------------------------------


def test_frames_are_not_compressed_and_the_end_takes_two_seconds(access: Access) -> None:
    config = server.make_server(None, access.settings).config
    assert (config.ws_per_message_deflate, config.timeout_graceful_shutdown) == (False, 2)
    assert (config.limit_concurrency, config.ws_max_size) == (256, 16_384)
    assert config.h11_max_incomplete_event_size == 16_384
    # Nothing of a client is believed of where it is, nor written line by line.
    assert (config.proxy_headers, config.access_log, config.server_header) == (False, False, False)


@pytest.mark.parametrize(
    ("level", "said", "kept"),
    [
        (logging.ERROR, "the program failed", True), (logging.WARNING, "a client has sent nonsense", False),
        (logging.ERROR, "Invalid UTF-8 sequence received from client.", False),
    ],
)  # fmt: skip
def test_only_errors_of_the_program_are_in_the_log_of_clients(level: int, said: str, kept: bool) -> None:
    record = logging.LogRecord("uvicorn.error.clients", level, "", 0, said, (), None)
    assert bool(logging.getLogger("uvicorn.error.clients").filter(record)) is kept


# --- limits ---------------------------------------------------------------------------------------------------------


def test_limits_of_the_page_are_those_of_the_manual() -> None:
    """The table of docs/explanation/security.md, in bytes, seconds and numbers."""
    wanted: dict[Any, dict[str, float]] = {
        settings_module: {
            "BODY_MAX": 65_536, "CONNECTIONS": 64, "CONNECTIONS_REMOTE": 8, "CONNECTIONS_OF_USER": 16,
            "UNUSED_S": 60.0, "REQUESTS_PER_S": 10.0, "REQUESTS_RESERVE": 40.0, "LOGINS_PER_S": 5.0,
            "LOGINS_RESERVE": 20.0, "HEADER_S": 5.0, "STUCK_S": 5.0,
        },
        sessions_module: {
            "IDLE_S": 900.0, "WHOLE_S": 28_800.0, "FAILURES": 5, "LOCK_MAX_S": 900.0, "SESSIONS_OF_USER": 16,
            "_REMEMBERED": 10_000,
        },
        door_module: {"WAITING": 256, "ARRIVALS": 1024},
        live_module: {"_STUCK_S": 5.0},
        rest_module: {"JOURNAL_MAX": 10_000, "NOTES_MAX": 50, "NOTES_PER_S": 4.0},
        traces_module: {"TIME_MAX_S": 30.0, "_LISTED": 500},
    }  # fmt: skip
    for module, limits in wanted.items():
        assert {name: getattr(module, name) for name in limits} == limits
