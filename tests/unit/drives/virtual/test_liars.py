"""Drives that lie, each beside the plain drive: what the lie changes, and that it does. The steps that must refuse them
are in `tests/unit/commissioning/test_liars.py`.
"""

import struct

import pytest

from gantryctl.drives.virtual.axis.cia402 import FOLLOWS_COMMAND, State
from unit.drives.virtual.bench import EMCY, ENABLE, HEARTBEAT, NODE, QUICK_STOP, RPDO1, Bench

MASTER = 1
DEADLINE_MS, HEARTBEAT_MS = 50, 150
QUIET_US = 1_000_000


def running(*names: str, deg_s: float = 1.0) -> Bench:
    """Enabled at a speed, watching for commands and for heartbeats of the master."""
    bench = Bench(*names).set_up()
    bench.down(0x1400, 1, 0x8000_0000 | RPDO1, 4)
    bench.down(0x1400, 5, DEADLINE_MS, 2)
    bench.down(0x1400, 1, RPDO1, 4)
    bench.down(0x1016, 1, MASTER << 16 | HEARTBEAT_MS, 4)
    bench.down(0x6007, 0, 1, 2)
    bench.enable()
    if deg_s:
        bench.ramp_to(deg_s)
    return bench


def silent(
    bench: Bench, *, heartbeats: bool = False, commands: bool = False
) -> tuple[bool, float, list[bytes]]:
    """Leave the drive alone for a second but for the one that goes on: (fault, true way in deg, EMCYs)."""
    bench.send(0x700 + MASTER, b"\x05")
    begun, word = bench.load_deg, struct.pack("<Hih", ENABLE, bench.turn(1.0), 0)
    bench.frames.clear()
    for _ in range(QUIET_US // 20_000):
        bench.node.advance(20_000)
        if heartbeats:
            bench.send(0x700 + MASTER, b"\x05")
        if commands:
            bench.send(RPDO1, word)
    messages = [data for can_id, data in bench.frames if can_id == EMCY]
    return bench.node.axis.state is State.FAULT, bench.load_deg - begun, messages


def test_the_plain_drive_stops_for_either_silence() -> None:
    for sent in ({"heartbeats": True}, {"commands": True}):
        fault, way, messages = silent(running(), **sent)
        assert fault
        assert messages
        assert way < 0.35, "1 deg/s for 0.05 or 0.15 s, then 0.09 deg on the ramp"


@pytest.mark.parametrize("name", ["emcy-only", "stops-at-rest-only", "fault-shown-only"])
def test_who_complains_and_goes_on(name: str) -> None:
    for sent in ({"heartbeats": True}, {"commands": True}):
        bench = running(name)
        fault, way, messages = silent(bench, **sent)
        assert not fault
        assert messages
        assert way == pytest.approx(1.0, abs=0.1), "a second at 1 deg/s"
        shown = bench.node.od.readers[0x6041, 0]() & 0x4F
        assert (shown == State.FAULT) is (name == "fault-shown-only")


def test_who_obeys_at_rest_stops_there() -> None:
    assert silent(running("stops-at-rest-only", deg_s=0.0), heartbeats=True)[0]
    assert not silent(running("emcy-only", deg_s=0.0), heartbeats=True)[0]


@pytest.mark.parametrize(
    ("name", "ignored"), [("heartbeat-ignored", "commands"), ("deadline-ignored", "heartbeats")]
)
def test_one_watch_without_effect_leaves_the_other(name: str, ignored: str) -> None:
    for sent in ("commands", "heartbeats"):
        fault, _, messages = silent(running(name), **{sent: True})
        assert fault is (sent != ignored)
        assert bool(messages) is fault


def test_the_brake_stays_open_until_a_command() -> None:
    bench = running("brake-open-in-silence")
    assert silent(bench, heartbeats=True)[0]
    assert bench.node.plant.brake_open
    bench.run(0.1, 0)
    bench.node.advance(QUIET_US)
    assert not bench.node.plant.brake_open


def test_the_quick_stop_takes_the_torque_off() -> None:
    plain, liar = running(), running("quick-stop-option-ignored")
    for bench in (plain, liar):
        bench.down(0x605A, 0, 6, 2)
    assert plain.run(0.02, QUICK_STOP).state is State.QUICK_STOP
    assert liar.run(0.02, QUICK_STOP).state is State.SWITCH_ON_DISABLED


def test_the_quick_stop_ramp_is_a_third_or_harder() -> None:
    ways = []
    for names in ((), ("slow-quick-stop",), ("hard-quick-stop",)):
        bench = running(*names)
        begun = bench.load_deg
        bench.run(1.5, QUICK_STOP)
        ways.append(bench.load_deg - begun)
    # Beside v^2 / 2a there are the two periods until the command acts, and the swing of the load: 0.07 deg together.
    assert ways[1] > 2.0 * ways[0]
    assert ways[2] < 0.9 * ways[0]


def test_the_torque_limit_is_without_effect() -> None:
    torques = []
    for names in ((), ("torque-limit-ignored",)):
        bench = running(*names, deg_s=0.0)
        bench.down(0x6072, 0, 200, 2)
        torques.append(max(abs(bench.cycle(ENABLE, bench.turn(3.0)).torque) for _ in range(20)))
    assert torques[0] <= 200
    assert torques[1] > 500


def test_bit_12_is_stuck() -> None:
    assert not Bench().set_up().cycle(0).status & FOLLOWS_COMMAND
    assert Bench("follows-bit-stuck").set_up().cycle(0).status & FOLLOWS_COMMAND


def test_the_sign_is_right_at_creep_and_wrong_at_speed() -> None:
    bench = running("wrong-sign-at-speed", deg_s=0.0)
    begun = bench.load_deg
    bench.run(1.0, ENABLE, bench.turn(0.2))
    crept = bench.load_deg - begun
    assert crept == pytest.approx(0.2, abs=0.05)
    bench.run(1.0, ENABLE, bench.turn(0.5))
    assert bench.load_deg - begun < crept - 0.3


def test_the_position_is_frozen_while_there_is_torque() -> None:
    bench = running("position-frozen", deg_s=0.0)
    first, begun = bench.cycle(ENABLE), bench.load_deg
    last = bench.run(0.5, ENABLE, bench.turn(0.5))
    assert (last.position, last.velocity) == (first.position, 0)
    assert bench.load_deg - begun > 0.2


def test_a_heartbeat_of_another_node_is_none_of_the_masters() -> None:
    """The bench itself: a heartbeat of node 9 must not keep the drive enabled."""
    bench = running()
    bench.send(0x700 + MASTER, b"\x05")
    for _ in range(10):
        bench.node.advance(20_000)
        bench.send(HEARTBEAT - NODE + 9, b"\x05")
    assert bench.node.axis.state is not State.ENABLED
