"""CTL-22 over the bus of a virtual drive, with an encoder node on the ring: by 6064, 6077 and what the node sends."""

from __future__ import annotations

from functools import cache

import pytest

from gantryctl.machine import Machine, configs_folder, load_machine, with_values
from gantryctl.operation.run import AxisRun
from gantryctl.program.alarms.codes import Code
from support.improved import improved_machine

pytestmark = pytest.mark.can


@cache
def known() -> Machine:
    """The gantry on a bus under the improved control, with what was identified on the same plant."""
    bare, improved = load_machine(configs_folder() / "hust_can.toml"), improved_machine()
    laws = ("torque.eccentric", "torque.acceleration", "gear_map.active", "windup.active", "windup.reversal")
    ring = ("load_encoder.active", "load_encoder.own_errors", "damping.active")
    machine = with_values(
        bare,
        {
            f"virtual_axis.{key}": getattr(improved.virtual_axis, key)
            for key in ("profile", "acc_deg_s2", "dec_deg_s2")
        }
        | {"virtual_axis.jerk_deg_s3": improved.virtual_axis.jerk_deg_s3}
        | {f"control.compensation.{key}": True for key in (*laws, *ring)}
        | {
            "control.compensation.latency_us": 62.5,
            "control.compensation.calibration": "a.toml",
            "can.load_encoder.source": "node",
            "can.load_encoder.node": 4,
        },
    )
    calibration = improved.calibration
    assert calibration is not None
    # Of the virtual drive, from 1018.
    origin = calibration.origin.model_copy(
        update={"machine": "hust_can", "encoder_serial": "CAN-000007FF-00470402-1"}
    )
    return machine.calibrated(calibration.model_copy(update={"origin": origin}))


def warnings(machine: Machine, targets_deg: tuple[float, ...]) -> dict[str, str]:
    """Alarms that stand after these moves, with their texts."""
    run = AxisRun(machine, None)
    run.power_up()
    for target in targets_deg:
        run.move(target)
        run.engine.run_for(2.0)
    alarms = {alarm.code: alarm.text for alarm in run.axis.alarms.active.values()}
    run.power_down()
    run.close("done")
    return alarms


@pytest.mark.slow  # 50 s of a quiet processor
def test_another_moment_is_named_and_a_sound_machine_is_not() -> None:
    """36 instead of 16 kN m; moves over half of the travel, both ways."""
    moves = (60.0, -60.0) * 4  # nothing is judged before two minutes of motion
    assert warnings(known(), moves) == {}
    # The same change as in configs/drifts/hust.toml.
    heavier = with_values(known(), {"plant.load.eccentricity_m": 0.00815 + 0.0101875})
    found = warnings(heavier, moves)
    assert set(found) == {Code.CTL_22}
    assert "moment" in found[Code.CTL_22]
