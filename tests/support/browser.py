"""Chromium on the built page against the real service, and a proxy that can freeze the network between them."""

from __future__ import annotations

import os
import queue
import signal
import socket
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from playwright.sync_api import Browser, BrowserContext, Locator, Page, Playwright, expect
from playwright.sync_api import TimeoutError as NotShown

from gantryctl.gateway.access import COOKIE
from support.service_process import Page as Watcher
from support.service_process import Service

CHROMIUM = "/usr/bin/chromium"
FLAGS = [
    "--no-sandbox",
    "--disable-gpu",
    "--disable-quic",
    "--no-first-run",
    "--disable-background-networking",
    "--disable-component-update",
    "--disable-sync",
]
FOREIGN = "foreign.example"
"""A name that leads to this machine and is not one of the service's: as after DNS rebinding."""
SIZE = {"width": 1024, "height": 768}
MOVING_DEG_S = 0.05
"""Above this the set-point moves; at rest it is exactly 0."""
_PRESSES_MAX, _FRAMES_TO_MOVE = 5, 100
_SHOWN_MS = 10_000
"""Power is on a second after the key; a busy machine may take some more."""
_PATIENCE_MS = 60_000
"""For a page to load and for an element to come: a computer with four workers has taken more than 30 s."""
expect.set_options(timeout=30_000)
_TOO_OLD = "SEC-02"


class Proxy:
    """Forwards bytes to the service; while frozen it keeps them, as a network that has stalled does.

    Attributes:
        lag_s: everything arrives so much later, in order and at the same rate.
    """

    def __init__(self, port: int) -> None:
        self._target = ("127.0.0.1", port)
        self.lag_s = 0.0
        self._flowing = threading.Event()
        self._flowing.set()
        self._server = socket.create_server(("127.0.0.1", 0))
        self.port = self._server.getsockname()[1]
        threading.Thread(target=self._accept, daemon=True).start()

    def freeze(self) -> None:
        self._flowing.clear()

    def thaw(self) -> None:
        self._flowing.set()

    def frozen_for(self, seconds: float) -> None:
        """Freeze, and thaw after that time; returns at once."""
        self.freeze()
        threading.Timer(seconds, self.thaw).start()

    def close(self) -> None:
        self.thaw()
        self._server.close()

    def _accept(self) -> None:
        with suppress(OSError):
            while True:
                near, _ = self._server.accept()
                far = socket.create_connection(self._target)
                for end in (near, far):
                    end.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
                for one, other in ((near, far), (far, near)):
                    threading.Thread(target=self._forward, args=(one, other), daemon=True).start()

    def _forward(self, one: socket.socket, other: socket.socket) -> None:
        waiting: queue.SimpleQueue[tuple[float, bytes]] = queue.SimpleQueue()
        threading.Thread(target=self._deliver, args=(waiting, one, other), daemon=True).start()
        data = b"first"
        while data:
            try:
                data = one.recv(65536)
            except OSError:
                data = b""
            waiting.put((time.monotonic(), data))

    def _deliver(
        self, waiting: queue.SimpleQueue[tuple[float, bytes]], one: socket.socket, other: socket.socket
    ) -> None:
        """Hand on what has waited long enough; the end of one side ends both."""
        with suppress(OSError):
            while True:
                came_s, data = waiting.get()
                time.sleep(max(0.0, came_s + self.lag_s - time.monotonic()))
                self._flowing.wait()
                if not data:
                    break
                other.sendall(data)
        for end in (one, other):
            with suppress(OSError):
                end.shutdown(socket.SHUT_RDWR)
            end.close()


def launch(playwright: Playwright, service: Service, proxy: Proxy) -> Browser:
    """Chromium for which `localhost` is the service behind the proxy, and 127.0.0.1 and a foreign name the service."""
    port = service.address.rsplit(":", 1)[1]
    rule = f"--host-resolver-rules=MAP localhost:{port} 127.0.0.1:{proxy.port},MAP {FOREIGN} 127.0.0.1"
    return playwright.chromium.launch(executable_path=CHROMIUM, args=[*FLAGS, rule])


def address(service: Service, *, frozen: bool = False) -> str:
    """Where the page is: directly, or behind the proxy."""
    port = service.address.rsplit(":", 1)[1]
    return f"http://{'localhost' if frozen else '127.0.0.1'}:{port}/"


def add_cookie(context: BrowserContext, url: str, session: str) -> None:
    """As a login does."""
    # The tool takes a Secure cookie from an https address only; the browser itself takes it over http here.
    url = url.replace("http:", "https:")
    context.add_cookies(
        [{"name": COOKIE, "value": session, "url": url, "secure": True, "sameSite": "Strict"}]
    )


