"""The axis of the running service, for `--service` and after `attach`."""

from __future__ import annotations

import math
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from typing import Any, Final

from gantryctl.errors import AlarmStop, CommandRefused, GantryctlError, UsageError
from gantryctl.image import Direction
from gantryctl.machine import Machine, short_hash
from gantryctl.operation.client import BRAKE_WATCH_S, BrakeDue, BrakeTestReport, Ending, MotionReport, Stop
from gantryctl.operation.store import state_root
from gantryctl.program import BrakeTestOutcome
from gantryctl.program.alarms.codes import Code
from gantryctl.program.alarms.log import refusal
from gantryctl.program.alarms.words import Said, Words
from gantryctl.program.axis.command_checks import (
    check_destination,
    check_direction,
    check_range,
    check_setting,
    check_target,
    inside_turn,
    require,
)
from gantryctl.service.clients.link import ServiceLink
from gantryctl.service.protocol.limits import FRAME_S, HELD_S
from gantryctl.terminal import tell
from gantryctl.units import deg, rad
from gantryctl.wiring.program import speed_settings, travel_settings

Tags = dict[str, Any]
# How long it waits for the second person to arm.
_OTHER_S: Final = 120.0
# A reply comes by the scan, the tags with the next status frame (50 ms) and those on change after it: shown in 0.5 s.
SHOWN_FRAMES: Final = math.ceil(0.5 / FRAME_S)
# Where the power sequence goes no further: without torque, or with torque alone to hold the load.
_ENDED: Final = ("off", "torque_hold")


def directory_of(machine: Machine) -> Path:
    """The machine's state directory."""
    return state_root() / machine.name


