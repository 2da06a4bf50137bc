"""Runs of an axis whose ramps take longer than those of the reference gantry."""

from __future__ import annotations

import pytest

from gantryctl.errors import AlarmStop
from gantryctl.image import InputImage
from gantryctl.machine import Machine, default_machine, with_values
from gantryctl.operation.client import Stop
from gantryctl.operation.run import AxisRun
from gantryctl.program import GantryProgram
from gantryctl.units import deg

# From 0.5 deg/s a stop takes 132 s, a quick stop 14 s.
SLOW = {
    "drive.kind": "ideal",
    "control.scan_period_ms": 40.0,
    "speed.setting_min_deg_s": 0.05,
    "speed.setting_max_deg_s": 0.5,
    "speed.creep_deg_s": 0.05,
    "virtual_axis.acc_deg_s2": 0.03,
    "virtual_axis.dec_deg_s2": 0.0038,
    "virtual_axis.jog_release_dec_deg_s2": 0.0038,
    "virtual_axis.quick_dec_deg_s2": 0.035,
    "monitors.velocity_deviation_deg_s": 0.3,
}


def slow() -> Machine:
    return with_values(default_machine(), SLOW)


def speed_deg_s(run: AxisRun) -> float:
    return deg(run.drive.read().vel_act_rad_s / run.machine.axis.ratio)


def test_a_stop_that_takes_minutes_is_waited_for() -> None:
    """0.5 deg/s on 0.0038 deg/s2: 132 s, and no experiment ends while the axis moves."""
    run = AxisRun(slow())
    run.power_up()
    run.begin_move(150.0, 0.5)
    run.follow(20.0)
    assert speed_deg_s(run) == pytest.approx(0.5, abs=0.01)
    run.stop = Stop.RAMP
    with pytest.raises(AlarmStop, match="in the middle of an experiment"):
        run.follow(1.0)
    assert run.axis.at_rest
    assert run.engine.time_s == pytest.approx(20.0 + 131.6, abs=3.0)
    run.stop = Stop.NO
    run.close("stopped")


class Fails(GantryProgram):
    """Fails half a minute after the start, in motion."""

    def logic(self, image: InputImage) -> None:
        super().logic(image)
        if image.time_s > 30.0:
            raise ValueError("a test")


def test_a_quick_stop_of_a_failed_program_that_takes_long_is_waited_for(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """0.5 deg/s on 0.035 deg/s2: 14 s until the drive stands."""
    run, speeds = AxisRun(slow(), program=Fails), []
    with pytest.raises(AlarmStop, match="SYS-09") as stopped:
        run.move(100.0, 0.5)
    close = run.engine.close

    def watched() -> None:
        speeds.append(speed_deg_s(run))
        close()

    monkeypatch.setattr(run.engine, "close", watched)
    run.close("stopped", stopped.value)
    assert speeds == [0.0]
