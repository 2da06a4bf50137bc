"""A fault campaign in its folder: complete, resumable, the same whoever plays it."""

from __future__ import annotations

import json
from datetime import UTC, datetime
from pathlib import Path

import pytest

from gantryctl.engineering.campaign.job import REFUSED
from gantryctl.engineering.fault_campaign import job, kinds
from gantryctl.engineering.fault_campaign.draw import random_scenario
from gantryctl.engineering.fault_campaign.kinds import FaultCampaign, campaign_of
from gantryctl.engineering.fault_campaign.matrix import CELLS, Cell, cell
from gantryctl.engineering.fault_campaign.play import Played, play
from gantryctl.engineering.fault_campaign.result import LOG_FILE, FaultResult
from gantryctl.engineering.fault_campaign.run import CampaignEnd, run_fault_campaign
from gantryctl.engineering.fault_campaign.scenario import Scenario
from gantryctl.engineering.faults.oracle.axis_oracle import Violation
from gantryctl.engineering.scheduler.job import Chunk, Job
from gantryctl.engineering.scheduler.pools import Pool, ThreadPool
from gantryctl.errors import UsageError
from support.command_line import cli

pytestmark = pytest.mark.can
CAMPAIGN = FaultCampaign("random", 1, 10.0)


@pytest.fixture(autouse=True)
def short(monkeypatch: pytest.MonkeyPatch) -> None:
    """Two seconds of each scenario, on the simulated drive."""

    def scenario(self: FaultCampaign, seed: int) -> Scenario:
        drawn = random_scenario(self.series, seed, self.scan_ms)
        return drawn.model_copy(update={"duration_s": 2.0, "drive": "sim", "beside": False, "faults": ()})

    monkeypatch.setattr(FaultCampaign, "scenario", scenario)


def one_thread(job: Job) -> Pool:
    return ThreadPool(job, 1)


def run(folder: Path, seeds: Chunk, *, ends_early: bool = False) -> CampaignEnd:
    """A campaign, or what of it there is when the first file has been written."""
    said: list[str] = []

    def stopped() -> bool:
        return ends_early and any(folder.glob("rows-*.parquet"))

    return run_fault_campaign(
        CAMPAIGN, folder, seeds, one_thread, say=said.append, now_s=lambda: 0.0,
        today=lambda: datetime(2026, 1, 1, tzinfo=UTC), stopped=stopped,
    )  # fmt: skip


def test_a_campaign_goes_on_where_it_was_ended(tmp_path: Path) -> None:
    part = run(tmp_path / "a", Chunk(0, 6), ends_early=True)
    assert 0 < part.there < 6
    whole = run(tmp_path / "a", Chunk(0, 6))
    assert whole.complete
    assert (whole.played, whole.broken) == (6 - part.there, 0)
    assert run(tmp_path / "a", Chunk(0, 6)).played == 0
    at_once = run(tmp_path / "b", Chunk(0, 6))
    assert at_once.played == 6
    there, other = (list(FaultResult.read(tmp_path / name).rows()) for name in "ab")
    assert [row["trace_sha256"] for row in there] == [row["trace_sha256"] for row in other]
    assert len({row["trace_sha256"] for row in there}) == 6
    lines = (tmp_path / "b" / LOG_FILE).read_text().splitlines()
    assert len(lines) == 1
    assert lines[0].startswith("2026-01-01 00:00 seeds 0-5: 6 runs, 0 over the bus, 0 refused")
    # Later seeds lie beside the first ones.
    assert run(tmp_path / "b", Chunk(8, 1)).there == 1
    assert FaultResult.read(tmp_path / "b").there == 7


def test_a_folder_holds_one_campaign(tmp_path: Path) -> None:
    run(tmp_path, Chunk(0, 1))
    other = FaultResult(tmp_path, FaultCampaign("random", 2, 10.0))
    with pytest.raises(UsageError, match="another campaign"):
        other.begin()
    with pytest.raises(UsageError, match="holds no fault campaign"):
        FaultResult.read(tmp_path / "nothing")
    with pytest.raises(UsageError, match="one of random, pairs, wide, axes, axis-pairs, matrix"):
        campaign_of("all")


