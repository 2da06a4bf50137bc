"""Workers, scheduler and client of a campaign may die at any moment: no row is lost and none counts twice."""

from __future__ import annotations

import random
import time
from pathlib import Path

import pytest

from gantryctl.engineering.campaign.reading import load_campaign
from gantryctl.engineering.campaign.run import run_campaign
from gantryctl.engineering.scheduler.pools import ThreadPool
from support.campaign_results import sorted_bytes
from support.dask_processes import run_among_kills

# Short moves: some 5 ms of computing a row, so that some chunks of a second come before and after every kill.
CAMPAIGN = """
[campaign]
name = "short_moves"
tests = ["move"]
outputs = ["move_load_error_deg_s", "move_reducer_knm"]
sampling = "sobol"
count = {rows}
seed = 3

[move]
from_deg = 0.0
to_deg = 0.5

[vary.gear]
law = "phases"

[vary.inertia]
law = "normal"
keys = ["plant.load.inertia_kg_m2"]
relative = true
mean = 1.0
deviation = 0.1

# One of many is beyond what the machine file allows: refused rows are rows too.
[vary.friction]
law = "lognormal"
keys = ["plant.motor_friction.load_ratio"]
relative = true
median = 1.0
spread = 2.5
"""


def campaign_file(folder: Path, rows: int) -> Path:
    path = folder / "short_moves.toml"
    path.write_text(CAMPAIGN.format(rows=rows), encoding="utf-8")
    return path


def undisturbed(campaign: Path, folder: Path) -> bytes:
    """The same campaign on threads, with nobody killed."""
    end = run_campaign(
        load_campaign(campaign),
        folder / "undisturbed.result",
        lambda job: ThreadPool(job, 2),
        say=lambda line: None,
        now_s=time.monotonic,
    )
    assert end.complete
    return sorted_bytes(folder / "undisturbed.result")


@pytest.mark.slow  # test_campaign_processes kills the client in the fast set
def test_three_kills_change_no_byte(tmp_path: Path) -> None:
    campaign = campaign_file(tmp_path, 2048)
    run_among_kills(
        campaign, tmp_path, ("worker", "client", "scheduler"), 200.0, random.Random(time.time_ns())
    )
    assert sorted_bytes(tmp_path / "killed.result") == undisturbed(campaign, tmp_path)


@pytest.mark.slow
def test_twenty_kills_change_no_byte(tmp_path: Path) -> None:
    campaign = campaign_file(tmp_path, 16384)
    rng = random.Random(time.time_ns())
    kills = [rng.choice(("worker", "scheduler", "client")) for _ in range(20)]
    run_among_kills(campaign, tmp_path, kills, 1500.0, rng)
    assert sorted_bytes(tmp_path / "killed.result") == undisturbed(campaign, tmp_path)
