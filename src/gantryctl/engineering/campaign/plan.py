"""What a large campaign takes: time, bytes and cost, from a few rows that are computed and written here."""

from __future__ import annotations

import math
import tempfile
import time
from pathlib import Path
from typing import Final, NamedTuple

from gantryctl.engineering.campaign.job import CampaignJob
from gantryctl.engineering.campaign.population import Campaign
from gantryctl.engineering.campaign.result import ResultFolder
from gantryctl.engineering.campaign.row_files import FULL_ROWS
from gantryctl.engineering.scheduler.job import Chunk, compute
from gantryctl.engineering.scheduler.schedule import CHUNK_MAX_S, CHUNK_MIN_S

# Of a task on a cluster, as `dask.distributed` itself measures it; the network comes on top.
TASK_S: Final = 1.6e-3
_FIRST_ROWS: Final = 16


class Plan(NamedTuple):
    """A campaign of many plants.

    Attributes:
        row_s: time of one core for one plant, measured here. rows_measured: by how many plants.
        time_s: on all cores. core_hours: of all together.
        bytes, files: of the result. chunks: tasks that compute it. overhead: part of the time that tasks cost.
        cost: by the price of a core for an hour.
    """

    plants: int
    cores: int
    rows_measured: int
    row_s: float
    time_s: float
    core_hours: float
    bytes: int
    files: int
    chunks: int
    overhead: float
    cost: float


def plan_campaign(
    campaign: Campaign, plants: int, cores: int, price_per_core_hour: float, measure_s: float
) -> Plan:
    """Compute rows for about `measure_s` on one core, and reckon.

    Args:
        price_per_core_hour: in any currency.
    """
    job, size = CampaignJob(campaign), _FIRST_ROWS
    # Caches and imports first.
    compute(job, Chunk(0, 1))
    with tempfile.TemporaryDirectory() as place:
        folder = ResultFolder(Path(place))
        head = folder.begin(campaign)
        while True:
            rows = min(size, campaign.design.rows)
            begun_s = time.process_time()
            result = compute(job, Chunk(0, rows))
            # Time of the processor: other work of this computer does not count.
            spent_s = time.process_time() - begun_s
            if spent_s >= 0.5 * measure_s or rows == campaign.design.rows:
                break
            size = max(2 * size, math.ceil(size * measure_s / max(spent_s, 1e-3)))
        # What more rows add: a file of a million has one head, as that of a few.
        half = rows // 2
        folder.write(head, Chunk(0, half), {name: column[:half] for name, column in result.rows.items()})
        of_half = folder.bytes_on_disk()
        folder.write(head, Chunk(0, rows), result.rows)
        row_bytes = (folder.bytes_on_disk() - 2 * of_half) / (rows - half)
    row_s = spent_s / rows
    total_s = row_s * plants
    chunk_s = min(max(total_s / cores / 100.0, CHUNK_MIN_S), CHUNK_MAX_S)
    return Plan(
        plants=plants,
        cores=cores,
        rows_measured=rows,
        row_s=row_s,
        time_s=total_s / cores,
        core_hours=total_s / 3600.0,
        bytes=round(row_bytes * plants),
        files=math.ceil(plants / FULL_ROWS),
        chunks=math.ceil(total_s / chunk_s),
        overhead=TASK_S / chunk_s,
        cost=price_per_core_hour * total_s / 3600.0,
    )
