"""Fault injection and the side channel's vocabulary."""

import math
import struct

import pytest

from gantryctl.drives.faults import names
from gantryctl.drives.virtual.axis.cia402 import State
from unit.drives.virtual.bench import (
    EMCY,
    ENABLE,
    HEARTBEAT,
    QUICK_STOP,
    SDO_RX,
    SWITCH_ON,
    TPDO1,
    Aborted,
    Bench,
)


@pytest.fixture
def bench() -> Bench:
    return Bench().set_up()


def moving(bench: Bench, deg_s: float = 1.0) -> Bench:
    bench.enable()
    bench.ramp_to(deg_s, 4.0)
    return bench


def refusal(bench: Bench, **request: object) -> str:
    answer = bench.control(request)
    assert answer["ok"] is False
    return str(answer["error"])


def test_a_frozen_position_stays_while_the_load_moves(bench: Bench) -> None:
    moving(bench)
    bench.inject("freeze_position")
    first = bench.cycle(ENABLE, bench.turn(1.0))
    later = bench.run(0.5, ENABLE, bench.turn(1.0))
    assert later.position == first.position
    assert later.velocity == 0
    assert bench.load_deg_s == pytest.approx(1.0, abs=0.2)


def test_a_position_offset_is_a_jump(bench: Bench) -> None:
    before = bench.cycle(0).position
    bench.inject("position_offset", 100_000)
    assert bench.cycle(0).position - before == pytest.approx(100_000, abs=10)


def test_never_move_lies_and_ignore_target_says_so(bench: Bench) -> None:
    bench.enable()
    start = bench.load_deg
    bench.inject("never_move")
    assert bench.run(1.0, ENABLE, bench.turn(1.0)).status & 0x1000
    bench.inject("never_move", False)
    bench.inject("ignore_target")
    assert not bench.run(1.0, ENABLE, bench.turn(1.0)).status & 0x1000
    assert abs(bench.load_deg - start) < 0.01


def test_ignore_target_in_motion_goes_on_with_the_last_speed(bench: Bench) -> None:
    moving(bench)
    bench.inject("ignore_target")
    assert bench.deg_s(bench.run(1.0, ENABLE, 0).velocity) == pytest.approx(1.0, abs=0.1)


def test_the_wrong_sign_turns_the_other_way(bench: Bench) -> None:
    bench.inject("command_sign", -1)
    bench.enable()
    start = bench.load_deg
    bench.run(1.0, ENABLE, bench.turn(0.5))
    assert bench.load_deg < start - 0.2


def test_the_drive_can_lie_about_mode_and_status(bench: Bench) -> None:
    bench.inject("mode_display", 3)
    assert bench.up(0x6061) == 3
    bench.inject("status_clear", 0x200)
    bench.inject("status_set", 0x80)
    assert bench.up(0x6041) & 0x280 == 0x80
    bench.inject("status_value", 0x1237)
    assert bench.up(0x6041) == 0x1237
    bench.inject("warning")
    bench.inject("status_value", None)
    assert bench.up(0x6041) & 0x80


def test_a_stuck_state_obeys_nothing(bench: Bench) -> None:
    bench.inject("stuck_state")
    assert bench.run(0.1, 0x06).state is State.SWITCH_ON_DISABLED


def test_a_quick_stop_that_is_not_obeyed_shows_the_state_and_goes_on(bench: Bench) -> None:
    moving(bench)
    bench.inject("quick_stop_off")
    feedback = bench.run(1.0, QUICK_STOP)
    assert feedback.state is State.QUICK_STOP
    assert bench.deg_s(feedback.velocity) == pytest.approx(1.0, abs=0.1)


def unbalanced() -> Bench:
    """At 90 deg the eccentric moment (174 kN m) is larger than all friction; near 0 deg friction holds the load."""
    return Bench(angle_rad=math.pi / 2).set_up()


def test_no_torque_while_enabled_lets_the_load_go() -> None:
    bench = unbalanced()
    bench.enable()
    bench.inject("no_torque")
    assert bench.run(1.0, ENABLE).state is State.ENABLED
    assert abs(bench.load_deg_s) > 0.01


