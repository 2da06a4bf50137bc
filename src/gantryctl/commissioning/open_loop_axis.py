"""A drive on a bus without a position loop, scan by scan: for the proofs that come before the loop may be closed."""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Iterator
from contextlib import contextmanager, nullcontext, suppress
from typing import Final

from gantryctl.commissioning.pictures import MotionSample
from gantryctl.commissioning.results import Context
from gantryctl.commissioning.room import why_no_room
from gantryctl.commissioning.watch import Halt, Seen, StepStopped, StepWatch
from gantryctl.drives.canopen.bus.node import LOST
from gantryctl.drives.canopen.cia402 import ENERGISED, FOLLOWS_COMMAND
from gantryctl.drives.canopen.drive import CanopenDrive
from gantryctl.errors import AlarmStop, CommandRefused, DeviceError
from gantryctl.image import SAFE_OUTPUT, DriveFeedback, DriveRequest, DriveState, LinkFlag, OutputImage
from gantryctl.machine import Machine
from gantryctl.operation.ledger.inputs import without_following_bit
from gantryctl.operation.opening import keep_machine, open_machine, rested_at
from gantryctl.operation.proofs import bus_reasons
from gantryctl.runtime import RealClock, Retained, VirtualClock, keeps_time
from gantryctl.units import deg, rad

ENABLE: Final = DriveRequest.ENABLE
_TORQUE: Final = (ENABLE, DriveRequest.QUICK_STOP)
_MINUS, _PLUS = 1, 2
_ENABLED: Final = DriveState.OPERATION_ENABLED
_ENABLE_S: Final = 2.0
# A command acts at the next SYNC and shows at the one after (decision 0012); two scans more are granted.
_SHOWN_SCANS: Final = 4
# The way of the command is ahead of the gantry by the lag of the drive's speed loop: 0.02 s on the virtual drive. This
# tells a drive that stands still, or turns the wrong way, from a slow one.
_BEHIND_DEG: Final = 0.05
_BEHIND_S: Final = 0.15
# Torque off and brake stop the reference gantry from 3 deg/s within 0.75 s.
_BREAK_OFF_S: Final = 1.5
_STILL_DEG_S: Final = 0.05
# `enable` tells more about a bit that never comes.
_BRIDGED: Final = LinkFlag.LATE | LinkFlag.SYNC_JITTER | LinkFlag.NEVER_FOLLOWED
_OLD_SCANS: Final = 3
_OLD_S: Final = 0.030
_STILL_S: Final = 0.1


