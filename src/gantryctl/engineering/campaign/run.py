"""One run of a campaign: what is missing in its result is computed and kept."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Sequence
from contextlib import closing
from pathlib import Path
from typing import Final, NamedTuple

from gantryctl.engineering.campaign.job import CampaignJob
from gantryctl.engineering.campaign.population import Campaign
from gantryctl.engineering.campaign.result import ResultFolder
from gantryctl.engineering.report.meter import Meter
from gantryctl.engineering.scheduler.job import Chunk, Job, Rows
from gantryctl.engineering.scheduler.pools import Pool
from gantryctl.engineering.scheduler.schedule import run_job
from gantryctl.files import remove_drafts
from gantryctl.machine.variation import RefusedValue, Variation
from gantryctl.runtime import StateLock

# Plants that are tried against the checks of the machine before a run: a tenth of a second.
SURVEY: Final = 1000
# New files of a long run that are merged at once: a listing of its folder stays short.
MERGED_FILES: Final = 512


class RunEnd(NamedTuple):
    """End of a run.

    Attributes:
        rows: of the campaign. there: rows in the result now. computed: by this run.
    """

    rows: int
    there: int
    computed: int

    @property
    def complete(self) -> bool:
        """Every row is there."""
        return self.there == self.rows


def survey(campaign: Campaign) -> tuple[int, Counter[str]]:
    """How many of the first plants were tried, and how many of them the checks of the machine refuse, by name."""
    count = min(SURVEY, campaign.design.rows)
    variation = Variation(campaign.controls[0].machine, campaign.varied_keys)
    answers = (variation.of(plant.values) for plant in campaign.plants(0, count))
    return count, Counter(str(answer) for answer in answers if isinstance(answer, RefusedValue))


def run_campaign(
    campaign: Campaign,
    folder: Path,
    pool_of: Callable[[Job], Pool],
    *,
    say: Callable[[str], None],
    now_s: Callable[[], float],
    stopped: Callable[[], bool] = lambda: False,
) -> RunEnd:
    """Compute what is missing in a result.

    Args:
        pool_of: workers for a job.
        say: a line for the person who watches. now_s: the clock of that person.
        stopped: asked between chunks; what is under way then is still kept.

    Raises:
        UsageError: the result is of another campaign or of other code. StateError: its folder cannot be used.
        DeviceError: no worker is left.
    """
    result = ResultFolder(folder)
    with StateLock(folder, lambda: "another `campaign run` writes this result"):
        remove_drafts(folder)
        head = result.begin(campaign)
        missing = result.missing(head)
        rows, left = head.design.rows, sum(chunk.size for chunk in missing)
        if left < rows:
            say(f"{rows - left} of {rows} rows are there")
        computed = 0
        if left:
            meter = Meter(say, left, now_s)
            job = CampaignJob(campaign)
            with closing(pool_of(job)) as pool:
                computed = keep_missing(
                    missing,
                    pool,
                    job.pack,
                    lambda chunk, found: result.write(head, chunk, found),
                    lambda: result.merge(head),
                    meter,
                    stopped,
                )
        result.merge(head)
        return RunEnd(rows, rows - left + computed, computed)


def keep_missing(
    missing: Sequence[Chunk],
    pool: Pool,
    pack: int,
    keep: Callable[[Chunk, Rows], None],
    merge: Callable[[], None],
    meter: Meter,
    stopped: Callable[[], bool],
) -> int:
    """Have ranges of rows computed and kept, chunk by chunk; how many were computed.

    Args:
        keep: writes the rows of a chunk, whole. merge: makes few files of many, called after many chunks.
        stopped: asked between chunks; what is under way then is still kept.
    """
    computed = 0
    for files, (chunk, found) in enumerate(run_job(missing, pool, pack, stopped), start=1):
        keep(chunk, found)
        computed += chunk.size
        if files % MERGED_FILES == 0:
            merge()
        meter.advance(chunk.size)
    return computed
