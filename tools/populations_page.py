"""Write the tables of `docs/explanation/populations.md`: `python tools/populations_page.py`.

They come from `docs/evidence/campaign_*.json`. Each of these files is what
`gantryctl campaign show RESULT --json` printed.
"""

from __future__ import annotations

import json
import re
from pathlib import Path
from typing import Any

ROOT = Path(__file__).parents[1]
PAGE = ROOT / "docs" / "explanation" / "populations.md"
EVIDENCE = ROOT / "docs" / "evidence"
PLACE = re.compile(r"(<!-- campaign (\w+): .*? -->\n).*?(<!-- end -->)", re.DOTALL)


def with_tables(page: str) -> str:
    """The page with the tables of the evidence between its marks."""
    return PLACE.sub(lambda mark: f"{mark[1]}{_tables(mark[2])}\n{mark[3]}", page)


def _tables(name: str) -> str:
    text = (EVIDENCE / f"campaign_{name}.json").read_text(encoding="utf-8")
    data: Any = json.loads(text)
    parts: list[dict[str, Any]] = data if isinstance(data, list) else [data]
    rows = [(part["part"], column, figure) for part in parts for column, figure in part["figures"].items()]
    first = parts[0]
    made = [f"{first['rows_there']} of {first['rows']} rows, seed {first['seed']}, {_refused(first)}.", ""]
    made += _table(
        ("", "figure", "", "5 %", "median", "95 %", "median, 95 % interval", "plants"), rows, _quantiles
    )
    if any(figure["passing"] for _, _, figure in rows):
        made += _table(("", "figure", "limit", "probability of keeping it", "95 % interval"), rows, _passing)
    if any(figure["sensitivity"] for _, _, figure in rows):
        made += _table(
            ("", "figure", "factor", "first order", "total", "95 % interval of the total"), rows, _sobol
        )
    return "\n".join(made).rstrip()


def _refused(part: dict[str, Any]) -> str:
    count = sum(part["refused"].values())
    return f"{count} refused ({', '.join(part['refused'])})" if count else "none refused"


def _table(heads: tuple[str, ...], rows: list[tuple[str, str, Any]], cells: Any) -> list[str]:
    lines = [
        f"| {part} | `{column}` | {' | '.join(row)} |"
        for part, column, figure in rows
        for row in cells(figure)
    ]
    if all(line.startswith("|  |") for line in lines):
        heads, lines = heads[1:], [line.removeprefix("|  ") for line in lines]
    return [f"| {' | '.join(heads)} |", f"|{'---|' * len(heads)}", *lines, ""]


def _quantiles(figure: dict[str, Any]) -> list[list[str]]:
    by_part = {each["part"]: each for each in figure["quantiles"]}
    median = by_part[0.5]
    interval = " .. ".join("-" if end is None else f"{end:.4g}" for end in (median["low"], median["high"]))
    values = [f"{by_part[part]['value']:.4g}" for part in (0.05, 0.5, 0.95)]
    return [[figure["unit"], *values, interval, str(figure["plants"])]]


def _passing(figure: dict[str, Any]) -> list[list[str]]:
    return [
        [f"{each['limit']:g}", f"{each['probability']:.4f}", f"{each['low']:.4f} .. {each['high']:.4f}"]
        for each in figure["passing"]
    ]


def _sobol(figure: dict[str, Any]) -> list[list[str]]:
    return [
        [
            each["factor"],
            f"{each['first']:.3f}",
            f"{each['total']:.3f}",
            f"{each['total_low']:.3f} .. {each['total_high']:.3f}",
        ]
        for each in sorted(figure["sensitivity"], key=lambda each: -float(each["total"]))
    ]


if __name__ == "__main__":
    PAGE.write_text(with_tables(PAGE.read_text(encoding="utf-8")), encoding="utf-8")
