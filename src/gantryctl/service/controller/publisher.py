"""Status of the controller: the values of all tags, computed after a scan."""

from __future__ import annotations

import math
from collections import deque
from typing import Any, Final

from gantryctl.image import DriveState, Mode
from gantryctl.machine import Machine, is_reference_machine, short_hash
from gantryctl.machine.tables.axis import ENDS
from gantryctl.program import GantryProgram
from gantryctl.program.alarms.log import messages_to_wire
from gantryctl.program.axis.permission import why_no_torque
from gantryctl.runtime import Engine
from gantryctl.service.command.arming import Armed
from gantryctl.service.command.operator import ServiceOperator
from gantryctl.service.controller.alarm_view import AlarmView
from gantryctl.service.controller.brake_watch import BrakeWatch
from gantryctl.service.memory.memory import SharedMemory, Source, Word
from gantryctl.service.memory.snapshot import FAST, publish_fast, publish_json, rounded
from gantryctl.service.memory.trace_ring import RingRecorder
from gantryctl.service.protocol.limits import FRAME_S
from gantryctl.service.protocol.messages import SETTABLE, Identity
from gantryctl.service.protocol.tags import BY_NAME, CommissioningPhase
from gantryctl.units import deg

FAST_S: Final = 0.010
SLOW_S: Final = 1.0
# Window of the statistics: long enough for a quantile of 99 %, short enough to show what has just happened.
RECENT_S: Final = 10.0
_BUS_TAGS: Final = (
    "bus_missed", "bus_late", "bus_duplicated", "bus_wrong_length", "bus_contradicted", "bus_refused", "bus_others",
)  # fmt: skip
# A change of one is recorded with every scan before and after it.
SWITCHED: Final = tuple(name for name in FAST if BY_NAME[name].kind in ("bool", "enum"))


