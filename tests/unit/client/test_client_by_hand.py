"""What a client sends and what it takes for done, frame by frame, against a service that is played by the test."""

from __future__ import annotations

import json
import socket
import threading
import time
from collections.abc import Iterator
from contextlib import nullcontext, suppress
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any, ClassVar

import pytest

from gantryctl.client import Axis, KeyLost, MotionStopped, Refused, Service, held, wires
from gantryctl.client import axis as client_axis
from gantryctl.client import service as client_service
from gantryctl.client.connection import Reply
from gantryctl.client.service import Recording
from gantryctl.client.wires import WebSocketWire, refusal_of
from gantryctl.errors import AlarmStop, DeviceError, UsageError
from gantryctl.operation.store import SERVICE_SOCKET
from unit.client.played_service import PATIENCE_S, FakeService

NOT_HELD = {"first_out": True, "code": "BRK-03", "text": "BRK-03 STOP"}


@pytest.fixture
def service() -> FakeService:
    return FakeService(power=True)


@pytest.fixture
def axis(service: FakeService) -> Iterator[Axis]:
    made = Axis(service)
    yield made
    made.close()


def seen(axis: Axis, monkeypatch: pytest.MonkeyPatch, *frames: dict[str, Any]) -> None:
    """Let the axis see these frames one after the other, 60 s apart, and nothing behind them."""
    now = axis.tags
    clock = SimpleNamespace(now_s=0.0)
    monkeypatch.setattr(client_axis, "time", SimpleNamespace(monotonic=lambda: clock.now_s))

    def shown() -> Iterator[Any]:
        for values in frames:
            clock.now_s += 60.0
            yield replace(now, **values)

    monkeypatch.setattr(axis, "frames", shown)


def test_a_wait_in_vain_has_no_tags(axis: Axis, monkeypatch: pytest.MonkeyPatch) -> None:
    seen(axis, monkeypatch, {"pos_ref_deg": 1.0}, {"pos_ref_deg": 2.0})
    assert axis.wait_until(lambda tags: tags.pos_ref_deg == 2.0, 90.0) is not None
    seen(axis, monkeypatch, {"pos_ref_deg": 1.0}, {"pos_ref_deg": 2.0})
    assert axis.wait_until(lambda tags: tags.pos_ref_deg == 2.0, 30.0) is None


@pytest.mark.parametrize(("direction", "end_deg"), [("forward", 3.5), ("reverse", 2.5)])
def test_an_increment_ends_one_increment_further_in_its_direction(direction: Any, end_deg: float) -> None:
    service = FakeService(power=True, pos_ref_deg=3.0, increment_deg=0.5, mode="continuous")
    service.moves["mode"] = {"mode": "incremental"}
    service.moves["increment"] = {"pos_ref_deg": end_deg}
    with Axis(service) as axis:
        assert axis.increment(direction).pos_ref_deg == end_deg
    assert service.kinds() == ["mode", "increment"]
    assert [each["direction"] for each in service.sent if each["type"] == "increment"] == [direction]


def test_a_way_counts_from_the_set_point() -> None:
    service = FakeService(power=True, pos_ref_deg=3.0, pos_act_deg=3.01)
    service.moves["move_by"] = {"pos_ref_deg": 5.0}
    with Axis(service) as axis:
        assert axis.move_by(2.0).pos_ref_deg == 5.0


def test_a_key_is_held_in_continuous_mode_only() -> None:
    service = FakeService(power=True, mode="incremental")
    service.moves["mode"] = {"mode": "continuous"}
    with Axis(service) as axis, axis.hold("forward", speed_deg_s=1.0):
        pass
    assert service.kinds() == ["mode", "set", "jog", "release"]


def test_a_brake_test_ends_with_its_own_result() -> None:
    service = FakeService(power=False, power_phase="off", brake_tests=4)
    service.moves["brake_test"] = {"brake_tests": 5}
    with Axis(service) as axis:
        assert axis.test_brake(PATIENCE_S).brake_tests == 5
    assert service.kinds() == ["brake_test"]


def test_a_move_that_begins_late_and_lasts_long_is_done_where_it_ends(
    axis: Axis, monkeypatch: pytest.MonkeyPatch
) -> None:
    """At rest for a frame, then on its way for longer than the 10 s that it may take to settle."""
    there = {"pos_ref_deg": 0.0, "in_position": False}
    seen(axis, monkeypatch, there, {"at_rest": False}, there, {**there, "in_position": True})
    assert axis.move(0.0).in_position
    seen(axis, monkeypatch, there, there)
    with pytest.raises(MotionStopped, match="not in position after 10 s"):
        axis.move(0.0)


