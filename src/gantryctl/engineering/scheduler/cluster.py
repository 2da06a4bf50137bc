"""Workers of a Dask cluster, in whatever way it was deployed."""

from __future__ import annotations

import contextlib
import itertools
import logging
import threading
import time
from collections.abc import Callable
from typing import TYPE_CHECKING, Any, Final, NamedTuple

from gantryctl.engineering.scheduler.identity import Identity, identity
from gantryctl.engineering.scheduler.job import Chunk, ChunkResult, Job, compute
from gantryctl.engineering.scheduler.pools import Outcome
from gantryctl.errors import DeviceError, UsageError
from gantryctl.extras import need

if TYPE_CHECKING:
    from distributed import Client, Future

# A scheduler that was killed is started again by its service or its operator.
RECONNECT_S: Final = 120.0
_CONNECT_S: Final = 5.0
_PAUSE_S: Final = 0.2
# The list of workers is asked for so often.
_LOOK_S: Final = 1.0


class _Refused(NamedTuple):
    """Answer of a worker with another identity, instead of rows."""

    worker: str
    other: Identity


def _compute_there(job: Job, chunk: Chunk, wanted: Identity) -> ChunkResult | _Refused | BaseException:
    # A worker may join in the middle of a run: each chunk asks anew.
    from distributed import get_worker

    if identity() != wanted:
        return _Refused(get_worker().address, identity())
    try:
        return compute(job, chunk)
    except Exception as fault:  # what the job raises is an answer; what Dask raises is a fault of the cluster
        return fault


