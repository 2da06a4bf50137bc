"""A page of somebody else in the browser of an operator who is logged in: whatever it tries is refused.

From three addresses: another port of the same host, to which the browser does send the cookie (ports do not count for
SameSite), another name, and a name that was rebound to this machine.
"""

from __future__ import annotations

import threading
from collections.abc import Iterator
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from typing import Any

import pytest
from playwright.sync_api import BrowserContext, Page, expect

from gantryctl.service.recorder.journal.reading import read_journal
from support.browser import FOREIGN, address, enter, take_control
from support.service_process import PASSWORD, Service
from support.service_process import Page as Watcher


class _Site(BaseHTTPRequestHandler):
    def do_GET(self) -> None:
        self.send_response(200)
        self.send_header("Content-Type", "text/html")
        self.end_headers()
        self.wfile.write(b"<!doctype html><title>prize draw</title><body>")

    def log_message(self, *_: object) -> None:
        """Nothing on the terminal."""


@pytest.fixture(scope="module")
def site() -> Iterator[int]:
    """Port of the foreign site."""
    with ThreadingHTTPServer(("127.0.0.1", 0), _Site) as server:
        threading.Thread(target=server.serve_forever, daemon=True).start()
        yield server.server_port
        server.shutdown()


@pytest.fixture(params=["127.0.0.1", "localhost", FOREIGN])
def foreign(
    request: pytest.FixtureRequest, site: int, context: BrowserContext, page_service: Service
) -> Page:
    """The operator's page is open, with control; beside it the foreign one."""
    own = enter(context, page_service, "operator")
    take_control(own)
    page = context.new_page()
    page.goto(f"http://{request.param}:{site}/")
    return page


def logins(service: Service) -> list[Any]:
    rows = [row.values for row in read_journal(service.directory)]
    return [row["text"] for row in rows if row["kind"] == "login" and row["text"].startswith("logged")]


def still_in(context: BrowserContext, watcher: Watcher, epoch: int) -> None:
    """The operator is logged in and has control, and nothing was commanded."""
    own = context.pages[0]
    expect(own.locator("[data-stale=false]")).to_be_attached()
    expect(own.get_by_test_id("control")).to_contain_text("you")
    assert own.evaluate("async () => (await fetch('/api/v1/session')).status") == 200
    assert watcher.look()["epoch"] == epoch


def test_it_gets_no_connection(
    foreign: Page, context: BrowserContext, page_service: Service, watcher: Watcher
) -> None:
    epoch = watcher.look()["epoch"]
    ended = foreign.evaluate(
        """(url) => new Promise((done) => {
            const socket = new WebSocket(url);
            socket.onopen = () => done('open');
            socket.onclose = (event) => done(event.code);
        })""",
        f"ws://{page_service.address}/api/v1/socket",
    )
    assert ended == 1006  # refused before it opened
    still_in(context, watcher, epoch)


ASK = """async ([url, options]) => {
    try {
        const answer = await fetch(url, { credentials: 'include', ...options });
        return [answer.type, answer.status];
    } catch (fault) {
        return [fault.name, 0];
    }
}"""
JSON = {"Content-Type": "application/json"}
LOGIN = f'{{"user": "viewer", "password": "{PASSWORD}"}}'
REQUESTS: dict[str, tuple[str, dict[str, object]]] = {
    "read": ("status", {}),
    "read unseen": ("status", {"mode": "no-cors"}),
    "log in": ("login", {"method": "POST", "headers": JSON, "body": LOGIN}),
    "log in unseen": ("login", {"method": "POST", "mode": "no-cors", "body": LOGIN}),
    "log out": ("logout", {"method": "POST", "headers": JSON, "body": "{}"}),
    "log out unseen": ("logout", {"method": "POST", "mode": "no-cors", "body": "{}"}),
}


def test_its_requests_read_nothing_and_do_nothing(
    foreign: Page, context: BrowserContext, page_service: Service, watcher: Watcher
) -> None:
    """An opaque answer has status 0 and no body; the other requests end in a TypeError."""
    before, epoch = logins(page_service), watcher.look()["epoch"]
    cookie = context.cookies(address(page_service))[0]["value"]
    for name, (route, options) in REQUESTS.items():
        kind, status = foreign.evaluate(ASK, [f"{address(page_service)}api/v1/{route}", options])
        assert (kind, status) in (("TypeError", 0), ("opaque", 0)), name
    assert context.cookies(address(page_service))[0]["value"] == cookie
    assert logins(page_service) == before
    still_in(context, watcher, epoch)


def test_its_forms_do_nothing(
    foreign: Page, context: BrowserContext, page_service: Service, watcher: Watcher
) -> None:
    """A form needs no permission to send; its text/plain may even be JSON."""
    before, epoch = logins(page_service), watcher.look()["epoch"]
    for route in ("login", "logout"):
        with foreign.expect_response(f"**/api/v1/{route}") as answer:
            foreign.evaluate(
                """([url, body, target]) => {
                    const form = Object.assign(document.createElement('form'),
                        { action: url, method: 'post', enctype: 'text/plain', target });
                    const [name, value] = [body.slice(0, -1) + ', "x": "', '"}'];
                    form.append(Object.assign(document.createElement('input'), { name, value }));
                    document.body.append(form,
                        Object.assign(document.createElement('iframe'), { name: target }));
                    form.submit();
                }""",
                [f"{address(page_service)}api/v1/{route}", LOGIN, f"within_{route}"],
            )
        assert answer.value.status == 403
    assert logins(page_service) == before
    still_in(context, watcher, epoch)


def test_it_cannot_frame_the_page(
    foreign: Page, context: BrowserContext, page_service: Service, watcher: Watcher
) -> None:
    """No click of the operator can be led onto a button that is not seen."""
    epoch = watcher.look()["epoch"]
    said: list[str] = []
    foreign.on("console", lambda message: said.append(message.text))
    foreign.evaluate(
        """(url) => new Promise((done) => {
            const frame = Object.assign(document.createElement('iframe'), { src: url });
            frame.onload = () => done();
            document.body.append(frame);
        })""",
        address(page_service),
    )
    assert foreign.frames[1].locator("button").count() == 0
    assert any("frame-ancestors" in text or "X-Frame-Options" in text for text in said), said
    still_in(context, watcher, epoch)


def test_a_name_that_was_rebound_is_not_served(context: BrowserContext, page_service: Service) -> None:
    """The browser believes that the service belongs to the foreign name: `Host` tells."""
    page = context.new_page()
    answer = page.goto(address(page_service).replace("127.0.0.1", FOREIGN))
    assert answer is not None
    assert answer.status == 403
    assert "SEC-04" in answer.text()
    assert page.evaluate(ASK, ["/api/v1/session", {}]) == ["basic", 403]
