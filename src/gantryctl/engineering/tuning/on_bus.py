"""Tuning of a machine on a bus, in two halves with the maker's tool between them.

First half: measure the speed loop of the drive and the position loop, put what was measured and identified into the
linear model, and search gains by margins. Then somebody enters Kvp and Tvi with the maker's tool, and Kpp in the
machine file. Second half: measure again, and judge whether the drive has what was proposed and the loop is as calm as
wanted.
"""

from __future__ import annotations

import json
import math
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any, Final, NamedTuple

import numpy as np

from gantryctl.engineering.analysis.measured.on_engine import EngineProbe
from gantryctl.engineering.analysis.measured.response import (
    TORQUE_LIMIT_SHARE,
    MeasuredResponse,
    conditions,
    measure_on,
)
from gantryctl.engineering.analysis.measured.speed_loop import HangingLoad, SpeedLoop, measured_speed_loop
from gantryctl.engineering.identification.experiment import SPEED_LOOP_S, experiment_of
from gantryctl.engineering.identification.measure import SPEED_LOOP_SHARES
from gantryctl.engineering.stops import check_quick_stop
from gantryctl.engineering.tuning.by_margins import STATED, Conditions, by_margins
from gantryctl.engineering.tuning.gains import Gains, configured, machine_with
from gantryctl.errors import ConfigError, StateError, UsageError
from gantryctl.files import write_whole
from gantryctl.machine import Machine, with_values
from gantryctl.machine.places import one_flank_deg, reach_deg
from gantryctl.operation.run import AxisRun
from gantryctl.wiring.compensation import check_calibration
from gantryctl.wiring.simulator import drive_params

# A measured gain is a few per cent off: a drive that has what was proposed is nearer than this.
KVP_WITHIN: Final = 0.15
TVI_WITHIN: Final = 0.25
# Of the proposal's own limit: noise of a measured line, and one cycle of the bus that the linear model leaves out.
SENSITIVITY_WITHIN: Final = 0.15
_CALM_S: Final = 4.0
_SHORTEST_LAG_S: Final = 1e-5
_TRIALS: Final = 8
_SOFTER: Final = 0.7


class DriveFigures(NamedTuple):
    """What was measured of a drive and its position loop.

    Attributes:
        speed_loop: of the drive.
        sensitivity: largest 1/|1 + L| of the position loop, standing, over the lines that can be trusted.
        sensitivity_hz: where.
    """

    speed_loop: SpeedLoop
    sensitivity: float
    sensitivity_hz: float


class Check(NamedTuple):
    """One line of the verdict."""

    name: str
    measured: float
    wanted: float
    allowed: float
    unit: str

    @property
    def passed(self) -> bool:
        """Within the allowed difference, or at most the allowed value where nothing is wanted."""
        if math.isnan(self.wanted):
            return self.measured <= self.allowed
        return abs(self.measured / self.wanted - 1.0) <= self.allowed


@dataclass(frozen=True)
class TuningSession:
    """A tuning under way, as it is kept between its halves.

    Attributes:
        machine, drive: names; the second half belongs to the same two.
        sensitivity_max: largest that was asked for.
        after: None until the second half.
    """

    machine: str
    drive: str
    sensitivity_max: float
    before: DriveFigures
    proposal: Gains
    after: DriveFigures | None = None

    @property
    def checks(self) -> tuple[Check, ...]:
        """The verdict of the second half; () before it."""
        if self.after is None:
            return ()
        loop, wanted = self.after.speed_loop, self.proposal
        limit = self.sensitivity_max * (1.0 + SENSITIVITY_WITHIN)
        return (
            Check(
                "Kvp of the drive", loop.kvp_nm_s_per_rad, wanted.kvp_nm_s_per_rad, KVP_WITHIN, "N m s/rad"
            ),
            Check("Tvi of the drive", 1e3 * loop.tvi_s, 1e3 * wanted.tvi_s, TVI_WITHIN, "ms"),
            Check("sensitivity of the position loop", self.after.sensitivity, math.nan, limit, ""),
        )

    @property
    def passed(self) -> bool:
        """The second half was made, and the drive has what was proposed."""
        return bool(self.checks) and all(check.passed for check in self.checks)


