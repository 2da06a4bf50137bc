"""Rules of a draft by hand: each on a basis of the few numbers that it needs."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import pytest

from gantryctl.engineering.drafting import choice
from gantryctl.engineering.drafting.draft import _accuracy


def test_a_draft_dwells_for_twelve_swings_and_averages_the_last_four() -> None:
    """Of a mode of 2 Hz 6 and 2 s."""
    sheet = SimpleNamespace(
        structure=SimpleNamespace(first_mode_hz=2.0),
        required=SimpleNamespace(angle_deg=0.1),
        teeth=SimpleNamespace(ring_radius_m=2.4),
    )
    basis: Any = SimpleNamespace(sheet=sheet)
    found = _accuracy(basis)
    assert (found["accuracy.dwell_s"].value, found["accuracy.average_s"].value) == (6.0, 2.0)


@pytest.mark.parametrize(("stiff", "taken"), [(3.0, 3.0), (None, 1.0)])
def test_of_motors_whose_loop_is_too_soft_the_smallest_is_drafted(
    monkeypatch: pytest.MonkeyPatch, stiff: float | None, taken: float
) -> None:
    """1, 2 and 3 kW fit, in any order: the first that is stiff enough, and the smallest where none is."""

    def drafted(fitted: Any, name: str) -> Any:
        power_kw = fitted.motor.motor.power_rated_kw
        return SimpleNamespace(
            power_kw=power_kw, machine=lambda: None, soft_loop=None if power_kw == stiff else "soft"
        )

    monkeypatch.setattr(choice, "fit", lambda _, motor: SimpleNamespace(fits=True, motor=motor))
    monkeypatch.setattr(choice, "draft", drafted)
    monkeypatch.setattr(choice, "check_quick_stop", lambda _: None)
    motors: Any = [
        SimpleNamespace(name=f"{power_kw} kW", motor=SimpleNamespace(power_rated_kw=power_kw))
        for power_kw in (2.0, 3.0, 1.0)
    ]
    sheet: Any = None
    made: Any = choice.draft_with(sheet, motors, "axis")
    assert made.power_kw == taken