class OpenLoopAxis:
    """Commands to an open drive, switched off when the gantry moves too far or not as it was commanded.

    Args:
        feedback: what the drive showed when it was opened.
        start_deg: angle of the gantry there; NaN without a zero offset.
        leash_deg: way from there at which the axis is switched off.
        watch: sees the axis, is told of the time that passes, and ends the step when a person stops it.
        following: the gantry must follow the speed command, as a drive of proven sign and scale does.

    Attributes:
        retained: the controller's memory, kept at the end; a step may change it.
        samples: what was commanded and seen, reading by reading.
        start_counts, deg_per_count: motor encoder at the start, and the gantry's angle of a count.
    """

    def __init__(
        self,
        machine: Machine,
        drive: CanopenDrive,
        feedback: DriveFeedback,
        start_deg: float,
        leash_deg: float,
        retained: Retained,
        watch: StepWatch,
        *,
        following: bool = True,
    ) -> None:
        self.retained = retained
        self._watch = watch
        self.samples: list[MotionSample] = []
        self._ref_deg_s, self._sample_s = 0.0, 0.0
        self.drive, self.period_s = drive, drive.settings.period_s
        self.ratio = machine.axis.ratio
        self.start_deg, self._leash_deg = start_deg, leash_deg
        self.deg_per_count = 360.0 / (drive.identity().counts_per_turn * self.ratio)
        self._clock = RealClock(self.period_s) if machine.paced_by_clock else VirtualClock()
        self._deadline = 0
        self._feedback, self.start_counts = feedback, feedback.pos_act_counts
        self._following = following
        self._without_bit = without_following_bit(machine)
        self._band_deg_s = machine.monitors.velocity_deviation_deg_s
        self._band_scans = max(1, round(1e-3 * machine.monitors.velocity_deviation_time_ms / self.period_s))
        self._commanded: deque[float] = deque(maxlen=_SHOWN_SCANS)
        self._way_deg = self._begun_deg = 0.0
        self._off_scans = self._stuck_scans = 0
        self._passed_s = self.period_s
        self._limits_closed = _limits_closed(feedback)

    @property
    def feedback(self) -> DriveFeedback:
        """What the drive showed last."""
        return self._feedback

    @feedback.setter
    def feedback(self, seen: DriveFeedback) -> None:
        # Every reading is kept for the picture, whoever has taken it: scan, silence, break-off.
        self._feedback = seen
        link = self.drive.link
        self._sample_s = self._sample_s + self.period_s if link.stepped else link.now_s()
        # In silence the position alone is asked for, by SDO: speed and torque are those of the last telegram.
        shown = not self.drive.silent_process_data
        speed, torque = (self.speed_deg_s, seen.torque_act_nm) if shown else (math.nan, math.nan)
        self.samples.append(MotionSample(self._sample_s, self._ref_deg_s, speed, self.angle_deg, torque))
        there_deg = self.start_deg + self.angle_deg
        self._watch.seen = Seen(
            there_deg if math.isfinite(there_deg) else None, speed if math.isfinite(speed) else None, seen
        )

    @property
    def angle_deg(self) -> float:
        """Way of the gantry since the start, motor side."""
        return (self.feedback.pos_act_counts - self.start_counts) * self.deg_per_count

    @property
    def speed_deg_s(self) -> float:
        """Of the gantry, as the drive says."""
        return deg(self.feedback.vel_act_rad_s / self.ratio)

    def motor_rad_s(self, speed_deg_s: float) -> float:
        """Speed of the motor for one of the gantry."""
        return rad(speed_deg_s) * self.ratio

    def scan(
        self, request: DriveRequest, speed_deg_s: float = 0.0, torque_nm: float = 0.0, brake: bool = True
    ) -> DriveFeedback:
        """Send one command and return the feedback of the next SYNC.

        Raises:
            AlarmStop: the leash is at its end, the gantry does not follow, a limit switch has opened, or something is
            wrong with the connection.
            StepStopped: a person has stopped the step.
        """
        self.heed()
        before, self._ref_deg_s = self.feedback.state, speed_deg_s
        self.drive.write(OutputImage(request, self.motor_rad_s(speed_deg_s), torque_nm, brake))
        self.wait()
        self.feedback = self.drive.read()
        if not math.isfinite(self.angle_deg) or abs(self.angle_deg) > self._leash_deg:
            self.stop_for(f"the axis moved {self.angle_deg:+.3f} deg, {self._leash_deg:g} deg were allowed")
        # The program, whose interlocks they are, does not run; of a drive that is off a hand tries them.
        opened = self._limits_closed & ~_limits_closed(self.feedback)
        if opened and request in _TORQUE:
            self.stop_for(f"the limit switch at the {'plus' if opened & _PLUS else 'minus'} end has opened")
        link = self.feedback.link
        # As in operation: a telegram that is missing is bridged for 30 ms, and jitter is a warning.
        oldest = max(self.feedback.age_scans, self.feedback.inputs_age_scans)
        if link & ~_BRIDGED or oldest > max(_OLD_SCANS, _OLD_S / self.period_s):
            self.stop_for(f"the connection to the drive is disturbed: {link.name}")
        self._judge_bit_12()
        self._judge_following(speed_deg_s, request is ENABLE and before is self.feedback.state is _ENABLED)
        return self.feedback

    def heed(self) -> None:
        """Take torque off and brake where a person has stopped the step: no ramp of this drive is proven yet.

        Raises:
            StepStopped: with who it was and what the drive has confirmed.
        """
        if self.halted:
            raise StepStopped(f"{self._watch.halt.why} · {self.break_off()}")

    @property
    def halted(self) -> bool:
        """A person has stopped the step."""
        return self._watch.halt.asked()

    def hear_nobody(self) -> None:
        """Heed no person any more: of a copy of this process, to which nobody talks and which is to be killed."""
        self._watch = StepWatch(self._watch.meter, Halt())

    def begin_time(self) -> None:
        """Count scans from now on, after a time that somebody else has paced."""
        self._clock.start()

    def wait(self) -> None:
        """Wait for the next scan."""
        before = self._deadline
        self._deadline = self._clock.wait_for(before + 1).deadline
        # The gantry goes on while scans are missed.
        self._passed_s = (self._deadline - before) * self.period_s
        self._watch.meter.advance(self._passed_s)

    def _judge_bit_12(self) -> None:
        """A drive that is off, or stops by itself, follows no command: a bit that is always 1 says nothing."""
        wrong = (
            self.drive.settings.follows_bit
            and self.feedback.state is not _ENABLED
            and bool(self.drive.process.statusword & FOLLOWS_COMMAND)
        )
        self._stuck_scans = self._stuck_scans + 1 if wrong else 0
        if self._stuck_scans > _SHOWN_SCANS:
            self.stop_for(
                f"bit 12 of 6041 says that the drive follows the command in {state_name(self.feedback.state)} · [can] "
                "follows_bit = false where the bit means nothing"
            )

    def _judge_following(self, speed_deg_s: float, enabled: bool) -> None:
        """Compare speed and way with what was commanded since the drive was enabled."""
        if not (enabled and self._following):
            self._commanded.clear()
            self._way_deg, self._begun_deg, self._off_scans = 0.0, self.angle_deg, 0
            return
        self._commanded.append(speed_deg_s)
        self._way_deg += speed_deg_s * self._passed_s
        low, high = min(self._commanded) - self._band_deg_s, max(self._commanded) + self._band_deg_s
        self._off_scans = 0 if low <= self.speed_deg_s <= high else self._off_scans + 1
        if self._off_scans > self._band_scans:
            self.stop_for(
                f"the axis turns at {self.speed_deg_s:+.3f} deg/s, {speed_deg_s:+.3f} deg/s are commanded (band "
                f"{self._band_deg_s:g} deg/s)"
            )
        way, fastest = self.angle_deg - self._begun_deg, max(map(abs, self._commanded))
        allowed = _BEHIND_DEG + _BEHIND_S * fastest
        if not abs(way - self._way_deg) <= allowed:
            self.stop_for(
                f"the axis turned by {way:+.3f} deg, {self._way_deg:+.3f} deg were commanded, {allowed:.3f} deg "
                "apart are allowed"
            )

    # --- the end of a command, expected or not ---------------------------------------------------------------------

    def stop_for(self, why: str) -> None:
        """Take torque off and brake, and end the step.

        Raises:
            AlarmStop: always, with the reason and with what the drive has confirmed.
        """
        raise AlarmStop(f"{why} · {self.break_off()}")

    def break_off(self) -> str:
        """Command torque off and brake, look at the drive, and say what it has confirmed."""
        drive, still_s = self.drive, 0.0
        drive.silent_process_data = drive.silent_heartbeat = False
        self._ref_deg_s = 0.0
        drive.write(SAFE_OUTPUT)
        if drive.lost:
            # A drive that has left OPERATIONAL takes commands, and shows itself, only after it was started.
            with suppress(DeviceError):
                drive.resume()
        self.begin_time()
        before = self.angle_deg
        for k in range(round(_BREAK_OFF_S / self.period_s)):
            drive.write(SAFE_OUTPUT)
            self.wait()
            self.feedback = seen = drive.read()
            # A turning gantry is not believed to be off, whatever the state says.
            still = abs(self.angle_deg - before) <= _STILL_DEG_S * self.period_s
            before = self.angle_deg
            shown = not seen.age_scans and not seen.inputs_age_scans and not seen.link & LOST
            off = shown and seen.state not in (*ENERGISED, DriveState.UNKNOWN) and not seen.brake_open
            still_s = still_s + self.period_s if off and still else 0.0
            if still_s >= _STILL_S:
                after_ms = max(0.0, 1e3 * ((k + 1) * self.period_s - still_s))
                return f"torque off and brake closed after {after_ms:.0f} ms, at {self.angle_deg:+.3f} deg"
        return "torque off and brake commanded, not confirmed: press the emergency stop"

    def show(self, output: OutputImage, seconds: float) -> None:
        """Repeat outputs for a time, with the drive off."""
        for _ in range(math.ceil(seconds / self.period_s - 1e-9)):
            self.heed()
            self.drive.write(output)
            self.wait()
            self.feedback = self.drive.read()

    def run(
        self,
        seconds: float,
        request: DriveRequest = ENABLE,
        speed_deg_s: float = 0.0,
        torque_nm: float = 0.0,
        brake: bool = True,
    ) -> list[DriveFeedback]:
        """Repeat a command for a time."""
        return [
            self.scan(request, speed_deg_s, torque_nm, brake)
            for _ in range(math.ceil(seconds / self.period_s - 1e-9))
        ]

    def enable(self, *, brake: bool = True) -> None:
        """Enable the drive, standing.

        Raises:
            DeviceError: it does not reach Operation enabled.
        """
        for _ in range(round(_ENABLE_S / self.period_s)):
            if self.scan(ENABLE, brake=brake).state is _ENABLED:
                self.run(0.3, brake=brake)
                return
        status = self.drive.process.statusword
        # The drive itself may say Operation enabled: then only bit 12 is missing.
        lacks_bit = self.drive.settings.follows_bit and not status & FOLLOWS_COMMAND
        hint = (
            " · bit 12 of 6041 is 0: [can] follows_bit = false where the drive has no such bit; one that ignores the "
            f"command is then {self._without_bit}"
            if lacks_bit
            else ""
        )
        raise DeviceError(
            f"the drive is in {state_name(self.feedback.state)} after {_ENABLE_S:g} s, operation enabled was wanted"
            f"{hint}"
        )

    def ramp_to(self, speed_deg_s: float, acc_deg_s2: float) -> None:
        """Change speed at a constant acceleration."""
        start = self.speed_deg_s
        n = max(1, math.ceil(abs(speed_deg_s - start) / acc_deg_s2 / self.period_s))
        for k in range(n):
            self.scan(ENABLE, start + (speed_deg_s - start) * (k + 1) / n)

    def disable(self) -> None:
        """Close the brake, where the controller commands it, then take the torque off."""
        self.run(2 * self.period_s, brake=False)
        self.run(0.6, DriveRequest.DISABLE, brake=False)

    def wake(self) -> None:
        """Send again after a silence, asking for nothing, and clear the fault that the silence has caused.

        Raises:
            DeviceError: the fault stays.
        """
        self.drive.resume()
        self.begin_time()
        if self.run(0.1, DriveRequest.DISABLE)[-1].state is not DriveState.SWITCH_ON_DISABLED:
            self.reset()

    def reset(self) -> None:
        """Clear a fault that a proof has caused.

        Raises:
            DeviceError: it stays for a second.
        """
        for _ in range(round(1.0 / self.period_s)):
            if self.scan(DriveRequest.FAULT_RESET).state is DriveState.SWITCH_ON_DISABLED:
                return
        raise DeviceError(f"the drive's fault does not go away: {self.feedback.error_code:04X}h")