def test_a_move_ends_where_power_goes_off(axis: Axis, monkeypatch: pytest.MonkeyPatch) -> None:
    seen(axis, monkeypatch, {"at_rest": False}, {"power": False, "pos_ref_deg": 10.0, "in_position": True})
    with pytest.raises(MotionStopped, match="power was switched off"):
        axis.move(10.0)


@pytest.mark.parametrize(
    ("frames", "error"),
    [
        (({"power_phase": "off"},), None),
        (({"power_phase": "torque_hold", "alarms": [NOT_HELD]},), AlarmStop),
        (({"power_phase": "unloading"},), MotionStopped),
    ],
)
def test_power_that_does_not_go_off_is_told(
    axis: Axis, monkeypatch: pytest.MonkeyPatch, frames: Any, error: type[Exception] | None
) -> None:
    """A script that goes on would send people to a load that nothing but torque holds."""
    seen(axis, monkeypatch, *frames)
    if error is None:
        axis.power_off()
        return
    with pytest.raises(error, match=r"BRK-03|power is not off 30 s after"):
        axis.power_off()


def test_a_key_is_renewed_with_the_frame_that_the_loop_has_seen(axis: Axis, service: FakeService) -> None:
    with axis.hold("forward") as key:
        looked_at = service.sent[-1]["frame"]
        newest = service.frame()
        while axis._connection.frame.mark != newest:
            time.sleep(0.005)
        next(key)
        renewed = [message["frame"] for message in service.sent if message["type"] == "renew"]
    assert renewed == [looked_at]


def test_a_frame_without_an_age_is_not_the_present_state(axis: Axis, service: FakeService) -> None:
    service.frame(age_ms=None, pos_ref_deg=1.0)
    until_s = time.monotonic() + PATIENCE_S
    while axis._connection._values["pos_ref_deg"] != 1.0 and time.monotonic() < until_s:
        time.sleep(0.005)
    with pytest.raises(DeviceError, match="no present state"):
        _ = axis.tags


def test_a_refusal_belongs_to_its_message_and_not_to_one_before(axis: Axis, service: FakeService) -> None:
    connection = axis._connection
    service.refused["renew"] = "SEC-09"
    seq = connection.say("renew", lease="0" * 16)
    while connection.refusal_from(0) is None:
        time.sleep(0.005)
    found = connection.refusal_from(seq)
    assert found is not None
    assert (found.seq, found.code) == (seq, "SEC-09")
    assert connection.refusal_from(seq + 1) is None


class Answers(Service):
    """A session whose requests the test answers."""

    def __init__(self, **answers: bytes) -> None:
        self._answers, self._cookie = answers, ""
        self.asked: list[str] = []

    def _ask(self, method: str, path: str, body: object = None) -> bytes:
        self.asked.append(f"{method} {path}")
        return self._answers[path.strip("/").partition("?")[0]]


def test_the_status_of_a_silent_controller_is_none(service: FakeService) -> None:
    with pytest.raises(DeviceError, match="its controller is silent"):
        Answers(status=b'{"fresh": false, "tags": {}}').status()


def test_events_go_on_behind_a_number() -> None:
    row = (
        b'{"seq": 8, "utc": "u", "kind": "alarm", "user": "a", "role": "r", "place": "p", "text": "t", '
        b'"detail": "{\\"code\\": \\"CTL-03\\"}", "hash": "h"}\n'
    )
    asked = Answers(journal=row)
    assert [(event.seq, event.values) for event in asked.events(after=7, limit=2)] == [
        (8, {"code": "CTL-03"})
    ]
    assert asked.asked == ["GET /journal?from=7&limit=2"]


@pytest.mark.parametrize("host", ["localhost.example", "127.0.0.1.example", "192.168.0.1", "localhost6"])
def test_only_this_computer_gets_a_password_without_tls(host: str) -> None:
    with pytest.raises(UsageError, match="with TLS only"):
        Service(f"http://{host}:8650", "anna", "secret")


def test_who_has_taken_no_control_gives_none_back(service: FakeService) -> None:
    service.refused["take"] = "SEC-07"
    with Axis(service) as axis, pytest.raises(Refused):
        axis.take()
    assert service.kinds() == ["take"]


