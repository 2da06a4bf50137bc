"""Monitors of an axis that follows its set-point, and of one that is released."""

from __future__ import annotations

import math

from gantryctl.program.alarms.codes import Code, Reaction
from gantryctl.program.alarms.log import AlarmLog
from gantryctl.program.alarms.words import Words
from gantryctl.program.feedback import Feedback
from gantryctl.program.monitors.drag import DragWatch
from gantryctl.program.monitors.oscillation import Oscillation
from gantryctl.program.monitors.torque import TorqueWatch
from gantryctl.program.power.holding_torque import HoldingTorque
from gantryctl.program.settings import AxisSettings
from gantryctl.program.stretch import Sector
from gantryctl.program.virtual_axis import VirtualAxis
from gantryctl.units import deg


class Monitors:
    """Following error, speed, brake, torque and position while the axis follows.

    `scan` is a flat row of cheap tests written so that NaN fails them; a method per monitor is entered only
    when its test fails, counts there how many scans the condition lasts and decides. The reaction follows one rule:
    where reading and drive are believed, QUICK STOP; where either is in doubt, TORQUE OFF.

    Attributes:
        in_position: at rest within the window for the dwell time.
        not_in_position: the tolerance time ran out since the set-point arrived.
        drag: the watch for a brake that drags, with the torque model.
        rest_scans: how long the set-point has been at rest.
    """

    __slots__ = (
        "_alarms",
        "_at_rest",
        "_band_base",
        "_band_per_speed",
        "_brake",
        "_brake_scans",
        "_commanded",
        "_deviation",
        "_deviation_count",
        "_deviation_scans",
        "_dwell",
        "_dwell_scans",
        "_error_at_saturation",
        "_feedback",
        "_following",
        "_following_scans",
        "_holding",
        "_in_window",
        "_lead_s",
        "_look_ahead",
        "_oscillation",
        "_over_travel_minus",
        "_over_travel_plus",
        "_overspeed",
        "_overspeed_scans",
        "_period_s",
        "_ratio",
        "_saturation",
        "_saturation_scans",
        "_settings",
        "_standstill",
        "_standstill_scans",
        "_swing_max",
        "_tolerance_scans",
        "_torque_max",
        "_torque_watch",
        "_travel",
        "_trip",
        "_virtual",
        "_warning_ratio",
        "_window",
        "drag",
        "in_position",
        "not_in_position",
        "rest_scans",
    )  # fmt: skip

    def __init__(
        self,
        settings: AxisSettings,
        feedback: Feedback,
        virtual: VirtualAxis,
        holding: HoldingTorque,
        alarms: AlarmLog,
    ) -> None:
        monitors = settings.monitors
        self._settings = monitors
        self._feedback, self._virtual, self._holding, self._alarms = feedback, virtual, holding, alarms
        self._period_s = settings.period_s
        self._ratio = settings.law.ratio
        self._band_base = monitors.following_error_base_rad
        self._band_per_speed = monitors.following_error_per_speed_s
        self._warning_ratio = monitors.following_error_warning_ratio
        self._following_scans = settings.scans(monitors.following_error_time_s)
        self._deviation = monitors.velocity_deviation_rad_s
        self._deviation_scans = settings.scans(monitors.velocity_deviation_time_s)
        self._trip = settings.speed.overspeed_trip_rad_s
        self._overspeed_scans = settings.scans(monitors.overspeed_time_s)
        self._saturation_scans = settings.scans(monitors.torque_saturation_time_s)
        self._brake_scans = settings.scans(settings.power.brake_feedback_time_s)
        self._window = monitors.in_position_window_rad
        self._dwell_scans = settings.scans(monitors.in_position_dwell_s)
        self._tolerance_scans = settings.scans(monitors.in_position_tolerance_time_s)
        self._standstill_scans = settings.scans(monitors.standstill_time_s)
        self._travel = settings.travel
        self._look_ahead = 0.5 / settings.ramps.quick_dec_rad_s2
        # The drive's own limit is the motor's; a reading far beyond it is invalid.
        self._torque_max = 4.0 * settings.power.torque_max_nm
        # 0 without a no-go sector.
        self._lead_s = settings.travel.no_go_lead_s if settings.travel.no_go_rad else 0.0
        self._over_travel_plus = settings.travel.over_travel_max_rad
        self._over_travel_minus = settings.travel.over_travel_min_rad
        self.drag = DragWatch(settings, feedback, virtual, holding, alarms)
        self._oscillation = Oscillation(settings, alarms)
        self._swing_max = self._oscillation.limit_rad_s
        self._torque_watch = TorqueWatch(settings, feedback, virtual, holding, alarms)
        self.reset()

    def reset(self) -> None:
        """Forget all counts."""
        self._following = self._deviation_count = self._overspeed = self._saturation = self._brake = 0
        self._standstill = self._dwell = self.rest_scans = 0
        self._error_at_saturation = self._commanded = 0.0
        self._torque_watch.begin()
        self.drag.begin()
        self._in_window = self._at_rest = False
        self.in_position = self.not_in_position = False

    def scan(self, pos_rad: float, pos_err_rad: float, vel_cmd_rad_s: float) -> None:
        """Judge this scan; `vel_cmd_rad_s` is the speed command of the last scan, motor side."""
        feedback, virtual = self._feedback, self._virtual
        vel = feedback.vel_rad_s
        vel_ref = virtual.vel_ref_rad_s
        # Following error: the band grows with speed, 0.03 deg at rest and 0.10 deg at 6 deg/s.
        band = self._band_base + self._band_per_speed * abs(vel_ref)
        warning = band * self._warning_ratio
        if not -warning <= pos_err_rad <= warning:
            self._following_error(pos_err_rad, band, vel_cmd_rad_s)
        elif self._following:
            self._following = 0
        # The speed of the drive against its command of the last scan.
        deviation = vel - vel_cmd_rad_s / self._ratio
        if not -self._deviation <= deviation <= self._deviation:
            self._velocity_deviation(vel, vel_cmd_rad_s / self._ratio)
        elif self._deviation_count:
            self._deviation_count = 0
        self._torque_watch.scan(deviation, pos_err_rad)
        swing = vel - vel_ref
        if not -self._swing_max <= swing <= self._swing_max:
            self._oscillation.scan(swing)
        trip = self._trip
        if not -trip <= vel <= trip:
            self._too_fast(vel)
        elif self._overspeed:
            self._overspeed = 0
        # Travel: the angle, and the angle at which a quick stop would end, v|v| / 2a.
        stop = pos_rad + vel * abs(vel) * self._look_ahead
        if self._lead_s:
            stop += vel * self._lead_s
        low, high = self._over_travel_minus, self._over_travel_plus
        if not (low <= pos_rad <= high and low <= stop <= high):
            self._beyond_travel(pos_rad, stop, vel)
        self._torque_and_brake(vel, pos_err_rad, warning)
        if virtual.at_rest:
            self._at_standstill(pos_err_rad)
            return
        if self._at_rest:
            self._leave_standstill()
        self.drag.scan(pos_rad)

    def _torque_and_brake(self, vel: float, pos_err_rad: float, warning: float) -> None:
        feedback, torque_max = self._feedback, self._torque_max
        if not -torque_max <= feedback.torque_nm <= torque_max:
            self._invalid(Words.TORQUE_READING)
        if feedback.torque_limited:
            self._saturated(pos_err_rad)
        elif self._saturation:
            self._saturation = 0
        if not feedback.brake_open:
            self._brake_closed(vel, pos_err_rad, warning)
        elif self._brake:
            self._brake = 0

    def scan_released(self, pos_rad: float) -> None:
        """Judge a scan in which the axis does not follow: invalid readings, and a speed that was off its command."""
        feedback = self._feedback
        torque_max = self._torque_max
        if not -torque_max <= feedback.torque_nm <= torque_max:
            self._invalid(Words.TORQUE_READING)
        self._torque_watch.scan_released()
        if self._deviation_count:
            self._released_in_deviation(feedback.vel_rad_s)
        self._arm_over_travel(pos_rad)

    def _arm_over_travel(self, pos_rad: float) -> None:
        """Restore the normal limit once the axis is back inside."""
        low, high = self._limits(pos_rad)
        if low < pos_rad < high:
            self._over_travel_minus, self._over_travel_plus = low, high

    def _limits(self, pos_rad: float) -> tuple[float, float]:
        """Angles at which the measured one trips around here: of over-travel, or before a no-go sector."""
        travel = self._travel
        low, high = travel.over_travel_min_rad, travel.over_travel_max_rad
        if travel.no_go_rad:
            stretch, margin = travel.stretch(pos_rad), travel.no_go_margin_rad
            if stretch.below is not None:
                low = max(low, stretch.below[1] + margin)
            if stretch.above is not None:
                high = min(high, stretch.above[0] - margin)
        return low, high

    def turn_back(self, turns: int) -> None:
        """Count limits from a zero that lies so many turns further on."""
        self._over_travel_minus -= turns * math.tau
        self._over_travel_plus -= turns * math.tau

    def open_the_way_back(self, pos_rad: float) -> None:
        """Trip only when the axis goes further out: it was switched on outside the travel, to bring it back."""
        margin = self._settings.standstill_window_rad
        low, high = self._limits(pos_rad)
        self._over_travel_minus, self._over_travel_plus = low, high
        if pos_rad > high:
            self._over_travel_plus = pos_rad + margin
        elif pos_rad < low:
            self._over_travel_minus = pos_rad - margin

    # --- one method per monitor, entered when its cheap test failed -------------------------------

    def _following_error(self, error: float, band: float, vel_cmd_rad_s: float) -> None:
        size = abs(error)
        if not size <= band:
            self._following = self._feedback.lasting(self._following)
            if self._following >= self._following_scans or math.isnan(size):
                # An error that grows on an unchanged count is a frozen encoder, not an axis that lags.
                if self._feedback.unchanged_scans:
                    self._feedback.report_frozen(vel_cmd_rad_s)
                    return
                # Only a drive that obeys is asked for a ramp (B3).
                obeys = abs(self._feedback.vel_rad_s - vel_cmd_rad_s / self._ratio) <= self._deviation
                tell = self._alarms.raise_ if obeys else self._feedback.disobeyed
                speed = deg(abs(self._virtual.vel_ref_rad_s))
                tell(Code.CTL_03, measured=deg(size), limit=deg(band), speed=speed)
            return
        self._following = 0
        warning = deg(band * self._warning_ratio)
        self._alarms.raise_(Code.CTL_12, measured=deg(size), limit=warning, trip=deg(band))

    def _velocity_deviation(self, vel: float, command: float) -> None:
        """A drive at its torque limit may be slow in the right direction; everything else is disobedience (B5)."""
        self._deviation_count = self._feedback.lasting(self._deviation_count)
        self._commanded = command
        if self._deviation_count < self._deviation_scans:
            return
        # With the sign inverted in the drive a quick stop accelerates: beyond 18 000 deg on a rigid model (B5).
        lags = self._feedback.torque_limited and abs(vel) < abs(command) and vel * command >= 0.0
        if not lags:
            limit = deg(self._deviation)
            self._feedback.disobeyed(Code.CTL_05, measured=deg(vel), command=deg(command), limit=limit)

    def _released_in_deviation(self, vel: float) -> None:
        """A stop for another cause forgives nothing: on its ramp a sound drive is between the last command and rest.

        Judged by its ramp alone, from the speed of a runaway, a wrong sign was told after 200 ms in place of 20. None
        of 1,000 drawn pairs (simulated drive, readings 40 ms late, the sign turned 20 ms before to 60 ms after; 0.15
        to 3 deg/s, both ways, 1 to 50 kN m, 1, 4 and 10 ms) calls a wrong angle valid or takes more than 52 % of its
        limit. 288 sound quick stops on it (0.6 to 6 deg/s, 16 and 50 kN m, inertia within 20 %, 1, 4 and 10 ms) and
        60 over the bus never came to be judged so.
        """
        low, high = min(0.0, self._commanded), max(0.0, self._commanded)
        if low - self._deviation <= vel <= high + self._deviation or not self._feedback.energised:
            self._deviation_count = 0
        else:
            self._velocity_deviation(vel, self._commanded)

    def _too_fast(self, vel: float) -> None:
        self._overspeed = self._feedback.lasting(self._overspeed)
        if self._overspeed >= self._overspeed_scans:
            # At 1.2 of the highest speed the drive's own ramp is not believed any more; the trip stands at 1.1.
            reaction = Reaction.TORQUE_OFF if abs(vel) > 1.2 / 1.1 * self._trip else None
            self._alarms.raise_(Code.CTL_04, reaction, measured=deg(abs(vel)), limit=deg(self._trip))

    def _beyond_travel(self, pos_rad: float, stop_rad: float, vel: float) -> None:
        low, high = self._over_travel_minus, self._over_travel_plus
        above = pos_rad > high or stop_rad > high
        beyond, sector = high if above else low, self._sector_beyond(pos_rad, above)
        if sector is not None:
            read = self._travel.read_rad
            at, stop, begin, end = (deg(read(angle)) for angle in (pos_rad, stop_rad, *sector))
            self._alarms.raise_(Code.LIM_06, measured=at, position=stop, begin=begin, end=end)
            return
        # An angle beyond an end and the end are written alike, or nobody can compare them.
        signed = self._travel.read_end_rad
        at, stop, limit = (deg(signed(angle)) for angle in (pos_rad, stop_rad, beyond))
        if not low <= pos_rad <= high:
            self._alarms.raise_(Code.LIM_02, measured=at, limit=limit)
        else:
            self._alarms.raise_(Code.CTL_10, measured=deg(vel), position=stop, limit=limit)

    def _sector_beyond(self, pos_rad: float, above: bool) -> Sector | None:
        """The no-go sector that bounds this side, unless the end of travel is nearer."""
        if not self._travel.no_go_rad:
            return None
        stretch = self._travel.stretch(pos_rad)
        return stretch.above if above else stretch.below

    def _saturated(self, error: float) -> None:
        """The torque limit alone is no fault; a following error that grows at the limit is one (B8)."""
        size = abs(error)
        if self._saturation == 0:
            self._error_at_saturation = size
        self._saturation = self._feedback.lasting(self._saturation)
        if self._saturation >= self._saturation_scans and size > self._error_at_saturation + self._window:
            time_ms = self._saturation * self._period_s * 1e3
            self._alarms.raise_(Code.CTL_07, measured=deg(size), time_ms=time_ms)

    def _brake_closed(self, vel: float, error: float, warning: float) -> None:
        """Closed while commanded open: a fault at once when the axis feels it, else after a time (C5, C6)."""
        self._brake = self._feedback.lasting(self._brake)
        # A brake that closes by itself in motion shows in torque or error before its contact is late.
        moving, late = not self._virtual.at_rest, self._brake >= self._brake_scans
        felt = self._feedback.torque_limited or not -warning <= error <= warning
        if moving and (late or felt):
            # On its ramp the drive pushes against the brake: 4.28 deg from 6 deg/s, with the torque off 2.6.
            reaction = Reaction.TORQUE_OFF if felt else None
            self._alarms.raise_(Code.BRK_05, reaction, measured=deg(vel), error=deg(abs(error)))
        elif late:
            time_ms = self._brake * self._period_s * 1e3
            self._alarms.raise_(Code.BRK_06, measured=Words.CLOSED, command=Words.OPEN, time_ms=time_ms)

    def _at_standstill(self, error: float) -> None:
        """In position after the dwell time; from then on the standstill window must be kept."""
        self._at_rest = True
        self.rest_scans = self._feedback.lasting(self.rest_scans)
        size = abs(error)
        if size <= self._window:
            self._dwell = self._feedback.lasting(self._dwell)
            if self._dwell >= self._dwell_scans:
                self.in_position = self._in_window = True
                self.not_in_position = False
                self._holding.learn(self._feedback.torque_nm)
                self._torque_watch.standing()
        else:
            self._dwell = 0
            self.in_position = False
            overdue = self.rest_scans >= self._tolerance_scans
            # Once in the window, leaving it is a matter of standstill (CTL-13), not of arrival.
            if overdue and not self._in_window and not self.not_in_position:
                self.not_in_position = True
                time_s, limit = self.rest_scans * self._period_s, deg(self._window)
                self._alarms.raise_(Code.CTL_11, measured=deg(size), limit=limit, time_s=time_s)
        if self._in_window and not size <= self._settings.standstill_window_rad:
            self._standstill = self._feedback.lasting(self._standstill)
            if self._standstill >= self._standstill_scans:
                limit = deg(self._settings.standstill_window_rad)
                self._alarms.raise_(Code.CTL_13, measured=deg(size), limit=limit)
        elif self._standstill:
            self._standstill = 0

    def _invalid(self, reading: Words) -> None:
        self._alarms.raise_(Code.CTL_02, Reaction.TORQUE_OFF, measured=reading)

    def _leave_standstill(self) -> None:
        self._arm_over_travel(self._virtual.pos_ref_rad)
        self._at_rest = self._in_window = self.in_position = self.not_in_position = False
        self._dwell = self.rest_scans = self._standstill = 0
