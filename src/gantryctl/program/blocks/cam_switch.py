"""PLCopen DigitalCamSwitch: outputs that follow the angle."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from enum import IntEnum

from gantryctl.errors import UsageError
from gantryctl.program.axis.axis import Axis
from gantryctl.program.blocks.base import Block
from gantryctl.program.blocks.touch_probe import between


class CamDirection(IntEnum):
    """Directions of motion in which a cam acts, with PLCopen's numbers; at rest the last one counts."""

    BOTH = 0
    POSITIVE = 1
    NEGATIVE = 2


@dataclass(frozen=True, slots=True)
class Cam:
    """One cam of a track.

    Args:
        first_on_rad, last_on_rad: it is on between these, both included.
        direction: of motion, in which it acts.
        duration_s: a time-based cam: on for so long after the axis has passed `first_on_rad`, and `last_on_rad` counts
            for nothing.
    """

    first_on_rad: float
    last_on_rad: float
    direction: CamDirection = CamDirection.BOTH
    duration_s: float | None = None

    def __post_init__(self) -> None:
        numbers = (self.first_on_rad, self.last_on_rad, self.duration_s or 0.0)
        if not all(math.isfinite(number) for number in numbers) or (self.duration_s or 0.0) < 0.0:
            raise UsageError(
                f"a cam needs finite angles and a duration of at least 0 s, got {self.first_on_rad} and "
                f"{self.last_on_rad} rad, {self.duration_s} s"
            )


class DigitalCamSwitch(Block):
    """Tracks of cams, each an output that is TRUE while one of its cams is on.

    Args:
        tracks: the cams of each track.
        on_s, off_s: compensation: an output switches where the axis will be so much later, or was so much before when
            negative, at its present speed.
        hysteresis_rad: a cam that is on goes off so far outside, so that an angle at its edge does not chatter.
        set_point: follow the set-point and not the measured angle.

    Attributes:
        in_operation: Enable is TRUE, and the angle is known.
        outputs: of the tracks; all FALSE when not in operation.
    """

    __slots__ = (
        "_hysteresis_rad", "_off_s", "_on", "_on_s", "_pos_before", "_positive", "_set_point", "_tracks", "_until_s",
        "in_operation", "outputs",
    )  # fmt: skip

    def __init__(
        self,
        axis: Axis,
        tracks: Sequence[Sequence[Cam]],
        *,
        on_s: float = 0.0,
        off_s: float = 0.0,
        hysteresis_rad: float = 0.0,
        set_point: bool = False,
    ) -> None:
        super().__init__(axis)
        if not (math.isfinite(on_s) and math.isfinite(off_s) and 0.0 <= hysteresis_rad < math.pi):
            raise UsageError(
                f"a cam switch needs finite compensations and a hysteresis of 0 to 180 deg, got {on_s} s, {off_s} s, "
                f"{hysteresis_rad} rad"
            )
        self._tracks = tuple(tuple(track) for track in tracks)
        self._on_s, self._off_s, self._hysteresis_rad = on_s, off_s, hysteresis_rad
        self._set_point = set_point
        # Of each cam: whether it is on, and until when if it is a time-based one.
        self._on = [[False] * len(track) for track in self._tracks]
        self._until_s = [[-math.inf] * len(track) for track in self._tracks]
        self._positive = True
        self._pos_before = math.nan
        self.in_operation = False
        self.outputs = (False,) * len(self._tracks)

    def __call__(self, *, enable: bool = True) -> None:
        axis = self.axis
        self.in_operation = enable and (self._set_point or axis.feedback.position_valid)
        if not self.in_operation:
            self._clear()
            return
        virtual = axis.virtual
        pos, vel = (
            (virtual.pos_ref_rad, virtual.vel_ref_rad_s)
            if self._set_point
            else (axis.pos_act_rad, axis.feedback.vel_rad_s)
        )
        # The reading of a drive at rest is noise of either sign.
        if abs(vel) > axis.settings.speed.rest_rad_s:
            self._positive = vel > 0.0
        outputs = []
        for on, until_s, cams in zip(self._on, self._until_s, self._tracks, strict=True):
            for index, cam in enumerate(cams):
                if cam.duration_s is None:
                    on[index] = self._acts(cam) and self._covers(cam, pos, vel, was_on=on[index])
                else:
                    if self._acts(cam) and self._passes(cam, pos + vel * self._on_s):
                        until_s[index] = axis.time_s + cam.duration_s
                    on[index] = axis.time_s < until_s[index]
            outputs.append(any(on))
        self.outputs = tuple(outputs)
        self._pos_before = pos + vel * self._on_s

    def _acts(self, cam: Cam) -> bool:
        if cam.direction is CamDirection.BOTH:
            return True
        return self._positive is (cam.direction is CamDirection.POSITIVE)

    def _covers(self, cam: Cam, pos: float, vel: float, *, was_on: bool) -> bool:
        # The edge that the axis comes to lies earlier by one compensation, the one that it leaves by the other.
        on, off = vel * self._on_s, vel * self._off_s
        before, beyond = (on, -off) if vel > 0.0 else (off, -on)
        wider = self._hysteresis_rad if was_on else 0.0
        return between(
            self.axis,
            pos,
            cam.first_on_rad,
            cam.last_on_rad,
            before_rad=before + wider,
            beyond_rad=beyond + wider,
        )

    def _passes(self, cam: Cam, pos: float) -> bool:
        """Whether the axis has come to or over the first angle since the scan before."""
        before = self._pos_before
        if math.isnan(before):
            return False
        first = cam.first_on_rad
        if self.axis.settings.travel.endless:
            # The way of a scan is far below half a turn, and the zero moves on by whole turns.
            before = math.remainder(before - first, math.tau)
            pos = before + math.remainder(pos - first - before, math.tau)
            first = 0.0
        return before < first <= pos or before > first >= pos

    def _clear(self) -> None:
        self.outputs = (False,) * len(self._tracks)
        self._pos_before = math.nan
        for on, until_s in zip(self._on, self._until_s, strict=True):
            on[:] = [False] * len(on)
            until_s[:] = [-math.inf] * len(until_s)
