"""A fault campaign, slice by slice: what is missing in its folder is played and kept."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import closing
from datetime import datetime
from pathlib import Path
from typing import Final, NamedTuple

from gantryctl.engineering.campaign.job import REFUSED
from gantryctl.engineering.campaign.run import keep_missing
from gantryctl.engineering.fault_campaign.job import FaultJob
from gantryctl.engineering.fault_campaign.kinds import FaultCampaign
from gantryctl.engineering.fault_campaign.result import FaultResult
from gantryctl.engineering.report.meter import Meter
from gantryctl.engineering.scheduler.identity import identity
from gantryctl.engineering.scheduler.job import Chunk, Job, Rows
from gantryctl.engineering.scheduler.pools import Pool
from gantryctl.files import remove_drafts
from gantryctl.runtime import StateLock

SLICE: Final = 500
"""Runs for each line of the log."""


class CampaignEnd(NamedTuple):
    """End of a run of a campaign.

    Attributes:
        asked: runs that were asked for. there: of them, in the result now. played: by this call.
        broken: of these, runs in which something broke. broken_there: of those that are there, whoever played them.
    """

    asked: int
    there: int
    played: int
    broken: int
    broken_there: int

    @property
    def complete(self) -> bool:
        """Every run is there."""
        return self.there == self.asked


def run_fault_campaign(
    campaign: FaultCampaign,
    folder: Path,
    seeds: Chunk,
    pool_of: Callable[[Job], Pool],
    *,
    say: Callable[[str], None],
    now_s: Callable[[], float],
    today: Callable[[], datetime],
    stopped: Callable[[], bool] = lambda: False,
) -> CampaignEnd:
    """Play the runs that a folder does not have yet.

    Args:
        seeds: numbers of the runs that are wanted.
        pool_of: workers for a job.
        say: a line for the person who watches. now_s: the clock of that person; today: the date of a line of the log.
        stopped: asked between chunks; what is under way then is still kept.

    Raises:
        UsageError: the folder is of another campaign, or there are no such runs. StateError: it cannot be used.
            DeviceError: no worker is left.
    """
    campaign.check_seeds(*seeds)
    result, count = FaultResult(folder, campaign), seeds.size
    played = broken = 0
    with StateLock(folder, lambda: "another `faults campaign` writes this folder"):
        remove_drafts(folder)
        result.begin()
        missing = result.missing(*seeds)
        left = sum(chunk.size for chunk in missing)
        if left < count:
            say(f"{count - left} of {count} runs are there")
        if left:
            meter = Meter(say, left, now_s)
            job = FaultJob(campaign)
            with closing(pool_of(job)) as pool:
                for part in _slices(missing, SLICE):
                    if stopped():
                        break
                    tally = _Tally()

                    def keep(chunk: Chunk, rows: Rows, tally: _Tally = tally) -> None:
                        result.write(chunk, rows)
                        tally.count(chunk, rows, say)

                    begun_s = now_s()
                    keep_missing(part, pool, job.pack, keep, result.merge, meter, stopped)
                    played, broken = played + tally.runs, broken + tally.broken
                    if tally.runs:
                        spent_s = now_s() - begun_s
                        result.log(
                            f"{today():%Y-%m-%d %H:%M} {tally.text} {spent_s:.0f} s, sources {identity().sources}"
                        )
        result.merge()
        # A campaign that goes on shows what broke before as well.
        broken_there = result.broken(*seeds)
    return CampaignEnd(count, count - left + played, played, broken, broken_there)


def _slices(missing: list[Chunk], size: int) -> list[list[Chunk]]:
    """Missing ranges cut where a slice of so many numbers ends."""
    found: dict[int, list[Chunk]] = {}
    for chunk in missing:
        first = chunk.first
        while first <= chunk.last:
            number = first // size
            end = min(chunk.last + 1, (number + 1) * size)
            found.setdefault(number, []).append(Chunk(first, end - first))
            first = end
    return [found[number] for number in sorted(found)]


class _Tally:
    """What a slice has brought."""

    def __init__(self) -> None:
        self.runs = self.broken = self.refused = self.over_bus = self.nuisances = 0
        self.axis_s = 0.0
        self._first: int | None = None
        self._last = 0

    def count(self, chunk: Chunk, rows: Rows, say: Callable[[str], None]) -> None:
        self._first = chunk.first if self._first is None else min(self._first, chunk.first)
        self._last = max(self._last, chunk.last)
        self.runs += chunk.size
        ran = rows[REFUSED] == ""
        self.refused += int((~ran).sum())
        self.over_bus += int((ran & (rows["drive"] == "bus")).sum())
        self.nuisances += int(rows["nuisances"].sum())
        self.axis_s += float(rows["axis_s"].sum())
        for number, (faults, what) in enumerate(
            zip(rows["faults"], rows["violations"], strict=True), chunk.first
        ):
            if what:
                self.broken += 1
                say(f"seed {number} ({faults}): {what[:300]}")

    @property
    def text(self) -> str:
        """For the log."""
        return (
            f"seeds {self._first}-{self._last}: {self.runs} runs, {self.over_bus} over the bus, {self.refused} "
            f"refused, {self.axis_s / 3600.0:.2f} h of the axis, {self.broken} broken, {self.nuisances} nuisances,"
        )
