"""`--json`: one document, finite numbers, exactly the keys that docs/reference/json.md names."""

from __future__ import annotations

import io
import json
import re
import shutil
from collections.abc import Iterator
from contextlib import nullcontext
from pathlib import Path
from typing import Any

import click
import pytest

from gantryctl.cli.main import cli as commands
from gantryctl.engineering.instruments import Reading
from gantryctl.engineering.instruments.line_server import LineServer
from gantryctl.machine import configs_folder, default_machine
from gantryctl.operation.store import state_root
from gantryctl.service.recorder.journal.writer import Journal
from support.command_line import cli, done, machine_file

PAGE = Path(__file__).parents[3] / "docs" / "reference" / "json.md"
COMMAND = re.compile(r"`gantryctl ([^`]+)`")
KEY = re.compile(r"`([a-z_0-9]+)`")


def documented() -> dict[str, set[str]]:
    """The keys that the page names, by command."""
    found: dict[str, set[str]] = {}
    for section in PAGE.read_text(encoding="utf-8").split("\n## ")[1:]:
        title, _, body = section.partition("\n")
        items = re.findall(r"^- (.*?):", body, re.MULTILINE)
        for command in COMMAND.findall(title):
            found[command] = {key for item in items for key in KEY.findall(item)}
    return found


KEYS = documented()


def prepare() -> None:
    """A machine with a move, a trace, an alarm, and files to look at."""
    done("sim", "reset", "--angle", "181")
    done("encoder", "set-zero", "--angle", "0", "--witness", "wrong mark")
    assert cli("move", "3").code == 4  # into the limit switch, by the wrong mark
    machine_file(Path("a.toml"), {})
    machine_file(Path("b.toml"), {"control.kvf": 0.9})
    shutil.copy(next(Path().absolute().parent.rglob("*/traces/*.parquet")), "run.parquet")


def campaign_file() -> None:
    """A campaign of two plants."""
    Path("small.toml").write_text(
        '[campaign]\nname = "small"\ntests = ["move"]\ncount = 2\n[move]\nto_deg = 0.1\n[vary.gear]\nlaw = "phases"\n'
    )


def drift_files() -> None:
    """Two ways of control and a plant that changes."""
    quick = {"accuracy.dwell_s": 0.5, "accuracy.average_s": 0.2, "accuracy.bases_deg": [0.0]}
    for name, kvf in (("quick", 1.0), ("slow", 0.9)):
        machine_file(Path(f"{name}.toml"), quick | {"machine.name": name, "control.kvf": kvf})
    Path("drift.toml").write_text("[row.gap.set]\nplant.transmission.backlash_mm = 0.2\n")


class Level:
    """An instrument."""

    name = "level"

    def read(self, time_s: float) -> Reading:
        return Reading(0.0, 0.001)


