"""Choice of a motor and a grade of the teeth: the smallest that fits, the coarsest that keeps the required angle."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

from gantryctl.engineering.drafting.draft import Draft, draft
from gantryctl.engineering.drafting.open_items import GearsOfGrade
from gantryctl.engineering.drafting.origin import Origin, Values, guessed
from gantryctl.engineering.sizing.checks import Fit, fit
from gantryctl.engineering.sizing.motors import MotorFile
from gantryctl.engineering.sizing.sheet import Sheet
from gantryctl.engineering.stops import check_quick_stop
from gantryctl.errors import ConfigError

# Of motors that do not fit: a person reads why of so many.
_NEAREST: Final = 3


def draft_with(sheet: Sheet, motors: Sequence[MotorFile], name: str) -> Draft:
    """Draft a machine with the motor of the smallest rated power that does it, by its loop as well if there is one.

    Args:
        sheet: what the axis must do. motors: to choose from. name: of the machine.

    Raises:
        ConfigError: none does it: what the rules of a machine say about the first that fits, or what is worst of those
            that come nearest.
    """
    unfit: list[Fit] = []
    refused: list[str] = []
    soft: Draft | None = None
    for motor in sorted(motors, key=lambda motor: (motor.motor.power_rated_kw, motor.name)):
        fitted = fit(sheet, motor)
        if not fitted.fits:
            unfit.append(fitted)
            continue
        try:
            made = draft(fitted, name)
            check_quick_stop(made.machine())
        except ConfigError as wrong:
            # The first says it: what a rule refuses with one motor it refuses with most.
            refused = refused or [f"{motor.name}: {problem}" for problem in wrong.problems]
            continue
        if made.soft_loop is None:
            return made
        soft = soft or made
    if soft is not None:
        return soft
    raise ConfigError(refused or _nearest(sheet, unfit))


def _nearest(sheet: Sheet, unfit: Sequence[Fit]) -> list[str]:
    """What the motors lack that come nearest, and what may be done."""
    nearest = sorted(unfit, key=lambda fitted: fitted.tightest.part)[:_NEAREST]
    told = [f"{each.motor.name} does not fit {sheet.sheet.name}: {each.reasons[0]}" for each in nearest]
    more = (
        f"{len(unfit)} motors were tried, these come nearest"
        if len(unfit) > len(nearest)
        else "no motor is left"
    )
    return [*told, f"{more}: change the answers or the sheet, or name another motor by --motor FILE"]


GRADE: Final = "teeth.grade"


def with_enough_grade(sheet: Values, gears: GearsOfGrade) -> Values | None:
    """The values of a sheet with the grade that keeps the required angle; None where the grade stands.

    It stands where it keeps the angle, where none does, and where it is no guess: a person who names a grade has one.
    """
    if gears.kept or gears.enough is None or sheet[GRADE].origin is not Origin.GUESS:
        return None
    rule = (
        f"the coarsest of which 95 % of {gears.gears} gears keep {gears.required_deg:g} deg; "
        f"usual is {gears.drafted.grade:g}"
    )
    return sheet | {GRADE: guessed(gears.enough.grade, rule)}
