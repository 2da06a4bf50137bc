"""The SDO server by raw frames."""

import struct

import pytest

from unit.drives.virtual.bench import EMCY, SDO_RX, SDO_TX, Aborted, Bench


@pytest.fixture
def bench() -> Bench:
    return Bench()


def test_an_expedited_upload_tells_its_size(bench: Bench) -> None:
    assert bench.sdo(bytes.fromhex("4017100000000000")) == bytes.fromhex("4b17100000000000")
    assert bench.sdo(bytes.fromhex("4000100000000000")) == bytes.fromhex("4300100092010200")
    assert bench.sdo(bytes.fromhex("4061600000000000"))[0] == 0x4F


def test_a_string_comes_in_segments_with_alternating_toggle(bench: Bench) -> None:
    first = bench.sdo(bytes.fromhex("4008100000000000"))
    assert first[0] == 0x41
    size = struct.unpack_from("<I", first, 4)[0]
    text, toggle = b"", 0
    while True:
        part = bench.sdo(bytes((0x60 | toggle,)))
        assert part[0] & 0x10 == toggle
        text += part[1 : 8 - (part[0] >> 1 & 7)]
        toggle ^= 0x10
        if part[0] & 1:
            break
    assert text == b"gantryctl virtual drive"
    assert len(text) == size


def test_a_number_may_be_downloaded_in_segments(bench: Bench) -> None:
    assert bench.sdo(bytes.fromhex("2185600004000000")) == bytes.fromhex("6085600000000000")
    assert bench.sdo(bytes.fromhex("07") + struct.pack("<I", 123_456)) == bytes.fromhex("2000000000000000")
    assert bench.up(0x6085) == 123_456


def test_a_segmented_download_without_size_is_taken_too(bench: Bench) -> None:
    bench.sdo(bytes.fromhex("2085600000000000"))
    bench.sdo(bytes.fromhex("0a0102"))
    assert bench.sdo(bytes.fromhex("1b0304")) == bytes.fromhex("3000000000000000")
    assert bench.up(0x6085) == 0x04030201


def test_an_expedited_download_without_size_takes_the_bytes_of_the_object(bench: Bench) -> None:
    bench.sdo(bytes.fromhex("22171000e8030000"))
    assert bench.up(0x1017) == 1000


@pytest.mark.parametrize(
    ("request_hex", "code"),
    [
        ("4000200000000000", 0x06020000),  # no object
        ("4018100500000000", 0x06090011),  # no sub-index
        ("4018100900000000", 0x06090011),
        ("2f00100001000000", 0x06010002),  # read-only
        ("2b41600001000000", 0x06010002),
        ("2308100001000000", 0x06010002),  # const
        ("2385600001000000", None),
        ("2b85600001000000", 0x06070013),  # too short
        ("2317100001000000", 0x06070012),  # too long
        ("2b5a600009000000", 0x06090031),  # too high
        ("2b5a6000ffff0000", 0x06090032),  # too low
        ("2f60600008000000", 0x06090030),  # a mode it has not
        ("2385600000000000", 0x06090032),
        ("2100100000000000", 0x06010002),  # a segmented download is refused at once
        ("2185600000100000", 0x06070012),
        ("a085600000000000", 0x05040002),  # a block of 0 segments
        ("a385600000000000", 0x05040001),  # a block without a transfer
        ("e085600000000000", 0x05040001),
        ("6000000000000000", 0x05040001),  # a segment without a transfer
        ("0000000000000000", 0x05040001),
    ],
)
def test_a_refused_access_has_its_abort_code(bench: Bench, request_hex: str, code: int | None) -> None:
    if code is None:
        bench.sdo(bytes.fromhex(request_hex))
        return
    with pytest.raises(Aborted) as refused:
        bench.sdo(bytes.fromhex(request_hex))
    assert f"{refused.value.code:08X}" == f"{code:08X}"


def test_an_abort_names_the_object_that_was_asked_for(bench: Bench) -> None:
    frames = bench.send(SDO_RX, bytes.fromhex("4000200700000000"))
    assert frames == [(SDO_TX, bytes.fromhex("8000200700000206"))]


def test_a_toggle_bit_that_does_not_alternate_ends_the_transfer(bench: Bench) -> None:
    bench.sdo(bytes.fromhex("4008100000000000"))
    bench.sdo(b"\x60")
    with pytest.raises(Aborted, match="05030000"):
        bench.sdo(b"\x60")
    with pytest.raises(Aborted, match="05040001"):
        bench.sdo(b"\x70")


def test_a_segmented_download_of_another_size_than_announced_is_refused(bench: Bench) -> None:
    bench.sdo(bytes.fromhex("2185600004000000"))
    with pytest.raises(Aborted, match="06070010"):
        bench.sdo(bytes.fromhex("0b0102"))


def test_a_segmented_download_has_an_end(bench: Bench) -> None:
    bench.sdo(bytes.fromhex("2085600000000000"))

    def without_end() -> None:
        for k in range(400):
            bench.sdo(bytes((0x10 * (k % 2), 1, 2, 3, 4, 5, 6, 7)))

    with pytest.raises(Aborted, match="05040005"):
        without_end()


def test_an_abort_of_the_client_ends_the_transfer_without_an_answer(bench: Bench) -> None:
    bench.sdo(bytes.fromhex("4008100000000000"))
    assert bench.send(SDO_RX, bytes.fromhex("8008100000000405")) == []
    with pytest.raises(Aborted, match="05040001"):
        bench.sdo(b"\x60")


def test_a_new_request_takes_the_place_of_a_transfer_under_way(bench: Bench) -> None:
    bench.sdo(bytes.fromhex("4008100000000000"))
    assert bench.up(0x1000) == 0x20192
    with pytest.raises(Aborted, match="05040001"):
        bench.sdo(b"\x60")


@pytest.mark.parametrize("length", [0, 1, 4, 7])
def test_sdo_frames_of_another_length_are_not_answered(bench: Bench, length: int) -> None:
    assert bench.send(SDO_RX, bytes.fromhex("4000100000000000")[:length]) == []


def test_requests_to_another_node_are_not_answered(bench: Bench) -> None:
    assert bench.send(SDO_RX + 1, bytes.fromhex("4000100000000000")) == []


def test_identity_names_and_versions_can_be_pinned(bench: Bench) -> None:
    assert [bench.up(0x1018, sub) for sub in range(5)] == [4, 0x7FF, 0x470402, 0x10000, 1]
    assert bench.up(0x6502) == 0x104
    assert bench.up(0x6076) == 257_000
    assert bench.up(0x6075) == 69_000
    assert (bench.up(0x608F, 1), bench.up(0x608F, 2)) == (1 << 19, 1)
    assert bench.take(EMCY) == []
