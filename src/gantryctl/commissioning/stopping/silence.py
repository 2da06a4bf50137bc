"""Silence on purpose: what a drive does when its controller falls silent, by its own words, before any command."""

from __future__ import annotations

import math
from dataclasses import dataclass
from enum import StrEnum
from typing import Final, NamedTuple

from gantryctl.commissioning.open_loop_axis import ENABLE, OpenLoopAxis, state_name
from gantryctl.drives.canopen.cia402 import ENERGISED, decode_statusword
from gantryctl.drives.canopen.drive import CanopenDrive
from gantryctl.drives.od.verdicts import ParameterVerdict
from gantryctl.errors import DeviceError
from gantryctl.image import DriveState, OutputImage

# By SDO state and position are asked for in turn, and an answer comes a scan later; 6041 itself lags by 10 ms on a real
# drive model.
_SEEN_SCANS: Final = 4
_LAG_S: Final = 0.010
# Beyond the ramp: brake, torque off, and the state that shows it.
_END_S: Final = 1.0
_STILL_DEG_S: Final = 0.05
_STILL_S: Final = 0.2
_OFF: Final = (DriveState.FAULT, DriveState.SWITCH_ON_DISABLED)


class Way(StrEnum):
    """Way in which a controller falls silent, and the object by which a drive notices it."""

    COMMANDS = "process data"
    HEARTBEAT = "heartbeat"

    @property
    def place(self) -> str:
        """Object of the drive's own watch."""
        return "1400:05" if self is Way.COMMANDS else "1016:01"

    def limit_s(self, drive: CanopenDrive) -> float:
        """Time after which the drive must act."""
        settings = drive.opened.settings
        return settings.rpdo_deadline_s if self is Way.COMMANDS else settings.watch_s


def watched_ways(axis: OpenLoopAxis) -> tuple[Way, ...]:
    """The silences that this drive has an object for."""
    rows = axis.drive.opened.rows
    have = {row.place for row in rows if row.verdict is ParameterVerdict.OK}
    return tuple(way for way in Way if way.place in have)


class Silence(NamedTuple):
    """Bounds of one silence.

    Attributes:
        ways: what falls silent.
        limit_s: time from the last command to the first state that is not Operation enabled.
        way_deg: way of the gantry from the last command to rest.
        ramp_s: time of the ramp.
    """

    ways: tuple[Way, ...]
    limit_s: float
    way_deg: float
    ramp_s: float = 0.0


@dataclass
class SilentDrive:
    """What a drive has done while its controller was silent.

    Attributes:
        complained_s, stopped_s: time of its first emergency message, and of the first state that is not Operation
            enabled; NaN for never.
        state: the last one before the controller spoke again.
        brake_open: by the contact, else by the state.
        way_deg: of the gantry, motor side, without a sign.
        broken_off: why the controller ended it, and what the drive has confirmed; "" where it was the drive.
    """

    complained_s: float = math.nan
    stopped_s: float = math.nan
    state: DriveState = DriveState.UNKNOWN
    brake_open: bool = True
    way_deg: float = 0.0
    broken_off: str = ""

    @property
    def stopped(self) -> bool:
        """The drive alone has come to rest, taken the torque off and closed the brake."""
        return not self.broken_off and self.state in _OFF and not self.brake_open


class _View:
    """State and position in silence: by telegrams where SYNC goes out, else by SDO requests that nobody waits for."""

    def __init__(self, axis: OpenLoopAxis) -> None:
        self._axis, self._drive = axis, axis.drive
        self.state = axis.feedback.state
        self.looks = False
        """SYNC goes out again, and still no command."""
        self._turn = False

    @property
    def _by_telegram(self) -> bool:
        return (self.looks or not self._drive.silent_process_data) and not self._drive.process.age

    def scan(self) -> None:
        """One scan."""
        drive = self._drive
        if not self._by_telegram:
            self._turn = not self._turn
            if self._turn:
                drive.requests.read(0x6041, 0, self._state)
            else:
                drive.requests.read(0x6064, 0, self._position)
        # Without SYNC the link itself listens for the length of a scan.
        if self.looks or not drive.silent_process_data:
            self._axis.wait()
        feedback = drive.look() if self.looks else drive.read()
        if self._by_telegram:
            self._axis.feedback = feedback
            self.state = decode_statusword(drive.process.statusword)

    def look(self) -> None:
        """From now on send SYNC: a drive that answers no SDO shows itself in its telegrams."""
        if not self.looks:
            self.looks = True
            self._axis.begin_time()
            self.scan()

    def _state(self, data: bytes | None) -> None:
        if data is not None and len(data) == 2:
            self.state = decode_statusword(int.from_bytes(data, "little"))

    def _position(self, data: bytes | None) -> None:
        if data is None or len(data) != 4:
            return
        process = self._drive.process
        process.take_position(int.from_bytes(data, "little", signed=True))
        self._axis.feedback = self._axis.feedback._replace(pos_act_counts=process.counts)


