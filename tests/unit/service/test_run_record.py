"""The record of a run: what kills and power cuts leave of it is told at the next start, with the angle."""

from __future__ import annotations

import os
import random
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

from gantryctl.errors import DeviceError
from gantryctl.service.memory.memory import SharedMemory, Word
from gantryctl.service.memory.snapshot import FAST, publish_fast, publish_json
from gantryctl.service.recorder import run_record as module
from gantryctl.service.recorder.run_record import (
    FILE,
    KEEP_AT_REST_S,
    KEEP_S,
    NOTE_S,
    RunFile,
    RunKeeper,
    RunRecord,
)

SECTOR = 512


def record(number: int, *, clean: bool = False) -> RunRecord:
    return RunRecord(7, clean, 1000.0 + number, 0.001 * number, float(number), 0.5)


def reread(directory: Path) -> RunRecord | None:
    file = RunFile(directory)
    try:
        return file.read()
    finally:
        file.close()


def test_the_newest_record_is_read_whichever_way_it_was_written(tmp_path: Path) -> None:
    file = RunFile(tmp_path)
    assert file.read() is None
    for number, write in enumerate([file.keep, file.note, file.note, file.keep, file.keep, file.note]):
        write(record(number))
        assert reread(tmp_path) == record(number)
    file.close()
    again = RunFile(tmp_path)  # a later run goes on counting
    again.read()
    again.keep(record(50, clean=True))
    again.close()
    assert reread(tmp_path) == record(50, clean=True)


def test_of_a_damaged_file_nothing_is_known_and_it_was_not_shut_down(tmp_path: Path) -> None:
    (tmp_path / FILE).write_bytes(b"damaged" * 300)
    found = reread(tmp_path)
    assert found is not None
    assert (found.clean, found.pos_deg, found.vel_deg_s) == (False, None, None)
    assert "it was at an angle that is not known" in found.told.line


def test_one_process_holds_it(tmp_path: Path) -> None:
    first, second = RunFile(tmp_path), RunFile(tmp_path)
    assert first.hold()
    assert not second.hold()
    first.close()
    assert second.hold()
    second.close()


def test_a_link_is_no_record(tmp_path: Path) -> None:
    (tmp_path / FILE).symlink_to(tmp_path / "elsewhere")
    with pytest.raises(DeviceError, match=r"run\.state: .*it must be a file of this user"):
        RunFile(tmp_path)


class CutDisk:
    """The file as a power cut may leave it: what was not synchronised is old, new or torn, sector by sector."""

    def __init__(self, monkeypatch: pytest.MonkeyPatch) -> None:
        self.safe = bytearray(3 * SECTOR)
        self.open: list[tuple[int, bytes]] = []
        write, sync = os.pwrite, os.fdatasync
        self.cuts = 0
        self.before_sync: list[list[tuple[int, bytes]]] = []

        def pwrite(handle: int, data: bytes, at: int) -> int:
            self.open.append((at, data))
            return write(handle, data, at)

        def fdatasync(handle: int) -> None:
            self.cut_here()  # in the middle of a synchronisation
            sync(handle)
            for at, data in self.open:
                self.safe[at : at + len(data)] = data
            self.open.clear()

        monkeypatch.setattr(module.os, "pwrite", pwrite)
        monkeypatch.setattr(module.os, "fdatasync", fdatasync)
        self.kept = -1
        self.chance = random.Random(3)
        self.lost = 0
        self.place = Path()

    def cut_here(self) -> None:
        """A power cut now, in a copy; afterwards the newest record must be no older than what was kept."""
        image = bytearray(self.safe)
        for at, data in self.open:
            torn = self.chance.choice((0, len(data), self.chance.randrange(1, 100)))  # of some 130 bytes
            image[at : at + torn] = data[:torn]
        if not any(image):
            return
        self.place.mkdir(exist_ok=True)
        (self.place / FILE).write_bytes(image)
        found = reread(self.place)
        assert found is not None
        self.cuts += 1
        self.lost += self.kept >= 0 and (found.pos_deg is None or found.pos_deg < self.kept)