def moves_text(machine: Machine) -> str:
    """What `measured_drive` does, for the person who lets it move."""
    experiment, dial = experiment_of(machine), machine.axis.dial
    begin = experiment.speed_loop_deg
    end = min(reach_deg(machine)[1], begin + SPEED_LOOP_S * experiment.speed_loop_deg_s)
    return (
        f"moves to {dial.text(begin)} deg, turns slowly to {dial.text(end)} deg at most and stands at "
        f"{dial.text(one_flank_deg(machine))} deg for 5 minutes, with test signals of up to "
        f"+-{SPEED_LOOP_SHARES[0] * machine.motor.torque_rated_nm:.3g} N m on its speed command"
    )


def measured_drive(machine: Machine, run: AxisRun) -> DriveFigures:
    """Measure speed loop and position loop of a machine under power: some 5 minutes.

    Raises:
        UsageError: the speed loop cannot be read. AlarmStop: the axis was stopped.
    """
    lowest = machine.speed.setting_min_deg_s
    experiment = experiment_of(machine)
    turning_deg_s = experiment.speed_loop_deg_s
    run.move(experiment.speed_loop_deg)
    # To the end of the travel: the measurement is over before.
    run.begin_move(reach_deg(machine)[1], max(turning_deg_s, lowest), min(1.0, turning_deg_s / lowest))
    run.follow(_CALM_S)
    rated_nm = machine.motor.torque_rated_nm
    loop = measured_speed_loop(
        EngineProbe(run, TORQUE_LIMIT_SHARE * rated_nm), SPEED_LOOP_SHARES[0] * rated_nm
    )
    run.halt()
    standing = conditions(machine, one_flank_deg(machine))[0]
    sensitivity, hz = _sensitivity(measure_on(machine, run, standing))
    return DriveFigures(loop, sensitivity, hz)


def _sensitivity(response: MeasuredResponse) -> tuple[float, float]:
    trusted = response.trusted > 0.0
    peaks = 1.0 / np.abs(1.0 + response.measured.position_open[trusted])
    if not len(peaks):
        raise UsageError("no line of the frequency response stands above its noise: ask for more --torque")
    worst = int(np.argmax(peaks))
    return float(peaks[worst]), float(response.measured.hz[trusted][worst])


def measured_machine(machine: Machine, loop: SpeedLoop, encoder_serial: str) -> Machine:
    """The machine with what was measured in its [plant] and [drive], for the linear model.

    Raises:
        ConfigError: it has no calibration of its own: identify it first.
    """
    calibration = check_calibration(machine, encoder_serial)
    motor_inertia = calibration.number("motor_inertia_kg_m2")
    drive = drive_params(machine)
    ratio = machine.axis.ratio
    own_s = (0.5 + drive.delay_cycles) * drive.cycle_s + drive.latency_s
    lag_s = max(_SHORTEST_LAG_S, loop.dead_time_s - machine.control.scan_period_ms * 1e-3 - own_s)
    return with_values(
        machine,
        {
            "plant.load.inertia_kg_m2": calibration.number("inertia_kg_m2") - ratio * ratio * motor_inertia,
            "plant.motor.wave_generator_inertia_kg_m2": max(0.0, motor_inertia - machine.motor.inertia_kg_m2),
            "drive.speed_loop.kvp_nm_s_per_rad": loop.kvp_nm_s_per_rad,
            "drive.speed_loop.tvi_ms": 1e3 * loop.tvi_s,
            "drive.current_loop.ideal": False,
            "drive.current_loop.bandwidth_hz": min(1.0 / (2.0 * math.pi * lag_s), 5000.0),
        },
    )


def begin(machine: Machine, run: AxisRun, asked: Conditions = STATED) -> TuningSession:
    """The first half: measure, and search gains on what was measured.

    Raises:
        ConfigError: the machine was not identified. UsageError: no gains meet the conditions.
        AlarmStop: the axis was stopped.
    """
    identity = run.drive.identity()
    # Before anything moves.
    check_calibration(machine, identity.encoder_serial)
    before = measured_drive(machine, run)
    known = measured_machine(machine, before.speed_loop, identity.encoder_serial)
    return TuningSession(
        machine.name, identity.encoder_serial, asked.sensitivity, before, proposed(machine, known, asked)
    )


