"""The two tunings that many tests look at; each takes some seconds, so once."""

import pytest

from gantryctl.engineering.tuning.result import MARGINS_METHOD, TRIALS_METHOD, tune
from gantryctl.machine import default_machine


@pytest.fixture(scope="session")
def parts() -> dict[str, list[float]]:
    """What a person is told of each method: the part that is done."""
    return {TRIALS_METHOD: [], MARGINS_METHOD: []}


@pytest.fixture(scope="session")
def as_paper(parts):
    """The paper's procedure on the axis that the paper's drive saw."""
    return tune(default_machine(), TRIALS_METHOD, as_paper=True, watch=parts[TRIALS_METHOD].append)


@pytest.fixture(scope="session")
def designed(parts):
    """Gains by margins for the machine as it is configured."""
    return tune(default_machine(), MARGINS_METHOD, watch=parts[MARGINS_METHOD].append)
