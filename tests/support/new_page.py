"""What a browser does that opens the page now: its files, the login, the WebSocket, the first picture."""

from __future__ import annotations

import json
import re
import time
from contextlib import suppress
from http.client import HTTPConnection, HTTPException
from typing import NamedTuple

from websockets.exceptions import WebSocketException

from gantryctl.gateway.access import COOKIE
from support.service_process import PASSWORD, PATIENCE_S, Page, Service

TRIES = 20
"""A browser asks again when a connection that it kept was ended, and the page connects again by itself."""


class Opened(NamedTuple):
    """A page, and seconds from its begin to its files, to its session and to its first picture."""

    page: Page
    files_s: float
    session_s: float
    picture_s: float
    asked_again: int


class Browser:
    """Requests over a connection that is kept while the service keeps it, with a session or without."""

    def __init__(self, address: str, cookie: str = "") -> None:
        self._address = address
        self._headers = {"Cookie": f"{COOKIE}={cookie}"} if cookie else {}
        self.asked_again = 0
        self._kept: HTTPConnection | None = None

    def ask(self, method: str, path: str, body: object = None) -> tuple[str, str]:
        """The answer, and the cookie that it sets."""
        for _ in range(TRIES):
            kept = self._kept = self._kept or HTTPConnection(self._address, timeout=PATIENCE_S)
            try:
                kind = {} if body is None else {"Content-Type": "application/json"}
                kept.request(method, path, body and json.dumps(body), self._headers | kind)
                answer = kept.getresponse()
                text = answer.read().decode()
            except (OSError, HTTPException):
                self.asked_again += 1
                self.close()
                continue
            assert answer.status == 200, f"{method} {path}: {answer.status} {text:.200}"
            cookie = re.match(f"{COOKIE}=([^;]*)", answer.headers.get("set-cookie", ""))
            return text, cookie[1] if cookie else ""
        raise AssertionError(f"{method} {path}: no answer in {TRIES} tries")

    def close(self) -> None:
        """End the connection."""
        if self._kept is not None:
            self._kept.close()
            self._kept = None


def files_of(index: str) -> list[str]:
    """What the first file of the page names, the script first."""
    return sorted(re.findall(r'(?:src|href)="(/[^"]+)"', index), key=lambda path: not path.endswith(".js"))


def open_page(service: Service, user: str, cookie: str = "") -> Opened:
    """Open the page as a browser does, with its files where they are built in; with a login unless it has a session."""
    begin_s = time.monotonic()
    browser = Browser(service.address, cookie)
    with suppress(AssertionError):  # 503: the page is not built into this installation
        for path in files_of(browser.ask("GET", "/")[0]):
            browser.ask("GET", path)
    files_s = time.monotonic() - begin_s
    if not cookie:
        _, cookie = browser.ask("POST", "/api/v1/login", {"user": user, "password": PASSWORD})
    session_s = time.monotonic() - begin_s
    browser.close()
    for _ in range(TRIES):
        try:
            page = service.page_of(cookie)
            break
        except (OSError, WebSocketException):
            browser.asked_again += 1
    else:
        raise AssertionError(f"no WebSocket in {TRIES} tries")
    return Opened(page, files_s, session_s, time.monotonic() - begin_s, browser.asked_again)
