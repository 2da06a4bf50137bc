"""The disk of a running service fills up and gets room again: the axis goes on, and no event is lost.

INV-8, with a full disk.
"""

from __future__ import annotations

import os
import shutil
import sys
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path

import pytest

from gantryctl.service.memory.memory import Source
from gantryctl.service.recorder.journal.key import read_key
from gantryctl.service.recorder.journal.places import FILE
from gantryctl.service.recorder.journal.proof import verify, verify_file
from gantryctl.service.recorder.journal.reading import read_journal
from gantryctl.service.recorder.retention import MB, RetentionPolicy
from gantryctl.trace.reader import read_trace
from support.service_process import Page, Service, add_users, on_own_disk

pytestmark = pytest.mark.skipif(sys.platform != "linux", reason="the service needs Linux")
DISK_MB = 120


@pytest.fixture
def service(tmp_path: Path) -> Iterator[Service]:
    if not on_own_disk(DISK_MB, tmp_path):
        pytest.skip("no mount namespace: a disk of its own cannot be had here")
    with Service(tmp_path, disk_mb=DISK_MB) as made:
        yield made


@pytest.fixture
def disk(service: Service) -> Iterator[Path]:
    """The disk of the service, which only it has mounted; it lives until we let go of it."""
    inside = f"/proc/{service.process.pid}/root{service.root}/disk"
    handle = os.open(inside, os.O_RDONLY | os.O_DIRECTORY)
    yield Path(f"/proc/self/fd/{handle}")
    os.close(handle)


def fill(disk: Path, leave_mb: float) -> None:
    """Somebody else's file takes all but so much."""
    found = os.statvfs(disk)
    size = max(0, found.f_bavail * found.f_frsize - int(leave_mb * MB))
    with suppress(OSError), (disk / "somebody").open("ab") as file:
        file.write(bytes(size))


def use_up(service: Service, page: Page, disk: Path) -> None:
    """Less and less room while the axis moves, then room again, and another move."""
    page.power_up()
    page.do("set", tag="speed_setting_deg_s", value=0.6)
    page.do("move", target_deg=3.0)
    page.until(lambda tags: tags["vel_act_deg_s"] > 0.3 and tags["recording"])
    fill(disk, RetentionPolicy().reserve_mb - 10)
    page.until(lambda tags: not tags["recording"])
    assert page.tags["journal_state"] == "ok"
    fill(disk, RetentionPolicy().event_reserve_mb - 10)
    page.until(lambda tags: tags["journal_state"] == "full")
    fill(disk, 0)
    with service.page("service") as other:
        while page.tags["journal_state"] != "failed":
            assert page.refused("move", target_deg=1.0) == "JRN-02"
            # An event each time: what the journal has of the disk takes some of them yet.
            other.do("arm", action="brake_test")
            page.look()
    # And the axis has gone on all the time; a busy computer may have let it arrive meanwhile.
    assert page.tags["vel_act_deg_s"] > 0.3 or page.tags["in_position"]
    page.until(lambda tags: tags["in_position"])
    assert page.tags["pos_act_deg"] == pytest.approx(3.0, abs=0.005)  # the in-position window
    # What lasts is done and said not to be kept; a stop waits for no disk.
    unkept = page.ask("set", tag="increment_deg", value=2.0)
    assert (unkept["ok"], unkept["code"]) == (True, "JRN-03"), unkept
    stopped = page.ask("stop")
    assert (stopped["ok"], stopped["code"]) == (True, ""), stopped
    page.look()
    assert page.tags["journal_committed"] < unkept["journal"]
    (disk / "somebody").unlink()
    page.until(lambda tags: tags["journal_state"] == "ok" and tags["recording"])
    page.until(lambda tags: tags["journal_committed"] == tags["journal_sequence"])
    page.do("move", target_deg=2.9)
    page.until(lambda tags: tags["in_position"] and tags["pos_act_deg"] < 2.95)
    page.do("power", on=False)
    page.until(lambda tags: tags["power_phase"] == "off" and not tags["recording"])


