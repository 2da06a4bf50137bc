"""Counters that run for months (fault F5): a move across the wrap of 32 bits is the same, bit for bit."""

from __future__ import annotations

import numpy as np
import pytest

from gantryctl.image import Mode, OperatorCommand
from gantryctl.machine import Machine, configs_folder, default_machine, load_machine, with_values
from gantryctl.operation.opening import open_axis
from gantryctl.runtime.recorder import MemoryRecorder
from gantryctl.trace.table import Trace
from gantryctl.units import rad
from gantryctl.wiring.engine import build_engine

SIM = with_values(default_machine(), {"control.scan_period_ms": 4.0, "virtual_axis.acc_deg_s2": 4.0})
BUS = with_values(load_machine(configs_folder() / "hust_can.toml"), {"virtual_axis.acc_deg_s2": 4.0})
RUN_S = 9.0
# The counter wraps in the middle of the move: scans as 32-bit numbers, signed and not; milliseconds of 4 ms scans.
WRAPS = {"scans, signed": 2**31, "scans": 2**32, "milliseconds": 2**32 // 4, "microseconds": 2**32 // 4000}


class ByScan:
    """Commands by the number of scans since the start: a time of 2^32 scans is a float of 4 ns steps."""

    def __init__(self, begin: int, commands: dict[int, OperatorCommand]) -> None:
        self._begin, self._commands = begin, commands

    def poll(self, time_s: float) -> OperatorCommand:
        since = round(time_s / 0.004) - self._begin
        return [command for at, command in self._commands.items() if at <= since][-1]


def recorded(machine: Machine, begin: int) -> Trace:
    """Power up and move 6 deg and back by hand, from scan `begin` on."""
    opened = open_axis(machine, None)
    on = OperatorCommand(power=True, speed_rad_s=rad(3.0))
    move = on._replace(mode=Mode.INCREMENTAL, increment_rad=rad(6.0))
    up = move._replace(forward=True)
    engine = build_engine(
        machine,
        opened.drive,
        opened.program,
        ByScan(begin, {0: on, 750: move, 775: up, 1625: on, 1800: OperatorCommand()}),
        recorder=MemoryRecorder,
    )
    engine.scan = begin
    engine.run_for(RUN_S)
    trace = engine.recorder.trace()
    engine.close()
    return trace


# Over the bus a second of a processor each: one of them is in the fast set.
@pytest.mark.parametrize(
    ("what", "machine"),
    [pytest.param(what, SIM, id=f"{what}-sim") for what in WRAPS]
    + [
        pytest.param(
            what,
            BUS,
            id=f"{what}-bus",
            marks=[pytest.mark.can] + [pytest.mark.slow] * (what != "microseconds"),
        )
        for what in WRAPS
    ],
)
def test_a_move_across_the_wrap_is_the_same_bit_for_bit(machine: Machine, what: str) -> None:
    middle = WRAPS[what] - int(4.2 / 0.004)  # 4.2 s after the start it moves
    early, late = recorded(machine, 0), recorded(machine, middle)
    assert np.degrees(np.ptp(late["pos_act_rad"])) > 5.0
    for column in early.columns:
        if column != "time_s":
            assert np.array_equal(early[column], late[column], equal_nan=True), column
    # Time is the scan number times the period, never a sum: exact to the last digit of a float of 5e5 s.
    assert late["time_s"][-1] - late["time_s"][0] == pytest.approx(early["time_s"][-1], abs=1e-8)