CAN = configs_folder() / "hust_can.toml"
SHEET = configs_folder() / "requirements" / "rotary_table.toml"
RUNS: dict[str, list[str]] = {
    "move": ["move", "0.5", "--fresh"],
    "jog": ["jog", "+", "--for", "1", "--fresh"],
    "status": ["status"],
    "alarms": ["alarms"],
    "reset": ["reset"],
    "brake-test": ["brake-test", "--fresh"],
    "encoder show": ["encoder", "show"],
    "encoder set-zero": ["encoder", "set-zero", "--angle", "3", "--witness", "mark"],
    "retain show": ["retain", "show"],
    "state show": ["state", "show"],
    "sim reset": ["sim", "reset"],
    "stops": ["stops", "--speed", "1"],
    "profile": ["profile", "--move", "0", "5", "--base-um", "400"],
    "stops --find-quick": ["stops", "--find-quick"],
    "speed-test": ["speed-test", "--speed", "3"],
    "accuracy run": ["accuracy", "run", "--no-speed-test", "--out", "report"],
    "accuracy report": ["accuracy", "report", "--measured", "table.csv", "--out", "report"],
    "accuracy measure": ["accuracy", "measure", "--instrument", "simulated", "--config", "quick.toml"],
    "instrument read": ["instrument", "read", "tcp:127.0.0.1:47113"],
    "accuracy stats": ["accuracy", "stats", "paper_table2.csv"],
    "accuracy gear": ["accuracy", "gear"],
    "accuracy isocentre": ["accuracy", "isocentre", "--step-deg", "30"],
    "can scan": ["can", "scan", "--config", str(CAN)],
    "can log": ["can", "log", "bus.log"],
    "drive status": ["drive", "status", "--config", str(CAN)],
    "drive diff": ["drive", "diff", "--config", str(CAN)],
    "drive objects": ["drive", "objects", "--config", str(CAN)],
    "drive profiles": ["drive", "profiles"],
    "drive profiles show": ["drive", "profiles", "show", "e35"],
    "drive gains": ["drive", "gains", "--config", "epos4.toml"],
    "drive field": ["drive", "field", "--drive", "Faulhaber", "--config", str(CAN)],
    "size": ["size"],
    "size motors": ["size", "motors"],
    "size init": ["size", "init", "sheet.toml", "--template", "tilt_table"],
    "new": ["new", "rig", "--template", "tilt_table", "--gears", "0"],
    "config init --sheet": ["config", "init", "rig.toml", "--sheet", str(SHEET), "--gears", "0"],
    "analyse": ["analyse"],
    "tune": ["tune", "--method", "margins"],
    "identify": ["identify", "--out", "found.toml"],
    "compare": ["compare", "paper", "paper"],
    "compare --drift": ["compare", "quick.toml", "slow.toml", "--drift", "drift.toml"],
    "compare --stale-days": ["compare", "--stale-days", "1"],
    "bench": ["bench", "jitter", "--repeats", "1", "--scale", "0.01"],
    "doctor": ["doctor", "--period", "4", "--seconds", "0.1"],
    "campaign run": ["campaign", "run", "small.toml"],
    "campaign show": ["campaign", "show", "small.result"],
    "campaign compare": ["campaign", "compare", "small.result", "small.result"],
    "campaign plot": ["campaign", "plot", "small.result"],
    "campaign plan": ["campaign", "plan", "small.toml", "--measure", "0.01"],
    "config check": ["config", "check", "a.toml"],
    "config show": ["config", "show", "a.toml"],
    "config diff": ["config", "diff", "a.toml", "b.toml"],
    "config init": ["config", "init", "new.toml", "--improved"],
    "config export": ["config", "export"],
    "backup create": ["backup", "create", "new.tar.gz"],
    "backup show": ["backup", "show", "old.tar.gz"],
    "backup restore": ["backup", "restore", "old.tar.gz"],
    "trace show": ["trace", "show", "run.parquet"],
    "trace list": ["trace", "list"],
    "trace compare": ["trace", "compare", "run.parquet", "run.parquet"],
    "why": ["why"],
    "eds check": ["eds", "check", "drive.eds"],
    "faults list": ["faults", "list"],
    "faults list --kinds": ["faults", "list", "--kinds"],
    "faults show": ["faults", "show", "A2"],
    "faults run": ["faults", "run", "--fault", "D1"],
    "faults campaign": [
        "faults",
        "campaign",
        "--scan",
        "10",
        "--count",
        "1",
        "--first",
        "3",
        "--workers",
        "1",
    ],
    "faults replay": ["faults", "replay", "3", "--scan", "10"],
    "faults shrink": ["faults", "shrink", "--file", "breaks.toml", "--trials", "1"],
    "faults report": ["faults", "report", "faults_random.result"],
    "journal show": ["journal", "show"],
    "journal verify": ["journal", "verify"],
    "user list": ["user", "list"],
    "trace plot": ["trace", "plot", "run.parquet"],
    "trace export": ["trace", "export", "run.parquet", "--format", "csv"],
}


def slipping_encoder() -> None:
    """A scenario that breaks something: nothing sees a coupling that slips by a fiftieth (row A18)."""
    Path("breaks.toml").write_text(
        "scan_ms = 10.0\nduration_s = 8.0\nramp_deg_s2 = 1.0\n"
        '[[actions]]\nat_s = 0.1\ndo = "power"\n'
        '[[actions]]\nat_s = 1.6\ndo = "move"\ntarget_deg = 60.0\nspeed_deg_s = 3.0\n'
        '[[faults]]\nnumber = "A18"\nat_s = 3.0\n'
    )


FILES = {
    "compare --drift": drift_files,
    "eds check": lambda: done("drive", "sim", "--write-eds", "drive.eds"),
    "faults report": lambda: done(*RUNS["faults campaign"]),
    "faults shrink": slipping_encoder,
}
"""What a command needs before it."""


def with_json(command: click.Command, path: str, ctx: click.Context) -> Iterator[str]:
    """Every command and group that has the option."""
    if any("--json" in option.opts for option in command.params):
        yield path.strip()
    if isinstance(command, click.Group):
        for name in command.list_commands(ctx):
            below = command.get_command(ctx, name)
            assert below is not None
            yield from with_json(below, f"{path} {name}", ctx)


def test_the_page_names_every_command_that_prints_json() -> None:
    assert set(KEYS) == set(RUNS)
    assert all(KEYS.values())
    # `size` alone is `size motors`.
    named = {command.partition(" --")[0] for command in KEYS} - {"size"}
    assert named == set(with_json(commands, "", click.Context(commands)))


