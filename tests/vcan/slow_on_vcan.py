"""Controller and drive over a vcan0 that goes down, loses, delays and doubles frames; stops without it; commissioning.

Run inside `support/vcan.sh`. The drive is stepped: it waits for a SYNC that is late or lost, so what is judged is what
each side says, in its order.
"""

from __future__ import annotations

import json
import signal
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from gantryctl.trace.reader import read_trace
from support.controller_death import judge, kill_in_motion
from vcan.rig import VcanBus, ended, netem, run

pytestmark = pytest.mark.can


@pytest.fixture
def bus(tmp_path_factory: pytest.TempPathFactory) -> Iterator[VcanBus]:
    made = VcanBus(tmp_path_factory.mktemp("bus"))
    yield made
    made.end()


def spoiled_move(bus: VcanBus, target_deg: float, *spoiled: str) -> tuple[int, dict[str, Any], str]:
    """A move over a bus that is spoiled from 1 deg/s on: a set-up without answers is another matter."""
    controller = bus.start("move", str(target_deg), "--speed", "2", "--json", "--no-trace")
    bus.wait_for_speed(1.0, controller)
    with netem(*spoiled):
        return ended(controller)


def test_late_frames_are_waited_for(bus: VcanBus) -> None:
    code, out, err = spoiled_move(bus, 4.0, "delay", "3ms")
    assert code == 0, err
    assert out["summary"]["end_deg"] == pytest.approx(4.0, abs=0.005)  # the in-position window
    assert out["alarms"] == []


def test_a_lost_frame_now_and_then_is_bridged(bus: VcanBus) -> None:
    # Some 1500 frames: ten of them are lost, most of them telegrams or their SYNC.
    code, out, err = spoiled_move(bus, 4.0, "loss", "0.7%")
    assert code == 0, err
    assert out["summary"]["end_deg"] == pytest.approx(4.0, abs=0.005)


def test_a_bus_that_loses_most_frames_stops_the_axis(bus: VcanBus) -> None:
    code, out, err = spoiled_move(bus, 20.0, "loss", "90%")
    assert code == 4, err
    # Our own SYNC does not come back, or the drive's telegrams do not come: whichever is first.
    assert out["alarms"][0].split()[0] in ("CAN-01", "CAN-03", "CAN-05"), out["alarms"]


def test_a_frame_of_ours_that_comes_twice_is_told_as_another_sender(bus: VcanBus) -> None:
    code, out, err = spoiled_move(bus, 20.0, "duplicate", "5%")
    assert code == 4, err
    assert out["alarms"][0].split()[0] in ("CAN-12", "CAN-16"), out["alarms"]


def test_a_drive_is_commissioned_with_its_stops(bus: VcanBus) -> None:
    code, said = bus.commission("y\ny\nn\n")  # at standstill, near, but not the whole travel
    assert code == 1
    assert "  left out" in said
    kept = json.loads((bus.folder / "state" / "hust_can" / "commissioning.json").read_text())
    steps = {key: result["outcome"] for key, result in kept["results"].items()}
    assert list(steps)[:4] == ["identity", "encoder", "defaults", "parameters"]
    assert {"pdo", "sync", "silence", "brake", "sign", "velocity", "loop", "stops"} <= steps.keys(), said
    assert "failed" not in steps.values(), said
    # What comes of waiting for a drive that has left OPERATIONAL: 3 s in each scan, minutes for a silence.
    assert kept["results"]["stops"]["seconds"] < 120.0, said


def test_an_interface_that_goes_down_is_an_alarm_and_comes_back(bus: VcanBus) -> None:
    controller = bus.start("move", "60", "--json", "--no-trace")
    bus.wait_for_speed(2.0, controller)
    run("ip", "link", "set", "vcan0", "down")
    try:
        # No telegram any more: the drive stops by its own deadline.
        ask = bus.clock_after(0)
        while abs(bus.speed_deg_s()) > 0.05:
            assert ask("truth")["time_s"] < 100.0
        bus.ask("advance", s=2.0)  # and closes its brake
        code, out, err = ended(controller)
    finally:
        run("ip", "link", "set", "vcan0", "up")
    assert code == 4, err
    assert out["alarms"][0].startswith("CAN-08"), out["alarms"]
    # The controller has missed the stop: what it says of the angle is in doubt until somebody has compared it.
    bus.set_zero()
    bus.reset()


def test_a_second_ctrl_c_is_the_quick_stop_of_the_drive(bus: VcanBus, tmp_path: Path) -> None:
    controller = bus.start("move", "-60", "--json", "--out", str(tmp_path))
    bus.wait_for_speed(2.5, controller)
    controller.send_signal(signal.SIGINT)
    time.sleep(0.05)
    controller.send_signal(signal.SIGINT)
    code, out, err = ended(controller)
    assert code == 4, err
    assert out["alarms"][0].startswith("INT-06"), out["alarms"]
    trace = read_trace(next(tmp_path.glob("*.parquet")))
    vel, time_s = np.abs(np.degrees(trace["vel_act_rad_s"])), trace["time_s"]
    # The last time that the axis has 80 % and 30 % of its highest speed: both on the ramp of object 6085.
    levels = 0.8 * vel.max(), 0.3 * vel.max()
    at_s = [time_s[np.flatnonzero(vel >= level)[-1]] for level in levels]
    dec_deg_s2 = (levels[0] - levels[1]) / (at_s[1] - at_s[0])
    # A scan of 10 ms on a ramp of 0.2 s.
    assert dec_deg_s2 == pytest.approx(bus.machine.virtual_axis.quick_dec_deg_s2, rel=0.1)
    assert bus.ask("status")["brake_open"] is False
    bus.reset()


def test_the_drive_stops_by_itself_when_the_controller_is_killed(bus: VcanBus, tmp_path: Path) -> None:
    log = tmp_path / "killed.log"
    controller = bus.start("move", "-60", "--json", "--no-trace", "--bus-log", str(log))
    bus.wait_for_speed(3.0, controller)
    judge(kill_in_motion(bus.clock_after(1), bus.machine, controller.pid))
    controller.communicate()
    # The log is there up to a second before the kill; its last line may be cut.
    *whole, _ = log.read_text().splitlines()
    assert sum(" 080#" in line for line in whole) > 50
    refused = bus.start("move", "0", "--json")
    _, err = refused.communicate(timeout=100.0)
    # It moved while nobody looked: 3 to 4 deg, a third of which is within 0.05 deg of whole motor turns (0.3147 deg).
    assert err.startswith(("error: ENC-10", "error: ENC-08")), err
    assert refused.returncode == 2
    bus.set_zero()
    refused = bus.run("move", "0")
    # The drive has stopped by its own watch, and nothing else in the memory of the controller tells of that.
    assert refused.err.startswith("error: DRV-15"), refused.err
    assert refused.code == 2
    bus.reset()
