"""The accuracy report as one HTML page, its figures inline."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any, Final

from gantryctl.engineering.accuracy.budget import budget_rows, freedom_text
from gantryctl.engineering.accuracy.paper import (
    PAPER_A_DEG,
    PAPER_LOWER_DEG,
    PAPER_MEAN_DEG,
    PAPER_NAME,
    PAPER_TABLE,
    PAPER_THREE_S_DEG,
    PAPER_UPPER_DEG,
)
from gantryctl.engineering.accuracy.report import figures
from gantryctl.engineering.accuracy.report.data import report_json
from gantryctl.engineering.accuracy.report.report import AccuracyReport, Beside, SpeedRun
from gantryctl.engineering.accuracy.report.text import (
    ISO_NAMES,
    NOT_JUDGED,
    STATISTICS,
    angle_text,
    iso_text,
)
from gantryctl.engineering.accuracy.statistics import TableStatistics, statistics
from gantryctl.engineering.accuracy.table import Direction, ErrorTable
from gantryctl.engineering.accuracy.table_csv import format_error_table
from gantryctl.engineering.accuracy.uncertainty import COVERAGE_K
from gantryctl.engineering.accuracy.verdict import Conformity, conformity_of, plus_minus
from gantryctl.engineering.report.head import Head, Judged, Required, Verdict, judged_as
from gantryctl.engineering.report.page import Section, render_page, render_sections, signed
from gantryctl.engineering.report.recording import ShownFigure, recorded, still
from gantryctl.engineering.report.text import TextTable, or_dash
from gantryctl.units import Dial

TEMPLATE: Final = Path(__file__).parent / "templates" / "accuracy.html.j2"
SWITCH_NAMES: Final = {
    "gear_error": "gear error",
    "backlash": "backlash",
    "hysteresis": "hysteresis",
    "roller_friction": "roller friction",
    "motor_friction": "motor friction",
    "eccentric_moment": "eccentric moment",
    "base": "rocking base",
    "torque_ripple": "torque ripple",
    "three_slopes": "three-slope stiffness",
    "tooth_pitch": "single teeth",
    "thermal": "temperatures",
    "ageing": "breakaway after rest",
    "encoder_errors": "errors of the motor encoder",
    "cable": "cable chain",
    "second_pinion": "second pinion",
    "rigid": "rigid (no compliance)",
}


def render_html(report: AccuracyReport, head: Head) -> str:
    """The page as text."""
    conformity = report.verdict.conformity
    word, judged = conformity.value.upper(), conformity is not Conformity.NOT_JUDGED
    verdict = Verdict(
        f"{word}: {report.required.limit:g}° required" if judged and report.required else word,
        _JUDGED.get(conformity, Judged.OPEN),
        report.verdict.text,
    )
    return render_page(TEMPLATE, head, verdict, _required(report), _view(report))


_JUDGED: Final = {Conformity.PASS: Judged.PASS, Conformity.FAIL: Judged.FAIL}


def write_report(report: AccuracyReport, head: Head, folder: str | Path) -> Path:
    """Write report.html, report.json and the measured table as table.csv; returns the path of the page."""
    folder = Path(folder)
    folder.mkdir(parents=True, exist_ok=True)
    page = folder / "report.html"
    page.write_text(render_html(report, head), encoding="utf-8")
    (folder / "report.json").write_text(report_json(report), encoding="utf-8")
    (folder / "table.csv").write_text(format_error_table(report.measured), encoding="utf-8")
    return page


def _view(report: AccuracyReport) -> dict[str, Any]:
    """View for the template: words and numbers, no logic."""
    iso = report.iso
    paper_rms = statistics(PAPER_TABLE).rms_deg if report.of_reference else {}
    return {
        "report": report,
        "coverage": COVERAGE_K,
        "angle": _angle,
        "paper_name": PAPER_NAME if report.of_reference else "",
        "speed_required": report.speed[0].required if report.speed else None,
        "tiles": _tiles(report),
        "asked": _asked(report),
        "tables": [
            (title, _table_view(table, report.beside, report.dial))
            for title, table in (("without instrument noise", report.true), ("as measured", report.measured))
            if table is not None and not (title == "as measured" and report.measured == report.true)
        ],
        "paper_printed": _paper_printed(report.table)
        if report.beside and report.beside.table is PAPER_TABLE
        else "",
        "budget": report.budget,
        "budget_rows": [] if report.budget is None else budget_rows(report.budget),
        "budget_freedom": "" if report.budget is None else freedom_text(report.budget.degrees_of_freedom),
        "iso": iso,
        "iso_rows": _iso_rows(report),
        "noise": [
            (name, distribution)
            for name, distribution in (
                ("A as measured", report.a_measured),
                ("A of a perfect axis: noise alone", report.a_floor),
                ("A of a perfect axis: uncertainty alone", report.uncertainty and report.uncertainty.floor),
            )
            if distribution is not None
        ],
        "bases": [
            (
                signed(f"{report.dial.text(base)}°"),
                rms,
                *report.statistics.range_deg[base],
                paper_rms.get(base),
            )
            for base, rms in report.statistics.rms_deg.items()
        ],
        "figures": _figures(report),
        "switches": [(SWITCH_NAMES.get(name, name), on) for name, on in report.switches.items()],
    }


def _required(report: AccuracyReport) -> list[Required]:
    """What the machine must keep: its angle, and its speeds where they were tested."""
    found, required = report.verdict, report.required
    if required is None:
        return []
    limit = f"at most {required.limit:g} deg"
    rows = [
        Required(
            name,
            limit,
            f"{value:.4f} {plus_minus(found.uncertainties_deg.get(name))}deg",
            _JUDGED.get(
                conformity_of(value, found.uncertainties_deg.get(name, 0.0), required.limit), Judged.OPEN
            ),
        )
        for name, value in found.figures_deg.items()
    ]
    if not rows:
        rows.append(Required("accuracy of the angle", limit, "not measured at the load", Judged.OPEN))
    if report.speed:
        rows += _required_speed(report.speed)
    return rows


def _required_speed(runs: Sequence[SpeedRun]) -> list[Required]:
    worst = max(run.motor_error_deg_s for run in runs)
    kept = None if any(run.motor_within is None for run in runs) else all(run.motor_within for run in runs)
    least = min(run.reached_deg_s / run.speed_deg_s for run in runs)
    return [
        Required(
            "part of each speed that is reached",
            "at least 99.9 %",
            f"{100.0 * least:.2f} %",
            judged_as(all(run.reached for run in runs)),
        ),
        Required(
            "speed error of the motor side over whole moves",
            f"at most {runs[0].required.limit:g} deg/s",
            f"{worst:.4f} deg/s",
            judged_as(kept),
        ),
    ]


def _why_failed(run: SpeedRun) -> str:
    why = "motor side above the limit" if run.reached else "speed not reached"
    return f"{run.speed_deg_s:g} deg/s {run.direction.value}: {why}"


def render_speed_test(runs: Sequence[SpeedRun], head: Head) -> str:
    """The page of a speed test alone."""
    failed = [run for run in runs if not run.passed]
    motor = (
        "every motor-side error is within the limit" if all(run.motor_judged for run in runs) else NOT_JUDGED
    )
    verdict = Verdict(
        "FAIL" if failed else "PASS",
        judged_as(not failed),
        "; ".join(map(_why_failed, failed)) or f"every speed is reached, {motor}",
    )
    rows = [
        {
            "asked\ndeg/s": f"{run.speed_deg_s:g}",
            "way": run.direction.value,
            "from\ndeg": signed(run.ends_read[0]),
            "to\ndeg": signed(run.ends_read[1]),
            "reached\ndeg/s": f"{run.reached_deg_s:.3f}",
            "error, motor side\ndeg/s": f"{run.motor_error_deg_s:.4f}",
            "error, load side\ndeg/s": or_dash(run.load_error_deg_s, ".4f"),
            "": ("pass" if run.passed else "FAIL") + (", stick-slip" if run.stick_slip else ""),
        }
        for run in runs
    ]
    table = TextTable.of("", rows)._replace(left=(1, 7))
    shown = [
        recorded(figures.speed_test(run), f"speed-{k}", _way(run)) for k, run in enumerate(runs) if run.curves
    ]
    return render_sections(
        head,
        verdict,
        _required_speed(runs),
        title=f"Speed test of {head.machine}",
        subtitle="Largest speed error over whole moves; the load side is reported, not judged",
        sections=[Section("", tables=[table]), Section("Moves", figures=shown)],
    )


def _way(run: SpeedRun) -> str:
    way = signed("{}° to {}°".format(*run.ends_read))
    return f"{run.speed_deg_s:g}°/s {run.direction.value}, {way}"


def _iso_rows(report: AccuracyReport) -> list[tuple[str, str, list[str]]]:
    """Symbol, name, and the value (true first where it is known)."""
    if report.iso.not_computable is not None:
        return []
    sides = [report.iso_measured] if report.true is None else [report.iso, report.iso_measured]
    return [
        (symbol, name, [signed(iso_text(attribute, side)) for side in sides])
        for attribute, symbol, name in ISO_NAMES
    ]


def _tiles(report: AccuracyReport) -> list[tuple[str, str, str]]:
    """The figures at the top: value, name, remark."""
    figures_ = report.statistics
    tiles = []
    if report.true is not None:
        tiles.append((f"{figures_.a_deg:.4f}°", "A", f"{report.origin.value}, no instrument"))
    tiles.append((f"{report.a_as_measured_deg:.4f}°", "A as measured", _measured_remark(report)))
    if report.simulated is not None:
        tiles.append(
            (f"{statistics(report.simulated).a_deg:.4f}°", "A of the model", "simulated, true angles")
        )
    if report.of_reference:
        tiles.append((f"{PAPER_A_DEG:.4f}°", "A of the paper", "comparison, no criterion"))
    if figures_.a_by_direction_deg is not None:
        tiles.append((f"{figures_.a_by_direction_deg:.4f}°", "directions apart", "3 s in each direction"))
    if report.angle_errors_deg is not None:
        worst = max(abs(error) for error in report.angle_errors_deg)
        tiles.append((f"{worst:.4f}°", "largest angle error", "reading minus target, any stop"))
    if report.speed:
        worst_speed = max(run.motor_error_deg_s for run in report.speed)
        tiles.append(
            (
                f"{worst_speed:.4f}°/s",
                "speed error, motor side",
                f"limit {report.speed[0].required.limit:g}°/s",
            )
        )
    return tiles


def _measured_remark(report: AccuracyReport) -> str:
    if report.uncertainty is not None:
        return f"{report.origin.value}, ± {COVERAGE_K * report.uncertainty.a_deg:.4f}° (k = {COVERAGE_K:g})"
    if report.a_measured is None:
        return f"{report.origin.value}, one table"
    return f"{report.a_measured.low_deg:.4f} .. {report.a_measured.high_deg:.4f} in 90 % of draws"


def _asked(report: AccuracyReport) -> list[tuple[str, str]]:
    rows = [("Readings", f"{report.origin.value}: {report.source}")]
    if report.required is not None:
        rows.append(("Required", f"{report.required.limit:g}°, by {report.required.origin}"))
    procedure = report.procedure
    if procedure is not None:
        bases = signed(", ".join(f"{report.dial.text(base)}°" for base in procedure.bases_deg))
        steps = ", ".join(f"{d:g}°" for d in procedure.displacements_deg)
        rows += [
            ("Chord procedure", f"{procedure.name}; chords from the {_CHORD_NAMES[procedure.chord.value]}"),
            ("Bases", bases),
            ("Displacements", f"{steps}, counter-clockwise and clockwise"),
            ("Runs", f"{procedure.runs}; {len(procedure.stops)} stops, one after another"),
        ]
    if report.dwell_s is not None and report.average_s is not None:
        rows.append(("Dwell", f"{report.dwell_s:g} s, reading = mean of the last {report.average_s:g} s"))
    if report.radius_m is not None:
        noise = (
            "" if report.sigma_m is None else f", noise {report.sigma_m * 1e6:g} µm per coordinate (1 sigma)"
        )
        rows.append(("Instrument", f"chord radius {report.radius_m:g} m{noise}"))
    if report.vel_max_deg_s is not None and report.acc_deg_s2 is not None:
        rows.append(("Profile limits", f"{report.vel_max_deg_s:g}°/s, {report.acc_deg_s2:.4g}°/s²"))
    return rows + list(report.settings.items())


_CHORD_NAMES: Final = {"base": "base", "adjacent": "stop before (single steps)"}


def _table_view(table: ErrorTable, beside: Beside | None, dial: Dial) -> dict[str, Any]:
    """Rows of one table beside another's where base, direction and displacements are the same."""
    other = beside.table if beside and table.displacements_deg == beside.table.displacements_deg else None
    others: dict[tuple[float, Direction], list[float]] = {}
    if other is not None:
        reference = other.mean_of_runs()
        others = dict(zip([row[:2] for row in reference.rows], reference.errors_deg.tolist(), strict=True))
    shown = table.mean_of_runs()
    rows = [
        {
            "name": signed(f"{dial.text(row.base_deg)} {row.direction.value}"),
            "errors": errors[1:],
            "others": others.get(row[:2], [])[1:],
            "first_of_base": index == 0 or shown.rows[index - 1].base_deg != row.base_deg,
        }
        for index, (row, errors) in enumerate(zip(shown.rows, shown.errors_deg.tolist(), strict=True))
    ]
    theirs = None if other is None else statistics(other)
    return {
        "columns": [f"{d:g}°" for d in table.displacements_deg[1:]],
        "beside": beside.name if beside and other is not None else "",
        "runs": table.runs,
        "rows": rows,
        "statistics": _statistics_view(statistics(table), theirs),
        "a": statistics(table).a_deg,
        "other_a": None if theirs is None else theirs.a_deg,
    }