def proposed(machine: Machine, known: Machine, asked: Conditions) -> Gains:
    """Gains by margins with which motor and reducer can still give the quick stop of the machine file.

    Raises:
        UsageError: there are none.
    """
    present, highest = configured(machine), math.inf
    # A quick stop is a step of deceleration: a stiffer speed loop answers it with more torque.
    for _ in range(_TRIALS):
        found = by_margins(known, asked, kvp_highest=highest).gains
        gains = replace(found, kvf=present.kvf, acc_deg_s2=present.acc_deg_s2)
        try:
            # By what was measured, and by the machine file, which every command that moves checks.
            for judged in (known, machine):
                check_quick_stop(machine_with(judged, gains))
        except ConfigError:
            highest = _SOFTER * gains.kvp_nm_s_per_rad
        else:
            return gains
    raise UsageError(
        f"no gains meet the conditions with a quick stop of {machine.virtual_axis.quick_dec_deg_s2:g} deg/s2 "
        "([virtual_axis] quick_dec_deg_s2): lower it, or ask for less damping"
    )


def end(machine: Machine, run: AxisRun, session: TuningSession) -> TuningSession:
    """The second half: measure what the drive has now.

    Raises:
        UsageError: the session belongs to another machine or drive, or Kpp is not the proposed one.
        AlarmStop: the axis was stopped.
    """
    drive = run.drive.identity().encoder_serial
    if (session.machine, session.drive) != (machine.name, drive):
        raise UsageError(
            f"the tuning under way is of {session.machine} with {session.drive}, this is {machine.name} with {drive}: "
            "--again begins anew"
        )
    wanted = session.proposal.kpp_per_s
    if abs(machine.control.kpp_per_s / wanted - 1.0) > 1e-3:
        raise UsageError(
            f"[control] kpp_per_s = {machine.control.kpp_per_s:g}, proposed are {wanted:g} /s: enter it in the machine "
            "file, or run with --config PROPOSAL; --again begins anew"
        )
    after = measured_drive(machine, run)
    return TuningSession(
        session.machine, session.drive, session.sensitivity_max, session.before, session.proposal, after
    )


def session_data(session: TuningSession) -> dict[str, Any]:
    """The session as JSON."""
    return {
        "machine": session.machine,
        "drive": session.drive,
        "sensitivity_max": session.sensitivity_max,
        "before": _figures_data(session.before),
        "proposal": asdict(session.proposal),
        "after": None if session.after is None else _figures_data(session.after),
        "checks": [_check_data(check) for check in session.checks],
        "passed": session.passed,
    }


def _check_data(check: Check) -> dict[str, Any]:
    # NaN is no JSON: where only a limit counts nothing is wanted.
    wanted = check.wanted if math.isfinite(check.wanted) else None
    return check._asdict() | {"wanted": wanted, "passed": check.passed}


def _figures_data(figures: DriveFigures) -> dict[str, Any]:
    return figures._asdict() | {"speed_loop": figures.speed_loop._asdict()}


def _figures(data: dict[str, Any]) -> DriveFigures:
    loop = data["speed_loop"]
    loads = tuple(HangingLoad(*load) for load in loop["loads"])
    return DriveFigures(SpeedLoop(**{**loop, "loads": loads}), data["sensitivity"], data["sensitivity_hz"])


def store_session(path: Path, session: TuningSession) -> None:
    """Keep the session, whole or not at all."""
    write_whole(path, json.dumps(session_data(session), indent=2, allow_nan=False) + "\n")


def load_session(path: Path) -> TuningSession | None:
    """The session that waits for its second half; None where none does.

    Raises:
        StateError: the file is damaged.
    """
    if not path.exists():
        return None
    try:
        data = json.loads(path.read_text(encoding="utf-8"))
        if data["after"] is not None:
            return None
        return TuningSession(
            data["machine"],
            data["drive"],
            data["sensitivity_max"],
            _figures(data["before"]),
            Gains(**data["proposal"]),
        )
    except (OSError, ValueError, KeyError, TypeError) as fault:
        raise StateError(
            f"{path}: the tuning under way cannot be read ({fault}); --again begins anew"
        ) from None
