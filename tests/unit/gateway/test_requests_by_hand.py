"""Requests that a door is seldom asked: odd headers, links, logins and what each route answers, by hand."""

from __future__ import annotations

import asyncio
from typing import Any

import pytest
from starlette.requests import Request

from gantryctl.gateway import access as access_module
from gantryctl.gateway.access import CONSOLE_COOKIE, COOKIE, Access
from gantryctl.gateway.guard import error
from gantryctl.gateway.routes import API, openapi
from gantryctl.gateway.sessions import Session
from gantryctl.program import Code
from gantryctl.program.alarms.log import refusal
from gantryctl.program.alarms.words import Words
from gantryctl.service.protocol.roles import Role
from support.gateway_by_hand import ANNA, HERE, guard, scope


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


def test_a_link_that_a_proxy_has_carried_here_is_not_used_up(
    access: Access, monkeypatch: pytest.MonkeyPatch
) -> None:
    used: list[str] = []
    monkeypatch.setattr(access_module, "local_user", lambda _: 1000)
    monkeypatch.setattr(access.links, "take", lambda token, uid: used.append(token) or True)
    for headers, found in (([(b"via", b"1.1 proxy")], []), ([], ["0" * 16])):
        answer = access.open_console(Request(scope(headers=headers)), "0" * 16)
        assert (answer.status_code, used) == (303 if found else 403, found)


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


# --- headers --------------------------------------------------------------------------------------------------------


def test_every_answer_has_the_headers_that_keep_other_pages_out(access: Access) -> None:
    """docs/explanation/security.md: nothing runs here but files of this page, and no other page shows or loads them."""
    sent: list[Any] = []

    async def send(message: Any) -> None:
        sent.append(message)

    asyncio.run(
        guard(access)._with_headers(send)({"type": "http.response.start", "status": 200, "headers": []})
    )
    told = {name.decode(): value.decode() for name, value in sent[0]["headers"]}
    rules = dict(rule.split(" ", 1) for rule in told.pop("content-security-policy").split("; "))
    assert rules == {
        **dict.fromkeys(("script-src", "style-src", "connect-src", "font-src", "manifest-src"), "'self'"),
        **dict.fromkeys(("default-src", "base-uri", "form-action", "frame-ancestors"), "'none'"),
        "img-src": "'self' data:",
    }
    assert told == {
        "x-content-type-options": "nosniff", "x-frame-options": "DENY", "referrer-policy": "no-referrer",
        "cross-origin-opener-policy": "same-origin", "cross-origin-resource-policy": "same-origin",
        "permissions-policy": "camera=(), microphone=(), geolocation=()", "cache-control": "no-store",
    }  # fmt: skip


# --- logins ---------------------------------------------------------------------------------------------------------


def logins(access: Access, monkeypatch: pytest.MonkeyPatch, *passwords: str) -> tuple[list[int], list[str]]:
    """Statuses of logins that are sent at once by user 7 of this machine, and which of them were checked."""
    checked: list[str] = []

    async def check(name: str, password: str) -> Any:
        await asyncio.sleep(0)
        checked.append(password)
        return ANNA if password == "right" else None

    monkeypatch.setattr(access_module, "peer_of", lambda _: "uid 7")
    monkeypatch.setattr(access, "_check", check)

    async def all_at_once() -> list[int]:
        asked = (access.log_in(Request(scope("POST")), "anna", password) for password in passwords)
        return [answer.status_code for answer in await asyncio.gather(*asked)]

    return asyncio.run(all_at_once()), checked


def test_of_guesses_that_are_sent_at_once_five_are_checked(
    access: Access, monkeypatch: pytest.MonkeyPatch
) -> None:
    assert logins(access, monkeypatch, *["wrong"] * 8) == ([401] * 5 + [429] * 3, ["wrong"] * 5)


def test_a_right_password_takes_the_failures_of_its_peer_away(
    access: Access, monkeypatch: pytest.MonkeyPatch
) -> None:
    tries = [*["wrong"] * 4, "right"] * 2
    statuses, checked = logins(access, monkeypatch, *tries)
    assert (statuses, checked) == ([*[401] * 4, 200] * 2, tries)


def test_a_longer_name_is_another_one(access: Access, monkeypatch: pytest.MonkeyPatch) -> None:
    """Failures are counted by its first 64 letters, and all of it is looked for among the users."""
    checked: list[str] = []

    async def check(name: str, _: str) -> None:
        checked.append(name)

    monkeypatch.setattr(access, "_check", check)
    asyncio.run(access.log_in(Request(scope("POST")), "a" * 65, "guess"))
    assert checked == ["a" * 65]
    assert list(access.locks._failures) == [("a" * 64, "192.0.2.7")]
