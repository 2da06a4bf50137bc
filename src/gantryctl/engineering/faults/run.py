"""Run one fault: bring the axis into its phase, inject, watch the true plant until it stands, judge."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Final, Literal, NamedTuple

import numpy as np

from gantryctl.engineering.faults.bench import (
    BrakeOwner,
    FaultBench,
    FaultLog,
    bench_machine,
    way_to_cruise_deg,
)
from gantryctl.engineering.faults.case import FaultCase, Phase, ReactionClass
from gantryctl.engineering.faults.injection import finite
from gantryctl.engineering.faults.limits import limit_deg, reaction_of
from gantryctl.errors import UsageError
from gantryctl.machine import Machine, configs_folder, default_machine, load_machine, with_values
from gantryctl.machine.places import heaviest_deg, reach_deg
from gantryctl.program.alarms.log import Alarm
from gantryctl.program.alarms.words import Said, Words
from gantryctl.units import deg
from gantryctl.wiring.program import ramps_deg

DriveKind = Literal["sim", "bus"]
# Gravity of the mass that the eccentric moment is given by.
_G: Final = 9.81
_MOMENT_MAX_KNM: Final = 1e5
# An axis whose fault stops nothing goes on for so long behind the place, if its travel is long enough.
_GOES_ON_S: Final = 4.0
_SPARE_DEG: Final = 0.1
_BEFORE_S: Final = 0.3
_WATCH_S: Final = 2.0
_LONGEST_S: Final = 12.0
# A told angle may be this far from the true one (motor side).
TOLD_DEG: Final = 0.05
# Of the highest speed: below the first the motor stands, above the second it has left its motion.
_AT_REST_SHARE: Final = 1.0 / 120.0
_DEVIATION_SHARE: Final = 1.0 / 60.0
_STOPS: Final = (
    ReactionClass.QUICK_STOP,
    ReactionClass.DRIVE_DEADLINE,
    ReactionClass.TORQUE_OFF,
    ReactionClass.FEEDBACK,
    ReactionClass.STANDSTILL,
    ReactionClass.BRAKE_SLIP,
)


class Moment(NamedTuple):
    """An alarm, and when it came."""

    time_s: float
    code: str


@dataclass(frozen=True, slots=True)
class FaultResult:
    """What a fault led to. Angles at the gantry; the true ones are of the motor.

    Attributes:
        way_deg: farthest from the angle at the onset; limit_deg: permitted.
        rest_s: from the onset until the motor stands; infinite when it does not.
        vel_peak_deg_s: fastest true speed after the onset.
        first_out: code of the alarm that stopped the axis, "" for none; codes: all alarms after the onset.
        told_deg, true_deg: at the end. position_valid: the told one is said to be valid.
        enables: times at which the drive was enabled after the first alarm.
        held: the load is held by torque at the end.
        texts: the alarms in words. moments: the alarms by time.
        faults: what is against the case; () when everything is as it must be.
    """

    number: str
    kind: DriveKind
    brake_owner: str
    scan_ms: float
    speed_deg_s: float
    angle_deg: float
    onset_s: float
    way_deg: float
    limit_deg: float
    rest_s: float
    vel_peak_deg_s: float
    first_out: str
    codes: tuple[str, ...]
    told_deg: float
    true_deg: float
    position_valid: bool
    enables: int
    held: bool
    texts: tuple[str, ...]
    moments: tuple[Moment, ...]
    faults: tuple[str, ...]
    log: FaultLog

    @property
    def ok(self) -> bool:
        """Everything is as it must be."""
        return not self.faults


class Conditions(NamedTuple):
    """Where, how fast and under what a fault is run.

    Attributes:
        speed_deg_s: of phases in motion, and of the first move; its sign is the direction.
        angle_deg: where the fault begins. scan_ms: scan period. eccentric_knm: eccentric moment of the load.
    """

    speed_deg_s: float
    angle_deg: float
    scan_ms: float
    eccentric_knm: float


def conditions_of(machine: Machine, speed_deg_s: float | None = None) -> Conditions:
    """What a fault is run under where nobody says otherwise: the highest speed, and the place of the largest eccentric
    moment from which run-up and stop fit into the travel.
    """
    speed = machine.speed.setting_max_deg_s if speed_deg_s is None else speed_deg_s
    low, high = reach_deg(machine)
    quick = with_values(machine, bench_machine(machine, speed))
    before, ramp = way_to_cruise_deg(quick, speed), speed * speed / (2.0 * quick.virtual_axis.dec_deg_s2)
    left = high - low - abs(before) - 2.0 * _SPARE_DEG
    after = math.copysign(min(_GOES_ON_S * abs(speed) + ramp, max(left, 0.0)), speed)
    least, most = (low + before, high - after) if speed > 0.0 else (low - after, high + before)
    return Conditions(
        speed_deg_s=speed,
        angle_deg=min(max(heaviest_deg(machine)[0], least + _SPARE_DEG), most - _SPARE_DEG),
        scan_ms=machine.control.scan_period_ms,
        eccentric_knm=1e-3 * machine.plant.load.eccentric_moment_nm,
    )


def base_machine(kind: DriveKind, *, beside: bool = False) -> Machine:
    """The reference gantry on the simulator or on its bus; `beside`: with the nodes beside its drive."""
    if kind == "sim":
        return default_machine()
    return load_machine(configs_folder() / ("hust_can_nodes.toml" if beside else "hust_can.toml"))


def fault_machine(
    machine: Machine | None,
    kind: DriveKind,
    speed_deg_s: float,
    scan_ms: float,
    brake_owner: BrakeOwner = "drive",
    eccentric_knm: float | None = None,
    *,
    beside: bool = False,
) -> Machine:
    """Machine for a run: the reference gantry on the simulator or on its bus, unless another one is given.

    Args:
        eccentric_knm: another eccentric moment than the machine's.
        beside: with the nodes beside its drive. The brake is an output of the I/O node then, whoever owns it else.

    Raises:
        ConfigError: a machine file with these values is refused.
        UsageError: a value that is no number of its range.
    """
    if machine is None:
        machine = base_machine(kind, beside=beside)
    if machine.on_bus is not (kind == "bus"):
        raise UsageError(
            f'{machine.name} has [drive] kind = "{machine.drive.kind}": {"leave out" if kind == "bus" else "add"} --bus'
        )
    top = machine.speed.setting_max_deg_s
    if finite(speed_deg_s, "speed in deg/s", -top, top) == 0.0:
        raise UsageError("speed in deg/s must not be 0")
    values: dict[str, object] = {
        **bench_machine(machine, speed_deg_s),
        "control.scan_period_ms": float(scan_ms),
    }
    if eccentric_knm is not None:
        moment_nm = 1e3 * finite(eccentric_knm, "eccentric moment in kN m", 0.0, _MOMENT_MAX_KNM)
        values["plant.load.eccentricity_m"] = moment_nm / (machine.plant.load.mass_kg * _G)
    if kind == "bus":
        # Three quarters of a scan at most.
        answer_ms = min(machine.can.answer_ms, 0.5 * scan_ms)
        values |= {"can.commissioning_required": False, "can.answer_ms": answer_ms}
        # Inputs that not every machine has: bits of the I/O node, or those of the virtual drive.
        if beside:
            io = machine.can.io
            if io.node and max(machine.can.inputs.estop_ok_2, io.inputs.estop_ok_2) < 0:
                values["can.io.inputs.estop_ok_2"] = 1 + max(io.inputs.model_dump().values())
        else:
            values |= {
                "brake.owner": brake_owner,
                "can.inputs.collision_ok": 20,
                "can.inputs.door_ok": 21,
                "can.inputs.estop_ok_2": 22,
            }
    return with_values(machine, values)


@dataclass(frozen=True, slots=True)
class FaultRun:
    """A case, and what it is run on and under.

    Attributes:
        machine: the reference gantry when not given.
        kind: the simulated drive in process, or the virtual drive behind a bus.
        beside: with the nodes beside its drive, also for a case that is of none of them.
        speed_deg_s, angle_deg, scan_ms, eccentric_knm: see `Conditions`; those of the machine where not given.
    """

    case: FaultCase
    machine: Machine | None = None
    kind: DriveKind = "sim"
    brake_owner: BrakeOwner = "drive"
    beside: bool = False
    speed_deg_s: float | None = None
    angle_deg: float | None = None
    scan_ms: float | None = None
    eccentric_knm: float | None = None


def run_fault(run: FaultRun) -> FaultResult:
    """Run one case in virtual time, on the engine and the program of the product.

    Raises:
        UsageError: the case is not for this drive, or the sound axis does not reach the phase.
        ConfigError: a machine with these values is refused.
    """
    case, kind = run.case, run.kind
    if kind not in case.buses:
        needed = "a drive on a bus: --bus" if kind == "sim" else "the simulated drive"
        raise UsageError(f"{case.number} '{case.title}' needs {needed}")
    beside = run.beside or case.beside
    base = run.machine or base_machine(kind, beside=beside)
    usual = conditions_of(base, run.speed_deg_s)
    speed_deg_s, angle_deg = usual.speed_deg_s, usual.angle_deg if run.angle_deg is None else run.angle_deg
    built = fault_machine(
        base,
        kind,
        speed_deg_s,
        usual.scan_ms if run.scan_ms is None else run.scan_ms,
        run.brake_owner,
        run.eccentric_knm,
        beside=beside,
    )
    axis = built.axis
    angle_deg = finite(angle_deg, "angle in deg", axis.pos_min_deg, axis.pos_max_deg)
    bench = FaultBench(built, case.phase, speed_deg_s, angle_deg)
    try:
        bench.reach()
        before = _Before(len(bench.axis.alarms.history), bench.axis.refusal_count)
        bench.record()
        if not case.phase.moves:
            bench.run_for(_BEFORE_S)
        bench.inject(case.injections)
        bench.go_on()
        _watch(bench, case)
        return _judged(case, bench, before, kind, speed_deg_s, angle_deg)
    finally:
        bench.close()


def _watch(bench: FaultBench, case: FaultCase) -> None:
    if bench.target.silent or (case.judged and case.reaction in (ReactionClass.WARNING, ReactionClass.NONE)):
        bench.run_for(3.0)
        return
    axis = bench.axis

    def over() -> bool:
        # A load that nothing holds may begin to move as slowly as friction lets it: it is told, or it stands for good.
        told = case.rests or any(alarm.code is case.also for alarm in axis.alarms.history)
        return bench.target.silent or (bench.onset_s is not None and bench.settled and told)

    bench.until(over, _LONGEST_S)
    bench.run_for(_WATCH_S)


class _Before(NamedTuple):
    """How many alarms and refusals there were before the fault."""

    alarms: int
    refusals: int


def _judged(
    case: FaultCase,
    bench: FaultBench,
    before: _Before,
    kind: DriveKind,
    speed_deg_s: float,
    angle_deg: float,
) -> FaultResult:
    axis, log, machine, offset_deg = bench.axis, bench.log(), bench.machine, bench.offset_deg
    time_s, pos, vel = log["time_s"], log["pos_deg"], log["vel_deg_s"]
    onset_s = bench.onset_s if bench.onset_s is not None else math.nan
    begin = int(np.searchsorted(time_s, onset_s - 1e-9)) if math.isfinite(onset_s) else 0
    begin = min(begin, len(time_s) - 1)
    top = machine.speed.setting_max_deg_s
    start_deg, counted = pos[begin], begin
    if case.from_deviation:
        # The program's own ramp to the target is no deviation: with torque that is still enough the axis comes there.
        # Further away its set-point proves nothing: one that follows an axis which gives way would hide the deviation.
        least = _DEVIATION_SHARE * top
        obeys = np.abs(vel[begin:] - log["ref_deg_s"][begin:]) <= least
        if case.phase is Phase.CRUISE:
            target_deg = deg(bench.target.operator.command.target_rad) - offset_deg
            obeys &= np.abs(pos[begin:] - target_deg) <= ramps_deg(machine, abs(speed_deg_s))
        away = np.nonzero((np.abs(vel[begin:] - vel[begin]) > least) & ~obeys)[0]
        counted = begin + int(away[0]) if len(away) else len(pos) - 1
        start_deg = pos[counted]
    alarms = list(axis.alarms.history)[before.alarms :]
    # Where nothing is left that could hold the load, it is told in time.
    told_s = min((alarm.time_s for alarm in alarms), default=math.inf) if not case.rests else math.inf
    judged = slice(counted, max(counted + 1, int(np.searchsorted(time_s, told_s))))
    way = float(np.max(np.abs(pos[judged] - start_deg)))
    moving = np.nonzero(np.abs(vel[begin:]) > _AT_REST_SHARE * top)[0]
    rests = not len(moving) or begin + int(moving[-1]) < len(vel) - 1
    rest_s = float((moving[-1] + 1) * 1e-3) if len(moving) else 0.0
    first = axis.alarms.first_out
    refusal = axis.refusal
    refused = () if refusal is None or axis.refusal_count == before.refusals else (refusal.code.value,)
    first_out = first.code.value if first is not None else ""
    speed = abs(speed_deg_s) if case.phase.moves else 0.0
    limit = limit_deg(machine, reaction_of(machine, case, case.injections), speed, case.seen_by)
    true_deg = bench.pos_deg + offset_deg
    result = FaultResult(
        number=case.number,
        kind=kind,
        brake_owner=machine.brake.owner,
        scan_ms=machine.control.scan_period_ms,
        speed_deg_s=speed_deg_s,
        angle_deg=angle_deg,
        onset_s=onset_s,
        way_deg=way,
        limit_deg=limit,
        rest_s=rest_s if rests else math.inf,
        vel_peak_deg_s=float(np.max(np.abs(vel[begin:]))),
        first_out=first_out,
        codes=tuple(dict.fromkeys([*(alarm.code.value for alarm in alarms), *refused])),
        told_deg=deg(axis.pos_act_rad),
        true_deg=true_deg,
        position_valid=axis.feedback.position_valid,
        enables=bench.enables,
        held=bench.enabled,
        texts=tuple(alarm.text for alarm in alarms),
        moments=tuple(Moment(alarm.time_s, alarm.code.value) for alarm in alarms),
        faults=(),
        log=log,
    )
    return replace(result, faults=tuple(_against(case, bench, result, alarms, offset_deg)))


def _against(
    case: FaultCase, bench: FaultBench, result: FaultResult, alarms: list[Alarm], offset_deg: float
) -> list[str]:
    """What is against the case."""
    wrong: list[str] = []
    if not math.isfinite(result.onset_s):
        return ["the fault was never injected: its moment did not come"]
    if not case.judged:
        return []
    if case.from_deviation and result.way_deg == 0.0 and not alarms:
        # The axis needs less torque than is left, and does what it is told.
        return wrong
    if not result.way_deg <= result.limit_deg:
        wrong.append(f"moved {result.way_deg:.3f} deg, permitted {result.limit_deg:.3f}")
    if case.rests and case.reaction in _STOPS and not math.isfinite(result.rest_s):
        wrong.append("the load still moves")
    held = case.reaction is ReactionClass.BRAKE_SLIP or not case.rests
    if held and result.way_deg <= bench.machine.brake.sag_max_deg and not alarms:
        # Friction holds the load, so nothing slips.
        return wrong
    if not bench.target.silent:
        wrong += _told(case, bench.machine, result, alarms, offset_deg)
        if result.enables > int(case.hold):
            wrong.append(f"the drive was enabled {result.enables} times after the alarm; nobody asked for it")
    return wrong


def _told(
    case: FaultCase, machine: Machine, result: FaultResult, alarms: list[Alarm], offset_deg: float
) -> list[str]:
    """What the operator reads and is not true."""
    wrong, codes = [], case.codes_on(machine)
    # A reaction shows as the first alarm that stopped, a warning as any.
    seen = (result.first_out,) if case.reaction in _STOPS else result.codes
    if codes and not set(seen) & set(codes):
        told = " ".join(result.codes) or "nothing"
        expected = "/".join(codes)
        wrong.append(f"told {told}, first {result.first_out or '-'}; expected {expected}")
    if case.also is not None and case.also not in result.codes:
        wrong.append(f"told {' '.join(result.codes) or 'nothing'}; {case.also} should have come")
    if not codes and result.first_out:
        wrong.append(f"stopped by {result.first_out}; nothing should have")
    if case.position_valid is not None and result.position_valid is not case.position_valid:
        wrong.append(f"the position is told to be {'valid' if result.position_valid else 'not valid'}")
    # What is told belongs to the beginning of the scan, what is true to its end.
    moved_deg = 0.0 if math.isfinite(result.rest_s) else abs(result.speed_deg_s) * result.scan_ms * 1e-3
    if result.position_valid and not abs(result.told_deg - result.true_deg) <= TOLD_DEG + moved_deg:
        wrong.append(f"told {result.told_deg:.3f} deg, true {result.true_deg:.3f}")
    for alarm in alarms:
        for said in alarm.steps:
            if isinstance(said, Said) and said.words is Words.MOVED_TO:
                # Within the turn that people read: whole turns are no difference.
                told_deg = float(str(said.values["position"]))
                at_rest_deg = _true_at_rest(result, offset_deg)
                if not abs(math.remainder(told_deg - at_rest_deg, 360.0)) <= TOLD_DEG:
                    wrong.append(f"{alarm.code} tells {told_deg:.3f} deg at rest, true {at_rest_deg:.3f}")
    return wrong


def _true_at_rest(result: FaultResult, offset_deg: float) -> float:
    """True angle where the motor came to rest."""
    log = result.log
    if not math.isfinite(result.rest_s):
        return float(log["pos_deg"][-1]) + offset_deg
    at = int(np.searchsorted(log["time_s"], result.onset_s + result.rest_s))
    return float(log["pos_deg"][min(at, len(log["pos_deg"]) - 1)]) + offset_deg
