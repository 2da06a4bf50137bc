"""The attended chord test: killed between any two steps, it goes on, loses no reading and ends with the same table."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from gantryctl.engineering.accuracy.attended import run as attended
from gantryctl.engineering.accuracy.attended.run import AttendedTest
from gantryctl.engineering.accuracy.attended.session import (
    ChordOrder,
    ChordSession,
    load_session,
    measured_stops,
    new_session,
    session_path,
    session_to_go_on_with,
)
from gantryctl.engineering.accuracy.procedure.plan import chord_plan
from gantryctl.engineering.accuracy.procedure.procedures import Chord, chord_procedure, evaluate
from gantryctl.engineering.instruments import Reading
from gantryctl.errors import InstrumentError, StateError, UsageError
from gantryctl.machine import Machine, default_machine, with_values
from gantryctl.operation.client import Stop
from gantryctl.operation.run import AxisRun
from gantryctl.operation.store import StateStore

# Short chords and dwells: what is tested is the order of things, not the gantry.
MACHINE = with_values(
    default_machine(),
    {
        "drive.kind": "ideal",
        "control.scan_period_ms": 10.0,
        "accuracy.dwell_s": 0.3,
        "accuracy.average_s": 0.1,
    },
)
OUT_AND_BACK = chord_procedure("B", bases_deg=(0.0,), displacements_deg=(2.0,))
SHORT = replace(OUT_AND_BACK, stops=OUT_AND_BACK.stops[:3])
"""0, 2, 0 deg."""
ORDER = ChordOrder(chord_plan(MACHINE), "B", 1, Chord.BASE)
U_DEG = 0.0002
# The ideal drive comes to a stop within a few of its counts, 2.6e-7 deg each at the gantry.
SAME_DEG = 1e-5


@pytest.fixture(autouse=True)
def short_procedure(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(ChordOrder, "made", lambda self: SHORT)


class Killed(BaseException):
    """As by SIGKILL: nothing after it is done."""


class Level:
    """Reads the motor angle, 3 % too large and from a zero of its own; it may be killed, moved or spoilt."""

    name = "level"

    def __init__(self, run: AxisRun | None = None) -> None:
        self.run, self.zero_deg, self.spoilt = run, 77.0, []

    def read(self, time_s: float) -> Reading:
        assert self.run is not None
        if self.spoilt:
            raise InstrumentError(self.spoilt.pop())
        return Reading(self.zero_deg + 1.03 * self.run.angle_deg, U_DEG)


@contextmanager
def opened(
    machine: Machine, root: Path, level: Level, order: ChordOrder = ORDER, said: list[str] | None = None
) -> Iterator[AttendedTest]:
    with StateStore(machine, root) as store:
        path = session_path(store)
        session = session_to_go_on_with(path, machine, order) or new_session(machine, order)
        run = level.run = AxisRun(machine, store)
        try:
            yield AttendedTest(run, session, path, level, [].append if said is None else said.append)
        finally:
            run.close("test")


def whole(root: Path) -> ChordSession:
    with opened(MACHINE, root, Level()) as test:
        return test.go_on()


def angles(session: ChordSession | None) -> list[float]:
    return [r.angle_deg for r in session.readings] if session is not None else []


def test_every_stop_that_a_chord_needs_is_read(tmp_path: Path) -> None:
    session = whole(tmp_path)
    assert session.complete
    assert [r.stop for r in session.readings] == list(measured_stops(SHORT)) == [0, 1, 2]
    assert angles(session) == pytest.approx([77.0, 79.06, 77.0], abs=1e-4)
    assert [r.motor_deg for r in session.readings] == pytest.approx([0.0, 2.0, 0.0], abs=1e-4)
    assert set(session.uncertainties_deg()) == {U_DEG}
    # In procedure A every series begins with a stop that is only passed.
    assert measured_stops(chord_procedure("A"))[:6] == (1, 2, 3, 4, 5, 7)
    # Killed before its report was written: nothing is read again.
    with StateStore(MACHINE, tmp_path) as store:
        assert session_to_go_on_with(session_path(store), MACHINE, ORDER) == session


def steps(monkeypatch: pytest.MonkeyPatch, kill_at: int) -> list[str]:
    """Count moves, dwells, readings and writes, before and after each; at one of them, be killed."""
    done: list[str] = []

    def step(name: str) -> None:
        if len(done) == kill_at:
            raise Killed
        done.append(name)

    def around(owner: object, name: str) -> None:
        inner = getattr(owner, name)

        def wrapped(*args: object, **values: object) -> object:
            step(f"before {name}")
            result = inner(*args, **values)
            step(f"after {name}")
            return result

        monkeypatch.setattr(owner, name, wrapped)

    around(AxisRun, "move")
    around(AttendedTest, "_settled_deg")
    around(Level, "read")
    around(attended, "store_session")
    return done


def test_a_kill_between_any_two_steps_loses_no_reading(tmp_path: Path) -> None:
    expected = angles(whole(tmp_path / "whole"))
    with pytest.MonkeyPatch.context() as patch:
        counted = steps(patch, -1)
        whole(tmp_path / "counted")
    count = len(counted)
    assert count == 2 * 3 * 4
    for kill_at in range(count):
        root = tmp_path / str(kill_at)
        with pytest.MonkeyPatch.context() as patch:
            done = steps(patch, kill_at)
            with pytest.raises(Killed), opened(MACHINE, root, Level()) as test:
                test.go_on()
            written = done.count("after store_session")
        with StateStore(MACHINE, root) as store:
            kept = load_session(session_path(store))
        before = angles(kept)
        # A kill between the rename on the disk and the return keeps one reading more than was told.
        assert len(before) in (written, done.count("before store_session"))
        assert before == pytest.approx(expected[: len(before)], abs=SAME_DEG)
        said: list[str] = []
        with opened(MACHINE, root, Level(), said=said) as test:
            again = test.go_on()
        assert angles(again) == pytest.approx(expected, abs=SAME_DEG)
        assert again.readings[: len(before)] == (kept.readings if kept is not None else ())
        # The instrument is checked where something had been read and something was left.
        assert len(again.checks) == (0 < len(before) < len(expected))


def begun(root: Path, readings: int) -> None:
    """A test that has as many readings."""
    with opened(MACHINE, root, Level()) as test:
        keep = test._keep

        def until(session: ChordSession) -> None:
            keep(session)
            if len(session.readings) == readings:
                test._run.stop = Stop.RAMP

        test._keep = until  # type: ignore[method-assign]
        assert not test.go_on().complete


def test_the_operator_stops_it_and_it_goes_on(tmp_path: Path) -> None:
    begun(tmp_path, 2)
    said: list[str] = []
    with opened(MACHINE, tmp_path, Level(), said=said) as test:
        assert test.go_on().complete
    # Back over the base, so that 2 deg is reached from the same side; then what was left.
    assert said == [
        "stop 1 of 3: 0.0 deg", "stop 2 of 3: 2.0 deg", "reads 2 deg again: has the instrument moved?",
        "stop 3 of 3: 0.0 deg",
    ]  # fmt: skip


@pytest.mark.parametrize("by_deg", [0.01, -0.01])
def test_an_instrument_that_was_moved_is_found(tmp_path: Path, by_deg: float) -> None:
    begun(tmp_path, 1)
    moved = Level()
    moved.zero_deg += by_deg
    with (
        opened(MACHINE, tmp_path, moved) as test,
        pytest.raises(InstrumentError, match="the instrument has moved"),
    ):
        test.go_on()
    with opened(MACHINE, tmp_path, Level()) as test:
        assert test.go_on().complete


def test_an_instrument_that_fails_is_asked_again_and_then_ends_the_test(tmp_path: Path) -> None:
    level, said = Level(), []
    level.spoilt = ["beam interrupted"] * 2
    with opened(MACHINE, tmp_path, level, said=said) as test:
        assert test.go_on().complete
    assert said.count("beam interrupted · asked again") == 2
    level = Level()
    level.spoilt = ["beam interrupted"] * 3
    with (
        opened(MACHINE, tmp_path / "b", level) as test,
        pytest.raises(InstrumentError, match="beam interrupted"),
    ):
        test.go_on()


@pytest.mark.parametrize("factor", [-1.0, 0.01745, 60.0])
def test_another_sign_or_unit_is_found_at_the_second_reading(factor: float) -> None:
    """Counting backwards, radians, minutes of arc."""
    session = new_session(MACHINE, ORDER).with_reading(0, Reading(77.0, U_DEG), 0.0)
    with pytest.raises(InstrumentError, match="check its sign"):
        session.with_reading(1, Reading(77.0 + factor * 2.0, U_DEG), 2.0)


def test_another_order_or_configuration_does_not_go_on_with_it(tmp_path: Path) -> None:
    begun(tmp_path, 1)
    with StateStore(MACHINE, tmp_path) as store:
        path = session_path(store)
        with pytest.raises(UsageError, match="another procedure"):
            session_to_go_on_with(path, MACHINE, replace(ORDER, runs=5))
        with pytest.raises(UsageError, match="another configuration"):
            session_to_go_on_with(path, with_values(MACHINE, {"control.kpp_per_s": 9.0}), ORDER)
        path.write_text("{", encoding="utf-8")
        with pytest.raises(StateError, match="--again begins the test anew"):
            session_to_go_on_with(path, MACHINE, ORDER)


def test_the_angles_make_the_table(tmp_path: Path) -> None:
    session = whole(tmp_path)
    table = evaluate(SHORT, np.radians(session.angles_deg()), 1.0)
    # 3 % of 2 deg.
    assert table.errors_deg[0, 1] == pytest.approx(0.06, abs=1e-4)
