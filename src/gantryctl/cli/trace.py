"""`gantryctl trace`: list, show, plot, compare and export recordings."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Final

import click

from gantryctl.cli.options import json_option, print_done, print_json, write_text
from gantryctl.cli.report import report_options
from gantryctl.cli.values import FINITE, PATH, InputPath, Whole, check_lasting
from gantryctl.extras import need

if TYPE_CHECKING:
    from gantryctl.engineering.report.head import Made
    from gantryctl.trace.table import ColumnSummary, Trace


def _newest() -> Path:
    from gantryctl.operation.store import last_recording

    return last_recording()


_RECORDING: Final = InputPath({"last": _newest})
# What a picture of a comparison shows unless it is told.
_COMPARED: Final = ("pos_act_rad", "vel_act_rad_s", "torque_act_nm")
file_argument = click.argument("file", type=_RECORDING, default="last")


@click.group()
def trace() -> None:
    """List, show, plot, compare and export recordings.

    They are *.parquet, or *.arrows of a run that still goes on or was killed.

    FILE is a recording; without it, or with the word `last`, the newest one of the state directory.
    """


@trace.command("list")
@click.option("--config", "config_file", type=PATH, help="Only those of this machine.")
@click.option("--last", "count", type=Whole(1), default=20, show_default=True, help="How many, the newest.")
@json_option
def list_(config_file: Path | None, count: int, as_json: bool) -> None:
    """List the recordings of the state directory, newest last."""
    from gantryctl.machine import load_machine
    from gantryctl.operation.store import state_root
    from gantryctl.trace.listing import recordings

    name = "*" if config_file is None else load_machine(config_file).name
    found = [row for folder in state_root().glob(f"{name}/traces") for row in recordings(folder)]
    found = sorted(found, key=lambda row: (row.begun is not None, row.begun, row.file))[-count:]
    if as_json:
        print_json(
            [
                {
                    **row._asdict(),
                    "file": str(row.file),
                    "machine": row.file.parent.parent.name,
                    "begun": None if row.begun is None else row.begun.isoformat(timespec="milliseconds"),
                }
                for row in found
            ]
        )
        return
    if not found:
        click.echo(f"no recording under {state_root()} yet: `gantryctl move` makes one")
    for row in found:
        begun = "-" if row.begun is None else f"{row.begun:%Y-%m-%d %H:%M:%S} UTC"
        lasts = "not closed" if row.duration_s is None else f"{row.duration_s:.1f} s"
        click.echo(f"{begun:<23}  {lasts:>11}  {row.size_bytes / 1e6:>8.2f} MB  {row.file}")


@trace.command()
@file_argument
@json_option
def show(file: Path, as_json: bool) -> None:
    """Show what FILE records of its run, and smallest, largest and r.m.s. value of every column.

    In degrees; as JSON in radians, as recorded.
    """
    from gantryctl.trace.reader import read_trace
    from gantryctl.trace.table import summarize

    recording = read_trace(file)
    if as_json:
        data = {
            "file": str(file),
            "complete": recording.complete,
            "rows": len(recording),
            "duration_s": recording.duration_s,
            "gaps_s": recording.gaps(),
            "rest_rows": recording.rest_rows,
            "hash": recording.hash(),
            "metadata": recording.metadata,
            "columns": [summary._asdict() for summary in summarize(recording)],
        }
        print_json(data)
        return
    click.echo(f"{file}: {len(recording)} rows, {recording.duration_s:.3f} s, hash {recording.hash()[:16]}")
    if not recording.complete:
        click.echo("not closed: the run was killed or still goes on; every row shown is whole")
    # Missed deadlines are never caught up: the scan numbers go on with the time (decision 0005).
    for before_s, after_s in recording.gaps():
        click.echo(
            f"rows are missing between {before_s:.3f} s and {after_s:.3f} s: scans missed, or no place for them"
        )
    if recording.rest_rows:
        click.echo(_thinned(recording))
    for key, value in recording.metadata.items():
        click.echo(f"  {key}: {value}")
    shown = recording.in_degrees()
    click.echo(_table(recording.columns, summarize(shown)))


def _thinned(recording: Trace) -> str:
    """Say that the rows are not at equal times."""
    longest_s = float(recording["spacing_s"].max())
    return (
        f"{recording.rest_rows} rows are of an axis at rest and stand for up to {longest_s:g} s each (spacing_s); "
        "r.m.s. values are over time; `trace export --every-scan` makes one row per scan"
    )


def _table(names: tuple[str, ...], summaries: list[ColumnSummary]) -> str:
    # Columns have the names under which they were recorded, so that a reader finds them again in the file.
    width = max([len(name) for name in names], default=0)
    lines = ["", f"{'column':{width}}  {'smallest':>12}  {'largest':>12}  {'r.m.s.':>12}  shown in"]
    for name, summary in zip(names, summaries, strict=True):
        values = (summary.minimum, summary.maximum, summary.rms)
        cells = "  ".join(f"{'-' if value is None else format(value, '.6g'):>12}" for value in values)
        note = f"  ({summary.not_finite} values are not finite)" if summary.not_finite else ""
        lines.append(f"{name:{width}}  {cells}  {summary.unit}{note}".rstrip())
    return "\n".join(lines)


@trace.command()
@file_argument
@click.option(
    "--out",
    type=PATH,
    help="PNG, SVG, or HTML with the recording inside, as the name ends (default: FILE with .png).",
)
@click.option("--overlay", type=_RECORDING, metavar="FILE", help="HTML: another recording over this one.")
@click.option("--columns", help="Only these, separated by commas; one diagram per unit.")
@click.option("--from", "start_s", type=FINITE, help="From this time on, s.")
@click.option("--to", "end_s", type=FINITE, help="Up to this time, s.")
@report_options
@json_option
def plot(
    file: Path,
    out: Path | None,
    overlay: Path | None,
    columns: str | None,
    start_s: float | None,
    end_s: float | None,
    as_json: bool,
    made: Made,
) -> None:
    """Plot FILE: angle, speed, following error and torque, or the columns asked for.

    The HTML page zooms, has cursors, and lays the page of another recording over this one.
    """
    from gantryctl.engineering.report.pages.trace import ShownTrace, render_trace
    from gantryctl.errors import UsageError
    from gantryctl.trace.figure import chosen, draw, overview, save
    from gantryctl.trace.reader import read_trace

    need("matplotlib")

    def shown(path: Path) -> ShownTrace:
        recording = _part(read_trace(path), start_s, end_s)
        names = [name.strip() for name in (columns or "").split(",") if name.strip()]
        panels = overview(recording) if columns is None else chosen(recording, names)
        return ShownTrace(path.name, recording, panels)

    drawn = shown(file)
    out = out or _beside(file, ".png")
    page = out.suffix.lower() == ".html"
    if overlay is not None and not page:
        raise UsageError(f"--overlay {overlay}: needs --out NAME.html")
    title = _title(file, drawn.trace)
    if page:
        write_text(out, render_trace(drawn, shown(overlay) if overlay else None, title, made))
    else:
        save(draw(drawn.trace, drawn.panels, title), out)
    print_done(f"wrote {out}", as_json, written=[str(out)])


def _part(recording: Trace, start_s: float | None, end_s: float | None) -> Trace:
    """The rows between two times; all of them without times."""
    import math

    from gantryctl.errors import UsageError

    start = -math.inf if start_s is None else start_s
    end = math.inf if end_s is None else end_s
    if not start <= end:
        raise UsageError(f"--from {start} s --to {end} s: the end must not be before the start")
    part = recording.slice(start, end)
    if not len(part):
        raise UsageError(
            f"no row between {start} s and {end} s: it has {len(recording)} rows, {_span(recording)}"
        )
    return part


def _span(recording: Trace) -> str:
    # A run that was refused before its first scan leaves no row.
    if not len(recording):
        return "so there is nothing to see"
    return f"from {recording.time_s[0]:.3f} s to {recording.time_s[-1]:.3f} s"


def _title(file: Path, recording: Trace) -> str:
    known = [str(recording.metadata[key]) for key in ("machine", "command") if recording.metadata.get(key)]
    marks = [] if recording.complete else ["not closed"]
    return " · ".join([*known, file.name, *marks])


def _beside(file: Path, suffix: str) -> Path:
    from gantryctl.files import check_place

    check_lasting(file, "without --out")
    # A recording may have dots in its name (a date, a version): only the endings of recordings are taken off.
    stem = file.stem if file.suffix in {".parquet", ".arrows", ".csv"} else file.name
    beside = file.with_name(stem + suffix)
    check_place(beside)
    return beside


@trace.command()
@click.argument("first", metavar="A", type=_RECORDING)
@click.argument("second", metavar="B", type=_RECORDING)
@click.option(
    "--align",
    type=click.Choice(["motion", "start"]),
    default="motion",
    show_default=True,
    help="What both begin with: the first motion of the set-point, or the first row.",
)
@click.option("--out", type=PATH, help="Picture of the differences, PNG or SVG.")
@click.option("--columns", help="Only these in the picture, separated by commas.")
@json_option
def compare(
    first: Path, second: Path, align: str, out: Path | None, columns: str | None, as_json: bool
) -> None:
    """Compare recording B with recording A: the largest deviation of every column, and when.

    Both are put on one time axis, that of A. In degrees. The picture shows B minus A.
    """
    from gantryctl.errors import UsageError
    from gantryctl.trace.comparison import difference, differences, motion_begins_s
    from gantryctl.trace.figure import check_picture, chosen, draw, save
    from gantryctl.trace.reader import read_trace

    if out is not None:
        need("matplotlib")
        check_picture(out)
    elif columns is not None:
        raise UsageError("--columns: is for the picture; name its file with --out")
    a, b = read_trace(first), read_trace(second)
    begins = [motion_begins_s(trace) if align == "motion" else None for trace in (a, b)]
    # A recording without a motion has its first row instead.
    aligned = None not in begins
    begins_s = [
        begin if aligned and begin is not None else float(trace.time_s[0]) if len(trace) else 0.0
        for begin, trace in zip(begins, (a, b), strict=True)
    ]
    shift_s = begins_s[0] - begins_s[1]
    found = difference(a, b, shift_s)
    rows = differences(found)
    if as_json:
        print_json(
            {
                "first": str(first),
                "second": str(second),
                "aligned_by": "motion" if aligned else "start",
                "shift_s": shift_s,
                "from_s": float(found.time_s[0]),
                "to_s": float(found.time_s[-1]),
                "columns": [row._asdict() for row in rows],
            }
        )
    else:
        what = "the first motion" if aligned else "the first row"
        click.echo(
            f"{second} minus {first}, {what} of both at {begins_s[0]:.3f} s; "
            f"from {found.time_s[0]:.3f} s to {found.time_s[-1]:.3f} s"
        )
        width = max(len(row.name) for row in rows)
        click.echo(f"\n{'column':{width}}  {'largest':>12}  {'at':>12}  {'r.m.s.':>12}  shown in")
        for row in rows:
            cells = (row.largest, row.time_s, row.rms)
            shown = "  ".join(f"{'-' if value is None else format(value, '.6g'):>12}" for value in cells)
            click.echo(f"{row.name:{width}}  {shown}  {row.unit}".rstrip())
    if out is not None:
        names = [name.strip() for name in (columns or "").split(",") if name.strip()]
        usual = [name for name in _COMPARED if name in found]
        save(draw(found, chosen(found, names or usual), f"{second.name} minus {first.name}"), out)
        if not as_json:
            click.echo(f"wrote {out}")


@trace.command()
@file_argument
@click.option("--format", "kind", type=click.Choice(["csv", "parquet"]), required=True, help="What to write.")
@click.option("--degrees", is_flag=True, help="Angles in degrees, also in the names of the columns.")
@click.option(
    "--every-scan",
    "every_scan",
    is_flag=True,
    help="One row per scan: rows at rest are repeated for the scans that they stand for.",
)
@click.option("--out", type=PATH, help="Where to (default: beside FILE).")
@json_option
def export(file: Path, kind: str, degrees: bool, every_scan: bool, out: Path | None, as_json: bool) -> None:
    """Write FILE as CSV for other programs, or as Parquet.

    Parquet is for a recording that was never closed, or to have it in degrees.
    """
    from gantryctl.errors import UsageError
    from gantryctl.files import check_place
    from gantryctl.trace.reader import read_trace

    if out is not None:
        check_place(out)
    recording = read_trace(file)
    out = out or _beside(file, ("_deg." if degrees else ".") + kind)
    # The file would be truncated before it is read to its end.
    if out.exists() and out.samefile(file):
        raise UsageError(f"{out}: that is the recording itself; give another name with --out")
    if every_scan:
        recording = recording.every_scan()
    if degrees:
        recording = recording.in_degrees()
    if kind == "csv":
        recording.to_csv(out)
    else:
        recording.to_parquet(out)
    done = f"wrote {out}: {len(recording)} rows, {len(recording.columns)} columns"
    print_done(done, as_json, written=[str(out)])
