"""The report of a sizing."""

from __future__ import annotations

from collections.abc import Sequence

from gantryctl.engineering.report.head import Head, Made, Required, Verdict, judged_as
from gantryctl.engineering.report.page import Section, render_sections
from gantryctl.engineering.report.pictures import Panel, Picture, line
from gantryctl.engineering.report.recording import recorded
from gantryctl.engineering.sizing import text
from gantryctl.engineering.sizing.checks import Check, Fit
from gantryctl.engineering.sizing.train import over_angle
from gantryctl.units import behind


def render_sizing(shown: Fit, fits: Sequence[Fit], made: Made) -> str:
    """The page: every demand on the motor that is shown, and which motors fit."""
    sheet, motor = shown.train.sheet, shown.motor
    head = Head(
        sheet.sheet.name,
        (
            ("Requirement sheet", sheet.sheet.name),
            ("Description", sheet.sheet.description),
            ("Inertia of the load", f"{sheet.load.inertia_kg_m2:.6g} kg m²"),
            (
                "Transmission",
                f"{sheet.gears.reducer_ratio:g} × {sheet.gears.ring_ratio:g} = {sheet.gears.ratio:g}",
            ),
            ("Motor", f"{motor.name} ({motor.identity.source})"),
        ),
        made,
        required_source=sheet.required.source or f"requirement sheet {sheet.sheet.name}",
    )
    verdict = Verdict(
        "FITS" if shown.fits else "NO MOTOR FITS",
        judged_as(shown.fits),
        f"{motor.name} {'fits' if shown.fits else 'does not fit'}; the tightest is {shown.tightest.name}",
    )
    sentences = text.sentences(shown, fits)
    return render_sections(
        head,
        verdict,
        [_required(check) for check in shown.checks],
        title=f"Sizing of {sheet.sheet.name}",
        subtitle=f"Motors for a requirement sheet; the figures are those of {motor.name}",
        sections=[
            Section("What it means", sentences),
            Section("Torque", tables=[text.first_table(sheet), text.complete_table(shown)]),
            Section(
                "Over the angle",
                tables=[text.angle_table(shown)],
                figures=[recorded(_picture(shown), "angle")],
            ),
            Section("Further", tables=[text.further_table(shown), text.motors_table(fits)]),
        ],
    )


def _required(check: Check) -> Required:
    unit = behind(check.unit)
    return Required(
        f"{check.name} ({check.how})",
        f"at most {check.limit:.4g}{unit}",
        f"{check.used:.4g}{unit}",
        judged_as(check.fits),
    )


def _picture(shown: Fit) -> Picture:
    rows = sorted(over_angle(shown.train))
    angle_deg = [row.angle_deg for row in rows]
    curves = {
        "hold": [row.hold for row in rows],
        "turn out": [row.steady for row in rows],
        "turn back": [row.back for row in rows],
        "normal acceleration": [row.normal for row in rows],
        "sizing acceleration": [row.sizing for row in rows],
    }
    lines = tuple(line(name, angle_deg, values) for name, values in curves.items())
    return Picture("Motor torque over the angle", (Panel("angle, deg", "motor torque, N m", lines),))