class Publisher:
    """Publishes the tags that are due after a scan.

    Args:
        real_time: the system granted scheduling and memory.
    """

    def __init__(
        self,
        machine: Machine,
        engine: Engine,
        operator: ServiceOperator,
        alarms: AlarmView,
        brake: BrakeWatch,
        recorder: RingRecorder,
        memory: SharedMemory,
        *,
        real_time: bool,
        version: str,
    ) -> None:
        assert isinstance(engine.program, GantryProgram)
        self._program, self._axis = engine.program, engine.program.axis
        self._machine, self._engine, self._operator = machine, engine, operator
        self._alarms, self._recorder, self._memory = alarms, recorder, memory
        self._brake = brake
        self._model = self._axis.monitors.drag.model
        self._fast_scans = max(1, round(FAST_S / engine.period_s))
        self._frame_scans = max(1, round(FRAME_S / engine.period_s))
        self._slow_scans = max(1, round(SLOW_S / engine.period_s))
        self._fixed = self._constant() | {"real_time": real_time, "version": version}
        self._before: deque[tuple[list[int], list[int]]] = deque(maxlen=round(RECENT_S / SLOW_S))
        self._statistics = self._timing()
        self._shown: tuple[object, ...] = ()
        self._switched_before: dict[str, float] = {}
        self._changes = 0
        self._scan = self._scan_before = engine.scan

    def scan(self) -> None:
        """Publish fast tags every 10 ms, changed ones with every frame, statistics every second."""
        self._scan_before, self._scan = self._scan, self._engine.scan
        self._alarms.scan()
        if self._due(self._fast_scans):
            tags = self.fast()
            publish_fast(self._memory.fast, tags, self._operator.frames.key)
            self._note_changes(tags)
        if self._due(self._frame_scans):
            self._publish_slow(self._due(self._slow_scans))
        # Alarm rows a scan later than the other tags: no scan carries both.
        elif self._due(self._frame_scans, 1) and self._alarms.changed:
            self._alarms.changed = False
            publish_json(self._memory.alarms, self._alarms.rows())

    def _note_changes(self, tags: dict[str, float]) -> None:
        """Tell the recording that a flag or a word has changed, or that the journal has a new event."""
        switched = {name: tags[name] for name in SWITCHED}
        if switched != self._switched_before:
            self._switched_before = switched
            self._changes += 1
        self._recorder.mark = self._changes + self._memory.events[Source.CONTROLLER].written

    def _due(self, scans: int, offset: int = 0) -> bool:
        """Whether so many scans have passed."""
        # Scan numbers jump where deadlines were missed, so a remainder would miss its turn.
        return (self._scan - offset) // scans != (self._scan_before - offset) // scans

    def _expected_nm(self) -> float:
        axis, virtual = self._axis, self._axis.virtual
        # With the power off the brake holds the load: nothing is expected of the motor.
        if not virtual.following:
            return math.nan
        return self._model.expected_nm(axis.pos_act_rad, virtual.vel_ref_rad_s, virtual.acc_ref_rad_s2)

    def _publish_slow(self, due: bool) -> None:
        operator = self._operator
        if due:
            self._statistics = self._timing()
        levels = operator.levels
        shown = (
            operator.authority.holder, self._program.mode, levels.speed_rad_s, levels.increment_rad,
            levels.override, self._axis.virtual.ramps.acc_rad_s2, self._blocked_by(),
            self._axis.refusal_count, self._armed(), operator.permit.reset_locked, self._brake.changed,
        )  # fmt: skip
        if due or shown != self._shown:
            self._changes += shown != self._shown
            self._shown = shown
            publish_json(self._memory.slow, self.slow())

    def fast(self) -> dict[str, float]:
        """The 20 Hz tags as numbers; not finite where they are unknown."""
        return {**self._moving(), **self._switched(), **self._counted(), **self._brake.fast()}

    def _moving(self) -> dict[str, float]:
        axis, engine = self._axis, self._engine
        virtual, feedback = axis.virtual, axis.feedback
        # Numbers of a reading that is in doubt, or too old, are not told: they become null.
        travel = axis.settings.travel
        pos = deg(travel.shown_rad(axis.pos_act_rad)) if feedback.position_valid else math.nan
        vel = feedback.vel_rad_s if feedback.speed_known and not feedback.in_doubt else math.nan
        monitors, limits = axis.settings.monitors, self._machine.axis
        # A motion without an end has no target, and none in time.
        end_rad = virtual.plan.pos_end if virtual.plan.vel_end == 0.0 else math.nan
        ref, low, high = deg(travel.shown_rad(virtual.pos_ref_rad)), limits.pos_min_deg, limits.pos_max_deg
        if travel.no_go_rad:
            stretch, ref_rad = travel.stretch(virtual.pos_ref_rad), virtual.pos_ref_rad
            low, high = ref + deg(stretch.low_rad - ref_rad), ref + deg(stretch.high_rad - ref_rad)
        elif travel.endless:
            low = high = math.nan
        quick_deg = deg(0.5 * vel * vel / axis.settings.ramps.quick_dec_rad_s2)
        widening_rad = monitors.following_error_per_speed_s * abs(virtual.vel_ref_rad_s)
        return {
            "pos_act_deg": pos,
            "vel_act_deg_s": deg(vel),
            "pos_ref_deg": ref,
            "vel_ref_deg_s": deg(virtual.vel_ref_rad_s),
            "acc_ref_deg_s2": deg(virtual.acc_ref_rad_s2),
            "vel_cmd_deg_s": deg(axis.vel_cmd_rad_s / axis.settings.law.ratio),
            "pos_err_deg": deg(axis.pos_err_rad),
            "torque_act_nm": feedback.torque_nm,
            "torque_expected_nm": self._expected_nm(),
            "overload": feedback.overload,
            "target_deg": deg(travel.shown_rad(end_rad)) if virtual.following else pos,
            "time_left_s": max(0.0, axis.plan_end_s - engine.time_s) if virtual.following else 0.0,
            # A quick stop has left the set-point, which stands.
            "stopping_angle_deg": deg(axis.stopping_angle_rad()) if virtual.following else quick_deg,
            "key_lost_angle_deg": deg(self._program.key_lost_angle_rad()),
            "quick_stop_angle_deg": quick_deg,
            "travel_left_minus_deg": math.nan if travel.endless else pos - low,
            "travel_left_plus_deg": math.nan if travel.endless else high - pos,
            "reach_min_deg": low,
            "reach_max_deg": high,
            "following_error_trip_deg": deg(monitors.following_error_base_rad + widening_rad),
        }

    def _switched(self) -> dict[str, float]:
        axis, operator, feedback = self._axis, self._operator, self._axis.feedback
        return {
            "axis_state": axis.state,
            "drive_state": DriveState.UNKNOWN if feedback.state_old else feedback.state,
            "power_phase": axis.power.phase.value,
            "power": axis.power.status,
            "brake_open": feedback.brake_open
            if feedback.brake_known or not feedback.brake_contact
            else math.nan,
            "brake_open_cmd": axis.power.brake_open,
            "horn": axis.alarms.horn,
            "at_rest": axis.at_rest,
            "in_position": axis.in_position,
            "torque_limited": feedback.torque_limited,
            "position_valid": feedback.position_valid and not operator.permit.doubts_position,
            "estop_ok": feedback.inputs.estop_ok,
            "enabling_switch": feedback.inputs.enabling_switch,
            "limit_minus_ok": feedback.inputs.limit_minus_ok,
            "limit_plus_ok": feedback.inputs.limit_plus_ok,
            "mains_ready": feedback.inputs.mains_ready,
            "collision_ok": fitted(feedback.inputs.collision_ok),
            "door_ok": fitted(feedback.inputs.door_ok),
            "motion_permit": fitted(feedback.inputs.motion_permit),
            "estop_ok_2": fitted(feedback.inputs.estop_ok_2),
        }

    def _blocked_by(self) -> tuple[object, ...]:
        """Why power would be refused: reasons of this run before those of the program."""
        permit, axis = self._operator.permit, self._axis
        if permit.blocked_by:
            return permit.blocked_by
        refused = why_no_torque(axis.feedback, axis.alarms)
        return () if refused is None else (refused.values["reason"],)

    def _armed(self) -> Armed | None:
        operator = self._operator
        return operator.arming.now(operator.authority.epoch, operator.now())

    def _counted(self) -> dict[str, float]:
        axis, engine, operator, memory = self._axis, self._engine, self._operator, self._memory
        events = memory.events[Source.CONTROLLER]
        now_s = operator.now()
        return {
            "issued_ms": operator.frames.issued_ms,
            "epoch": operator.authority.epoch,
            "scan": engine.scan,
            "time_s": engine.time_s,
            "lease_left_ms": operator.hold.left_s(now_s) * 1e3,
            "round_trip_ms": operator.authority.round_trip.shortest_s(now_s) * 1e3,
            "armed_left_s": operator.arming.left_s(operator.authority.epoch, now_s),
            "commissioning_left_s": math.nan,
            "unheld_power_left_s": operator.unheld.left_s(now_s),
            "alarm_count": len(axis.alarms.active),
            "refusal_count": axis.refusal_count,
            "feedback_age_ms": engine.image.drive.age_scans * engine.period_s * 1e3,
            "heartbeat_age_ms": self._heartbeat_age_ms(),
            "journal_sequence": events.written,
            "journal_committed": events.done,
            "journal_state": memory.words[Word.JOURNAL_STATE],
            "recording": self._recorder.number > 0 and not memory.words[Word.RECORDING_STOPPED],
        }

    def _heartbeat_age_ms(self) -> float:
        health = self._engine.drive.health()
        return math.nan if health is None else health.heartbeat_age_scans * self._engine.period_s * 1e3

    def _bus(self) -> dict[str, int | None]:
        """Telegrams and frames since the drive was set up."""
        health = self._engine.drive.health()
        if health is None:
            return dict.fromkeys(_BUS_TAGS)
        counts = (health.missed, health.late, health.duplicated, health.wrong_length, health.contradicted)
        return dict(zip(_BUS_TAGS, (*map(sum, counts), health.refused, health.unknown), strict=True))

    def slow(self) -> dict[str, Any]:
        """Everything else but the alarms, as JSON values."""
        operator, axis = self._operator, self._axis
        moment, angle = self._model.eccentric()
        blocked_by = self._blocked_by()
        return {
            **self._fixed,
            **self._statistics,
            **self._brake.slow(),
            **control_tags(
                operator.authority.holder, self._armed(), second_person=operator.arming.second_person
            ),
            "reset_locked": operator.permit.reset_locked,
            "mode": Mode(self._program.mode).name.lower(),
            **{tag: rounded(operator.setting(tag)) for tag in SETTABLE},
            "blocked_by": "; ".join(map(str, blocked_by)),
            "blocked_by_messages": messages_to_wire(*blocked_by),
            "eccentric_moment_nm": rounded(moment),
            "eccentric_angle_deg": rounded(deg(angle)),
            "refusal_text": f"{axis.refusal.code} · {axis.refusal.text}" if axis.refusal else "",
            "refusal_messages": messages_to_wire(axis.refusal) if axis.refusal else [],
        }

    def _constant(self) -> dict[str, Any]:
        """Tags that never change while the controller runs."""
        machine, ranges = self._machine, self._operator.ranges
        motor = machine.motor
        cap_rad_s = self._axis.settings.speed.without_enabling_switch_rad_s
        speed, acc = ranges["speed_setting_deg_s"], ranges["acc_setting_deg_s2"]
        return {
            **machine_tags(machine),
            "commissioning_available": machine.on_bus,
            "commissioning": CommissioningPhase.NONE.name.lower(),
            "commissioning_step": "",
            "commissioning_results": 0,
            "speed_min_deg_s": speed.low,
            "speed_max_deg_s": speed.high,
            "speed_cap_deg_s": rounded(deg(cap_rad_s)),
            "quick_dec_deg_s2": rounded(deg(self._axis.settings.ramps.quick_dec_rad_s2)),
            "acc_min_deg_s2": rounded(acc.low),
            "acc_max_deg_s2": acc.high,
            "increment_max_deg": ranges["increment_deg"].high,
            "torque_rated_nm": motor.torque_rated_nm,
            "torque_max_nm": motor.torque_max_nm,
            "moment_max_nm": motor.torque_max_nm * machine.axis.ratio,
        }

    def _timing(self) -> dict[str, Any]:
        """Scan statistics: counts and the latest scan since the start, the rest over `RECENT_S`."""
        found, top = self._engine.statistics, self._machine.speed.setting_max_deg_s
        late = found.lateness
        before = self._before[0] if self._before else ([0] * len(late.counts), [0] * len(late.counts))
        recent, run = late.since(before[0]), found.run_time.since(before[1])
        self._before.append((list(late.counts), list(found.run_time.counts)))
        p99_s = recent.quantile_s(0.99)
        return {
            "scan_period_ms": rounded(found.period_s * 1e3),
            "scan_lateness_p50_us": rounded(recent.quantile_s(0.5) * 1e6),
            "scan_lateness_p99_us": rounded(p99_s * 1e6),
            "scan_lateness_max_us": rounded(late.worst_s * 1e6),
            "scan_lateness_p99_deg": rounded(p99_s * top),
            "scan_lateness_max_deg": rounded(late.worst_s * top),
            "scan_run_p50_us": rounded(run.quantile_s(0.5) * 1e6),
            "scan_run_p99_us": rounded(run.quantile_s(0.99) * 1e6),
            "scan_overruns": found.overruns,
            "scan_skipped": found.skipped,
            "trace_rows_lost": self._recorder.lost,
            "events_lost": self._operator.events.lost,
            **self._bus(),
        }


