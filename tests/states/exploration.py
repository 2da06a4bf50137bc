"""Breadth first through every state that the world can reach, to the end."""

from __future__ import annotations

import random
from array import array
from collections import Counter, deque
from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import Final

from gantryctl.image import DriveState
from gantryctl.program import AxisState, PowerPhase
from states.abstraction import Keys
from states.people import NOTHING, PANEL, Event
from states.properties import look, violations
from states.snapshot import Snapshot
from states.stub_drive import Once, Standing
from states.world import World

# States reached again whose other way there is kept, and the share of those that are: the check of the keys.
_TWINS: Final = 400
_TWIN_SHARE: Final = 0.01
NEEDS_CONTROL: Final = ("mode", "jog", "renew", "move", "halt", "set", "reset", "brake_test")


@dataclass(frozen=True)
class Alphabet:
    """What may happen.

    Attributes:
        commands: what people say.
        standing, once: what the drive may do.
        faults: so many happen before the axis is without any again; what stands may end at any time.
        without_right: messages that must change nothing.
    """

    commands: tuple[Event, ...]
    standing: tuple[Standing, ...]
    once: tuple[Once, ...] = ()
    faults: int = 1
    without_right: tuple[Event, ...] = ()


@dataclass
class Found:
    """What an exploration has seen."""

    states: int = 0
    transitions: int = 0
    phases: Counter[PowerPhase] = field(default_factory=Counter)
    axis_states: Counter[AxisState] = field(default_factory=Counter)
    drive_states: Counter[DriveState] = field(default_factory=Counter)
    violations: dict[str, list[str]] = field(default_factory=dict)
    """Of each kind the shortest way to it, event by event."""

    def __str__(self) -> str:
        phases = ", ".join(
            f"{phase.name} {count}" for phase, count in sorted(self.phases.items(), key=lambda p: p[0].value)
        )
        return f"{self.states} states, {self.transitions} transitions; {phases}"


class Exploration:
    """Every state of a world, and what was wrong on the way.

    Args:
        world: in the state to begin with.
        alphabet: what may happen.
        stop_at_first: end at the first violation.

    Attributes:
        found: the figures. closed: no state is left whose successors are unknown.
    """

    def __init__(self, world: World, alphabet: Alphabet, *, stop_at_first: bool = False) -> None:
        self.world, self.alphabet, self.found = world, alphabet, Found()
        self.closed = False
        self._stop_at_first = stop_at_first
        self.keys = Keys(world.roots)
        self._number: dict[tuple[int, ...], int] = {}
        self._came: list[tuple[int, Event]] = []
        self._after: list[array[int]] = []
        self._waiting: deque[tuple[int, Snapshot]] = deque()
        self._twins: list[tuple[int, Snapshot]] = []
        self._homes: list[int] = []
        self._random = random.Random(1)

    def run(self) -> Found:
        """Explore until nothing new is found."""
        self._state(0, NOTHING, [])
        while self._waiting:
            number, snapshot = self._waiting.popleft()
            self._expand(number, snapshot)
            if self._stop_at_first and self.found.violations:
                return self.found
        self.closed = True
        return self.found

    def events(self) -> Iterator[Event]:
        """What may happen in the state that the world is in."""
        alphabet, drive = self.alphabet, self.world.drive
        more = drive.faults < alphabet.faults
        yield NOTHING
        for event in alphabet.commands:
            if self.world.can(event):
                yield event
        for each in alphabet.standing:
            if more or each in drive.standing:
                yield Event(drive=each)
        for once in alphabet.once if more else ():
            yield Event(drive=once)

    def _expand(self, number: int, snapshot: Snapshot) -> None:
        world = self.world
        restore = world.keeper.restore
        after = array("l")
        restore(snapshot)
        events = tuple(self.events())
        refused = tuple(filter(world.can, self.alphabet.without_right))
        holder = world.holder
        for event in events:
            restore(snapshot)
            self._do(event, number)
            after.append(self._state(number, event, snapshot))
            if event.kind in NEEDS_CONTROL and event.who != holder and after[-1] != after[0]:
                self._violated(f"INV-10: {event} acts without control", number, event)
        self._after.append(after)
        for event in refused:
            restore(snapshot)
            self._do(event, number)
            if self._number.get(self.keys.make()) != after[0]:
                self._violated(f"INV-10: {event} acts without a right to", number, event)

    def _do(self, event: Event, number: int) -> None:
        world, found = self.world, self.found
        for part in world.parts(event):
            before = look(world)
            world.scan(part)
            for said in violations(before, part, world):
                self._violated(said, number, event)
        found.transitions += 1

    def _state(self, came_from: int, event: Event, parent: Snapshot) -> int:
        key = self.keys.make()
        number = self._number.get(key)
        if number is not None:
            if len(self._twins) < _TWINS and self._random.random() < _TWIN_SHARE:
                self._twins.append((number, self.world.keeper.take(parent)))
            return number
        number = self._number[key] = len(self._number)
        self._came.append((came_from, event))
        found, world = self.found, self.world
        found.states += 1
        found.phases[world.axis.power.phase] += 1
        found.axis_states[world.axis.state] += 1
        found.drive_states[world.drive.state] += 1
        self._waiting.append((number, world.keeper.take(parent)))
        if self._is_home():
            self._homes.append(number)
        return number

    def _is_home(self) -> bool:
        """Power off, everything sound, nothing latched, nobody in control."""
        world = self.world
        axis, drive = world.axis, world.drive
        return (
            axis.power.phase is PowerPhase.OFF
            and not axis.alarms.active
            and not drive.standing
            and axis.feedback.position_valid
            and world.holder in (None, PANEL)
            and not world.wants_power
        )

    def without_way_home(self) -> list[int]:
        """States from which no events lead back to power off with everything sound: dead ends."""
        comes_from: list[list[int]] = [[] for _ in self._after]
        for number, after in enumerate(self._after):
            for successor in set(after):
                comes_from[successor].append(number)
        home = set(self._homes)
        waiting = list(home)
        while waiting:
            for number in comes_from[waiting.pop()]:
                if number not in home:
                    home.add(number)
                    waiting.append(number)
        return [number for number in range(len(self._after)) if number not in home]

    def differing_twins(self) -> list[str]:
        """Of states that were reached again: another way there, and what it changed in the states that follow."""
        world, wrong = self.world, []
        for number, snapshot in self._twins:
            world.keeper.restore(snapshot)
            events = tuple(self.events())
            for event, expected in zip(events, self._after[number], strict=True):
                world.keeper.restore(snapshot)
                for part in world.parts(event):
                    world.scan(part)
                key = self.keys.make()
                if self._number.get(key) != expected:
                    other = self._keys_in_order()[expected]
                    wrong.append(f"{event}: {'; '.join(self.keys.differences(other, key))}")
        return wrong

    def _keys_in_order(self) -> list[tuple[int, ...]]:
        return list(self._number)

    def way(self, number: int) -> list[str]:
        """Events that lead to a state, the first one first."""
        said = []
        while number:
            number, event = self._came[number]
            said.append(str(event))
        return said[::-1]

    def _violated(self, said: str, number: int, event: Event) -> None:
        if said not in self.found.violations:
            self.found.violations[said] = [*self.way(number), str(event)]