@pytest.mark.parametrize("position", ["closed", "open"])
def test_the_brake_can_be_stuck(bench: Bench, position: str) -> None:
    bench.inject("brake", position)
    for word in (0, 0x06, SWITCH_ON, ENABLE):
        bench.run(0.3, word)
        assert bench.node.plant.brake_open is (position == "open")
    bench.inject("brake", None)
    bench.run(0.3, 0)
    assert not bench.node.plant.brake_open


def test_a_weaker_brake_slips() -> None:
    bench = unbalanced()
    bench.event("plant", name="brake_torque_nm", value=1.0)
    bench.run(1.0, 0)
    assert abs(bench.load_deg_s) > 0.01


@pytest.mark.parametrize(
    ("kind", "amount", "frames"),
    [
        ("drop", 1, [0, 0, 0, 1, 1]),
        ("duplicate", 1, [2, 2, 2, 1, 1]),
        ("delay", 2, [0, 0, 1, 3, 1]),
        ("swap", 1, [0, 2, 0, 2, 1]),
    ],
)
def test_tpdos_can_be_dropped_doubled_delayed_and_swapped(
    bench: Bench, kind: str, amount: int, frames: list[int]
) -> None:
    bench.inject("tpdo", tpdo=1, kind=kind, amount=amount, count=3)
    counts = [sum(can_id == TPDO1 for can_id, _ in bench.send(0x80)) for _ in frames]
    assert counts == frames


def test_delayed_tpdos_are_old_and_come_in_order(bench: Bench) -> None:
    moving(bench)
    bench.inject("tpdo", tpdo=1, kind="delay", amount=3)
    bench.frames.clear()
    for _ in range(10):
        bench.send(0x80)
    positions = [struct.unpack("<Hi", data)[1] for data in bench.take(TPDO1)]
    assert len(positions) == 7
    assert positions == sorted(positions)


@pytest.mark.parametrize("length", [0, 2, 8])
def test_tpdos_can_have_the_wrong_length(bench: Bench, length: int) -> None:
    bench.inject("tpdo", tpdo=1, kind="length", amount=length)
    bench.frames.clear()
    bench.send(0x80)
    assert [len(data) for data in bench.take(TPDO1)] == [length]


def test_heartbeats_can_stop_and_lie(bench: Bench) -> None:
    bench.down(0x1017, 0, 20, 2)
    bench.inject("heartbeat_state", 4)
    bench.frames.clear()
    bench.run(0.05, 0)
    assert set(bench.take(HEARTBEAT)) == {b"\x04"}
    bench.inject("heartbeat_off")
    bench.run(0.1, 0)
    assert bench.take(HEARTBEAT) == []


def test_emcy_can_flood_without_a_fault(bench: Bench) -> None:
    bench.frames.clear()
    bench.event("emcy", code=0x5000, register=0x01, count=1000)
    assert bench.take(EMCY) == [struct.pack("<HB5x", 0x5000, 1)] * 1000
    assert bench.cycle(0).state is State.SWITCH_ON_DISABLED


def test_the_node_can_change_its_nmt_state_and_restart_by_itself(bench: Bench) -> None:
    bench.event("nmt", state="PRE_OPERATIONAL")
    assert bench.send(0x80) == []
    bench.start()
    moving(bench)
    bench.frames.clear()
    bench.event("reset", off_s=0.1)
    assert bench.take(HEARTBEAT) == []
    period_s = bench.node.sync_period_us * 1e-6  # the default: what was set up is lost with the power
    for _ in range(round(0.1 / period_s) + 2):
        bench.send(0x80)
    assert bench.take(HEARTBEAT) == [b"\x00"]
    assert bench.node.axis.state is State.SWITCH_ON_DISABLED


