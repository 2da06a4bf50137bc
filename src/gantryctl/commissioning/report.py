"""The report: one HTML page and its JSON, with a hash, beside what the last commissioning measured."""

from __future__ import annotations

import json
from html import escape
from pathlib import Path
from typing import Final

from gantryctl.commissioning.plan import STEPS
from gantryctl.commissioning.results import Outcome, Progress, load_progress
from gantryctl.errors import StateError

_STYLE: Final = """body{font:15px/1.45 system-ui,sans-serif;margin:2em auto;max-width:62em;padding:0 1em;color:#222}
table{border-collapse:collapse;width:100%}td,th{border-bottom:1px solid #ccc;padding:.35em .6em;text-align:left;
vertical-align:top}.passed{color:#176b2c}.failed{color:#b00020}.none{color:#666}code{font-size:90%}"""


def write_report(progress: Progress, folder: Path) -> Path:
    """Write `commissioning.html` and `commissioning.json`; a JSON that is there already is what is compared with."""
    data = folder / "commissioning.json"
    try:
        before = load_progress(data)
    except StateError:
        before = None
    data.write_text(json.dumps(progress.as_dict(), indent=1, allow_nan=False) + "\n", encoding="utf-8")
    page = folder / "commissioning.html"
    page.write_text(_page(progress, before), encoding="utf-8")
    return page


def _page(progress: Progress, before: Progress | None) -> str:
    rows = "\n".join(_row(progress, before, step.key, step.title) for step in STEPS)
    last = f"<p>Compared with report <code>{before.hash[:16]}</code>.</p>" if before is not None else ""
    return (
        f"<!doctype html><html lang=en><meta charset=utf-8><title>Commissioning of {escape(progress.machine)}</title>"
        f"<style>{_STYLE}</style><h1>Commissioning of {escape(progress.machine)}</h1>"
        f"<p>Drive <code>{escape(progress.drive)}</code>, software {escape(progress.software)}<br>"
        f"Configuration <code>{progress.proven_hash[:16]}</code><br>Report <code>{progress.hash}</code></p>{last}"
        f"<table><tr><th>Step<th>Result<th>Proof and figures<th>Time</tr>\n{rows}</table></html>\n"
    )


def _row(progress: Progress, before: Progress | None, key: str, title: str) -> str:
    result = progress.results.get(key)
    if result is None:
        return f"<tr><td>{escape(title)}<td class=none>not done<td><td></tr>"
    old = before.results.get(key) if before is not None else None
    figures = "".join(
        f"<br><code>{escape(name)}</code> {value:.6g}"
        + (f" (was {old.figures[name]:.6g})" if old is not None and name in old.figures else "")
        for name, value in result.figures.items()
    )
    style = {Outcome.PASSED: "passed", Outcome.FAILED: "failed"}.get(result.outcome, "none")
    to_do = f"<br>To do: {escape(result.to_do)}" if result.to_do else ""
    return (
        f"<tr><td>{escape(title)}<td class={style}>{result.outcome.value}<td>{escape(result.proof)}{figures}{to_do}"
        f"<td>{result.seconds:.1f} s<br>{escape(result.at)}</tr>"
    )
