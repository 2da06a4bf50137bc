"""What a power cut, a flipped bit or a second process does to the retained memory is never unnoticed."""

import dataclasses
import errno
import math
import os
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest

from gantryctl.errors import StateError
from gantryctl.runtime import AlarmEntry, Retained, RetainedMemory, StateLock, retained
from gantryctl.runtime.retained_store import COPIES, decode, encode

FIRST = Retained(
    machine="hust_gantry",
    config_hash="0123abcd",
    speed_rad_s=0.0105,
    encoder_serial="SIM-0001",
    zero_offset_counts=16_777_216,
    zero_set_by="service",
    zero_set_at="2026-11-20T10:00:00+00:00",
    zero_witness="mark at 0 deg, Häfele",
    rest_position_counts=16_777_300,
    alarms=(AlarmEntry("CTL-03", "CTL-03 STOP · following error 0.12 deg", time_s=1.5, pos_act_rad=0.1),),
)
SECOND = dataclasses.replace(FIRST, rest_position_counts=16_900_000, moves=1)
THIRD = dataclasses.replace(FIRST, rest_position_counts=17_000_000, moves=2)


@pytest.fixture
def memory(tmp_path: Path) -> RetainedMemory:
    return RetainedMemory(tmp_path / "state")


def path_of(memory: RetainedMemory, sequence: int) -> Path:
    """The copy that holds this sequence number."""
    return next(
        memory.directory / name
        for name in COPIES
        if decode((memory.directory / name).read_bytes())[0] == sequence
    )


def test_without_files_there_is_nothing_to_remember(memory: RetainedMemory) -> None:
    assert memory.load() is None
    assert memory.notes == ()


def test_the_newest_of_two_copies_counts_and_they_are_written_in_turn(memory: RetainedMemory) -> None:
    for number in range(1, 8):
        record = dataclasses.replace(FIRST, moves=number)
        memory.store(record)
        assert memory.load() == record
        assert memory.notes == ()
        assert path_of(memory, number).name == COPIES[(number - 1) % 2]
    assert sorted(path.name for path in memory.directory.iterdir()) == sorted(COPIES)


def test_the_sequence_decides_and_not_the_name_or_the_age_of_a_file(memory: RetainedMemory) -> None:
    memory.directory.mkdir()
    (memory.directory / COPIES[0]).write_bytes(encode(FIRST, 10))
    (memory.directory / COPIES[1]).write_bytes(encode(SECOND, 9))
    assert memory.load() == FIRST
    memory.store(THIRD)
    assert memory.load() == THIRD
    assert path_of(memory, 11).name == COPIES[1]


def test_a_newer_copy_torn_at_any_byte_falls_back_to_the_older_and_says_so(memory: RetainedMemory) -> None:
    memory.store(FIRST)
    memory.store(SECOND)
    newer = path_of(memory, 2)
    whole = newer.read_bytes()
    for length in range(len(whole)):
        newer.write_bytes(whole[:length])
        assert memory.load() == FIRST, f"cut at byte {length}"
        assert newer.name in memory.notes[0]
        assert memory.notes[0].endswith("; the other copy is used")


def test_every_flipped_bit_of_the_newer_copy_is_found(memory: RetainedMemory) -> None:
    memory.store(FIRST)
    memory.store(SECOND)
    whole = path_of(memory, 2).read_bytes()
    for position in range(len(whole)):
        for bit in range(8):
            flipped = bytearray(whole)
            flipped[position] ^= 1 << bit
            with pytest.raises(StateError):
                decode(bytes(flipped))


def test_after_a_torn_write_the_next_store_replaces_the_damaged_copy(memory: RetainedMemory) -> None:
    memory.store(FIRST)
    memory.store(SECOND)
    torn = path_of(memory, 2)
    torn.write_bytes(torn.read_bytes()[:100])
    memory.store(THIRD)
    assert memory.load() == THIRD
    assert memory.notes == ()
    assert path_of(memory, 1).name != torn.name


def test_two_damaged_copies_are_refused_in_clear_words_and_not_overwritten(memory: RetainedMemory) -> None:
    memory.store(FIRST)
    memory.store(SECOND)
    for name in COPIES:
        (memory.directory / name).write_bytes(b'{"crc32": ')
    for call in (memory.load, lambda: memory.store(THIRD)):
        with pytest.raises(StateError, match=r"retain.a.json .*retain.b.json .*move the files away"):
            call()
    assert (memory.directory / COPIES[0]).read_bytes() == b'{"crc32": '


def test_a_single_damaged_copy_is_refused_too(memory: RetainedMemory) -> None:
    memory.store(FIRST)
    (memory.directory / COPIES[0]).write_bytes(b"")
    with pytest.raises(StateError, match="cut off or damaged"):
        memory.load()


def test_a_missing_copy_is_noted(memory: RetainedMemory) -> None:
    memory.store(FIRST)
    memory.store(SECOND)
    (memory.directory / COPIES[0]).unlink()
    assert memory.load() == SECOND
    assert memory.notes == ("retain.a.json is missing; the other copy is used",)


@pytest.mark.parametrize("content", [b"[]", b"null", b"{}", b"\xff\xfe", b"[" * 100_000, b"\0" * 500])
def test_foreign_content_is_damage(content: bytes) -> None:
    with pytest.raises(StateError):
        decode(content)