def test_silence_is_both_ways_and_the_drive_goes_on(bench: Bench) -> None:
    bench.down(0x1400, 5, 50, 2)
    bench.down(0x6007, 0, 3, 2)
    moving(bench)
    bench.inject("silence", for_s=0.2)
    bench.frames.clear()
    for _ in range(48):
        assert bench.send(0x80) == []
        bench.send(0x202, struct.pack("<Hih", ENABLE, bench.turn(1.0), 0))
    assert bench.node.axis.state is not State.ENABLED
    for _ in range(5):
        bench.send(0x80)
    assert TPDO1 in [can_id for can_id, _ in bench.frames]


def test_sdo_can_be_silent_abort_and_have_wrong_toggles(bench: Bench) -> None:
    bench.inject("sdo_silent")
    assert bench.send(SDO_RX, bytes.fromhex("4000100000000000")) == []
    bench.inject("sdo_silent", False)
    bench.inject("sdo_abort", 0x08000000)
    with pytest.raises(Aborted, match="08000000"):
        bench.up(0x1000)
    bench.inject("sdo_abort", None)
    bench.inject("sdo_toggle")
    bench.sdo(bytes.fromhex("4008100000000000"))
    assert bench.sdo(b"\x60")[0] & 0x10


def test_a_fault_may_end_by_itself(bench: Bench) -> None:
    bench.inject("warning", for_s=0.1)
    assert bench.run(0.05, 0).status & 0x80
    assert not bench.run(0.1, 0).status & 0x80


def test_clear_makes_the_drive_sound(bench: Bench) -> None:
    bench.inject("warning")
    bench.inject("brake", "closed")
    bench.inject("tpdo", tpdo=2, kind="drop")
    status = bench.control({"cmd": "status"})
    assert status["faults"] == {"warning": True, "brake": "closed", "tpdo": {"2": "drop"}}
    assert bench.control({"cmd": "clear", "fault": "warning"})["ok"]
    assert bench.control({"cmd": "clear"})["ok"]
    assert bench.control({"cmd": "status"})["faults"] == {}


def test_the_truth_is_told_on_the_side_and_nowhere_else(bench: Bench) -> None:
    moving(bench)
    answer = bench.control({"cmd": "truth"})
    assert tuple(answer[name] for name in bench.node.truth_columns) == bench.node.truth()
    assert answer["time_s"] == bench.node.time_us * 1e-6
    names_on_the_bus = " ".join(e.name.lower() for e in bench.node.device.entries())
    assert "gantry" not in names_on_the_bus.replace("gantryctl", "")
    assert "truth" not in names_on_the_bus


def test_values_can_be_read_and_written_past_the_access_rules(bench: Bench) -> None:
    assert bench.control({"cmd": "write", "index": 0x60FF, "value": 5})["ok"]
    assert bench.control({"cmd": "read", "index": 0x60FF}) == {"ok": True, "value": 5}
    assert bench.control({"cmd": "read", "index": 0x1008})["value"] == "gantryctl virtual drive"
    assert "does not take 99" in refusal(bench, cmd="write", index=0x605A, value=99)
    assert refusal(bench, cmd="read", index=0x5000) == "there is no object 5000:00"


def test_a_stepped_drive_can_be_advanced_without_sync(bench: Bench) -> None:
    before = bench.node.time_us
    assert bench.control({"cmd": "advance", "s": 0.25})["time_s"] == pytest.approx(before * 1e-6 + 0.25)
    bench.node.stepped = False
    assert "only a stepped one" in refusal(bench, cmd="advance", s=1)


