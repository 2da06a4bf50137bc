"""A rig for brake tests: it looks in every scan that the brake was not released."""

import math

from gantryctl.image import DriveRequest
from gantryctl.program import BrakeTestOutcome, BrakeTestPhase, PowerPhase
from unit.program.rig import Rig, settings

LEVEL_NM = 65.0
HOLDING_NM = 12.0
LONGEST_S = 12.0
PASSED, FAILED, ABORTED = BrakeTestOutcome.PASSED, BrakeTestOutcome.FAILED, BrakeTestOutcome.ABORTED
TORQUE_PHASES = [
    BrakeTestPhase.PLUS_RISING, BrakeTestPhase.PLUS_HELD, BrakeTestPhase.MINUS_RISING,
    BrakeTestPhase.MINUS_HELD, BrakeTestPhase.RELIEVING,
]  # fmt: skip
RUNNING = [BrakeTestPhase.ENABLING, *TORQUE_PHASES]


class TestRig(Rig):
    """A rig that keeps what was said to the drive, and checks in every scan that the brake was not released."""

    __test__ = False

    def __init__(self, **arguments):
        config = arguments.pop("config", None) or settings(
            test_torque_nm=LEVEL_NM, holding_torque_nm=HOLDING_NM
        )
        super().__init__(config=config, **arguments)
        self.torques = []

    def step(self):
        super().step()
        self.torques.append(self.output.torque_ff_nm)
        assert not self.output.brake_open, "the load is held by the brake at every instant"
        assert self.output.vel_cmd_rad_s == 0.0

    def begin(self):
        self.run(0.05)
        self.op(brake_test=True)
        self.op(brake_test=False)
        assert self.axis.brake_test.under_way

    def to(self, phase):
        self.until(lambda: self.axis.brake_test.phase is phase, LONGEST_S)

    def finish(self):
        self.until(lambda: not self.axis.brake_test.under_way, LONGEST_S)
        self.run(0.5)

    @property
    def result(self):
        return self.axis.brake_test.last

    def is_off(self):
        return (
            self.axis.power.phase is PowerPhase.OFF
            and self.output.request is DriveRequest.DISABLE
            and self.output.torque_ff_nm == 0.0
        )


def weak(rig, slips_at_nm):
    """The brake slips above a torque: the speed loop of the drive takes back what it does not bear."""

    def spoil(drive):
        given = drive.torque_act_nm - HOLDING_NM
        limit = math.copysign(min(abs(given), slips_at_nm), given)
        if abs(given) > slips_at_nm:
            rig.drive.pos_motor_rad += math.copysign(1e-4, given)
        return drive._replace(torque_act_nm=HOLDING_NM + limit if drive.torque_act_nm else 0.0)

    rig.spoil = spoil