def _limits_closed(seen: DriveFeedback) -> int:
    """Limit switches that are closed, or not wired."""
    return _MINUS * seen.inputs.limit_minus_ok | _PLUS * seen.inputs.limit_plus_ok


def state_name(state: DriveState) -> str:
    """State of a drive for people."""
    return state.name.lower().replace("_", " ")


@contextmanager
def open_loop_axis(
    c: Context, leash_deg: float, part: str = "", *, following: bool = True, way: float = 0.0
) -> Iterator[OpenLoopAxis]:
    """Open the drive, and leave it off, braked and with its rest position retained.

    Args:
        part: of the step, for the title of its picture; where the gantry does not move there is no picture.
        way: its sign is the direction in which the step turns the axis; 0: either.

    Raises:
        CommandRefused: its parameters forbid enabling.
        StepStopped: the axis stands so near to an end of its way that the step could reach it.
    """
    machine, store = c.machine, c.store
    opened = open_machine(machine, store)
    drive = opened.drive
    assert isinstance(drive, CanopenDrive)
    known_deg = opened.reading.angle_deg
    axis = OpenLoopAxis(
        machine,
        drive,
        opened.feedback,
        math.nan if known_deg is None else known_deg,
        leash_deg,
        opened.retained,
        c.watch,
        following=following,
    )
    try:
        for reason in bus_reasons(machine, store, drive, commissioning=True):
            raise CommandRefused(reason.text)
        # Nothing was tried, so that nothing has failed: what was proven before stands.
        if near := why_no_room(machine, opened.reading, leash_deg, opened.retained.doubted_by, way):
            raise StepStopped(near)
        with keeps_time() if machine.paced_by_clock else nullcontext():
            yield axis
    finally:
        drive.close()
        counts = int(drive.read().pos_act_counts)
        keep_machine(machine, store, drive, rested_at(opened, axis.retained, counts))
        if part:
            c.watch.draw(part, _from_zero(axis.samples))


def _from_zero(samples: list[MotionSample]) -> list[MotionSample]:
    begun_s = samples[0].time_s if samples else 0.0
    return [sample._replace(time_s=sample.time_s - begun_s) for sample in samples]
