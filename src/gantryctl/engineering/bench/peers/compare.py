"""All peers in one run: medians of turns, each held against the reference first."""

from __future__ import annotations

import platform
from collections.abc import Sequence
from functools import partial
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import NamedTuple

from gantryctl import _core
from gantryctl.engineering.bench.figures import Figure, medians
from gantryctl.engineering.bench.peers.building import compiler_version
from gantryctl.engineering.bench.peers.table import OWN, PEERS, Peer
from gantryctl.engineering.bench.rigid import TOLERANCE_DEG, Run, deviation_deg, reference, same_job
from gantryctl.engineering.report.meter import Watch, nobody
from gantryctl.errors import GantryctlError


class PeerResult(NamedTuple):
    """What became of one peer.

    Attributes:
        rate: axis seconds per second of processor time; None where it was left out.
        deviation_deg: from the reference, at the gantry.
        why_not: why it was left out, or "".
    """

    peer: Peer
    rate: float | None
    deviation_deg: float | None
    why_not: str = ""


class WrongJob(GantryctlError):
    """A program whose motor is not where the reference is: its speed says nothing."""

    exit_code = 1


def compare_peers(
    repeats: int, scale: float, table: tuple[Peer, ...] = PEERS, watch: Watch = nobody
) -> list[PeerResult]:
    """Measure every peer that is installed.

    Args:
        repeats: how often each takes its turn.
        scale: part of the usual length.
        table: the peers.
        watch: is told the part that is done.

    Raises:
        WrongJob: a program does another job.
    """
    chosen = [peer._replace(seconds=max(1, round(peer.seconds * scale))) for peer in table]
    expected = reference(max(peer.seconds for peer in chosen))
    runs: dict[str, Run] = {}
    with TemporaryDirectory(prefix="gantryctl-bench-") as folder:
        # To be prepared, each is built and runs once: about as long as a turn.
        turns, results = repeats + 1, []
        for n, peer in enumerate(chosen):
            results.append(_prepared(peer, expected, Path(folder) / str(n), runs))
            watch((n + 1) / len(chosen) / turns)
        spent = medians(
            {name: partial(_spent_s, run) for name, run in runs.items()},
            repeats,
            lambda part: watch((1.0 + part * repeats) / turns),
        )
    return [
        result._replace(rate=result.peer.seconds / spent[result.peer.name]) if not result.why_not else result
        for result in results
    ]


def _prepared(peer: Peer, expected: Sequence[float], folder: Path, runs: dict[str, Run]) -> PeerResult:
    """Prepare a peer and hold its job against the reference; its run goes into `runs`."""
    missing = peer.missing()
    if missing is not None:
        return PeerResult(peer, None, None, f"not installed: {missing}")
    folder.mkdir()
    try:
        run = peer.prepare(folder)
    except (ImportError, GantryctlError) as failed:
        return PeerResult(peer, None, None, str(failed))
    angles = run().angles
    apart = deviation_deg(angles, expected)
    if not same_job(angles, expected, peer.seconds):
        raise WrongJob(
            f"{peer.name} does another job: {apart:.3g} deg from the reference (limit {TOLERANCE_DEG:g} deg), "
            f"{len(angles)} of {peer.seconds} angles"
        )
    runs[peer.name] = run
    return PeerResult(peer, None, apart)


def _spent_s(run: Run) -> float:
    return run().spent_s


def peers(repeats: int, scale: float, watch: Watch = nobody) -> list[Figure]:
    """Rates and their ratios, as figures."""
    return peer_figures(compare_peers(repeats, scale, watch=watch))


def peer_figures(results: list[PeerResult]) -> list[Figure]:
    """The rate of gantryctl, and how much faster it is than each peer that was measured."""
    rates = {result.peer.name: result.rate for result in results if result.rate is not None}
    own = rates[OWN]
    figures = [Figure("own", "gantryctl, rigid job", own, "axis s/s")]
    for name, rate in rates.items():
        if name != OWN:
            least = 0.7 if name == "plain C" else None
            key = f"over_{name.lower().replace(', ', '_').replace(' ', '_').replace('-', '_')}"
            figures.append(Figure(key, f"gantryctl / {name}", own / rate, least=least))
    return figures


def where() -> str:
    """The computer of a run, for its table."""
    python, compiled = platform.python_version(), compiler_version()
    return f"{platform.machine()} ({_core.isa()}), {platform.system()}, Python {python}, {compiled}"