def test_runs_of_an_earlier_drawing_are_told_as_such(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The rows are sound: neither damaged nor of another campaign; going on and reporting both say why not."""
    with monkeypatch.context() as before:
        before.setitem(kinds._DRAWING, "random", 1)
        run(tmp_path, Chunk(0, 1))
    monkeypatch.setitem(kinds._DRAWING, "random", 2)
    for use in (lambda: FaultResult.read(tmp_path), lambda: run(tmp_path, Chunk(0, 2))):
        with pytest.raises(
            UsageError, match=r"drawing 1 of 'random'; this version has drawing 2.*another --out"
        ):
            use()
    monkeypatch.setitem(kinds._DRAWING, "random", 1)
    assert FaultResult.read(tmp_path).there == 1


def test_cells_that_are_not_wanted_are_left_out_of_the_matrix(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Each of 60 cells is played, or has its reason; the same folder takes no other part."""
    ran: list[tuple[str, float]] = []

    def run_it(at: Cell) -> dict[str, object]:
        ran.append((at.drive, at.scan_ms))
        return {
            "refused": "",
            "violations": [],
            "drive": at.drive,
            "scan_ms": at.scan_ms,
            "faults": at.case.number,
        }

    monkeypatch.setattr(job, "run_cell", run_it)
    campaign = campaign_of("matrix", scan_ms=4.0, drive="sim")
    rows = job.FaultJob(campaign).rows(0, 60)
    cells = [cell(number) for number in range(60)]
    wanted = [(at.drive, at.scan_ms) == ("sim", 4.0) for at in cells]
    assert ran == [("sim", 4.0)] * sum(wanted)
    assert 4 <= sum(wanted) <= 20  # a sixth of them
    assert [why == "" for why in rows[REFUSED]] == wanted
    assert list(rows["faults"]) == [at.case.number for at in cells]
    assert {
        why for at, why in zip(cells, rows[REFUSED], strict=True) if at.drive == "sim" and at.scan_ms != 4.0
    } == {"left out: 4 ms alone is played"}
    FaultResult(tmp_path, campaign).begin()
    assert FaultResult.read(tmp_path).campaign == campaign
    with pytest.raises(
        UsageError, match=r"holds another campaign \(matrix, series 1, scan 4 ms, sim alone; this one"
    ):
        FaultResult(tmp_path, campaign_of("matrix", scan_ms=4.0)).begin()
    campaign.check_seeds(0, CELLS)
    with pytest.raises(UsageError, match=f"cells 0 to {CELLS - 1}; runs 2 to {CELLS + 1} go beyond"):
        campaign.check_seeds(2, CELLS)
    with pytest.raises(UsageError, match="of the matrix must be one of 1, 4, 10 ms, got 2"):
        campaign_of("matrix", scan_ms=2.0)


def test_what_broke_is_kept_with_its_words(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A run with a broken invariant, for the sake of its row."""
    true = play

    def spoilt(scenario: Scenario) -> Played:
        played = true(scenario)
        played.violations = (Violation("INV-7", 1.0, "wrong"),)
        return played

    monkeypatch.setattr(job, "play", spoilt)
    assert run(tmp_path, Chunk(0, 2)).broken == 2
    monkeypatch.setattr(job, "play", true)
    # A call that goes on plays sound ones, and what broke before has not held for that.
    again = run(tmp_path, Chunk(1, 2))
    assert (again.played, again.broken, again.broken_there) == (1, 0, 1)
    assert run(tmp_path, Chunk(2, 1)).broken_there == 0
    told = cli("faults", "campaign", "--scan", "10", "--count", "2", "--out", tmp_path, "--workers", "1")
    assert told.code == 1
    assert "all 2 runs are there, broken 2; played now 0, broken 0" in told.out
    first, *_ = FaultResult.read(tmp_path).rows()
    assert json.loads(first["violations"]) == ["INV-7 at 1.000 s: wrong"]


def test_a_seed_is_replayed_from_the_command_line_and_from_its_file(tmp_path: Path) -> None:
    answer = cli("faults", "replay", "7", "--scan", "10", "--json")
    assert (answer.code, answer.json["ok"], answer.json["axis_s"]) == (0, True, pytest.approx(2.0, abs=0.011))
    file = tmp_path / "seven.toml"
    file.write_text(cli("faults", "replay", "7", "--scan", "10", "--toml").out)
    again = cli("faults", "replay", "--file", file)
    assert answer.json["trace_sha256"] in again.out
    assert "operator: power" in again.out
    assert cli("faults", "replay").code == 2
    other = cli("faults", "replay", "7", "--scan", "10", "--drive", "bus")
    assert other.code == 2
    assert "seed 7 is on drive sim, left out: bus alone is played" in other.err


def test_a_cell_of_the_matrix_is_played_again() -> None:
    answer = cli("faults", "replay", "--kind", "matrix", "0", "--json")
    assert answer.json["cell"].startswith("A1 in ")
    assert answer.code == int(not answer.json["ok"])
    told = cli("faults", "replay", "--kind", "matrix", "0").out
    assert answer.json["cell"] in told
    assert answer.json["refused"] in told
    assert cli("faults", "replay", "--kind", "matrix", "0", "--toml").code == 2
    assert cli("faults", "replay", "--kind", "matrix", "999999999").code == 2
    assert cli("faults", "shrink", "--kind", "matrix", "0").code == 2
