"""The doors of the gateway by hand: whose role, which page, which host, how long, and who is at the console."""

from __future__ import annotations

import asyncio
import os
from collections.abc import Iterator
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest
import uvicorn
from starlette.requests import Request
from starlette.websockets import WebSocket

from gantryctl.errors import StateError
from gantryctl.gateway import access as access_module
from gantryctl.gateway import peers
from gantryctl.gateway.access import COOKIE, Access
from gantryctl.gateway.door import Door
from gantryctl.gateway.guard import CSP, _limited, deny, error
from gantryctl.gateway.live import Live
from gantryctl.gateway.routes import API, ROUTES
from gantryctl.gateway.sessions import FAILURES
from gantryctl.gateway.settings import BODY_MAX, Settings
from gantryctl.gateway.traces import Traces
from gantryctl.program import Code
from gantryctl.program.alarms.log import refusal
from gantryctl.program.alarms.words import Words
from gantryctl.service.clients.console_link import LinkTaker
from gantryctl.service.clients.hub import Hub
from gantryctl.service.memory.memory import SharedMemory, Source
from gantryctl.service.protocol.messages import Identity
from gantryctl.service.protocol.roles import Action, Role
from gantryctl.service.supervisor.users import Users
from support.gateway_by_hand import HERE, JSON, Headers, guard, scope

PASSWORD = "correct horse battery"


@pytest.fixture(scope="module")
def users(tmp_path_factory: pytest.TempPathFactory) -> bytes:
    """File of an operator and a viewer, made once: a password takes 0.1 s of a processor."""
    made = Users(tmp_path_factory.mktemp("users"))
    for role in (Role.OPERATOR, Role.VIEWER):
        made.add(str(role), role, PASSWORD)
    return made.path.read_bytes()


@pytest.fixture
def access(tmp_path: Path, users: bytes) -> Iterator[Access]:
    memory = SharedMemory.create()
    made = Access(
        Settings("127.0.0.1", 1, -1, None, None, (), tmp_path, tmp_path),
        Hub(memory, Source.WEB),
        LinkTaker(memory.words),
    )
    made.users.path.write_bytes(users)
    yield made
    memory.close()


def cookie_of(access: Access, role: Role) -> tuple[bytes, bytes]:
    session = access.sessions.open(access.users.all()[str(role)], "here")
    return b"cookie", f"{COOKIE}={session.token}".encode()


@pytest.mark.parametrize(
    ("role", "action", "status"),
    [
        (None, Action.VIEW, 401), (Role.VIEWER, Action.VIEW, None), (Role.VIEWER, Action.TRACES, 403),
        (Role.OPERATOR, Action.TRACES, None),
    ],
)  # fmt: skip
def test_a_route_asks_for_its_role(
    access: Access, role: Role | None, action: Action, status: int | None
) -> None:
    headers = [] if role is None else [cookie_of(access, role)]
    answer = access.refuse(Request(scope(headers=headers)), action)
    assert (None if answer is None else answer.status_code) == status


def test_a_password_that_is_too_long_costs_no_check(access: Access, monkeypatch: pytest.MonkeyPatch) -> None:
    """256 characters are looked at, one more is not."""
    asked: list[int] = []
    monkeypatch.setattr(access.users, "check", lambda _, password: asked.append(len(password)))
    for length in (256, 257):
        assert asyncio.run(access._check("operator", "x" * length)) is None
    assert asked == [256]


@pytest.mark.parametrize(
    ("headers", "status"),
    [
        ([JSON], None), ([JSON, (b"origin", b"http://127.0.0.1:1")], None),
        ([JSON, (b"origin", b"HTTP://LOCALHOST:1")], None),
        ([JSON, (b"origin", b"http://evil.example")], 403), ([JSON, (b"origin", b"null")], 403),
        ([JSON, (b"origin", b"")], 403),
        ([(b"content-type", b"text/plain")], 400), ([], 400),
        ([(b"content-type", b"application/x-www-form-urlencoded")], 400),
    ],
)  # fmt: skip
def test_only_the_own_page_posts_and_only_json(access: Access, headers: Headers, status: int | None) -> None:
    answer = access.refuse(Request(scope("POST", headers=headers)), None)
    assert (None if answer is None else answer.status_code) == status


