"""A virtual drive and a controller as processes on vcan0, the bus of a real kernel."""

from __future__ import annotations

import json
import math
import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from gantryctl.drives.virtual.side_channel.control import ControlClient
from gantryctl.errors import DeviceError
from gantryctl.machine import configs_folder, load_machine
from gantryctl.operation.store import STATE_VARIABLE
from support.command_line import Answer, cli

COMMAND = [sys.executable, "-m", "gantryctl"]
# A ramp that is at 3 deg/s within 1.5 s.
FAST = "\n[virtual_axis]\nacc_deg_s2 = 2.0\ndec_deg_s2 = 2.0\n"
START_S = 60.0
LAST = "7FF#"


def machine_file(folder: Path) -> Path:
    """The reference gantry behind a stepped drive on vcan0, at 100 Hz."""
    text = (configs_folder() / "hust_can.toml").read_text(encoding="utf-8")
    for old, new in (
        ('interface = "simulated"', 'interface = "socketcan"'),
        ('channel = ""', f'channel = "vcan0"\nstepped = true\nside_channel = "{folder / "drive.sock"}"'),
        ("scan_period_ms = 4.0", "scan_period_ms = 10.0"),
        # A busy computer holds this kernel up for a second now and then.
        ("commissioning_required = true\n", "commissioning_required = false\nsdo_timeout_ms = 5000.0\n"),
    ):
        assert old in text
        text = text.replace(old, new)
    path = folder / "machine.toml"
    path.write_text(text + FAST, encoding="utf-8")
    return path


class VcanBus:
    """The process of a stepped drive, and commands of the controller.

    Its time goes on by SYNC and by `ask("advance")`: how fast this computer is has no part in it.
    """

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self.config = machine_file(folder)
        self.machine = load_machine(self.config)
        self.environment = {**os.environ, STATE_VARIABLE: str(folder / "state")}
        socket = str(folder / "drive.sock")
        options = [
            "--can",
            "socketcan",
            "--channel",
            "vcan0",
            "--config",
            str(self.config),
            "--control",
            socket,
        ]
        self.drive = subprocess.Popen(
            [*COMMAND, "drive", "sim", "--stepped", *options], stdout=subprocess.DEVNULL
        )
        self._client = self._channel(Path(socket))
        self.ask = self._client.ask
        self.set_zero()

    def _channel(self, socket: Path) -> ControlClient:
        end = time.monotonic() + START_S
        while time.monotonic() < end:
            try:
                return ControlClient(socket)
            except DeviceError:
                time.sleep(0.1)
        raise AssertionError("the virtual drive did not start")

    def run(self, *arguments: str) -> Answer:
        """A short command in this process: starting one takes seconds on this kernel."""
        before = os.environ.get(STATE_VARIABLE)
        os.environ[STATE_VARIABLE] = self.environment[STATE_VARIABLE]
        try:
            return cli(*arguments, "--config", self.config)
        finally:
            if before is not None:
                os.environ[STATE_VARIABLE] = before

    def start(self, *arguments: str) -> subprocess.Popen[str]:
        return subprocess.Popen(
            [*COMMAND, *arguments, "--config", str(self.config)],
            env=self.environment, text=True, stdout=subprocess.PIPE, stderr=subprocess.PIPE,
        )  # fmt: skip

    def reset(self) -> None:
        done = self.run("reset", "--yes")
        assert done.code == 0, done.err

    def set_zero(self) -> None:
        """Tell the controller the angle that the drive's gantry really has."""
        angle_deg = math.degrees(self.ask("truth")["pos_motor_rad"]) / self.machine.axis.ratio
        done = self.run("encoder", "set-zero", "--angle", f"{angle_deg:.4f}", "--witness", "virtual drive")
        assert done.code == 0, done.err

    def commission(self, answers: str) -> tuple[int, str]:
        """Commission with these answers to what is asked; exit code, and what was printed."""
        command = [*COMMAND, "commission", "--out", str(self.folder / "report"), "--config", str(self.config)]
        done = subprocess.run(
            command, env=self.environment, text=True, input=answers, capture_output=True, check=False
        )
        return done.returncode, done.stdout + done.stderr

    def speed_deg_s(self) -> float:
        """Of the motor side, at the gantry."""
        return math.degrees(self.ask("truth")["vel_motor_rad_s"]) / self.machine.axis.ratio

    def wait_for_speed(self, speed_deg_s: float, controller: subprocess.Popen[str]) -> None:
        while abs(self.speed_deg_s()) < speed_deg_s:
            if controller.poll() is not None:
                raise AssertionError(f"the controller ended before: {controller.communicate()}")
            time.sleep(0.002)

    def clock_after(self, calls: int) -> Callable[..., dict[str, Any]]:
        """The side channel; from a call on, each question comes a millisecond of the drive's time after the last."""
        count = 0

        def ask(command: str, **values: object) -> dict[str, Any]:
            nonlocal count
            count += 1
            if count > calls:
                self.ask("advance", s=0.001)
            return self.ask(command, **values)

        return ask

    def end(self) -> None:
        self._client.__exit__()
        self.drive.send_signal(signal.SIGINT)
        self.drive.wait(20.0)


def ended(controller: subprocess.Popen[str]) -> tuple[int, dict[str, Any], str]:
    """Exit code, JSON and standard error of a command."""
    out, err = controller.communicate(timeout=100.0)
    assert out, err
    return controller.returncode, json.loads(out), err


@contextmanager
def dumped(path: Path) -> Iterator[None]:
    """Everything on vcan0 by candump, a program of the kernel's people, in its log format."""
    with path.open("wb") as file:
        dump = subprocess.Popen(["candump", "-L", "-r", "10000000", "vcan0"], stdout=file)
        time.sleep(0.3)
        try:
            yield
        finally:
            # The last one to be seen, so that nothing before it is still on its way; then it is taken out.
            run("cansend", "vcan0", LAST)
            end = time.monotonic() + START_S
            while LAST not in (text := path.read_text()) and time.monotonic() < end:
                time.sleep(0.1)
            dump.terminate()
            dump.wait()
            path.write_text("".join(line for line in text.splitlines(keepends=True) if LAST not in line))


@contextmanager
def netem(*options: str) -> Iterator[None]:
    """Spoil what goes over vcan0."""
    run("tc", "qdisc", "add", "dev", "vcan0", "root", "netem", *options)
    try:
        yield
    finally:
        run("tc", "qdisc", "del", "dev", "vcan0", "root")


def run(*command: str) -> None:
    subprocess.run(command, check=True, capture_output=True)
