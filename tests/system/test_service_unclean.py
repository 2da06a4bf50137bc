"""A service that was not shut down is told at the next start, with the angle; what was acknowledged is there.

INV-8, with kills of all processes at once.
"""

from __future__ import annotations

import json
import os
import random
import signal
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from gantryctl.service.protocol.roles import Role
from gantryctl.service.recorder.journal.proof import verify
from gantryctl.service.recorder.journal.reading import read_journal
from gantryctl.service.supervisor.users import Users
from support.kill_all import PHASES, Killed, boots, lost, run_and_kill
from support.service_process import PASSWORD, Page, Service, add_users

pytestmark = pytest.mark.skipif(sys.platform != "linux", reason="the service needs Linux")
Evidence = Callable[[str, dict[str, object]], None]
# Between the last status frame of the page and the last record: frames come every 50 ms, records too.
PERIODS_S = 0.1
# The axis gains speed after the last frame, 3 deg/s2 at most.
ACC_DEG_S2 = 3.0


def told(directory: Path, boot: int) -> list[dict[str, Any]]:
    """SYS-05 rows that the recorder wrote since the begin of a start."""
    rows = read_journal(directory, limit=1_000_000)
    begun = next(row.seq for row in rows if row.values["boot"] == boot)
    return [
        {**row.values, "detail": json.loads(row.values["detail"]), "seq": row.seq - begun}
        for row in rows
        if row.values["text"].startswith("SYS-05")
    ]


def within(killed: Killed, pos_deg: float) -> bool:
    """Whether the angle told is that of the last status frame, or a little later on its way."""
    late_s = killed.age_s + PERIODS_S
    way_deg = abs(killed.vel_deg_s) * late_s + 0.5 * ACC_DEG_S2 * late_s * late_s
    early_deg = abs(killed.vel_deg_s) * PERIODS_S
    return killed.pos_deg - early_deg - 0.01 <= pos_deg <= killed.pos_deg + way_deg + 0.01


def kill_all(root: Path, count: int) -> dict[str, object]:
    """Kill everything so often; each next start must tell it."""
    chance, directory = random.Random(5), root / "hust_gantry"
    acknowledged = missing = silent = 0
    worst_deg, phases = 0.0, dict.fromkeys(PHASES, 0)
    before: Killed | None = None
    for number in range(count + 1):
        with Service(root) as service:
            if before is not None:
                until = time.monotonic() + 30.0
                while len(told(directory, boots(directory)[-1])) < number and time.monotonic() < until:
                    time.sleep(0.05)
                rows = told(directory, boots(directory)[-1])
                silent += len(rows) != number or "SYS-05" not in service.errors()
                detail = rows[-1]["detail"]
                assert within(before, detail["pos_deg"]), (before, detail)
                worst_deg = max(worst_deg, abs(detail["pos_deg"] - before.pos_deg))
                assert rows[-1]["kind"] == "alarm"
            if number == count:
                break
            before = run_and_kill(service, PHASES[number % len(PHASES)], chance)
        acknowledged += len(before.acknowledged)
        missing += lost(directory, boots(directory)[-1], before)
        phases[before.phase] += 1
    assert verify(directory).wrong == ""
    return {
        "kills_of_everything": count,
        "phases": phases,
        "acknowledged_events": acknowledged,
        "acknowledged_events_lost": missing,
        "starts_that_did_not_tell_it": silent,
        "angle_told_from_last_frame_max_deg": round(worst_deg, 3),
    }


@pytest.mark.slow
@pytest.mark.timeout(7200)
def test_two_hundred_kills_of_everything(tmp_path: Path, evidence: Evidence) -> None:
    add_users(tmp_path)
    found = kill_all(tmp_path, 200)
    evidence("service_killed_whole", found)
    assert (found["acknowledged_events_lost"], found["starts_that_did_not_tell_it"]) == (0, 0)


def test_everything_killed_is_told_with_the_angle_and_a_killed_first_process_ends_in_order(
    tmp_path: Path,
) -> None:
    Users(tmp_path).add("operator", Role.OPERATOR, PASSWORD)
    with Service(tmp_path) as service:
        killed = run_and_kill(service, "move", random.Random(1))
    with Service(tmp_path) as service:
        directory = service.directory
        assert "SYS-05 the previous run of the controller was not shut down" in service.errors()
        recorder = service.child("recorder")
        with service.page("operator") as page:
            moving_and_orphaned(page, service.process.pid)
        until = time.monotonic() + 30.0
        while Path(f"/proc/{recorder}").exists() and time.monotonic() < until:
            time.sleep(0.05)
    first, second = boots(directory)
    assert lost(directory, first, killed) == 0
    (row,) = told(directory, second)
    assert within(killed, row["detail"]["pos_deg"]), (killed, row)
    assert (row["kind"], row["detail"]["code"]) == ("alarm", "SYS-05")
    texts = [row.values["text"] for row in read_journal(directory)]
    assert "SYS-06 supervisor has ended without a word; the others bring the axis to rest and end" in texts
    # The controller's last word comes a ramp and a power-down later, and is kept.
    assert texts[-1].startswith("controller ended at")
    assert "brake closed, torque off" in texts[-1]
    with Service(tmp_path) as again:
        pass
    assert "SYS-05" not in again.errors()  # that run was shut down
    assert len(told(directory, second)) == 1
    assert verify(directory).wrong == ""


def moving_and_orphaned(page: Page, supervisor: int) -> None:
    """Kill the first process while the axis moves."""
    page.power_up()
    page.do("set", tag="speed_setting_deg_s", value=2.0)
    page.do("move", target_deg=90.0)
    page.until(lambda tags: tags["vel_act_deg_s"] > 1.9)
    os.kill(supervisor, signal.SIGKILL)