@pytest.mark.parametrize("holder", ["", "other"])
@pytest.mark.parametrize("fails", [False, True])
def test_who_leaves_takes_nothing_from_the_next_holder(holder: str, fails: bool) -> None:
    """Power that was switched on here goes off and what moves stops, but not under the control of somebody else."""
    service = FakeService(power=False)
    service.moves = {"power": {"power": True}}
    with suppress(KeyError), Axis(service) as axis:
        axis.take()
        axis.power_on()
        service.moves = {"power": {"power": False, "power_phase": "off"}}
        service.frame(authority_client=holder)
        assert axis.wait_until(lambda tags: tags.authority_client == holder, PATIENCE_S)
        if fails:
            raise KeyError
    ends = ["stop"] * fails + ["power", "give"]
    assert service.kinds() == ["take", "power", *([] if holder else ends)]


def test_a_refused_setting_in_the_block_of_a_key_is_no_lost_key(axis: Axis, service: FakeService) -> None:
    service.refused["set"] = "CTL-01"
    with axis.hold("forward") as key:
        with pytest.raises(Refused):
            axis.set("speed_setting_deg_s", 60.0)
        service.frame()
        assert next(key) == axis.tags


def test_a_refusal_is_not_among_what_was_done_but_not_kept(axis: Axis, service: FakeService) -> None:
    service.refused["reset"] = "CTL-14"
    with pytest.raises(Refused):
        axis.reset()
    assert not axis._connection.kept_late


def test_what_was_done_but_not_kept_is_told(axis: Axis, service: FakeService) -> None:
    """JRN-03: a person learns that the journal may not have it."""
    service.late["note"] = "JRN-03"
    axis.note("a line")
    assert [(each.ok, each.code) for each in axis._connection.kept_late] == [(True, "JRN-03")]


def test_a_brake_test_that_does_not_end_is_stopped(monkeypatch: pytest.MonkeyPatch) -> None:
    """Else it goes on with its torque behind a script that has given it up."""
    service = FakeService(power=False, power_phase="off", brake_tests=4)
    with Axis(service) as axis:
        seen(axis, monkeypatch, {}, {}, {})
        with pytest.raises(MotionStopped, match="did not end within 120 s"):
            axis.test_brake()
        assert service.kinds() == ["brake_test", "stop"]


