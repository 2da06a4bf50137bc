"""A brake that drags: the motor needs more torque than load and friction have needed so far (fault catalogue C2)."""

from __future__ import annotations

from typing import Final

from gantryctl.program.alarms.codes import Code, Reaction
from gantryctl.program.alarms.log import AlarmLog
from gantryctl.program.feedback import Feedback
from gantryctl.program.monitors.torque_model import TorqueModel
from gantryctl.program.power.holding_torque import HoldingTorque
from gantryctl.program.settings import AxisSettings
from gantryctl.program.virtual_axis import VirtualAxis

_SAMPLE_S: Final = 0.050
# One period of the load's swing, in which it comes to nothing.
_MEAN_S: Final = 0.5
_LASTS_S: Final = 1.0
# Parts of the rated torque.
_WARNING_SHARE: Final = 0.15
_HALT_SHARE: Final = 0.30
# A motor that starts slowly turns its closed brake without a step of the torque, which `TorqueWatch` needs: then half
# of the brake's torque, as there, in the mean. A load that swings is not above it for half of its period.
_GRIPS_SHARE: Final = 0.5
_GRIPS_PERIODS: Final = 0.5


class DragWatch:
    """Learns what a motion needs and judges what it needs beyond that, in the direction of motion.

    Until it has learned, all that any motion may need counts as load: the torque the brake is tested with, or where
    friction is above that what the machine file gives; and what an acceleration needs of the largest inertia with which
    the quick stop is possible, J <= T_max / (i a_quick). What a wind may add is never taken for a brake.

    Attributes:
        model: what has been learned; its weights are retained memory.
    """

    __slots__ = (
        "_alarms", "_feedback", "_grip_nm", "_grips", "_halt_nm", "_holding", "_known", "_lasts", "_load_nm",
        "_mean_nm", "_mean_share", "_over", "_over_grip", "_over_halt", "_per_acc", "_rated_nm", "_sample_scans",
        "_virtual", "_wait", "_warning_nm", "_wind_nm", "model",
    )  # fmt: skip

    def __init__(
        self,
        settings: AxisSettings,
        feedback: Feedback,
        virtual: VirtualAxis,
        holding: HoldingTorque,
        alarms: AlarmLog,
    ) -> None:
        power = settings.power
        self._feedback, self._virtual, self._holding, self._alarms = feedback, virtual, holding, alarms
        self._known = power.torque_preload
        self._sample_scans = settings.scans(_SAMPLE_S)
        sample_s = self._sample_scans * settings.period_s
        self._mean_share = min(1.0, sample_s / _MEAN_S)
        self._lasts = round(_LASTS_S / sample_s)
        self._rated_nm = power.torque_rated_nm
        self._warning_nm, self._halt_nm = _WARNING_SHARE * self._rated_nm, _HALT_SHARE * self._rated_nm
        self._grip_nm = _GRIPS_SHARE * power.brake_torque_nm
        self._grips = round(_GRIPS_PERIODS * settings.monitors.swing_s / sample_s)
        self._load_nm = max(power.test_torque_nm, power.running_torque_nm)
        self._per_acc = power.torque_max_nm / settings.ramps.quick_dec_rad_s2
        self._wind_nm = power.wind_torque_nm
        self.model = TorqueModel(
            settings.law.ratio, power.torque_rated_nm, in_wind=power.wind_torque_nm > 0.0
        )
        self.begin()

    def begin(self) -> None:
        """Forget the motion before; what was learned stays."""
        self._mean_nm = 0.0
        self._wait = self._over = self._over_halt = self._over_grip = 0

    def scan(self, pos_rad: float) -> None:
        """Take a scan in which the set-point moves; every 50 ms is judged."""
        self._wait += self._feedback.periods
        if self._wait >= self._sample_scans:
            self._wait = 0
            if self._known and self._holding.believed:
                self._judge(pos_rad)

    def _judge(self, pos_rad: float) -> None:
        virtual, model, torque_nm = self._virtual, self.model, self._feedback.torque_nm
        vel, acc = virtual.vel_ref_rad_s, virtual.acc_ref_rad_s2
        sign = 1.0 if vel > 0.0 else -1.0
        if model.learned:
            excess = sign * (torque_nm - model.expected_nm(pos_rad, vel, acc)) - self._wind_nm
        else:
            excess = sign * torque_nm - self._load_nm - self._per_acc * max(0.0, sign * acc)
        self._mean_nm += (excess - self._mean_nm) * self._mean_share
        # What drags is not learned.
        if not self._mean_nm > 0.5 * self._warning_nm:
            model.add(pos_rad, vel, acc, torque_nm)
        if not self._mean_nm > self._warning_nm:
            self._over = self._over_halt = self._over_grip = 0
            return
        self._over += 1
        self._over_halt = self._over_halt + 1 if self._mean_nm > self._halt_nm else 0
        self._over_grip = self._over_grip + 1 if self._mean_nm > self._grip_nm else 0
        grips = self._over_grip >= self._grips
        if not (grips or self._over >= self._lasts):
            return
        reaction = None
        if grips:
            # On a ramp the drive would push against the brake.
            reaction = Reaction.TORQUE_OFF
        elif self._over_halt >= self._lasts:
            reaction = Reaction.HLT
        share = 100.0 * self._mean_nm / self._rated_nm
        self._alarms.raise_(Code.BRK_02, reaction, measured=self._mean_nm, share=share)
