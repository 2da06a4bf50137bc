"""`gantryctl why`: what it tells of the last stop is what the recording and the alarms say."""

from __future__ import annotations

import json
import re
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from gantryctl.cli.axis import why
from gantryctl.engineering.report.last_stop import last_stop, moment_of
from gantryctl.machine import default_machine
from gantryctl.runtime import AlarmEntry
from gantryctl.service.recorder.journal import reading
from gantryctl.trace.reader import read_trace
from support.command_line import cli, done, machine_file


def stopped_machine() -> Path:
    """A machine without speed feed-forward: CTL-12 warns, CTL-03 stops it."""
    file = machine_file(Path("weak.toml"), {"control.kvf": 0.0})
    assert cli("move", "30", "--config", file).code == 4
    return file


def test_a_machine_that_no_alarm_has_stopped_says_so() -> None:
    assert done("why").out == "hust_gantry: no alarm has stopped the axis\n"
    assert done("why", "--json").json is None


def test_what_is_told_is_what_was_recorded() -> None:
    file = stopped_machine()
    found = done("why", "--config", file, "--json").json
    trace = read_trace(found["moment"]["file"])
    row = int(np.argmax(trace["alarm_count"] >= 2))  # the warning was the first
    time_s = found["first"]["time_s"]
    assert (found["first"]["code"], found["first"]["severity"]) == ("CTL-03", "STOP")
    assert [alarm["code"] for alarm in found["before"]] == ["CTL-12"]
    assert time_s == pytest.approx(trace.time_s[row], abs=1e-9)
    assert found["moment"]["speed_deg_s"] == pytest.approx(np.degrees(trace["vel_act_rad_s"][row]))
    # It was stopped while it turned slowly: the drive's own ramp of 5.5 deg/s2 takes v / 5.5 s and v^2 / 11 deg, the
    # load's swing pulls at it by some hundredths.
    speed = found["moment"]["speed_deg_s"]
    assert found["moment"]["way_deg"] == pytest.approx(speed**2 / 11.0, abs=0.01)
    assert found["moment"]["drive"][0]["state"] == "OPERATION_ENABLED"
    assert [each["state"] for each in found["moment"]["drive"]][1:] == [
        "QUICK_STOP_ACTIVE",
        "SWITCH_ON_DISABLED",
    ]
    assert found["holds"]
    assert found["command"] is None
    text = done("why", "--config", file).out
    assert re.search(r"hust_gantry was stopped on \S+Z, 1\.\d{3} s after the run began, by CTL-03", text)
    assert f"turning at {speed:+.3f} deg/s" in text
    # The following error that stopped it, as the alarm itself says it.
    said = re.search(r"Following error (\d\.\d{3}) deg, limit", found["first"]["text"])
    assert said is not None
    assert found["moment"]["error_deg"] == pytest.approx(float(said[1]), abs=6e-4)
    assert "No other alarm followed" in text
    assert "It still holds the axis" in text
    assert Path(found["picture"]).read_bytes().startswith(b"\x89PNG")


def test_a_stop_of_the_past_is_told_with_its_own_recording() -> None:
    file = stopped_machine()
    before = done("why", "--config", file, "--json").json
    done("reset", "--config", file)
    assert cli("move", "0.16", "--config", file, "--speed", "0.6").code == 0
    later = done("why", "--config", file, "--json").json
    assert not later["holds"]
    assert later["moment"]["file"] == before["moment"]["file"]
    Path(later["moment"]["file"]).unlink()
    text = done("why", "--config", file).out
    assert "No recording of that moment is left" in text
    assert "does not hold the axis any more" in text
    assert "picture" not in text


def alarm(code: str, time_s: float, severity: str = "STOP", follows: str = "", at: str = "now") -> AlarmEntry:
    return AlarmEntry(code, code, at, time_s, 0.0, severity=severity, follows=follows)


def test_the_first_alarm_is_the_cause_and_what_followed_is_in_order() -> None:
    newest_first = [
        alarm("CTL-12", 9.0, "WARNING"),
        alarm("DRV-02", 5.2, follows="ENC-01"),
        alarm("CTL-03", 5.1, follows="ENC-01"),
        alarm("ENC-01", 5.0),
        alarm("CTL-12", 4.0, "WARNING"),
        alarm("BUS-01", 4.0, at="yesterday"),
    ]
    found = last_stop(newest_first, ["ENC-01"])
    assert found is not None
    assert found.first.code == "ENC-01"
    assert [each.code for each in found.followed] == ["CTL-03", "DRV-02"]
    assert [each.code for each in found.before] == ["CTL-12"]
    assert found.holds
    # A memory of an older version knows the code alone.
    old = last_stop([alarm("CTL-12", 9.0, ""), alarm("CTL-03", 5.0, "")], [])
    assert old is not None
    assert old.first.code == "CTL-03"
    assert last_stop([alarm("CTL-12", 9.0, "WARNING")], []) is None


def test_a_recording_without_that_alarm_is_not_shown_for_it() -> None:
    """The liar: a run that has the time of the alarm, and nothing happened in it."""
    done("move", "1")
    folder = next(Path().absolute().parent.rglob("traces"))
    assert moment_of(default_machine(), alarm("CTL-03", 1.0, at="2099-01-01T00:00:00Z"), folder) is None


def test_the_last_command_is_one_that_was_carried_out(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Somebody else asks for a move without control while anna's is under way: it asks nothing of the axis."""
    (tmp_path / "journal.sqlite").touch()
    told = [
        ("command", "anna", "move 90.0: done", {"time_s": 3.0}),
        ("command", "otto", "move 10.0: refused: SEC-07 anna has control", {"code": "SEC-07"}),
        ("alarm", "", "DRV-01 STOP", {"code": "DRV-01", "time_s": 5.0}),
        ("alarm", "", "CTL-03 STOP", {"code": "CTL-03", "time_s": 5.1}),
        ("command", "otto", "reset: done", {"time_s": 9.0}),
    ]
    rows = [
        SimpleNamespace(values={"kind": kind, "user": user, "text": text, "utc": "now", "detail": json.dumps(detail)})
        for kind, user, text, detail in told
    ]  # fmt: skip
    monkeypatch.setattr(reading, "read_journal", lambda *_, **__: rows)
    alarm = AlarmEntry("CTL-03", "CTL-03 STOP", "now", 5.1, 0.0)
    assert why._asked_for(tmp_path, alarm) == "move 90.0: done, by anna, now"
