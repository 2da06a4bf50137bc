"""Frequency response measured on a running axis, simulated or real: through the drive port and the position law only.

The axis stays in its closed loop. A periodic signal is added to the speed command or to the torque, small enough for
a given torque; responses are ratios of what the drive reports, so nothing of the plant has to be known. Where
friction holds, a small signal sees springs, where the axis turns it sees them slip: measure both ways and compare.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Final, NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray

from gantryctl import _core
from gantryctl.engineering.analysis.measured.excitation import Excitation
from gantryctl.engineering.analysis.models.linear import ComplexArray, FloatArray
from gantryctl.engineering.analysis.models.sampled import Input
from gantryctl.errors import AlarmStop, UsageError
from gantryctl.image import DriveRequest, DriveState, OutputImage
from gantryctl.motion import MotionLimits, SetPoint, hold, plan_stop, plan_velocity
from gantryctl.ports import Drive
from gantryctl.units import SIGNED, Dial, deg

_ENABLE_S: Final = 5.0
CALM_S: Final = 3.0
# Begins with a fiftieth and grows at most tenfold a trial: torque never jumps on an axis whose plant is not
# known.
_FIRST_SHARE: Final = 0.02
_MOST_GROWTH: Final = 10.0
_TRIALS: Final = 4
# Of the torque asked for: an axis that swings more than this by itself is not quiet.
_QUIET_SHARE: Final = 0.1
RECORD_COLUMNS: Final = ("vel_cmd_rad_s", "vel_law_rad_s", "vel_act_rad_s", "torque_act_nm", "pos_err_rad")

Record = dict[str, FloatArray]
"""Rows of a run, one value a scan, motor side: `RECORD_COLUMNS`."""


class ExcitedAxis(Protocol):
    """An axis in its position loop to whose command a signal can be added."""

    @property
    def scan_s(self) -> float:
        """Scan period."""
        ...

    @property
    def torque_limit_nm(self) -> float:
        """Motor torque that stops a measurement."""
        ...

    @property
    def step_rad(self) -> float:
        """One step of the motor encoder."""
        ...

    def run(self, excitation: Excitation | None, scans: int) -> Record:
        """Run so many scans with the signal added, from the start of its period.

        Raises:
            AlarmStop: the axis was stopped.
        """
        ...


@dataclass(frozen=True)
class ProbeLimits:
    """Limits that stop a measurement at once.

    Attributes:
        torque_nm: largest motor torque, absolute. pos_min_rad, pos_max_rad: gantry angle.
        motion: for getting to the speed at which it is measured, and for stopping.
        dial: how people read the angle.
    """

    torque_nm: float
    pos_min_rad: float
    pos_max_rad: float
    motion: MotionLimits
    dial: Dial = SIGNED

    def violation(self, torque_nm: float, angle_rad: float) -> str:
        """What is beyond its limit, with both values; "" for nothing."""
        if not abs(torque_nm) <= self.torque_nm:
            return f"the torque is {torque_nm:.4g} N m, permitted +-{self.torque_nm:.4g} N m"
        if not self.pos_min_rad <= angle_rad <= self.pos_max_rad:
            permitted = self.dial.span(deg(self.pos_min_rad), deg(self.pos_max_rad), ".2f")
            return f"the angle is {self.dial.text(deg(angle_rad), '.2f')} deg, permitted {permitted} deg"
        return ""


class FrequencyResponse(NamedTuple):
    """Measured frequency response, one value per line.

    Attributes:
        hz: frequencies.
        plant: motor speed per motor torque, rad/s per N m.
        speed_loop: motor speed per speed command. position_open: position loop cut at the speed command (L).
        position: motor angle per speed command, s, by the encoder alone: a drive may filter the speed that it reports.
        torque: motor torque per speed command, N m s/rad.
        torque_nm: amplitude of the motor torque. scatter: what the neighbouring frequencies carry, relative to the
        line:
            noise, gear error and the harmonics of friction.
    """

    hz: FloatArray
    plant: ComplexArray
    speed_loop: ComplexArray
    position_open: ComplexArray
    position: ComplexArray
    torque: ComplexArray
    torque_nm: FloatArray
    scatter: FloatArray


class Probe:
    """An axis that runs scan by scan with a signal added; the same for a simulated drive and one on a bus.

    Args:
        drive: the axis; torque off at the beginning.
        law: the position law of the controller. Its zero is the angle at which the axis stands now.
        scan_s: scan period. limits: see `ProbeLimits`. angle_rad: the gantry angle now, for the travel limits.
    """

    def __init__(
        self, drive: Drive, law: _core.PositionLaw, scan_s: float, limits: ProbeLimits, angle_rad: float
    ) -> None:
        self.drive = drive
        self.law = law
        self.scan_s = scan_s
        self.limits = limits
        # The law's zero is where the axis stands now: enabling makes no step.
        self.zero_counts = drive.read().pos_act_counts - law.ratio * angle_rad / law.rad_per_count
        self._plan = hold(angle_rad)
        self._scan = 0

    @property
    def torque_limit_nm(self) -> float:
        """Motor torque that stops a measurement."""
        return self.limits.torque_nm

    @property
    def step_rad(self) -> float:
        """One step of the motor encoder."""
        return self.law.rad_per_count

    @property
    def angle_rad(self) -> float:
        """Where the axis is."""
        return self._angle(self.drive.read().pos_act_counts)

    def enable(self) -> None:
        """Switch on, open the brake, hold the present angle until the axis is calm.

        Raises:
            AlarmStop: the drive does not come up within 5 s.
        """
        self.switch_on()
        self._plan, self._scan = hold(self.angle_rad), 0
        self.run(None, round(CALM_S / self.scan_s))

    def switch_on(self) -> None:
        """Switch on and open the brake.

        Raises:
            AlarmStop: the drive does not come up within 5 s.
        """
        for _ in range(round(_ENABLE_S / self.scan_s)):
            feedback = self.drive.read()
            if feedback.state is DriveState.OPERATION_ENABLED and feedback.brake_open:
                break
            self.drive.write(OutputImage(DriveRequest.ENABLE, 0.0, 0.0, True))
        else:
            raise AlarmStop(
                f"the drive is not enabled with its brake open after {_ENABLE_S:g} s: {feedback.state.name}"
            )

    def turn(self, vel_rad_s: float) -> None:
        """Turn at a constant speed, or come to rest, until the axis is calm."""
        start = SetPoint(*self._plan.sample(self._scan * self.scan_s))
        self._plan = plan_turning(start, vel_rad_s, self.limits.motion)
        self._scan = 0
        self.run(None, round((self._plan.duration + CALM_S) / self.scan_s))

    def run(self, excitation: Excitation | None, scans: int) -> Record:
        """Run so many scans with the signal added, from the start of its period.

        Raises:
            AlarmStop: torque or travel beyond the limits, or the drive left its enabled state; the axis is stopped.
        """
        signal = [0.0] if excitation is None else excitation.period(self.scan_s).tolist()
        to_torque = excitation is not None and excitation.where is Input.TORQUE
        read, write, law, sample = self.drive.read, self.drive.write, self.law.scan, self._plan.sample
        ratio = self.law.ratio
        rows = []
        for k in range(scans):
            feedback = read()
            ref_pos, ref_vel, _ = sample((self._scan + k) * self.scan_s)
            wanted, angle, error = law(ref_pos, ref_vel, feedback.pos_act_counts - self.zero_counts)
            self._check(feedback.state, feedback.torque_act_nm, angle)
            added = signal[k % len(signal)]
            command = wanted if to_torque else wanted + added
            write(OutputImage(DriveRequest.ENABLE, command, added if to_torque else 0.0, True))
            rows.append((command, wanted, feedback.vel_act_rad_s, feedback.torque_act_nm, ratio * error))
        self._scan += scans
        return dict(zip(RECORD_COLUMNS, np.array(rows).T, strict=True))

    def _angle(self, counts: float) -> float:
        return (counts - self.zero_counts) * self.law.rad_per_count / self.law.ratio

    def _check(self, state: DriveState, torque_nm: float, angle_rad: float) -> None:
        limits = self.limits
        if state is not DriveState.OPERATION_ENABLED:
            wrong = f"the drive is {state.name}"
        elif (
            abs(torque_nm) <= limits.torque_nm and limits.pos_min_rad <= angle_rad <= limits.pos_max_rad
        ):  # a scan long: nothing is called
            return
        else:
            wrong = limits.violation(torque_nm, angle_rad)
        # Stop first, explain afterwards: the axis moves under test.
        self.drive.write(OutputImage(DriveRequest.QUICK_STOP, brake_open=True))
        raise stopped(wrong)


def plan_turning(start: SetPoint, vel_rad_s: float, motion: MotionLimits) -> _core.Segments:
    """To a constant speed, or to rest."""
    return plan_velocity(start, vel_rad_s, motion) if vel_rad_s else plan_stop(start, motion)


def stopped(wrong: str) -> AlarmStop:
    """What a measurement ends with whose axis was stopped."""
    return AlarmStop(f"frequency response stopped: {wrong}; the signal is off, the axis makes a quick stop")


def fit_amplitude(probe: ExcitedAxis, excitation: Excitation, torque_nm: float) -> Excitation:
    """Fit the amplitude of a signal, so that the motor torque swings by +-`torque_nm`.

    Begins with a fiftieth of what moves an inertia that is not there and grows at most tenfold a trial, so the torque
    never jumps; a period each.

    Raises:
        UsageError: the torque asked for is not below the probe's limit.
    """
    if not 0.0 < torque_nm < probe.torque_limit_nm:
        raise UsageError(
            f"a test torque of {torque_nm:g} N m: must be above 0 and below the limit of "
            f"{probe.torque_limit_nm:g} N m that stops the measurement"
        )
    scans = round(excitation.period_s / probe.scan_s)
    quiet = float(np.ptp(probe.run(None, scans)["torque_act_nm"])) / 2.0
    crest = float(np.max(np.abs(replace(excitation, amplitude=1.0).period(probe.scan_s))))
    trial = replace(excitation, amplitude=_FIRST_SHARE / crest)
    for _ in range(_TRIALS):
        torque = probe.run(trial, scans)["torque_act_nm"]
        if quiet > _QUIET_SHARE * torque_nm:
            # An axis that turns swings by itself, with gear and ripple: only the lines of the signal are its answer.
            spectrum = np.zeros(scans // 2 + 1, dtype=np.complex128)
            lines = list(excitation.lines)
            spectrum[lines] = np.fft.rfft(torque)[lines]
            swing = float(np.ptp(np.fft.irfft(spectrum, scans))) / 2.0
        else:
            # One that stands answers with the harmonics of its friction as well.
            whole = float(np.ptp(torque)) / 2.0
            swing = max(whole - quiet, 0.1 * whole)
        growth = min(torque_nm / max(swing, 1e-9), _MOST_GROWTH)
        trial = replace(trial, amplitude=trial.amplitude * growth)
        if abs(growth - 1.0) < 0.1:
            break
    return trial


def measure(
    probe: ExcitedAxis, excitation: Excitation, settle_periods: int = 2, periods: int = 4
) -> FrequencyResponse:
    """Run the signal until it is periodic, then evaluate whole periods with a Hann window.

    The window takes away the mean, drifts and what is not periodic; between two lines at least `periods` - 3 bins are
    free, and what they carry is the scatter.

    Raises:
        UsageError: fewer than 4 periods cannot tell a line from its neighbourhood.
    """
    if periods < 4:
        raise UsageError(f"{periods} periods: at least 4 are needed")
    scans = round(excitation.period_s / probe.scan_s)
    probe.run(excitation, settle_periods * scans)
    record = probe.run(excitation, periods * scans)
    # Hann: a line fills its bin and both neighbours, and takes drifts away.
    window = 1.0 - np.cos(2.0 * np.pi / (periods * scans) * np.arange(periods * scans))
    spectra = {
        name: np.fft.rfft(window * (values - values.mean())) * (2.0 / len(values))
        for name, values in record.items()
    }
    bins = np.array(excitation.lines) * periods
    at = {name: spectrum[bins] for name, spectrum in spectra.items()}
    # rounding to counts repeats with the signal: its power lies on the multiples of 1/period, evenly
    rounding = probe.step_rad / probe.scan_s / np.sqrt(6.0) / np.sqrt(scans / 2.0)
    return FrequencyResponse(
        hz=excitation.hz,
        plant=at["vel_act_rad_s"] / at["torque_act_nm"],
        speed_loop=at["vel_act_rad_s"] / at["vel_cmd_rad_s"],
        position_open=-at["vel_law_rad_s"] / at["vel_cmd_rad_s"],
        position=-at["pos_err_rad"] / at["vel_cmd_rad_s"],
        torque=at["torque_act_nm"] / at["vel_cmd_rad_s"],
        torque_nm=np.abs(at["torque_act_nm"]),
        scatter=np.maximum.reduce(
            [
                _scatter(spectra["vel_act_rad_s"], bins, periods),
                _scatter(spectra["torque_act_nm"], bins, periods),
                rounding / np.abs(at["vel_act_rad_s"]),
            ]
        ),
    )


def _scatter(spectrum: ComplexArray, bins: NDArray[np.int64], periods: int) -> FloatArray:
    """R.m.s. of the free bins beside each line, relative to the line (Hann: a line fills its bin and both
    neighbours).
    """
    # The bins between two lines carry no signal: what is there is noise, gear error and harmonics of
    # friction.
    offsets = [k for k in range(-periods + 2, periods - 1) if abs(k) >= 2]
    beside = np.abs(spectrum[bins[:, None] + np.array(offsets)[None, :]])
    return np.asarray(np.sqrt(np.mean(beside**2, axis=1)) / np.abs(spectrum[bins]))