def machine_tags(machine: Machine) -> dict[str, Any]:
    """Tags that tell which machine this is, whoever has its axis."""
    axis = machine.axis
    return {
        "machine": machine.name,
        "axis_kind": axis.kind,
        "display": axis.display,
        "no_go_deg": axis.no_go_deg,
        "drawing": "couch" if is_reference_machine(machine) else "axis",
        "drive_kind": machine.drive.kind,
        "config_hash": short_hash(machine),
        "pos_min_deg": axis.pos_min_deg,
        "pos_max_deg": axis.pos_max_deg,
        # A modulo axis has no ends.
        **{key: None if axis.modulo else getattr(axis, key) for key in ENDS},
    }


def control_tags(holder: Identity | None, armed: Armed | None, *, second_person: bool) -> dict[str, Any]:
    """Tags of who has control, and who has armed what."""
    return {
        "authority_user": holder.user if holder else "",
        "authority_client": holder.client if holder else "",
        "authority_local": bool(holder and holder.local),
        "armed_action": str(armed.action) if armed else "none",
        "armed_step": armed.step if armed else "",
        "armed_by": armed.who.user if armed else "",
        "armed_person": armed.who.person if armed else "",
        "armed_client": armed.who.client if armed else "",
        "second_person": second_person,
    }


def fitted(value: bool | None) -> float:
    """An input as a number; nan, which is null on the wire, where the machine does not have it."""
    return math.nan if value is None else value
