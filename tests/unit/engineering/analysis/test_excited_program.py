"""The shipped program with a signal on its output: clamped both ways, and ended by torque of either sign."""

from __future__ import annotations

import math
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest

from gantryctl.engineering.analysis.measured.excitation import Excitation
from gantryctl.engineering.analysis.measured.on_engine import ExcitedProgram
from gantryctl.engineering.analysis.models.sampled import Input
from gantryctl.program import AxisState
from gantryctl.program.alarms.codes import Code
from unit.program.rig import Rig

# A clamp of 6.3 deg/s behind 1144: 6.3 x pi / 180 x 1144.
CLAMP_RAD_S = 125.789
LIMIT_NM = 50.0


def excited(value: float, where: Input = Input.SPEED) -> Any:
    """An axis under power to whose output a signal of one value is added from now on."""
    rig = Rig(ExcitedProgram)
    rig.power_up()
    program = cast(ExcitedProgram, rig.program)
    signal = SimpleNamespace(where=where, period=lambda _scan_s: np.array([value]))
    program.excite(cast(Excitation, signal), rig.period_s, LIMIT_NM)
    return rig


@pytest.mark.parametrize(
    ("value", "told"), [(3.0, 3.0), (-3.0, -3.0), (500.0, CLAMP_RAD_S), (-500.0, -CLAMP_RAD_S)]
)
def test_command_and_signal_together_keep_the_clamp_both_ways(value: float, told: float) -> None:
    rig = excited(value)
    rig.step()
    # The axis stands: its own command is below a thousandth of the clamp.
    assert rig.output.vel_cmd_rad_s == pytest.approx(told, abs=0.1)


@pytest.mark.parametrize(
    ("where", "steps"), [(Input.SPEED, [3.0, 3.0, 3.0, 0.0]), (Input.TORQUE, [0.0, 0.0, 0.0, 0.0])]
)
def test_a_step_is_the_signal_s_from_its_begin_to_its_end(where: Input, steps: list[float]) -> None:
    rig = excited(3.0, where)
    told = [rig.program.signal_step_rad_s]
    for _ in range(2):
        rig.step()
        told.append(rig.program.signal_step_rad_s)
    rig.program.end_signal()
    for _ in range(2):
        rig.step()
        told.append(rig.program.signal_step_rad_s)
    assert told == [0.0, *steps]


def test_a_signal_that_follows_another_steps_from_its_value() -> None:
    rig = excited(3.0)
    rig.step()
    signal = SimpleNamespace(where=Input.SPEED, period=lambda _scan_s: np.array([-2.0]))
    rig.program.excite(cast(Excitation, signal), rig.period_s, LIMIT_NM)
    rig.step()
    assert rig.program.signal_step_rad_s == 5.0


@pytest.mark.parametrize("torque_nm", [50.1, -50.1, math.nan])
@pytest.mark.parametrize("where", [Input.SPEED, Input.TORQUE])
def test_torque_of_either_sign_ends_the_signal(torque_nm: float, where: Input) -> None:
    rig = excited(3.0, where)
    rig.spoil = lambda seen: seen._replace(torque_act_nm=math.copysign(49.9, torque_nm))
    rig.step()
    assert 3.0 in (
        pytest.approx(rig.output.vel_cmd_rad_s, abs=0.1),
        pytest.approx(rig.output.torque_ff_nm),
    )
    rig.spoil = lambda seen: seen._replace(torque_act_nm=torque_nm)
    rig.step()
    rig.spoil = None
    rig.step()
    # And it does not come back once the torque has gone.
    assert (rig.output.vel_cmd_rad_s, rig.output.torque_ff_nm) == pytest.approx((0.0, 0.0), abs=0.1)
    assert rig.axis.state is AxisState.ERROR_STOP
    # Nobody has pressed Quick stop: the torque and its limit are told.
    assert "INT-06" not in rig.codes
    said = rig.axis.alarms.active[Code.CTL_23].measured
    assert said == f"Torque {torque_nm:.3g} N m under a test signal, permitted +-50 N m"
