"""The moment observer in the axis: it runs in every scan, and warns of a change beyond what a person expects."""

from __future__ import annotations

import pytest

from gantryctl.errors import ConfigError
from gantryctl.image import DriveFeedback, OutputImage
from gantryctl.machine import Machine, with_values
from gantryctl.program import Code
from gantryctl.units import rad
from gantryctl.wiring.compensation import compensation, compensation_settings
from gantryctl.wiring.engine import build_engine
from gantryctl.wiring.simulator import sim_drive
from parity.test_engine_parity import Rig, powered
from support.improved import improved_machine

AT = "control.compensation.moment_observer."


def observed(limit_nm: float) -> Machine:
    return with_values(improved_machine(), {AT + "active": True, AT + "limit_nm": limit_nm})


class Heavier:
    """A drive whose motor shows more torque than it has, at the gantry; NaN where it shows none."""

    def __init__(self, rig: Rig, more_nm: float) -> None:
        self._drive, self._more_nm = rig.engine.drive, more_nm / rig.machine.axis.ratio

    def read(self) -> DriveFeedback:
        feedback = self._drive.read()
        return feedback._replace(torque_act_nm=feedback.torque_act_nm + self._more_nm)

    def write(self, output: OutputImage) -> None:
        self._drive.write(output)


def moved(machine: Machine, more_nm: float, way_deg: float = 14.0) -> Rig:
    """Where the sine of the angle is nearly 1 more torque is more moment."""
    rig = powered(machine, 80.0)
    rig.engine.drive = Heavier(rig, more_nm)
    rig.command(move=True, target_rad=rad(80.0 + way_deg), speed_rad_s=rad(6.0))
    rig.engine.run_for(9.0)
    return rig


@pytest.mark.parametrize(("more_nm", "warned"), [(0.0, False), (30e3, True)])
def test_a_change_beyond_the_limit_is_a_warning_and_the_axis_goes_on(more_nm: float, *, warned: bool) -> None:
    rig = moved(observed(15e3), more_nm)
    axis = rig.program.axis
    assert axis.load_side is not None
    # One short move one way tells sine, cosine and friction apart only roughly: 5 kN m are seen of nothing.
    assert axis.load_side.moment_change_nm == pytest.approx(more_nm, abs=0.35 * more_nm + 6e3)
    assert set(axis.alarms.active) == ({Code.CTL_19} if warned else set())
    assert axis.virtual.following
    laws = axis.load_side.laws.state
    assert (laws["moment_sine_nm"] ** 2 + laws["moment_cosine_nm"] ** 2) ** 0.5 <= 15e3


def test_an_axis_that_starts_again_goes_on_with_what_it_has_learnt() -> None:
    """Power off and on keeps it; the next start of the controller begins with the calibration."""
    rig = moved(observed(15e3), 8e3)
    load_side = rig.program.axis.load_side
    assert load_side is not None
    before = load_side.laws.state["moment_sine_nm"]
    assert before > 3e3
    load_side.begin()
    assert load_side.laws.state["moment_sine_nm"] == before
    fresh = compensation(rig.machine)
    assert fresh is not None
    assert fresh.state["moment_sine_nm"] == 0.0


def test_a_drive_that_does_not_report_its_torque_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    drive = sim_drive(observed(15e3), 0.0)
    monkeypatch.setattr(type(drive), "reports_torque", False)
    with pytest.raises(ConfigError, match=r"6077 is not mapped"):
        build_engine(observed(15e3), drive=drive)


def test_without_the_observer_nothing_is_watched() -> None:
    machine = with_values(improved_machine(), {"control.compensation.moment_observer.active": False})
    rig = moved(machine, 30e3, way_deg=2.0)
    load_side = rig.program.axis.load_side
    assert load_side is not None
    assert load_side.moment_change_nm == 0.0
    assert Code.CTL_19 not in rig.program.axis.alarms.active
    settings = compensation_settings(machine)
    assert settings is not None
    assert settings.moment_limit_nm == float("inf")
