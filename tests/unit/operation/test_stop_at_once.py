"""A request to stop that comes from another thread, in the middle of a slice of scans."""

from __future__ import annotations

from gantryctl.machine import default_machine
from gantryctl.operation.client import Stop
from gantryctl.operation.run import AxisRun


def test_a_stop_in_the_middle_of_a_slice_is_in_the_next_scan() -> None:
    run = AxisRun(default_machine())
    scans: list[tuple[int, bool]] = []

    def done() -> bool:
        scans.append((run.engine.scan, run.operator.command.stop))
        if len(scans) == 37:  # of the 100 of a slice
            run.stop = Stop.RAMP
        return len(scans) == 60

    try:
        run.power_up()
        run.begin_move(10.0, 1.0)
        run._scans.until(done, 5.0)
    finally:
        run.close("test")
    levels = dict(scans)
    asked_in = scans[36][0]
    assert not any(levels[scan] for scan in levels if scan <= asked_in)
    assert all(levels[scan] for scan in levels if scan > asked_in)
