"""Spoiled feedback, and what an alarm that stops the axis must look like."""

import math

from gantryctl.image import DriveRequest
from gantryctl.program import AxisState, Reaction
from unit.program.rig import COUNTS_PER_DEG

STOP_REQUEST = {
    Reaction.QUICK_STOP: DriveRequest.QUICK_STOP,
    Reaction.TORQUE_OFF: DriveRequest.DISABLE,
}


# Position and speed come from one encoder: spoiling one of them alone is a fault of its own (ENC-12), which the tests
# of other monitors leave out.
POSITION_ALONE = {"encoder_drift_max_rad": math.inf}


def counts(degrees):
    return round(degrees * COUNTS_PER_DEG)


def after(scans, change):
    """Spoil the reading from the given number of scans on."""
    state = {"scan": 0}

    def spoil(drive):
        state["scan"] += 1
        return change(drive) if state["scan"] > scans else drive

    return spoil


def expect(rig, code, reaction, within_s, *words):
    """The first-out alarm, its reaction in the same scan, its words, and that the axis ends in ErrorStop."""
    rig.until(lambda: rig.first is not None, within_s + 1.5 * rig.period_s)
    assert str(rig.first.code) == code
    assert rig.first.reaction is reaction
    assert rig.output.request is STOP_REQUEST[reaction]
    assert rig.output.vel_cmd_rad_s == 0.0
    assert rig.output.brake_open == (reaction is Reaction.QUICK_STOP)
    rig.step()
    assert rig.axis.state is AxisState.ERROR_STOP
    for word in words:
        assert word in rig.first.text, rig.first.text
