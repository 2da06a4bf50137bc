"""An axis on an ideal drive in virtual time, with a place to spoil what the drive reports."""

import math
from collections.abc import Callable
from dataclasses import replace

from gantryctl.drives.ideal import IdealDrive
from gantryctl.image import DriveFeedback, InputImage, OperatorCommand, OutputImage, SystemStop
from gantryctl.program import Axis, AxisProgram, GantryProgram, PowerPhase
from gantryctl.program.settings import (
    AxisSettings,
    LawSettings,
    MonitorSettings,
    PowerSettings,
    RampSettings,
    SpeedSettings,
    TravelSettings,
)
from gantryctl.units import deg, rad

RATIO = 1144.0
COUNTS_PER_TURN = 2048 * 2048
ZERO_COUNTS = 2048 * COUNTS_PER_TURN  # the encoder range centred on 0 deg
COUNTS_PER_DEG = COUNTS_PER_TURN * RATIO / 360.0


def settings(*, period_s=0.001, acc=4.0, dec=4.0, jerk=math.inf, monitors=None, **power) -> AxisSettings:
    """The reference machine with quick ramps (deg/s2), so that tests take little axis time."""
    return AxisSettings(
        period_s=period_s,
        travel=TravelSettings(rad(-180.0), rad(180.0), rad(-180.5), rad(180.5)),
        speed=SpeedSettings(rad(0.6), rad(6.0), rad(6.3), rad(6.6)),
        ramps=RampSettings(rad(acc), rad(dec), rad(jerk), rad(5.0), rad(100.0), rad(5.5)),
        law=LawSettings(10.0, 1.0, RATIO, COUNTS_PER_TURN, 4096),
        power=PowerSettings(torque_max_nm=385.0, torque_rated_nm=257.0, **power),
        monitors=replace(MonitorSettings(), **(monitors or {})),
    )


class Rig:
    """`run`, `until`, `op`: an engine of twenty lines. `spoil` changes a reading on its way to the program."""

    def __init__(self, program=GantryProgram, at_deg=0.0, config=None, **program_arguments):
        config = config or settings()
        self.period_s = config.period_s
        self.drive = IdealDrive(
            self.period_s, COUNTS_PER_TURN, RATIO, pos_rad=rad(at_deg), zero_counts=ZERO_COUNTS
        )
        self.axis = Axis(config, ZERO_COUNTS, keep_plans=True)
        self.program: AxisProgram = program(self.axis, **program_arguments)
        self.operator = OperatorCommand()
        self.spoil: Callable[[DriveFeedback], DriveFeedback] | None = None
        self.scan = 0
        self.missed: Callable[[int], int] = lambda scan: 0
        """Scans that are missed behind this one."""
        self.output = OutputImage()
        self.image: InputImage | None = None
        self.system_stop: SystemStop | None = None
        """What the engine would ask a stop for."""
        self.rows: list[tuple[float, ...]] = []
        self.keep_rows = False

    def step(self):
        feedback = self.drive.read()
        if self.spoil is not None:
            feedback = self.spoil(feedback)
        self.image = InputImage(
            self.scan, self.scan * self.period_s, feedback, self.operator, self.system_stop
        )
        self.output = self.program.scan(self.image)
        if self.keep_rows:
            self.rows.append(self.program.trace_row())
        for _ in range(1 + self.missed(self.scan)):  # the drive goes on with what it was told last
            self.drive.write(self.output)
            self.scan += 1

    def run(self, seconds):
        end = self.scan + math.ceil(seconds / self.period_s - 1e-9)
        while self.scan < end:
            self.step()

    def until(self, condition, timeout_s=60.0):
        end = self.scan + math.ceil(timeout_s / self.period_s)
        while self.scan < end:
            if condition():
                return
            self.step()
        raise AssertionError(f"not within {timeout_s} s; {self.axis.state!r}, {self.axis.power.phase!r}")

    def op(self, **levels):
        """Change the operator's levels and make one scan."""
        self.operator = self.operator._replace(**levels)
        self.step()

    def power_up(self):
        self.op(power=True)
        self.until(lambda: self.axis.power.phase is PowerPhase.ON, 5.0)
        self.run(0.3)  # in position, standstill monitor armed
        assert not self.codes

    def move(self, target_deg, speed_deg_s=6.0):
        """Give the move and let it go on."""
        self.op(move=True, target_rad=rad(target_deg), speed_rad_s=rad(speed_deg_s))
        self.op(move=False)

    def hold_key(self, seconds):
        """Let time pass while the hold-to-run lease is renewed every 30 ms."""
        for _ in range(math.ceil(seconds / 0.03)):
            self.operator = self.operator._replace(lease=self.operator.lease + 1)
            self.run(0.03)

    @property
    def pos_deg(self):
        return deg(self.axis.pos_act_rad)

    @property
    def ref_deg(self):
        return deg(self.axis.virtual.pos_ref_rad)

    @property
    def vel_deg_s(self):
        return deg(self.axis.virtual.vel_ref_rad_s)

    @property
    def codes(self):
        """Codes of the active alarms, first out first."""
        return [str(code) for code in self.axis.alarms.active]

    @property
    def first(self):
        return self.axis.alarms.first_out

    def refused(self):
        """Text of the last refusal, which must have come in this scan or before."""
        assert self.axis.refusal is not None
        return self.axis.refusal.text


def powered():
    """Power on, in position at 0 deg, no mode chosen."""
    rig = Rig()
    rig.power_up()
    return rig


def moving_rig(at_deg=0.0, speed_deg_s=6.0, **arguments):
    """A rig in the middle of a long move at constant speed."""
    rig = Rig(at_deg=at_deg, **arguments)
    rig.power_up()
    rig.move(at_deg + 100.0 if at_deg < 50.0 else at_deg - 100.0, speed_deg_s)
    rig.run(3.0)
    assert math.isclose(abs(rig.vel_deg_s), speed_deg_s, rel_tol=1e-12)
    return rig


def press(rig, **key):
    """A key together with a fresh lease, as every panel sends it."""
    rig.op(lease=rig.operator.lease + 1, **key)
