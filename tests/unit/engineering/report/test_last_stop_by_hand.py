"""Why the axis stopped, from the memory and a recording, by hand: which alarm, what came before, what followed."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest

from gantryctl.engineering.report.last_stop import last_stop, moment_of, sentences
from gantryctl.image import DriveState
from gantryctl.machine import default_machine
from gantryctl.runtime import AlarmEntry
from gantryctl.trace.table import Trace

TODAY, YESTERDAY = "2026-11-28T10:00:00+00:00", "2026-11-27T10:00:00+00:00"


def entry(code: str, time_s: float, at: str = TODAY, severity: str = "STOP", follows: str = "") -> AlarmEntry:
    return AlarmEntry(
        code, f"{code} at {time_s:g}", at, time_s, math.radians(40.0), 0.1, 5.0, severity, follows
    )


def test_the_newest_stop_is_told_with_its_own_run_and_what_followed_from_it() -> None:
    first = entry("CTL-03", 7.0)
    before, followed = entry("DRV-10", 6.0, severity="WARNING"), entry("BRK-06", 7.5, follows="CTL-03")
    oldest_first = [
        entry("CTL-03", 6.5, YESTERDAY), entry("BRK-06", 6.9, YESTERDAY, follows="CTL-03"),
        entry("DRV-10", 5.0, YESTERDAY, severity="WARNING"),
        before, first, followed, entry("CTL-22", 9.0, severity="WARNING"),
    ]  # fmt: skip
    found = last_stop(oldest_first[::-1], ["CTL-03"])
    assert found is not None
    assert (found.first, found.before, found.followed, found.holds) == (first, (before,), (followed,), True)
    assert last_stop([before], []) is None


def recording(folder: Path, turns: float = 0.0) -> None:
    """Scans of 10 ms: 2 deg/s to minus, an alarm at 1.00 s, a swing through 0 at 1.10 s, rest at 1.20 s."""
    time_s = 0.01 * np.arange(200)
    vel = np.where(time_s < 0.995, -2.0, 0.0)
    vel[100:110], vel[111:120] = -1.0, 0.5
    pos = 10.0 + np.concatenate([[0.0], np.cumsum(vel[:-1]) * 0.01]) - 360.0 * turns * (time_s > 1.045)
    error = np.where(time_s < 0.985, 0.01, np.where(time_s < 0.995, 0.3, 0.0))
    state = np.where(time_s < 1.045, DriveState.OPERATION_ENABLED, DriveState.SWITCH_ON_DISABLED)
    columns = {
        "time_s": time_s, "vel_act_rad_s": np.radians(vel), "pos_act_rad": np.radians(pos),
        "pos_err_rad": np.radians(error), "torque_act_nm": np.where(time_s < 1.005, -12.0, 0.0),
        "drive_state": state.astype(float), "alarm_count": (time_s >= 0.995).astype(float),
    }  # fmt: skip
    Trace(columns, {"period_s": 0.01}).to_parquet(folder / "hust_gantry-000001-20261128T095958000.parquet")


def test_a_recording_tells_speed_error_way_and_rest_of_a_stop(tmp_path: Path) -> None:
    recording(tmp_path)
    machine = default_machine()
    moment = moment_of(machine, entry("CTL-03", 1.0), tmp_path)
    assert moment is not None
    # The error that tripped is that of the scan before: in the scan of the alarm the set-point follows the angle.
    assert (moment.speed_deg_s, moment.torque_nm, moment.error_deg) == pytest.approx((-1.0, -12.0, 0.3))
    # 10 scans with -1 deg/s and 9 with 0.5 deg/s of 10 ms.
    assert moment.way_deg == pytest.approx(-0.1 + 0.045)
    assert moment.rest_s == pytest.approx(0.2)
    assert [(change.time_s, change.state) for change in moment.drive] == [
        (pytest.approx(1.0), DriveState.OPERATION_ENABLED),
        (pytest.approx(1.05), DriveState.SWITCH_ON_DISABLED),
    ]
    stop = last_stop([entry("CTL-03", 1.0)], [])
    assert stop is not None
    told = "\n".join(sentences(machine, stop, moment))
    assert "It stood 0.20 s later, -0.055 deg from there." in told
    assert "50 ms later switch on disabled" in told
    assert "turning at -1.000 deg/s, the set-point +0.3000 deg ahead of it, with -12.0 N m" in told


@pytest.mark.parametrize("turns", [1.0, -3.0])
def test_a_zero_that_moves_on_within_a_stop_is_no_way(tmp_path: Path, turns: float) -> None:
    """An axis without ends whose set-point lets go of it far from its zero."""
    recording(tmp_path, turns)
    moment = moment_of(default_machine(), entry("CTL-03", 1.0), tmp_path)
    assert moment is not None
    assert moment.way_deg == pytest.approx(-0.1 + 0.045)
    assert moment.rest_s == pytest.approx(0.2)


def test_a_recording_in_which_the_alarm_did_not_come_is_of_another_run(tmp_path: Path) -> None:
    recording(tmp_path)
    assert moment_of(default_machine(), entry("CTL-03", 1.5), tmp_path) is None
    assert moment_of(default_machine(), entry("CTL-03", 1.0, YESTERDAY), tmp_path) is None
