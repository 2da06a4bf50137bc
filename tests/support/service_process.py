"""The service as a user starts it, and a page that is a few lines of Python: what the system tests share."""

from __future__ import annotations

import http.cookiejar
import json
import os
import re
import signal
import socket
import subprocess
import sys
import time
import urllib.error
import urllib.request
from collections.abc import Callable, Mapping
from contextlib import AbstractContextManager, suppress
from pathlib import Path
from typing import Any

import pytest
from websockets.sync.client import ClientConnection, connect

from gantryctl.gateway.access import COOKIE
from gantryctl.service.protocol.roles import Role
from gantryctl.service.supervisor import users
from gantryctl.service.supervisor.users import Users
from support.unread import unread_pipe

PASSWORD = "correct horse battery"
PATIENCE_S = 30.0
_TOO_OLD, _ASKED_MAX = "SEC-02", 5
RELEASED = """
from gantryctl.drives.simulated import SimDrive
made = SimDrive.__init__
def released(self, *args, **kwargs):
    made(self, *args, **kwargs)
    self.faults.enabling_switch = False
SimDrive.__init__ = released
"""
"""As `sitecustomize.py` of every process of the service: nobody presses the enabling switch of the virtual gantry."""


def add_users(root: Path) -> None:
    """One user for every role, named like it; what a password costs is tested elsewhere."""
    made = Users(root)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(users, "_N", 2)
        for role in Role:
            made.add(str(role), role, PASSWORD)


def on_own_disk(size_mb: int, place: Path) -> list[str]:
    """What to put before a command so that it alone sees a disk of that size at a place; [] where nobody may."""
    mounted = f'mount -t tmpfs -o size={size_mb}m tmpfs "$0" && exec "$@"'
    for private in (["unshare", "--mount"], ["unshare", "--mount", "--map-root-user"]):
        command = [*private, "sh", "-c", mounted, str(place)]
        with suppress(OSError):
            if subprocess.run([*command, "true"], capture_output=True, check=False).returncode == 0:
                return command
    return []


