"""Two faults close together: telegrams stop, and an encoder or a drive is spoilt within the stop that nobody sees."""

import numpy as np
import pytest

from gantryctl.engineering.fault_campaign.play import play
from gantryctl.engineering.fault_campaign.scenario import Action, PlannedFault, Scenario


@pytest.mark.parametrize(
    ("scan_ms", "owner", "spoilt", "most_deg"),
    [
        # 2 deg/s for 0.25 s (the brake is told after 0.1 s and takes 0.15 s), all torque meanwhile (9 deg/s2 from 30 ms
        # on) and the brake from 4 deg/s (9 deg/s2): 0.5 + 0.2 + 0.9 deg. Trusted to the end of its ramp it goes 3.2.
        (4.0, "object_60FE", "A2", 1.6),
        # The torque goes after 0.1 s, and the brake has the axis 0.15 s later, from 2.7 deg/s: 0.25 + 0.4 + 0.4 deg.
        # Trusted to the end it goes 5.8.
        (4.0, "drive", "A15b", 1.1),
        (10.0, "drive", "A15b", 1.1),
    ],
)
def test_a_ramp_that_nobody_sees_is_ended_by_the_brake(scan_ms, owner, spoilt, most_deg):
    at_s = 4.0
    scene = Scenario(
        drive="bus",
        brake_owner=owner,
        scan_ms=scan_ms,
        ramp_deg_s2=2.0,
        actions=(
            Action(at_s=0.2, do="power"),
            Action(at_s=2.4, do="move", target_deg=60.0, speed_deg_s=2.0),
        ),
        faults=(PlannedFault(number="E1", at_s=at_s), PlannedFault(number=spoilt, at_s=at_s + 0.02)),
        duration_s=at_s + 1.5,
    )
    played = play(scene, record=True)
    assert played.violations == ()
    begin = int(np.searchsorted(played.log["time_s"], at_s))
    angle = played.log["pos_deg"][begin:]
    assert 0.3 < np.max(np.abs(angle - angle[0])) < most_deg
    assert played.stops == ("CAN-03",)
