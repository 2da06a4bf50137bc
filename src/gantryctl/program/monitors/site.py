"""Interlocks of the treatment room: collision, door, motion permit, second emergency-stop channel, loose wires."""

from __future__ import annotations

from collections import deque
from collections.abc import Container

from gantryctl.image import DigitalInputs
from gantryctl.program.alarms.codes import Code, Reaction
from gantryctl.program.alarms.log import AlarmLog
from gantryctl.program.alarms.words import Words
from gantryctl.program.feedback import Feedback
from gantryctl.program.settings import AxisSettings


def why_site_forbids(inputs: DigitalInputs) -> Words | None:
    """Why these inputs forbid torque, or None."""
    if inputs.collision_ok is False:
        return Words.COLLISION_OPEN
    return Words.DOOR_OPEN if inputs.door_ok is False else None


def why_site_keeps(active: Container[Code], inputs: DigitalInputs) -> Words | None:
    """Why an alarm of these inputs cannot be reset yet, or None."""
    if Code.INT_04 in active and inputs.estop_ok is not inputs.estop_ok_2:
        return Words.ESTOP_CHANNELS_DIFFER
    if Code.INT_01 in active and inputs.collision_ok is False:
        return Words.COLLISION_OPEN
    if Code.INT_08 in active and inputs.motion_permit is False:
        return Words.PERMIT_MISSING
    return Words.DOOR_OPEN if Code.INT_07 in active and inputs.door_ok is False else None


class SiteInterlocks:
    """Checks the inputs that not every machine has (faults G7, G8, G10, G11); without them it costs nothing.

    Each acts on the first scan that shows it and stays latched: an input that closes again moves nothing.
    """

    __slots__ = (
        "_alarms", "_chatter_max", "_chatter_s", "_collision", "_differ_count", "_differ_scans", "_door",
        "_door_reaction", "_feedback", "_inputs", "_period_s", "_permit",
    )  # fmt: skip

    def __init__(self, settings: AxisSettings, feedback: Feedback, alarms: AlarmLog) -> None:
        monitors = settings.monitors
        self._feedback, self._alarms = feedback, alarms
        self._period_s = settings.period_s
        self._chatter_max, self._chatter_s = monitors.chatter_edges_max, monitors.chatter_time_s
        self._differ_scans = settings.scans(monitors.estop_discrepancy_time_s)
        self._differ_count = 0
        self._door_reaction = Reaction.QUICK_STOP if monitors.door_quick_stop else None
        # The times at which an input has opened: one more than are permitted.
        self._collision: deque[float] = deque(maxlen=self._chatter_max + 1)
        self._door: deque[float] = deque(maxlen=self._chatter_max + 1)
        self._permit: deque[float] = deque(maxlen=self._chatter_max + 1)
        self._inputs = DigitalInputs()

    def scan(self, pos_rad: float, powered: bool, moving: bool) -> None:
        """Check inputs of which one is open or has changed.

        Args:
            powered: the drive is not switched off.
            moving: a motion is under way, or waits for power or override.
        """
        inputs = self._feedback.inputs
        before, self._inputs = self._inputs, inputs
        if inputs.collision_ok is False:
            self._opened(Code.INT_01, None, pos_rad, powered)
            if before.collision_ok is not False:
                self._note_edge(self._collision, Words.COLLISION_INPUT)
        if inputs.door_ok is False:
            self._opened(Code.INT_07, self._door_reaction, pos_rad, powered)
            if before.door_ok is not False:
                self._note_edge(self._door, Words.DOOR_INPUT)
        if inputs.motion_permit is False:
            # A room withdraws it between motions as a matter of course: then it only keeps the next one from beginning.
            self._opened(Code.INT_08, None, pos_rad, moving)
            if before.motion_permit is not False:
                self._note_edge(self._permit, Words.PERMIT_INPUT)
        if inputs.estop_ok_2 is None or inputs.estop_ok is inputs.estop_ok_2:
            self._differ_count = 0
        else:
            self._differ()

    def _opened(self, code: Code, reaction: Reaction | None, pos_rad: float, matters: bool) -> None:
        # With power off a door is opened all day: then it only keeps power from being switched on.
        if matters:
            self._alarms.raise_(code, reaction, measured=self._feedback.where_moving(pos_rad))

    def _note_edge(self, edges: deque[float], name: Words) -> None:
        """Count an input that opens, and call a loose wire by its name (G8)."""
        edges.append(self._alarms.time_s)
        lasted_s = edges[-1] - edges[0]
        if len(edges) > self._chatter_max and lasted_s <= self._chatter_s:
            limit = self._chatter_max
            self._alarms.raise_(Code.INT_02, name=name, measured=len(edges), time_s=lasted_s, limit=limit)

    def _differ(self) -> None:
        """Two channels of one chain that do not switch together (G10)."""
        self._differ_count = self._feedback.lasting(self._differ_count)
        if self._differ_count >= self._differ_scans:
            time_ms, limit_ms = (
                scans * self._period_s * 1e3 for scans in (self._differ_count, self._differ_scans)
            )
            self._alarms.raise_(Code.INT_04, time_ms=time_ms, limit=limit_ms)
