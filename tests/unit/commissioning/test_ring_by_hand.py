"""The ring against the motor by hand: each way has its own ratio, and what is left after both is slip."""

from __future__ import annotations

import pytest

from gantryctl.commissioning.load_side.ring import _judged, _Standing
from unit.commissioning.hand_drive import MACHINE


def test_each_way_has_its_own_ratio() -> None:
    """Motor 0, 10, 0 deg; ring 0, 10, 5 deg: 1 forward, 0.5 back, 5 deg of slip."""
    found = _judged(MACHINE, _Standing(0.0, 0.0), _Standing(10.0, 10.0), _Standing(0.0, 5.0))
    names = ("ratio_forward", "ratio_back", "slip_deg")
    assert [found.number(name) for name in names] == pytest.approx([1.0, 0.5, 5.0])
