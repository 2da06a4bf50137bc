"""PDO mapping by the CiA procedure, transmission types, deadlines, SYNC."""

import struct

import pytest

from gantryctl.drives.virtual.axis.cia402 import State
from unit.drives.virtual.bench import EMCY, ENABLE, NODE, RPDO1, SHUTDOWN, TPDO1, TPDO2, Aborted, Bench

OFF = 0x8000_0000


@pytest.fixture
def bench() -> Bench:
    return Bench()


def refused(bench: Bench, index: int, sub: int, value: int, size: int) -> str:
    with pytest.raises(Aborted) as caught:
        bench.down(index, sub, value, size)
    return f"{caught.value.code:08X}"


def test_the_procedure_maps_and_everything_reads_back(bench: Bench) -> None:
    bench.map(0x1800, TPDO1, (0x60410010, 0x60640020))
    assert [bench.up(0x1A00, sub) for sub in range(3)] == [2, 0x60410010, 0x60640020]
    assert (bench.up(0x1800, 1), bench.up(0x1800, 2)) == (TPDO1, 1)


def test_a_valid_pdo_takes_no_new_mapping(bench: Bench) -> None:
    assert refused(bench, 0x1600, 0, 0, 1) == "08000022"
    assert refused(bench, 0x1600, 1, 0x60400010, 4) == "08000022"


def test_entries_are_refused_while_the_count_is_not_zero(bench: Bench) -> None:
    bench.down(0x1600 - 0x200, 1, OFF | RPDO1, 4)
    assert refused(bench, 0x1600, 1, 0x60400010, 4) == "08000022"
    bench.down(0x1600, 0, 0, 1)
    bench.down(0x1600, 1, 0x60FF0020, 4)
    bench.down(0x1600, 0, 1, 1)


@pytest.mark.parametrize(
    ("index", "entry", "code"),
    [
        (0x1600, 0x20000010, "06020000"),  # no object
        (0x1600, 0x60C20910, "06090011"),  # no sub-index
        (0x1600, 0x60410010, "06040041"),  # read-only into an RPDO
        (0x1600, 0x60850020, "06040041"),  # not mappable
        (0x1600, 0x60400020, "06070010"),  # another length
        (0x1A00, 0x60850020, "06040041"),
        (0x1A00, 0x60640010, "06070010"),
        (0x1A00, 0x10080020, "06040041"),
    ],
)
def test_an_entry_that_cannot_be_mapped_is_refused(bench: Bench, index: int, entry: int, code: str) -> None:
    bench.down(index - 0x200, 1, OFF | TPDO1, 4)
    bench.down(index, 0, 0, 1)
    assert refused(bench, index, 1, entry, 4) == code


def test_more_than_64_bit_and_more_than_8_entries_are_refused(bench: Bench) -> None:
    bench.down(0x1800, 1, OFF | TPDO1, 4)
    bench.down(0x1A00, 0, 0, 1)
    for sub, entry in enumerate((0x60640020, 0x606C0020, 0x60410010), start=1):
        bench.down(0x1A00, sub, entry, 4)
    assert refused(bench, 0x1A00, 0, 3, 1) == "06040042"
    assert refused(bench, 0x1A00, 0, 9, 1) == "06040042"
    assert refused(bench, 0x1A00, 0, 4, 1) == "06020000"  # an empty entry
    bench.down(0x1A00, 0, 2, 1)


@pytest.mark.parametrize("kind", [241, 251, 252, 253])
def test_transmission_types_that_do_not_exist_are_refused(bench: Bench, kind: int) -> None:
    assert refused(bench, 0x1800, 2, kind, 1) == "06090030"
    assert refused(bench, 0x1400, 2, kind, 1) == "06090030"


@pytest.mark.parametrize("cob_id", [0x000, 0x001, 0x080, 0x101, 0x582, 0x602, 0x6E0, 0x702, 0x2000_0182])
def test_identifiers_of_other_services_are_refused(bench: Bench, cob_id: int) -> None:
    bench.down(0x1801, 1, OFF | TPDO2, 4)
    assert refused(bench, 0x1801, 1, cob_id, 4) == "06090030"


