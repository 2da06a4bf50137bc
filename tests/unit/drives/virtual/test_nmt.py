"""NMT, boot-up, heartbeat both ways, EMCY."""

import struct

import pytest

from gantryctl.drives.virtual.axis.cia402 import State
from gantryctl.drives.virtual.communication.nmt import NmtCommand, NmtState, command_for, next_nmt
from gantryctl.drives.virtual.node import DriveNode
from gantryctl.errors import UsageError
from unit.drives.virtual.bench import EMCY, ENABLE, HEARTBEAT, NODE, SDO_TX, TPDO1, Aborted, Bench


@pytest.fixture
def bench() -> Bench:
    return Bench()


def test_every_pair_of_nmt_state_and_command() -> None:
    for state in NmtState:
        for command in NmtCommand:
            expected = {
                NmtCommand.START: NmtState.OPERATIONAL,
                NmtCommand.STOP: NmtState.STOPPED,
                NmtCommand.ENTER_PRE_OPERATIONAL: NmtState.PRE_OPERATIONAL,
            }.get(command, NmtState.INITIALISING)
            if state is NmtState.INITIALISING:
                expected = state
            assert next_nmt(state, command) is expected


@pytest.mark.parametrize("data", [b"", b"\x01", b"\x01\x02\x00", b"\x01\x03", b"\x03\x02", b"\xff\x00"])
def test_what_is_no_command_for_this_node_is_none(data: bytes) -> None:
    assert command_for(data, NODE) is None


def test_boot_up_is_one_zero_byte_and_leads_to_pre_operational(bench: Bench) -> None:
    assert bench.take(HEARTBEAT) == [b"\x00"]
    assert bench.node.state is NmtState.PRE_OPERATIONAL


@pytest.mark.parametrize("addressed", [0, NODE])
def test_nmt_is_for_one_node_or_for_all(bench: Bench, addressed: int) -> None:
    bench.nmt(0x01, addressed)
    assert bench.node.state is NmtState.OPERATIONAL
    bench.nmt(0x80, addressed + 1 if addressed else 99)
    assert bench.node.state is NmtState.OPERATIONAL


def test_a_stopped_node_answers_nothing_but_nmt(bench: Bench) -> None:
    bench.set_up()
    bench.nmt(0x02)
    assert bench.send(0x602, bytes.fromhex("4000100000000000")) == []
    assert bench.send(0x80) == []
    bench.start()
    assert bench.up(0x1000) == 0x20192


def test_pdos_live_in_operational_only(bench: Bench) -> None:
    bench.set_up()
    assert TPDO1 in dict(bench.send(0x80))
    bench.nmt(0x80)
    assert bench.send(0x80) == []


def test_reset_node_forgets_the_mapping_and_boots_up(bench: Bench) -> None:
    bench.set_up()
    bench.enable()
    assert bench.nmt(0x81)[-1] == (HEARTBEAT, b"\x00")
    assert bench.node.state is NmtState.PRE_OPERATIONAL
    assert bench.node.axis.state is State.SWITCH_ON_DISABLED
    assert not bench.node.axis.stage.energised
    assert bench.up(0x1A00, 0) == 1
    assert bench.up(0x6060) == 0


def test_reset_communication_keeps_the_application_and_resets_the_rest(bench: Bench) -> None:
    bench.set_up()
    bench.down(0x6085, 0, 1234, 4)
    bench.down(0x1017, 0, 100, 2)
    assert bench.nmt(0x82)[-1] == (HEARTBEAT, b"\x00")
    assert (bench.up(0x6085), bench.up(0x1017), bench.up(0x6060)) == (1234, 0, 9)


def test_the_heartbeat_shows_the_state_in_its_period(bench: Bench) -> None:
    bench.set_up()
    bench.down(0x1017, 0, 20, 2)
    bench.frames.clear()
    bench.run(0.104, 0)  # the first SYNC is time 0
    assert bench.take(HEARTBEAT) == [b"\x05"] * 5
    bench.nmt(0x02)
    bench.frames.clear()
    for _ in range(10):
        bench.send(0x80)
    assert bench.take(HEARTBEAT) == [b"\x04"] * 2
    bench.nmt(0x80)
    bench.down(0x1017, 0, 0, 2)
    bench.frames.clear()
    for _ in range(20):
        bench.send(0x80)
    assert bench.take(HEARTBEAT) == []


def test_a_missing_heartbeat_is_emcy_8130_once_and_0000_when_it_is_back(bench: Bench) -> None:
    bench.set_up()
    bench.down(0x1016, 1, 0x7F << 16 | 50, 4)
    bench.run(0.2, 0)
    assert bench.take(EMCY) == []  # watched from the first heartbeat on
    for _ in range(10):
        bench.send(0x77F, b"\x05")
        bench.run(0.04, 0)
    assert bench.take(EMCY) == []
    for _ in range(25):
        bench.send(0x80)
    assert bench.take(EMCY) == [bytes.fromhex("3081110000000000")]
    assert bench.up(0x1001) == 0x11
    bench.send(0x77F, b"\x05")
    assert bench.take(EMCY) == [bytes(8)]
    assert bench.up(0x1001) == 0
    assert bench.up(0x1003, 0) == 1
    assert bench.up(0x1003, 1) == 0x8130


