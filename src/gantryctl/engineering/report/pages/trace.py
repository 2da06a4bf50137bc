"""The report of one recording, or of two over one another."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

from gantryctl.engineering.report.head import Head, Judged, Made, Verdict
from gantryctl.engineering.report.page import Section, render_sections
from gantryctl.engineering.report.pictures import Panel, Picture, line
from gantryctl.engineering.report.recording import recorded
from gantryctl.engineering.report.text import TextTable
from gantryctl.trace.figure import Panel as TracePanel
from gantryctl.trace.files import Floats
from gantryctl.trace.table import Trace, summarize


class ShownTrace(NamedTuple):
    """A recording with its diagrams, under the name of its file."""

    name: str
    trace: Trace
    panels: Sequence[TracePanel]


def render_trace(shown: ShownTrace, beside: ShownTrace | None, title: str, made: Made) -> str:
    """The page of a recording; `beside`: another one, both drawn from their own beginning on."""
    told = [(str(key), str(value)) for key, value in shown.trace.metadata.items()]
    head = Head(
        str(shown.trace.metadata.get("machine") or shown.name),
        (("Recording", shown.name), *told, ("SHA-256 of the values", shown.trace.hash())),
        made,
    )
    over = "" if beside is None else f"; over it {beside.name}, {len(beside.trace)} rows"
    verdict = Verdict(
        "RECORDING" if shown.trace.complete else "NOT CLOSED",
        Judged.OPEN,
        f"{len(shown.trace)} rows, {shown.trace.duration_s:.3f} s{_thinned(shown.trace)}{over}",
    )
    return render_sections(
        head,
        verdict,
        [],
        title=title,
        subtitle="What was recorded; angles of the axis",
        sections=[
            Section("Diagrams", figures=[recorded(_picture(shown, beside), "recording")]),
            Section("Columns", tables=[_columns(shown.trace)]),
        ],
    )


def _thinned(trace: Trace) -> str:
    """How many rows stand for more than a scan; "" for a recording with one row per scan."""
    return f", {trace.rest_rows} of them at rest and further apart than a scan" if trace.rest_rows else ""


def _picture(shown: ShownTrace, beside: ShownTrace | None) -> Picture:
    others = {} if beside is None else {panel.title: panel for panel in beside.panels}
    panels = []
    time_s = shown.trace.time_s if beside is None else _since(shown)
    for panel in shown.panels:
        lines = [line(each.label, time_s, each.values) for each in panel.lines]
        if beside is not None and panel.title in others:
            lines += [
                line(f"{each.label} ({beside.name})", _since(beside), each.values)
                for each in others[panel.title].lines
            ]
        panels.append(Panel("time, s", _label(panel), tuple(lines), title=panel.title, y_dial=panel.dial))
    return Picture(
        "Drawn with the smallest and the largest sample of every stretch.", tuple(panels), columns=1
    )


def _since(shown: ShownTrace) -> Floats:
    """Time from the beginning of the recording on: two runs lie over one another."""
    since: Floats = shown.trace.time_s - shown.trace.time_s[0]
    return since


def _label(panel: TracePanel) -> str:
    """`angle in deg` as `angle, deg`."""
    return ", ".join(panel.axis_label.rsplit(" in ", 1))


def _columns(trace: Trace) -> TextTable:
    rows = tuple(
        (
            name,
            *("-" if value is None else f"{value:.6g}" for value in (each.minimum, each.maximum, each.rms)),
            each.unit,
        )
        for name, each in zip(trace.in_degrees().columns, summarize(trace.in_degrees()), strict=True)
    )
    return TextTable("", ("column", "smallest", "largest", "r.m.s.", "unit"), rows, left=(0, 4))
