"""A result holds each row once, of one campaign and one code, and a run goes on where it ended."""

from __future__ import annotations

import itertools
import json
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from gantryctl.engineering.campaign import result as result_module
from gantryctl.engineering.campaign.job import CampaignJob
from gantryctl.engineering.campaign.population import Campaign
from gantryctl.engineering.campaign.result import ResultFolder
from gantryctl.engineering.campaign.row_files import METADATA_KEY
from gantryctl.engineering.campaign.run import RunEnd, run_campaign
from gantryctl.engineering.campaign.statistics import population_of
from gantryctl.engineering.scheduler.identity import identity
from gantryctl.engineering.scheduler.job import Chunk
from gantryctl.engineering.scheduler.pools import ThreadPool
from gantryctl.errors import StateError, UsageError
from gantryctl.runtime import StateLock
from support.campaign_results import rows_of

from .conftest import INERTIA, ORDER

Made = Callable[..., Campaign]
FIGURE = "move_load_error_deg_s"


@pytest.fixture(autouse=True)
def _small_chunks(monkeypatch: pytest.MonkeyPatch) -> None:
    """Eight rows in several files."""
    monkeypatch.setattr(CampaignJob, "pack", 1)


def run(campaign: Campaign, folder: Path, most: int | None = None) -> RunEnd:
    """Run; after `most` asks nothing new is begun."""
    asked = 0

    def stopped() -> bool:
        nonlocal asked
        asked += 1
        return most is not None and asked > most

    return run_campaign(
        campaign,
        folder,
        lambda job: ThreadPool(job, 1),
        say=lambda line: None,
        now_s=lambda: 0.0,
        stopped=stopped,
    )


def test_a_run_that_was_ended_goes_on_and_gives_the_same_rows(made: Made, tmp_path: Path) -> None:
    campaign, folder = made(), tmp_path / "r"
    first = run(campaign, folder, most=2)
    assert 0 < first.there < 8
    assert not first.complete
    second = run(campaign, folder)
    assert second == RunEnd(8, 8, 8 - first.there)
    assert np.array_equal(rows_of(folder, [FIGURE])[FIGURE], CampaignJob(campaign).rows(0, 8)[FIGURE])
    assert run(campaign, folder) == RunEnd(8, 8, 0)


def test_what_is_missing_is_what_no_file_holds(made: Made, tmp_path: Path) -> None:
    campaign, result = made(), ResultFolder(tmp_path)
    head = result.begin(campaign)
    for chunk in (Chunk(2, 2), Chunk(5, 1)):
        result.write(head, chunk, CampaignJob(campaign).rows(*chunk))
    assert result.missing(head) == [Chunk(0, 2), Chunk(4, 1), Chunk(6, 2)]
    assert rows_of(tmp_path, ["row"])["row"].tolist() == [2, 3, 5]


def test_a_longer_campaign_goes_on_with_the_rows_that_are_there(made: Made, tmp_path: Path) -> None:
    run(made(), tmp_path)
    assert run(made(order=ORDER.replace("count = 8", "count = 12")), tmp_path) == RunEnd(12, 12, 4)
    # A shorter one finds its rows.
    end = run(made(order=ORDER.replace("count = 8", "count = 6")), tmp_path)
    assert end.complete
    assert population_of(ResultFolder(tmp_path)).figures[0].plants == 6


def test_every_file_says_what_its_rows_are(made: Made, tmp_path: Path) -> None:
    import pyarrow.parquet as pq

    campaign = made()
    run(campaign, tmp_path)
    for file in tmp_path.glob("rows-*.parquet"):
        said = json.loads(pq.read_metadata(file).metadata[METADATA_KEY])
        assert said["campaign_hash"] == campaign.hash
        assert said["made_by"]["version"] == identity().version
        assert len(said["machine_hash"]) == 64


