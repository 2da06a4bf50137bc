"""What the answer of a drive to its speed command says: gains of its speed loop, inertia at the motor, dead time.

Fitted to measured responses of motor angle (6064) and motor torque (6077) above the frequencies at which the load
moves. The model: a command that acts a dead time after the scan that computed it and is held for a scan; PI on the
speed error; a first-order lag of the torque; a rotor, whose load hangs on a spring with a damper and stays at rest.
Where that misses, as on a small stiff axis that swings at 100 Hz, the load and its base move: two masses, each on a
spring with a damper at the rotor, answer like any chain of two (Foster's form; Meirovitch, Fundamentals of Vibrations,
2001, 7.4).
"""

from __future__ import annotations

from collections.abc import Callable
from itertools import pairwise
from typing import Final, NamedTuple

import numpy as np

from gantryctl.engineering.analysis.measured.excitation import Excitation, multisine
from gantryctl.engineering.analysis.measured.probe import (
    ExcitedAxis,
    FrequencyResponse,
    fit_amplitude,
    measure,
)
from gantryctl.engineering.analysis.models.linear import ComplexArray, FloatArray, expm
from gantryctl.engineering.analysis.models.sampled import Input
from gantryctl.errors import UsageError

# The motor against the load swings near 6 Hz on the reference gantry; three times above it the load stands still.
_LOW_HZ: Final = 20.0
# Of the scan rate, at most 200 Hz: above it a speed command moves nothing that an encoder sees.
_HIGH_SHARE: Final = 0.48
_HIGH_HZ: Final = 200.0
_LINES: Final = 50
_PERIOD_S: Final = 4.0
# A line is believed to 1 % at best: the model has no ripple, no gear error, no friction that holds.
_TRUST: Final = 0.01
# Gain, integral time, inertia, dead time (in scans), lag, spring, damper: where the search begins.
_START: Final = (50.0, 0.02, 0.3, 1.0, 3e-4, 400.0, 1.0)
# A misfit that a quieter signal may lessen: gears that leave their flank are not linear.
MISFIT_LOUD: Final = 3.0
# Loads that move are asked for where one at rest leaves more: 0.5 on the reference gantry, 10 with a base of 24 Hz.
_AT_REST_MAX: Final = 1.5
# Where the search for them begins: frequencies alone, in parts of the lowest line; inertia in parts of the rotor's.
_LOADS: Final = ((1.0, 3.0), (2.0, 5.0), (0.3, 1.0))
_LOAD_INERTIA: Final = 3.0
# Where loads move within the band the loop is fast, and its dead time is felt in the loop: lags in a row, all of it.
_LAGS: Final = 3
_LOAD_DAMPING: Final = 0.025
_ITERATIONS: Final = 80
# Misfit in units of the trust: beyond it the drive is no PI with a lag.
MISFIT_MAX: Final = 10.0


class HangingLoad(NamedTuple):
    """A mass on a spring with a damper at the rotor, at the motor: N m/rad, N m s/rad, kg m2."""

    stiffness_nm_per_rad: float
    damping_nm_s_per_rad: float
    inertia_kg_m2: float