def test_a_service_that_hangs_at_the_socket_is_told(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Whoever reads has no end of his own: frames come all the time, so silence is an end."""
    monkeypatch.setattr(wires, "_SEND_S", 0.05)
    with socket.socket(socket.AF_UNIX, socket.SOCK_STREAM) as hanging:
        hanging.bind(str(tmp_path / SERVICE_SOCKET))
        hanging.listen()
        wire = wires.LocalWire(tmp_path)
        gone = threading.Timer(2.0, hanging.close)  # a client that waits on fails the test then
        gone.start()
        try:
            with pytest.raises(DeviceError, match="timed out"):
                wire.receive()
        finally:
            gone.cancel()
            wire.close()


@pytest.mark.parametrize(("replied", "named"), [(8, 8), (7, 7), (6, 7)])
def test_what_follows_a_stop_at_once_names_the_epoch_that_the_stop_has_begun(
    axis: Axis, service: FakeService, replied: int, named: int
) -> None:
    """No frame has shown it yet; a lower one is of a reply that has waited, and a stop has come since."""
    service.epoch = replied
    axis.stop()
    axis._ask("set", shown=False, tag="speed_setting_deg_s", value=1.0)
    assert service.sent[-1]["epoch"] == named
    # The next frame is the newest.
    service.frame(epoch=9)
    axis.wait_until(lambda tags: tags.epoch == 9, 5.0)
    axis._ask("set", shown=False, tag="speed_setting_deg_s", value=1.0)
    assert service.sent[-1]["epoch"] == 9


def test_what_a_command_did_is_shown_before_its_event_is_on_the_disk() -> None:
    """The reply has waited for the disk as long as it had to; the tags need not."""
    service = FakeService(journal_sequence=40, journal_committed=39)
    with Axis(service) as axis:
        done = Reply(9, ok=True, code="", text="", values={}, epoch=7, journal=40)
        assert axis._connection._shows(done)
        assert not axis._connection._shows(done._replace(journal=41))
        assert not axis._connection._shows(done._replace(epoch=8))


class Http:
    """HTTP of the standard library: what it was asked, and where; each answer has a cookie."""

    asked: ClassVar[list[tuple[str, Any, str, str, str]]] = []
    told: ClassVar[dict[str, Any]] = {"user": "anna", "person": "bela", "role": "viewer", "may": ["view"]}

    def __init__(self, host: str, port: int, **_: object) -> None:
        self._at = host, port

    def request(self, method: str, path: str, _: object, headers: dict[str, str]) -> None:
        self.asked.append((*self._at, method, path, headers.get("Cookie", "")))

    def getresponse(self) -> SimpleNamespace:
        said = f"{client_service._SESSION}=0123; Path=/; Secure"
        told = json.dumps(self.told).encode()
        return SimpleNamespace(status=200, read=lambda: told, getheader=lambda *_: said)

    def close(self) -> None:
        pass


@pytest.fixture
def http(monkeypatch: pytest.MonkeyPatch) -> list[tuple[str, Any, str, str, str]]:
    Http.asked = []
    for name in ("HTTPConnection", "HTTPSConnection"):
        monkeypatch.setattr(client_service.http.client, name, Http)
    return Http.asked


def test_leaving_logs_the_session_out_once(http: list[tuple[str, Any, str, str, str]]) -> None:
    """Its own session: the request names it."""
    with Service("http://127.0.0.1:8650", "anna", "secret") as session:
        assert (session.who.user, session.who.person) == ("anna", "bela")
    session.close()
    assert [each[2:] for each in http] == [
        ("POST", "/api/v1/login", ""), ("POST", "/api/v1/logout", f"{client_service._SESSION}=0123")
    ]  # fmt: skip


@pytest.mark.parametrize(
    ("address", "at"), [("https://gantry.example", ("gantry.example", 443)), ("http://[::1]", ("::1", 80))]
)
def test_an_address_without_a_port_has_the_usual_one(
    http: list[tuple[str, Any, str, str, str]], address: str, at: tuple[str, int]
) -> None:
    Service(address, "anna", "secret")
    assert http[0][:2] == at


def test_a_recording_is_read_while_it_is_there(
    http: list[tuple[str, Any, str, str, str]], monkeypatch: pytest.MonkeyPatch
) -> None:
    """It is in a folder of its own, which is gone behind it."""
    read: list[Path] = []

    def look(path: Path) -> bytes:
        read.append(path)
        return path.read_bytes()

    monkeypatch.setattr(client_service, "read_trace", look)
    session = Service("http://127.0.0.1:8650", "anna", "secret")
    found = session.recording(Recording("ab/c", "move-7.parquet", 90, "now"))
    assert found == json.dumps(Http.told).encode()
    assert http[-1][3] == "/api/v1/traces/ab%2Fc"
    assert not read[0].parent.exists()


def test_what_the_service_tells_newest_first_stays_so(
    http: list[tuple[str, Any, str, str, str]], monkeypatch: pytest.MonkeyPatch
) -> None:
    """And alarms are those of the past too. A cookie of another name is no session."""
    session = Service("http://127.0.0.1:8650", "anna", "secret")
    rows = [{"id": str(n), "name": f"move-{n}", "size": 1, "modified": "now"} for n in (3, 2, 1)]
    monkeypatch.setattr(Http, "told", rows)
    assert [each.name for each in session.recordings()] == ["move-3", "move-2", "move-1"]
    monkeypatch.setattr(Http, "told", {"active": [], "history": [NOT_HELD]})
    assert session.alarms() == [NOT_HELD]
    session._keep_cookie("__Host-gantryctl_console=77; Path=/; Secure")
    assert session._cookie == f"{client_service._SESSION}=0123"


# --- a key ----------------------------------------------------------------------------------------


@pytest.mark.parametrize(("pause_s", "lost"), [(0.1, False), (0.3, True)])
def test_who_looks_often_enough_has_held_the_key(
    axis: Axis, service: FakeService, monkeypatch: pytest.MonkeyPatch, pause_s: float, lost: bool
) -> None:
    """A lease of 250 ms; each look is counted from the one before, not from the press."""
    now_s = [0.0]
    monkeypatch.setattr(held, "time", SimpleNamespace(monotonic=lambda: now_s[0]))
    with pytest.raises(KeyLost, match=r"for 0\.30 s") if lost else nullcontext(), axis.hold("forward") as key:
        for _ in range(5):
            service.frame()
            next(key)
            now_s[0] += pause_s


def test_a_key_that_an_alarm_has_taken_tells_the_alarm(axis: Axis, service: FakeService) -> None:
    service.refused["renew"] = "SEC-09"
    with axis.hold("forward") as key:

        def go_on() -> None:
            while True:
                service.frame(alarms=[NOT_HELD])
                next(key)

        with pytest.raises(AlarmStop, match="BRK-03"):
            go_on()


def test_a_key_is_let_go_before_the_axis_is_waited_for(axis: Axis, service: FakeService) -> None:
    sent: list[str] = []
    key = held.Held(axis._connection, "forward", lambda: sent.extend(service.kinds()))
    with key:
        pass
    assert sent == ["jog", "release"]


def test_a_refusal_of_before_takes_no_key(axis: Axis, service: FakeService) -> None:
    connection = axis._connection
    axis.halt()
    dead = {"ok": False, "code": "SEC-09", "text": "dead", "values": {}, "epoch": 7, "journal": 0}
    connection._take({"type": "reply", "seq": connection._seq, **dead})
    with axis.hold("forward") as key:
        service.frame()
        next(key)


def test_power_that_does_not_come_is_taken_back() -> None:
    service = FakeService(power=False, power_phase="off")
    with Axis(service) as axis:
        with pytest.raises(MotionStopped, match="the power sequence has ended"):
            axis.power_on()
        assert service.kinds() == ["power", "power"]
        assert service.sent[-1]["on"] is False
    # Once: power that somebody else switches on behind it is not this program's to take.
    assert service.kinds() == ["power", "power"]


# --- the connection -------------------------------------------------------------------------------


def test_the_next_frame_of_a_silent_controller_is_none(axis: Axis, service: FakeService) -> None:
    """A held key would be renewed by it."""
    service.frame(fresh=False)
    while not axis._connection.stale:
        time.sleep(0.005)
    with pytest.raises(DeviceError, match="no present state"):
        axis._connection.next_frame(0, timeout_s=0.02)


def test_the_end_of_a_connection_wakes_whoever_waits(
    axis: Axis, service: FakeService, monkeypatch: pytest.MonkeyPatch
) -> None:
    connection, woken = axis._connection, list[object]()
    monkeypatch.setattr(connection._news, "notify_all", lambda: woken.append(connection._ended))
    service.close()
    connection._reader.join(PATIENCE_S)
    assert isinstance(woken[-1], DeviceError)


def test_leaving_ends_the_connection_before_it_waits_for_its_reader(
    axis: Axis, service: FakeService, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Control ends with the connection."""
    did: list[str] = []
    close = service.close
    monkeypatch.setattr(service, "close", lambda: (did.append("ended"), close()))
    monkeypatch.setattr(axis._connection._reader, "join", lambda _: did.append("waited"))
    axis.close()
    assert did == ["ended", "waited"]


@pytest.mark.parametrize("said", [DeviceError("silent"), "{}", "no JSON"])
def test_a_connection_that_cannot_be_used_is_ended(said: DeviceError | str) -> None:
    class Wire(FakeService):
        ended = False

        def receive(self) -> str:
            if isinstance(said, DeviceError):
                raise said
            return said

        def close(self) -> None:
            self.ended = True

    wire = Wire()
    with pytest.raises(DeviceError):
        Axis(wire)
    assert wire.ended


def test_who_has_control_at_the_console_may_take_it_again(
    axis: Axis, service: FakeService, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(axis._connection, "welcome", axis.welcome._replace(place="local"))
    service.frame(authority_user="anna", at_rest=True)
    assert axis.wait_until(lambda tags: tags.authority_user == "anna", PATIENCE_S)
    axis.take()
    assert service.kinds() == ["take"]


def test_a_refusal_before_the_connection_has_code_and_text() -> None:
    refused = refusal_of(b'{"error": {"code": "SEC-06", "text": "too many connections"}}', 429)
    assert isinstance(refused, Refused)
    assert (refused.code, str(refused)) == ("SEC-06", "SEC-06 · too many connections")
    assert "HTTP status 502" in str(refusal_of(b"<html>", 502))


def test_no_frame_waits_in_front_of_a_slow_reader(monkeypatch: pytest.MonkeyPatch) -> None:
    """The library holds 16 messages back by itself, which would be old when they are read and look fresh."""
    options: dict[str, Any] = {}

    def connect(address: str, **given: Any) -> nullcontext[None]:
        options.update(given, address=address)
        return nullcontext()

    monkeypatch.setattr("websockets.sync.client.connect", connect)
    WebSocketWire("https://gantry:8650", "/api/v1/socket", "session=1", None)
    assert options["address"] == "wss://gantry:8650/api/v1/socket"
    assert (options["max_queue"], options["origin"]) == (None, "https://gantry:8650")