class ClusterPool:
    """Accepted workers of a cluster: those with the identity of this process.

    Args:
        address: of the scheduler, such as "tcp://10.0.0.1:8786".
        say: a line for the person who watches: workers that are refused, a scheduler that is away.

    Raises:
        ExtraMissing: `cluster` is not installed. DeviceError: nobody answers at the address.
    """

    def __init__(self, job: Job, address: str, say: Callable[[str], None]) -> None:
        need("distributed")
        # Its log tells of every lost connection with a traceback; here that is an ordinary event.
        for name in [name for name in logging.root.manager.loggerDict if name.startswith("distributed")]:
            logging.getLogger(name).setLevel(logging.CRITICAL + 1)
        self._job, self._address, self._say = job, address, say
        self._number = itertools.count()
        self._pending: dict[Future, Chunk] = {}
        self._workers: dict[str, int] = {}
        self._refused: set[str] = set()
        self._lost: list[Chunk] = []
        self._woken = threading.Event()
        self._looked_s = 0.0
        self._client = self._connect(_CONNECT_S)
        self._look()

    @property
    def slots(self) -> int:
        return max(1, sum(self._workers.values()))

    def submit(self, chunk: Chunk) -> None:
        key = f"gantryctl-{next(self._number)}-{chunk.first}-{id(self):x}"
        try:
            future = self._client.submit(
                _compute_there,
                self._job,
                chunk,
                identity(),
                key=key,
                pure=False,
                # Only where somebody was refused: a list of names keeps workers out that join later.
                workers=list(self._workers) if self._refused and self._workers else None,
            )
        except Exception:  # a client without its scheduler raises whatever its connection raises
            self._lost.append(chunk)
            return
        self._pending[future] = chunk
        future.add_done_callback(lambda _: self._woken.set())

    def finished(self, timeout_s: float) -> list[Outcome]:
        if not self._lost and not any(future.done() for future in self._pending):
            self._woken.wait(timeout_s)
        self._woken.clear()
        if self._client.status != "running":
            return self._reconnected()
        found = [outcome for future in list(self._pending) if (outcome := self._ended(future)) is not None]
        found += [Outcome(chunk, None) for chunk in self._lost]
        self._lost.clear()
        if time.monotonic() - self._looked_s > _LOOK_S:
            self._look()
        return found

    def withdraw(self) -> list[Chunk]:
        # Which of them a worker has begun is known to the scheduler alone.
        chunks = list(self._pending.values())
        with contextlib.suppress(Exception):
            self._client.cancel(list(self._pending))
        self._pending.clear()
        return chunks

    def close(self) -> None:
        with contextlib.suppress(Exception):
            self._client.close(timeout=_CONNECT_S)

    def _ended(self, future: Future) -> Outcome | None:
        """Outcome of a future that is done; None while it is under way."""
        if not future.done():
            return None
        chunk = self._pending.pop(future)
        try:
            answer: Any = future.result(timeout=_CONNECT_S)
        except Exception:  # killed with its worker, cancelled with its scheduler, lost on its way here
            return Outcome(chunk, None)
        if isinstance(answer, _Refused):
            self._refuse(answer.worker, identity().differences(answer.other))
            self._lost.append(chunk)
            return None
        if isinstance(answer, BaseException):
            raise answer
        return Outcome(chunk, answer)

    def _refuse(self, worker: str, why: str) -> None:
        if worker not in self._refused:
            self._refused.add(worker)
            self._say(f"worker {worker} is refused: {why}")
        self._workers.pop(worker, None)

    def _look(self) -> None:
        """Ask for the workers of the cluster, and newcomers for their identity.

        Raises:
            DeviceError: every worker of the cluster is refused.
        """
        self._looked_s = time.monotonic()
        try:
            known = self._client.scheduler_info(n_workers=-1)["workers"]
            newcomers = [name for name in known if name not in self._workers and name not in self._refused]
            answers = self._client.run(identity, workers=newcomers, on_error="return") if newcomers else {}
        except Exception:  # the scheduler is away: `finished` sees it by the status of the client
            return
        before = set(self._workers)
        self._workers = {name: known[name]["nthreads"] for name in self._workers if name in known}
        for name, answer in answers.items():
            if isinstance(answer, Identity) and answer == identity():
                self._workers[name] = known[name]["nthreads"]
            elif isinstance(answer, Identity):
                self._refuse(name, identity().differences(answer))
            elif isinstance(answer, ImportError):
                self._refuse(name, f"gantryctl cannot be imported there ({answer})")
        if known and not self._workers and self._refused.issuperset(known):
            raise DeviceError(
                f"--cluster {self._address}: all of its {len(known)} workers are refused; install the same gantryctl "
                "with the same libraries on all of them (docs/how-to/run-a-campaign.md)"
            )
        if self._refused and set(self._workers) != before:
            # Chunks that wait for workers by name would wait for those that have left.
            self._lost += self.withdraw()

    def _reconnected(self) -> list[Outcome]:
        """Wait for the scheduler; all that was under way is lost.

        Raises:
            DeviceError: it did not come back.
        """
        self._say(f"the scheduler {self._address} is away; trying for {RECONNECT_S:.0f} s")
        self._lost += self._pending.values()
        self._pending.clear()
        self._workers.clear()
        self.close()
        self._client = self._connect(RECONNECT_S)
        self._say(f"the scheduler {self._address} is back")
        self._look()
        found = [Outcome(chunk, None) for chunk in self._lost]
        self._lost.clear()
        return found

    def _connect(self, within_s: float) -> Client:
        from distributed import Client

        end = time.monotonic() + within_s
        while True:
            try:
                return Client(self._address, timeout=_CONNECT_S, set_as_default=False, name="gantryctl")
            except (OSError, TimeoutError, ValueError) as fault:
                if isinstance(fault, ValueError):
                    raise UsageError(
                        f"--cluster {self._address}: {fault}; such as tcp://10.0.0.1:8786"
                    ) from None
                if time.monotonic() > end:
                    raise DeviceError(
                        f"--cluster {self._address}: no scheduler answers within {within_s:.0f} s; start it with "
                        "`dask scheduler`; the same command goes on where this one ended"
                    ) from None
                time.sleep(_PAUSE_S)
