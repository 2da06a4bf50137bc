"""What a day at rest costs on the disk, power on: of the reference gantry, scanned every 1 ms and every 4 ms."""

from __future__ import annotations

from pathlib import Path
from typing import NamedTuple

import pytest

from gantryctl.machine import default_machine, with_values
from gantryctl.operation.run import AxisRun
from gantryctl.runtime.recorder import ArrowRecorder, MemoryRecorder
from gantryctl.service.memory.memory import SharedMemory
from gantryctl.service.memory.snapshot import publish_json
from gantryctl.service.memory.trace_ring import RingRecorder, rest_metadata
from gantryctl.service.recorder.trace_writer import REST_BLOCK_S, TraceWriter
from gantryctl.trace.table import Trace

DAY_S = 86400.0
SETTLED_S = 10.0
REST_S = 60.0
MB = 1e6
PLENTY = 10**12


class Size(NamedTuple):
    """Bytes of a day: of the live file, and of the closed one."""

    live: float
    closed: float


def at_rest(period_ms: float) -> tuple[Trace, dict[str, float]]:
    """The rows of an axis that holds its load, power on."""
    machine = with_values(default_machine(), {"control.scan_period_ms": period_ms})
    run = AxisRun(machine, recorder=MemoryRecorder)
    run.power_up()
    run.engine.run_for(SETTLED_S)
    begin_s = run.engine.time_s
    run.engine.run_for(REST_S)
    recorder = run.engine.recorder
    assert isinstance(recorder, MemoryRecorder)
    trace = recorder.trace().slice(begin_s, run.engine.time_s)
    run.close("measured")
    return trace, {"period_s": 1e-3 * period_ms, **rest_metadata(machine.motor.torque_rated_nm)}


def every_row(trace: Trace, metadata: dict[str, float], path: Path) -> Size:
    made = ArrowRecorder(path, trace.columns, metadata)
    for row in trace.rows():
        made.record(tuple(row))
    made.flush()
    live = made.live_path.stat().st_size
    made.close()
    return Size(live * DAY_S / REST_S, made.path.stat().st_size * DAY_S / REST_S)


def by_event(trace: Trace, metadata: dict[str, float], folder: Path, seconds: float) -> Size:
    """Bytes of the files as the service writes them, a block every ten seconds."""
    memory = SharedMemory.create()
    publish_json(memory.columns, {"columns": trace.columns, "metadata": metadata})
    ring = RingRecorder(memory.rows, trace.columns)
    writer = TraceWriter(memory, folder, lambda: PLENTY)
    ring.number = 1
    block = round(REST_BLOCK_S / metadata["period_s"])
    rows = trace.rows(0, round(seconds / metadata["period_s"]))
    for start in range(0, len(rows), block):
        for row in rows[start : start + block]:
            ring.record(tuple(row))
        writer.drain(at_once=True)
    (live,) = folder.iterdir()
    size = live.stat().st_size
    writer.end(last=True)
    (closed,) = folder.iterdir()
    memory.close()
    return Size(size, closed.stat().st_size)


@pytest.mark.parametrize(("period_ms", "before_gb"), [(1.0, 13.2), (4.0, 3.3)])
def test_a_day_at_rest_is_a_hundred_and_fifty_megabytes_and_not_thirteen_gigabytes(
    period_ms: float, before_gb: float, tmp_path: Path
) -> None:
    trace, metadata = at_rest(period_ms)
    before = every_row(trace, metadata, tmp_path / "all")
    # The seconds around the beginning and the end, with every scan, are in both.
    half, whole = (by_event(trace, metadata, tmp_path / f"{s:g}", s) for s in (REST_S / 2, REST_S))
    after = Size(*((b - a) * DAY_S / (REST_S / 2) for a, b in zip(half, whole, strict=True)))
    print(f"{period_ms:g} ms, MB a day: before {before.live / MB:.0f} live, {before.closed / MB:.0f} closed; "
          f"after {after.live / MB:.0f} live, {after.closed / MB:.0f} closed")  # fmt: skip
    assert before.live / MB == pytest.approx(1e3 * before_gb, rel=0.03)
    assert after.live < 160 * MB
    assert after.closed < before.closed
