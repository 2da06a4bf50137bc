"""Run in a network namespace of its own: service and virtual drive on a CAN bus; the drive restarts in motion.

Prints what was seen after a reset as JSON. Not a test itself; test_service_can.py runs it.
"""

from __future__ import annotations

import json
import math
import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

from gantryctl.drives.virtual.side_channel.control import ControlClient
from gantryctl.service.clients.link import ServiceLink
from support.killed_on_bus import machine_file, until_said

RUN = [sys.executable, "-m", "gantryctl"]


class Console:
    """A person at the local socket, who looks all the time."""

    def __init__(self, link: ServiceLink) -> None:
        self.link = link

    def until(self, found: Callable[[dict[str, Any]], bool], seconds: float = 20.0) -> dict[str, Any]:
        end_s = time.monotonic() + seconds
        while time.monotonic() < end_s:
            self.link.alive()
            tags = self.link.look()
            if found(tags):
                return dict(tags)  # the link goes on writing into its own
        raise SystemExit(f"not within {seconds:g} s: {tags}")


def measure(root: Path) -> dict[str, object]:
    control = root / "drive.sock"
    config = machine_file(root, control)
    at = {"env": {**os.environ, "GANTRYCTL_STATE": str(root), "PYTHONUNBUFFERED": "1"}}
    sim = ["drive", "sim", "--can", "udp_multicast", "--channel", "239.74.163.2", "--control", str(control)]
    drive = subprocess.Popen([*RUN, *sim, "--config", str(config)], stdout=subprocess.PIPE, text=True, **at)
    try:
        until_said(drive, "side channel")
        zero = ["encoder", "set-zero", "--config", str(config), "--angle", "0", "--witness", "test"]
        subprocess.run([*RUN, *zero], check=True, stdout=subprocess.DEVNULL, **at)
        serve = [*RUN, "serve", "--no-page", "--config", str(config)]
        service = subprocess.Popen(serve, stdout=subprocess.PIPE, text=True, **at)
        try:
            until_said(service, "Ctrl-C")
            with ServiceLink(root / "hust_can") as link, ControlClient(control) as true:
                return restart_in_motion(Console(link), true)
        finally:
            service.send_signal(signal.SIGINT)
            service.communicate(timeout=60)
    finally:
        drive.send_signal(signal.SIGINT)
        drive.communicate(timeout=60)


def restart_in_motion(console: Console, true: ControlClient) -> dict[str, object]:
    ask, until = console.link.ask, console.until

    def load_deg() -> float:
        return math.degrees(true.ask("truth")["pos_load_rad"])

    ask("take", over=False)
    ask("power", on=True)
    until(lambda tags: tags["power"])
    ask("set", tag="speed_setting_deg_s", value=3.0)
    ask("move", target_deg=30.0)
    until(lambda tags: tags["vel_act_deg_s"] > 2.5)
    true.ask("event", event="reset")
    # Torque off, and the last telegram of before too old to be believed: 28 ms, shown with the next status frame.
    lost = until(lambda tags: tags["power_phase"] == "off" and tags["feedback_age_ms"] > 200.0)
    stood = load_deg()
    ask("arm", action="reset_locked")
    ask("reset")
    back = until(lambda tags: tags["axis_state"] == "disabled")
    after_reset = load_deg()
    ask("power", on=True)
    until(lambda tags: tags["power"])
    ask("move", target_deg=back["pos_act_deg"] + 1.0)
    until(lambda tags: tags["axis_state"] == "discrete_motion")
    end = until(lambda tags: tags["axis_state"] == "standstill")
    return {
        "axis_state_lost": lost["axis_state"],
        "position_valid_lost": lost["position_valid"],
        "angle_lost_deg": lost["pos_act_deg"],
        "speed_lost_deg_s": lost["vel_act_deg_s"],
        "brake_open_lost": lost["brake_open"],
        "codes_lost": [row["code"] for row in lost["alarms"]],
        "moved_by_reset_deg": after_reset - stood,
        "shown_after_reset_deg": back["pos_act_deg"],
        "load_after_reset_deg": after_reset,
        "power_after_reset": back["power"],
        "shown_at_end_deg": end["pos_act_deg"],
        "load_at_end_deg": load_deg(),
    }


if __name__ == "__main__":
    print(json.dumps(measure(Path(sys.argv[1]))))