class SpeedLoop(NamedTuple):
    """Speed loop of a drive as measured.

    Attributes:
        kvp_nm_s_per_rad, tvi_s: of the PI. inertia_kg_m2: at the motor, of what turns with it above the load's
            frequencies.
        dead_time_s: from the scan that computes a command until the torque answers it, as 6064 shows: way of the
            command, computing, current loop, age of the reading.
        lag_s: the part of it that is a lag of the torque.
        stiffness_nm_per_rad, damping_nm_s_per_rad: of the spring to the load at rest, at the motor, for motions too
            small to slide; 0 where loads move.
        misfit: r.m.s. deviation from the model, 1 = 1 % of a line or its scatter.
        loads: that move; () where the load stays at rest.
    """

    kvp_nm_s_per_rad: float
    tvi_s: float
    inertia_kg_m2: float
    dead_time_s: float
    lag_s: float
    stiffness_nm_per_rad: float
    damping_nm_s_per_rad: float
    misfit: float
    loads: tuple[HangingLoad, ...] = ()

    def sampled_torque_lack_kg_m2(self, scan_s: float) -> float:
        """Mean torque minus the torque seen at the scans, per acceleration, while the command rises in steps.

        Each step of the command kicks the torque, which has settled when the next scan looks: 6077 at SYNC shows less
        than the mean. At 4 ms and 7.9 rad/s2 that is 1.0 of 2.8 N m of the reference motor.
        """
        # Spring off: the load takes part in the acceleration, the ripple between scans is the motor's alone.
        free = self._replace(stiffness_nm_per_rad=0.0, damping_nm_s_per_rad=0.0, loads=())
        matrix, command = _matrices(free)
        step, late, soon = _held(matrix, command, self.dead_time_s - self.lag_s, scan_s)[:3]
        delay = int((self.dead_time_s - self.lag_s) // scan_s)
        state = np.zeros(len(command))
        # Long enough for the integrator: ten integral times.
        scans = delay + round(10.0 * max(self.tvi_s, self.lag_s) / scan_s) + 50
        ramp = scan_s * np.maximum(np.arange(scans + 1, dtype=np.float64) - delay, 0.0)
        for k in range(1, scans):
            state = step @ state + soon * ramp[k] + late * ramp[k - 1]
        return self.inertia_kg_m2 - float(state[_TORQUE])


_SPEED, _TORQUE, _INTEGRAL, _ANGLE, _LOAD = range(5)


def speed_loop_signal(scan_s: float) -> Excitation:
    """Signal for `measured_speed_loop`: lines of equal height up to half the scan rate."""
    high = min(_HIGH_HZ, _HIGH_SHARE / scan_s)
    if not high > 2.0 * _LOW_HZ:
        raise UsageError(
            f"a speed loop is measured from {_LOW_HZ:g} Hz on, and a scan period of {1e3 * scan_s:g} ms carries "
            f"{high:.0f} Hz: at most {1e3 * _HIGH_SHARE / (2.0 * _LOW_HZ):.0f} ms"
        )
    return multisine(Input.SPEED, _LOW_HZ, high, _LINES, scan_s, _PERIOD_S, roll_off_hz=np.inf)


def measured_speed_loop(axis: ExcitedAxis, torque_nm: float) -> SpeedLoop:
    """Excite an axis that turns slowly, and fit its speed loop: some 40 s.

    Args:
        torque_nm: half the swing of the motor torque that the signal makes.

    Raises:
        UsageError: the scan is too slow, or the drive is not of this kind. AlarmStop: the axis was stopped.
    """
    signal = fit_amplitude(axis, speed_loop_signal(axis.scan_s), torque_nm)
    return fit_speed_loop(measure(axis, signal, settle_periods=1, periods=5), axis.scan_s)


def fit_speed_loop(response: FrequencyResponse, scan_s: float) -> SpeedLoop:
    """Fit the model to a response.

    Raises:
        UsageError: no PI with a lag answers like that.
    """
    wanted = np.concatenate([response.position, response.torque])
    trust = np.tile(np.maximum(response.scatter, _TRUST), 2) * np.abs(wanted)

    def deviation(x: FloatArray) -> FloatArray:
        off = (_answer(_loop_of(x, scan_s), scan_s, response.hz) - wanted) / trust
        return np.concatenate([off.real, off.imag])

    x, cost = _descend(deviation, np.log(np.array(_START)))
    found = _loop_of(x, scan_s)._replace(misfit=float(np.sqrt(2.0 * cost)))
    if found.misfit > _AT_REST_MAX:
        trials = [_descend(deviation, start) for start in _moving_starts(response)]
        x, cost = min(trials, key=lambda trial: trial[1])
        if float(np.sqrt(2.0 * cost)) < found.misfit:
            found = _loop_of(x, scan_s)._replace(misfit=float(np.sqrt(2.0 * cost)))
    if not found.misfit <= MISFIT_MAX:
        raise UsageError(
            f"the speed loop of the drive does not answer like a PI with a lag: {found.misfit:.0f} % off, at most "
            f"{MISFIT_MAX:g} % can be read; are filters or an observer on in the drive?"
        )
    return found


def _moving_starts(response: FrequencyResponse) -> list[FloatArray]:
    """Where the search begins with loads that move: gain and rotor as the response shows them."""
    top = slice(3 * len(response.hz) // 4, None)
    rate = 2.0 * np.pi * response.hz[top]
    rotor = float(np.median(np.abs(response.torque[top] / response.position[top]) / rate**2))
    gain = float(np.median(np.abs(response.torque)))
    starts = []
    for shares in _LOADS:
        x = [gain, *_START[1:2], rotor, *_START[3:5]]
        for share in shares:
            swing = 2.0 * np.pi * share * float(response.hz[0])
            inertia = _LOAD_INERTIA * rotor
            x += [inertia * swing * swing, 2.0 * _LOAD_DAMPING * inertia * swing, inertia]
        starts.append(np.log(np.array(x)))
    return starts


def _loop_of(x: FloatArray, scan_s: float) -> SpeedLoop:
    kvp, tvi, inertia, delay, lag, *rest = (float(v) for v in np.exp(x))
    loop = SpeedLoop(kvp, tvi, inertia, delay * scan_s + lag, lag, 0.0, 0.0, np.nan)
    if len(rest) == len(("spring", "damper")):
        spring, damper = rest
        return loop._replace(stiffness_nm_per_rad=spring, damping_nm_s_per_rad=damper)
    loads = tuple(HangingLoad(*rest[k : k + 3]) for k in range(0, len(rest), 3))
    return loop._replace(loads=loads)


def _matrices(loop: SpeedLoop) -> tuple[FloatArray, FloatArray]:
    """x' = A x + b u of speed, torque, integral of the error, angle, speed and angle of each load that moves, and the
    lags before that of the torque; u the command as it acts.
    """
    lags = _LAGS if loop.loads else 1
    first_lag = _LOAD + 2 * len(loop.loads)
    size = first_lag + lags - 1
    a, b = np.zeros((size, size)), np.zeros(size)
    kvp, lag, inertia = loop.kvp_nm_s_per_rad, loop.lag_s / lags, loop.inertia_kg_m2
    a[_SPEED, :_LOAD] = [
        -loop.damping_nm_s_per_rad / inertia,
        1.0 / inertia,
        0.0,
        -loop.stiffness_nm_per_rad / inertia,
    ]
    chain = [*range(first_lag, size), _TORQUE]
    a[chain[0], :_LOAD] = [-kvp / lag, 0.0, kvp / lag, 0.0]
    for before, behind in pairwise(chain):
        a[behind, before] = 1.0 / lag
    for each in chain:
        a[each, each] = -1.0 / lag
    a[_INTEGRAL, _SPEED] = -1.0 / loop.tvi_s
    a[_ANGLE, _SPEED] = 1.0
    b[chain[0]], b[_INTEGRAL] = kvp / lag, 1.0 / loop.tvi_s
    for number, load in enumerate(loop.loads):
        speed = _LOAD + 2 * number
        angle = speed + 1
        # Torque that the load puts on the rotor, by speeds and angles of both.
        pull = np.zeros(size)
        pull[[_SPEED, speed]] = -load.damping_nm_s_per_rad, load.damping_nm_s_per_rad
        pull[[_ANGLE, angle]] = -load.stiffness_nm_per_rad, load.stiffness_nm_per_rad
        a[_SPEED] += pull / inertia
        a[speed] -= pull / load.inertia_kg_m2
        a[angle, speed] = 1.0
    return a, b


def _held(
    a: FloatArray, b: FloatArray, delay_s: float, scan_s: float
) -> tuple[FloatArray, FloatArray, FloatArray, int]:
    """One scan of a held command that acts `delay_s` late: matrix, effect of the older and of the newer command, and
    the whole scans of the delay (Franklin, Powell, Workman, Digital Control of Dynamic Systems, 4.3.4).
    """
    n = len(b)

    def over(time_s: float) -> tuple[FloatArray, FloatArray]:
        block = np.zeros((n + 1, n + 1))
        block[:n, :n], block[:n, n] = a, b
        moved = expm(block * time_s)
        return moved[:n, :n], moved[:n, n]

    whole = int(delay_s // scan_s)
    part = delay_s - whole * scan_s
    step = over(scan_s)[0]
    rest, newer = over(scan_s - part)
    older = rest @ over(part)[1]
    return step, older, newer, whole


def _answer(loop: SpeedLoop, scan_s: float, hz: FloatArray) -> ComplexArray:
    """Angle, then torque, per command, at these frequencies."""
    step, older, newer, whole = _held(*_matrices(loop), loop.dead_time_s - loop.lag_s, scan_s)
    z = np.exp(2j * np.pi * hz * scan_s)[:, np.newaxis]
    eye = np.eye(len(newer))
    states = np.linalg.solve(
        z[:, :, np.newaxis] * eye - step, ((newer + older / z) * z**-whole)[:, :, np.newaxis]
    )[:, :, 0]
    return np.concatenate([states[:, _ANGLE], states[:, _TORQUE]])


def _descend(deviation: Callable[[FloatArray], FloatArray], x: FloatArray) -> tuple[FloatArray, float]:
    """Least squares by Levenberg and Marquardt; the point and the mean square there."""
    off: FloatArray = deviation(x)
    cost, damping = float(off @ off), 1e-3
    for _ in range(_ITERATIONS):
        slope = np.column_stack([(deviation(x + 1e-5 * row) - off) / 1e-5 for row in np.eye(len(x))])
        square = slope.T @ slope
        step = np.zeros_like(x)
        while damping < 1e12:
            scaled = square + damping * np.diag(np.diag(square) + 1e-12)
            step = np.clip(np.linalg.solve(scaled, -slope.T @ off), -0.5, 0.5)
            tried: FloatArray = deviation(x + step)
            if float(tried @ tried) <= cost:
                x, off, cost, damping = x + step, tried, float(tried @ tried), max(damping / 5.0, 1e-12)
                break
            damping *= 5.0
        if damping >= 1e12 or float(np.max(np.abs(step))) < 1e-7:
            break
    return x, cost / len(off)
