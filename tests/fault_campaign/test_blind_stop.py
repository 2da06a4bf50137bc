"""Two faults close together: telegrams stop, and an encoder or a drive is spoilt within the stop that nobody sees."""

import numpy as np
import pytest

from gantryctl.engineering.fault_campaign.play import play
from gantryctl.engineering.fault_campaign.scenario import Action, PlannedFault, Scenario

pytestmark = [pytest.mark.can, pytest.mark.slow]


@pytest.mark.parametrize(
    ("owner", "speed", "spoilt", "most_deg"),
    [
        # 0.04 s until the stop, and 0.106 s until a speed that grows by 9 deg/s2 shows that; the torque is off 20 ms
        # later, and the brake has the axis 0.15 s behind that (3.3 deg/s, 9 deg/s2): 0.1 + 0.3 + 0.5 + 0.6 deg. Trusted
        # to the end of its ramp it goes 5.9 deg.
        ("drive", 2.0, "A15b", 1.5),
        ("object_60FE", 2.0, "A15b", 1.5),
        # The same from 3.5 deg/s: 0.2 + 0.5 + 0.7 + 1.3 deg for 12.8.
        ("drive", 3.5, "A15b", 2.7),
        # A reading that stands at once is no ramp: told, or 0.1 s behind the last speed, by the brake.
        ("object_60FE", 2.0, "A2", 1.7),
        # The torque goes after 0.1 s, at 6 deg/s; the brake has the axis 0.15 s later: 0.5 + 0.9 + 2.0 deg.
        ("drive", 5.0, "A15b", 3.4),
        # A ramp alone keeps the class of a quick stop at every speed: 0.06 s, v^2 / 11 and 2 %.
        ("drive", 1.0, None, 0.155),
        ("drive", 2.0, None, 0.49),
        ("drive", 4.0, None, 1.73),
        ("drive", 6.0, None, 3.71),
        ("object_60FE", 1.0, None, 0.155),
        ("object_60FE", 2.0, None, 0.49),
        ("object_60FE", 6.0, None, 3.71),
    ],
)
@pytest.mark.parametrize("scan_ms", [4.0, 10.0])
def test_a_ramp_that_nobody_sees_is_ended_by_the_brake(scan_ms, owner, speed, spoilt, most_deg):
    at_s = 2.4 + speed / 2.0 + 1.2
    scene = Scenario(
        drive="bus",
        brake_owner=owner,
        scan_ms=scan_ms,
        ramp_deg_s2=2.0,
        actions=(
            Action(at_s=0.2, do="power"),
            Action(at_s=2.4, do="move", target_deg=60.0, speed_deg_s=speed),
        ),
        faults=(
            PlannedFault(number="E1", at_s=at_s),
            *([PlannedFault(number=spoilt, at_s=at_s + 0.02)] if spoilt else []),
        ),
        duration_s=at_s + 2.2,
    )
    played = play(scene, record=True)
    assert played.violations == ()
    begin = int(np.searchsorted(played.log["time_s"], at_s))
    angle = played.log["pos_deg"][begin:]
    assert 0.1 < np.max(np.abs(angle - angle[0])) < most_deg
    assert played.stops == ("CAN-03",)
