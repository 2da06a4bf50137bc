"""Workers of long commands, and how a person ends such a command in order."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING

from gantryctl.cli.options import stop_signals
from gantryctl.terminal import tell

if TYPE_CHECKING:
    from gantryctl.engineering.scheduler.job import Job
    from gantryctl.engineering.scheduler.pools import Pool


@contextmanager
def ended_in_order() -> Iterator[Callable[[], bool]]:
    """Whether a person wants the end; a second Ctrl-C ends at once."""
    interrupts = 0

    def interrupted() -> None:
        nonlocal interrupts
        interrupts += 1
        if interrupts > 1:
            # Every file is whole at every moment: nothing is left to be tidied up.
            os._exit(130)
        tell("ending; the chunks under way are finished first, a second Ctrl-C ends at once")

    with stop_signals(interrupted):
        yield lambda: interrupts > 0


def pool_of(threads: int | None, workers: int | None, cluster: str | None) -> Callable[[Job], Pool]:
    """Workers that were asked for; threads where nothing was.

    Raises:
        UsageError: more than one kind.
    """
    from gantryctl.engineering.scheduler.cluster import ClusterPool
    from gantryctl.engineering.scheduler.pools import ProcessPool, ThreadPool
    from gantryctl.errors import UsageError

    if sum(each is not None for each in (threads, workers, cluster)) > 1:
        raise UsageError("--threads, --workers and --cluster: give one of them")
    if cluster is not None:
        return lambda job: ClusterPool(job, cluster, tell)
    if workers is not None:
        return lambda job: ProcessPool(job, workers)
    return lambda job: ThreadPool(job, threads)
