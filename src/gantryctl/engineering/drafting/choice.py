"""Choice of a motor for a sheet: the smallest that fits, with a machine that every rule and the full plant accept."""

from __future__ import annotations

from collections.abc import Sequence

from gantryctl.engineering.drafting.draft import Draft, draft
from gantryctl.engineering.sizing.checks import fit
from gantryctl.engineering.sizing.motors import MotorFile
from gantryctl.engineering.sizing.sheet import Sheet
from gantryctl.engineering.stops import check_quick_stop
from gantryctl.errors import ConfigError


def draft_with(sheet: Sheet, motors: Sequence[MotorFile], name: str) -> Draft:
    """Draft a machine with the motor of the smallest rated power that does it.

    Args:
        sheet: what the axis must do. motors: to choose from. name: of the machine.

    Raises:
        ConfigError: none does it: what the rules of a machine say about the first that fits, or what is worst of each.
    """
    unfit: list[str] = []
    refused: list[str] = []
    for motor in sorted(motors, key=lambda motor: (motor.motor.power_rated_kw, motor.name)):
        fitted = fit(sheet, motor)
        if not fitted.fits:
            unfit.append(f"{motor.name} does not fit {sheet.sheet.name}: {fitted.reasons[0]}")
            continue
        try:
            made = draft(fitted, name)
            check_quick_stop(made.machine())
        except ConfigError as wrong:
            # The first says it: what a rule refuses with one motor it refuses with most.
            refused = refused or [f"{motor.name}: {problem}" for problem in wrong.problems]
            continue
        return made
    raise ConfigError(refused or unfit)
