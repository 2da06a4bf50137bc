"""The axis of a running service: tags to read, commands to give, a key to hold."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Iterator
from contextlib import suppress
from pathlib import Path
from types import TracebackType
from typing import Any, Final, Literal

from gantryctl.client.connection import Connection, Reply, Welcome
from gantryctl.client.errors import MotionStopped, Refused
from gantryctl.client.held import Direction, Held, raise_alarm
from gantryctl.client.tags import Tags
from gantryctl.client.wires import LocalWire, Wire
from gantryctl.errors import AlarmStop, DeviceError, GantryctlError
from gantryctl.notebook import facts_html
from gantryctl.program.alarms.codes import Code

Way = Literal["shortest", "positive", "negative", "current"]
Setting = Literal["speed_setting_deg_s", "increment_deg", "override_percent", "acc_setting_deg_s2"]
Armable = Literal["brake_test", "reset_locked"]
# An axis at rest that is not in position after this long will not be.
_SETTLE_S: Final = 10.0
# Tags have six decimals; a stop ends further from the target than that, or at it.
_AT_TARGET_DEG: Final = 1e-4


class Axis:
    """The axis of one service on one connection, open from construction; a context manager.

    Reading needs no control; most commands do: `take` it first. Leaving switches off what was switched on here and
    gives control back; leaving by an exception stops the axis before. Neither is done to an axis that somebody else has
    control of by then. When this process dies or freezes, a held key is let go after `welcome.lease_ms`, control is
    free after 2 s, and a move that was begun ends at its target.

    Angles are signed angles of the axis in deg, speeds deg/s.

    Args:
        wire: open, and this object's own from now on.

    Raises:
        DeviceError: the service does not answer, or its controller is silent.
    """

    def __init__(self, wire: Wire) -> None:
        self._connection = Connection(wire)
        self._powered = self._controls = False

    def __enter__(self) -> Axis:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        if error is not None and self._controls and not self._is_taken:
            self._stop_quietly()
        self.close()

    def close(self) -> None:
        """Switch off what was switched on here, give control back, end the connection; may be called twice."""
        try:
            # Whatever fails here, the connection ends, and with it control and every key that is held.
            with suppress(GantryctlError):
                if not self._is_taken:
                    if self._powered:
                        self.power_off()
                    if self._controls:
                        self.give()
        finally:
            self._connection.close()

    @property
    def welcome(self) -> Welcome:
        """Who this connection is, and what its role may do."""
        return self._connection.welcome

    # --- reading -----------------------------------------------------------------------------------

    @property
    def tags(self) -> Tags:
        """The newest tags.

        Raises:
            DeviceError: they are not the present state: the controller is silent, or the connection has ended.
        """
        return self._connection.frame.tags

    def frames(self) -> Iterator[Tags]:
        """Go through the status frames as they come, 20 a second; a slow reader misses some, never the newest."""
        number = 0
        while True:
            frame = self._connection.next_frame(number)
            number = frame.number
            yield frame.tags

    def wait_until(self, condition: Callable[[Tags], bool], timeout_s: float) -> Tags | None:
        """Wait for a frame that fulfils a condition; None when it did not come in time."""
        until_s = time.monotonic() + timeout_s
        for tags in self.frames():
            if condition(tags):
                return tags
            if time.monotonic() > until_s:
                return None
        return None

    def _repr_html_(self) -> str:
        tags, who = self.tags, self.welcome
        facts = {
            "angle": None if tags.pos_act_deg is None else f"{tags.pos_act_deg:.4f} deg",
            "speed": None if tags.vel_act_deg_s is None else f"{tags.vel_act_deg_s:.4f} deg/s",
            "state": tags.axis_state,
            "power": "on" if tags.power else "off",
            "control": tags.authority_user or "free",
            "alarms": ", ".join(str(row["code"]) for row in tags.alarms) or "none",
            "connected as": f"{who.user} ({who.role}), {who.place}",
        }
        return facts_html(f"Axis of {tags.machine}", facts)

    # --- stopping: everybody may, always -------------------------------------------------------------

    def stop(self) -> None:
        """Stop on the jog-release ramp. From any thread, without control, whatever else is under way."""
        self._ask("stop", shown=False)

    def quick_stop(self) -> None:
        """Stop by a quick stop, which leads to ErrorStop. From any thread, without control."""
        self._ask("quick_stop", shown=False)

    # --- control and power ---------------------------------------------------------------------------

    def take(self, *, over: bool = False) -> None:
        """Take control.

        Args:
            over: from another holder too; at standstill only, and never from the local console.

        Raises:
            Refused: SEC-07 somebody has it, SEC-08 it cannot be taken over now, SEC-01 the role may not.
        """
        # The service lets the local console take control from anybody, and stops what moves: here only when asked.
        if self.welcome.place == "local" and not over:
            tags = self.tags
            if tags.authority_user and tags.authority_client != self.welcome.client:
                raise Refused(Code.SEC_07, f"{tags.authority_user} has control; over=True takes it")
            if not tags.at_rest:
                raise Refused(Code.SEC_08, "the axis moves; over=True stops it and takes control")
        self._ask("take", over=over)
        self._controls = True

    def give(self) -> None:
        """Give control back: a held key ends, a move goes on."""
        self._ask("give")
        self._controls = False

    def power_on(self, timeout_s: float = 30.0) -> None:
        """Switch power on, and wait until the axis follows commands; nothing when it does.

        Raises:
            Refused: not now. AlarmStop: an alarm ended it. MotionStopped: power did not come in time.
        """
        if self.tags.power:
            return
        try:
            self._ask("power", on=True)
            # Power that was on before belongs to somebody else, and stays on afterwards.
            self._powered = True
            for tags in self._watched(timeout_s):
                if tags.power:
                    return
                if tags.power_phase == "off":
                    break
        except Refused:
            raise
        except BaseException:
            with suppress(GantryctlError):
                self._ask("power", on=False, shown=False)
            raise
        self._ask("power", on=False, shown=False)
        self._powered = False
        raise MotionStopped(f"the power sequence has ended, or did not end within {timeout_s:g} s")

    def power_off(self, timeout_s: float = 30.0) -> None:
        """Come to rest, close the brake, take the torque off, and wait for that. Needs no control.

        Raises:
            AlarmStop: the brake does not hold, and torque keeps the load. MotionStopped: power was not off in time.
        """
        self._ask("power", on=False)
        self._powered = False
        tags = self.wait_until(lambda tags: tags.power_phase in ("off", "torque_hold"), timeout_s)
        if tags is None:
            raise MotionStopped(f"power is not off {timeout_s:g} s after it was told to go off")
        if tags.power_phase == "torque_hold":
            raise_alarm(tags)

    def set(self, tag: Setting, value: float) -> None:
        """Change a setting; outside its range it is refused, never clamped."""
        self._ask("set", tag=tag, value=float(value))

    # --- motion ----------------------------------------------------------------------------------------

    def move(self, target_deg: float, *, speed_deg_s: float | None = None, way: Way | None = None) -> Tags:
        """Move to an angle, and wait until the axis stands there; the tags then.

        Ctrl-C and every other exception while it waits stop the axis.

        Args:
            speed_deg_s: becomes the speed setting; as it is when not given. way: of a modulo axis.

        Raises:
            Refused: target, speed or state do not allow it; nothing moved. AlarmStop: an alarm ended it.
            MotionStopped: it ended before its target: somebody has stopped it.
        """
        keys: dict[str, Any] = {"target_deg": float(target_deg)}
        if way is not None:
            keys["direction"] = way
        return self._moved("move", keys, speed_deg_s, lambda _: target_deg)

    def move_by(self, distance_deg: float, *, speed_deg_s: float | None = None) -> Tags:
        """Move by an angle from the set-point, a modulo axis also beyond a turn; else as `move`."""
        keys = {"distance_deg": float(distance_deg)}
        return self._moved("move_by", keys, speed_deg_s, lambda tags: tags.pos_ref_deg + distance_deg)

    def increment(self, direction: Direction) -> Tags:
        """Move by one increment in incremental mode, which is chosen where it is not; else as `move`."""
        self._choose_mode("incremental")
        sign = 1.0 if direction == "forward" else -1.0
        return self._moved(
            "increment",
            {"direction": direction},
            None,
            lambda tags: tags.pos_ref_deg + sign * tags.increment_deg,
        )

    def hold(self, direction: Direction, *, speed_deg_s: float | None = None) -> Held:
        """Hold the forward or reverse key in a `with` block; continuous mode is chosen where it is not.

            with axis.hold("forward", speed_deg_s=1.0) as key:
                for tags in key:
                    if tags.pos_act_deg > 20.0:
                        break

        The loop is what holds the key, see `Held`. Leaving the block lets it go and waits until the axis stands.

        Raises:
            Refused: control, mode, speed or connection (SEC-13: too slow) do not allow it.
        """
        self._choose_mode("continuous")
        if speed_deg_s is not None:
            self.set("speed_setting_deg_s", speed_deg_s)
        return Held(
            self._connection, direction, lambda: self.wait_until(lambda tags: tags.at_rest, _SETTLE_S)
        )

    def halt(self) -> None:
        """End the motion on the normal ramp."""
        self._ask("halt")

    # --- alarms and brake --------------------------------------------------------------------------------

    def reset(self) -> None:
        """Reset alarms whose cause is gone; never switches on. Locked ones need `arm` and the service role."""
        self._ask("reset")

    def acknowledge(self, alarm_id: int) -> None:
        """Mark an alarm as seen: `id` of its row."""
        self._ask("acknowledge", id=alarm_id)

    def note(self, line: str) -> None:
        """Write a line into the shift log: 120 characters at most; it is in the journal when this returns."""
        self._ask("note", line=line)

    def arm(self, action: Armable) -> None:
        """Take the first of two steps; the second follows within 10 s."""
        self._ask("arm", action=action)

    def test_brake(self, timeout_s: float = 120.0) -> Tags:
        """Execute the armed brake test, and wait for its end; the tags `brake_test_..` tell the result."""
        before = self.tags.brake_tests
        try:
            self._ask("brake_test")
            for tags in self._watched(timeout_s):
                if tags.brake_tests != before:
                    return tags
        except (Refused, AlarmStop):
            raise
        except BaseException:
            self._stop_quietly()
            raise
        self._stop_quietly()
        raise MotionStopped(f"the brake test did not end within {timeout_s:g} s")

    # --- how it does it ------------------------------------------------------------------------------------

    def _ask(self, kind: str, *, shown: bool = True, **values: Any) -> Reply:
        return self._connection.ask(kind, shown=shown, **values)

    def _choose_mode(self, mode: str) -> None:
        if self.tags.mode != mode:
            self._ask("mode", mode=mode)

    @property
    def _is_taken(self) -> bool:
        """Whether somebody else has control, as far as is known."""
        with suppress(DeviceError):
            return self.tags.authority_client not in ("", self.welcome.client)
        return False

    def _stop_quietly(self) -> None:
        with suppress(GantryctlError):
            self.stop()

    def _watched(self, timeout_s: float = math.inf) -> Iterator[Tags]:
        """Frames until an alarm has stopped the axis, which is an exception, or the time is over."""
        until_s = time.monotonic() + timeout_s
        for tags in self.frames():
            raise_alarm(tags)
            yield tags
            if time.monotonic() > until_s:
                return

    def _moved(
        self, kind: str, keys: dict[str, Any], speed_deg_s: float | None, target: Callable[[Tags], float]
    ) -> Tags:
        if speed_deg_s is not None:
            self.set("speed_setting_deg_s", speed_deg_s)
        target_deg = target(self.tags)
        try:
            self._ask(kind, **keys)
            rested_s = None
            for tags in self._watched():
                if not tags.power:
                    raise MotionStopped("power was switched off before the axis was at its target")
                if not tags.at_rest:
                    rested_s = None
                    continue
                rested_s = rested_s or time.monotonic()
                left_deg = target_deg - tags.pos_ref_deg
                if abs(_turned(left_deg) if tags.axis_kind == "modulo" else left_deg) > _AT_TARGET_DEG:
                    raise MotionStopped(f"stopped at {tags.pos_ref_deg:.4f} deg, before {target_deg:.4f} deg")
                if tags.in_position:
                    return tags
                if time.monotonic() - rested_s > _SETTLE_S:
                    raise MotionStopped(f"the axis is at rest, but not in position after {_SETTLE_S:g} s")
        except (Refused, MotionStopped, AlarmStop):
            raise
        except BaseException:
            self._stop_quietly()
            raise
        raise DeviceError("the connection to the service has ended")


def _turned(angle_deg: float) -> float:
    """The same angle of a modulo axis, within half a turn."""
    return (angle_deg + 180.0) % 360.0 - 180.0


def local_axis(machine: str = "hust_gantry", directory: Path | None = None) -> Axis:
    """Connect to the service of a machine on this computer, without login: the system says who asks.

    This is the local console: it has more rights than a page, and its `take` takes control from everybody.

    Args:
        machine: its name. directory: its state directory, where it is another than that of the command line.

    Raises:
        DeviceError: no service runs.
    """
    from gantryctl.operation.store import state_root

    return Axis(LocalWire(directory or state_root() / machine))
