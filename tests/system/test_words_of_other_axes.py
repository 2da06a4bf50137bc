"""Service, bus and vocabulary of an axis that is no gantry: nothing speaks of the reference machine or its paper."""

from __future__ import annotations

import json
import os
import socket
import subprocess
import sys
from pathlib import Path

import pytest

from gantryctl.engineering.faults.oracle.limits import bounds_of
from gantryctl.engineering.faults.oracle.taps import Oracle
from gantryctl.gateway.routes import openapi
from gantryctl.machine import load_machine, with_values
from gantryctl.machine.effective import to_toml
from gantryctl.program.alarms.table import ALARMS
from gantryctl.program.alarms.words import Words
from gantryctl.service.protocol.tags import TAGS
from support.command_line import cli
from support.foreign_words import foreign, foreign_in
from support.service_process import Service, add_users

PAGE = Path(__file__).resolve().parents[2] / "hmi" / "src" / "lib"
READ = (
    "tags",
    "status",
    "alarms",
    "traces",
    "journal?from=0&limit=1000",
    "session",
    "health",
    "openapi.json",
)


def test_the_vocabulary_that_all_axes_share_is_of_none() -> None:
    """Tags of page, REST and OPC UA, alarms and words in both languages, the API, and the texts of the page."""
    assert foreign(json.dumps([tag._asdict() for tag in TAGS], default=str)) == []
    assert foreign("\n".join(map(repr, ALARMS.values()))) == []
    assert foreign("\n".join(f"{word.value}" for word in Words)) == []
    assert foreign(json.dumps(openapi())) == []
    for name in ("en.ts", "zh.ts", "codes.ts"):
        assert foreign((PAGE / name).read_text(encoding="utf-8")) == [], name


def drafted(template: str, root: Path, **changes: object) -> Path:
    """A machine file as `gantryctl new` writes it, with changes."""
    assert cli("new", "axis1", "--template", template, "--gears", "0", "--out", root).code == 0
    file = root / "axis1.toml"
    if changes:
        machine = with_values(
            load_machine(file), {key.replace("__", "."): value for key, value in changes.items()}
        )
        file.write_text(to_toml(machine), encoding="utf-8")
    return file


def printed(root: Path, *arguments: str) -> str:
    """What a command prints in a process of its own."""
    done = subprocess.run(
        [sys.executable, "-m", "gantryctl", *arguments],
        env={**os.environ, "GANTRYCTL_STATE": str(root)},
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode in (0, 1), (arguments, done.stderr)
    return done.stdout + done.stderr


@pytest.mark.slow
@pytest.mark.parametrize("template", ["telescope_azimuth", "rotary_table", "tilt_table"])
def test_a_service_of_another_axis(template: str, tmp_path: Path) -> None:
    """Moves, refusals, a stop and its reset: what the page, REST, the command line and every file say of them."""
    file = drafted(template, tmp_path)
    add_users(tmp_path)
    said = []
    with socket.create_server(("127.0.0.1", 0)) as free:
        port = free.getsockname()[1]
    with (
        Service(tmp_path, "--config", str(file), "--opcua", f"127.0.0.1:{port}") as service,
        service.page("service", queue=None) as page,
    ):
        page.power_up()
        here = page.tags["pos_act_deg"]
        page.do("move", target_deg=here + 0.5)
        page.until(lambda tags: tags["axis_state"] == "discrete_motion")
        page.until(lambda tags: bool(tags["at_rest"]))
        for kind, values in (
            ("move", {"target_deg": 3000.0}),
            ("speed", {"speed_deg_s": 1e6}),
            ("mode", {"mode": "incremental"}),
        ):
            said.append(page.ask(kind, **values))
        page.say("quick_stop")
        page.until(lambda tags: bool(tags["alarms"]))
        said.append(dict(page.tags))
        said.append(page.ask("reset"))
        page.do("power", on=False)
        for path in READ:
            status, body, _ = service.request("GET", f"/api/v1/{path}", cookie=page.cookie)
            assert status == 200, path
            said.append(body.decode("utf-8"))
        for line in (("status", "--service", "--json"), ("status", "--service")):
            said.append(printed(tmp_path, *line, "--config", str(file)))
        said.append("".join(service.said) + service.errors())
    for line in (
        ("status", "--config", str(file)),
        ("alarms", "--config", str(file)),
        ("encoder", "show", "--config", str(file)),
        ("retain", "show", "--config", str(file)),
        ("journal", "show", "--config", str(file)),
        ("journal", "export", str(tmp_path / "events.csv"), "--config", str(file)),
        ("journal", "verify", "--config", str(file)),
        ("backup", "create", str(tmp_path / "axis1.backup"), "--config", str(file)),
        ("backup", "show", str(tmp_path / "axis1.backup")),
    ):
        said.append(printed(tmp_path, *line))
    assert "quick stop" in "".join(map(str, said)).lower()
    assert foreign("\n".join(map(str, said))) == []
    assert list(foreign_in(tmp_path)) == []


@pytest.mark.slow
@pytest.mark.parametrize(
    ("kind", "changes"),
    [
        # Its draft is for a scan of 1 ms: the band of 9e-3 deg is too narrow for one of 4 ms.
        ("tilt_table", {"monitors__following_error_base_deg": 0.012}),
        ("telescope_azimuth", {}),
        ("wind_turbine_yaw", {}),
        ("crane_slew", {}),
    ],
)
def test_commissioning_of_another_axis(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, oracle: Oracle, kind: str, changes: dict[str, object]
) -> None:
    """Behind a virtual drive on a bus: every step, the report and its record; the wind is no brake that drags."""
    monkeypatch.setenv("GANTRYCTL_STATE", str(tmp_path / "state"))
    monkeypatch.chdir(tmp_path)
    file = drafted(kind, tmp_path, drive__kind="canopen", control__scan_period_ms=4.0, **changes)
    oracle.bounds = bounds_of(load_machine(file))
    answer = cli("commission", "--with-sim", "--config", file, "--out", "commissioning")
    assert answer.code in (0, 1), answer.err
    assert "BRK-02" not in answer.out
    assert foreign(answer.out + answer.err) == []
    assert list(foreign_in(tmp_path)) == []
