"""Outcome of a step, by hand: its proof and its figures against their limits."""

from __future__ import annotations

import pytest

from gantryctl.commissioning.results import Figure, Outcome, failed, judged, passed

pytestmark = pytest.mark.can


@pytest.mark.parametrize(
    ("ok", "first", "second", "passes"),
    [(True, 1.0, 1.0, True), (False, 1.0, 1.0, False), (True, 2.0, 1.0, False), (True, 1.0, 2.0, False)],
)
def test_a_step_passes_by_its_proof_and_by_every_figure(
    ok: bool, first: float, second: float, passes: bool
) -> None:
    found = judged(ok, "k", "", "", a=Figure(first, high=1.5), b=Figure(second, high=1.5))
    assert (found.outcome is Outcome.PASSED) is passes


def test_what_has_failed_has_failed_whatever_its_figures_say() -> None:
    found = failed("k", "slipped", "call service", moved_deg=Figure(0.01, high=0.02))
    assert (found.outcome, found.to_do) == (Outcome.FAILED, "call service")
    good = passed("k", "held", moved_deg=Figure(0.01, high=0.02))
    assert (good.outcome, good.to_do) == (Outcome.PASSED, "")
    assert passed("k", "held", moved_deg=Figure(0.03, high=0.02)).outcome is Outcome.FAILED
