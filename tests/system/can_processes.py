"""A virtual drive and a controller as two processes on a CAN bus made of UDP multicast, in a network of their own.

Runs inside `private_network.sh`: `python can_processes.py SCENARIO FOLDER`; prints one JSON object.
"""

from __future__ import annotations

import json
import math
import os
import signal
import socket
import subprocess
import sys
import time
from collections.abc import Mapping
from contextlib import suppress
from pathlib import Path
from types import MappingProxyType

import can
import numpy as np
from can.interfaces.udp_multicast.utils import pack_message

from gantryctl.drives.canopen.bus.link import UDP_GROUP
from gantryctl.drives.virtual.side_channel.control import ControlClient
from gantryctl.errors import DeviceError
from gantryctl.machine import configs_folder, load_machine
from gantryctl.trace.reader import read_trace
from support.controller_death import kill_in_motion

COMMAND = [sys.executable, "-m", "gantryctl"]
LATE_MS = 30.0
"""A stall longer than this is a quick stop."""
_TRIES = 5
# Default of python-can's udp_multicast.
_UDP_PORT = 43113
# Controller late, controller frozen, drive late: both are processes of this computer.
_BUSY = ("SYS-02", "SYS-03", "CAN-03")
FAST = "\n[virtual_axis]\nacc_deg_s2 = 2.0\ndec_deg_s2 = 2.0\n"


class Bus:
    """The drive's process, and a machine file for the controller."""

    def __init__(
        self,
        folder: Path,
        period_ms: float,
        *options: str,
        machine: str = "hust_can.toml",
        changes: Mapping[str, str] = MappingProxyType({}),
    ) -> None:
        self.folder = folder
        self.socket = folder / "drive.sock"
        text = (configs_folder() / machine).read_text(encoding="utf-8")
        text = text.replace('interface = "simulated"', 'interface = "udp_multicast"')
        text = text.replace(
            "commissioning_required = true\n", "commissioning_required = false\nanswer_ms = 4.0\n"
        )
        text = text.replace("scan_period_ms = 4.0", f"scan_period_ms = {period_ms}")
        if period_ms < 6.0:
            text = text.replace("answer_ms = 4.0", "answer_ms = 2.0")
        for old, new in changes.items():
            assert old in text
            text = text.replace(old, new)
        self.config = folder / "machine.toml"
        self.config.write_text(text + FAST, encoding="utf-8")
        self.environment = {**os.environ, "GANTRYCTL_STATE": str(folder / "state")}
        arguments = ["drive", "sim", "--can", "udp_multicast", "--config", str(self.config), "--control"]
        self.drive = subprocess.Popen(
            [*COMMAND, *arguments, str(self.socket), *options], stdout=subprocess.DEVNULL
        )
        self.ask = self._channel().ask
        self.run("encoder", "set-zero", "--angle", "0", "--witness", "virtual drive")

    def _channel(self) -> ControlClient:
        for _ in range(200):
            try:
                return ControlClient(self.socket)
            except DeviceError:
                time.sleep(0.1)
        raise SystemExit("the virtual drive did not start")

    def run(self, *arguments: str) -> subprocess.CompletedProcess[str]:
        return subprocess.run(
            [*COMMAND, *arguments, "--config", str(self.config)],
            env=self.environment,
            text=True,
            capture_output=True,
            check=False,
        )

    def start(self, *arguments: str) -> subprocess.Popen[str]:
        return subprocess.Popen(
            [*COMMAND, *arguments, "--config", str(self.config)],
            env=self.environment, text=True, stdout=subprocess.PIPE, stderr=subprocess.PIPE,
        )  # fmt: skip

    def truth(self) -> tuple[float, float, float]:
        """The drive's own time, s; angle and speed of the load, deg."""
        answer = self.ask("truth")
        return answer["time_s"], math.degrees(answer["pos_load_rad"]), math.degrees(answer["vel_load_rad_s"])

    def wait_for_speed(self, speed_deg_s: float, master: subprocess.Popen[str]) -> None:
        if self.reaches(speed_deg_s, master):
            return
        self.end()
        master.kill()
        raise SystemExit(f"{speed_deg_s} deg/s were never reached: {master.communicate()}")

    def reaches(self, speed_deg_s: float, master: subprocess.Popen[str]) -> bool:
        """Wait for a speed; False when the controller ends before."""
        for _ in range(3000):
            if abs(self.truth()[2]) >= speed_deg_s:
                return True
            if master.poll() is not None:
                return False
            time.sleep(0.01)
        return False

    def end(self) -> None:
        self.drive.send_signal(signal.SIGINT)
        self.drive.wait()


def move(folder: Path) -> dict[str, object]:
    """A move in real time, 100 Hz."""
    bus = Bus(folder, 10.0)
    done = bus.run("move", "5", "--json")
    _, angle, _ = bus.truth()
    status = bus.ask("status")
    bus.end()
    return {
        "out": json.loads(done.stdout),
        "err": done.stderr,
        "load_deg": angle,
        "brake_open": status["brake_open"],
    }