def test_the_identifier_of_a_valid_pdo_does_not_change(bench: Bench) -> None:
    assert refused(bench, 0x1400, 1, RPDO1 + 0x10, 4) == "06090030"
    bench.down(0x1400, 1, OFF | RPDO1 + 0x10, 4)
    bench.down(0x1400, 1, RPDO1 + 0x10, 4)


def test_the_inhibit_time_of_a_valid_tpdo_does_not_change(bench: Bench) -> None:
    assert refused(bench, 0x1800, 3, 10, 2) == "08000022"


def test_a_synchronous_tpdo_comes_with_every_nth_sync(bench: Bench) -> None:
    bench.map(0x1800, TPDO1, (0x60410010,), kind=1)
    bench.map(0x1801, TPDO2, (0x60640020,), kind=3)
    bench.start()
    seen = [{can_id for can_id, _ in bench.send(0x80)} for _ in range(6)]
    assert all(TPDO1 in frames for frames in seen)
    assert [TPDO2 in frames for frames in seen] == [False, False, True, False, False, True]


def test_a_synchronous_rpdo_acts_at_the_next_sync_an_event_driven_one_at_once(bench: Bench) -> None:
    bench.set_up()
    bench.send(RPDO1, struct.pack("<Hih", SHUTDOWN, 0, 0))
    assert bench.node.axis.state is State.SWITCH_ON_DISABLED
    bench.send(0x80)
    assert bench.node.axis.state is State.READY
    direct = Bench().set_up(rpdo_kind=255)
    direct.send(RPDO1, struct.pack("<Hih", SHUTDOWN, 0, 0))
    assert direct.node.axis.state is State.READY


def test_a_tpdo_samples_before_the_rpdo_acts(bench: Bench) -> None:
    bench.set_up()
    bench.send(RPDO1, struct.pack("<Hih", SHUTDOWN, 0, 0))
    first, second = (dict(bench.send(0x80))[TPDO1] for _ in range(2))
    assert struct.unpack_from("<H", first)[0] & 0x6F == State.SWITCH_ON_DISABLED
    assert struct.unpack_from("<H", second)[0] & 0x6F == State.READY


def test_an_event_driven_tpdo_comes_at_the_start_and_with_every_change_of_the_statusword(
    bench: Bench,
) -> None:
    bench.frames.clear()
    bench.start()
    assert [data.hex() for can_id, data in bench.frames if can_id == TPDO1] == ["5002"]
    assert bench.send(RPDO1, b"\x06\x00") == [(TPDO1, bytes.fromhex("3102"))]
    assert bench.send(RPDO1, b"\x06\x00") == []


def test_the_event_timer_repeats_and_the_inhibit_time_holds_back(bench: Bench) -> None:
    bench.down(0x1800, 1, OFF | TPDO1, 4)
    bench.down(0x1800, 3, 500, 2)  # 50 ms
    bench.down(0x1800, 5, 100, 2)
    bench.down(0x1800, 1, TPDO1, 4)
    bench.down(0x60C2, 1, 10, 1)
    bench.start()
    bench.frames.clear()
    for _ in range(41):
        bench.send(0x80)
    assert len(bench.take(TPDO1)) == 4
    for word in (6, 7, 6, 7, 6):
        bench.send(RPDO1, bytes((word, 0)))
    early = len(bench.take(TPDO1))
    for _ in range(10):
        bench.send(0x80)
    assert early <= 1
    assert len(bench.take(TPDO1)) >= 1


def test_transmission_type_0_comes_with_sync_but_only_after_a_change(bench: Bench) -> None:
    bench.map(0x1800, TPDO1, (0x60410010,), kind=0)
    bench.start()
    counts = []
    for word in (0, 0, 6, 6, 0):
        bench.down(0x6040, 0, word, 2)
        counts.append(sum(can_id == TPDO1 for _ in range(2) for can_id, _ in bench.send(0x80)))
    assert counts == [1, 0, 1, 0, 1]


