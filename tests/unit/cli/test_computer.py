"""`doctor` and `bench`: what they refuse, what they keep. No figure is judged: this computer is as fast as it is."""

import json
from pathlib import Path
from types import SimpleNamespace

import pytest

from gantryctl.engineering.bench.figures import Figure
from gantryctl.engineering.bench.groups import GROUPS
from gantryctl.engineering.computer import scan_trial
from support.command_line import cli


@pytest.mark.parametrize(
    ("words", "named"),
    [
        (("bench", "speed"), "'speed'"),
        (("bench", "scan", "--repeats", "0"), "--repeats"),
        (("bench", "scan", "--scale", "0"), "--scale"),
        (("bench", "scan", "--scale", "nan"), "--scale"),
        (("bench", "scan", "--out", "."), "only the peers"),
        (("doctor", "--seconds", "0"), "0.1 to 86400 s"),
        (("doctor", "--seconds", "inf"), "--seconds"),
        (("doctor", "--period", "100"), "0.5 to 40 ms"),
        (("doctor", "--period", "0.7"), "0.7"),
        (("doctor", "--config", "nowhere.toml"), "nowhere.toml"),
    ],
)
def test_what_makes_no_sense_is_refused_by_name(words: tuple[str, ...], named: str) -> None:
    answer = cli(*words)
    assert answer.code == 2
    assert named in answer.err
    assert answer.out == ""


def test_a_run_of_the_usual_length_is_kept_and_the_next_one_compared(
    state: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    values = iter([10.0, 5.0])
    monkeypatch.setitem(
        GROUPS,
        "scan",
        lambda repeats, scale, watch: [Figure("scan_us", "one scan", next(values), "us", most=8.0)],
    )
    first = cli("bench", "scan")
    assert first.code == 1  # 10 us against a limit of 8
    assert "MISSED" in first.out
    second = cli("bench", "scan")
    assert second.code == 0
    row = next(line for line in second.out.splitlines() if "one scan" in line)
    assert row.split()[-1] == "0.50"
    kept = json.loads((state / "bench.json").read_text())
    assert [run["figures"] for run in kept["scan"]] == [{"scan_us": 10.0}, {"scan_us": 5.0}]


def test_a_shorter_run_is_not_kept(state: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(
        GROUPS, "scan", lambda repeats, scale, watch: [Figure("scan_us", "one scan", 1.0, "us")]
    )
    assert "not kept" in cli("bench", "scan", "--scale", "0.5").out
    assert not (state / "bench.json").exists()


def test_a_file_of_results_that_cannot_be_read_ends_the_run_before_it_begins(state: Path) -> None:
    state.mkdir()
    (state / "bench.json").write_text("{")
    answer = cli("bench", "batch")
    assert answer.code == 3
    assert "bench.json" in answer.err


@pytest.mark.parametrize(("periods", "good"), [((4.0,), True), ((1.0,), False), ((1.0, 4.0), False)])
def test_a_computer_is_good_when_it_keeps_every_period_that_was_asked_for(
    monkeypatch: pytest.MonkeyPatch, periods: tuple[float, ...], good: bool
) -> None:
    """One that keeps 4 ms and not 1 ms."""

    def tried(period_ms: float, seconds: float, *, watch: object) -> SimpleNamespace:
        return SimpleNamespace(good=period_ms == 4.0, to_dict=lambda speed_deg_s: {"period_ms": period_ms})

    monkeypatch.setattr(scan_trial, "scan_trial", tried)
    words = [word for period in periods for word in ("--period", f"{period:g}")]
    answer = cli("doctor", *words, "--json")
    assert (answer.code, answer.json["good"]) == (int(not good), good)
    assert [scan["period_ms"] for scan in answer.json["scans"]] == list(periods)
