"""Three axes that are no gantry: each from `gantryctl new` to a report for a customer in six commands.

Nothing that these runs print or write speaks of the reference machine, of its paper, of its gear or its gains.
"""

import re
import time
from pathlib import Path

import pytest

from support.command_line import cli
from support.foreign_words import foreign, foreign_in, foreign_in_html
from support.reports import CAMPAIGN

# The last two take some ten seconds of processor each.
AXES = [
    pytest.param("tilt_table", "20", id="tilt"),
    pytest.param("telescope_azimuth", "20", id="telescope", marks=pytest.mark.slow),
    pytest.param("rotary_table", "20", id="table", marks=pytest.mark.slow),
]
MOST_SECONDS = 300.0
"""Of a processor: what a person waits on a quiet computer."""


def commands(template: str, target: str) -> list[list[str]]:
    return [
        ["new", "axis1", "--template", template, "--set", "source=order 4711"],
        ["size", "axis1_sheet.toml", "--out", "size"],
        ["config", "check", "axis1.toml"],
        ["move", target, "--config", "axis1.toml"],
        ["stops", "--config", "axis1.toml", "--out", "stops"],
        ["accuracy", "run", "--config", "axis1.toml", "--out", "report"],
    ]


@pytest.mark.parametrize(("template", "target"), AXES)
def test_from_new_to_a_report_in_six_commands(
    template: str, target: str, tmp_path: Path, monkeypatch
) -> None:
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("GANTRYCTL_STATE", str(tmp_path / "state"))
    began = time.process_time()
    said = ""
    lines = commands(template, target)
    assert len(lines) <= 6
    for line in lines:
        answer = cli(*line)
        assert answer.code == 0, (line, answer.out[-2000:], answer.err)
        said += answer.out + answer.err
    assert time.process_time() - began < MOST_SECONDS
    report = (tmp_path / "report" / "report.html").read_text(encoding="utf-8")
    assert "order 4711" in report
    assert re.search(r"\n95 % of 32 gears of grade \d keep A = 0\.0\d+ deg; 0\.0\d deg is required\n", said)
    assert re.search(r"\bPASS\b", said)
    assert foreign(said) == []
    assert list(foreign_in(tmp_path)) == []


FURTHER = [
    ["config", "show", "axis1.toml"],
    ["config", "show", "axis1.toml", "--json"],
    ["size", "axis1_sheet.toml", "--json"],
    ["size", "axis1_sheet.toml", "--limits"],
    ["move", "10", "--config", "axis1.toml", "--json"],
    ["jog", "+", "--for", "0.3", "--config", "axis1.toml"],
    ["status", "--config", "axis1.toml"],
    ["encoder", "show", "--config", "axis1.toml"],
    ["retain", "show", "--config", "axis1.toml"],
    ["speed-test", "--config", "axis1.toml", "--out", "speed"],
    ["accuracy", "run", "--config", "axis1.toml", "--json", "--out", "again"],
    ["analyse", "--config", "axis1.toml", "--out", "analysis"],
    ["brake-test", "--config", "axis1.toml"],
    ["stops", "--find-quick", "--config", "axis1.toml"],
    ["tune", "--config", "axis1.toml", "--out", "tuning"],
    ["tune", "--config", "axis1.toml", "--method", "margins", "--out", "margins"],
    ["faults", "run", "--fault", "A2", "--config", "axis1.toml", "--out", "fault.png"],
    ["trace", "show"],
    ["trace", "plot", "--out", "trace.html"],
    ["identify", "--config", "axis1.toml"],
    ["campaign", "run", "campaign.toml", "--out", "campaign"],
    ["campaign", "show", "campaign"],
    ["campaign", "plot", "campaign", "--out", "campaign_page"],
    ["alarms", "--config", "axis1.toml"],
    ["reset", "--config", "axis1.toml"],
]
"""Other commands of an engineer; a verdict may be FAIL (1), but nothing is refused."""


@pytest.mark.slow
@pytest.mark.parametrize("template", ["tilt_table", "telescope_azimuth", "rotary_table"])
def test_no_other_command_speaks_of_the_reference_machine(template: str, tmp_path: Path, monkeypatch) -> None:
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("GANTRYCTL_STATE", str(tmp_path / "state"))
    assert cli("new", "axis1", "--template", template, "--gears", "0").code == 0
    (tmp_path / "campaign.toml").write_text(
        CAMPAIGN.replace("[campaign]\n", '[campaign]\nmachine = "axis1.toml"\n'), encoding="utf-8"
    )
    refused, hits = [], []
    for line in FURTHER:
        answer = cli(*line)
        if answer.code > 1:
            refused.append((line, answer.err))
        hits += [(line, hit) for hit in foreign(answer.out + answer.err)]
    assert refused == []
    assert hits == []
    assert list(foreign_in(tmp_path)) == []


def test_the_search_finds_what_it_must_find(tmp_path: Path) -> None:
    """A liar: each word and number planted once, in text, in a page, in a picture, in a file's name."""
    for text in ("The paper says", "of the gantry", "hust_gantry", "338 teeth", "1144.0", "kvp = 77.6959"):
        assert foreign(text), text
    for text in ("gantryctl", "papers", "0.338", "11440", "1.1440", "gantryctl's"):
        assert not foreign(text), text
    assert foreign_in_html("<p>every 338 teeth</p>")
    assert foreign_in_html("<svg><text>the gantry</text></svg>")
    assert not foreign_in_html('<svg><path d="M 338 1144"/></svg><img src="data:image/png;base64,hust338">')
    (tmp_path / "a.png").write_bytes(b"\x89PNG the gantry")
    (tmp_path / "gantry.csv").write_text("a,b\n")
    assert [name for name, _ in foreign_in(tmp_path)] == ["a.png", "gantry.csv"]