class ServiceAxis:
    """An `AxisClient` of the running service.

    Control is lost after 2 s of silence, so whoever asks a person looks first (`angle_deg`, `look`) and takes control
    after the answer. Whoever has control keeps it unless `take_over`. What was switched on here is switched off.

    Attributes:
        tags: the newest that are known.

    Raises:
        CommandRefused: another configuration, or somebody else has control.
    """

    must_ask = True

    def __init__(self, machine: Machine, *, take_over: bool) -> None:
        self.machine, self.stop, self.stopped_as = machine, Stop.NO, Ending.STOPPED
        self.tags: Tags = {}
        self._connection: ServiceLink | None = None
        self._take_over = take_over
        self._powered = self._tested = False

    # --- control -------------------------------------------------------------------------------------------------

    def look(self) -> Tags:
        """Read the tags of the service on a connection that is left at once."""
        with ServiceLink(directory_of(self.machine)) as link:
            self._check_service(link.tags)
            self.tags = link.tags
        return self.tags

    @property
    def speed_max_deg_s(self) -> float:
        """Highest speed setting in force: of the machine file, or of the ledger where that is lower."""
        return float((self.tags if self._connection else self.look())["speed_max_deg_s"])

    @property
    def quick_dec_deg_s2(self) -> float:
        """Quick-stop deceleration: as measured of a drive with a ramp of its own, else that of the machine file."""
        return float((self.tags if self._connection else self.look())["quick_dec_deg_s2"])

    def _check_speed(self, speed_deg_s: float) -> None:
        require(check_setting(rad(speed_deg_s), speed_settings(self.machine, self.speed_max_deg_s)))

    @property
    def angle_deg(self) -> float:
        """Measured angle, motor side.

        Raises:
            CommandRefused: its reading is in doubt.
        """
        found = (self.tags if self._connection else self.look())["pos_act_deg"]
        if found is None:
            raise CommandRefused("the angle is not known: `gantryctl status` says why, service compares it")
        return float(found)

    @property
    def _link(self) -> ServiceLink:
        """The connection that has control, from `take` to `close`."""
        assert self._connection is not None
        return self._connection

    def take(self) -> float:
        """Take control; what moves without a holder of it is left alone, or stopped with `take_over`."""
        self._connect()
        # A move goes on when its holder of control has gone; a key that is held does not.
        if not self.tags["at_rest"]:
            if not self._take_over:
                target = self.machine.axis.dial.text(self.tags["target_deg"], ".2f")
                raise CommandRefused(f"the axis moves to {target} deg; --take-over stops it, or wait")
            self._link.ask("stop")
            self._wait(lambda tags: bool(tags["at_rest"]))
        return self.angle_deg

    def _connect(self) -> None:
        if self._connection:
            return
        # Control on a connection of its own: the service ends those that do not read, as while a person thinks.
        self._connection = ServiceLink(directory_of(self.machine), tell)
        self.tags = self._link.tags
        self._check_service(self.tags)
        self._link.ask("take", over=True)

    def _check_service(self, tags: Tags) -> None:
        """It must be this machine, and its control must be free."""
        if tags["config_hash"] != short_hash(self.machine):
            raise CommandRefused(
                f"the service runs {tags['machine']} with configuration {tags['config_hash']}, this command has "
                f"{short_hash(self.machine)}: name the service's machine file with --config"
            )
        # A person at the page keeps control unless this command is told to take it (SEC-07).
        holder = tags["authority_user"]
        if holder and not self._take_over:
            refused = _no_control(Words.HAS_CONTROL(user=holder))
            raise CommandRefused(f"{refused}; --take-over takes it, and stops what moves")

    def close(self, result: str, alarm: AlarmStop | None = None) -> None:
        """Take off the torque that was switched on here, give control back, leave."""
        if self._connection is None:
            return
        # Whatever fails here, the connection ends, and with it control and every key that is held.
        with self._connection as link, suppress(GantryctlError):
            link.look()
            if not self._taken_by:
                if self._powered:
                    link.ask("power", on=False)
                link.ask("give")
                # The next command reads from the tags who has control: it must not find this one there.
                self._until(lambda tags: tags["authority_client"] != link.client)
        self._connection, self._powered = None, False

    # --- commands ------------------------------------------------------------------------------------------------

    def switch(self, on: bool) -> bool:
        """Switch power and leave it so; return whether that changed anything.

        Raises:
            CommandRefused: somebody else has control, or it moves. AlarmStop: an alarm ended it.
        """
        try:
            self.take()
            if bool(self.tags["power"]) is on and self.tags["power_phase"] == ("on" if on else "off"):
                return False
            # The reply is faster than the tags: only those that know of the command show what it did.
            begun = self._link.ask("power", on=on)["journal"]
            self._wait(
                lambda tags: (
                    tags["journal_sequence"] >= begun
                    and (tags["power_phase"] in _ENDED or (on and bool(tags["power"])))
                )
            )
            self._raise_alarm()
            if on and not self.tags["power"]:
                raise CommandRefused(
                    f"power stays off: {self.tags['blocked_by'] or 'it was switched off again'}"
                )
            return True
        finally:
            self.close("power")

    def power_up(self) -> None:
        """Power on, unless it is on."""
        self.take()
        # Power that was on before belongs to somebody else, and stays on afterwards.
        if self.tags["power"]:
            return
        self._link.ask("power", on=True)
        self._powered = True
        self._wait(lambda tags: bool(tags["power"]) or tags["power_phase"] in _ENDED)
        self._raise_alarm()

    def power_down(self) -> None:
        """Power off if it was switched on here, and see that the brake holds.

        Raises:
            AlarmStop: an alarm on the way, as of a brake that does not hold.
        """
        if self._powered and not self._taken_by:
            self._link.ask("power", on=False)
            self._wait(lambda tags: tags["power_phase"] in _ENDED)
            self._powered = False
            watched_s = self.tags["time_s"] + BRAKE_WATCH_S
            self._wait(lambda tags: tags["power_phase"] == "torque_hold" or tags["time_s"] >= watched_s)
            self._raise_alarm()

    def move(
        self,
        target_deg: float,
        speed_deg_s: float | None = None,
        override: float = 1.0,
        direction: Direction | None = None,
    ) -> MotionReport:
        """Move to an angle and wait until the axis stands there."""

        def check(start_deg: float) -> None:
            travel = travel_settings(self.machine)
            require(check_destination(rad(start_deg), rad(target_deg), direction, travel))

        def way(start_deg: float) -> dict[str, Any]:
            travel = travel_settings(self.machine)
            chosen = direction or inside_turn(rad(start_deg), rad(target_deg), travel)
            return {"target_deg": target_deg} | ({"direction": chosen.name.lower()} if chosen else {})

        return self._move(check, speed_deg_s, override, "move", way)

    def move_by(
        self, distance_deg: float, speed_deg_s: float | None = None, override: float = 1.0
    ) -> MotionReport:
        """Move by an angle, a modulo axis also beyond a turn."""
        travel = travel_settings(self.machine)

        def check(start_deg: float) -> None:
            refused = check_target(rad(start_deg), rad(start_deg + distance_deg), travel)
            require(check_range(rad(distance_deg), travel) if travel.endless else refused)

        return self._move(check, speed_deg_s, override, "move_by", lambda _: {"distance_deg": distance_deg})

    def _move(
        self,
        check: Callable[[float], None],
        speed_deg_s: float | None,
        override: float,
        kind: str,
        keys: Callable[[float], dict[str, Any]],
    ) -> MotionReport:
        wanted = self.speed_max_deg_s if speed_deg_s is None else speed_deg_s
        self._check_speed(wanted)
        start_deg = self.take()
        check(start_deg)
        self.power_up()
        start_s, before = self.tags["time_s"], dict(self.tags)
        self._set("speed_setting_deg_s", wanted)
        self._set("override_percent", override * 100.0)
        try:
            epoch = self._link.ask(kind, **keys(start_deg))["epoch"]
            return self._followed(start_deg, start_s, epoch)._replace(asked_deg_s=wanted * override)
        finally:
            # Speed and override are the operator's settings; this command has only borrowed them.
            if not self._taken_by:
                for tag in ("speed_setting_deg_s", "override_percent"):
                    self._set(tag, before[tag])

    def jog(self, forward: bool, speed_deg_s: float, seconds: float) -> MotionReport:
        """Hold the key for a time, then let go and wait for rest."""
        if seconds > HELD_S:
            raise UsageError(
                f"--for {seconds:g} s: the service lets a key be held for {HELD_S:g} s at most; ask again then"
            )
        start_deg = self.take()
        self._check_speed(speed_deg_s)
        direction = 1.0 if forward else -1.0
        require(check_direction(rad(start_deg), direction, travel_settings(self.machine)))
        self.power_up()
        start_s, before = self.tags["time_s"], dict(self.tags)
        self._link.ask("mode", mode="continuous")
        self._set("speed_setting_deg_s", speed_deg_s)
        epoch = self.tags["epoch"]
        try:
            lost = self._link.hold(forward, seconds, lambda: self.stop is not Stop.NO)
            report = self._followed(start_deg, start_s, epoch)
        finally:
            # As with a move: who presses the next key at the page has mode and speed that were set there.
            if not self._taken_by:
                self._set("speed_setting_deg_s", before["speed_setting_deg_s"])
                if before["mode"] != "continuous" and self.tags["at_rest"]:
                    self._link.ask("mode", mode=before["mode"])
        if lost is not None and report.done:
            raise CommandRefused(f"the key was let go before its time: {lost}")
        return report

    def test_brake(self) -> BrakeTestReport:
        """Give torque both ways against the closed brake, with power off."""
        self.take()
        self._arm("brake_test")
        # The phase is back at idle a status frame before the result is in the tags, so the count is what tells.
        before = self._link.look()["brake_tests"]
        begun = self._link.ask("brake_test")["journal"]
        self._wait(lambda tags: tags["journal_sequence"] >= begun and tags["brake_test_phase"] == "idle")
        self._until(lambda tags: bool(tags["brake_tests"] != before))
        self._tested = True
        self._raise_alarm()
        return self.brake_test_report()

    def brake_test_report(self) -> BrakeTestReport:
        """Report of the test of this command at the service; without outcome and figures until it has made one."""
        tags, tested = self.tags or self.look(), self._tested
        # What the brake bore in an earlier test, of another day, is no figure of this command.
        return BrakeTestReport(
            outcome=BrakeTestOutcome[tags["brake_test_result"].upper()] if tested else BrakeTestOutcome.NONE,
            detail=tags["brake_test_text"] if tested else "",
            level_nm=tags["brake_test_level_nm"],
            plus_nm=_number(tags["brake_test_plus_nm"]) if tested else math.nan,
            minus_nm=_number(tags["brake_test_minus_nm"]) if tested else math.nan,
            moved_deg=tags["brake_test_moved_deg"] if tested else 0.0,
            limit_deg=tags["brake_test_limit_deg"],
            due=brake_due(self.machine, tags),
        )

    def reset(self) -> str:
        """Reset what holds the axis; what was done, in words.

        Raises:
            CommandRefused: something locked has come since `look`.
        """
        locked = bool(self.tags and self.tags["reset_locked"])
        try:
            self._connect()
            return self._reset(locked)
        finally:
            self.close("reset")

    def _reset(self, locked: bool) -> str:
        if self.tags["reset_locked"] and not locked:
            raise CommandRefused("something locked has come since you looked: look, then ask again")
        before = held_codes(self.tags)
        if locked:
            self._arm("reset_locked")
        asked = self._link.ask("reset")["journal"]
        self._until(lambda tags: bool(tags["journal_sequence"] >= asked and tags["alarm_count"] == 0))
        left = {row["code"] for row in self._link.look()["alarms"]}
        gone = [code for code in before if code not in left]
        done = f"{', '.join(gone)} reset" if gone else "nothing to reset"
        return f"{done}; still there: {', '.join(sorted(left))}" if left else done

    # --- how it does it ------------------------------------------------------------------------------------------

    def _set(self, tag: str, value: float) -> None:
        self._link.ask("set", tag=tag, value=value)

    @property
    def _taken_by(self) -> str:
        """Who else has control now; "" for nobody. What that person does is not this command's to end."""
        mine = self.tags["authority_client"] in ("", self._link.client)
        return "" if mine else str(self.tags["authority_user"])

    def _followed(self, start_deg: float, start_s: float, epoch: int) -> MotionReport:
        """Wait for the end of the motion that was begun in an epoch.

        Raises:
            CommandRefused: somebody else has taken control.
        """
        self._wait(
            lambda tags: (
                (tags["at_rest"] and (tags["in_position"] or self.stop is not Stop.NO))
                or not tags["power"]
                or bool(self._taken_by)
            )
        )
        self._raise_alarm()
        if self._taken_by:
            raise CommandRefused(_no_control(Words.HAS_TAKEN_CONTROL(user=self._taken_by)))
        # Whoever stops, here or elsewhere, begins an epoch; whoever switches off does not.
        stopped = self.stop is not Stop.NO or self.tags["epoch"] != epoch or not self.tags["power"]
        ending = self.stopped_as if stopped else Ending.DONE
        return MotionReport(ending, start_deg, self.angle_deg, start_s, self.tags["time_s"])

    def _wait(self, holds: Callable[[Tags], bool]) -> None:
        """Look until the tags show something; signs of life and stop requests go out meanwhile."""
        # Without a sign of life for 2 s control is free for others.
        sent = Stop.NO
        self._link.look()
        while not holds(self._link.look()):
            self._link.alive()
            if self.stop > sent:
                sent = self.stop
                self._link.ask("stop" if sent is Stop.RAMP else "quick_stop")

    def _until(self, holds: Callable[[Tags], bool]) -> None:
        """Look until what was done shows, but not for long: the reply is faster than the tags."""
        for _ in range(SHOWN_FRAMES):
            if holds(self._link.look()):
                return

    def _raise_alarm(self) -> None:
        first = next((row for row in self.tags["alarms"] if row["first_out"]), None)
        if first is not None:
            raise AlarmStop(first["text"], first["code"])

    def _arm(self, action: str) -> None:
        """Arm an action, or wait until somebody else has.

        Raises:
            CommandRefused: it was not armed in time.
        """
        # One person arms and another executes where the service was started with --second-person (decision 0014).
        if not self.tags["second_person"]:
            self._link.ask("arm", action=action)
            return
        word = action.replace("_", "-")
        tell(f"another person must arm it now: the page, or `gantryctl arm {word}`")
        left = math.ceil(_OTHER_S / FRAME_S)

        def armed(tags: Tags) -> bool:
            nonlocal left
            left -= 1
            return tags["armed_action"] == action or left < 0 or self.stop is not Stop.NO

        self._wait(armed)
        if self.tags["armed_action"] != action:
            raise CommandRefused(f"{Code.SEC_10} · nobody has armed {word}: nothing was done")


def brake_due(machine: Machine, tags: Tags) -> BrakeDue:
    """When the next brake test is due."""
    return BrakeDue(
        tags["brake_test_due_at"],
        tags["brake_test_cycles_left"],
        overdue=tags["brake_test_overdue"],
        overdue_deg_s=deg(speed_settings(machine).brake_overdue_rad_s),
    )


def held_codes(tags: Tags) -> list[str]:
    """Codes of what holds the axis; of an earlier stop, that of its alarm."""
    # What the axis itself says is words: what stopped it is among the alarms.
    reasons = [row for row in tags["blocked_by_messages"] if isinstance(row, dict) and "reason" in row]
    return [row["code"] for row in tags["alarms"]] + [
        row["values"].get("stopped_by", row["reason"]) for row in reasons
    ]


def _number(value: float | None) -> float:
    return math.nan if value is None else value


def _no_control(reason: Said) -> str:
    refused = refusal(Code.SEC_07, reason=reason)
    return f"{refused.code} · {refused.text}"
