"""Commands at a service that hangs: it takes what it is sent and says nothing from some step on.

Each ends with one sentence and the exit code of a device, never with an error of the computer; its connection ends, and
with it control and a held key.
"""

from __future__ import annotations

import json
from types import SimpleNamespace
from typing import Any

import pytest

from gantryctl.machine import default_machine
from gantryctl.operation.store import state_root
from gantryctl.service.clients import link as module
from support.command_line import cli
from unit.cli.test_service_axis_by_hand import AT_REST

MACHINE = default_machine()
TAGS: dict[str, Any] = {
    **AT_REST, "power": False, "power_phase": "off", "mode": "none", "armed_client": "", "alarm_history": [],
    "brake_test_available": True, "axis_state": "disabled", "position_valid": True,
}  # fmt: skip
SHOWS: dict[str, dict[str, Any]] = {
    "take": {"authority_client": "me", "authority_user": "anna"},
    "give": {"authority_client": "", "authority_user": ""},
    "power": {"power": True, "power_phase": "on"},
    "move": {"at_rest": False, "in_position": False},
    "arm": {"armed_client": "me", "armed_action": "brake_test"},
}


class Hanging:
    """The socket of a service that answers until a command of a kind comes, or so many messages were read.

    Attributes:
        sent: kinds of commands. waited: how often nothing came for the whole time limit.
    """

    def __init__(self, after: str | int) -> None:
        self._after, self._read, self._frame = after, 0, 0
        self._lines: list[dict[str, Any]] = [{"type": "welcome", "client": "me"}]
        self._tags = dict(TAGS)
        self.sent: list[str] = []
        self.silent = self.closed = False
        self.waited = 0

    def settimeout(self, time_s: float) -> None:
        self.time_s = time_s

    def connect(self, _: object) -> None:
        pass

    def close(self) -> None:
        self.closed = True

    def sendall(self, data: bytes) -> None:
        assert not self.closed
        message = json.loads(data)
        kind = message.get("type", "")
        self.sent.append(kind)
        self.silent |= kind == self._after
        if kind in ("", "alive", "renew") or self.silent:
            return
        self._tags |= SHOWS.get(kind, {})
        reply = {"type": "reply", "seq": message["seq"], "ok": True, "code": "", "text": "", "epoch": 7}
        self._lines.append(reply | {"journal": 100})

    def recv(self, _: int) -> bytes:
        assert not self.closed
        self._read += 1
        if self.silent or self._read == self._after:
            self.silent = True
            self.waited += self.time_s == module._TIMEOUT_S
            raise TimeoutError("timed out")
        if not self._lines:
            self._frame += 1
            self._lines.append(
                {"type": "status", "frame": f"f{self._frame}", "fresh": True, "tags": dict(self._tags)}
            )
        return json.dumps(self._lines.pop(0)).encode() + b"\n"


@pytest.fixture
def clock(monkeypatch: pytest.MonkeyPatch) -> None:
    now_s = 100.0

    def monotonic() -> float:
        nonlocal now_s
        now_s += 0.01
        return now_s

    monkeypatch.setattr(module, "time", SimpleNamespace(monotonic=monotonic))
    (state_root() / MACHINE.name).mkdir(parents=True)


MOVE = ("move", "20", "--service", "--yes")
JOG = ("jog", "+", "--for", "0.1", "--service", "--yes")


@pytest.mark.usefixtures("clock")
@pytest.mark.parametrize(
    ("command", "after"),
    [
        *((MOVE, after) for after in (1, 2, 3, "take", "power", "set", "move", "alive")),
        *((JOG, after) for after in ("mode", "jog", "renew", "release")),
        *((("power", "on", "--yes"), after) for after in ("take", "power")),
        *((("brake-test", "--service", "--yes"), after) for after in ("arm", "brake_test")),
        *((("reset", "--service", "--yes"), after) for after in ("reset",)),
        *((("arm", "brake-test"), after) for after in ("arm", "alive")),
        (("status", "--service"), 2),
        (("alarms", "--service"), 2),
    ],
)
def test_a_command_ends_where_the_service_hangs(
    monkeypatch: pytest.MonkeyPatch, command: tuple[str, ...], after: str | int
) -> None:
    made: list[Hanging] = []

    def opened(*_: object) -> Hanging:
        # A command looks on a connection that it leaves again, and takes control on the next.
        made.append(Hanging(after))
        return made[-1]

    monkeypatch.setattr(module, "socket", SimpleNamespace(socket=opened, AF_UNIX=1, SOCK_STREAM=1))
    answer = cli(*command)
    assert (answer.code, answer.err.count("\n")) == (3, 1), answer
    assert "the service has said nothing for 3 s, and whether the axis moves is not known" in answer.err
    assert all(each.closed for each in made)
    # Once, not once for everything that the command asks on its way out.
    assert [each.waited for each in made if each.silent] == [1]
