"""1010 and 1011: signature, refusal while enabled, file, reset."""

import json
from pathlib import Path

import pytest

from unit.drives.virtual.bench import EMCY, ENABLE, Aborted, Bench

SAVE, LOAD = 0x65766173, 0x64616F6C


def test_saved_parameters_are_there_after_a_reset_and_in_another_process(tmp_path: Path) -> None:
    path = tmp_path / "store.json"
    bench = Bench(store=path)
    bench.down(0x6085, 0, 4321, 4)
    bench.down(0x1017, 0, 77, 2)
    bench.down(0x1010, 1, SAVE, 4)
    bench.down(0x6085, 0, 1, 4)
    bench.nmt(0x81)
    assert (bench.up(0x6085), bench.up(0x1017)) == (4321, 77)
    other = Bench(store=path)
    assert (other.up(0x6085), other.up(0x1017)) == (4321, 77)


def test_commands_and_modes_are_never_stored() -> None:
    bench = Bench().set_up()
    bench.down(0x60FF, 0, 1000, 4)
    bench.down(0x1010, 1, SAVE, 4)
    bench.nmt(0x81)
    assert (bench.up(0x60FF), bench.up(0x6060), bench.up(0x6040)) == (0, 0, 0)


def test_a_stored_mapping_is_in_force_after_the_reset() -> None:
    bench = Bench().set_up()
    bench.down(0x1010, 1, SAVE, 4)
    bench.nmt(0x81)
    bench.start()
    found = dict(bench.send(0x80))
    assert len(found[0x182]) == 6


def test_load_acts_at_the_reset_and_not_before() -> None:
    bench = Bench()
    factory = bench.up(0x6085)
    bench.down(0x6085, 0, 4321, 4)
    bench.down(0x1010, 1, SAVE, 4)
    bench.down(0x1011, 1, LOAD, 4)
    assert bench.up(0x6085) == 4321
    bench.nmt(0x81)
    assert bench.up(0x6085) == factory


def test_groups_are_stored_apart() -> None:
    bench = Bench()
    bench.down(0x6085, 0, 4321, 4)
    bench.down(0x1017, 0, 77, 2)
    bench.down(0x1010, 2, SAVE, 4)
    bench.nmt(0x81)
    assert bench.up(0x1017) == 77
    assert bench.up(0x6085) != 4321


@pytest.mark.parametrize(("index", "value"), [(0x1010, LOAD), (0x1010, 0), (0x1011, SAVE), (0x1011, 1)])
def test_another_signature_is_refused(index: int, value: int) -> None:
    with pytest.raises(Aborted, match="08000020"):
        Bench().down(index, 1, value, 4)


@pytest.mark.parametrize(("index", "value"), [(0x1010, SAVE), (0x1011, LOAD)])
def test_neither_is_allowed_while_the_drive_is_enabled(index: int, value: int) -> None:
    bench = Bench().set_up()
    bench.enable()
    with pytest.raises(Aborted, match="08000022"):
        bench.down(index, 1, value, 4)
    bench.run(0.5, 0)
    bench.down(index, 1, value, 4)
    assert bench.up(index, 1) == 1
    bench.run(0.02, ENABLE)


def test_a_damaged_file_means_defaults_and_emcy_6310(tmp_path: Path) -> None:
    path = tmp_path / "store.json"
    for text in ("", "{", "[]", '{"format": 2, "values": {}}', '{"format": 1, "values": {"x": 1}}'):
        path.write_text(text)
        bench = Bench(store=path)
        assert [data[:2].hex() for data in bench.take(EMCY)] == ["1063"]


def test_values_out_of_range_in_the_file_are_not_taken(tmp_path: Path) -> None:
    path = tmp_path / "store.json"
    values = {"605A:00": 99, "6085:00": -1, "1600:00": 200, "1017:00": 50, "9999:00": 1}
    path.write_text(json.dumps({"format": 1, "values": values}))
    bench = Bench(store=path)
    assert bench.up(0x605A) == 2
    assert bench.up(0x1017) == 50
    bench.start()
    bench.send(0x202, b"\x06\x00")
    bench.nmt(0x81)


def test_a_file_that_cannot_be_written_is_an_abort_and_an_emcy(tmp_path: Path) -> None:
    bench = Bench(store=tmp_path / "nowhere" / "store.json")
    with pytest.raises(Aborted, match="08000020"):
        bench.down(0x1010, 1, SAVE, 4)
    bench.down(0x1011, 1, LOAD, 4)
    bench.frames.clear()
    bench.nmt(0x81)
    assert [data[:2].hex() for data in bench.take(EMCY)] == ["3055"]