class Service:
    """`gantryctl serve` on a free port of loopback, with its own state directory; a context manager.

    Args:
        root: state root, and where its errors go.
        disk_mb: the state root is `disk` below it instead, a disk of its own of that size that nobody else sees.
        environment: more of it. own_group: Ctrl-C at the terminal does not reach it.
        unheard: its standard error is a pipe that nobody reads any more.
    """

    def __init__(
        self,
        root: Path,
        *options: str,
        disk_mb: int = 0,
        environment: Mapping[str, str] | None = None,
        own_group: bool = False,
        unheard: bool = False,
    ) -> None:
        self.root, self.directory = root, root / "hust_gantry"
        # -P, as for the script `gantryctl`: the folder of this process holds no modules of it.
        serve = ["-P", "-m", "gantryctl", "serve", "--listen", "127.0.0.1:0"]
        command = [sys.executable, *serve, *options]
        state = root
        if disk_mb:
            state = root / "disk"
            state.mkdir()
            private = (
                ["unshare", "--mount"] if os.geteuid() == 0 else ["unshare", "--mount", "--map-root-user"]
            )
            mounted = f'mount -t tmpfs -o size={disk_mb}m tmpfs "$0" && exec "$@"'
            command = [*private, "sh", "-c", mounted, str(state), *command]
        whole = {**os.environ, "GANTRYCTL_STATE": str(state), "PYTHONUNBUFFERED": "1", **(environment or {})}
        with (root / "errors").open("wb") as file, unread_pipe() as pipe:
            errors = pipe if unheard else file
            self.process = subprocess.Popen(
                command,
                env=whole,
                stdout=subprocess.PIPE,
                stderr=errors,
                text=True,
                process_group=0 if own_group else None,
            )
        self.said: list[str] = []
        self.address = ""

    def __enter__(self) -> Service:
        assert self.process.stdout is not None
        for line in self.process.stdout:
            self.said.append(line)
            found = re.search(r"page: https?://(\S+)/", line)
            self.address = found[1] if found else self.address
            if line.startswith("Ctrl-C"):
                return self
        raise AssertionError("".join(self.said) + self.errors())

    def __exit__(self, *_: object) -> None:
        self.end()

    def end(self) -> None:
        """Ctrl-C, and wait; may be called twice."""
        assert self.process.stdout is not None
        if self.process.stdout.closed:
            return
        if self.process.poll() is None:
            self.process.send_signal(signal.SIGINT)
        with self.process.stdout:
            self.process.wait(PATIENCE_S)

    def errors(self) -> str:
        """What it wrote on standard error."""
        return (self.root / "errors").read_text(encoding="utf-8")

    def child(self, name: str) -> int:
        """Process number of `controller`, `recorder` or `gateway`."""
        found = subprocess.run(
            ["ps", "-o", "pid=,args=", "--ppid", str(self.process.pid)],
            capture_output=True,
            text=True,
            check=True,
        )
        for line in found.stdout.splitlines():
            if f"gantryctl.service.{name} " in line or f"gantryctl.{name} " in line:
                return int(line.split()[0])
        raise AssertionError(f"no {name} in:\n{found.stdout}")

    def command(self, *arguments: str) -> subprocess.CompletedProcess[str]:
        """One command line to its end, as a process of its own that finds this service."""
        return subprocess.run(**self._line(arguments), timeout=60, check=False)

    def start(self, *arguments: str) -> subprocess.Popen[str]:
        """The same, begun."""
        return subprocess.Popen(**self._line(arguments))

    def _line(self, arguments: tuple[str, ...]) -> dict[str, Any]:
        return {
            "args": [sys.executable, "-m", "gantryctl", *arguments],
            "env": {**os.environ, "GANTRYCTL_STATE": str(self.root)},
            "stdin": subprocess.DEVNULL, "stdout": subprocess.PIPE, "stderr": subprocess.PIPE, "text": True,
        }  # fmt: skip

    def request(
        self, method: str, path: str, body: object = None, cookie: str = "", **headers: str
    ) -> tuple[int, bytes, dict[str, str]]:
        """One HTTP request."""
        data = json.dumps(body).encode() if body is not None else None
        if data is not None:
            headers.setdefault("Content-Type", "application/json")
        if cookie:
            headers["Cookie"] = f"{COOKIE}={cookie}"
        asked = urllib.request.Request(f"http://{self.address}{path}", data, headers, method=method)
        try:
            with urllib.request.urlopen(asked, timeout=PATIENCE_S) as answer:
                return answer.status, answer.read(), dict(answer.headers)
        except urllib.error.HTTPError as refused:
            with refused:
                return refused.code, refused.read(), dict(refused.headers)

    def log_in(self, user: str) -> str:
        """The cookie of a new session."""
        jar = http.cookiejar.CookieJar()
        opener = urllib.request.build_opener(urllib.request.HTTPCookieProcessor(jar))
        asked = urllib.request.Request(
            f"http://{self.address}/api/v1/login",
            json.dumps({"user": user, "password": PASSWORD}).encode(),
            {"Content-Type": "application/json"},
        )
        with opener.open(asked, timeout=PATIENCE_S):
            return str(next(iter(jar)).value)

    def page(self, user: str, source: str = "127.0.0.1", queue: int | None = 16) -> Page:
        """A page with a session of its own, from an address of this machine.

        Who does not read for ten seconds is ended, unless `queue`, the messages that wait, has no limit.
        """
        return self.page_of(self.log_in(user), source, queue)

    def page_of(self, cookie: str, source: str = "127.0.0.1", queue: int | None = 16) -> Page:
        """A page of a session."""
        host, port = self.address.split(":")
        return Page(
            connect(
                f"ws://{self.address}/api/v1/socket",
                origin=f"http://{self.address}",
                additional_headers={"Cookie": f"{COOKIE}={cookie}"},
                sock=socket.create_connection((host, int(port)), PATIENCE_S, (source, 0)),
                max_queue=queue,
            ),
            cookie,
        )