@pytest.mark.parametrize(
    ("reaction", "state"),
    [(0, NmtState.PRE_OPERATIONAL), (1, NmtState.OPERATIONAL), (2, NmtState.STOPPED)],
)
def test_1029_says_which_nmt_state_follows_a_lost_heartbeat(
    bench: Bench, reaction: int, state: NmtState
) -> None:
    bench.set_up()
    bench.down(0x1029, 1, reaction, 1)
    bench.down(0x1016, 1, 0x7F << 16 | 50, 4)
    bench.send(0x77F, b"\x05")
    for _ in range(20):
        bench.send(0x80)
    assert bench.node.state is state


def test_one_node_is_watched_once_and_only_node_ids_are(bench: Bench) -> None:
    bench.down(0x1016, 1, 0x7F << 16 | 50, 4)
    with pytest.raises(Aborted, match="06040043"):
        bench.down(0x1016, 2, 0x7F << 16 | 80, 4)
    with pytest.raises(Aborted, match="06090030"):
        bench.down(0x1016, 2, 0x80 << 16 | 80, 4)


def test_the_error_history_is_newest_first_and_can_be_cleared_only(bench: Bench) -> None:
    bench.set_up()
    for code in (0x7305, 0x4210, 0x3210):
        bench.event("fault", code=code)
    assert bench.up(0x1003, 0) == 3
    assert [bench.up(0x1003, sub) for sub in (1, 2, 3)] == [0x3210, 0x4210, 0x7305]
    assert bench.up(0x1001) == 0x01 | 0x04 | 0x08
    with pytest.raises(Aborted, match="06090030"):
        bench.down(0x1003, 0, 1, 1)
    bench.down(0x1003, 0, 0, 1)
    assert bench.up(0x1003, 0) == 0


def test_the_error_history_is_bounded(bench: Bench) -> None:
    for code in range(1, 20):
        bench.event("fault", code=code)
    assert bench.up(0x1003, 0) == 8
    assert bench.up(0x1003, 1) == 19


def test_emcy_can_be_moved_silenced_and_inhibited(bench: Bench) -> None:
    bench.set_up()
    bench.down(0x1014, 0, 0xA5, 4)
    bench.event("emcy", code=0x1234)
    assert [can_id for can_id, _ in bench.frames[-1:]] == [0xA5]
    bench.down(0x1014, 0, 0x8000_00A5, 4)
    bench.frames.clear()
    bench.event("emcy", code=0x1234)
    assert bench.frames == []
    bench.down(0x1014, 0, EMCY, 4)
    bench.down(0x1015, 0, 200, 2)  # 20 ms
    bench.frames.clear()
    bench.event("emcy", code=0x1000, count=3)
    assert len(bench.take(EMCY)) == 1
    bench.run(0.06, 0)
    assert len(bench.take(EMCY)) == 2
    with pytest.raises(Aborted, match="06090030"):
        bench.down(0x1014, 0, 0x602, 4)


def test_a_sync_with_a_counter_is_reported_once(bench: Bench) -> None:
    bench.set_up()
    bench.frames.clear()
    for count in (1, 2, 3):
        bench.send(0x80, bytes((count,)))
    assert [struct.unpack_from("<H", data)[0] for data in bench.take(EMCY)] == [0x8240]


def test_sync_listens_to_1005_and_produces_nothing(bench: Bench) -> None:
    bench.set_up()
    bench.down(0x1005, 0, 0x8000_0090, 4)
    assert bench.send(0x80) == []
    assert TPDO1 in dict(bench.send(0x90))
    for value in (0x4000_0080, 0x2000_0080, 0):
        with pytest.raises(Aborted, match="06090030"):
            bench.down(0x1005, 0, value, 4)


@pytest.mark.parametrize("node_id", [0, 128, -1])
def test_a_node_id_out_of_range_is_refused(node_id: int) -> None:
    from unit.drives.virtual.bench import hardware

    with pytest.raises(UsageError, match="node ids 1 to 127"):
        DriveNode(hardware(), node_id, lambda *_: None)


def test_a_controlword_by_sdo_acts_in_pre_operational(bench: Bench) -> None:
    for word in (0x06, 0x07):
        bench.down(0x6040, 0, word, 2)
    assert bench.up(0x6041) & 0x6F == State.SWITCHED_ON
    assert bench.node.axis.controlword == 0x07 != ENABLE
    assert bench.take(SDO_TX)
