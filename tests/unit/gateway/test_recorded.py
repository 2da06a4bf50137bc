"""Curves of a recording over REST: every peak, angles in degrees, a part of the time, one question at a time."""

from __future__ import annotations

import asyncio
import json
import os
import sys
from pathlib import Path

import numpy as np
import pytest
from jsonschema import Draft202012Validator, validate

from gantryctl.errors import UsageError
from gantryctl.gateway import traces
from gantryctl.gateway.routes import openapi
from gantryctl.gateway.traces import Recorded
from gantryctl.service.clients.recorded import POINTS_MAX, columns_between
from gantryctl.trace.table import Trace

NAME = "service-000012-20261122T151537123.parquet"
ROWS, PEAK = 20_000, 12_345


@pytest.fixture
def recording(tmp_path: Path) -> Path:
    """20 s at 1 ms from 5 s on, with one peak of a scan and an unknown value."""
    time_s = 5.0 + 0.001 * np.arange(ROWS)
    torque_nm = np.zeros(ROWS)
    torque_nm[PEAK] = 300.0
    torque_nm[7] = np.nan
    path = tmp_path / NAME
    columns = {
        "time_s": time_s,
        "pos_act_rad": np.radians(time_s),
        "torque_act_nm": torque_nm,
        "motor_a": time_s,
    }
    Trace(columns, {"machine": "hust_gantry", "period_s": 0.001}).to_parquet(path)
    return path


def test_the_whole_recording_keeps_its_peak(recording: Path) -> None:
    found = columns_between(recording, NAME, 0, 10**9)
    schemas = openapi()["components"]
    wanted = {"$ref": "#/components/schemas/Columns", "components": schemas}
    validate(json.loads(json.dumps(found, allow_nan=False)), wanted, Draft202012Validator)
    angle, torque, _ = found["columns"]
    assert [(each["name"], each["unit"]) for each in found["columns"]] == [
        ("pos_act_deg", "deg"), ("torque_act_nm", "N m"), ("motor_a", "A"),
    ]  # fmt: skip
    assert (angle["x"][0], angle["y"][0], angle["y"][-1]) == (0.0, 5.0, 24.999)
    assert all(len(each["x"]) == len(each["y"]) <= POINTS_MAX for each in found["columns"])
    assert torque["x"][torque["y"].index(300.0)] == pytest.approx(0.001 * PEAK)
    assert found["end_s"] == 19.999
    # 2026-11-22T15:15:37.123Z, of its name.
    assert found["utc_s"] == 1795360537.123


def test_a_part_has_every_row_and_both_ends(recording: Path) -> None:
    torque = columns_between(recording, NAME, 5, 9)["columns"][1]
    assert torque["x"] == [0.005, 0.006, 0.007, 0.008, 0.009]
    assert torque["y"] == [0.0, 0.0, None, 0.0, 0.0]
    assert columns_between(recording, NAME, 20_000, 30_000)["columns"][1]["x"] == []


def test_what_is_no_recording_is_refused(tmp_path: Path) -> None:
    (tmp_path / "one.parquet").write_bytes(b"rows")
    with pytest.raises(UsageError, match="not a recording"):
        columns_between(tmp_path / "one.parquet", "one.parquet", 0, 1)


async def asked(path: Path) -> bytes | None:
    handle = os.open(path, os.O_RDONLY)
    try:
        return await Recorded().columns(handle, NAME, 0, 10**9)
    finally:
        os.close(handle)


def test_the_process_says_the_same_and_nothing_for_a_damaged_file(recording: Path) -> None:
    answer = asyncio.run(asked(recording))
    assert answer is not None
    assert json.loads(answer) == columns_between(recording, NAME, 0, 10**9)
    recording.write_bytes(recording.read_bytes()[:5000])
    assert asyncio.run(asked(recording)) is None


def test_one_that_takes_too_long_is_ended(recording: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    script = recording.with_name("slow.py")
    script.write_text("import os, time\nprint(os.getpid(), flush=True)\ntime.sleep(60)\n", encoding="utf-8")
    monkeypatch.setattr(sys, "path", [str(recording.parent), *sys.path])
    monkeypatch.setenv("PYTHONPATH", str(recording.parent))
    monkeypatch.setattr(traces, "_READER", "slow")
    monkeypatch.setattr(traces, "TIME_MAX_S", 0.2)
    assert asyncio.run(asked(recording)) is None