def journal() -> None:
    """One event."""
    record = {"utc": "2026-01-01", "monotonic_ns": 1, "kind": "command", "user": "anna", "role": "operator",
              "place": "local", "client": "c", "text": "stop: done"}  # fmt: skip
    made = Journal(state_root() / default_machine().name)
    made.append(1, 0, 1, [json.dumps(record).encode()])
    made.close()


LONG = (
    "accuracy measure",
    "compare",
    "compare --drift",
    "compare --stale-days",
    "stops --find-quick",
    "tune",
)
"""Three to five seconds of a processor each."""


def marks(command: str) -> list[pytest.MarkDecorator]:
    on_bus = [pytest.mark.can] if RUNS[command][-1] == str(CAN) else []
    return on_bus + ([pytest.mark.slow] if command in LONG else [])


@pytest.mark.parametrize("command", [pytest.param(run, marks=marks(run)) for run in RUNS])
def test_the_keys_are_those_of_the_page(command: str, monkeypatch: pytest.MonkeyPatch) -> None:
    if command.split(maxsplit=1)[0] in (
        "status",
        "alarms",
        "reset",
        "retain",
        "state",
        "trace",
        "config",
        "why",
    ):
        prepare()
    Path("table.csv").write_text(
        "base_deg,direction,displacement_deg,error_deg\n0,ccw,5,0.001\n0,cw,5,-0.002\n"
    )
    Path("bus.log").write_text("(1.000000) can0 080#\n(1.004000) can0 182#270200000000\n")
    if command.startswith("backup"):
        prepare()
        done("backup", "create", "old.tar.gz")
    if command == "accuracy measure":
        values = {"accuracy.dwell_s": 0.5, "accuracy.average_s": 0.2, "virtual_axis.acc_deg_s2": 2.0}
        machine_file(Path("quick.toml"), values | {"virtual_axis.dec_deg_s2": 2.0})
    if command in FILES:
        FILES[command]()
    if command.startswith("journal"):
        journal()
    if command == "user list":
        monkeypatch.setattr("sys.stdin", io.StringIO("correct horse battery\n"))
        done("user", "add", "anna", "--role", "operator")
    if command.startswith("campaign"):
        campaign_file()
        if command not in ("campaign run", "campaign plan"):
            done("campaign", "run", "small.toml", "--threads", "1")
    if command == "drive gains":
        drive = {"can.virtual_drive": "maxon EPOS4@", "can.encoder.index": 0}
        machine_file(Path("epos4.toml"), {"drive.kind": "canopen", "control.scan_period_ms": 4.0, **drive})
    with LineServer(Level(), lambda: 0.0, port=47113) if command == "instrument read" else nullcontext():
        answer = cli(*RUNS[command], "--json")
    # As the drive comes, it differs; whether this computer is good enough is not asked here.
    codes = {"drive diff": (1,), "doctor": (0, 1)}
    assert answer.code in codes.get(command, (0,))
    assert answer.err == ""
    value: Any = answer.json
    if isinstance(value, list):
        assert value
        value = value[0]
    assert set(value) == KEYS[command]
    assert answer.out.endswith("\n")
    assert all(Path(name).is_file() for name in value.get("written", []))


def test_summary_and_rows_have_the_keys_of_the_page() -> None:
    text = PAGE.read_text(encoding="utf-8")
    summary = done("move", "0.2", "--json").json["summary"]
    row = done("stops", "--speed", "1", "--json").json["rows"][0]
    value = done("config", "show", "--json").json["values"]["control.kvf"]
    for key in (*summary, *row, *value):
        assert f"`{key}`" in text


def test_what_a_draft_leaves_open_has_the_keys_of_the_page() -> None:
    """Of the tilt table the brake is too strong; with two gears 0.001 deg is no grade's."""
    text = PAGE.read_text(encoding="utf-8")
    asked = ("--template", "tilt_table", "--set", "angle_deg=0.001", "--gears", "2")
    found = done("new", "rig", *asked, "--json").json
    assert set(found["guesses"]) == {"sheet", "machine"}
    for key in (*found["brake_overload"], *found["gears"], *found["gears"]["drafted"]):
        assert f"`{key}`" in text


def test_an_empty_machine_prints_json_too() -> None:
    assert done("alarms", "--json").json == []
    assert done("retain", "show", "--json").json is None
    assert done("reset", "--json").json == {"reset": "nothing to reset"}
    assert done("config", "diff", *[machine_file(Path(f"{k}.toml"), {}) for k in "ab"], "--json").json == []


def test_a_wrong_machine_file_as_json() -> None:
    answer = cli("config", "check", "nowhere.toml", "--json")
    assert answer.code == 2
    assert set(answer.json) == {"file", "ok", "problems"}
    assert [f"error: {line}" for line in answer.json["problems"]] == answer.err.splitlines()