def patient(context: BrowserContext) -> BrowserContext:
    """The same context, whose pages wait for long: nothing is judged by how fast this computer is."""
    context.set_default_timeout(_PATIENCE_MS)
    return context


def enter(
    context: BrowserContext, service: Service, role: str, area: str = "operation", *, frozen: bool = False
) -> Page:
    """A page of somebody who has logged in."""
    url = address(service, frozen=frozen)
    add_cookie(context, url, service.log_in(role))
    page = patient(context).new_page()
    page.goto(f"{url}#{area}")
    page.locator("[data-stale=false]").wait_for()
    return page


def person_key(page: Page, name: str) -> None:
    """Press a button of the list below the person's name."""
    page.get_by_test_id("user").click()
    page.locator("#person").get_by_role("button", name=name).click()


def press_key(page: Page, name: str, shown: Locator) -> None:
    """Press a button until the page shows what it is for.

    A command from a picture older than the limit is refused (SEC-02): on a computer that is busy that happens now and
    then. The page must have said that; a person presses again then.
    """
    key = page.get_by_role("button", name=name, exact=True)
    for _ in range(_PRESSES_MAX):
        key.click()
        with suppress(NotShown):
            shown.wait_for(timeout=_SHOWN_MS)
            return
        expect(page.get_by_test_id("note")).to_contain_text(_TOO_OLD)
    raise AssertionError(f"{name} was refused {_PRESSES_MAX} times")


def take_control(page: Page, take: str = "Take control", give: str = "Give back") -> None:
    """Names are those of the buttons."""
    press_key(page, take, page.get_by_role("button", name=give))


def ready_to_jog(page: Page) -> None:
    """Take control, power on, continuous mode: by the buttons that a person uses."""
    take_control(page)
    if page.locator("[data-tag=power_phase]").inner_text() != "on":
        press_key(page, "Power on", page.get_by_text("Power: on"))
    press_key(page, "continuous", page.locator("[data-hold=forward]:enabled"))


def press(page: Page, direction: str = "forward") -> None:
    """Mouse button down on a key."""
    page.locator(f"[data-hold={direction}]").hover()
    page.mouse.down()


def until_moving(watcher: Watcher) -> None:
    """The set-point moves."""
    watcher.until(lambda tags: abs(tags["vel_ref_deg_s"]) > MOVING_DEG_S)


def press_until_moving(page: Page, watcher: Watcher, direction: str = "forward") -> int:
    """Press until the set-point moves; returns how many presses were not taken.

    A press whose frame is older than 200 ms is dropped: on a computer that is busy that happens now and then, and a
    person presses again.
    """
    for lost in range(_PRESSES_MAX):
        press(page, direction)
        for _ in range(_FRAMES_TO_MOVE):
            if abs(watcher.look()["vel_ref_deg_s"]) > MOVING_DEG_S:
                return lost
        page.mouse.up()
        watcher.until(lambda tags: tags["at_rest"])
    raise AssertionError(f"{_PRESSES_MAX} presses moved nothing: {watcher.tags}")


def look_on(watcher: Watcher, frames: int) -> list[float]:
    """Speeds of the set-point in the next frames."""
    return [watcher.look()["vel_ref_deg_s"] for _ in range(frames)]


def farthest_deg(watcher: Watcher, lease_s: float = 0.25, late_s: float = 0.15, sign: float = 1.0) -> float:
    """Where the axis must have come to rest from now on: lease, two frames and a busy machine, then the ramp.

    The lease may live 250 ms; what is read is up to 50 ms old, and so is the stopping angle.
    """
    tags = watcher.look()
    speed = abs(tags["speed_setting_deg_s"])
    return float(tags["pos_ref_deg"] + sign * (speed * (lease_s + late_s) + _ramp_deg(watcher)))


def _ramp_deg(watcher: Watcher) -> float:
    """Stopping angle from the full speed setting, seen while moving at it."""
    return float(max(watcher.look()["stopping_angle_deg"], 0.13 * watcher.tags["speed_setting_deg_s"] / 0.6))


@contextmanager
def browser_to_kill(playwright: Playwright, folder: Path) -> Iterator[BrowserContext]:
    """A browser of its own that a test may kill."""
    context = playwright.chromium.launch_persistent_context(
        str(folder), executable_path=CHROMIUM, args=FLAGS, viewport=SIZE
    )
    try:
        yield context
    finally:
        with suppress(Exception):
            context.close()


def kill(folder: Path) -> None:
    """SIGKILL for every process of the browser that keeps its data in that folder."""
    for process in Path("/proc").glob("[0-9]*"):
        with suppress(OSError):
            words = (process / "cmdline").read_bytes().decode(errors="replace")
            if f"--user-data-dir={folder}" in words:
                os.kill(int(process.name), signal.SIGKILL)
