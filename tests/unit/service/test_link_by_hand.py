"""A command line at a service, by hand: what it sends, what it waits for, and what it says when nobody answers."""

from __future__ import annotations

import io
import json
import re
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

from gantryctl.errors import CommandRefused, DeviceError
from gantryctl.service.clients import link as module
from gantryctl.service.clients.link import ServiceLink


class Socket:
    """The other end: what it is sent, and what it answers.

    Attributes:
        lines: what comes next, one a call; bytes, or an exception.
        answers: what comes behind a command of a kind, or what makes it.
    """

    def __init__(self) -> None:
        self.sent: list[dict[str, Any]] = []
        self.lines: list[Any] = []
        self.answers: dict[str, list[Any]] = {}
        self.timeouts: list[float] = []
        self.sent_within_s: list[float] = []
        self.closed = 0
        self.breaks: OSError | None = None

    def settimeout(self, time_s: float) -> None:
        self.timeouts.append(time_s)

    def connect(self, _: object) -> None:
        pass

    def close(self) -> None:
        self.closed += 1

    def sendall(self, data: bytes) -> None:
        if self.breaks is not None:
            raise self.breaks
        assert data.endswith(b"\n")
        message = json.loads(data)
        self.sent.append(message)
        self.sent_within_s.append(self.timeouts[-1])
        for made in self.answers.get(message.get("type", ""), []):
            line = made() if callable(made) else made
            asked = isinstance(line, dict) and line["type"] == "reply"
            self.lines.append(line | {"seq": message["seq"]} if asked else line)

    def recv(self, _: int) -> bytes:
        line = self.lines.pop(0)
        if isinstance(line, BaseException):
            raise line
        return line if isinstance(line, bytes) else json.dumps(line).encode() + b"\n"


def status(frame: str, *, fresh: bool = True, **tags: Any) -> dict[str, Any]:
    return {"type": "status", "frame": frame, "fresh": fresh, "tags": tags}


def reply(code: str = "", *, ok: bool = True, epoch: int = 8) -> dict[str, Any]:
    return {"type": "reply", "ok": ok, "code": code, "text": "a text", "epoch": epoch}


WELCOME = {"type": "welcome", "client": "c1"}


class Desk:
    """A link and its socket, at a time that goes on by 10 ms with each look at the clock."""

    def __init__(self, monkeypatch: pytest.MonkeyPatch) -> None:
        self.socket, self.now_s, self.warned = Socket(), 100.0, list[str]()
        sockets = SimpleNamespace(socket=lambda *_: self.socket, AF_UNIX=1, SOCK_STREAM=1)
        monkeypatch.setattr(module, "socket", sockets)
        monkeypatch.setattr(module, "time", SimpleNamespace(monotonic=self.clock))

    def clock(self) -> float:
        self.now_s += 0.01
        return self.now_s

    def open(self, folder: Path, *lines: Any) -> ServiceLink:
        self.socket.lines = [WELCOME, status("f1", epoch=7, pos_act_deg=1.0), *lines]
        return ServiceLink(folder, self.warned.append)


@pytest.fixture
def desk(monkeypatch: pytest.MonkeyPatch) -> Desk:
    return Desk(monkeypatch)


def test_it_watches_and_waits_for_a_fresh_frame(desk: Desk, tmp_path: Path) -> None:
    desk.socket.lines = [
        WELCOME, status("old", fresh=False, epoch=7, power=False), status("f1", pos_act_deg=1.0)
    ]  # fmt: skip
    with ServiceLink(tmp_path) as link:
        assert desk.socket.sent == [{"watch": True}]
        assert (link.client, link.frame) == ("c1", "f1")
        assert link.tags == {"epoch": 7, "power": False, "pos_act_deg": 1.0}
        # The next frame is another one, in as many parts as it comes; tags that it does not name stay.
        data = json.dumps(status("f2", pos_act_deg=2.0)).encode() + b"\n"
        desk.socket.lines = [status("f1", pos_act_deg=9.0), data[:7], data[7:]]
        assert link.look() == {"epoch": 7, "power": False, "pos_act_deg": 2.0}
    assert desk.socket.closed == 1


@pytest.mark.parametrize(
    "lines", [[OSError("gone")], [b""], [{"type": "welcome"}], [b"no JSON\n"], [WELCOME, b""]]
)
def test_without_a_service_there_is_no_link(desk: Desk, tmp_path: Path, lines: list[Any]) -> None:
    desk.socket.lines = lines
    with pytest.raises(DeviceError):
        ServiceLink(tmp_path)
    assert desk.socket.closed == 1