def test_another_campaign_and_other_code_are_refused(
    made: Made, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    run(made(), tmp_path)
    with pytest.raises(UsageError, match=r"holds rows of another campaign .* choose another --out"):
        run(made(INERTIA.replace("1.2", "1.3")), tmp_path)
    other = identity()._replace(core="0123456789ab")
    monkeypatch.setattr(result_module, "identity", lambda: other)
    with pytest.raises(UsageError, match=f"core {identity().core}, here 0123456789ab"):
        run(made(), tmp_path)


def test_damage_is_named(made: Made, tmp_path: Path) -> None:
    campaign, result = made(), ResultFolder(tmp_path)
    head = result.begin(campaign)
    for chunk in (Chunk(0, 2), Chunk(4, 2)):
        result.write(head, chunk, CampaignJob(campaign).rows(*chunk))
    file = sorted(tmp_path.glob("rows-*.parquet"))[0]
    whole = file.read_bytes()
    file.write_bytes(whole[: len(whole) // 2])
    with pytest.raises(StateError, match=f"{file.name}: cannot be read"):
        run(campaign, tmp_path)
    file.write_bytes(whole)
    twice = file.with_name("rows-0000000001-0000000004.parquet")
    twice.write_bytes(whole)
    with pytest.raises(StateError, match=r"some of its rows are in .* too"):
        run(campaign, tmp_path)
    twice.unlink()
    file.rename(file.with_name("rows-0000000100-0000000101.parquet"))
    with pytest.raises(StateError, match=r"0000000101\.parquet: holds other rows than its name"):
        run(campaign, tmp_path)
    (tmp_path / "rows-0000000100-0000000101.parquet").unlink()
    assert run(campaign, tmp_path).complete
    (tmp_path / "result.json").write_text("{}")
    with pytest.raises(StateError, match=r"result\.json: cannot be read"):
        ResultFolder(tmp_path).head()


def test_rows_of_another_campaign_under_a_right_name_are_refused(made: Made, tmp_path: Path) -> None:
    run(made(), tmp_path / "a")
    run(made(INERTIA.replace("1.2", "1.3")), tmp_path / "b")
    for file in (tmp_path / "a").glob("rows-*.parquet"):
        file.unlink()
    stranger = next((tmp_path / "b").glob("rows-*.parquet"))
    stranger.rename(tmp_path / "a" / stranger.name)
    with pytest.raises(StateError, match="holds other rows"):
        run(made(), tmp_path / "a")


def test_two_runs_do_not_write_one_result(made: Made, tmp_path: Path) -> None:
    with StateLock(tmp_path), pytest.raises(StateError, match="another `campaign run` writes this result"):
        run(made(), tmp_path)


def test_there_is_no_result_in_an_empty_folder(tmp_path: Path) -> None:
    with pytest.raises(UsageError, match="holds no result of a campaign"):
        population_of(ResultFolder(tmp_path))


@pytest.mark.parametrize("held", [0, 10**6])
def test_batches_depend_on_the_rows_and_not_on_their_files(
    made: Made, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, held: int
) -> None:
    """Sums of floats depend on their order: the same rows must give the same figures before and after a merge."""
    monkeypatch.setattr(result_module, "_BATCH", 4)
    monkeypatch.setattr(result_module, "_HELD", held)
    campaign = made(order=ORDER.replace("count = 8", "count = 13"))
    rows = CampaignJob(campaign).rows(0, 16)
    found = []
    for k, cuts in enumerate(([0, 12], [0, 1, 3, 6, 7, 12])):
        result = ResultFolder(tmp_path / str(k))
        head = result.begin(campaign)
        for low, high in itertools.pairwise(cuts):
            chunk = {name: column[low:high] for name, column in rows.items()}
            result.write(head, Chunk(low, high - low), chunk)
        batches = list(result.rows().batches([FIGURE]))
        assert [first for first, _ in batches] == [0, 4, 8]
        found.append([part[FIGURE].tobytes() for _, part in batches])
    assert found[0] == found[1]
    # The campaign ends within a chunk.
    result.write(head, Chunk(12, 4), {name: column[12:] for name, column in rows.items()})
    assert result.rows().there == 13
    assert [len(part[FIGURE]) for _, part in result.rows().batches([FIGURE])] == [4, 4, 4, 1]
