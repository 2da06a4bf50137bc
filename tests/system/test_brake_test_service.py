"""The brake test of the service with real processes: arming, the test, and what ends it."""

from __future__ import annotations

import io
import json
import os
import signal
import sys
from collections.abc import Iterator

import pytest

from gantryctl.service.recorder.journal.reading import read_journal
from support.command_line import cli
from support.service_process import Page, Service, add_users

pytestmark = pytest.mark.skipif(sys.platform != "linux", reason="the service needs Linux")


@pytest.fixture(scope="module")
def service(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Service]:
    root = tmp_path_factory.mktemp("brake")
    add_users(root)
    with Service(root) as made:
        yield made


def begin(page: Page) -> None:
    page.do("take", over=False)
    page.do("arm", action="brake_test")
    page.until(lambda tags: tags["armed_action"] == "brake_test" and tags["armed_left_s"] > 0.0)
    assert page.tags["armed_by"] == "physicist"
    page.do("brake_test")


def test_a_physicist_tests_the_brake_at_the_page(service: Service) -> None:
    with service.page("physicist") as page:
        assert page.look()["brake_test_available"]
        assert page.refused("brake_test") == "SEC-07"
        begin(page)
        tags = page.until(lambda tags: tags["brake_test_phase"] == "plus_held")
        assert tags["power_phase"] == "testing"
        assert not tags["brake_open_cmd"]
        page.until(lambda tags: tags["brake_test_phase"] == "idle" and tags["brake_test_result"] == "passed")
        # 95 % of the level are asked for.
        assert page.tags["brake_test_plus_nm"] == pytest.approx(page.tags["brake_test_level_nm"], rel=0.05)
        assert page.tags["brake_tested_at"]
        assert not page.tags["brake_test_overdue"]
        page.until(lambda tags: tags["journal_committed"] == tags["journal_sequence"])
    rows = [row.values for row in read_journal(service.directory)]
    assert [row["text"] for row in rows if row["user"] == "physicist" and row["kind"] == "command"][-2:] == [
        "arm brake_test: done", "brake_test: done",
    ]  # fmt: skip
    assert any(row["kind"] == "brake_test" and "passed" in row["text"] for row in rows)


@pytest.mark.parametrize("how", ["stop", "closed", "gateway"])
def test_it_ends_when_somebody_stops_it_or_its_page_is_gone(service: Service, how: str) -> None:
    with service.page("physicist") as page:
        tests = page.tags["brake_tests"]
        begin(page)
        page.until(lambda tags: tags["brake_test_phase"] == "plus_held")
        if how == "stop":
            with service.page("viewer") as other:
                other.do("stop")
        elif how == "gateway":
            os.kill(service.child("gateway"), signal.SIGKILL)
    shown: dict[str, object] = {"brake_tests": tests}
    while shown["brake_tests"] == tests:  # its result comes with it, a picture after the phase
        shown = json.loads(service.command("status", "--service", "--json").stdout)["tags"]
    assert shown["brake_test_result"] == "aborted"
    assert shown["power_phase"] == "off"
    assert not shown["brake_open"]


def test_the_command_line_tests_resets_and_shows_what_the_service_knows(service: Service) -> None:
    done = service.command("brake-test", "--service", "--yes", "--json")
    assert (done.returncode, done.stderr) == (0, "")
    assert json.loads(done.stdout)["result"] == "passed"
    assert json.loads(service.command("retain", "show", "--service", "--json").stdout)["brake_tests"] >= 1
    with service.page("viewer") as page:
        page.do("quick_stop")  # with power off it stops nothing
    assert service.command("attach").returncode == 0
    assert service.command("reset").stdout == "nothing to reset\n"
    assert json.loads(service.command("alarms", "--json").stdout) == []
    assert service.command("detach").returncode == 0


def test_power_is_switched_watched_and_left_from_the_command_line(
    service: Service, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("GANTRYCTL_STATE", str(service.root))
    assert "hust_gantry: no alarm has stopped" in cli("why", "--service").out
    until = "; it goes off after 300 s at rest with nobody in control\n"
    assert cli("power", "on", "--yes") == (0, f"power is on{until}", "")
    # Each command finds control free, however soon it follows: one of four was refused by SEC-07 before.
    assert {cli("power", "on", "--yes") for _ in range(16)} == {(0, f"power was on already{until}", "")}
    # The command has ended and power is still there; without an answer it would not have come.
    monkeypatch.setattr("sys.stdin", io.StringIO("n\n"))
    answer = cli("power", "on")
    assert (answer.code, "power stays off" in answer.err) == (2, True)
    with service.start("status", "--watch", "--json") as watching:
        assert watching.stdout is not None
        lines = [json.loads(watching.stdout.readline()) for _ in range(2)]
        watching.send_signal(signal.SIGINT)
        assert watching.wait(20) == 0
    assert [line["power"] for line in lines] == [True, True]
    # A line a second of the axis; the status frames come every 50 ms.
    passed_s = lines[1]["time_s"] - lines[0]["time_s"]
    assert 0.99 <= passed_s <= 1.5
    # Nobody has control, so the time left goes down as the time of the axis goes on, a scan or two apart.
    first, second = (line["unheld_power_left_s"] for line in lines)
    assert 0.0 < second < first < 300.0
    assert first - second == pytest.approx(passed_s, abs=0.05)
    assert "; off in " in cli("status", "--service").out
    assert cli("power", "off").out == "power is off\n"
    assert cli("power", "off").out == "power was off already\n"
