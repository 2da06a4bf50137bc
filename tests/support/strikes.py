"""Each process of a service is frozen for a time or killed, at rest, in a jog and in a move: what the axis does then.

`python -m support.strikes ROOT` strikes the virtual gantry, with `can` behind it a virtual drive on a CAN bus over
multicast, for which it needs a network namespace of its own; names of processes strike those only, and `kills` kills
only. Prints JSON.
"""

from __future__ import annotations

import json
import math
import os
import signal
import subprocess
import sys
import time
from collections.abc import Iterator, Mapping, Sequence
from contextlib import ExitStack, contextmanager, suppress
from pathlib import Path
from typing import Any, NamedTuple

from gantryctl.drives.virtual.side_channel.control import ControlClient
from gantryctl.engineering.stops import StopClass, worst_stop
from gantryctl.machine import Machine, default_machine, load_machine
from gantryctl.service.protocol.roles import Role
from gantryctl.service.recorder.journal.proof import verify
from gantryctl.service.recorder.journal.reading import read_journal
from gantryctl.service.supervisor.users import Users
from support.controller_death import silent_stop
from support.killed_on_bus import machine_file, until_said
from support.service_process import PASSWORD, Service

VICTIMS = ("recorder", "gateway", "controller", "supervisor")
STATES = ("at rest", "jog", "move")
KILL = math.inf
FROZEN_S = (0.1, 0.5, 2.0, 5.0, KILL)
SPEED_DEG_S = 1.0
PRESSES = 10
"""A computer that is busy loses a key now and then, or a virtual drive its time; it is begun anew."""
WITHIN_S = 0.2
"""Between the reading of the angle and the signal, and between two looks at it afterwards, on a busy computer."""

STOPPED_S = 3.0
"""Longer than any stop of the table from this speed; power is off before the brake holds."""


class Strike(NamedTuple):
    """What is done to which process, and when; `frozen_s` is KILL for a kill."""

    victim: str
    state: str
    frozen_s: float

    @property
    def loses_key(self) -> bool:
        """Whether a key that is held is let go by it: the gateway is away for longer than a lease."""
        return self.victim in ("gateway", "controller") and self.frozen_s > 0.3


def limit_deg(machine: Machine, strike: Strike, bus: bool) -> float:
    """Way from the strike to rest by the stop table; inf where the motion goes on."""
    moving = strike.state != "at rest"
    speed = SPEED_DEG_S if moving else 0.0
    before = speed * WITHIN_S + 0.02
    ramp = worst_stop(machine, StopClass.JOG_RELEASE, SPEED_DEG_S).angle_deg if moving else 0.0
    if strike.victim == "controller":
        if bus:
            return before + (silent_stop(machine, speed).angle_deg if moving else 0.0)
        # The plant of the virtual gantry stands still with its scan: a key is let go, a move goes on.
        if strike.state == "at rest":
            return before
        return before + ramp + speed * 0.3 if strike.loses_key and strike.state == "jog" else math.inf
    if strike.victim == "supervisor" and strike.frozen_s == KILL:
        return before + ramp
    if strike.loses_key and strike.state == "jog":
        return before + ramp + speed * (machine.monitors.lease_ms * 1e-3 + 0.05)
    return math.inf if moving else before


def words(strike: Strike, bus: bool) -> str:
    """What the journal must say; "" for what does no harm and is too short to be told."""
    killed = strike.frozen_s == KILL
    match strike.victim:
        case "controller" if killed:
            return "SYS-05"
        # On a bus the drive has stopped by itself: that is told, or the lateness, whatever came first.
        case "controller" if bus:
            return "STOP ·"
        case "supervisor" if killed:
            return "SYS-06 supervisor"
        case _ if killed:
            return f"SYS-06 {strike.victim}"
        case "gateway" | "controller" if strike.loses_key and strike.state == "jog":
            return "hold-to-run"
        case victim if strike.frozen_s > 1.0:
            return f"{victim} was held up"
    return ""