def nodes(folder: Path) -> dict[str, object]:
    """Brake test, move, Ctrl-C and a lost I/O node of an axis with nodes beside its drive, 100 Hz."""
    bus = Bus(folder, 10.0, "--with-io", "--with-encoder", machine="hust_can_nodes.toml")
    try:
        tested = bus.run("brake-test", "--yes", "--json")
        moved = bus.run("move", "5", "--json", "--no-trace")
        load_deg = bus.truth()[1]
        stopped = bus.start("move", "40", "--json", "--no-trace")
        bus.wait_for_speed(3.0, stopped)
        stopped.send_signal(signal.SIGINT)
        ended = json.loads(stopped.communicate()[0])
        lost = _lost_node(bus)
        reset = bus.run("reset")
        again = bus.run("move", "0", "--json", "--no-trace")
        return {
            "brake_test": tested.returncode, "move": json.loads(moved.stdout), "load_deg": load_deg,
            "stop": ended, **lost, "reset": reset.returncode, "again": json.loads(again.stdout),
        }  # fmt: skip
    finally:
        bus.end()


def killed_watchdog(folder: Path) -> dict[str, object]:
    """The step `watchdog` in real time, 100 Hz, with a drive that watches nothing and its enable on the I/O node."""
    bus = Bus(
        folder, 10.0, "--with-io", "--with-encoder", "--personality", "unwatched",
        machine="hust_can_nodes.toml", changes={"\nwatchdog = 1\n": "\ndrive_enable = 1\n"},
    )  # fmt: skip
    step = ("commission", "--only", "watchdog", "--yes", "--out", str(folder / "report"))
    try:
        found = {"sound": bus.run(*step).stdout, "load_deg": bus.truth()[1]}
        bus.ask("node", node=3, fault="error_values_ignored", value=True)
        found["liar"] = bus.run(*step).stdout
        return found
    finally:
        bus.end()


def _lost_node(bus: Bus) -> dict[str, object]:
    """The I/O node off the bus at 3 deg/s, and back after the stop."""
    for _ in range(_TRIES):
        master = bus.start("move", "-40", "--json", "--no-trace")
        bus.wait_for_speed(3.0, master)
        begun = bus.truth()[1]
        bus.ask("node", node=3, fault="silent", value=True)
        alarms = json.loads(master.communicate()[0])["alarms"]
        bus.ask("node", node=3, fault="silent", value=False)
        if alarms[0].split()[0] not in _BUSY:
            status = bus.ask("status")
            way = abs(bus.truth()[1] - begun)
            return {"alarms": alarms, "way_deg": way, "brake_open": status["brake_open"]}
        bus.run("reset")
    raise SystemExit(f"this computer was late by itself {_TRIES} times")


def kill_master(folder: Path) -> dict[str, object]:
    """SIGKILL of the controller at 6 deg/s; the way by the drive's own account."""
    bus = Bus(folder, 10.0)
    machine = load_machine(bus.config)
    try:
        for _ in range(_TRIES):
            here = bus.truth()[1]
            master = bus.start("move", "-150" if here > 45.0 else "150", "--json", "--no-trace")
            if bus.reaches(5.95, master):
                time.sleep(0.5)
                # A computer that is late has begun a stop of its own: that is no kill at 6 deg/s.
                if abs(bus.truth()[2]) > 5.9 and bus.ask("status")["state"] == "ENABLED":
                    found = kill_in_motion(bus.ask, machine, master.pid)
                    master.wait()
                    return found
            text, err = master.communicate()
            codes = [alarm.split()[0] for alarm in json.loads(text)["alarms"]]
            if not codes or codes[0] not in _BUSY:
                raise SystemExit(f"before the kill: {codes}, {err}")
            bus.run("reset")
        raise SystemExit(f"before the kill: this computer was late by itself {_TRIES} times: {err}")
    finally:
        bus.end()


def kill_drive(folder: Path) -> dict[str, object]:
    """SIGKILL of the drive in motion: what the controller says."""
    bus = Bus(folder, 10.0)
    master = bus.start("move", "60", "--json", "--no-trace")
    bus.wait_for_speed(2.0, master)
    bus.drive.kill()
    out, err = master.communicate()
    return {"out": json.loads(out), "err": err}


def flood(folder: Path, period_ms: str, data_bytes: str) -> dict[str, object]:
    """10 000 foreign frames a second for a second, in the cruise of 3 deg/s; the way by the drive's own account.

    `tried`: alarms of every run, those included that this computer has held up by itself.
    """
    bus = Bus(folder, float(period_ms))
    tried: list[str] = []
    try:
        for _ in range(_TRIES):
            here = bus.truth()[1]
            target = "-60" if here > 30.0 else "60"
            master = bus.start("move", target, "--speed", "3", "--json", "--no-trace")
            flooded = bus.reaches(2.95, master)
            begun = bus.truth()[1]
            if flooded:
                foreign_frames(0x7F, int(data_bytes), 10_000, 1.0)
            alarms = json.loads(master.communicate()[0])["alarms"]
            tried += alarms
            if flooded and not (alarms and alarms[0].split()[0] in _BUSY):
                return {"alarms": alarms, "tried": tried, "way_deg": abs(bus.truth()[1] - begun)}
            bus.run("reset")
        raise SystemExit(f"this computer was late by itself {_TRIES} times")
    finally:
        bus.end()


