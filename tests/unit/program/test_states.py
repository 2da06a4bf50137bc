"""The transition table, cell by cell, against a second way of writing it down."""

import itertools

import pytest

from gantryctl.program import AxisProgram, AxisState, BrakeTestPhase, PowerPhase
from gantryctl.program.axis.states import AxisEvents, next_state
from unit.program.rig import Rig

S = AxisState
MOTIONS = [S.HOMING, S.DISCRETE_MOTION, S.CONTINUOUS_MOTION, S.SYNCHRONIZED_MOTION]


def expected(state: AxisState, events: AxisEvents) -> AxisState:
    """PLCopen Part 1, figure of the axis states, as rules of precedence."""
    if events.error:
        return S.ERROR_STOP
    if not events.powered:
        return S.DISABLED
    if state in (S.DISABLED, S.ERROR_STOP):
        return S.STANDSTILL
    if events.stop_held:
        return S.STOPPING
    if state is S.STOPPING:
        return S.STANDSTILL
    return events.motion or S.STANDSTILL


@pytest.mark.parametrize("state", list(S))
@pytest.mark.parametrize("motion", [None, *MOTIONS])
def test_every_cell(state: AxisState, motion: AxisState | None) -> None:
    for error, powered, stop in itertools.product([False, True], repeat=3):
        events = AxisEvents(error, powered, stop, motion)
        assert next_state(state, events) is expected(state, events), events


def test_error_stop_is_left_only_without_an_error() -> None:
    for powered, stop in itertools.product([False, True], repeat=2):
        assert next_state(S.ERROR_STOP, AxisEvents(True, powered, stop, None)) is S.ERROR_STOP


def test_one_transition_a_scan() -> None:
    """A motion accepted in the scan in which power comes on shows one scan after Standstill."""

    class Eager(AxisProgram):
        def __init__(self, axis):
            super().__init__(axis)
            self.seen = []

        def logic(self, image):
            if not self.seen:
                self.axis.power_on()
            if self.axis.power.status and self.axis.motion.current is None and S.STANDSTILL not in self.seen:
                self.axis.motion.move_absolute(0.1, 0.05)
            self.seen.append(self.axis.state)

    rig = Rig(Eager)
    rig.run(2.0)
    seen = [state for state, _ in itertools.groupby(rig.program.seen)]
    assert seen == [S.DISABLED, S.STANDSTILL, S.DISCRETE_MOTION]


@pytest.mark.parametrize(("kind", "count"), [(AxisState, 8), (PowerPhase, 15), (BrakeTestPhase, 8)])
def test_recordings_and_pages_hold_the_number_of_a_state_and_it_stays_what_it_is(kind, count):
    assert [state.value for state in kind] == list(range(count))