class Struck:
    """A service that is struck again and again.

    Args:
        root: state root. machine: that it runs, of `config` unless it is the virtual gantry.
        true: side channel of the drive on a bus, None for the virtual gantry.
    """

    def __init__(self, root: Path, machine: Machine, config: Path | None, true: ControlClient | None) -> None:
        self.root, self.machine, self.true = root, machine, true
        self._options = [] if config is None else ["--config", str(config)]
        self.service = self._started()
        self.page = self.service.page("service")
        self.lease, self.begun_anew = "", 0

    def _started(self) -> Service:
        service = Service(self.root, *self._options)
        service.directory = self.root / self.machine.name
        return service.__enter__()

    def strike(self, strike: Strike) -> dict[str, Any]:
        """Strike once; what came of it."""
        self.begun_anew = 0
        self.bring_to(strike.state)
        seen = len(self.texts())
        lost = self.page.tags["trace_rows_lost"]
        pid = self.service.process.pid if strike.victim == "supervisor" else self.service.child(strike.victim)
        begin_deg = self.angle_deg()
        os.kill(pid, signal.SIGKILL if strike.frozen_s == KILL else signal.SIGSTOP)
        struck_s = time.monotonic()
        if strike.frozen_s != KILL:
            self.wait(strike.frozen_s)
            with suppress(
                ProcessLookupError
            ):  # so late that the supervisor took it for hung: the journal tells it
                os.kill(pid, signal.SIGCONT)
            struck_s = time.monotonic()
        back_s = self.back(strike, struck_s)
        rest_deg = self.rested(strike)
        if self.true is not None:
            self.wait(max(0.0, struck_s + STOPPED_S - time.monotonic()))
            rest_deg = self.angle_deg()
        limit, wanted = (
            limit_deg(self.machine, strike, self.true is not None),
            words(strike, self.true is not None),
        )
        told = self.texts()[seen:]
        until_s = time.monotonic() + 10.0
        while not any(wanted in text for text in told) and time.monotonic() < until_s:
            self.wait(0.1)
            told = self.texts()[seen:]
        # The plant of the virtual gantry dies with its controller.
        judged = math.isfinite(limit) and not (
            self.true is None and strike.victim == "controller" and strike.frozen_s == KILL
        )
        way_deg = abs(rest_deg - begin_deg)
        return {
            "victim": strike.victim,
            "state": strike.state,
            "strike": "kill" if strike.frozen_s == KILL else f"frozen {strike.frozen_s:g} s",
            "way_deg": round(way_deg, 3) if judged else None,
            "limit_deg": round(limit, 3) if judged else None,
            "back_s": round(back_s, 2),
            "begun_anew": self.begun_anew,
            "told": next((text for text in told if wanted in text), "") if wanted else None,
            "rows_lost": int(self.page.tags["trace_rows_lost"])
            - (0 if strike.victim in ("controller", "supervisor") else lost),
            "right": (not judged or way_deg <= limit)
            and (not wanted or any(wanted in text for text in told)),
        }

    def texts(self) -> list[str]:
        return [row.values["text"] for row in read_journal(self.service.directory, limit=1_000_000)]

    def angle_deg(self) -> float:
        """True angle, motor side, on a bus; else as the page shows it."""
        if self.true is not None:
            return math.degrees(self.true.ask("truth")["pos_motor_rad"]) / self.machine.axis.ratio
        return self.angle_shown_deg()

    def angle_shown_deg(self) -> float:
        """Angle of the next picture; NaN while it is not known."""
        shown = self.page.look()["pos_act_deg"]
        return math.nan if shown is None else float(shown)

    def bring_to(self, state: str) -> None:
        """Power on, at rest, in a jog or in a move at full speed; begun anew when an alarm or a lost key ends it.

        `begun_anew` counts that: a virtual drive that gets no processor for some scans stops its axis, as a real one
        would.
        """
        for _ in range(PRESSES):
            if self._stands() and (state == "at rest" or self._moves(state)):
                return
            self.begun_anew += 1
        raise AssertionError(f"not {state} after {PRESSES} times: {self.page.tags}")

    def _stands(self) -> bool:
        """Whether it is at rest with power on, alarms reset."""
        page, self.lease = self.page, ""
        self.ask("take", over=True)
        if page.tags["alarm_count"] or page.tags["blocked_by"]:
            page.until(lambda tags: tags["power_phase"] == "off")
            if page.tags["reset_locked"]:
                self.ask("arm", action="reset_locked")
            page.ask("reset")
            page.look()
        if not page.tags["power"]:
            try:
                self.ask("power", on=True)
            except AssertionError:
                return False
        page.until(lambda tags: bool(tags["at_rest"] and tags["power"]) or self._ended(tags))
        if self._ended(page.tags):
            return False
        self.ask("set", tag="speed_setting_deg_s", value=SPEED_DEG_S)
        return True

    @staticmethod
    def _ended(tags: Mapping[str, Any]) -> bool:
        return bool(tags["alarm_count"] or tags["blocked_by"])

    def _moves(self, state: str) -> bool:
        """Whether it came to full speed in a jog, whose key stays held, or in a move."""
        page = self.page
        forward = page.tags["pos_ref_deg"] < 0.0
        fast = 0.98 * SPEED_DEG_S
        if state == "jog":
            self.ask("mode", mode="continuous")
            self.lease = os.urandom(8).hex()
            self.ask("jog", lease=self.lease, direction="forward" if forward else "reverse")
        else:
            self.ask("move", target_deg=60.0 if forward else -60.0)
        began = False

        def over(tags: Mapping[str, Any]) -> bool:
            nonlocal began
            vel = abs(tags["vel_act_deg_s"] or 0.0)
            began = began or vel > 0.02
            return vel > fast or (began and tags["at_rest"]) or self._ended(tags)

        page.until(over, renew=self.lease)
        return not self._ended(page.tags) and abs(page.tags["vel_act_deg_s"] or 0.0) > fast

    def ask(self, kind: str, **values: Any) -> None:
        """A command; sent again when the picture was too old."""
        for _ in range(20):
            reply = self.page.ask(kind, **values)
            if reply["ok"]:
                return
            self.page.look()
        raise AssertionError(reply)

    def wait(self, seconds: float) -> None:
        """Let time pass; a key stays held, and control is kept."""
        end_s = time.monotonic() + seconds
        while time.monotonic() < end_s:
            with suppress(Exception):
                self.page.say("renew", lease=self.lease) if self.lease else self.page.say("alive")
            time.sleep(0.03)

    def back(self, strike: Strike, struck_s: float) -> float:
        """Wait until everything works again: page, local socket, controller and journal."""
        if strike.victim == "supervisor" and strike.frozen_s == KILL:
            self.wait(1.0)
            self.service.end()
            until_s = time.monotonic() + 30.0
            while True:  # the others end in order first
                struck_s = time.monotonic()
                try:
                    self.service = self._started()
                    break
                except AssertionError:
                    assert time.monotonic() < until_s
        until_s = time.monotonic() + 60.0
        renewed = strike.victim in ("gateway", "supervisor") or strike.frozen_s == KILL
        while time.monotonic() < until_s:
            with suppress(Exception):
                if renewed:
                    self.page.__exit__()
                    self.page = self.service.page("service")
                self.page.look()
                # The reply of `set` waits for the disk: gateway, controller and recorder have all done their part.
                if self.page.ask("take", over=True)["ok"] and self._set_and_kept():
                    return time.monotonic() - struck_s
            time.sleep(0.05)
        raise AssertionError(f"not back after 60 s: {strike}")

    def _set_and_kept(self) -> bool:
        self.page.look()
        reply = self.page.ask("set", tag="increment_deg", value=1.0)
        return bool(reply["ok"] and not reply["code"])

    def rested(self, strike: Strike) -> float:
        """Let the key go if it is held, end a move that goes on, and wait for rest; the angle shown before that.

        What a strike ends comes to rest by itself. A move goes on, however long recorder or gateway are away, until it
        is stopped here: its way of up to 120 deg is longer than anybody waits.
        """
        limit = limit_deg(self.machine, strike, self.true is not None)
        if not (math.isinf(limit) and strike.state == "move"):
            self.page.until(lambda tags: tags["at_rest"] or not tags["power"])
        self.page.ask("stop")
        at = self.angle_shown_deg()
        self.page.until(lambda tags: bool(tags["at_rest"]) or not tags["power"])
        return at