def cut(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> CutDisk:
    """Power cuts in 400 steps of a run."""
    disk = CutDisk(monkeypatch)
    disk.place = tmp_path / "cut"
    file = RunFile(tmp_path / "run")
    for number in range(400):
        if disk.chance.random() < 0.2:
            file.keep(record(number))
            disk.kept = number
        else:
            file.note(record(number))
        disk.cut_here()
    file.close()
    return disk


def test_a_power_cut_leaves_what_was_kept(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    disk = cut(tmp_path, monkeypatch)
    assert disk.cuts > 400
    assert disk.lost == 0


def test_this_test_can_fail_a_record_in_one_place_is_lost(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def in_one_place(self: RunFile, made: RunRecord) -> None:
        self._write(1, made)
        os.fdatasync(self._handle)

    monkeypatch.setattr(RunFile, "keep", in_one_place)
    assert cut(tmp_path, monkeypatch).lost > 0


class Run:
    """A service with a controller that publishes, and its recorder's keeper, in a time of its own."""

    def __init__(self, directory: Path, boot: int) -> None:
        self.memory, self.now_s = SharedMemory.create(), 0.0
        self.memory.words[Word.BOOT], self.memory.words[Word.CONTROLLER_CLEAN] = boot, 1
        self.file = RunFile(directory)
        assert self.file.hold()
        self.keeper = RunKeeper(self.memory, self.file, lambda: 5000.0 + self.now_s, lambda: self.now_s)

    def sees(self, pos_deg: float, vel_deg_s: float, **tags: float) -> None:
        self.memory.words[Word.CONTROLLER_CLEAN] = 0
        values = dict.fromkeys(FAST, 0.0) | {"position_valid": 1.0}
        values |= {"pos_act_deg": pos_deg, "vel_act_deg_s": vel_deg_s, **tags}
        publish_fast(self.memory.fast, values, 0)

    def killed(self) -> None:
        self.file.close()
        self.memory.close()


def left(directory: Path, boot: int) -> RunRecord | None:
    run = Run(directory, boot)
    found = run.keeper.left_behind()
    run.killed()
    return found


def test_a_run_that_was_killed_is_told_with_angle_and_speed(tmp_path: Path) -> None:
    run = Run(tmp_path, 1)
    assert run.keeper.left_behind() is None
    run.keeper.look()  # no controller yet
    run.sees(12.346, 1.5)
    run.now_s += NOTE_S
    run.keeper.look()
    run.killed()
    assert left(tmp_path, 1) is None  # a recorder of the same run
    found = left(tmp_path, 2)
    assert found is not None
    assert (found.pos_deg, found.vel_deg_s) == (12.346, 1.5)
    assert found.told.line.startswith(
        "SYS-05 the previous run of the controller was not shut down; at 1970-01-01T01:23:"
    )
    assert "it was at 12.35 deg, 1.50 deg/s" in found.told.line


def test_it_is_told_until_a_run_is_shut_down(tmp_path: Path) -> None:
    run = Run(tmp_path, 1)
    run.sees(3.0, 0.0)
    run.keeper.look()
    run.killed()
    for boot in (2, 3):  # killed before their controller was there
        assert left(tmp_path, boot) is not None
    last = Run(tmp_path, 4)
    last.sees(4.0, 0.0)
    last.keeper.look()
    last.memory.words[Word.CONTROLLER_CLEAN] = 1
    last.keeper.end(kept=True)
    last.killed()
    assert left(tmp_path, 5) is None


@pytest.mark.parametrize(("kept", "shut_down"), [(False, 1), (True, 0)])
def test_an_end_without_all_events_or_without_a_shutdown_is_not_clean(
    tmp_path: Path, kept: bool, shut_down: int
) -> None:
    run = Run(tmp_path, 1)
    run.sees(3.0, 0.0)
    run.memory.words[Word.CONTROLLER_CLEAN] = shut_down
    run.keeper.end(kept=kept)
    run.killed()
    assert left(tmp_path, 2) is not None


def test_an_angle_that_was_not_vouched_for_is_not_told(tmp_path: Path) -> None:
    run = Run(tmp_path, 1)
    run.sees(3.0, 0.0, position_valid=0.0)
    run.keeper.look()
    run.killed()
    found = left(tmp_path, 2)
    assert found is not None
    assert found.pos_deg is None


def test_an_angle_is_told_as_people_read_it(tmp_path: Path) -> None:
    run = Run(tmp_path, 1)
    publish_json(run.memory.columns, {"columns": [], "metadata": {"turn_begin_deg": 0.0}})
    run.sees(-90.0, 0.0)
    run.keeper.look()
    run.killed()
    found = left(tmp_path, 2)
    assert found is not None
    assert found.pos_deg == 270.0


def test_it_is_synchronised_every_second_in_motion_and_rarely_at_rest(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    syncs = 0
    sync = os.fdatasync

    def counted(handle: int) -> None:
        nonlocal syncs
        syncs += 1
        sync(handle)

    monkeypatch.setattr(module.os, "fdatasync", counted)
    run = Run(tmp_path, 1)

    def seconds(count: float, vel_deg_s: float) -> int:
        nonlocal syncs
        syncs, begin_s = 0, run.now_s
        while run.now_s < begin_s + count:
            run.sees(30.0 + vel_deg_s * (run.now_s - begin_s), vel_deg_s)
            run.keeper.look()
            run.now_s += 0.01
        return syncs

    seconds(1.0, 0.0)
    assert seconds(100.0, 0.0) <= 100.0 / KEEP_AT_REST_S + 1
    assert seconds(20.0, 1.0) == pytest.approx(20.0 / KEEP_S, abs=2)
    run.killed()


def test_a_disk_that_fails_is_told_once_and_the_run_goes_on(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def fails(*_: Any) -> int:
        raise OSError(28, "No space left on device")

    run = Run(tmp_path, 1)
    run.sees(3.0, 0.0)
    with monkeypatch.context() as broken:
        broken.setattr(module.os, "pwrite", fails)
        for _ in range(5):
            run.keeper.look()
            run.now_s += NOTE_S
    assert capsys.readouterr().err.count("No space left on device") == 1
    run.keeper.look()
    run.now_s += NOTE_S
    # Once more when it has worked in between.
    with monkeypatch.context() as broken:
        broken.setattr(module.os, "pwrite", fails)
        run.keeper.look()
    assert capsys.readouterr().err.count("No space left on device") == 1
    run.now_s += NOTE_S
    run.keeper.look()
    run.killed()
    assert left(tmp_path, 2) is not None


@pytest.mark.parametrize("vel_deg_s", [1.0, -1.0])
def test_an_axis_that_turns_is_kept_every_second_whichever_way_it_turns(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, vel_deg_s: float
) -> None:
    run, kept = Run(tmp_path, 1), []
    keep = run.file.keep
    monkeypatch.setattr(run.file, "keep", lambda made: (kept.append(round(run.now_s, 3)), keep(made)))
    for step in range(101):
        run.now_s = 0.05 * step
        run.sees(vel_deg_s * run.now_s, vel_deg_s)
        run.keeper.look()
    run.killed()
    assert kept == [0.0, 1.0, 2.0, 3.0, 4.0, 5.0]


def test_a_reading_has_the_time_at_which_it_was_read(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """It is half a second old at 01:23:20, 5000 s after midnight of 1970."""
    run = Run(tmp_path, 1)
    run.sees(3.0, 0.0)
    tags, _ = run.keeper._snapshot.fast()
    monkeypatch.setattr(run.keeper._snapshot, "fast", lambda: (tags, 500.0))
    run.keeper.look()
    run.killed()
    found = left(tmp_path, 2)
    assert found is not None
    assert found.utc_s == 4999.5


def test_the_newest_record_is_the_last_that_is_written_over(tmp_path: Path) -> None:
    """Two on the disk, the newer one in the third sector: the next start writes into the second."""
    file = RunFile(tmp_path)
    file.keep(record(1))
    file.keep(record(2))
    file.close()
    newest = (tmp_path / FILE).read_bytes()[2 * SECTOR :]
    again = RunFile(tmp_path)
    assert again.read() == record(2)
    again.keep(record(3))
    again.close()
    assert (tmp_path / FILE).read_bytes()[2 * SECTOR :] == newest
    assert reread(tmp_path) == record(3)


def test_the_end_of_a_run_is_on_the_disk_and_an_unknown_angle_is_one_at_rest(tmp_path: Path) -> None:
    """A power cut behind a shutdown is no cut of the run; without an angle the disk is asked every 10 s."""
    run, kept, noted = Run(tmp_path, 1), list[tuple[float, bool]](), list[float]()
    file: Any = SimpleNamespace(
        keep=lambda made: kept.append((run.now_s, made.clean)), note=lambda _: noted.append(run.now_s)
    )
    run.keeper._file = file
    run.sees(3.0, 0.0, position_valid=0.0)
    for now_s in (0.0, 1.0, 9.0, 10.0):
        run.now_s = now_s
        run.keeper.look()
    run.memory.words[Word.CONTROLLER_CLEAN] = 1
    run.keeper.end(kept=True)
    assert kept == [(0.0, False), (10.0, False), (10.0, True)]
    assert noted == [1.0, 9.0]
    run.killed()
