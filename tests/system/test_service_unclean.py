"""A service that was not shut down is told at the next start, with the angle; what was acknowledged is there.

INV-8, with kills of all processes at once.
"""

from __future__ import annotations

import json
import math
import os
import random
import signal
import sys
import time
from collections import Counter
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
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
# What the axis gains between two frames, at most: of the machine file, and some for the ripple of the drive.
ACC_DEG_S2 = 1.0
# The encoder's step and the rounding of tags.
READING_DEG = 0.002
# The recorder is no real-time process: on a computer with ten times the load that it can carry it comes late.
BEHIND_MAX_S = 2.0
# How long a word of the recorder is waited for: only a service that hangs takes so long, on the busiest computer too.
WORD_S = 300.0


def told(directory: Path, boot: int) -> list[dict[str, Any]]:
    """SYS-05 rows that the recorder wrote since the begin of a start."""
    rows = read_journal(directory, limit=1_000_000)
    begun = next(row.seq for row in rows if row.values["boot"] == boot)
    return [
        {**row.values, "detail": json.loads(row.values["detail"]), "seq": row.seq - begun}
        for row in rows
        if row.values["text"].startswith("SYS-05")
    ]


def off_the_way_deg(killed: Killed, told: dict[str, Any]) -> float:
    """How far the angle told is from that at its time, beyond what two frames leave open; the frames are the page's."""
    time_s, pos_deg = told["time_s"], told["pos_deg"]
    frames = killed.seen
    after = next((n for n, frame in enumerate(frames) if frame[0] >= time_s), len(frames))
    known = frames[max(0, after - 1)]
    gap_s = time_s - known[0]
    expected = known[1] + known[2] * gap_s
    return max(0.0, abs(pos_deg - expected) - 0.5 * ACC_DEG_S2 * gap_s * gap_s - READING_DEG)


def behind_s(killed: Killed, told: dict[str, Any]) -> float:
    """Time from the record to the last status frame that the page has seen."""
    return max(0.0, killed.seen[-1][0] - told["time_s"])


def kill_all(root: Path, count: int) -> list[dict[str, Any]]:
    """Kill everything so often; what each next start told and had."""
    chance, directory = random.Random(root.name), root / "hust_gantry"
    add_users(root)
    found: list[dict[str, Any]] = []
    before: Killed | None = None
    for number in range(count + 1):
        with Service(root) as service:
            if before is not None:
                boot = boots(directory)[-1]
                until_s = time.monotonic() + WORD_S
                while len(told(directory, boot)) < number and time.monotonic() < until_s:
                    time.sleep(0.05)
                rows = told(directory, boot)
                detail = rows[-1]["detail"] if len(rows) == number else None
                found[-1] |= {
                    "told": detail is not None
                    and "SYS-05" in service.errors()
                    and rows[-1]["kind"] == "alarm",
                    "off_deg": math.inf if detail is None else off_the_way_deg(before, detail),
                    "behind_s": math.inf if detail is None else behind_s(before, detail),
                }
            if number == count:
                break
            before = run_and_kill(service, PHASES[number % len(PHASES)], chance)
        missing = lost(directory, boots(directory)[-1], before)
        found.append({"phase": before.phase, "acknowledged": len(before.acknowledged), "lost": missing})
    assert verify(directory).wrong == ""
    return found


@pytest.mark.slow
def test_two_hundred_kills_of_everything(tmp_path: Path, evidence: Evidence) -> None:
    """Four services at the same time, so that the computer is busy."""
    roots = [tmp_path / str(number) for number in range(4)]
    for root in roots:
        root.mkdir()
    with ThreadPoolExecutor(len(roots)) as pool:
        runs = [run for found in pool.map(lambda root: kill_all(root, 50), roots) for run in found]
    lost_events = sum(run["lost"] for run in runs)
    silent = sum(not run["told"] for run in runs)
    behind = sorted(run["behind_s"] for run in runs)
    evidence(
        "service_killed_whole",
        {
            "kills_of_everything": len(runs),
            "phases": Counter(run["phase"] for run in runs),
            "acknowledged_events": sum(run["acknowledged"] for run in runs),
            "acknowledged_events_lost": lost_events,
            "starts_that_did_not_tell_it": silent,
            "angle_told_off_the_way_max_deg": round(max(run["off_deg"] for run in runs), 4),
            "record_behind_last_frame_median_s": round(behind[len(behind) // 2], 3),
            "record_behind_last_frame_max_s": round(behind[-1], 3),
            "load_average": os.getloadavg(),
        },
    )
    assert (lost_events, silent) == (0, 0)
    assert all(run["off_deg"] == 0.0 for run in runs)
    assert behind[-1] < BEHIND_MAX_S


def test_everything_killed_is_told_with_the_angle_and_a_killed_first_process_ends_in_order(
    tmp_path: Path,
) -> None:
    Users(tmp_path).add("operator", Role.OPERATOR, PASSWORD)
    with Service(tmp_path) as service:
        killed = run_and_kill(service, "move", random.Random(1))
    with Service(tmp_path) as service:
        directory = service.directory
        said = "SYS-05 the previous run of the controller was not shut down"
        # The recorder says it; the service is ready without it.
        until = time.monotonic() + WORD_S
        while said not in service.errors() and time.monotonic() < until:
            time.sleep(0.05)
        assert said in service.errors()
        recorder = service.child("recorder")
        with service.page("operator") as page:
            moving_and_orphaned(page, service.process.pid)
        until = time.monotonic() + WORD_S
        while Path(f"/proc/{recorder}").exists() and time.monotonic() < until:
            time.sleep(0.05)
    first, second = boots(directory)
    assert lost(directory, first, killed) == 0
    (row,) = told(directory, second)
    assert off_the_way_deg(killed, row["detail"]) == 0.0, (killed.seen, row)
    assert behind_s(killed, row["detail"]) < BEHIND_MAX_S
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