@contextmanager
def machine_to_strike(root: Path, can: bool) -> Iterator[Struck]:
    """The service on the virtual gantry, or on a virtual drive."""
    Users(root).add("service", Role.SERVICE, PASSWORD)
    with ExitStack() as stack:
        if not can:
            struck = Struck(root, default_machine(), None, None)
        else:
            control = root / "drive.sock"
            config = machine_file(root, control)
            run = [sys.executable, "-m", "gantryctl"]
            environment = {**os.environ, "GANTRYCTL_STATE": str(root), "PYTHONUNBUFFERED": "1"}
            drive = subprocess.Popen(
                [*run, "drive", "sim", "--config", str(config), "--can", "udp_multicast", "--channel",
                 "239.74.163.2", "--control", str(control)],
                stdout=subprocess.PIPE, text=True, env=environment,
            )  # fmt: skip
            stack.callback(_ended, drive)
            until_said(drive, "side channel")
            zero = ["encoder", "set-zero", "--config", str(config), "--angle", "0", "--witness", "test"]
            subprocess.run([*run, *zero], check=True, stdout=subprocess.DEVNULL, env=environment)
            true = stack.enter_context(ControlClient(control))
            struck = Struck(root, load_machine(config), config, true)
        try:
            yield struck
        finally:
            struck.service.end()


