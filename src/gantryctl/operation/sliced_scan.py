"""Scans of a run in slices: between two of them its display, its lease and requests to stop have their turn."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, Final

from gantryctl.operation.bus_log import AlarmFrames
from gantryctl.operation.client import Ending, Snapshot, Stop
from gantryctl.program import Axis, AxisState
from gantryctl.runtime import Engine, FixedOperator
from gantryctl.units import deg

# Axis time between two calls of the observer.
SLICE_S: Final = 0.1
# The same while a key is held and its lease renewed: as often as the page does, [monitors] lease_ms is 250 by default.
LEASE_SLICE_S: Final = 0.03


class SlicedScan:
    """Scans until something is done, with the levels of one operator.

    Args:
        frames: takes the alarms of each slice.
        observer: gets a `Snapshot` after each slice. One that fails is left out from then on, and the axis stops: its
            display has no reader any more.

    Attributes:
        stop: raised by whoever wants the axis to stop, at any time.
        stopped_as: how a motion has ended that `stop` ends: by a person, unless the cause is known.
        observer: of the next slice; None for nobody.
    """

    def __init__(
        self,
        engine: Engine,
        axis: Axis,
        operator: FixedOperator,
        frames: AlarmFrames,
        observer: Callable[[Snapshot], None] | None,
    ) -> None:
        self._engine, self._axis, self._operator, self._frames = engine, axis, operator, frames
        self.observer = observer
        self.stop, self.stopped_as = Stop.NO, Ending.STOPPED

    def command(self, **levels: Any) -> None:
        """Set levels of the operator; the next scan sees them."""
        self._operator.command = self._operator.command._replace(**levels)

    def renew(self) -> None:
        """Renew the lease of a hold-to-run command."""
        self.command(lease=self._operator.command.lease + 1)

    def until(
        self,
        done: Callable[[], bool],
        timeout_s: float,
        *,
        held: bool = False,
        watch: bool = True,
    ) -> None:
        """Scan until something is done, or the time is over.

        Args:
            held: a key is held: the lease is renewed, and a request to stop ends the waiting, which lets go.
            watch: stop requests go to the program.
        """
        engine = self._engine
        end_s = engine.time_s + timeout_s
        slice_s = LEASE_SLICE_S if held else SLICE_S
        handed = Stop.QUICK

        def ended(_: object) -> bool:
            # A request of another thread ends the slice: the next scan has it.
            return done() or self.stop > handed

        while engine.time_s < end_s - 1e-9:
            if watch and self._asked_to_stop() and held:
                return
            if held:
                self.renew()
            handed = self.stop if watch else Stop.QUICK
            engine.run_until(ended, min(slice_s, end_s - engine.time_s))
            self._frames.look(engine.time_s)
            self._observe()
            if done():
                return

    def snapshot(self) -> Snapshot:
        """State of the axis for a display."""
        axis, feedback, time_s = self._axis, self._axis.feedback, self._engine.time_s
        vel = self._engine.image.drive.vel_act_rad_s / axis.settings.law.ratio
        moves = axis.state is AxisState.DISCRETE_MOTION
        return Snapshot(
            time_s=time_s,
            angle_deg=deg(axis.settings.travel.shown_rad(axis.pos_act_rad))
            if feedback.position_valid
            else None,
            speed_deg_s=deg(vel) if feedback.speed_known and not feedback.in_doubt else None,
            following_error_deg=deg(axis.pos_err_rad),
            state=state_words(axis.state),
            time_left_s=max(0.0, axis.plan_end_s - time_s) if moves else None,
        )

    def end(self) -> None:
        """After the last scan: the frames around the alarms since the last slice."""
        self._frames.look(self._engine.time_s)

    def _observe(self) -> None:
        if self.observer is None:
            return
        try:
            self.observer(self.snapshot())
        except Exception:
            # Terminal lost or pipe closed: an axis without anybody who watches it stops.
            self.observer = None
            if self.stop is Stop.NO:
                self.stop, self.stopped_as = Stop.RAMP, Ending.UNREAD

    def _asked_to_stop(self) -> bool:
        """Hand a stop request to the program."""
        if self.stop is Stop.QUICK:
            self.command(quick_stop=True)
        elif self.stop is Stop.RAMP:
            self.command(stop=True)
        return self.stop is not Stop.NO


def state_words(state: AxisState) -> str:
    """A state of the axis for people."""
    return state.name.lower().replace("_", " ")