def test_evidence_is_for_those_who_may_have_it() -> None:
    needed = {(each.method, each.path): each.action for each in ROUTES}
    assert needed["GET", "/status"] is Action.VIEW
    assert needed["GET", "/traces/{id}"] is Action.TRACES
    assert needed["GET", "/journal"] is Action.JOURNAL


def test_another_role_in_the_file_ends_the_session(access: Access) -> None:
    session = access.sessions.open(access.users.all()["operator"], "here")
    assert access.sessions.lives(session)
    text = access.users.path.read_text(encoding="utf-8")
    new = text.replace('"role": "operator"', '"role": "viewer"').replace(
        '"role":"operator"', '"role":"viewer"'
    )
    assert new != text
    access.users.path.write_text(new, encoding="utf-8")
    assert not access.sessions.lives(session)


def test_a_users_file_that_is_renamed_into_place_is_read(access: Access) -> None:
    """A backup may bring the time of the file before along."""
    session = access.sessions.open(access.users.all()["operator"], "here")
    assert access.sessions.lives(session)
    path = access.users.path
    then, text = path.stat().st_mtime_ns, path.read_text(encoding="utf-8")
    access.users.remove("operator")
    gone = path.read_bytes()
    path.write_text(text, encoding="utf-8")
    os.utime(path, ns=(then, then))
    assert access.sessions.lives(session)
    beside = path.with_name("beside")
    beside.write_bytes(gone)
    os.utime(beside, ns=(then, then))
    beside.replace(path)
    assert not access.sessions.lives(session)


def test_a_right_password_forgets_the_wrong_ones(access: Access) -> None:
    async def log_in(password: str) -> int:
        return (await access.log_in(Request(scope("POST")), "viewer", password)).status_code

    async def tries() -> list[int]:
        wrong = ["wrong"] * (FAILURES - 1)
        return [await log_in(each) for each in [*wrong, PASSWORD, *wrong, PASSWORD]]

    found = asyncio.run(tries())
    assert found == [*[401] * (FAILURES - 1), 200] * 2


@pytest.mark.parametrize("right", [True, False])
def test_a_login_is_of_its_peer_and_its_account_is_cut(
    access: Access, monkeypatch: pytest.MonkeyPatch, right: bool
) -> None:
    """Limits know a network of IPv6 by its first 64 bits; 64 letters of a name are enough for the journal."""
    told: list[Any] = []
    user = access.users.all()["viewer"]

    async def check(name: str, password: str) -> Any:
        return user if right else None

    monkeypatch.setattr(access, "_check", check)
    monkeypatch.setattr(
        access.hub.events, "put", lambda kind, text, who, **more: told.append((text, who.user, more))
    )
    asked = {**scope("POST"), "client": ("2001:db8::7", 1)}
    asyncio.run(access.log_in(Request(asked), "v" * 100, "guess"))
    if right:
        (session,) = access.sessions._sessions.values()
        assert session.peer == "2001:db8::/64"
        assert told == [("logged in", "viewer", {"address": "2001:db8::7"})]
    else:
        assert list(access.locks._failures) == [("v" * 64, "2001:db8::/64")]
        assert told == [("refused: wrong name or password, 1 times", "v" * 64, {"address": "2001:db8::7"})]


def test_a_damaged_users_file_counts_as_no_guess(access: Access, monkeypatch: pytest.MonkeyPatch) -> None:
    async def check(name: str, password: str) -> Any:
        raise StateError("damaged")

    monkeypatch.setattr(access, "_check", check)
    assert asyncio.run(access.log_in(Request(scope("POST")), "viewer", PASSWORD)).status_code == 503
    assert not access.locks._failures


@pytest.mark.parametrize("place", ["console", "remote"])
def test_who_is_refused_stands_in_the_journal_with_the_place(
    access: Access, monkeypatch: pytest.MonkeyPatch, place: str
) -> None:
    told: list[Any] = []
    monkeypatch.setattr(access, "place", lambda _: place)
    monkeypatch.setattr(access.hub.refusals, "put_text", lambda who, *what: told.append((who, *what[:2])))
    access.refuse(
        Request(scope(path="/api/v1/traces", headers=[cookie_of(access, Role.VIEWER)])), Action.TRACES
    )
    assert told == [(Identity("", "viewer", Role.VIEWER, place), "read", "GET /api/v1/traces")]