def test_a_whole_copy_of_another_version_is_never_bridged_with_older_data(
    memory: RetainedMemory, monkeypatch: pytest.MonkeyPatch
) -> None:
    memory.store(FIRST)
    monkeypatch.setattr("gantryctl.runtime.retained_store.FORMAT", "gantryctl retained memory, version 2")
    (memory.directory / COPIES[1]).write_bytes(encode(SECOND, 2))
    monkeypatch.undo()
    with pytest.raises(StateError, match=r"retain\.b\.json: of another version of gantryctl"):
        memory.load()


@pytest.mark.parametrize(
    "change",
    [
        {"speed_rad_s": math.nan},
        {"travelled_rad": math.inf},
        {"zero_offset_counts": 1.5},
        {"zero_offset_counts": True},
        {"moves": None},
        {"machine": 7},
        {"holding_torque_nm": "12"},
        {"travelled_rad": 10**400},
        {"alarms": (AlarmEntry("X", "x", time_s=math.nan),)},
    ],
)
def test_what_is_not_finite_or_of_the_wrong_type_is_not_stored(
    memory: RetainedMemory, change: dict[str, object]
) -> None:
    memory.store(FIRST)
    with pytest.raises(StateError, match="must be a finite"):
        memory.store(dataclasses.replace(FIRST, **change))
    assert memory.load() == FIRST


def test_the_alarm_history_keeps_the_last_hundred() -> None:
    alarms = tuple(AlarmEntry("X", str(number)) for number in range(150))
    kept = dataclasses.replace(FIRST, alarms=alarms).alarms
    assert [alarm.text for alarm in kept] == [str(number) for number in range(50, 150)]


def test_a_disk_that_does_not_take_it_leaves_both_copies_as_they_were(
    memory: RetainedMemory, monkeypatch: pytest.MonkeyPatch
) -> None:
    memory.store(FIRST)
    memory.store(SECOND)
    before = {name: (memory.directory / name).read_bytes() for name in COPIES}

    def no_space(handle: int) -> None:
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    monkeypatch.setattr(os, "fsync", no_space)
    with pytest.raises(StateError, match="cannot be written: No space left on device"):
        memory.store(THIRD)
    assert {name: (memory.directory / name).read_bytes() for name in COPIES} == before
    assert memory.load() == SECOND


def test_a_directory_that_is_a_file_is_named(tmp_path: Path) -> None:
    (tmp_path / "state").write_text("x")
    memory = RetainedMemory(tmp_path / "state")
    with pytest.raises(StateError, match="state"):
        memory.load()
    with pytest.raises(StateError, match="state directory"), StateLock(tmp_path / "state"):
        pass


# --- the lock --------------------------------------------------------------------------------------


HOLD = """
import sys
from gantryctl.runtime import StateLock
with StateLock(sys.argv[1]):
    print("held", flush=True)
    input()
"""


def test_two_processes_cannot_hold_one_directory_and_the_second_names_the_first(tmp_path: Path) -> None:
    command = [sys.executable, "-c", HOLD, str(tmp_path)]
    with subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True) as first:
        assert first.stdin is not None
        assert first.stdout is not None
        assert first.stdout.readline() == "held\n"
        with pytest.raises(StateError, match=f"is in use by process {first.pid};"), StateLock(tmp_path):
            pass
        first.kill()  # however it ends, the directory is free again
        first.wait()
        with StateLock(tmp_path):
            pass


def test_the_lock_also_holds_within_one_process_and_is_freed(tmp_path: Path) -> None:
    with StateLock(tmp_path):
        with pytest.raises(StateError, match=f"process {os.getpid()}"), StateLock(tmp_path):
            pass
        with pytest.raises(StateError), StateLock(tmp_path):
            pass
    with StateLock(tmp_path):
        pass


def test_a_memory_from_before_the_brake_test_is_read_with_its_defaults() -> None:
    record = retained.to_json_values(FIRST)
    old = {name: value for name, value in record.items() if name not in retained._ADDED}
    assert len(old) < len(record)
    assert retained.from_json_values(old) == FIRST
    with pytest.raises(StateError, match="brake_tests_new"):
        retained.from_json_values({**old, "brake_tests_new": 1})


@pytest.mark.parametrize("more", [b" ", b"\n", b"\0"])
def test_a_copy_with_a_byte_behind_its_end_is_damaged(more: bytes) -> None:
    assert decode(encode(FIRST, 1)) == (1, FIRST)
    with pytest.raises(StateError, match="damaged"):
        decode(encode(FIRST, 1) + more)


@pytest.mark.parametrize("name", ["power_ups", "travelled_rad", "error_stop", "zero_offset_counts"])
def test_a_memory_without_a_field_is_refused_and_not_filled_up(name: str) -> None:
    """No alarm that held the axis, no zero: a default would say so."""
    values = retained.to_json_values(FIRST)
    del values[name]
    with pytest.raises(StateError, match=f"missing or unknown: {name}"):
        retained.from_json_values(values)


def test_every_value_is_read_back_as_it_was_stored(memory: RetainedMemory) -> None:
    """Each field with a value of its own: nothing takes the place of another, or its default."""
    values: dict[str, Any] = {}
    for number, field in enumerate(dataclasses.fields(Retained), start=1):
        kind = str(field.type)
        if field.name != "alarms":
            values[field.name] = (
                0.5 + number if "float" in kind else number if "int" in kind else f"word {number}"
            )
    entry = AlarmEntry("CTL-03", "text", "at", 1.5, 2.5, 3.5, 4.5, "STOP", "INT-03")
    memory.store(Retained(**values, alarms=(entry,)))
    found = RetainedMemory(memory.directory).load()
    assert found is not None
    assert {**vars(found), "alarms": ()} == {**values, "alarms": ()}
    assert found.alarms == (entry,)
