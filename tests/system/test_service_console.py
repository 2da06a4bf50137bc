"""Who is at the console of the machine: its own browser with its own link, and nobody whom a proxy has brought here."""

from __future__ import annotations

import http.client
import os
import socket
import subprocess
import sys
import threading
from collections.abc import Iterator
from contextlib import closing, contextmanager
from pathlib import Path

import pytest
from websockets.sync.client import connect

from gantryctl.gateway.access import CONSOLE_COOKIE, COOKIE
from support.browser import Proxy
from support.service_process import RELEASED, Page, Service, add_users

pytestmark = pytest.mark.skipif(sys.platform != "linux", reason="the service needs Linux")
STRANGER = 65534
FORWARDED = {
    "Forwarded": "for=192.0.2.7",
    "Via": "1.1 proxy",
    "X-Forwarded-For": "127.0.0.1",
    "X-Forwarded-Host": "127.0.0.1",
    "X-Forwarded-Proto": "http",
    "X-Real-IP": "127.0.0.1",
}


@pytest.fixture(scope="module")
def service(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Service]:
    root = tmp_path_factory.mktemp("console")
    (root / "sitecustomize.py").write_text(RELEASED)
    add_users(root)
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("PYTHONPATH", str(root), prepend=os.pathsep)
        with Service(root) as made:
            yield made


def asked(service: Service, folder: Path, **environment: str) -> subprocess.CompletedProcess[str]:
    """`gantryctl console` with a browser that writes down the address."""
    browser = folder / "browser"
    browser.write_text(f'#!/bin/sh\necho "$1" > {folder}/opened\n')
    browser.chmod(0o755)
    here = {name: text for name, text in os.environ.items() if name != "SSH_CONNECTION"}
    return subprocess.run(
        [sys.executable, "-P", "-m", "gantryctl", "console"],
        env={**here, "GANTRYCTL_STATE": str(service.root), "BROWSER": str(browser), **environment},
        stdin=subprocess.DEVNULL, capture_output=True, text=True, timeout=60, check=False,
    )  # fmt: skip


def link(service: Service, folder: Path) -> str:
    """Path of the link that a browser was opened with."""
    done = asked(service, folder)
    assert (done.returncode, done.stderr) == (0, "")
    opened = (folder / "opened").read_text().strip()
    address = f"http://{service.address}"
    assert opened.startswith(f"{address}/api/v1/console/")
    return opened.removeprefix(address)


def opened(service: Service, path: str, port: int = 0, **headers: str) -> tuple[int, str]:
    """Status of a link, and the cookie that it gives; by way of a proxy where a port is named."""
    host, own = service.address.split(":")
    with closing(http.client.HTTPConnection(host, port or int(own), timeout=30.0)) as made:
        made.request("GET", path, headers={"Host": service.address, **headers})
        answer = made.getresponse()
        answer.read()
        cookie = answer.headers.get("set-cookie", "")
        if cookie:
            assert answer.headers["location"] == "/"
            parts = {part.strip() for part in cookie.split(";")}
            assert {"Secure", "HttpOnly", "SameSite=strict", "Path=/"} <= parts
        return answer.status, cookie.partition(";")[0].removeprefix(f"{CONSOLE_COOKIE}=")


def page(service: Service, console: str = "", port: int = 0, user: str = "operator", **headers: str) -> Page:
    """A page with the cookie of a console, or without one; by way of a proxy where a port is named."""
    host, own = service.address.split(":")
    session = service.log_in(user)
    cookie = f"{COOKIE}={session}; {CONSOLE_COOKIE}={console}" if console else f"{COOKIE}={session}"
    return Page(
        connect(
            f"ws://{service.address}/api/v1/socket",
            origin=f"http://{service.address}",
            additional_headers={"Cookie": cookie, **headers},
            sock=socket.create_connection((host, port or int(own)), 30.0),
        ),
        session,
    )


def place(*how: object, **more: str) -> str:
    with page(*how, **more) as made:  # type: ignore[arg-type]
        return str(made.welcome["place"])


@contextmanager
def proxy_of(service: Service, uid: int | None = None) -> Iterator[int]:
    """A TCP proxy on this machine, as `ssh -L`, socat or the ports of a container are; its port."""
    target = int(service.address.split(":")[1])
    if uid is None:
        proxy = Proxy(target)
        yield proxy.port
        proxy.close()
        return
    # Of another user, as nginx is: a process of its own.
    ready, said = os.pipe()
    process = os.fork()
    if process == 0:
        os.setuid(uid)
        proxy = Proxy(target)
        os.write(said, str(proxy.port).encode())
        threading.Event().wait(60.0)
        os._exit(0)
    try:
        yield int(os.read(ready, 10))
    finally:
        os.kill(process, 9)
        os.waitpid(process, 0)
        os.close(ready)
        os.close(said)


def test_without_the_link_no_page_is_at_the_console_wherever_it_comes_from(service: Service) -> None:
    assert place(service) == "remote"
    assert place(service, "0" * 32) == "remote"
    with proxy_of(service) as port:
        assert place(service, "", port) == "remote"


def test_the_link_is_good_once_for_the_browser_that_it_was_opened_in(
    service: Service, tmp_path: Path
) -> None:
    path = link(service, tmp_path)
    for name, value in FORWARDED.items():
        assert opened(service, path, **{name: value})[0] == 403, name
    assert opened(service, path[:-16] + "0" * 16)[0] == 403
    status, console = opened(service, path)
    assert status == 303
    assert opened(service, path)[0] == 403
    assert place(service, console) == "console"
    for name, value in FORWARDED.items():
        assert place(service, console, **{name: value}) == "remote", name


@pytest.mark.skipif(os.geteuid() != 0, reason="only root has processes of two users")
def test_a_proxy_of_another_user_carries_nobody_to_the_console(service: Service, tmp_path: Path) -> None:
    path = link(service, tmp_path)
    with proxy_of(service, STRANGER) as port:
        assert opened(service, path, port)[0] == 403
        status, console = opened(service, path)
        assert status == 303
        assert place(service, console, port) == "remote"
    assert place(service, console) == "console"


def test_moves_of_a_page_behind_a_tunnel_are_capped_and_those_of_the_console_are_not(
    service: Service, tmp_path: Path
) -> None:
    with proxy_of(service) as port, page(service, "", port) as far:
        far.power_up()
        far.do("set", tag="speed_setting_deg_s", value=1.5)
        assert far.refused("move", target_deg=1.0) == "INT-05"
        far.do("set", tag="speed_setting_deg_s", value=1.0)
        far.do("move", target_deg=0.2)
        far.until(lambda tags: tags["in_position"] and tags["axis_state"] == "standstill")
        far.do("give")
    _, console = opened(service, link(service, tmp_path))
    with page(service, console) as near:
        near.do("take", over=False)
        near.do("set", tag="speed_setting_deg_s", value=1.5)
        near.do("move", target_deg=1.0)
        near.until(lambda tags: tags["in_position"] and tags["axis_state"] == "standstill")
        near.do("power", on=False)


def test_the_command_says_what_it_cannot_do(service: Service, tmp_path: Path) -> None:
    done = asked(service, tmp_path, SSH_CONNECTION="192.0.2.7 5 192.0.2.1 22")
    assert done.returncode == 2
    assert "this shell came over ssh" in done.stderr
    done = asked(service, tmp_path, GANTRYCTL_STATE=str(tmp_path))
    assert done.returncode == 3
    assert "`gantryctl serve` starts one" in done.stderr
