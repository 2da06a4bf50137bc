"""Table and plot of the peers for the documentation, written by `gantryctl bench peers --out docs/reference`."""

from __future__ import annotations

from pathlib import Path
from typing import Final

from gantryctl.engineering.bench.peers.compare import PeerResult, where
from gantryctl.engineering.bench.peers.table import OWN
from gantryctl.engineering.bench.rigid import TOLERANCE_DEG
from gantryctl.engineering.report.figures import BLUE, GREY, png_figure
from gantryctl.files import write_whole

PAGE: Final = "peers.md"
PLOT: Final = "peers.png"


def write_peers(folder: Path, results: list[PeerResult], repeats: int) -> tuple[Path, Path]:
    """Write page and plot; return their paths.

    Raises:
        DeviceError: a file cannot be written.
    """
    page, plot = folder / PAGE, folder / PLOT
    measured = [result for result in results if result.rate is not None]
    with png_figure(
        plot, "The rigid job: axis seconds per second of processor time", 1, 1, figsize=(8.6, 4.2)
    ) as axes:
        ordered = sorted(measured, key=lambda result: result.rate or 0.0)
        bars = axes.barh(
            [result.peer.name for result in ordered],
            [result.rate for result in ordered],
            color=[BLUE if result.peer.name == OWN else GREY for result in ordered],
        )
        axes.bar_label(bars, fmt=_three, padding=3, fontsize=8)
        axes.set_xscale("log")
        axes.set_xlabel("axis s/s, logarithmic")
    write_whole(page, peers_page(results, repeats))
    return page, plot


def peers_page(results: list[PeerResult], repeats: int) -> str:
    """The page as Markdown."""
    own = next(result.rate for result in results if result.peer.name == OWN)
    assert own is not None
    lines = [
        "# Peers",
        "",
        "Written by `gantryctl bench peers --out docs/reference`; do not edit.",
        "",
        "Every program does the *rigid job*: the paper's loop on one inertia with an eccentric moment, position law at",
        "1 ms, PI speed loop at 125 us, 0 to 90 deg ([benchmarks](benchmarks.md)). Each is written in the way of its",
        f"own manual, and must be within {TOLERANCE_DEG:g} deg of a tight reference at every whole second before its",
        f"time counts; compiling and importing do not. Medians of {repeats}, all taking turns in one run. {where()}.",
        "",
        "![Axis seconds per second of processor time](peers.png)",
        "",
        "| | axis s/s | gantryctl is faster by | deviation, deg | version | way |",
        "|---|---:|---:|---:|---|---|",
    ]
    for result in sorted(results, key=lambda result: -(result.rate or 0.0)):
        peer = result.peer
        if result.rate is None:
            lines.append(f"| {peer.name} | - | - | - | {result.why_not} | {peer.way} |")
            continue
        lines.append(
            f"| {peer.name} | {_three(result.rate)} | {_three(own / result.rate)} | {result.deviation_deg:.0e} "
            f"| {peer.versions() or '-'} | {peer.way} |"
        )
    return "\n".join(lines) + "\n"


def _three(value: float) -> str:
    """Three digits, without an exponent."""
    return f"{value:.0f}" if value >= 100.0 else f"{value:.3g}"
