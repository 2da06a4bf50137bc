"""The client without a service: what it sends, when a key counts as lost, and what it never does by itself."""

from __future__ import annotations

import threading
import time
from collections.abc import Iterator
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

from gantryctl.client import Axis, KeyLost, MotionStopped, Refused, Service
from gantryctl.errors import AlarmStop, DeviceError, UsageError
from unit.client.played_service import PATIENCE_S, FakeService


class Frames:
    """Sends a frame every 5 ms until it is left."""

    def __init__(self, service: FakeService) -> None:
        self._service, self._end = service, threading.Event()
        self._thread = threading.Thread(target=self._run)

    def _run(self) -> None:
        while not self._end.wait(0.005):
            self._service.frame()

    def __enter__(self) -> None:
        self._thread.start()

    def __exit__(self, *_: object) -> None:
        self._end.set()
        self._thread.join()


@pytest.fixture
def service() -> FakeService:
    return FakeService()


@pytest.fixture
def axis(service: FakeService) -> Iterator[Axis]:
    made = Axis(service)
    yield made
    made.close()


def test_a_refusal_has_its_code(service: FakeService, axis: Axis) -> None:
    service.refused["move"] = "SEC-07"
    with pytest.raises(Refused, match="SEC-07 · why") as refused:
        axis.move(10.0)
    assert refused.value.code == "SEC-07"
    assert service.kinds() == ["move"], "what is refused has begun nothing, so there is nothing to stop"


def test_a_move_ends_at_its_target_and_not_where_somebody_has_stopped_it(
    service: FakeService, axis: Axis
) -> None:
    service.moves["move"] = {"pos_ref_deg": 10.0}
    assert axis.move(10.0).pos_ref_deg == 10.0
    service.moves["move"] = {"pos_ref_deg": 15.0}
    with pytest.raises(MotionStopped, match=r"stopped at 15\.0000 deg, before 20"):
        axis.move(20.0)
    # A stop just before the end is one too: tags have six decimals.
    service.moves["move"] = {"pos_ref_deg": 19.99}
    with pytest.raises(MotionStopped, match=r"stopped at 19\.9900 deg, before 20"):
        axis.move(20.0)


def test_a_modulo_axis_counts_its_angle_within_one_turn(service: FakeService, axis: Axis) -> None:
    service.moves["move_by"] = {"pos_ref_deg": 40.0, "axis_kind": "modulo"}
    assert axis.move_by(400.0).pos_ref_deg == 40.0


def test_a_turn_away_from_its_target_a_linear_axis_is_not_there(service: FakeService, axis: Axis) -> None:
    """From one end of +-180 deg to the other: somebody stops it before it has begun."""
    service.moves["move"] = {"pos_ref_deg": -180.0}
    with pytest.raises(MotionStopped, match=r"stopped at -180\.0000 deg, before 180"):
        axis.move(180.0)


def test_ctrl_c_while_it_moves_is_a_stop(
    service: FakeService, axis: Axis, monkeypatch: pytest.MonkeyPatch
) -> None:
    service.moves["move"] = {"at_rest": False}

    def interrupted() -> Iterator[Any]:
        raise KeyboardInterrupt

    monkeypatch.setattr(axis, "frames", interrupted)
    with pytest.raises(KeyboardInterrupt):
        axis.move(10.0)
    assert service.kinds() == ["move", "stop"]


def test_an_alarm_ends_a_move(service: FakeService, axis: Axis) -> None:
    row = {"first_out": True, "text": "CTL-03 STOP", "code": "CTL-03"}
    service.moves["move"] = {"at_rest": False, "alarms": [row]}
    with pytest.raises(AlarmStop) as stopped:
        axis.move(10.0)
    assert stopped.value.code == "CTL-03"


def test_every_turn_of_the_loop_acknowledges_the_frame_before_it(service: FakeService, axis: Axis) -> None:
    with Frames(service), axis.hold("forward") as key:
        for count, _ in enumerate(key):
            if count == 3:
                break
    sent = [message for message in service.sent if message["type"] != "alive"]
    assert [message["type"] for message in sent] == ["jog", *4 * ["renew"], "release"]
    marks = [int(message["frame"].partition("-")[0]) for message in sent[:-1]]
    assert marks[1] >= marks[0]
    assert marks[1:] == sorted(set(marks[1:])), "each names a newer frame than the one before"
    assert len({message["lease"] for message in sent}) == 1


def test_the_thread_that_reads_says_that_it_lives_and_never_renews(service: FakeService, axis: Axis) -> None:
    """A program that hangs in the body of the loop must not hold a key: only its loop renews."""
    with pytest.raises(KeyLost, match="nobody looked at the axis"), Frames(service), axis.hold("reverse"):
        time.sleep(0.4)  # longer than the lease of 250 ms
    assert service.kinds() == ["jog", "release"]
    assert sum(message["type"] == "alive" for message in service.sent) > 3