@pytest.mark.parametrize(
    ("request_", "text"),
    [
        ([], "a request is a JSON object"),
        ({}, "there is no cmd None"),
        ({"cmd": "dance"}, "there is no cmd 'dance'; there are: hello, truth"),
        ({"cmd": "inject", "fault": "gremlin"}, "there is no fault 'gremlin'; there are: freeze_position"),
        (
            {"cmd": "inject", "fault": "brake", "value": "ajar"},
            "fault 'brake': Input should be 'closed' or 'open'",
        ),
        (
            {"cmd": "inject", "fault": "warning", "value": 1},
            "fault 'warning': Input should be a valid boolean",
        ),
        ({"cmd": "inject", "fault": "position_offset", "value": 1.5}, "Input should be a valid integer"),
        ({"cmd": "inject", "fault": "torque_offset", "value": "x"}, "Input should be a valid number"),
        ({"cmd": "inject", "fault": "command_sign", "value": 2}, "Input should be 1 or -1"),
        ({"cmd": "inject", "fault": "warning", "for_s": -1}, "for_s is from 0 to 3600"),
        ({"cmd": "inject", "fault": "tpdo", "kind": "burn"}, "a fault of frames is one of drop, delay"),
        ({"cmd": "inject", "fault": "tpdo", "tpdo": 9, "kind": "drop"}, "tpdo is a whole number from 1 to 4"),
        ({"cmd": "inject", "fault": "tpdo", "kind": "length", "amount": 9}, "a frame has at most 8 bytes"),
        ({"cmd": "event", "event": "party"}, "there is no event 'party'; there are: fault, emcy"),
        ({"cmd": "event", "event": "fault", "code": 0}, "code is a whole number from 1 to 65535"),
        ({"cmd": "event", "event": "nmt", "state": "ASLEEP"}, "state is STOPPED, OPERATIONAL"),
        (
            {"cmd": "event", "event": "plant", "name": "colour", "value": 1},
            "the plant has no parameter 'colour'",
        ),
        ({"cmd": "event", "event": "plant", "name": "ratio", "value": float("nan")}, "value is a number"),
        ({"cmd": "event", "event": "frame", "can_id": 1, "data": "zz"}, "data is hexadecimal"),
        ({"cmd": "advance", "s": "long"}, "s is a number"),
        ({"cmd": "clear", "fault": "gremlin"}, "there is no fault 'gremlin'"),
    ],
)
def test_a_request_that_makes_no_sense_is_one_sentence(bench: Bench, request_: object, text: str) -> None:
    answer = bench.control(request_)
    assert answer["ok"] is False
    assert text in answer["error"]


def test_hello_names_everything_that_can_be_asked(bench: Bench) -> None:
    hello = bench.control({"cmd": "hello"})
    assert (hello["node"], hello["personality"], hello["stepped"]) == (2, "plain", True)
    assert set(names()) < set(hello["faults"])
    assert "reset" in hello["events"]


def test_a_foreign_frame_can_be_sent_in_the_drive_s_name(bench: Bench) -> None:
    bench.frames.clear()
    bench.event("frame", can_id=0x123, data="0102")
    assert bench.frames == [(0x123, b"\x01\x02")]


def test_a_sync_that_is_lost_lets_the_time_of_the_drive_go_on(bench: Bench) -> None:
    bench.send(0x80)  # the first is time 0
    before = bench.node.time_us
    bench.inject("frame", can_id=0x80, kind="drop", count=2)
    assert [len(bench.send(0x80)) for _ in range(3)] == [0, 0, 2]
    assert bench.node.time_us - before == 3 * bench.node.sync_period_us


def test_frames_to_and_from_the_drive_can_be_lost(bench: Bench) -> None:
    bench.inject("frame", can_id=SDO_RX, kind="drop", count=1)
    assert bench.send(SDO_RX, bytes.fromhex("4000100000000000")) == []
    assert len(bench.send(SDO_RX, bytes.fromhex("4000100000000000"))) == 1
    bench.down(0x1017, 0, 20, 2)
    bench.inject("frame", can_id=HEARTBEAT, kind="drop", for_s=0.1)
    bench.frames.clear()
    bench.run(0.09, 0)
    assert bench.take(HEARTBEAT) == []
    bench.run(0.1, 0)
    assert bench.take(HEARTBEAT)


def test_a_frame_of_a_third_party_reaches_drive_and_master(bench: Bench) -> None:
    bench.frames.clear()
    bench.event("foreign", can_id=0x000, data="8002")
    assert (0x000, b"\x80\x02") in bench.frames
    assert bench.send(0x80) == []  # pre-operational: no process data any more
