"""Run in a network namespace of its own: service and virtual drive on a CAN bus over multicast, controller killed.

Prints what was measured as JSON. Not a test itself; test_service_can.py runs it.
"""

from __future__ import annotations

import json
import math
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

from gantryctl.drives.virtual.side_channel.control import ControlClient
from gantryctl.engineering.stops import StopClass, worst_stop
from gantryctl.machine import load_machine
from gantryctl.machine.rules.reaction import REACTION_S
from gantryctl.service.clients.link import ServiceLink


def machine_file(root: Path, control: Path) -> Path:
    text = (Path(__file__).parents[2] / "configs" / "hust_can.toml").read_text(encoding="utf-8")
    text = text.replace(
        'interface = "simulated" ', f'interface = "udp_multicast"\nside_channel = "{control}" '
    )
    text = text.replace('channel = "" ', 'channel = "239.74.163.2" ')
    text = text.replace("commissioning_required = true", "commissioning_required = false")
    if "commissioning_required" not in text:
        text = text.replace("[can]\n", "[can]\ncommissioning_required = false\n")
    path = root / "machine.toml"
    path.write_text(text + "\n[virtual_axis]\nacc_deg_s2 = 1.0\ndec_deg_s2 = 1.0\n", encoding="utf-8")
    return path


def child(parent: int, name: str) -> int:
    found = subprocess.run(
        ["ps", "-o", "pid=,args=", "--ppid", str(parent)], capture_output=True, text=True, check=True
    )
    return next(
        int(line.split()[0]) for line in found.stdout.splitlines() if f"gantryctl.service.{name} " in line
    )


def until_said(process: subprocess.Popen[str], words: str) -> None:
    assert process.stdout is not None
    for line in process.stdout:
        if words in line:
            return
    raise AssertionError(f"{words!r} was never said")


def measure(root: Path, speed_deg_s: float) -> dict[str, object]:
    control = root / "drive.sock"
    config = machine_file(root, control)
    run = [sys.executable, "-m", "gantryctl"]
    at = {"env": {**os.environ, "GANTRYCTL_STATE": str(root), "PYTHONUNBUFFERED": "1"}}
    drive = subprocess.Popen(
        [*run, "drive", "sim", "--config", str(config), "--can", "udp_multicast", "--channel", "239.74.163.2",
         "--control", str(control)],
        stdout=subprocess.PIPE, text=True, **at,
    )  # fmt: skip
    try:
        until_said(drive, "side channel")
        zero = ["encoder", "set-zero", "--config", str(config), "--angle", "0", "--witness", "test"]
        subprocess.run([*run, *zero], check=True, stdout=subprocess.DEVNULL, **at)
        service = subprocess.Popen(
            [*run, "serve", "--no-page", "--config", str(config)],
            stdout=subprocess.PIPE, text=True, **at,
        )  # fmt: skip
        try:
            until_said(service, "Ctrl-C")
            return kill_in_motion(root, config, service.pid, control, speed_deg_s)
        finally:
            service.send_signal(signal.SIGINT)
            service.communicate(timeout=60)
    finally:
        drive.send_signal(signal.SIGINT)
        drive.communicate(timeout=60)


def kill_in_motion(
    root: Path, config: Path, service: int, control: Path, speed_deg_s: float
) -> dict[str, object]:
    with ServiceLink(root / "hust_can") as link, ControlClient(control) as true:
        link.ask("take", over=False)
        link.ask("power", on=True)
        while not link.look()["power"]:
            link.alive()
        link.ask("set", tag="speed_setting_deg_s", value=speed_deg_s)
        link.ask("move", target_deg=60.0)
        while link.look()["vel_act_deg_s"] < 0.999 * speed_deg_s:
            assert not link.tags["alarms"], link.tags["alarms"]  # a computer that is too busy: no measurement
            link.alive()
        pid = child(service, "controller")
        machine = load_machine(config)
        per_rad = math.degrees(1.0) / machine.axis.ratio
        before = true.ask("truth")["pos_motor_rad"] * per_rad
        os.kill(pid, signal.SIGKILL)
        begin_s = time.monotonic()
        last, still_s = before, begin_s
        while time.monotonic() - still_s < 1.0 and time.monotonic() - begin_s < 30.0:
            now = true.ask("truth")["pos_motor_rad"] * per_rad
            if abs(now - last) > 0.001:
                last, still_s = now, time.monotonic()
        angle = worst_stop(machine, StopClass.QUICK, speed_deg_s).angle_deg
        # the motor side carries the reading's own delay of one question beside it: a few ms
        return {
            "speed_deg_s": speed_deg_s,
            "travelled_deg": round(last - before, 4),
            "rest_after_s": round(still_s - begin_s, 3),
            "quick_stop_deg": round(angle, 4),
            "reaction_s": REACTION_S,
            "limit_deg": round(angle + REACTION_S * speed_deg_s, 4),
        }


if __name__ == "__main__":
    print(json.dumps(measure(Path(sys.argv[1]), float(sys.argv[2]))))
