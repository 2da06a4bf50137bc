"""The frame that every report stands in."""

from __future__ import annotations

import json
import math
from pathlib import Path

from gantryctl.engineering.report.head import Head, Judged, Made, Required, Verdict
from gantryctl.engineering.report.machine_facts import Serials, known_serials, machine_facts
from gantryctl.engineering.report.origin import Origin
from gantryctl.engineering.report.page import VIEWER, Section, css_text, render_sections
from gantryctl.engineering.report.pages.brake_test import render_brake_test
from gantryctl.engineering.report.pages.trace import _columns
from gantryctl.engineering.report.pictures import Panel, Picture, line
from gantryctl.engineering.report.recording import recorded
from gantryctl.machine import configs_folder, default_machine, load_machine, with_values
from gantryctl.operation.client import BrakeDue, BrakeTestReport
from gantryctl.program import BrakeTestOutcome
from gantryctl.trace.table import Trace
from support.command_line import cli, done
from support.reports import HEAD

EVIL = '</script></style><b>"evil"</b>'


def page(head: Head = HEAD, **changes: str) -> str:
    panel = Panel("time, s", "speed, deg/s", (line(EVIL, [0.0, 1.0], [0.0, 2.0]),), (1.5,))
    return render_sections(
        head,
        Verdict("FAIL", Judged.FAIL, "0.0127 deg: outside 0.01 deg"),
        [Required("angle", "at most 0.01 deg", "0.0127 deg", Judged.FAIL)],
        **{"title": "Report", "subtitle": "of a test", **changes},
        sections=[Section("Part", ["A sentence"], figures=[recorded(Picture("one", (panel,)), "one")])],
    )


def test_identity_requirement_people_and_room_for_signatures() -> None:
    text = page()
    for part in (
        "contract 4711", "at most 0.01°", "0.0127°", ">FAIL<", "A. Operator", "W. Witness", "tracker AT-1", "DKD 7",
        "2026-11-22 10:00 UTC", "gantryctl 0.1", "gantryctl accuracy run", "Accepted by", "Signature",
    ):  # fmt: skip
        assert part in text, part
    bare = page(Head("m", (), Made("d", "1", "c")))
    assert "Source of the required values: not named" in bare
    assert "Measured by" not in bare


def test_no_text_ends_an_element() -> None:
    made = Made(*[EVIL] * 5)
    text = page(Head(EVIL, ((EVIL, EVIL),), made, required_source=EVIL), title=EVIL, subtitle=EVIL)
    assert "<b>" not in text
    assert text.count("</script>") == 2
    assert text.count("</style>") == 1 + text.count("<style type")
    data = text.partition('class="recording">')[2].partition("</script>")[0]
    assert json.loads(data)["panels"][0]["lines"][0]["name"] == EVIL


def test_a_text_in_a_style_sheet() -> None:
    assert css_text('a"b\\c') == '"a\\22 b\\5c c"'


def test_the_viewer_is_built_with_the_licence_of_its_library_and_fetches_nothing() -> None:
    script, style = ((VIEWER / f"viewer.{kind}").read_text("utf-8") for kind in ("js", "css"))
    assert script.startswith("/* Contains uPlot ")
    assert "Permission is hereby granted, free of charge" in script
    for text in (script, style):
        assert "://" not in text
        assert "</" not in text.replace("</div>", "")
    assert not any(word in script for word in ("fetch(", "XMLHttpRequest", "WebSocket", "import("))


def test_facts_of_a_machine(tmp_path: Path) -> None:
    machine = default_machine()
    facts = dict(machine_facts(machine, Serials("vendor 1, serial 7", "E-1")))
    assert facts["Inertia of the load"] == "2.18e+06 kg m²"
    assert facts["Motor"].startswith("31 kW, 257 N m at 1150 r/min")
    assert facts["Drive"] == "simulated, vendor 1, serial 7"
    assert facts["Motor encoder"] == "serial number E-1"
    assert len(facts["Machine file, SHA-256"]) == 64
    assert facts["Calibration"] == "none"
    assert "Motor encoder" not in dict(machine_facts(machine, known_serials(machine, tmp_path / "none")))
    (tmp_path / f"{machine.name}.commissioned.toml").write_text("damaged", "utf-8")
    assert known_serials(machine, tmp_path) == Serials()


def test_a_command_names_itself_and_the_encoder_that_it_has_met(tmp_path: Path) -> None:
    done("move", "1")
    done("speed-test", "--speed", "3", "--out", tmp_path, "--witness", "W. W", "--date", "today")
    text = (tmp_path / "report.html").read_text("utf-8")
    assert f"gantryctl speed-test --speed 3 --out {tmp_path} --witness" in text
    assert "serial number SIM-0001" in text
    assert "today" in text


def test_every_report_stands_in_the_frame(tmp_path: Path) -> None:
    """Verdict, required values with their source, and room for signatures, whatever was done."""
    short = ("--fresh", "--witness", "W. W")
    for command in (
        ("stops", "--speed", "0.6", "--witness", "W. W"),
        ("size", "--witness", "W. W"),
        ("brake-test", *short),
    ):
        out = tmp_path / command[0]
        cli(*command, "--out", out)
        text = (out / "report.html").read_text("utf-8")
        for part in (
            "Required and found. Source of the required values: Sun",
            "W. W",
            "Accepted by",
            ">pass<",
        ):
            assert part in text, (command, part)
        assert f"gantryctl {command[0]}" in text


def test_a_brake_test_that_did_not_end_is_no_pass() -> None:
    due = BrakeDue("", 0, overdue=True)
    nan = float("nan")
    found = BrakeTestReport(BrakeTestOutcome.NONE, "", 70.0, 69.5, nan, nan, 0.02, due)
    text = render_brake_test(found, "DRV_01: drive fault", Origin.SIMULATED, HEAD)
    assert "NOT TESTED" in text
    assert "DRV_01: drive fault" in text
    assert text.count(">FAIL<") == 2  # the torque that was not held, and a movement that nobody knows


def test_a_movement_within_its_limit_proves_nothing_of_a_brake_test_that_did_not_end() -> None:
    found = BrakeTestReport(
        BrakeTestOutcome.NONE, "", 70.0, 69.5, -70.0, 0.001, 0.02, BrakeDue("", 0, overdue=True)
    )
    judged = [
        render_brake_test(report, ended_by, Origin.SIMULATED, HEAD).partition("Movement against")[2][:400]
        for report, ended_by in ((found, "refused"), (found._replace(moved_deg=0.03), "refused"), (found, ""))
    ]
    assert [(">pass<" in text.lower(), ">fail<" in text.lower()) for text in judged] == [
        (False, False), (False, True), (True, False),
    ]  # fmt: skip


def test_a_report_of_a_bus_that_is_simulated_says_so() -> None:
    on_bus = with_values(load_machine(configs_folder() / "hust_can.toml"), {"can.interface": "simulated"})
    assert dict(machine_facts(on_bus, Serials()))["Drive"] == "CANopen, simulated"


def test_the_columns_of_a_recording_are_told_in_the_degrees_that_they_are_named_in() -> None:
    """Half a turn is 180 deg, not 3.14."""
    table = _columns(Trace({"time_s": [0.0, 1.0], "pos_act_rad": [0.0, math.pi]}))
    assert table.rows[1][:3] == ("pos_act_deg", "0", "180")
    assert table.rows[1][4] == "deg"
