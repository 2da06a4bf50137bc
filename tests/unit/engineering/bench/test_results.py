"""Figures, their limits, the file they are kept in and the page they make."""

from __future__ import annotations

import json
import math
from pathlib import Path

import pytest

from gantryctl.cli.computer import bench as command
from gantryctl.engineering.bench.figures import Figure, medians
from gantryctl.engineering.bench.groups import GROUPS
from gantryctl.engineering.bench.peers.compare import PeerResult
from gantryctl.engineering.bench.peers.table import PEERS
from gantryctl.engineering.bench.peers_page import peers_page, write_peers
from gantryctl.engineering.bench.results import KEPT, load_results
from gantryctl.errors import StateError


@pytest.fixture(autouse=True)
def state(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setenv("GANTRYCTL_STATE", str(tmp_path / "state"))
    return tmp_path / "state"


def test_a_limit_is_met_at_its_edge_and_by_no_nan() -> None:
    assert Figure("a", "", 2.0, least=2.0).met
    assert Figure("a", "", 2.0, most=2.0).met
    assert Figure("a", "", math.nan).met  # without a limit there is nothing to miss
    assert not Figure("a", "", 1.9, least=2.0).met
    assert not Figure("a", "", math.nan, least=2.0).met
    assert not Figure("a", "", math.nan, most=2.0).met


def test_jobs_take_turns_and_medians_count() -> None:
    order: list[str] = []
    values = {"a": iter([1.0, 9.0, 2.0]), "b": iter([5.0, 6.0, 7.0])}

    def job(name: str) -> float:
        order.append(name)
        return next(values[name])

    parts: list[float] = []
    found = medians({"a": lambda: job("a"), "b": lambda: job("b")}, 3, parts.append)
    assert found == {"a": 2.0, "b": 6.0}
    assert "".join(order) == "ababab"
    assert parts == pytest.approx([1 / 6, 2 / 6, 3 / 6, 4 / 6, 5 / 6, 1.0])


def test_the_next_run_finds_the_last_one(state: Path) -> None:
    assert load_results().last("scan") == {}
    for value in range(KEPT + 3):
        load_results().add("scan", [Figure("scan_us", "one scan", float(value), "us")])
    results = load_results()
    assert results.last("scan") == {"scan_us": KEPT + 2.0}
    assert len(results.runs["scan"]) == KEPT
    assert results.last("batch") == {}
    assert (state / "bench.json").is_file()


@pytest.mark.parametrize("text", ["", "[]", '{"scan": [{}]}', '{"scan": [{"figures": {"a": "fast"}}]}'])
def test_a_file_that_is_no_file_of_results_is_named(state: Path, text: str) -> None:
    state.mkdir()
    (state / "bench.json").write_text(text)
    with pytest.raises(StateError, match=r"bench\.json"):
        load_results()


def test_the_command_knows_every_group() -> None:
    assert tuple(GROUPS) == command._GROUPS


def test_the_page_has_a_row_for_every_peer(tmp_path: Path) -> None:
    results = [
        PeerResult(peer, None, None, "not installed: it") if peer.needs else PeerResult(peer, 10.0 + n, 1e-9)
        for n, peer in enumerate(PEERS)
    ]
    page = peers_page(results, 5)
    rows = [line for line in page.splitlines() if line.startswith("| ") and "axis s/s" not in line]
    assert len(rows) == len(PEERS)
    for path in write_peers(tmp_path, results, 5):
        assert path.stat().st_size > 500


def test_the_committed_page_is_one_of_this_program() -> None:
    page = (Path(__file__).parents[4] / "docs" / "reference" / "peers.md").read_text(encoding="utf-8")
    assert all(f"| {peer.name} |" in page and peer.way in page for peer in PEERS)
    assert "not installed" not in page


@pytest.mark.parametrize("group", ["batch", "scan", "jitter"])
def test_a_group_measures_something(group: str) -> None:
    # One thousandth of the usual length: the figures mean nothing, but they are all there.
    parts: list[float] = []
    figures = GROUPS[group](1, 0.01, parts.append)
    assert parts == sorted(parts)
    # A trial in real time ends with the scan that began last.
    assert parts[-1] == pytest.approx(1.0, abs=0.1)
    assert figures
    assert len({figure.key for figure in figures}) == len(figures)
    assert all(math.isfinite(figure.value) and figure.value > 0.0 for figure in figures)
    json.dumps([figure.to_dict() for figure in figures], allow_nan=False)
