"""Logging in: how often one may guess, and what happens when the file of users is damaged."""

from __future__ import annotations

import asyncio
from collections import Counter
from collections.abc import Iterator
from pathlib import Path

import pytest
from starlette.requests import Request
from starlette.responses import Response

from gantryctl.gateway.access import COOKIE, Access
from gantryctl.gateway.sessions import FAILURES
from gantryctl.gateway.settings import Settings
from gantryctl.service.hub import Hub
from gantryctl.service.memory import SharedMemory, Source
from gantryctl.service.roles import Role

PASSWORD = "correct horse battery"


@pytest.fixture
def access(tmp_path: Path) -> Iterator[Access]:
    memory = SharedMemory.create()
    found = Access(Settings("127.0.0.1", 1, -1, None, None, (), tmp_path, tmp_path), Hub(memory, Source.WEB))
    found.users.add("anna", Role.OPERATOR, PASSWORD)
    yield found
    memory.close()


def asking(address: str = "192.0.2.7", cookie: str = "") -> Request:
    headers = [(b"cookie", f"{COOKIE}={cookie}".encode())] if cookie else []
    return Request({"type": "http", "method": "GET", "client": (address, 1), "headers": headers})


def test_guesses_at_the_same_time_count_one_after_the_other(access: Access) -> None:
    async def guesses() -> list[Response]:
        tries = (access.log_in(asking(), "anna", f"wrong {n}") for n in range(36))
        return list(await asyncio.gather(*tries))

    found = Counter(answer.status_code for answer in asyncio.run(guesses()))
    assert found[401] == FAILURES  # the sixth must wait a second: longer than it takes to say no to the rest
    assert found == {401: FAILURES, 429: 36 - FAILURES}


def test_a_whole_network_of_ipv6_is_one_guesser(access: Access) -> None:
    async def guesses() -> list[int]:
        tries = [asking(f"2001:db8::{n}") for n in range(1, FAILURES + 2)]
        return [(await access.log_in(each, "anna", "wrong")).status_code for each in tries]

    assert asyncio.run(guesses())[-1] == 429


def test_a_damaged_file_of_users_lets_nobody_in_and_is_named(access: Access) -> None:
    async def log_in() -> Response:
        return await access.log_in(asking(), "anna", PASSWORD)

    answer = asyncio.run(log_in())
    cookie = answer.headers["set-cookie"].partition("=")[2].partition(";")[0]
    assert access.session(asking(cookie=cookie)) is not None
    access.users.path.write_text("{", encoding="utf-8")
    assert access.session(asking(cookie=cookie)) is None
    answer = asyncio.run(log_in())
    assert answer.status_code == 503
    assert b"users.json cannot be read" in bytes(answer.body)
