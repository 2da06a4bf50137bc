"""The two tunings that many tests look at; each takes some seconds, so once."""

import pytest

from gantryctl.engineering.tuning.result import MARGINS_METHOD, TRIALS_METHOD, tune
from gantryctl.machine import default_machine


@pytest.fixture(scope="session")
def as_paper():
    """The paper's procedure on the axis that the paper's drive saw."""
    return tune(default_machine(), TRIALS_METHOD, as_paper=True)


@pytest.fixture(scope="session")
def designed():
    """Gains by margins for the machine as it is configured."""
    return tune(default_machine(), MARGINS_METHOD)