class Page:
    """A connection that does what the page must do; a context manager."""

    def __init__(self, connecting: AbstractContextManager[ClientConnection], cookie: str = "") -> None:
        self._connecting, self.cookie = connecting, cookie
        self.socket = connecting.__enter__()
        self.tags: dict[str, Any] = {}
        self.frame, self.seq = "", 0
        self.replies: dict[int, dict[str, Any]] = {}
        self.welcome = json.loads(self.socket.recv())
        self.look()

    def __enter__(self) -> Page:
        return self

    def __exit__(self, *_: object) -> None:
        self._connecting.__exit__(None, None, None)

    def look(self) -> dict[str, Any]:
        """The next picture."""
        while not self.take(self.socket.recv(PATIENCE_S)):
            pass
        return self.tags

    def take(self, text: str | bytes) -> bool:
        """One message; whether it was a picture."""
        message = json.loads(text)
        if message["type"] == "status":
            self.frame = message["frame"]
            self.tags.update(message["tags"])
            return True
        self.replies[message["seq"]] = message
        return False

    def say(self, kind: str, **values: Any) -> int:
        """Send a message; values may replace `frame`, `epoch` and `seq`."""
        with suppress(TimeoutError):
            while True:
                self.take(self.socket.recv(0))
        self.seq += 1
        message = {"type": kind, "seq": self.seq, "frame": self.frame, "epoch": self.tags["epoch"], **values}
        if kind in ("alive", "stop", "quick_stop", "release"):
            message.pop("epoch")
        self.socket.send(json.dumps(message))
        return int(message["seq"])

    def ask(self, kind: str, **values: Any) -> dict[str, Any]:
        """Send a message and wait for its reply.

        A picture that has become too old meanwhile is refused (SEC-02), as happens on a busy computer: then it is asked
        again from the next picture, unless the message names its picture or number itself.
        """
        for _ in range(_ASKED_MAX):
            reply = self._asked(kind, **values)
            if reply["code"] != _TOO_OLD or "frame" in values or "seq" in values:
                break
            self.look()
        return reply

    def _asked(self, kind: str, **values: Any) -> dict[str, Any]:
        seq = self.say(kind, **values)
        while seq not in self.replies:
            self.take(self.socket.recv(PATIENCE_S))
        reply = self.replies.pop(seq)
        if reply["epoch"] is not None:
            self.tags["epoch"] = reply["epoch"]
        return reply

    def do(self, kind: str, **values: Any) -> None:
        """A command that must be accepted."""
        reply = self.ask(kind, **values)
        assert reply["ok"], reply

    def refused(self, kind: str, **values: Any) -> str:
        """A command that must be refused; its code."""
        reply = self.ask(kind, **values)
        assert not reply["ok"], reply
        return str(reply["code"])

    def until(self, holds: Callable[[dict[str, Any]], bool], renew: str = "") -> dict[str, Any]:
        """Look until something holds, alive, with a lease renewed where there is one."""
        end_s = time.monotonic() + PATIENCE_S
        while not holds(self.look()):
            assert time.monotonic() < end_s, self.tags
            self.say("renew", lease=renew) if renew else self.say("alive")
        return self.tags

    def power_up(self, mode: str = "continuous") -> None:
        """Take control and switch on."""
        self.do("take", over=False)
        # A picture of before the reply may still be under way, and a command made from it is refused (SEC-03).
        taken = self.tags["epoch"]
        self.until(lambda tags: bool(tags["epoch"] == taken))
        self.do("power", on=True)
        self.until(lambda tags: bool(tags["power"]))
        self.do("mode", mode=mode)