def _statistics_view(
    ours: TableStatistics, other: TableStatistics | None
) -> list[tuple[str, list[float], list[float]]]:
    return [
        (signed(name), list(getattr(ours, key)[1:]), list(getattr(other, key)[1:]) if other else [])
        for name, key in STATISTICS
    ]


def _paper_printed(table: ErrorTable) -> str:
    """Note on the paper's printed statistics, which differ from those of its rows."""
    if table.displacements_deg != PAPER_TABLE.displacements_deg:
        return ""
    mean = ", ".join(f"{value:.4f}" for value in PAPER_MEAN_DEG[1:])
    three_s = ", ".join(f"{value:.4f}" for value in PAPER_THREE_S_DEG[1:])
    # Shown beside the printed values, because the last digits differ.
    lower = signed(f"{PAPER_LOWER_DEG:.4f}")
    return (
        f"The paper's statistics are computed here from its six printed rows. It prints X = {mean}, "
        f"3 S = {three_s}, largest X + 3 S {PAPER_UPPER_DEG:.4f}, smallest X − 3 S {lower}: the same within "
        "the rounding of the rows."
    )


def _figures(report: AccuracyReport) -> dict[str, ShownFigure]:
    """The figures by name; those without data are left out."""
    free = "" if report.true is None else ", without instrument noise"
    made = {
        "errors": still(
            figures.chord_errors(report.table, report.beside, report.dial),
            "errors",
            f"{'Figure 6 of the paper: chord' if report.of_reference else 'Chord'} error by displacement from each base"
            f"{free}; positive = moved too far. Filled: {report.origin.value}."
            + ("" if report.beside is None else f" Open, dashed: {report.beside.name}."),
        ),
        "bands": still(
            figures.bands(report.table, report.beside),
            "bands",
            "Mean X and band X ± 3 S of every column. A is the distance of the two red lines: largest X + 3 S "
            "minus smallest X − 3 S, the zero column included. S: sample standard deviation (n − 1) of "
            f"{report.statistics.n} rows here.",
        ),
    }
    with_curves = [run for run in report.speed if run.curves is not None]
    if with_curves:
        fastest = max(with_curves, key=lambda run: run.speed_deg_s)
        made["speed"] = recorded(
            figures.speed_test(fastest),
            "speed",
            f"{'Figure 5 of the paper: ' if report.of_reference else ''}{_way(fastest)}. Above the speeds, below their "
            "difference from the reference.",
        )
    if len(with_curves) > 1:
        made["speed_all"] = recorded(
            figures.speed_errors(with_curves),
            "speed_all",
            f"Speed errors of all runs, motor side and load side; dashed red: "
            f"±{report.speed[0].required.limit:g}°/s.",
        )
    if report.ensemble is not None:
        fitted = report.statistics.a_deg if report.phases_fitted else None
        gears = report.ensemble
        made["ensemble"] = still(
            figures.ensemble(gears, fitted, with_paper=report.of_reference),
            "ensemble",
            "A of the true angles for gears of the same grade whose error phases are drawn at random (seeds "
            f"{min(gears.seeds)} to {max(gears.seeds)}): median {gears.distribution.median_deg:.4f}°, "
            f"{min(gears.a_deg):.4f}° to {max(gears.a_deg):.4f}°.",
        )
    return made


def _angle(value: float | None) -> str:
    """An angle for the page: sign, four decimals."""
    return "–" if value is None else signed(angle_text(value).strip())