def test_a_key_that_the_service_has_let_go_is_lost_and_never_pressed_again(
    service: FakeService, axis: Axis
) -> None:
    service.refused["renew"] = "SEC-09"
    held = axis.hold("forward")
    with pytest.raises(KeyLost, match="SEC-09") as lost, Frames(service), held as key:
        key.keep(PATIENCE_S)
    assert lost.value.code == "SEC-09"
    with pytest.raises(KeyLost, match="make a new one"), held:
        pass
    assert service.kinds().count("jog") == 1
    assert service.kinds()[-1] == "release"


def test_a_body_that_raises_lets_the_key_go(service: FakeService, axis: Axis) -> None:
    with pytest.raises(ZeroDivisionError), axis.hold("forward"):
        raise ZeroDivisionError
    assert service.kinds() == ["jog", "release"]


def test_leaving_by_an_exception_stops_the_axis_and_gives_control_back(service: FakeService) -> None:
    axis = Axis(service)
    axis.take()
    with pytest.raises(ZeroDivisionError), axis:
        raise ZeroDivisionError
    assert service.kinds() == ["take", "stop", "give"]


def test_power_that_was_on_stays_on_and_what_was_switched_on_here_goes_off() -> None:
    service = FakeService(power=True)
    with Axis(service) as axis:
        axis.power_on()
    assert service.kinds() == []
    service = FakeService(power=False, power_phase="off")
    service.moves["power"] = {"power": True, "power_phase": "on"}
    with Axis(service) as axis:
        axis.take()
        axis.power_on()
        service.moves["power"] = {"power": False, "power_phase": "off"}
    assert service.kinds() == ["take", "power", "power", "give"]


def test_the_local_console_takes_no_control_from_anybody_unasked(
    service: FakeService, axis: Axis, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(axis._connection, "welcome", axis.welcome._replace(place="local"))
    service.frame(authority_user="otto", authority_client="other")
    axis.wait_until(lambda tags: tags.authority_user == "otto", PATIENCE_S)
    with pytest.raises(Refused, match="SEC-07 · otto has control"):
        axis.take()
    assert service.kinds() == []
    axis.take(over=True)
    assert service.kinds() == ["take"]


def test_what_is_not_the_present_state_is_no_state(service: FakeService, axis: Axis) -> None:
    service.frame(fresh=False, pos_ref_deg=1.0)
    while not axis._connection.stale:
        time.sleep(0.005)
    with pytest.raises(DeviceError, match="no present state"):
        _ = axis.tags
    service.close()
    with pytest.raises(DeviceError, match="has gone"):
        axis.stop()


def test_the_age_of_a_frame_is_that_of_its_values_and_what_has_passed_since(
    axis: Axis, service: FakeService, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Of 500 ms: 300 ms old as it came, so it is the present state for 200 ms more."""
    now_s = [time.monotonic()]
    monkeypatch.setattr("gantryctl.client.connection.time", SimpleNamespace(monotonic=lambda: now_s[0]))
    service.frame(age_ms=300.0, pos_ref_deg=1.0)
    while axis._connection.frame.tags.pos_ref_deg != 1.0:
        time.sleep(0.005)
    now_s[0] += 0.199
    assert not axis._connection.stale
    now_s[0] += 0.002
    assert axis._connection.stale


def test_an_axis_shows_itself_in_a_notebook_without_any_markup_of_others() -> None:
    service = FakeService(machine="<script>alert(1)</script>", pos_act_deg=12.5)
    with Axis(service) as axis:
        page = axis._repr_html_()
    assert "12.5000 deg" in page
    assert "<script" not in page


@pytest.mark.parametrize(
    ("address", "words"),
    [
        ("http://gantry.example:8650", "with TLS only"),
        ("ftp://gantry.example", "http"),
        ("gantry:8650", "http"),
        ("https://gantry.example/page", "HOST:PORT"),
    ],
)
def test_a_password_goes_to_no_address_that_it_should_not(address: str, words: str) -> None:
    with pytest.raises(UsageError, match=words):
        Service(address, "anna", "secret")


def test_a_certificate_that_is_none_is_named(tmp_path: Path) -> None:
    (tmp_path / "cert.pem").write_text("nothing", encoding="ascii")
    with pytest.raises(UsageError, match=r"cert\.pem"):
        Service("https://localhost:1", "anna", "secret", certificate=tmp_path / "cert.pem")
    with pytest.raises(DeviceError, match="does not answer"):
        Service("http://127.0.0.1:1", "anna", "secret")
