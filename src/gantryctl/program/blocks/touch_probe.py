"""PLCopen TouchProbe and AbortTrigger: the angle at which an input became TRUE."""

from __future__ import annotations

import math

from gantryctl.program.alarms.codes import Code
from gantryctl.program.alarms.log import refusal
from gantryctl.program.alarms.words import Words
from gantryctl.program.axis.axis import Axis
from gantryctl.program.blocks.base import Block
from gantryctl.units import deg


class TouchProbe(Block):
    """Keep the measured angle of the scan in which `trigger` becomes TRUE, after the rising edge of Execute.

    The trigger is a level that the program hands in, so it is seen once a scan: the angle may be late by
    `uncertainty_rad`, the way of one scan, and by what the input filters.

    Attributes:
        done: there is a recorded angle; `busy` until then. Both as with every block with Execute.
        recorded_position_rad: of a modulo axis within its turn; nan before.
        uncertainty_rad: way of the axis in one scan at the speed of that moment.
    """

    __slots__ = (
        "_execute", "_was", "_window", "busy", "command_aborted", "done", "recorded_position_rad",
        "uncertainty_rad",
    )  # fmt: skip

    def __init__(self, axis: Axis) -> None:
        super().__init__(axis)
        self.busy = self.done = self.command_aborted = self._execute = False
        # A level that is TRUE when the probe is armed is no edge.
        self._was = True
        self._window: tuple[float, float] | None = None
        self.recorded_position_rad = math.nan
        self.uncertainty_rad = 0.0

    def __call__(
        self,
        *,
        execute: bool,
        trigger: bool,
        window_only: bool = False,
        first_position_rad: float = 0.0,
        last_position_rad: float = 0.0,
    ) -> None:
        """One scan.

        Args:
            window_only: only an edge between the two angles counts, from the first one on in the positive direction.
        """
        if execute and not self._execute:
            self._arm((first_position_rad, last_position_rad) if window_only else None)
        elif not execute and not self.busy:
            self.done = self.command_aborted = False
            self._fail(None)
        self._execute = execute
        rises, self._was = trigger and not self._was, trigger
        if self.busy and rises and self._inside():
            axis = self.axis
            self.busy, self.done = False, True
            self.recorded_position_rad = axis.settings.travel.shown_rad(axis.pos_act_rad)
            self.uncertainty_rad = abs(axis.feedback.vel_rad_s) * axis.settings.period_s

    def abort(self) -> bool:
        """Give up waiting for the edge; False when nothing waits."""
        aborted, self.busy = self.busy, False
        self.command_aborted = self.command_aborted or aborted
        return aborted

    def _arm(self, window: tuple[float, float] | None) -> None:
        self.done = self.command_aborted = self.busy = False
        self.recorded_position_rad, self.uncertainty_rad = math.nan, 0.0
        bad = None if window is None else next((end for end in window if not math.isfinite(end)), None)
        refused = None
        if bad is not None:
            refused = refusal(
                Code.CTL_01,
                name=Words.NAME_POSITION,
                allowed=Words.WITHIN_TRAVEL(low=-360.0, high=360.0),
                measured=Words.ANGLE(value=deg(bad)),
            )
        if self._accepted(refused):
            self.busy, self._window = True, window

    def _inside(self) -> bool:
        if not self.axis.feedback.position_valid:
            return False
        if self._window is None:
            return True
        return between(self.axis, self.axis.pos_act_rad, *self._window)


class AbortTrigger(Block):
    """Give up a `TouchProbe` on the rising edge of Execute; `done` also when it waited for nothing."""

    __slots__ = ("_execute", "_probe", "done")

    def __init__(self, probe: TouchProbe) -> None:
        super().__init__(probe.axis)
        self._probe = probe
        self.done = self._execute = False

    def __call__(self, *, execute: bool) -> None:
        if execute and not self._execute:
            self._probe.abort()
        self.done = self._execute = execute


def between(
    axis: Axis,
    pos_rad: float,
    first_rad: float,
    last_rad: float,
    *,
    before_rad: float = 0.0,
    beyond_rad: float = 0.0,
) -> bool:
    """Whether an angle lies between two others; of a modulo axis from the first one on in the positive direction.

    Args:
        before_rad, beyond_rad: so far before the first and beyond the last angle counts, too.
    """
    first, width = first_rad - before_rad, last_rad - first_rad
    if not axis.settings.travel.endless:
        return first <= pos_rad <= first + width + before_rad + beyond_rad
    # A whole turn and more is every angle, not none.
    width = width if width >= math.tau else width % math.tau
    return (pos_rad - first) % math.tau <= width + before_rad + beyond_rad