def test_a_full_disk_ends_recordings_then_new_motion_and_loses_no_event(
    service: Service, disk: Path, tmp_path: Path
) -> None:
    add_users(disk)
    with service.page("operator") as page:
        use_up(service, page, disk)
    service.end()
    shutil.copy(disk / "hust_gantry" / FILE, tmp_path)
    (trace,) = (read_trace(file) for file in (disk / "hust_gantry" / "traces").iterdir())
    key = read_key(tmp_path / "disk-keys" / "hust_gantry" / "journal.key")
    assert verify_file(tmp_path / FILE, key).wrong == ""
    rows = [row.values for row in read_journal(tmp_path)]
    numbers = [row["number"] for row in rows if row["source"] == Source.CONTROLLER]
    assert numbers == list(range(1, len(numbers) + 1))
    texts = " ".join(row["text"] for row in rows)
    for said in (
        "set increment_deg 2.0",
        "nothing is recorded",
        "no new motion",
        "the journal could not be written",
        "room again",
    ):
        assert said in texts
    ((begin_s, end_s),) = trace.gaps()  # while there was no room
    assert trace.time_s[0] < begin_s < end_s < trace.time_s[-1]


def test_a_damaged_journal_is_kept_aside_and_nothing_moves_until_service_has_seen_it(tmp_path: Path) -> None:
    add_users(tmp_path)
    (tmp_path / "hust_gantry").mkdir()
    (tmp_path / "hust_gantry" / FILE).write_bytes(b"damaged" * 1000)
    with Service(tmp_path) as service, service.page("service") as page:
        assert "warning: journal" in service.errors()
        page.do("take", over=False)
        page.until(lambda tags: tags["journal_state"] == "locked")
        assert page.refused("power", on=True) == "JRN-02"
        page.do("arm", action="reset_locked")
        page.do("reset")
        page.until(lambda tags: tags["journal_state"] == "ok")
        page.do("power", on=True)
    (aside,) = service.directory.glob("journal-damaged-*")
    assert aside.read_bytes() == b"damaged" * 1000
    texts = [row.values["text"] for row in read_journal(service.directory)]
    assert texts[0].startswith("JRN-05")
    assert "the damaged journal was acknowledged by service" in texts
    assert verify(service.directory).wrong == ""


def test_a_state_directory_that_is_moved_away_locks_new_motion_and_ends_no_process(tmp_path: Path) -> None:
    """What moves goes on; back in its place, and read by service, the service goes on with everything it had."""
    add_users(tmp_path)
    away = tmp_path / "away"
    with Service(tmp_path) as service, service.page("service") as page:
        before = [service.child(name) for name in ("controller", "recorder", "gateway")]
        page.power_up()
        page.do("set", tag="speed_setting_deg_s", value=1.0)
        page.do("move", target_deg=6.0)
        page.until(lambda tags: tags["vel_act_deg_s"] > 0.3)
        service.directory.rename(away)
        page.until(lambda tags: tags["journal_state"] == "locked")
        page.until(lambda tags: tags["in_position"])
        assert page.tags["pos_act_deg"] == pytest.approx(6.0, abs=0.005)  # the in-position window
        assert page.refused("move", target_deg=1.0) == "JRN-02"
        page.do("power", on=False)
        page.until(lambda tags: tags["power_phase"] == "off")
        assert not (service.directory / "retain.a.json").exists()  # nothing is begun anew
        away.rename(service.directory)
        page.do("arm", action="reset_locked")
        page.do("reset")
        page.until(lambda tags: tags["journal_state"] == "ok")
        page.do("power", on=True)
        assert [service.child(name) for name in ("controller", "recorder", "gateway")] == before
    texts = [row.values["text"] for row in read_journal(service.directory)]
    assert any(text.startswith("JRN-07") for text in texts)
    assert any(text.startswith("the state was not kept: state directory") for text in texts)
    assert verify(service.directory).wrong == ""