def foreign_frames(can_id: int, data_bytes: int, per_s: int, seconds: float) -> None:
    """Put frames on the bus as fast as another node would."""
    message = can.Message(arbitration_id=can_id, data=bytes(data_bytes), is_extended_id=False)
    packed, begun_s, sent = pack_message(message), time.monotonic(), 0
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as sender:
        while (elapsed_s := time.monotonic() - begun_s) < seconds:
            for _ in range(int(elapsed_s * per_s) - sent):
                sender.sendto(packed, (UDP_GROUP, _UDP_PORT))
                sent += 1
            time.sleep(0.0005)


def stall(folder: Path, *stalls_ms: str) -> dict[str, object]:
    """The controller held by SIGSTOP for a time while it speeds up and in the cruise of `move 90`, at 250 Hz."""
    bus = Bus(folder, 4.0)
    for pid in (0, bus.drive.pid):  # a drive does not wait for a processor, nor does the end of the stall
        with suppress(OSError):
            os.sched_setscheduler(pid, os.SCHED_FIFO, os.sched_param(30))
    try:
        return {stall_ms: _stalled_run(bus, float(stall_ms)) for stall_ms in stalls_ms}
    finally:
        bus.end()


def _stalled_run(bus: Bus, stall_ms: float) -> dict[str, object]:
    """One run that this computer has not held up itself; `repeats` counts those that it has, by their own alarm."""
    for repeats in range(_TRIES):
        out = bus.folder / f"{stall_ms:g}-{repeats}"
        here = bus.truth()[1]
        master = bus.start("move", "0" if here > 45.0 else "90", "--json", "--out", str(out))
        held = _held(bus, master, stall_ms)
        text, err = master.communicate()
        end = json.loads(text)
        if held and (end["result"] == "done") is (stall_ms <= LATE_MS):
            return {
                **stalled(next(out.glob("*.parquet"))),
                "result": end["result"], "alarms": end["alarms"], "err": err[-600:], "repeats": repeats,
            }  # fmt: skip
        codes = [alarm.split()[0] for alarm in end["alarms"]]
        if not codes or codes[0] not in _BUSY:
            raise SystemExit(f"stall of {stall_ms:g} ms: {codes}, {err}")
        bus.run("reset")
    raise SystemExit(f"stall of {stall_ms:g} ms: this computer was late by itself {_TRIES} times: {err}")


def _held(bus: Bus, master: subprocess.Popen[str], stall_ms: float) -> bool:
    """Hold the controller half-way up the ramp, and in the cruise if it may go on; False if it was stopped before."""
    if not bus.reaches(3.0, master):
        return False
    hold(master.pid, stall_ms)
    if stall_ms > LATE_MS:
        return True
    if not bus.reaches(5.95, master):
        return False
    time.sleep(2.0)
    hold(master.pid, stall_ms)
    return True


def hold(pid: int, stall_ms: float) -> None:
    """Not a scan for a time."""
    if stall_ms:
        os.kill(pid, signal.SIGSTOP)
        time.sleep(stall_ms * 1e-3)
        os.kill(pid, signal.SIGCONT)


def stalled(path: Path) -> dict[str, float]:
    """Following error and torque of a whole move; what is left of them in the cruise beside their mean."""
    trace = read_trace(path)
    vel = np.abs(np.degrees(trace["vel_ref_rad_s"]))
    err, torque = np.degrees(trace["pos_err_rad"]), trace["torque_act_nm"]
    following = trace["axis_state"] > 0
    cruise = np.flatnonzero(vel > 5.999)
    cruise = cruise[250:] if len(cruise) > 500 else np.array([0])
    return {
        "following_error_deg": float(np.max(np.abs(err))),
        "torque_nm": float(np.max(np.abs(torque[following]))) if following.any() else 0.0,
        "cruise_error_deg": float(np.max(np.abs(err[cruise] - np.median(err[cruise])))),
        "cruise_torque_nm": float(np.max(np.abs(torque[cruise] - np.median(torque[cruise])))),
        "most_periods": float(np.max(np.diff(trace["time_s"])) / 0.004),
        "rows": float(len(err)),
    }


if __name__ == "__main__":
    scenarios = {
        "killed_watchdog": killed_watchdog,
        "move": move,
        "nodes": nodes,
        "kill_master": kill_master,
        "kill_drive": kill_drive,
        "stall": stall,
        "flood": flood,
    }
    print(json.dumps(scenarios[sys.argv[1]](Path(sys.argv[2]), *sys.argv[3:])))
