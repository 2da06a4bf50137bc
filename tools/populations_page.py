"""Write tables and figures of `docs/explanation/populations.md`: `python tools/populations_page.py`.

They come from `docs/evidence/campaign_*.json`. Each of these files is what
`gantryctl campaign show RESULT --json` printed, of a result that may still grow.
"""

from __future__ import annotations

import io
import json
import math
import re
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from gantryctl.engineering.campaign.report.figures import Curve, Spread, distribution, sensitivity, spreads
from gantryctl.engineering.campaign.statistics import Sensitivity
from gantryctl.engineering.report.svg import STYLE

if TYPE_CHECKING:
    from matplotlib.figure import Figure

ROOT = Path(__file__).parents[1]
PAGE = ROOT / "docs" / "explanation" / "populations.md"
EVIDENCE = ROOT / "docs" / "evidence"
MARK = re.compile(r"(<!-- campaign (\w+): .*? -->\n).*?(<!-- end -->)", re.DOTALL)
GRADE_KEY = "plant.gear_error.scale"


def filled(page: str) -> str:
    """The page with what the evidence says between its marks."""
    return MARK.sub(lambda mark: f"{mark[1]}{_section(mark[2])}\n{mark[3]}", page)


def _parts(name: str) -> list[dict[str, Any]]:
    """A result, or the parts of one; nothing where it was never run."""
    path = EVIDENCE / f"campaign_{name}.json"
    if not path.exists():
        return []
    data: Any = json.loads(path.read_text(encoding="utf-8"))
    return data if isinstance(data, list) else [data]


def _section(name: str) -> str:
    parts = _parts(name)
    if not parts:
        return "Not run yet."
    first = parts[0]
    made = [f"{first['rows_there']} of {first['rows']} rows, seed {first['seed']}, {_refused(first)}.", ""]
    for figure, title, _ in _figures(name, parts):
        made += [f"![{title}]({figure})", ""]
    rows = [(_part(part), column, figure) for part in parts for column, figure in part["figures"].items()]
    made += _table(
        ("", "figure", "", "5 %", "median", "95 %", "median, 95 % interval", "plants"), rows, _quantiles
    )
    limits = sorted({_limits(figure) for _, _, figure in rows} - {()}, reverse=True)
    for of in limits:
        heads = ("", "probability of keeping, 95 % interval", *(f"{limit:g}" for limit in of))
        made += _table(heads, [row for row in rows if _limits(row[2]) == of], _passing)
    if first["base_points"]:
        made += [f"Sobol indices, by {first['base_points']} base points:", ""]
        heads = ("", "figure", "factor", "first order", "total", "95 % interval of the total")
        made += _table(heads, rows, _sobol)
    return "\n".join(made).rstrip()


def _limits(figure: dict[str, Any]) -> tuple[float, ...]:
    return tuple(sorted({each["limit"] for each in figure["passing"]}, reverse=True))


def _refused(part: dict[str, Any]) -> str:
    count = sum(part["refused"].values())
    return f"{count} refused ({', '.join(part['refused'])})" if count else "none refused"


def _part(part: dict[str, Any]) -> str:
    if part["part"] is None:
        return ""
    key, value = part["part"]["key"], part["part"]["value"]
    return f"grade {8 + 2 * math.log2(value):g}" if key == GRADE_KEY else f"{key} {value:g}"


def _table(heads: Sequence[str], rows: Sequence[tuple[str, str, Any]], cells: Any) -> list[str]:
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
    ordered = sorted(figure["passing"], key=lambda each: -float(each["limit"]))
    return [[f"{each['probability']:.4f} ({each['low']:.4f} .. {each['high']:.4f})" for each in ordered]]


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


def _figures(name: str, parts: Sequence[dict[str, Any]]) -> Iterator[tuple[str, str, Figure]]:
    """File, title and picture of each figure of a campaign."""
    by_column = {
        column: [(_part(part), part["figures"][column]) for part in parts] for column in parts[0]["figures"]
    }
    controls = list(dict.fromkeys(column.rpartition(".")[0] for column in by_column))
    outputs = list(dict.fromkeys(column.rpartition(".")[2] for column in by_column))
    for output in outputs:
        mine = [
            each for column in by_column if column.rpartition(".")[2] == output for each in by_column[column]
        ]
        first = mine[0][1]
        label = f"{first['meaning']}, {first['unit']}"
        limits = [each["limit"] for each in first["passing"]]
        plants = sum(figure["plants"] for _, figure in by_column[f"{controls[0]}.{output}".lstrip(".")])
        file = f"populations_{name}_{output}.svg"
        if first["sensitivity"]:
            indices = [Sensitivity(**each) for each in first["sensitivity"]]
            title = f"Sobol indices of the {first['meaning']}, {parts[0]['base_points']} base points"
            yield file, title, sensitivity(indices)
        elif len(controls) > 1:
            rows = [
                Spread(control.replace("_", " "), *(_value(figure, part) for part in (0.05, 0.5, 0.95)))
                for control, (_, figure) in zip(controls, mine, strict=True)
            ]
            yield file, f"{first['meaning']} by control, {plants} plants", spreads(rows, limits, label)
        elif output == outputs[0]:
            curves = [Curve(part, figure["curve"]) for part, figure in mine]
            yield file, f"{first['meaning']}, {plants} plants", distribution(curves, limits, label)


def _value(figure: dict[str, Any], part: float) -> float:
    return float(next(each["value"] for each in figure["quantiles"] if each["part"] == part))


def _svg(figure: Figure, name: str) -> str:
    """A picture of some kilobytes that is the same each time; its letters are text."""
    import matplotlib as mpl

    out = io.StringIO()
    look = {**STYLE, "svg.fonttype": "none", "font.family": "sans-serif", "svg.hashsalt": name}
    with mpl.rc_context(look):
        figure.savefig(out, format="svg", metadata={"Date": None, "Creator": None}, facecolor="white")
    # Finer than a hundredth of a point no eye sees; and lines without spaces at their ends.
    numbers = re.compile(r"(\d\.\d\d)\d+")
    short = re.sub(r'="[^"]*"', lambda attribute: numbers.sub(r"\1", attribute[0]), out.getvalue())
    return "\n".join(line.rstrip() for line in short.splitlines()) + "\n"


if __name__ == "__main__":
    text = PAGE.read_text(encoding="utf-8")
    for _, campaign in re.findall(r"(<!-- campaign (\w+):)", text):
        for file, _, figure in _figures(campaign, _parts(campaign)) if _parts(campaign) else ():
            (PAGE.parent / file).write_text(_svg(figure, file), encoding="utf-8")
    PAGE.write_text(filled(text), encoding="utf-8")