def seen_by_s(limit_s: float, period_s: float) -> float:
    """Time by which the reaction within a limit has shown itself."""
    return limit_s + _SEEN_SCANS * period_s + _LAG_S


def fall_silent(axis: OpenLoopAxis, silence: Silence, speed_deg_s: float = 0.0) -> SilentDrive:
    """Stop sending, enabled at a speed, until the drive has stopped by itself or has to be stopped.

    No command is sent before the verdict: not even a controlword that follows the state. A drive that is still enabled
    after the limit, or whose gantry goes further than permitted, is broken off: torque off, brake.

    Raises:
        StepStopped: a person has stopped the step.
    """
    drive, seen, view = axis.drive, SilentDrive(), _View(axis)
    emergencies, begun_s, begun_deg = drive.node.emergencies.count, drive.link.now_s(), axis.angle_deg
    command = OutputImage(ENABLE, axis.motor_rad_s(speed_deg_s), 0.0, True)
    drive.silent_process_data = Way.COMMANDS in silence.ways
    drive.silent_heartbeat = Way.HEARTBEAT in silence.ways
    late_s = seen_by_s(silence.limit_s, axis.period_s)
    # A brake that 60FE works begins to close when the torque goes off.
    rest_s = _STILL_S + drive.settings.brake_close_s
    end_s = late_s + silence.ramp_s + rest_s + _END_S
    scans, still_s, before = 0, 0.0, begun_deg
    while still_s < rest_s:
        axis.heed()
        drive.write(command)
        view.scan()
        scans += 1
        time_s = scans * axis.period_s if drive.link.stepped else drive.link.now_s() - begun_s
        if math.isnan(seen.complained_s) and drive.node.emergencies.count > emergencies:
            seen.complained_s = time_s
        if time_s > late_s and drive.silent_process_data:
            view.look()
        if math.isnan(seen.stopped_s) and view.state is not DriveState.OPERATION_ENABLED:
            # What a SYNC shows right after the limit was so before.
            seen.stopped_s = min(time_s, late_s)
        seen.way_deg = abs(axis.angle_deg - begun_deg)
        still = abs(axis.angle_deg - before) <= _STILL_DEG_S * axis.period_s
        still_s = still_s + axis.period_s if still and view.state in _OFF else 0.0
        before = axis.angle_deg
        why = ""
        if not seen.way_deg <= silence.way_deg:
            why = f"moved {seen.way_deg:.3f} deg, {silence.way_deg:.3f} deg are permitted"
        elif math.isnan(seen.stopped_s) and time_s > late_s:
            why = f"still operation enabled {1e3 * time_s:.0f} ms after the last sign of the controller"
        elif time_s > end_s:
            why = f"in {state_name(view.state)} after {time_s:.1f} s"
        if why:
            seen.broken_off = f"{why} · {axis.break_off()}"
            seen.state = axis.feedback.state
            seen.way_deg = abs(axis.angle_deg - begun_deg)
            return seen
    view.look()
    seen.state, seen.brake_open = view.state, _brake_open(axis, view.state)
    return seen


def _brake_open(axis: OpenLoopAxis, state: DriveState) -> bool:
    """Contact of the brake, by telegram or SDO; without one what the state means."""
    drive = axis.drive
    try:
        contact = drive.beside.ask_brake_contact()
    except DeviceError:
        # What cannot be read is not closed.
        return True
    return state in ENERGISED if contact is None else contact
