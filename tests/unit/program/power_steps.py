"""What the tests of the power sequence share."""

from gantryctl.program import PowerPhase
from gantryctl.units import rad
from unit.program.rig import RATIO, Rig, settings

P = PowerPhase


def record(rig, seconds):
    """Phases in their order, with what each said to the drive in its last scan."""
    seen = []
    for _ in range(round(seconds / rig.period_s)):
        rig.step()
        phase = rig.axis.power.phase
        if not seen or seen[-1][0] is not phase:
            seen.append((phase, rig.output))
        seen[-1] = (phase, rig.output)
    return seen


def slip(rig, degrees):
    """The load slips by an angle at 5 deg/s, whatever the brake says."""
    steps = max(1, round(abs(degrees) / (5.0 * rig.period_s)))
    for _ in range(steps):
        rig.drive.pos_motor_rad += rad(degrees / steps) * RATIO
        rig.drive.vel_rad_s = rad(degrees / steps) * RATIO / rig.period_s
        rig.step()
        rig.drive.vel_rad_s = 0.0


def held_again():
    """A brake has slipped by 0.021 deg on the way down, and the torque of 12 N m has come back."""
    rig = Rig(config=settings(holding_torque_nm=12.0))
    rig.power_up()
    rig.op(power=False)
    rig.until(lambda: rig.axis.power.phase is P.UNLOADING)
    slip(rig, 0.021)
    rig.run(0.02)
    assert rig.axis.power.phase is P.TORQUE_HOLD
    return rig
