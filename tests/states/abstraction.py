"""What of the program's state decides what it does next: one declared rule for every attribute of every object.

Two states with the same key have the same successors, because a rule leaves out only what the program cannot tell
apart, or never reads:

- *same*: the value itself. *number*: rounded far below every limit and far above the rounding of a double.
- *count*: scans that a condition has lasted. Every timer of these settings ends within `_CAP` scans, and counts are
  compared with "at least" only: above the cap two counts are the same.
- *part*: another object with rules, by its place in the walk, so that two names of one command stay one.
- *clock*: scan numbers, times, sequence numbers: kept with a state, not in its key, because only differences are read;
  a difference that matters has a rule by itself (a function).
- *shown*: outputs of the blocks, which nothing in the program reads again: kept, not in the key.
- *fixed*: settings and links to other parts, never set again. *unread*: texts and records for people.

That this is so is checked by running two states of one key side by side (`Exploration.twins`).
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from operator import attrgetter
from typing import Any, Final

from gantryctl.image import OperatorCommand
from gantryctl.program import Axis, GantryProgram, PowerPhase
from gantryctl.program.alarms.log import Alarm, AlarmLog
from gantryctl.program.axis.commands import MotionCommands
from gantryctl.program.axis.motion_command import MotionCommand
from gantryctl.program.blocks import BrakeTest as BrakeTestBlock
from gantryctl.program.blocks import (
    Halt,
    Inch,
    Jog,
    MoveAbsolute,
    MoveRelative,
    Power,
    Reset,
    SetOverride,
    Stop,
)
from gantryctl.program.feedback import Feedback
from gantryctl.program.monitors.drag import DragWatch
from gantryctl.program.monitors.interlocks import Interlocks
from gantryctl.program.monitors.liveness import Liveness
from gantryctl.program.monitors.monitors import Monitors
from gantryctl.program.monitors.oscillation import Oscillation
from gantryctl.program.monitors.recovery import Recovery, StopRecord
from gantryctl.program.monitors.site import SiteInterlocks
from gantryctl.program.monitors.thermal import MotorThermal
from gantryctl.program.monitors.torque import TorqueWatch
from gantryctl.program.power.brake_test import BrakeTest
from gantryctl.program.power.hold_watch import HoldWatch
from gantryctl.program.power.holding_torque import HoldingTorque
from gantryctl.program.power.phases import RISING
from gantryctl.program.power.ramp_watch import RampWatch
from gantryctl.program.power.rest import RestWatch
from gantryctl.program.power.sequence import PowerSequence
from gantryctl.program.power.slip_watch import SlipWatch
from gantryctl.program.power.wear import BrakeWear
from gantryctl.program.virtual_axis import VirtualAxis
from gantryctl.service.command.arming import Arming
from gantryctl.service.command.authority import Authority
from gantryctl.service.command.frame_clock import FrameClock
from gantryctl.service.command.inbox import CommandQueue, Inbox
from gantryctl.service.command.lease import HoldToRun
from gantryctl.service.command.operator import ServiceOperator
from gantryctl.service.command.permit import Permit
from gantryctl.service.command.round_trip import RoundTrip
from gantryctl.service.command.unheld import UnheldPower
from states.people import Now, Panel
from states.snapshot import names_of
from states.stub_drive import StubDrive

# No timer of the settings in `world.py` needs more scans than this (unloading: five steps).
_CAP: Final = 6
Special = Callable[[Any, "Roots"], object]


@dataclass(frozen=True)
class Roots:
    """The objects that a state consists of."""

    program: GantryProgram
    operator: Any
    drive: StubDrive
    now: object

    @property
    def all(self) -> tuple[object, ...]:
        return self.program, self.operator, self.drive, self.now

    @property
    def axis(self) -> Axis:
        return self.program.axis


@dataclass(frozen=True)
class Rules:
    """Rules of one class: attribute names by kind, and functions for the rest."""

    same: str = ""
    number: str = ""
    count: str = ""
    part: str = ""
    clock: str = ""
    shown: str = ""
    fixed: str = ""
    unread: str = ""
    special: Mapping[str, Special] = field(default_factory=dict)
    when: Special | None = None
    """Only then *same*, *number* and *count* are read before they are set anew."""

    def names(self) -> set[str]:
        kinds = (
            self.same,
            self.number,
            self.count,
            self.part,
            self.clock,
            self.shown,
            self.fixed,
            self.unread,
        )
        return {*" ".join(kinds).split(), *self.special}


def _rounded(value: float | None) -> float | None:
    if value is None or math.isnan(value):
        return None if value is None else math.inf
    return round(value, 4) + 0.0


def _unseen_s(watch: RampWatch, roots: Roots) -> object:
    """Read within the ramp only."""
    power = roots.axis.power
    if power.phase is not PowerPhase.QUICK_STOPPING:
        return None
    return _rounded(watch.unseen_s(power._count * power._period_s))


def _ref_target(virtual: VirtualAxis, _: Roots) -> object:
    """Read only when a motion under way is planned anew."""
    under_way = virtual.following and not virtual.stopping and (not virtual.at_rest or virtual.paused)
    return (_rounded(virtual._target), _rounded(virtual._speed)) if under_way else None


def _scans_left(virtual: VirtualAxis, roots: Roots) -> object:
    """Of the plan: where it ends, and how many scans later."""
    if not virtual.following or virtual.at_rest:
        return None
    period_s = roots.axis.settings.period_s
    left_s = virtual._duration - (roots.axis.scan - virtual.start_scan) * period_s
    return math.ceil(left_s / period_s - 1e-9), _rounded(virtual.plan.pos_end)


def _in_phases(name: str, *phases: PowerPhase) -> Special:
    """A number that only these phases read."""

    def rule(power: PowerSequence, _: Roots) -> object:
        return _rounded(getattr(power, name)) if power.phase in phases else None

    return rule


def _held(slip: SlipWatch, roots: Roots) -> object:
    """Way since the phase began."""
    return None if slip._from_rad is None else _rounded(slip._from_rad - roots.axis.pos_act_rad)


def _levels(name: str) -> Special:
    """Operator levels: of the lease only whether it is new counts."""

    def rule(holder: Any, roots: Roots) -> object:
        levels: OperatorCommand = getattr(holder, name)
        renewed = levels.lease == roots.operator.levels.lease
        # A target counts at the edge of `move` only.
        return levels._replace(
            lease=0, lease_age_s=0.0, target_rad=levels.target_rad if levels.move else 0.0
        ), renewed

    return rule


def _swing(oscillation: Oscillation, roots: Roots) -> object:
    """Side, turns and length of a swing; one that the next scan is too late for is forgotten."""
    scan = roots.axis.scan
    if not oscillation._side or scan + 1 - oscillation._scan > oscillation._half_scans:
        return None
    lasted = min(scan - oscillation._began, _CAP)
    return scan - oscillation._scan, oscillation._side, min(oscillation._turns, _CAP), lasted


def _since(name: str, cap: int = 4) -> Special:
    def rule(each: Any, roots: Roots) -> object:
        return min(roots.axis.scan - getattr(each, name), cap)

    return rule


_PROVEN: Final = RISING - {PowerPhase.ENABLING, PowerPhase.TESTING}
_RESTING: Final = (PowerPhase.OFF, PowerPhase.PARKED)
_BLOCK: Final = "error_id error_text"
_EXECUTE: Final = "_execute active attention busy"
_SHOWN: Final = "_final command_aborted done error"

RULES: Final[dict[type, Rules]] = {
    GantryProgram: Rules(
        same="_by_way _keys_dead _move_gate _remote mode service",
        number="_speed",
        count="_lease_age",
        part="axis power reset override stop halt move move_by jog inch brake_test",
        fixed="_lease_scans _without_switch trace_columns",
        special={"_last": _levels("_last")},
    ),
    Axis: Rules(
        same="_error _events _settled state system_stop",
        number="pos_act_rad pos_err_rad vel_cmd_rad_s",
        part="alarms brake_test feedback interlocks liveness monitors motion power recovery virtual _site thermal",
        clock="scan time_s refusal_count",
        fixed="_drives_against "
        "_law _park_scans _ratio _reference _torque_max _vel_max load_side plans settings turns zero_counts",
        unread="refusal",
        special={"_vel_next": lambda axis, _: _rounded(axis._vel_next) if axis.virtual.following else None},
    ),
    AlarmLog: Rules(
        same="horn pending",
        clock="pos_rad scan time_s",
        unread="history",
        special={
            "active": lambda log, _: frozenset((each.code, each.reaction) for each in log.active.values()),
            "first_out": lambda log, _: None if log.first_out is None else log.first_out.code,
        },
    ),
    Alarm: Rules(same="code reaction", clock="scan time_s pos_rad steps values follows consequences"),
    Feedback: Rules(
        same="_complains _doubtful _look _old _spread _was_energised brake_contact brake_open encoder_alarm "
        "error_code in_doubt inputs "
        "motor_temp_c periods state state_old "
        "torque_limited warning",
        number="overload pos_ring_rad torque_nm vel_rad_s",
        count="_gap_scans _gap_stands _inputs_age _late_age _speed_age age unchanged_scans",
        # With a scan of two seconds the sum of steps forgets in one, and without inertia any rest may be sudden.
        # `_rest` is what other attributes were taken from.
        clock="_drift _gap_counts _gap_vel _gap_way _rest _step _step_before _torque_left_nm _torque_twist_nm "
        "_turn_scan _turn_vel _uneven_scan _vel_before",
        fixed="_alarms _battery _change_base _change_max _drift_keep _drift_max _rests_after _stands_from _swing_nm "
        "_turn_base _turn_per_torque _twist_share _vel_max "
        "_change_any _change_per_torque "
        "_counts_per_rad _deviation_ms _error_scans _error_texts _errors_max _frozen_scans _frozen_speed _jump_base "
        "_jump_per_speed _old_scans _period_s _ratio _rest_rad_s read_rad",
        special={
            "_late_scan": _since("_late_scan"),
            "_let_go_scan": lambda each, roots: max(-1, each._let_go_scan - roots.axis.scan),
            "_speed_late_scan": _since("_speed_late_scan"),
            "_speed_scan": _since("_speed_scan"),
            "_bad_scans": lambda feedback, roots: tuple(
                min(roots.axis.scan - scan, 8) for scan in feedback._bad_scans
            ),
            "counts": lambda feedback, _: _rounded(feedback.counts / feedback._counts_per_rad),
        },
    ),
    VirtualAxis: Rules(
        same="at_rest changed following override paused stopping",
        number="acc_ref_rad_s2 pos_ref_rad vel_ref_rad_s",
        clock="_duration _sample _speed start_scan",
        fixed="_period_s _ramps _speed_max _travel keep_plans plans ramps",
        special={"_target": _ref_target, "plan": _scans_left},
    ),
    PowerSequence: Rules(
        same="_drive_owns_brake _parking _stood _turns_back _unloaded brake_open fault_reset phase request status",
        number="torque_ff_nm",
        part="_hold_watch _ramp _rest _slip brake_test holding wear",
        # Of the proof only the twist has a state, and these settings do not judge it.
        clock="_off_s _pos_rad _torque_proof _turns_rad_s _twist",
        fixed="_alarms _braced_scans _brake_stop _close_late_scans _close_scans _disabled_scans _disabling_scans "
        "_feedback _open_late_scans _period_s _power_up_scans _sag_scans _settings _slip_scans _step_scans",
        special={
            # Decided when ENABLING ends.
            "proof": lambda power, _: power.proof if power.phase in _PROVEN else None,
            # Behind the closed brake only a contact that is late and a watch of one scan are timed.
            "_count": lambda power, _: min(power._count, 3 if power.phase in _RESTING else _CAP),
            "_enabled_scans": lambda power, _: min(power._enabled_scans, power._braced_scans),
            "_load_nm": _in_phases("_load_nm", PowerPhase.UNLOADING),
        },
    ),
    RestWatch: Rules(count="_scans", fixed="_brake_rest_scans _feedback _rest_scans"),
    SlipWatch: Rules(
        same="_unwinding",
        count="_doubted_moving",
        special={"_from_rad": _held},
        fixed="_alarms _feedback _period_s _rest_scans _sag_max_rad",
    ),
    RampWatch: Rules(
        when=lambda _, roots: roots.axis.power.phase is PowerPhase.QUICK_STOPPING,
        number="_vel_start",
        same="_stands_early",
        count="_over_envelope",
        fixed="_envelope _feedback _period_s _quick_dec _rests",
        special={"_seen_s": _unseen_s},
    ),
    HoldWatch: Rules(
        when=lambda _, roots: roots.axis.power.phase is PowerPhase.TORQUE_HOLD,
        number="_speed_before",
        count="_driven _held",
        fixed="_alarms _feedback _moved_max_rad _period_s _test_torque_nm",
    ),
    HoldingTorque: Rules(
        same="believed",
        number="mean_nm preload_nm",
        special={
            "proof_nm": lambda holding, roots: (
                _rounded(holding.proof_nm) if roots.axis.power.phase in _PROVEN else None
            )
        },
        fixed="_learn _learn_max_nm _proof_least_nm _torque_max_nm",
    ),
    BrakeTest: Rules(
        same="outcome phase",
        number="_correction _mean _preload_nm on_brake_nm",
        count="_scans",
        clock="count minus_nm moved_rad plus_nm last words",
        fixed="_period_s _torque_max_nm level_nm moved_max_rad",
        when=lambda test, roots: test.under_way or roots.program.brake_test.busy,
        special={
            "_start_rad": lambda test, roots: (
                _rounded(test._start_rad - roots.axis.pos_act_rad)
                if test.under_way and test._start_rad is not None
                else None
            )
        },
    ),
    Interlocks: Rules(
        same="_code_known _inputs _some_open _was_minus _was_plus minus_open permitted plus_open",
        fixed="_alarms _feedback",
    ),
    SiteInterlocks: Rules(
        same="_inputs",
        count="_differ_count",
        # Chatter is switched off by these settings.
        clock="_collision _door _permit",
        fixed="_alarms _chatter_max _chatter_s _differ_scans _door_reaction _feedback _period_s",
    ),
    MotorThermal: Rules(
        same="_blind _hot",
        number="_bad_s _model share",
        clock="_due_s _last_s",
        fixed="_alarms _feedback _refusal _rise_max_c _time_constant_s _torque_rated_nm _warning",
    ),
    TorqueWatch: Rules(
        when=lambda _, roots: roots.axis.virtual.following,
        same="_pulled _suspicious",
        number="_fast_acc _fast_nm _free_acc _free_nm _last_nm _lost_nm _lost_rad_s _mean_nm _missing _pos_err_rad "
        "_vel_start",
        count="_blocked _grips _heavy _leap _lost",
        fixed="_alarms _blocked_scans _deviation_max _effort_nm "
        "_effort_share _fast_share _feedback _grip_nm _grips_scans _per_acc _virtual _heavy_nm _heavy_scans _holding "
        "_known _leap_nm _leap_scans _lost_scans "
        "_mean_share _missing_max _nothing_nm _off_nm _off_scans _period_s _rated_nm _rise_nm _start _swing_scans",
        special={
            "_off": lambda watch, _: min(watch._off, _CAP),
            "_plus_scan": _since("_plus_scan"),
            "_minus_scan": _since("_minus_scan"),
        },
    ),
    DragWatch: Rules(
        when=lambda _, roots: roots.axis.virtual.following,
        number="_mean_nm",
        count="_over _over_grip _over_halt _wait",
        # What it has learned is a number without end; `world.py` has one that learns nothing.
        fixed="_alarms _feedback _grip_nm _grips _halt_nm _holding _known _lasts _load_nm _mean_share _rated_nm "
        "_sample_scans _per_acc _virtual _warning_nm _wind_nm model",
    ),
    BrakeWear: Rules(
        # The limit of these settings is never reached.
        clock="energy_j stops",
        fixed="_alarms _before _energy_per_speed _feedback _most _slowest_rad_s",
    ),
    Oscillation: Rules(
        clock="_began _side _turns",
        fixed="_alarms _half_scans _lasts_scans _period_s limit_rad_s",
        special={"_scan": _swing},
    ),
    # By these settings a reading may stand without end, and the stub gives no torque against its motion.
    Liveness: Rules(
        clock="_at _counts _hangs_nm _held _jumped _scan _slowest _still _stood_nm _torque_nm _torque_scan _tries _vel "
        "dithers vel_rad_s",
        fixed="_after _alarms _back _counts_per_rad _feedback _half _hangs_scans _holding _patience _period_s "
        "_torque_against_nm _torque_full_nm _torque_scans _torque_still_nm _unproven",
    ),
    Monitors: Rules(
        part="_oscillation _torque_watch drag",
        # A speed off its command is judged on in a stop.
        when=lambda monitors, roots: roots.axis.virtual.following or monitors._deviation_count > 0,
        same="_at_rest _in_window in_position not_in_position",
        number="_commanded _error_at_saturation _over_travel_minus _over_travel_plus",
        count="_brake _deviation_count _dwell _following _overspeed _saturation _standstill rest_scans",
        fixed="_alarms _band_base _band_per_speed _brake_scans _deviation _deviation_scans _dwell_scans _feedback "
        "_following_scans _holding _lead_s _look_ahead _overspeed_scans _period_s _ratio _saturation_scans "
        "_settings _standstill_scans "
        "_swing_max _tolerance_scans _torque_max _travel _trip _virtual _warning_ratio _window",
    ),
    MotionCommands: Rules(
        same="_stop_execute brake_overdue switching_off",
        part="buffered current stop_command waiting",
        clock="scan",
        fixed="_alarms _interlocks _monitors _power _settings _virtual speed_max_rad_s",
        unread="_sign",  # of a modulo axis only
    ),
    MotionCommand: Rules(
        same="_status endless held settles state",
        part="follower",
        number="speed_rad_s target_rad",
        # The aim is read when a command begins; this program lets none wait for another motion.
        unread="aim dynamics",
        special={"refusal": lambda command, _: command.refusal is not None},
    ),
    Recovery: Rules(
        same="resetting service",
        count="_count",
        part="_record",
        fixed="_alarms _feedback _power _reset_scans _settings",
        special={"failure": lambda recovery, _: recovery.failure is not None},
    ),
    StopRecord: Rules(
        same="finished",
        clock="_angle_known _brake_scan _brake_unseen _counts _ramp_s _read_rad_s _slow_scan _speed_known "
        "_stands_scan _start_rad_s _switching_on _torque_scan _torque_unseen _turned _turning_rad_s _turning_scan "
        "_was_open _was_torque alarm",
        fixed="_brake_stop _log _period_s",
    ),
    Power: Rules(same="_enable _on", shown="error status", fixed="axis", unread=_BLOCK),
    Reset: Rules(same="_execute busy", shown="done error", fixed="axis", unread=_BLOCK),
    SetOverride: Rules(same="_asked", shown="enabled error", fixed="axis", unread=_BLOCK),
    Stop: Rules(same=_EXECUTE, shown=_SHOWN, part="_held command", fixed="axis", unread=_BLOCK),
    Halt: Rules(same=_EXECUTE, shown=_SHOWN, part="command", fixed="axis", unread=_BLOCK),
    MoveAbsolute: Rules(same=_EXECUTE, shown=_SHOWN, part="command", fixed="axis", unread=_BLOCK),
    MoveRelative: Rules(same=_EXECUTE, shown=_SHOWN, part="command", fixed="axis", unread=_BLOCK),
    Jog: Rules(
        same=_EXECUTE + " _backward _direction _forward _released",
        shown=_SHOWN + " at_limit",
        number="_speed",
        part="command",
        fixed="axis",
        unread=_BLOCK,
    ),
    Inch: Rules(
        same=_EXECUTE + " _backward _forward", shown=_SHOWN, part="command", fixed="axis", unread=_BLOCK
    ),
    BrakeTestBlock: Rules(
        same="_execute attention busy",
        shown=_SHOWN,
        fixed="axis",
        unread=_BLOCK + " minus_nm moved_rad phase plus_nm",
        special={"_tests": lambda block, roots: block.busy and block._tests == roots.axis.brake_test.count},
    ),
    ServiceOperator: Rules(
        same="_gap _test_ended hands_over shutdown",
        count="_stop_scans",
        part="_inbox arming authority frames hold permit unheld",
        clock="_acting _refusals",
        fixed="_acknowledge _keys _on_bus events now program ranges",
        unread="refusals",
        special={
            "levels": _levels("levels"),
            "_test_epoch": lambda operator, _: operator._test_epoch == operator.authority.epoch,
        },
    ),
    # Minutes, which no world of a few scans sees the end of: tests/unit/service/test_unheld_power.py does.
    UnheldPower: Rules(clock="_since_s", fixed="_authority _axis limit_s"),
    HoldToRun: Rules(
        same="client forward reverse",
        clock="_began_s _used count issued_s too_long",
        fixed="_scan_s lease_s",
        unread="ended",
        special={"_lease": lambda hold, _: bool(hold._lease)},
    ),
    Authority: Rules(same="holder", part="round_trip", clock="_alive_s epoch"),
    FrameClock: Rules(clock="issued_ms", fixed="_secret start_s"),
    # Everybody here names the newest frame: no press is refused for a slow connection.
    RoundTrip: Rules(clock="_samples"),
    Arming: Rules(
        fixed="second_person",
        special={
            # What is armed dies with its epoch.
            "_armed": lambda arming, roots: (
                None
                if arming._armed is None or arming._armed.epoch != roots.operator.authority.epoch
                else (arming._armed.action, arming._armed.step, arming._armed.who)
            )
        },
    ),
    Permit: Rules(same="reasons", clock="resets", fixed="_axis _events _journal"),
    Inbox: Rules(
        part="others",
        clock="_last_seq first gone time_s",
        fixed="_commands _replies events",
        unread="refusals",
    ),
    CommandQueue: Rules(
        clock="_count",
        special={
            "_waiting": lambda queue, _: tuple(
                (pending.who.client, pending.message.kind) for pending in queue._waiting
            )
        },
    ),
    StubDrive: Rules(
        same="brake_open faults race slipped standing state",
        number="pos_rad shown_rad_s vel_rad_s",
    ),
    Panel: Rules(special={"levels": _levels("levels")}),
    Now: Rules(clock="time_s"),
}


def kept(each: object) -> tuple[str, ...] | None:
    """Attributes of an object that belong to a state; None for an object that has no rules: a value."""
    rules = RULES.get(type(each))
    if rules is None:
        return None
    return tuple(sorted(rules.names() - set(f"{rules.fixed} {rules.unread}".split())))


def without_rule(roots: Roots) -> list[str]:
    """Attributes that no rule names, rules for attributes that are gone, and objects of a class without rules."""
    found: set[str] = set()
    seen: set[int] = set()
    waiting: list[object] = [*roots.all]
    while waiting:
        each = waiting.pop()
        if id(each) in seen or each is None:
            continue
        seen.add(id(each))
        rules, name = RULES.get(type(each)), type(each).__name__
        if rules is None:
            found.add(f"{name}: no rules for this class")
            continue
        has = set(names_of(each)) - {"_"}
        found |= {f"{name}.{one}: no rule" for one in has - rules.names()}
        found |= {f"{name}.{one}: a rule, but no such attribute" for one in rules.names() - has}
        waiting.extend(getattr(each, part) for part in rules.part.split() if part in has)
    return sorted(found)


def _all_of(names: list[str]) -> Callable[[Any], tuple[Any, ...]]:
    if len(names) > 1:
        return attrgetter(*names)
    if not names:
        return lambda _: ()
    get = attrgetter(*names)
    return lambda each: (get(each),)


class Compiled:
    """The rules of one class, ready for many objects; `known`: the numbers of values seen before."""

    __slots__ = ("known", "parts", "plain", "rules", "simple", "special", "when")

    def __init__(self, rules: Rules) -> None:
        self.rules, self.when = rules, rules.when
        self.plain = _all_of(f"{rules.same} {rules.number} {rules.count}".split())
        self.parts = _all_of(rules.part.split()) if rules.part else None
        self.special = tuple(rules.special.values())
        self.simple = self.when is None and not self.special
        self.known: dict[tuple[Any, ...], int] = {}


def _reduced(raw: tuple[Any, ...], rules: Rules) -> tuple[object, ...]:
    same, number = len(rules.same.split()), len(rules.number.split())
    numbers, counts = raw[same : same + number], raw[same + number :]
    return (raw[:same], tuple(map(_rounded, numbers)), tuple(min(count, _CAP) for count in counts))


class Keys:
    """Makes the key of a state: the walk over all parts, each object's own values as one small number."""

    def __init__(self, roots: Roots) -> None:
        self._roots = roots
        self._compiled: dict[type, Compiled] = {}
        self._values: dict[tuple[type, object], int] = {}
        self.texts: list[tuple[type, object]] = []

    def make(self) -> tuple[int, ...]:
        """Key of the state that the program is in now."""
        place: dict[int, int] = {}
        key: list[int] = []
        roots = self._roots
        waiting: list[Any] = [*roots.all]
        compiled = self._compiled
        while waiting:
            each = waiting.pop()
            if each is None:
                key.append(-1)
                continue
            at = place.get(id(each))
            if at is not None:
                key.append(-2 - at)
                continue
            place[id(each)] = len(place)
            one = compiled.get(type(each))
            if one is None:
                one = compiled[type(each)] = Compiled(RULES[type(each)])
            # Three of four: seen before, and nothing else decides. The call costs as much as the rest.
            number = one.known.get(one.plain(each)) if one.simple else None
            key.append(self._number(each, one) if number is None else number)
            if one.parts is not None:
                waiting.extend(one.parts(each))
        return tuple(key)

    def _number(self, each: Any, one: Compiled) -> int:
        cls, roots = type(each), self._roots
        if one.when is None or one.when(each, roots):
            raw = one.plain(each)
            number = one.known.get(raw)
            if number is None:
                number = one.known[raw] = self._interned(cls, _reduced(raw, one.rules))
        else:
            number = self._interned(cls, "nothing of it is read now")
        if not one.special:
            return number
        return self._interned(cls, (number, *[rule(each, roots) for rule in one.special]))

    def _interned(self, cls: type, values: object) -> int:
        number = self._values.get((cls, values))
        if number is None:
            number = self._values[cls, values] = len(self.texts)
            self.texts.append((cls, values))
        return number

    def differences(self, one: tuple[int, ...], other: tuple[int, ...]) -> list[str]:
        """Where two keys differ, in words."""
        return [f"{self._words(a)} | {self._words(b)}" for a, b in zip(one, other, strict=False) if a != b]

    def _words(self, number: int) -> str:
        if number < 0:
            return str(number)
        cls, values = self.texts[number]
        if isinstance(values, tuple) and values and isinstance(values[0], int):
            return f"{self._words(values[0])} {values[1:]}"
        return f"{cls.__name__} {values}"