def test_an_interrupt_is_no_missing_service(desk: Desk, tmp_path: Path) -> None:
    desk.socket.lines = [KeyboardInterrupt()]
    with pytest.raises(KeyboardInterrupt):
        ServiceLink(tmp_path)
    assert desk.socket.closed == 1


def test_a_controller_without_news_is_silent(desk: Desk, tmp_path: Path) -> None:
    link = desk.open(tmp_path)
    desk.socket.lines = [status(f"f{n}", fresh=False) for n in range(2000)]
    with pytest.raises(DeviceError, match="its controller is silent"):
        link.look()


def test_commands_are_numbered_and_a_stop_has_no_epoch(desk: Desk, tmp_path: Path) -> None:
    link = desk.open(tmp_path)
    assert [link.say("halt"), link.say("stop"), link.say("move", target_deg=5.0)] == [1, 2, 3]
    assert desk.socket.sent[1:] == [
        {"type": "halt", "seq": 1, "frame": "f1", "epoch": 7},
        {"type": "stop", "seq": 2, "frame": "f1"},
        {"type": "move", "seq": 3, "frame": "f1", "epoch": 7, "target_deg": 5.0},
    ]
    desk.socket.breaks = BrokenPipeError(32, "Broken pipe")
    with pytest.raises(DeviceError, match="the connection to the service broke: Broken pipe"):
        link.say("halt")


def test_a_reply_is_waited_for_and_its_epoch_is_that_of_the_next_command(desk: Desk, tmp_path: Path) -> None:
    link = desk.open(tmp_path)
    desk.socket.answers = {"take": [status("f2"), reply(epoch=8)], "move": [reply("CTL-20", epoch=9)]}
    assert link.ask("take", over=False)["ok"]
    assert not desk.warned
    assert link.ask("move", target_deg=1.0)["code"] == "CTL-20"
    assert desk.warned == ["CTL-20 · a text"]
    assert [message.get("epoch") for message in desk.socket.sent[1:]] == [7, 8]
    assert (link.frame, link.tags["epoch"]) == ("f2", 9)
    # A reply to a command that nobody waited for, a sign of life for example, is not that to this one.
    link._replies[link.say("alive")] = reply()
    desk.socket.answers = {"halt": [reply("PWR-04", ok=False)]}
    with pytest.raises(CommandRefused, match="PWR-04"):
        link.ask("halt")


def test_a_refusal_is_told_and_no_answer_too(desk: Desk, tmp_path: Path) -> None:
    link = desk.open(tmp_path)
    desk.socket.answers = {"power": [reply("PWR-04", ok=False)]}
    with pytest.raises(CommandRefused, match="PWR-04 · a text"):
        link.ask("power", on=True)
    desk.socket.lines = [status(f"g{n}") for n in range(2000)]
    with pytest.raises(DeviceError, match="does not answer to halt"):
        link.ask("halt")
    desk.socket.lines = [b""]
    with pytest.raises(DeviceError, match="has closed the connection"):
        link.ask("halt")


@pytest.mark.parametrize("forward", [True, False])
def test_a_held_key_is_renewed_with_each_frame_and_let_go(desk: Desk, tmp_path: Path, forward: bool) -> None:
    link = desk.open(tmp_path)
    desk.socket.answers = {"jog": [reply()], "release": [reply()]}
    frames = iter(range(100))
    desk.socket.answers["renew"] = [lambda: status(f"h{next(frames)}")]
    held = iter([False, False, False, True])
    link.hold(forward, 60.0, lambda: next(held))
    jog, *renewals, release = desk.socket.sent[1:]
    assert (jog["type"], jog["direction"]) == ("jog", "forward" if forward else "reverse")
    assert [each["type"] for each in renewals] == ["renew"] * 3
    assert {each["lease"] for each in (jog, *renewals, release)} == {jog["lease"]}
    assert re.fullmatch("[0-9a-f]{16}", jog["lease"])
    assert release["type"] == "release"
    # A renewal waits for its period at most, anything else for seconds: sent and answered.
    assert max(desk.socket.sent_within_s[2:-1]) <= module.RENEW_S
    assert max(desk.socket.timeouts[1:-1]) <= module.RENEW_S
    assert desk.socket.timeouts[-1] == module._TIMEOUT_S


