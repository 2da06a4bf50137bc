"""A virtual drive and a controller as two processes on a CAN bus made of UDP multicast, in a network of their own.

Runs inside `private_network.sh`: `python can_processes.py SCENARIO FOLDER`; prints one JSON object.
"""

from __future__ import annotations

import json
import math
import os
import signal
import subprocess
import sys
import time
from contextlib import suppress
from pathlib import Path

import numpy as np

from gantryctl.drives.virtual.side_channel.control import ControlClient
from gantryctl.errors import DeviceError
from gantryctl.machine import configs_folder
from gantryctl.trace.reader import read_trace

COMMAND = [sys.executable, "-m", "gantryctl"]
LATE_MS = 30.0
"""A stall longer than this is a quick stop."""
FAST = "\n[virtual_axis]\nacc_deg_s2 = 2.0\ndec_deg_s2 = 2.0\n"


class Bus:
    """The drive's process, and a machine file for the controller."""

    def __init__(self, folder: Path, period_ms: float, *options: str) -> None:
        self.folder = folder
        self.socket = folder / "drive.sock"
        text = (configs_folder() / "hust_can.toml").read_text(encoding="utf-8")
        text = text.replace('interface = "simulated"', 'interface = "udp_multicast"')
        text = text.replace(
            "commissioning_required = true\n", "commissioning_required = false\nanswer_ms = 4.0\n"
        )
        text = text.replace("scan_period_ms = 4.0", f"scan_period_ms = {period_ms}")
        if period_ms < 6.0:
            text = text.replace("answer_ms = 4.0", "answer_ms = 2.0")
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
        for _ in range(3000):
            if abs(self.truth()[2]) >= speed_deg_s:
                return
            if master.poll() is not None:
                break
            time.sleep(0.01)
        self.end()
        master.kill()
        raise SystemExit(f"{speed_deg_s} deg/s were never reached: {master.communicate()}")

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


def kill_master(folder: Path) -> dict[str, object]:
    """SIGKILL of the controller at 6 deg/s; ways by the drive's own account."""
    bus = Bus(folder, 10.0)
    master = bus.start("move", "150", "--json", "--no-trace")
    bus.wait_for_speed(5.95, master)
    time.sleep(0.5)
    master.kill()
    begun_s, angle, speed = bus.truth()
    master.wait()
    at_rest_s = math.nan
    for _ in range(600):
        time.sleep(0.005)
        now_s, _, vel = bus.truth()
        if math.isnan(at_rest_s) and abs(vel) < 0.05:
            at_rest_s = now_s - begun_s
    _, end, _ = bus.truth()
    status = bus.ask("status")
    bus.end()
    return {
        "speed_deg_s": speed, "way_deg": end - angle, "rest_s": at_rest_s, "state": status["state"],
        "brake_open": status["brake_open"], "error_code": status["error_code"],
    }  # fmt: skip


def kill_drive(folder: Path) -> dict[str, object]:
    """SIGKILL of the drive in motion: what the controller says."""
    bus = Bus(folder, 10.0)
    master = bus.start("move", "60", "--json", "--no-trace")
    bus.wait_for_speed(2.0, master)
    bus.drive.kill()
    out, err = master.communicate()
    return {"out": json.loads(out), "err": err}


def stall(folder: Path, *stalls_ms: str) -> dict[str, object]:
    """The controller held by SIGSTOP for a time while it speeds up and in the cruise of `move 90`, at 250 Hz."""
    found: dict[str, object] = {}
    bus = Bus(folder, 4.0)
    for pid in (0, bus.drive.pid):  # a drive does not wait for a processor, nor does the end of the stall
        with suppress(OSError):
            os.sched_setscheduler(pid, os.SCHED_FIFO, os.sched_param(30))
    for number, stall_ms in enumerate(stalls_ms):
        out = folder / str(number)
        master = bus.start("move", str(90 - 90 * (number % 2)), "--json", "--out", str(out))
        bus.wait_for_speed(3.0, master)  # half of the ramp
        hold(master.pid, float(stall_ms))
        if master.poll() is None and float(stall_ms) <= LATE_MS:
            bus.wait_for_speed(5.95, master)
            time.sleep(2.0)
            hold(master.pid, float(stall_ms))
        text, err = master.communicate()
        end = json.loads(text)
        found[stall_ms] = {
            **stalled(next(out.glob("*.parquet"))),
            "result": end["result"],
            "alarms": end["alarms"],
        }
        found[stall_ms]["err"] = err[-600:]
    bus.end()
    return found


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
    scenarios = {"move": move, "kill_master": kill_master, "kill_drive": kill_drive, "stall": stall}
    print(json.dumps(scenarios[sys.argv[1]](Path(sys.argv[2]), *sys.argv[3:])))
