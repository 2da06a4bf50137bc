"""Frequency response of a simulated axis in the compiled loop: the bits of `Probe`, without Python in the scan."""

from __future__ import annotations

from typing import Final

import numpy as np

from gantryctl import _core
from gantryctl.drives.simulated import SimDrive
from gantryctl.engineering.analysis.measured.excitation import Excitation
from gantryctl.engineering.analysis.measured.probe import (
    CALM_S,
    RECORD_COLUMNS,
    Probe,
    ProbeLimits,
    Record,
    plan_turning,
    stopped,
)
from gantryctl.engineering.analysis.models.sampled import Input
from gantryctl.engineering.batch import ClosedLoop, Leg, Runner
from gantryctl.errors import UsageError
from gantryctl.motion import SetPoint, hold

_COLUMNS: Final = ("vel_cmd_rad_s", "vel_report_rad_s", "torque_act_nm", "pos_err_rad", "pos_act_rad")


class CompiledProbe:
    """A simulated axis under power to whose speed command a signal is added.

    Torque and travel are judged after each run, not within it: a simulated axis breaks nothing meanwhile.

    Args:
        drive: with its gantry; torque off at the beginning.
        law: of the controller; its zero is the angle at which the axis stands now, `angle_rad`.
        run: takes the plant through its legs.

    Raises:
        AlarmStop: the drive does not come up within 5 s.
    """

    def __init__(
        self, drive: SimDrive, law: _core.PositionLaw, limits: ProbeLimits, angle_rad: float, run: Runner
    ) -> None:
        self.scan_s = drive.sim.scan_period_s
        probe = Probe(drive, law, self.scan_s, limits, angle_rad)
        # States of the drive and its brake are scanned one by one; then the plant runs without them.
        probe.switch_on()
        self._plan, self._scan = hold(probe.angle_rad), 0
        # The drive counts within the range of its encoder, the plant from its own zero.
        drive.sim.count_offset -= drive.sim.feedback(law.rad_per_count)[0] - drive.read().pos_act_counts
        self._loop = ClosedLoop(drive.sim, law, probe.zero_counts)
        self._limits, self._run = limits, run
        self.run(None, round(CALM_S / self.scan_s))

    @property
    def torque_limit_nm(self) -> float:
        """Motor torque that stops a measurement."""
        return self._limits.torque_nm

    @property
    def step_rad(self) -> float:
        """One step of the motor encoder."""
        return self._loop.law.rad_per_count

    def turn(self, vel_rad_s: float) -> None:
        """Turn at a constant speed, or come to rest, until the axis is calm."""
        start = SetPoint(*self._plan.sample(self._scan * self.scan_s))
        self._plan, self._scan = plan_turning(start, vel_rad_s, self._limits.motion), 0
        self.run(None, round((self._plan.duration + CALM_S) / self.scan_s))

    def run(self, excitation: Excitation | None, scans: int) -> Record:
        """Run so many scans with the signal added to the speed command, from the start of its period.

        Raises:
            AlarmStop: torque or travel beyond the limits. UsageError: a signal that is a torque.
        """
        if excitation is not None and excitation.where is not Input.SPEED:
            raise UsageError("the compiled loop adds signals to the speed command, not to the torque")
        signal = np.zeros(1) if excitation is None else excitation.period(self.scan_s)
        added = () if excitation is None else signal.tolist()
        leg = Leg(self._plan, scans * self.scan_s, passed_scans=self._scan, added_rad_s=added)
        log = self._run(self._loop, [leg], _COLUMNS)
        self._scan += scans
        self._check(log["torque_act_nm"], log["pos_act_rad"])
        wanted = log["vel_cmd_rad_s"]
        values = (
            wanted + np.resize(signal, scans),
            wanted,
            log["vel_report_rad_s"],
            log["torque_act_nm"],
            self._loop.law.ratio * log["pos_err_rad"],
        )
        return dict(zip(RECORD_COLUMNS, values, strict=True))

    def _check(self, torque_nm: np.ndarray, angle_rad: np.ndarray) -> None:
        limits = self._limits
        inside = (
            (np.abs(torque_nm) <= limits.torque_nm)
            & (limits.pos_min_rad <= angle_rad)
            & (angle_rad <= limits.pos_max_rad)
        )
        if not inside.all():
            first = int(np.argmin(inside))
            raise stopped(limits.violation(float(torque_nm[first]), float(angle_rad[first])))