def test_a_short_rpdo_is_refused_whole_with_emcy_8210(bench: Bench) -> None:
    bench.set_up()
    bench.run(0.02, SHUTDOWN)
    bench.frames.clear()
    for _ in range(3):
        bench.send(RPDO1, b"\x00\x00\x01")
        bench.send(0x80)
    assert bench.node.axis.state is State.READY
    assert [data[:2].hex() for data in bench.take(EMCY)] == ["1082"]
    bench.send(RPDO1, struct.pack("<Hih", SHUTDOWN, 0, 0))
    assert bench.take(EMCY) == [bytes(8)]


def test_a_long_rpdo_is_read_as_far_as_it_is_mapped(bench: Bench) -> None:
    bench.map(0x1400, RPDO1, (0x60400010,), kind=255)
    bench.start()
    bench.send(RPDO1, bytes.fromhex("0600ffffffffffff"))
    assert bench.node.axis.state is State.READY


def test_a_mapped_value_out_of_range_is_left_out_and_the_rest_acts(bench: Bench) -> None:
    bench.map(0x1400, RPDO1, (0x60600008, 0x60400010), kind=255)
    bench.start()
    bench.send(RPDO1, b"\x08\x06\x00")
    assert bench.up(0x6061) == 0
    assert bench.node.axis.state is State.READY


def test_a_missed_rpdo_deadline_is_emcy_8250_and_6007_decides(bench: Bench) -> None:
    bench.set_up()
    bench.down(0x6007, 0, 3, 2)
    bench.down(0x605A, 0, 6, 2)
    bench.enable()
    bench.down(0x1400, 5, 50, 2)
    bench.run(0.2, ENABLE)
    bench.frames.clear()
    for _ in range(12):
        bench.send(0x80)
    assert bench.take(EMCY) == []
    for _ in range(2):
        bench.send(0x80)
    assert [data[:3].hex() for data in bench.take(EMCY)] == ["508211"]
    assert bench.node.axis.state is State.QUICK_STOP
    bench.cycle(0)
    assert bench.take(EMCY)[-1] == bytes(8)


def test_the_deadline_runs_from_the_first_rpdo_on_and_ends_with_operational(bench: Bench) -> None:
    bench.set_up()
    bench.down(0x1400, 5, 20, 2)
    for _ in range(20):
        bench.send(0x80)
    bench.cycle(0)
    bench.nmt(0x80)
    for _ in range(20):
        bench.send(0x80)
    assert bench.take(EMCY) == []


def test_a_missed_deadline_stays_in_the_error_register_until_commands_come_again(bench: Bench) -> None:
    """CiA 301: an error is told once, kept in 1001 over NMT commands, and told to be gone when it is."""
    bench.set_up()
    bench.down(0x1400, 5, 20, 2)
    bench.cycle(0)
    for _ in range(20):
        bench.send(0x80)
    bench.nmt(0x80)
    assert [data[:2].hex() for data in bench.take(EMCY)] == ["5082"]
    assert bench.up(0x1001, 0) == 0x11  # generic and communication
    bench.nmt(0x01)
    bench.cycle(0)
    assert bench.take(EMCY) == [bytes(8)]
    assert bench.up(0x1001, 0) == 0


def test_the_window_of_1007_drops_late_synchronous_rpdos(bench: Bench) -> None:
    bench.set_up()
    bench.down(0x1007, 0, 1000, 4)
    bench.send(0x80)
    bench.node.advance(2000)
    bench.send(RPDO1, struct.pack("<Hih", SHUTDOWN, 0, 0))
    bench.send(0x80)
    assert bench.node.axis.state is State.SWITCH_ON_DISABLED


def test_the_factory_mapping_is_that_of_the_profile(bench: Bench) -> None:
    assert bench.up(0x1400, 1) == 0x200 + NODE
    assert bench.up(0x1800, 1) == 0x4000_0180 + NODE
    assert bench.up(0x1401, 1) == OFF | 0x300 + NODE
    assert (bench.up(0x1600, 0), bench.up(0x1600, 1)) == (1, 0x60400010)
    assert bench.up(0x1802, 1) >> 31 == 1
