"""The accuracy job on the simulator: chord test, noise, random gears and speed test into one report."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import ClassVar, Final

import numpy as np

from gantryctl.engineering.accuracy.budget import Budget, budget, procedure_figure, stop_times_s
from gantryctl.engineering.accuracy.procedure.measuring import InstrumentKind, measure
from gantryctl.engineering.accuracy.procedure.on_batch import Readings, random_gear, run_procedure
from gantryctl.engineering.accuracy.procedure.on_engine import Progress, run_on_engine
from gantryctl.engineering.accuracy.procedure.plan import chord_test, speeds_to_test
from gantryctl.engineering.accuracy.procedure.procedures import Procedure, evaluate
from gantryctl.engineering.accuracy.report.report import AccuracyReport, GearEnsemble
from gantryctl.engineering.accuracy.speed_test import speed_test
from gantryctl.engineering.accuracy.statistics import accuracy_a
from gantryctl.engineering.accuracy.table import FloatArray
from gantryctl.engineering.batch import expected
from gantryctl.engineering.instruments.sources import sources_of
from gantryctl.engineering.report.origin import origin_of
from gantryctl.engineering.scheduler.job import Rows
from gantryctl.engineering.scheduler.schedule import all_rows
from gantryctl.errors import UsageError
from gantryctl.machine import Machine, default_machine, is_reference_machine, required_angle, short_hash

_LEADS: Final = (
    "compensations are on: the motor leaves the set-point on purpose, so the motor side of the speed test is not "
    "judged; look at the load side"
)


@dataclass(frozen=True)
class AccuracyJob:
    """Order for one accuracy test.

    Attributes:
        seed: of the tracker's noise; random gears take `seed + 1`, `seed + 2`, ...
        ensemble: number of random gears of the same grade; 0 for none.
        with_speed_test: run the speed test as well. speeds_deg_s: of it; none for those of the machine.
        threads: for the ensemble; None = all processors.
        instrument: the measuring instrument.
        on_engine: drive the chord test scan by scan with the PLC program instead of the compiled loop.
        real_time: on the engine, paced by the clock.
    """

    procedure: Procedure
    seed: int = 0
    ensemble: int = 0
    with_speed_test: bool = True
    threads: int | None = None
    instrument: InstrumentKind = InstrumentKind.TRACKER
    on_engine: bool = False
    real_time: bool = False
    speeds_deg_s: tuple[float, ...] = ()

    def __post_init__(self) -> None:
        if self.ensemble < 0:
            raise UsageError(f"ensemble = {self.ensemble}: the number of gears is 0 or more")


def accuracy_report(
    machine: Machine,
    job: AccuracyJob,
    version: str,
    created: str = "",
    progress: Progress | None = None,
    gears: Callable[[int], None] | None = None,
) -> AccuracyReport:
    """Run the tests of a job and make its report.

    Args:
        progress: called at every stop of a run on the engine. gears: called with the number of gears of the ensemble
            that are done.
        version: of the program, for the page.
        created: a date for the page, or "".

    Raises:
        UsageError: a stop of the procedure lies outside the travel, or the axis does not have a speed of it.
    """
    # A speed that the axis cannot have must not end a test of a minute.
    speeds = speeds_to_test(machine, job.speeds_deg_s) if job.with_speed_test else ()
    # The compiled loop has no bus: a CAN machine is driven scan by scan.
    if job.on_engine or job.real_time or machine.on_bus:
        readings = run_on_engine(machine, job.procedure, real_time=job.real_time, progress=progress)
    else:
        readings = run_procedure([machine], job.procedure, threads=job.threads)
    speed = tuple(speed_test(machine, speeds)) if job.with_speed_test else ()
    radius_m = machine.accuracy.chord_radius_m
    seen = measure(machine, job.instrument, job.procedure, readings, job.seed)
    virtual = machine.virtual_axis
    return AccuracyReport(
        machine=machine.name,
        config_hash=short_hash(machine),
        version=version,
        seed=job.seed,
        source=seen.source,
        created=created,
        measured=seen.table,
        origin=origin_of(machine),
        required=required_angle(machine),
        dial=machine.axis.dial,
        of_reference=is_reference_machine(machine),
        measures_load=seen.measures_load,
        procedure=job.procedure,
        true=evaluate(job.procedure, readings.load_rad[0], radius_m) if seen.measures_load else None,
        a_measured=seen.a_measured,
        # True, measured and floor are kept apart: noise alone has an A of its own.
        a_floor=seen.a_floor,
        radius_m=radius_m,
        sigma_m=seen.sigma_m,
        dwell_s=machine.accuracy.dwell_s,
        average_s=machine.accuracy.average_s,
        vel_max_deg_s=machine.speed.setting_max_deg_s,
        acc_deg_s2=virtual.acc_deg_s2,
        angle_errors_deg=angle_errors_deg(job.procedure, readings) if seen.measures_load else None,
        settings=_settings(machine, readings),
        switches=machine.plant.switches.model_dump(),
        phases_fitted=phases_fitted(machine),
        speed=speed,
        ensemble=ensemble_a(machine, job, gears) if job.ensemble else None,
        notes=_notes(machine, speeds),
        budget=_budget(machine, job, readings),
    )


def _budget(machine: Machine, job: AccuracyJob, readings: Readings) -> Budget | None:
    """Of A as the instrument of the job sees it; a motor encoder has none, because it does not see the load."""
    if job.instrument is InstrumentKind.MOTOR_SIDE:
        return None
    accuracy, procedure = machine.accuracy, job.procedure
    if job.instrument is InstrumentKind.TRACKER:
        name, sources = (
            "laser tracker",
            sources_of("tracker", accuracy.chord_radius_m, accuracy.tracker_noise_um),
        )
    else:
        name, sources = "encoder on the ring", sources_of("ring-encoder")
    # A stop takes its share of the run; none is much longer.
    times = stop_times_s(len(procedure.stops), readings.axis_time_s / len(procedure.stops))
    figure = procedure_figure(procedure)
    return budget(name, figure, np.degrees(readings.load_rad[0]), times, sources, seed=job.seed)


def _notes(machine: Machine, speeds_deg_s: tuple[float, ...]) -> tuple[str, ...]:
    notes = [_LEADS] if machine.control.compensation.moves_motor else []
    top = machine.speed.setting_max_deg_s
    if speeds_deg_s and max(speeds_deg_s) < (1.0 - 1e-9) * top:
        notes.append(f"speed test up to {max(speeds_deg_s):g} deg/s: the highest setting is {top:g} deg/s")
    return tuple(notes)


def angle_errors_deg(procedure: Procedure, readings: Readings) -> tuple[float, ...]:
    """True load angle minus target at every stop, deg."""
    errors = np.degrees(readings.load_rad[0] - procedure.targets_rad)
    return tuple(float(e) for e in errors)


def phases_fitted(machine: Machine) -> bool:
    """True for the reference machine with the gear-error phases that were fitted to the paper's table."""
    # 18 phases fitted to the 24 values of table 2 that are not zero: closeness to the paper shows the fit, it
    # predicts nothing. What gears of this grade give is the ensemble.
    fitted = default_machine().plant.gear_error.phases_rad
    own = machine.plant
    return is_reference_machine(machine) and own.switches.gear_error and own.gear_error.phases_rad == fitted


