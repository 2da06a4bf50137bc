"""Every state that program, operator and drive can reach together, and the invariants in each of them.

Breadth first to the end, without a limit of depth: PLCopen x CiA 402 x brake x authority x interlocks x reference. The
fast tests close four small worlds; `pytest -m slow -s tests/states` closes the large ones and prints their numbers.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import pytest

from gantryctl.program import Axis, AxisState, PowerPhase, Reaction
from gantryctl.program.power.phases import OUTPUTS
from gantryctl.program.power.sequence import PowerSequence
from gantryctl.service.command import rules
from gantryctl.units import rad
from states.abstraction import RULES, Rules, without_rule
from states.brief_settings import settings
from states.exploration import Alphabet, Exploration, Found
from states.people import NOTHING, buttons, commands, without_right
from states.stub_drive import Once, Standing
from states.world import World

S = Standing
POWER_ON, POWER_OFF, MOVE, STOP, QUICK_STOP, RESET, BRAKE_TEST = buttons()


def said(*names: str) -> tuple[Any, ...]:
    """The commands of people whose words begin like this."""
    return tuple(event for event in commands() if str(event).startswith(names))


INTERLOCKS = Alphabet((POWER_ON, POWER_OFF, MOVE, QUICK_STOP, RESET), (S.ESTOP,), (Once.LEAVES,))
# A contact that says closed is in the slow tests: with it twice as many states.
BRAKE = Alphabet((POWER_ON, POWER_OFF, RESET), (S.CONTACT_OPEN,), (Once.SLIPS,))
# Its quick stop is in the interlocks; with that button three times as many states (the slow tests have it).
FEEDBACK = Alphabet((POWER_ON, POWER_OFF, MOVE, RESET), (S.ENCODER_ALARM, S.COASTS))
TEST = Alphabet((POWER_ON, POWER_OFF, STOP, RESET, BRAKE_TEST), (S.FAULT,))
PEOPLE = Alphabet(
    said(
        "operator: take",
        "operator: power",
        "operator: move 2",
        "operator: reset",
        "service: take",
        "viewer",
        "sil",
    ),
    (),
    without_right=without_right()[::2],
)
ALL_PEOPLE = Alphabet(commands(), (S.ESTOP,), without_right=without_right())


def explore(
    alphabet: Alphabet,
    *,
    parks: bool = False,
    torque_preload: bool = True,
    people: bool = False,
    stop: bool = False,
) -> Exploration:
    world = World(settings(parks=parks, torque_preload=torque_preload), people=people)
    exploration = Exploration(world, alphabet, stop_at_first=stop)
    exploration.run()
    print(exploration.found)
    return exploration


def check(exploration: Exploration) -> Found:
    """Closed, without a violation and without a dead end, and the keys tell states apart as the program does."""
    found = exploration.found
    assert not found.violations, "\n".join(
        f"{what}: {' > '.join(way)}" for what, way in found.violations.items()
    )
    assert exploration.closed
    dead = exploration.without_way_home()
    assert not dead, f"{len(dead)} states without a way home: {' > '.join(exploration.way(dead[0]))}"
    assert not exploration.differing_twins()
    return found


def test_every_attribute_of_the_state_has_a_rule() -> None:
    for people in (False, True):
        assert without_rule(World(settings(parks=False), people=people).roots) == []


def test_an_attribute_without_a_rule_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    rules_of = RULES[PowerSequence]
    changed = Rules(**{**vars(rules_of), "same": rules_of.same.replace("phase", "fase")})
    monkeypatch.setitem(RULES, PowerSequence, changed)
    assert without_rule(World(settings(parks=False), people=False).roots) == [
        "PowerSequence.fase: a rule, but no such attribute",
        "PowerSequence.phase: no rule",
    ]


def test_a_shaft_that_coasts_comes_to_rest_on_the_grid() -> None:
    """Beside it, it would jump onto it at standstill: a following error that no axis has."""
    world = World(settings(parks=False), people=False)
    # A move from where a load that slipped was seen, to the end of travel: 0.95 deg/s in its middle.
    world.drive.vel_rad_s = rad(0.95)
    world.scan(NOTHING)
    assert (world.drive.pos_rad, world.drive.vel_rad_s) == (pytest.approx(rad(1.0)), 0.0)


def test_without_a_torque_input_a_brake_is_not_tested() -> None:
    world = World(settings(parks=False, torque_preload=False), people=False)
    for part in world.parts(BRAKE_TEST):
        world.scan(part)
    assert (world.axis.power.phase, world.axis.refusal_count) == (PowerPhase.OFF, 1)


# Which phases a world must reach; all worlds together reach all fifteen.
UP_AND_DOWN = {
    PowerPhase.OFF, PowerPhase.ENABLING, PowerPhase.PROVING, PowerPhase.SETTLING, PowerPhase.RELEASING,
    PowerPhase.SAG_WATCH, PowerPhase.ON, PowerPhase.CLOSING, PowerPhase.UNLOADING, PowerPhase.DISABLING,
}  # fmt: skip
WORLDS = {
    "interlocks": (INTERLOCKS, False, UP_AND_DOWN | {PowerPhase.QUICK_STOPPING, PowerPhase.TORQUE_OFF}),
    "brake": (BRAKE, False, UP_AND_DOWN | {PowerPhase.TORQUE_HOLD}),
    "feedback": (FEEDBACK, True, UP_AND_DOWN | {PowerPhase.PARKED, PowerPhase.TORQUE_OFF}),
    "brake test": (TEST, True, UP_AND_DOWN | {PowerPhase.PARKED, PowerPhase.TESTING}),
}


def test_the_worlds_reach_every_phase() -> None:
    assert set().union(*(phases for _, _, phases in WORLDS.values())) == set(PowerPhase)


@pytest.mark.parametrize("name", WORLDS)
def test_every_state_with_one_fault_at_a_time(name: str) -> None:
    alphabet, parks, phases = WORLDS[name]
    found = check(explore(alphabet, parks=parks))
    assert phases <= set(found.phases)


@pytest.mark.slow  # 15 s of a quiet processor
def test_every_state_that_people_can_bring_about() -> None:
    found = check(explore(PEOPLE, people=True))
    assert {AxisState.STANDSTILL, AxisState.DISCRETE_MOTION, AxisState.STOPPING, AxisState.ERROR_STOP} <= set(
        found.axis_states
    )


@pytest.mark.slow
@pytest.mark.parametrize("preload", [True, False], ids=["torque proven", "no torque preload"])
@pytest.mark.parametrize("parks", [False, True], ids=["servo holds", "brake holds"])
def test_every_state_with_every_fault_and_every_button(
    parks: bool, preload: bool, evidence: Callable[[str, dict[str, object]], None]
) -> None:
    """A world of its own for each fault: between two faults the axis has been without any."""
    figures: dict[str, object] = {}
    for fault in (*Standing, *Once):
        alphabet = Alphabet(
            buttons(),
            (fault,) if isinstance(fault, Standing) else (),
            (fault,) if isinstance(fault, Once) else (),
        )
        print(fault.value, end=": ")
        found = check(explore(alphabet, parks=parks, torque_preload=preload))
        figures[fault.name.lower()] = {"states": found.states, "transitions": found.transitions}
    evidence(f"states_{'brake' if parks else 'servo'}{'' if preload else '_no_preload'}", figures)


@pytest.mark.slow
def test_every_state_that_people_and_an_emergency_stop_can_bring_about(
    evidence: Callable[[str, dict[str, object]], None],
) -> None:
    found = check(explore(ALL_PEOPLE, people=True))
    evidence("states_people", {"states": found.states, "transitions": found.transitions})


# --- planted bugs: what the exploration is for ----------------------------------------------------


def plant_swapped_rows(patch: pytest.MonkeyPatch) -> None:
    """Two rows of the phase table are exchanged."""
    one, other = PowerPhase.CLOSING, PowerPhase.DISABLING
    rows = OUTPUTS[one], OUTPUTS[other]
    patch.setitem(OUTPUTS, one, rows[1])
    patch.setitem(OUTPUTS, other, rows[0])


def plant_forgotten_latch(patch: pytest.MonkeyPatch) -> None:
    """An alarm whose cause is gone clears itself as soon as power is off."""
    interrupted = Axis._interrupted

    def forgets(axis: Axis) -> None:
        interrupted(axis)
        if axis.power.phase is PowerPhase.OFF and axis.feedback.inputs.estop_ok and axis._error:
            axis.alarms.clear()
            axis._error = False

    patch.setattr(Axis, "_interrupted", forgets)


def plant_weakened_stop(patch: pytest.MonkeyPatch) -> None:
    """A quick stop takes over from TORQUE OFF."""
    react = PowerSequence.react

    def weaker(power: PowerSequence, reaction: Reaction) -> None:
        if power.phase is PowerPhase.TORQUE_OFF and reaction is Reaction.QUICK_STOP:
            power._enter(PowerPhase.QUICK_STOPPING)
        react(power, reaction)

    patch.setattr(PowerSequence, "react", weaker)


def plant_reset_that_enables(patch: pytest.MonkeyPatch) -> None:
    """Reset goes on where the stop had ended."""
    reset_now = Axis._reset_now

    def enables(axis: Axis) -> None:
        reset_now(axis)
        axis.power.switch_on()

    patch.setattr(Axis, "_reset_now", enables)


@pytest.mark.parametrize(
    ("plant", "broken"),
    [
        (plant_swapped_rows, "load_held"),
        (plant_forgotten_latch, "latched"),
        (plant_weakened_stop, "torque_off_stays"),
        (plant_reset_that_enables, "asked_for"),
    ],
)
def test_a_planted_bug_is_found(
    plant: Callable[[pytest.MonkeyPatch], None], broken: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    plant(monkeypatch)
    alphabet = Alphabet(INTERLOCKS.commands, (S.ESTOP, S.FOREIGN), (Once.LEAVES,), faults=2)
    found = explore(alphabet, stop=True).found
    assert any(what.startswith(broken) for what in found.violations), found.violations


def test_control_that_nobody_checks_is_found(monkeypatch: pytest.MonkeyPatch) -> None:
    right = rules.RIGHTS
    monkeypatch.setattr(
        rules, "RIGHTS", {action: row._replace(control=False) for action, row in right.items()}
    )
    found = explore(PEOPLE, people=True, stop=True).found
    assert any("without control" in what or "has control" in what for what in found.violations), (
        found.violations
    )
