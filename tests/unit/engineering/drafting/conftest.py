"""A draft of every template, made once."""

import functools

import pytest

from gantryctl.engineering.drafting.choice import draft_with
from gantryctl.engineering.drafting.sheets import Answered, drafted_sheet, sheet_values
from gantryctl.engineering.drafting.templates import load_template
from gantryctl.engineering.sizing.motors import delivered_motors, load_motors


@functools.cache
def _made(template):
    values = sheet_values(Answered.of(load_template(template), {}), f"my_{template}")
    return draft_with(drafted_sheet(values, "sheet"), load_motors(delivered_motors()), f"my_{template}")


@pytest.fixture(scope="session")
def made():
    """Template's name to the draft with the smallest motor that does it."""
    return _made