def test_a_key_is_let_go_when_its_time_is_over_or_something_fails(desk: Desk, tmp_path: Path) -> None:
    link = desk.open(tmp_path)
    desk.socket.answers = {"jog": [reply()], "release": [reply()], "renew": [TimeoutError()]}
    link.hold(True, 0.2, lambda: False)
    kinds = [each["type"] for each in desk.socket.sent[1:]]
    assert kinds[0] == "jog"
    assert kinds[-1] == "release"
    assert 2 < kinds.count("renew") < 20
    (first,) = {each["lease"] for each in desk.socket.sent[1:] if "lease" in each}
    desk.socket.sent.clear()
    desk.socket.lines = []

    def interrupted() -> bool:
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        link.hold(True, 1.0, interrupted)
    assert [each["type"] for each in desk.socket.sent] == ["jog", "release"]
    # A lease that was used is never valid again.
    assert first not in {each["lease"] for each in desk.socket.sent}


def test_a_key_that_is_dead_is_held_no_longer(desk: Desk, tmp_path: Path) -> None:
    """A renewal has no reply but its refusal."""
    link = desk.open(tmp_path)
    desk.socket.answers = {"jog": [reply()], "release": [reply()]}
    frames = iter(range(100))
    alive = [lambda: status(f"h{next(frames)}")]
    desk.socket.answers["renew"] = alive
    renewed = iter(range(100))

    def stopped() -> bool:
        if next(renewed) == 3:
            desk.socket.answers["renew"] = [reply("SEC-09", ok=False), *alive]
        return False

    lost = link.hold(True, 60.0, stopped)
    assert (lost, str(lost)) == (module.Refused("SEC-09", "a text"), "SEC-09 · a text")
    kinds = [each["type"] for each in desk.socket.sent[1:]]
    assert kinds == ["jog", "renew", "renew", "renew", "renew", "release"]
    desk.socket.answers["renew"] = alive
    assert link.hold(True, 0.2, lambda: False) is None


def test_a_renewal_waits_for_no_time_that_is_over(
    desk: Desk, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A socket with a time limit of 0 does not wait at all, and the connection seems broken; by a clock of 1/64 s."""
    link = desk.open(tmp_path)
    desk.now_s = 100.0

    def clock() -> float:
        desk.now_s += 1.0 / 64.0
        return desk.now_s

    monkeypatch.setattr(module, "time", SimpleNamespace(monotonic=clock))
    monkeypatch.setattr(module, "RENEW_S", 2.0 / 64.0)
    desk.socket.lines = [{"type": "welcome"}] * 5
    desk.socket.timeouts.clear()
    link._drain()
    assert desk.socket.timeouts == [1.0 / 64.0]


def test_a_service_has_three_seconds_for_an_answer(desk: Desk, tmp_path: Path) -> None:
    desk.open(tmp_path)
    assert desk.socket.timeouts == [3.0]


def test_a_sign_of_life_is_one_and_a_renewal_waits_for_the_next_frame(desk: Desk, tmp_path: Path) -> None:
    """Whatever comes in between."""
    link = desk.open(tmp_path)
    link.alive()
    assert [each["type"] for each in desk.socket.sent[1:]] == ["alive"]
    desk.socket.lines = [reply() | {"seq": 1}, status("f2"), status("f3")]
    link._drain()
    assert (link.frame, len(desk.socket.lines)) == ("f2", 1)


@pytest.mark.parametrize(
    ("said", "link"),
    [
        (b'{"link":"http://page/1"}\n', "http://page/1"), (b'{"link":""}\n', ""), (b"", None),
        (b'{"more":1}\n', None),
    ],
)  # fmt: skip
def test_a_link_to_the_page_is_asked_for_within_three_seconds(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path, said: bytes, link: str | None
) -> None:
    """Without a page there is none; what is no answer is a service that is silent."""
    did: list[Any] = []

    class Asking:
        def __enter__(self) -> Asking:
            return self

        def __exit__(self, *_: object) -> None:
            did.append("closed")

        def settimeout(self, time_s: float) -> None:
            did.append(time_s)

        def connect(self, _: object) -> None:
            pass

        def sendall(self, data: bytes) -> None:
            did.append(data)

        def makefile(self, _: str) -> io.BytesIO:
            return io.BytesIO(said)

    monkeypatch.setattr(module.socket, "socket", lambda *_: Asking())
    if link is None:
        with pytest.raises(DeviceError, match="no service answers"):
            module.console_link(tmp_path)
    else:
        assert module.console_link(tmp_path) == link
    assert did == [3.0, b'{"console":true}\n', "closed"]
