"""--bus-log and the frames around an alarm, on the command line."""

from __future__ import annotations

from pathlib import Path

import pytest

from gantryctl.cli.drive.can import KINDS
from gantryctl.drives.canopen.decoding.decoder import Kind
from gantryctl.drives.virtual.node import DriveNode
from gantryctl.drives.virtual.side_channel.requests import Requests
from gantryctl.machine import configs_folder, load_machine, with_values
from gantryctl.operation.bus_log import last_frozen, logged_bus
from gantryctl.operation.client import Snapshot
from gantryctl.operation.run import AxisRun
from gantryctl.operation.store import StateStore
from gantryctl.trace.frames.files import read_alarms, read_frames
from gantryctl.trace.frames.recorder import AFTER_S, BEFORE_S
from support.command_line import cli

pytestmark = pytest.mark.can

CONFIG = configs_folder() / "hust_can.toml"


@pytest.mark.parametrize("suffix", ["log", "asc", "blf"])
def test_a_run_in_virtual_time_gives_the_same_bytes_again(tmp_path: Path, suffix: str) -> None:
    logs = [tmp_path / f"{name}.{suffix}" for name in ("first", "second")]
    for log in logs:
        # A command that only reads: 0.2 s of axis time, and every kind of frame of a set-up.
        assert cli("drive", "status", "--config", CONFIG, "--bus-log", log).code == 0
    assert logs[0].read_bytes() == logs[1].read_bytes()
    found = list(read_frames(logs[0]))
    # 6041, statusword: asked for by the master, answered by the drive.
    assert [f.sent for f in found if f.data[1:4] == b"\x41\x60\x00"] == [True, False]


def test_a_command_without_a_bus_says_that_it_logged_nothing(tmp_path: Path) -> None:
    log = tmp_path / "bus.log"
    answer = cli("encoder", "show", "--bus-log", log)
    assert answer.code == 0
    assert f"--bus-log {log}: this command opened no bus" in answer.err
    assert not log.exists()


def test_a_name_without_a_format_is_refused_before_anything_is_opened(tmp_path: Path) -> None:
    answer = cli("drive", "status", "--config", CONFIG, "--bus-log", "bus.pcap")
    assert answer.code == 2
    assert ".log, .asc, .blf" in answer.err


def test_a_drive_fault_freezes_the_frames_around_it(tmp_path: Path) -> None:
    fault_s = 4.0

    def spoil(snapshot: Snapshot) -> None:
        if not spoiled and snapshot.time_s > fault_s:
            assert isinstance(run.drive.truth_source, DriveNode)
            Requests(run.drive.truth_source).answer({"cmd": "event", "event": "fault", "code": 0x2310})
            spoiled.append(snapshot.time_s)

    spoiled: list[float] = []
    machine = with_values(load_machine(CONFIG), {"can.commissioning_required": False})
    with StateStore(machine) as store, logged_bus(None) as log:
        run = AxisRun(machine, store, observer=spoil)
        with pytest.raises(Exception, match="2310"):
            run.move(20.0)
        alarms = {str(alarm.code): alarm.time_s for alarm in run.axis.alarms.history}
        run.close("test")
    frozen = last_frozen()
    assert log.frozen == [frozen]
    assert frozen.parent == store.traces
    told = read_alarms(frozen)
    assert {code for code, _ in told} <= set(alarms)
    frames = list(read_frames(frozen))
    # The emergency message, 81h for node 2 with 2310h, lies within a scan or two of the alarm on the log's clock.
    (emergency,) = [f for f in frames if f.can_id == 0x082 and f.data[:2] == b"\x10\x23"]
    assert told[0][1] == pytest.approx(emergency.time_s, abs=0.02)
    assert frames[-1].time_s - frames[0].time_s <= BEFORE_S + AFTER_S
    # The stop is in it.
    assert len([f for f in frames if f.time_s > emergency.time_s]) > 100
    # And in words, with the alarm as the zero of time, though the set-up may be older than what is left of the frames.
    answer = cli("can", "log", "--last", "--json")
    assert answer.code == 0
    assert answer.json["file"] == str(frozen)
    assert answer.json["alarms"][0] == {"code": told[0][0], "time_s": 0.0}
    before = [f for f in answer.json["frames"] if f["kind"] == "tpdo" and f["time_s"] < -0.1]
    assert {each["object"] for f in before[-10:] for each in f["objects"]} >= {
        "6041:00",
        "6064:00",
        "606C:00",
    }
    shown = cli("can", "log", "--kind", "emcy", "--from", -0.1, "--to", 0.1).out
    assert "EMCY 2310: overcurrent at the output" in shown


def test_filters_and_the_end_of_a_damaged_log(tmp_path: Path) -> None:
    log = tmp_path / "scan.log"
    assert cli("drive", "status", "--config", CONFIG, "--bus-log", log).code == 0
    whole = cli("can", "log", log).out.splitlines()
    assert len(whole) > 10
    assert (
        len(cli("can", "log", log, "--kind", "heartbeat").out.splitlines()) == 2
    )  # the name, and the boot-up
    assert len(cli("can", "log", log, "--node", 3).out.splitlines()) == 1
    log.write_text(log.read_text() + "(0.5) can0 182#1", encoding="utf-8")
    log.write_text(log.read_text() + "\nthis is no frame\n", encoding="utf-8")
    damaged = cli("can", "log", log)
    assert damaged.code == 2
    assert f"{log}: no whole log, damaged after" in damaged.err
    assert damaged.out.splitlines()[: len(whole)] == whole  # what stands before the damage is shown


@pytest.mark.parametrize(
    "arguments", [("nowhere.log",), ("--last", "x.log"), ("--from", 2, "--to", 1), ("x.pcap",)]
)
def test_a_question_that_cannot_be_answered_is_one_line(arguments: tuple[object, ...]) -> None:
    answer = cli("can", "log", *arguments)
    assert answer.code == 2
    assert answer.err.count("\n") == 1


def test_the_kinds_of_the_help_are_those_of_the_decoder() -> None:
    assert tuple(kind.value for kind in Kind) == KINDS
