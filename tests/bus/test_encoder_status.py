"""Status of the encoder from the drive's own object, mapped beside the position."""

from __future__ import annotations

import pytest

from bus.bus_rig import FEEDBACK_DEG, BusRig, bus_machine, few_at_1_ms
from gantryctl.image import EncoderFlag
from gantryctl.program import AxisState

pytestmark = pytest.mark.can

ROWS = [
    (speed, owner, scan_ms)
    for speed in (6.0, -3.0, 1.0)
    for owner, scan_ms in (("drive", 1.0), ("object_60FE", 4.0), ("drive", 10.0))
]


@pytest.mark.parametrize(("speed", "owner", "scan_ms"), few_at_1_ms(ROWS))
def test_an_alarm_of_the_encoder_takes_the_torque_off(speed: float, owner: str, scan_ms: float) -> None:
    rig = BusRig(bus_machine(owner, scan_ms)).power_up().cruise(speed)
    begun = len(rig.ticks)
    rig.inject("encoder", "flags", bits=int(EncoderFlag.ALARM))
    rig.run(3.0)
    assert rig.stops[0] == "ENC-05"
    assert rig.way_deg(begun - 1) < FEEDBACK_DEG[abs(speed)]
    assert not rig.axis.feedback.position_valid
    assert not rig.ticks[-1].brake_open
    assert not rig.enabled_again(begun)
    rig.engine.close()


def test_a_warning_goes_on() -> None:
    rig = BusRig(bus_machine()).power_up().cruise(3.0)
    rig.inject("encoder", "flags", bits=int(EncoderFlag.WARNING))
    rig.run(0.5)
    assert rig.codes == ["ENC-06"]
    assert rig.axis.state is AxisState.DISCRETE_MOTION
    rig.command(power=False, move=False)
    rig.until(lambda: rig.axis.is_off, 10.0)
    rig.engine.close()
