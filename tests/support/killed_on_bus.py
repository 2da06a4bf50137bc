"""Run in a network namespace of its own: service and virtual drive on a CAN bus over multicast, controller killed.

Prints what was measured as JSON. Not a test itself; test_service_can.py runs it.
"""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

from gantryctl.drives.virtual.side_channel.control import ControlClient
from gantryctl.machine import load_machine
from gantryctl.service.clients.link import ServiceLink
from support.controller_death import kill_in_motion as death


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


def until(link: ServiceLink, reached: Callable[[dict[str, Any]], bool]) -> None:
    """Wait for a state; an alarm before it is no measurement, and its words say why."""
    end_s = time.monotonic() + 60.0
    while not reached(link.look()):
        if link.tags["alarms"]:
            raise SystemExit(f"before the kill: {link.tags['alarms'][0]['text']}")
        if time.monotonic() > end_s:
            raise SystemExit(f"before the kill: not within 60 s: {link.tags}")
        link.alive()


def kill_in_motion(
    root: Path, config: Path, service: int, control: Path, speed_deg_s: float
) -> dict[str, object]:
    with ServiceLink(root / "hust_can") as link, ControlClient(control) as true:
        link.ask("take", over=False)
        link.ask("power", on=True)
        until(link, lambda tags: tags["power"])
        link.ask("set", tag="speed_setting_deg_s", value=speed_deg_s)
        link.ask("move", target_deg=60.0)
        until(link, lambda tags: tags["vel_act_deg_s"] >= 0.999 * speed_deg_s)
        return death(true.ask, load_machine(config), child(service, "controller"))


if __name__ == "__main__":
    print(json.dumps(measure(Path(sys.argv[1]), float(sys.argv[2]))))
