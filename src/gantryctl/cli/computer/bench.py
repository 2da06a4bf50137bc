"""`gantryctl bench`: how fast this computer is, as ratios."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Final

import click

from gantryctl.cli.options import directory, json_option, number_option, out_option, print_json
from gantryctl.cli.progress import metered
from gantryctl.cli.values import Whole

if TYPE_CHECKING:
    from gantryctl.engineering.bench.figures import Figure
    from gantryctl.engineering.bench.peers.compare import PeerResult

# The table is in `engineering.bench.groups`; a test compares.
_GROUPS: Final = ("peers", "batch", "scan", "jitter", "cli")
_SCALE_MIN: Final = 0.001
_SCALE_MAX: Final = 10.0


@click.command()
@click.argument("groups", nargs=-1, type=click.Choice(_GROUPS))
@click.option(
    "--repeats",
    type=Whole(1, 100),
    default=5,
    show_default=True,
    help="Turns of each job; medians count.",
)
@number_option(("--scale",), 1.0, "Part of the usual length of each job, 0.001 to 10.")
@out_option
@json_option
def bench(groups: tuple[str, ...], repeats: int, scale: float, out: Path | None, as_json: bool) -> int:
    """Measure this computer: peers, batch, scan, jitter, cli; all of them when none is named.

    The jobs of a ratio take turns, and medians are compared: computers differ and are busy, ratios stay. Results are
    kept in the state directory and compared with the last run. Peers are other tools that do the same job (install
    them with `pip install gantryctl[bench]`); those that are missing are left out, by name. --out writes their table
    and plot.

    Exit code 1 when a limit is missed, or a peer does another job.
    """
    from gantryctl.engineering.bench.groups import GROUPS
    from gantryctl.engineering.bench.peers.compare import compare_peers, peer_figures
    from gantryctl.engineering.bench.peers_page import write_peers
    from gantryctl.engineering.bench.results import load_results
    from gantryctl.errors import UsageError

    chosen = tuple(dict.fromkeys(groups)) or _GROUPS
    if not _SCALE_MIN <= scale <= _SCALE_MAX:
        raise UsageError(f"--scale must be {_SCALE_MIN:g} to {_SCALE_MAX:g}, got {scale:g}")
    if out is not None and "peers" not in chosen:
        raise UsageError("--out: only the peers have a table and a plot")
    results = load_results()
    found: dict[str, list[Figure]] = {}
    last = {group: results.last(group) for group in chosen}
    peers: list[PeerResult] = []
    written: list[str] = []
    for group in chosen:
        with metered(1.0, quiet=as_json) as meter:
            if group == "peers":
                peers = compare_peers(repeats, scale, watch=meter.reach)
                found[group] = peer_figures(peers)
            else:
                found[group] = GROUPS[group](repeats, scale, meter.reach)
        if group == "peers" and out is not None:
            written = [str(path) for path in write_peers(directory(out), peers, repeats)]
        if not as_json:
            _print(group, found[group], last[group])
            for one in peers if group == "peers" else []:
                if one.why_not:
                    click.echo(f"  left out: {one.peer.name} ({one.why_not})")
        # A shorter job is another job: its figures would spoil the comparison.
        if scale == 1.0:
            results.add(group, found[group])
    met = all(figure.met for figures in found.values() for figure in figures)
    if as_json:
        print_json(
            {
                "met": met,
                "groups": {
                    group: [figure.to_dict() for figure in figures] for group, figures in found.items()
                },
                "last": last,
                "left_out": {one.peer.name: one.why_not for one in peers if one.why_not},
                "written": written,
            }
        )
    else:
        for path in written:
            click.echo(f"written: {path}")
        click.echo(
            f"results: {results.path}" if scale == 1.0 else "not kept: only runs of the usual length are"
        )
    return int(not met)


def _print(group: str, figures: list[Figure], last: dict[str, float]) -> None:
    click.echo(f"\n{group:45} {'':>10} {'':9} {'limit':9} {'':6} {'x last':>7}")
    for figure in figures:
        limit = (
            f">= {figure.least:g}" if figure.least is not None
            else f"<= {figure.most:g}" if figure.most is not None
            else ""
        )  # fmt: skip
        verdict = "" if not limit else "ok" if figure.met else "MISSED"
        before = last.get(figure.key)
        change = f"{figure.value / before:7.2f}" if before else "      -"
        digits = 0 if abs(figure.value) >= 100 else 2
        click.echo(
            f"  {figure.title:43} {figure.value:10.{digits}f} {figure.unit:9} {limit:9} {verdict:6} {change}"
        )