def test_who_logs_in_again_in_one_browser_ends_the_session_before(
    access: Access, monkeypatch: pytest.MonkeyPatch
) -> None:
    user = access.users.all()["viewer"]

    async def check(name: str, password: str) -> Any:
        return user

    monkeypatch.setattr(access, "_check", check)
    cookie = cookie_of(access, Role.OPERATOR)
    before = access.session(Request(scope(headers=[cookie])))
    assert before is not None
    asyncio.run(access.log_in(Request(scope("POST", headers=[cookie])), "viewer", PASSWORD))
    assert not access.sessions.lives(before)
    assert len(access.sessions._sessions) == 1


def test_a_link_is_used_up_by_its_browser_alone(access: Access, monkeypatch: pytest.MonkeyPatch) -> None:
    """Whoever carries it here from afar leaves it to the one it was made for."""
    taken: list[str] = []
    monkeypatch.setattr(access.links, "take", lambda token, uid: not taken.append(token))
    for uid, status in ((None, 403), (1000, 303)):
        monkeypatch.setattr(access_module, "local_user", lambda _, uid=uid: uid)
        assert access.open_console(Request(scope()), "0" * 16).status_code == status
    assert taken == ["0" * 16]


def test_a_forwarded_browser_is_at_no_console(access: Access, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(access_module, "local_user", lambda asked: 1000)
    monkeypatch.setattr(access.links, "take", lambda token, uid: True)
    tunnel: Headers = [(b"x-forwarded-for", b"192.0.2.9")]
    assert access.open_console(Request(scope(headers=tunnel)), "0" * 16).status_code == 403
    assert access.open_console(Request(scope()), "0" * 16).status_code == 303


def test_a_console_is_a_cookie_its_user_and_nobody_between(monkeypatch: pytest.MonkeyPatch) -> None:
    uids = [1000]
    monkeypatch.setattr(peers, "local_user", lambda asked: uids[0])
    consoles = peers.Consoles()
    cookie = consoles.open(1000)
    assert consoles.proves(scope(), cookie)
    assert not consoles.proves(scope(), None)
    assert not consoles.proves(scope(headers=[(b"via", b"1.1 proxy")]), cookie)
    uids[0] = 1001
    assert not consoles.proves(scope(), cookie)


@pytest.mark.parametrize(
    ("headers", "status"),
    [
        ([(b"host", HERE)], None), ([(b"host", b"evil.example")], 403), ([(b"host", b"evil.example:1")], 403),
        ([], 403), ([(b"host", b"LocalHost:1")], None),
        ([(b"host", HERE), (b"content-length", str(BODY_MAX).encode())], None),
        ([(b"host", HERE), (b"content-length", str(BODY_MAX + 1).encode())], 413),
        ([(b"host", HERE), (b"content-length", b"-1")], 413), ([(b"host", b"127.0.0.1:2")], 403),
        # int() of a long text costs time: nine digits are looked at.
        ([(b"host", HERE), (b"content-length", b"000065536")], None),
        ([(b"host", HERE), (b"content-length", b"0000065536")], 413),
        ([(b"host", HERE), (b"transfer-encoding", b"chunked")], None),
        ([(b"host", HERE), (b"transfer-encoding", b"chunked"), (b"content-length", b"0")], 400),
    ],
)  # fmt: skip
def test_only_a_request_to_us_of_a_size_is_taken(
    access: Access, headers: Headers, status: int | None
) -> None:
    answer = guard(access)._refuse(scope("POST", headers=headers))
    assert (None if answer is None else answer.status_code) == status


def test_a_body_in_parts_ends_at_its_limit() -> None:
    part = b"x" * (BODY_MAX * 3 // 5)

    async def receive() -> dict[str, Any]:
        return {"type": "http.request", "body": part, "more_body": True}

    async def two() -> list[str]:
        limited = _limited(receive)
        return [(await limited())["type"] for _ in range(2)]

    assert asyncio.run(two()) == ["http.request", "http.disconnect"]


@pytest.mark.parametrize(("more", "kinds"), [(0, ["request"] * 2), (1, ["request", "disconnect"])])
def test_a_body_of_64_kib_is_whole_and_a_byte_more_is_cut_off(more: int, kinds: list[str]) -> None:
    parts = iter([b"x" * (BODY_MAX - 1), b"x" * (1 + more)])

    async def receive() -> dict[str, Any]:
        return {"type": "http.request", "body": next(parts), "more_body": True}

    async def both() -> list[str]:
        limited = _limited(receive)
        return [(await limited())["type"] for _ in range(2)]

    assert asyncio.run(both()) == [f"http.{kind}" for kind in kinds]


def test_strangers_and_logins_wait_and_who_is_logged_in_does_not(access: Access) -> None:
    door, inside = guard(access), []
    door._session = lambda connection: inside[0] if inside else None
    for path in (f"{API}/status", f"{API}/login"):
        assert any(door._wait_s(scope(path=path)) > 0.0 for _ in range(10_000))
    inside.append(SimpleNamespace(token="0" * 32))
    assert door._wait_s(scope(path=f"{API}/status")) == 0.0


def test_who_asks_too_often_is_refused_with_the_time_to_wait(access: Access) -> None:
    door = guard(access)
    answers = [door._refuse(scope(path=f"{API}/status", headers=[(b"host", HERE)])) for _ in range(500)]
    refused = [answer for answer in answers if answer is not None]
    assert answers[0] is None
    assert {(answer.status_code, answer.headers["retry-after"]) for answer in refused} == {(429, "1")}


@pytest.mark.parametrize(("address", "waits"), [("127.0.0.1", False), ("::1", False), ("192.0.2.7", True)])
def test_files_of_the_page_wait_for_nobody_on_this_machine_alone(
    access: Access, address: str, waits: bool
) -> None:
    """A flood from there keeps no new page away; one from elsewhere costs this machine as little as any other."""
    door, asked = guard(access), scope(path="/index.html") | {"client": (address, 1)}
    assert any(door._wait_s(asked) > 0.0 for _ in range(500)) is waits


def test_sessions_have_a_rate_each(access: Access) -> None:
    door, token = guard(access), ["1" * 32]
    door._session = lambda connection: SimpleNamespace(token=token[0])  # type: ignore[assignment, return-value]
    assert any(door._wait_s(scope(path=f"{API}/status")) > 0.0 for _ in range(10_000))
    token[0] = "2" * 32
    assert door._wait_s(scope(path=f"{API}/status")) == 0.0


def test_a_login_has_a_rate_of_its_own(access: Access) -> None:
    """Twenty at once, whatever else the same stranger has asked for; each costs a tenth of a second."""
    door = guard(access)
    for _ in range(10_000):
        door._wait_s(scope(path=f"{API}/status"))
    waits = [door._wait_s(scope(path=f"{API}/login")) for _ in range(25)]
    assert waits[:20] == [0.0] * 20
    assert min(waits[20:]) > 0.0


@pytest.mark.parametrize("certificate", [None, "cert.pem"])
def test_only_a_page_behind_tls_asks_for_it_the_next_time(access: Access, certificate: str | None) -> None:
    door = guard(access)
    door._settings = access.settings._replace(certificate=certificate)
    sent: list[Any] = []

    async def send(message: Any) -> None:
        sent.append(message)

    asyncio.run(door._with_headers(send)({"type": "http.response.start", "status": 200, "headers": []}))
    names = {name for name, _ in sent[0]["headers"]}
    assert (b"strict-transport-security" in names) is (certificate is not None)


def test_a_remote_address_has_eight_connections_and_this_machine_64(access: Access) -> None:
    """Of HTTP and of WebSockets alike: a flood from one place leaves room for the others."""
    for address, most in (("192.0.2.7", 8), ("2001:db8::7", 8), ("127.0.0.1", 64)):
        http = Door(uvicorn.Config(lambda: None))
        for places in (Live(access, access.hub)._places, http._places):
            assert [places.take(address) is not None for _ in range(most + 1)] == [True] * most + [False]


@pytest.mark.parametrize(("proved", "place"), [(True, "console"), (False, "remote")])
def test_only_who_has_proved_it_is_at_the_console(
    access: Access, monkeypatch: pytest.MonkeyPatch, proved: bool, place: str
) -> None:
    monkeypatch.setattr(access._consoles, "proves", lambda asked, cookie: proved)
    assert access.place(Request(scope())) == place


def test_no_page_may_frame_ours() -> None:
    assert "frame-ancestors 'none'" in CSP.split("; ")


@pytest.mark.parametrize(("role", "restarts"), [(Role.OPERATOR, True), (Role.VIEWER, False)])
def test_reading_restarts_the_idle_time_and_a_refusal_does_not(
    access: Access, role: Role, restarts: bool
) -> None:
    cookie = cookie_of(access, role)
    session = access.session(Request(scope(headers=[cookie])))
    assert session is not None
    session.used_s -= 600.0
    before_s = session.used_s
    access.refuse(Request(scope(headers=[cookie])), Action.TRACES)
    assert (session.used_s > before_s + 1.0) is restarts


@pytest.mark.parametrize(
    ("origin", "logged_in"),
    [(None, True), (b"http://evil.example", True), (b"null", True), (b"http://127.0.0.1:1", False)],
)
def test_a_websocket_of_another_page_or_of_nobody_is_refused(
    access: Access, origin: bytes | None, logged_in: bool
) -> None:
    sent: list[str] = []

    async def receive() -> Any:
        return {"type": "websocket.disconnect"}

    async def send(message: Any) -> None:
        sent.append(str(message["type"]))

    headers = [cookie_of(access, Role.VIEWER)] if logged_in else []
    headers += [] if origin is None else [(b"origin", origin)]
    connection = {"type": "websocket", "client": ("127.0.0.1", 1), "headers": headers}
    asyncio.run(Live(access, access.hub).serve(WebSocket(connection, receive, send)))
    assert sent == ["websocket.close"]


@pytest.mark.parametrize("place", ["console", "remote"])
def test_a_websocket_is_of_its_person_and_at_its_place(
    access: Access, monkeypatch: pytest.MonkeyPatch, place: str
) -> None:
    """Two accounts of one person are no two persons, and only the console of the machine is one."""
    seen: list[tuple[object, ...]] = []

    def connect(*who: object) -> None:
        seen.append(who)
        raise asyncio.CancelledError

    async def receive() -> Any:
        return {"type": "websocket.connect"}

    async def send(_: Any) -> None:
        pass

    cookie = cookie_of(access, Role.VIEWER)
    session = access.session(Request(scope(headers=[cookie])))
    assert session is not None
    session.person = "Eve"
    monkeypatch.setattr(access.sessions, "lives", lambda _: True)
    monkeypatch.setattr(access, "place", lambda _: place)
    monkeypatch.setattr(access.hub, "connect", connect)
    headers = [cookie, (b"origin", b"http://127.0.0.1:1")]
    connection = {"type": "websocket", "client": ("127.0.0.1", 1), "headers": headers}
    with pytest.raises(asyncio.CancelledError):
        asyncio.run(Live(access, access.hub).serve(WebSocket(connection, receive, send)))
    assert seen == [("viewer", Role.VIEWER, place, "Eve")]


@pytest.mark.parametrize(("origin", "status"), [(b"http://evil.example", 403), (b"http://127.0.0.1:1", 401)])
def test_a_page_of_ours_without_a_session_is_told_to_log_in(
    access: Access, origin: bytes, status: int
) -> None:
    sent: list[Any] = []

    async def receive() -> Any:
        return {"type": "websocket.connect"}

    async def send(message: Any) -> None:
        sent.append(message)

    connection = {
        "type": "websocket", "client": ("127.0.0.1", 1), "headers": [(b"origin", origin)],
        "extensions": {"websocket.http.response": {}},
    }  # fmt: skip
    asyncio.run(Live(access, access.hub).serve(WebSocket(connection, receive, send)))
    assert sent[0]["status"] == status


def test_only_files_of_the_folder_itself_are_recordings(tmp_path: Path) -> None:
    folder = tmp_path / "traces"
    folder.mkdir()
    secret = tmp_path / "secret.parquet"
    secret.write_bytes(b"secret")
    (folder / "run.parquet").write_bytes(b"run")
    (folder / "notes.txt").write_bytes(b"notes")
    (folder / "link.parquet").symlink_to(secret)
    traces = Traces(folder)
    assert [name for name, _, _ in traces._files()] == ["run.parquet"]
    assert traces._handle("link.parquet") is None
    found = traces._handle("run.parquet")
    assert found is not None
    os.close(found[2])


def test_a_websocket_is_refused_as_against_the_policy_where_no_status_can_be_sent() -> None:
    sent: list[Any] = []

    async def send(message: Any) -> None:
        sent.append(message)

    async def receive() -> Any:
        raise AssertionError

    answer = error(403, refusal(Code.SEC_04, reason=Words.FOREIGN_HOST))
    asyncio.run(deny({"type": "websocket"}, receive, send, answer))
    assert sent == [{"type": "websocket.close", "code": 1008}]
