"""The chord test of commissioning is judged by what the machine requires, not by a limit of its own."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import cast

import pytest

from gantryctl.commissioning.load_side.chord_test import _judged, order_of
from gantryctl.commissioning.results import Context, Outcome
from gantryctl.engineering.accuracy.attended.session import StopReading, measured_stops, new_session
from gantryctl.engineering.report.pictures import Picture
from gantryctl.machine import default_machine, with_values


@pytest.mark.parametrize(
    ("angle_deg", "outcome"),
    # A, 1.4 times 0.0197 deg, is known to 0.0001 deg: neither is proven, so it has not passed.
    [(0.1, Outcome.PASSED), (0.01, Outcome.FAILED), (0.02765, Outcome.FAILED)],
)
def test_the_same_readings_pass_and_fail_by_the_requirement(
    angle_deg: float, outcome: Outcome, tmp_path: Path
) -> None:
    """Chord errors of +-0.003 deg, A of 0.02 deg with the ratio of the short test: within 0.1 deg, not within 0.01."""
    changes = {"required.angle_deg": angle_deg, "required.source": "tender 4711"}
    machine = with_values(default_machine(), changes)
    session = new_session(machine, order_of(machine))
    stops = session.procedure.stops
    readings = tuple(
        StopReading(k, stops[k].target_deg, stops[k].target_deg + error, 1e-5, stops[k].target_deg, "now")
        for k, error in zip(measured_stops(session.procedure), (0.0, 0.003, 0.0, 0.003) * 4, strict=False)
    )
    session = replace(session, instruments=("tracker",), readings=readings)
    context = SimpleNamespace(
        machine=machine,
        folder=tmp_path,
        watch=SimpleNamespace(pictures=[]),
        store=SimpleNamespace(directory=tmp_path),
        certificate="D-K-4711",
    )
    result = _judged(cast(Context, context), session)
    assert result.outcome is outcome
    assert "required by hust_gantry (tender 4711)" in result.proof
    assert result.figures["a_deg"].high == pytest.approx(angle_deg / 1.4)
    assert result.figures["largest_chord_error_deg"].high == pytest.approx(angle_deg / 1.4)
    # A virtual gantry is watched by a simulated instrument, whatever its name.
    assert "by tracker (certificate D-K-4711), simulated" in result.proof
    # Two readings of 0.00001 deg make a chord: the root of two, and twice that.
    assert result.number("chord_expanded_uncertainty_deg") == pytest.approx(2.828e-5, rel=1e-3)
    # Six chord errors e of +-0.003 deg: S is 0.003 deg times the root of 6 / 5, and A is 6 S.
    assert result.number("largest_chord_error_deg") == pytest.approx(0.003, rel=1e-3)
    assert result.number("a_deg") == pytest.approx(0.019718, rel=1e-4)
    # A changes with each by 6 e / (5 S), in all by the root of 36 / 5, and each is known to 1.414e-5 deg; k = 2.
    assert result.number("a_expanded_uncertainty_deg") == pytest.approx(7.589e-5, rel=1e-3)
    # In thousandths of a degree, one panel of each base.
    pictures: list[Picture] = context.watch.pictures
    assert len(pictures[0].panels) == 3
    for panel in pictures[0].panels:
        # Both ways as seen, before those of the model.
        assert [abs(curve.y[-1]) for curve in panel.lines[:2]] == pytest.approx([3.0, 3.0], rel=1e-3)
    assert "D-K-4711" in (tmp_path / "accuracy" / "report.html").read_text(encoding="utf-8")