def _ended(process: subprocess.Popen[str]) -> None:
    process.send_signal(signal.SIGINT)
    process.communicate(timeout=60)


def strikes(root: Path, can: bool, victims: Sequence[str] = VICTIMS) -> dict[str, Any]:
    """All strikes, and what the journal looks like afterwards."""
    runs = []
    with machine_to_strike(root, can) as struck:
        for victim in victims:
            for state in STATES:
                for frozen_s in FROZEN_S:
                    runs.append(struck.strike(Strike(victim, state, frozen_s)))
                    sys.stderr.write(f"{json.dumps(runs[-1])}\n")
        directory = struck.service.directory
    rows = read_journal(directory, limit=1_000_000)
    numbers: dict[tuple[int, int], list[int]] = {}
    for row in rows:
        if row.values["boot"]:
            numbers.setdefault((row.values["boot"], row.values["source"]), []).append(row.values["number"])
    gaps = sum(found != list(range(1, len(found) + 1)) for found in numbers.values())
    return {"runs": runs, "journal": verify(directory).wrong or "intact", "gaps_in_numbers": gaps}


def kills(root: Path, can: bool, victims: Sequence[str] = VICTIMS) -> dict[str, Any]:
    """Kills only, each of a machine of its own.

    A controller that is killed under power leaves an axis whose angle nobody has kept: after some ways the next start
    wants its witness mark read (ENC-08), and nothing could be struck any more.
    """
    runs, wrong = [], []
    for number, (victim, state) in enumerate((victim, state) for victim in victims for state in STATES):
        place = root / str(number)
        place.mkdir()
        with machine_to_strike(place, can) as struck:
            runs.append(struck.strike(Strike(victim, state, KILL)))
            sys.stderr.write(f"{json.dumps(runs[-1])}\n")
            directory = struck.service.directory
        wrong.append(verify(directory).wrong)
    return {"runs": runs, "journal": next(filter(None, wrong), "intact")}


if __name__ == "__main__":
    asked = sys.argv[2:]
    named = [victim for victim in VICTIMS if victim in asked]
    strike_all = kills if "kills" in asked else strikes
    print(json.dumps(strike_all(Path(sys.argv[1]), "can" in asked, named or VICTIMS)))