def ensemble_a(
    machine: Machine, job: AccuracyJob, gears: Callable[[int], None] | None = None
) -> GearEnsemble:
    """A of the true angles for `job.ensemble` gears of the same grade with random phases."""
    found = all_rows(GearJob(machine, job.procedure, job.seed), job.ensemble, job.threads, gears)
    return GearEnsemble(
        tuple(found[_TRUE_A].tolist()), tuple(range(job.seed + 1, job.seed + 1 + job.ensemble))
    )


_TRUE_A: Final = "a_true_deg"


@dataclass(frozen=True)
class GearJob:
    """A of random gears in the machine; row k is the gear of `seed + 1 + k`."""

    machine: Machine
    procedure: Procedure
    seed: int

    # Two packs of the widest instruction set.
    pack: ClassVar[int] = 16

    def rows(self, first: int, count: int) -> Rows:
        """Column "a_true_deg"."""
        readings = run_procedure(self._gears(first, count), self.procedure, threads=1)
        return {_TRUE_A: np.array([self._true_a(row) for row in readings.load_rad])}

    def _gears(self, first: int, count: int) -> list[Machine]:
        """The machine with other gears, each with a calibration identified on that gear."""
        seeds = range(self.seed + 1 + first, self.seed + 1 + first + count)
        gears = [random_gear(self.machine, seed) for seed in seeds]
        if not self.machine.control.compensation.needs_calibration:
            return gears
        from gantryctl.engineering.identification import calibrate_each

        # A map of another gear would compensate errors that are not there (decision 0010: only what was
        # measured).
        found = expected(calibrate_each(gears, seeds))
        return [gear.calibrated(calibration) for gear, calibration in zip(gears, found, strict=True)]

    def _true_a(self, load_rad: FloatArray) -> float:
        table = evaluate(self.procedure, load_rad, self.machine.accuracy.chord_radius_m)
        return float(accuracy_a(table.errors_deg))


def _settings(machine: Machine, readings: Readings) -> dict[str, str]:
    control, loop = machine.control, machine.drive.speed_loop
    return {
        "profile": machine.virtual_axis.profile.replace("_", "-"),
        "position loop": f"Kpp {control.kpp_per_s:g} /s, Kvf {control.kvf:g}, every {control.scan_period_ms:g} ms",
        "speed loop": f"Kvp {loop.kvp_nm_s_per_rad:g} N m s/rad, Tvi {loop.tvi_ms:g} ms, every {loop.cycle_us:g} us",
        "length of the run": f"{readings.axis_time_s:.0f} s of axis time",
        "speed error in the test moves": (
            f"motor side {math.degrees(float(np.max(readings.vel_err_motor_rad_s))):.4f}, "
            f"load side {math.degrees(float(np.max(readings.vel_err_load_rad_s))):.4f} deg/s"
        ),
    }


def run_accuracy(
    machine: Machine, procedure: str = "A", *, ensemble: int = 0, seed: int = 0, speed_test: bool = True
) -> AccuracyReport:
    """The accuracy test for scripts and notebooks: chord procedure A, B, C or D on the simulated axis.

    Args:
        ensemble: number of gears with random phases to run beside it.
    """
    from importlib.metadata import version

    job = AccuracyJob(chord_test(machine, procedure), seed, ensemble, speed_test)
    return accuracy_report(machine, job, version("gantryctl"))
