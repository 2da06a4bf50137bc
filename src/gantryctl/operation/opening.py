"""One machine from power-on to power-off: opened with its retained memory, judged, given a program, and closed.

The command line, the service and commissioning all open and close a machine here.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from typing import NamedTuple

from gantryctl.errors import StateError, UsageError
from gantryctl.image import DriveFeedback, DriveIdentity
from gantryctl.machine import Machine, config_hash
from gantryctl.operation.brake_policy import LOCKED, restore_failure, restore_learned
from gantryctl.operation.home_reference import (
    ACCEPTED_DEG,
    SHOWN_DEG,
    AbsoluteReading,
    EncoderScale,
    judge_reference,
    why_not_referenced,
)
from gantryctl.operation.ledger.judging import speed_max_deg_s
from gantryctl.operation.ledger.kept_facts import facts_path, store_facts
from gantryctl.operation.proofs import bus_reasons, ledger_notes, ledger_of, own_ramp_deg_s2
from gantryctl.operation.run_memory import RunEnd, retained_after
from gantryctl.operation.store import StateStore, now_text
from gantryctl.ports import Drive
from gantryctl.program import AxisProgram, Code, GantryProgram
from gantryctl.program.alarms.reason import ClearedBy, Reason
from gantryctl.program.axis.turns import Turns
from gantryctl.runtime import AlarmEntry, Engine, Retained
from gantryctl.units import deg
from gantryctl.wiring.engine import ProgramFactory, build_program, drive_of


class OpenMachine(NamedTuple):
    """The drive of a machine and what the controller remembers of it.

    Attributes:
        feedback: what the drive showed when it was opened.
        reading: the encoder's part of it, compared with the retained memory.
        notes: what had to be done to open it, in words.
    """

    drive: Drive
    retained: Retained
    feedback: DriveFeedback
    scale: EncoderScale
    reading: AbsoluteReading
    notes: tuple[str, ...] = ()


class OpenAxis(NamedTuple):
    """An open machine with a program on its axis, power off.

    Attributes:
        reasons: why power cannot be switched on, the gravest first; () when nothing is wrong.
        speed_max_deg_s: highest speed setting in force: of the machine file, or of the ledger where that is lower.
        quick_dec_deg_s2: deceleration of a quick stop: the measured one of a drive with a ramp of its own.
    """

    drive: Drive
    retained: Retained
    reading: AbsoluteReading
    program: AxisProgram
    notes: tuple[str, ...]
    reasons: tuple[Reason, ...]
    speed_max_deg_s: float
    quick_dec_deg_s2: float


# --- opening --------------------------------------------------------------------------------------------------


def open_axis(
    machine: Machine,
    store: StateStore | None,
    *,
    program: ProgramFactory = GantryProgram,
    commissioning: bool = False,
    controlled_as: Machine | None = None,
) -> OpenAxis:
    """Open the machine as the last run left it, judge it, and put a program on its axis.

    Args:
        store: the state directory, locked by the caller; None for a new machine that is forgotten afterwards.
        commissioning: a CAN machine needs no commissioning record, because it is being made.
        controlled_as: the machine by whose control and profile the axis runs; `machine` itself when not given.

    Raises:
        StateError: retained memory or plant cannot be used. DeviceError: a drive on a bus cannot be reached.
    """
    found = open_machine(machine, store)
    with left_on_failure(found.drive):
        reasons = _reasons(found, bus_reasons(machine, store, found.drive, commissioning=commissioning))
        retained, notes = _with_accepted_motion(found, reasons)
        # Memory of this machine file from here on. Not at each power-off: the hash takes 0.4 ms of a scan.
        retained = replace(retained, config_hash=config_hash(machine))
        rows = ledger_of(machine, store, found.drive)
        top = min(each.speed.setting_max_deg_s for each in (machine, controlled_as or machine))
        fastest = min(top, speed_max_deg_s(rows))
        notes = (*notes, *ledger_notes(machine, rows), *_calibration_notes(controlled_as or machine))
        own_ramp = None if store is None else own_ramp_deg_s2(machine, store.directory)
        made = build_program(
            controlled_as or machine,
            found.drive,
            program,
            zero_counts=_zero_counts(found),
            holding_torque_nm=retained.holding_torque_nm or 0.0,
            speed_max_deg_s=fastest,
            quick_dec_deg_s2=own_ramp,
        )
    restore_failure(made.axis, retained)
    restore_learned(made.axis, retained)
    # A reading in doubt is not sound because the power was off meanwhile: service compares the angle.
    made.axis.feedback.in_doubt = bool(retained.doubted_by)
    quick_dec = deg(made.axis.settings.ramps.quick_dec_rad_s2)
    return OpenAxis(found.drive, retained, found.reading, made, notes, reasons, fastest, quick_dec)


def _calibration_notes(machine: Machine) -> tuple[str, ...]:
    """What of a calibration in use is not watched."""
    if machine.calibration is None:
        return ()
    from gantryctl.wiring.calibration_watch import (
        what_is_not_watched,
    )  # a machine without a calibration loads none

    return what_is_not_watched(machine)


def open_machine(machine: Machine, store: StateStore | None, *, read_only: bool = False) -> OpenMachine:
    """Open the drive: a simulated machine as the last run left it (a new one without a store), a real one as it stands.

    Args:
        read_only: a drive on a bus is read by SDO and not set up.

    Raises:
        StateError: retained memory or plant cannot be used. DeviceError: a drive on a bus cannot be reached.
    """
    found = _open(machine, store, read_only)
    if store is not None and machine.on_bus:
        from gantryctl.wiring.canopen import facts_of_drive  # only a machine on a bus loads the bus

        facts = facts_of_drive(found.drive)
        if facts is not None:
            with left_on_failure(found.drive):
                store_facts(facts_path(store.directory, machine), facts)
    return found


def _open(machine: Machine, store: StateStore | None, read_only: bool) -> OpenMachine:
    if not machine.plant_is_local:
        return _real_machine(machine, store, read_only)
    if store is None:
        return new_machine(machine)
    kept = store.load_plant()
    retained = store.load_retained()
    notes = tuple(f"retained memory: {note}" for note in store.notes)
    # Plant and memory belong together: one without the other means a lost file, and the zero cannot be guessed.
    if kept is None:
        if retained is None:
            at = machine.axis.dial.text(machine.axis.start_angle_deg)
            standing = f"a new simulated machine, standing at {at} deg"
            return new_machine(machine)._replace(notes=(standing,))
        raise StateError(
            f"{store.directory}: retained memory without a simulated plant; `gantryctl sim reset` makes a new machine"
        )
    if retained is None:
        raise StateError(
            f"{store.directory}: a simulated plant without retained memory: the zero offset is lost; "
            "`gantryctl sim reset` makes a new machine"
        )
    state, same_plant = kept
    if same_plant:
        return _opened(machine, _kept_drive(machine, state), retained, notes)
    # The state vector of another plant means nothing here; the angle is what a person expects to find again.
    angle = deg(state.get("pos_load", state.get("pos_ideal", 0.0)))
    moved = new_machine(machine, angle)
    at = machine.axis.dial.text(angle, ".4f")
    note = f"[plant] has changed since the last run: the new plant stands at the same {at} deg, zeroed anew"
    return _opened(machine, moved.drive, retained_of_new_plant(retained, moved.retained), (*notes, note))


@contextmanager
def read_only(machine: Machine, store: StateStore) -> Iterator[OpenMachine]:
    """Open a machine for questions, and leave its bus afterwards."""
    found = open_machine(machine, store, read_only=True)
    try:
        yield found
    finally:
        leave_bus(found.drive)


def new_machine(machine: Machine, angle_deg: float | None = None) -> OpenMachine:
    """A simulated machine as delivered: standing at an angle with the brake closed, encoder zeroed.

    Args:
        angle_deg: [axis] start_angle_deg when not given; the encoder was zeroed there in any case.

    Raises:
        UsageError: an angle outside the mechanical stops.
    """
    zeroed_deg = machine.axis.start_angle_deg
    angle_deg = zeroed_deg if angle_deg is None else angle_deg
    if not machine.axis.within_stops(angle_deg):
        raise UsageError(f"angle {angle_deg:g} deg: {machine.axis.stops_text}")
    from gantryctl.wiring.simulator import delivered_zero_counts  # a controller on a bus loads no simulator

    drive = drive_of(machine, angle_deg)
    with left_on_failure(drive):
        zero, rest = delivered_zero_counts(machine), int(drive.read().pos_act_counts)
        scale = _encoder_scale(machine, drive.identity())
        if (turn := scale.axis_turn_counts) is not None:
            # From the zero to where it stands the encoder may have wrapped: the zero is kept with its rest position.
            wraps = round((zero + angle_deg / scale.deg_per_count - rest) / scale.range_counts)
            zero = Turns(turn, zero).kept_zero(rest + wraps * scale.range_counts, scale.range_counts)
        retained = Retained(
            machine=machine.name,
            config_hash=config_hash(machine),
            encoder_serial=drive.identity().encoder_serial,
            zero_offset_counts=zero,
            zero_set_by="simulator",
            zero_witness=f"new simulated machine, zeroed at {machine.axis.dial.text(zeroed_deg)} deg",
            rest_position_counts=rest,
        )
    return _opened(machine, drive, retained)


def _opened(machine: Machine, drive: Drive, retained: Retained, notes: tuple[str, ...] = ()) -> OpenMachine:
    with left_on_failure(drive):
        scale, feedback = _encoder_scale(machine, drive.identity()), drive.read()
        reading = judge_reference(scale, feedback.pos_act_counts, retained)
    return OpenMachine(drive, retained, feedback, scale, reading, notes)


def _encoder_scale(machine: Machine, identity: DriveIdentity) -> EncoderScale:
    axis = machine.axis
    return EncoderScale(
        identity,
        axis.ratio,
        machine.encoder.counts_per_turn,
        axis.pos_min_deg,
        axis.pos_max_deg,
        (axis.mechanical_stop_min_deg, axis.mechanical_stop_max_deg),
        machine.encoder.wrap_margin_min_deg,
        axis.gear * machine.counts_per_turn if axis.modulo else None,
    )


def _real_machine(machine: Machine, store: StateStore | None, read_only: bool) -> OpenMachine:
    if store is None:
        raise UsageError(
            f"{machine.name}: a drive on a bus has no new machine behind it; leave --fresh out, and set its zero once: "
            "gantryctl encoder set-zero"
        )
    retained = store.load_retained() or Retained(machine=machine.name, config_hash=config_hash(machine))
    notes = tuple(f"retained memory: {note}" for note in store.notes)
    if not read_only:
        return _opened(machine, drive_of(machine), retained, notes)
    from gantryctl.wiring.canopen import read_only_drive  # only a machine on a bus loads the bus

    return _opened(machine, read_only_drive(machine), retained, notes)


def _kept_drive(machine: Machine, state: dict[str, float]) -> Drive:
    """The drive as it was left; StateError when the state does not fit it."""
    try:
        return drive_of(machine, state=state)
    except (ValueError, KeyError) as fault:
        raise StateError(
            f"{machine.name}: the kept state of the simulated plant cannot be used ({fault}); "
            "`gantryctl sim reset` makes a new one"
        ) from fault


def retained_of_new_plant(old: Retained, new: Retained) -> Retained:
    """Settings, counters and alarms of the old machine with the encoder data of the new one."""
    return replace(
        old,
        encoder_serial=new.encoder_serial,
        zero_offset_counts=new.zero_offset_counts,
        previous_offset_counts=old.zero_offset_counts,
        zero_set_by=new.zero_set_by,
        zero_witness=new.zero_witness,
        rest_position_counts=new.rest_position_counts,
        holding_torque_nm=None,
        torque_weights="",
        calibration_watch="",
    )


# --- judging --------------------------------------------------------------------------------------------------


def _reasons(found: OpenMachine, bus: tuple[Reason, ...]) -> tuple[Reason, ...]:
    """Everything that keeps power off."""
    # What no reset clears comes first: it is what a person has to deal with first, and what the service answers with.
    encoder = why_not_referenced(found.reading)
    reasons = [reason for reason in (encoder, *bus) if reason is not None and not reason.by_reset]
    if encoder is not None and encoder.by_reset:
        reasons.append(encoder)
    stopped_by = found.retained.error_stop
    if stopped_by:
        by_service = stopped_by in LOCKED or found.retained.doubted_by
        cleared_by = ClearedBy.SERVICE if by_service else ClearedBy.RESET
        reasons.append(Reason(Code.SYS_12, {"stopped_by": stopped_by}, cleared_by))
    return tuple(reasons)


def _with_accepted_motion(
    found: OpenMachine, reasons: tuple[Reason, ...]
) -> tuple[Retained, tuple[str, ...]]:
    """Memory and notes of an opening; a small motion while off is accepted, but noted in both."""
    moved = found.reading.moved_deg
    if moved is None or abs(moved) < SHOWN_DEG or reasons:
        return found.retained, found.notes
    text = f"{Code.ENC_09} INFO · the axis moved {moved:+.3f} deg while off · within {ACCEPTED_DEG:g} deg: accepted"
    alarms = (*found.retained.alarms, AlarmEntry(str(Code.ENC_09), text, now_text()))
    return replace(found.retained, alarms=alarms), (*found.notes, text)


def _zero_counts(found: OpenMachine) -> float:
    """Encoder count at 0 deg, on the branch of the present reading; the reading itself where no zero is stored."""
    # Feedback counts on over the wrap of the encoder's range, so the zero goes to the branch of the first reading.
    counts, kept = found.feedback.pos_act_counts, found.retained
    zero = kept.zero_offset_counts
    if zero is None:
        return counts
    return zero + counts - found.scale.unwrapped(counts, zero, kept.rest_position_counts)


def rested_at(found: OpenMachine, retained: Retained, counts: int) -> Retained:
    """Memory of an axis that rests at `counts`, which has counted on since the machine was found so."""
    span, turn = found.scale.range_counts, found.scale.axis_turn_counts
    kept = replace(retained, rest_position_counts=counts % span)
    if turn is None or kept.zero_offset_counts is None:
        return kept
    # The zero of a modulo axis lies on the branch of its rest position, and the range is no whole number of turns.
    return replace(kept, zero_offset_counts=Turns(turn, _zero_counts(found)).kept_zero(counts, span))


def set_up_again(engine: Engine) -> bool:
    """Set up a drive that was lost or has changed: power off, between two scans.

    Returns:
        Whether there was anything to do.

    Raises:
        DeviceError: it cannot be; the alarms come again.
    """
    # SDO transfers wait for answers and so never run inside a scan (decision 0012).
    if not engine.drive.lost:
        return False
    engine.between_scans(engine.drive.set_up_again)
    return True


# --- closing --------------------------------------------------------------------------------------------------


def close_axis(machine: Machine, store: StateStore | None, opened: OpenAxis, end: RunEnd) -> None:
    """Keep what the controller has to remember of a run that has ended."""
    retained = retained_after(machine, opened.retained, opened.program.axis, opened.drive, end)
    keep_machine(machine, store, opened.drive, retained)


def keep_machine(machine: Machine, store: StateStore | None, drive: Drive, retained: Retained) -> None:
    """Keep memory and plant."""
    if store is not None:
        # The memory first: after a crash between the two, a plant without its memory could not be trusted.
        store.store_retained(retained)
        if machine.plant_is_local:
            store.store_plant(drive.plant_state())
        health = drive.health()
        # A drive that was only asked has exchanged no telegrams.
        if health is not None and health.scans:
            store.store_bus(health.lines())


@contextmanager
def left_on_failure(drive: Drive) -> Iterator[None]:
    """Leave the bus of a drive if what is done with it fails."""
    # A drive that was set up is not left behind on its bus, whatever goes wrong while its machine is opened.
    try:
        yield
    except BaseException:
        leave_bus(drive)
        raise


def leave_bus(drive: Drive) -> None:
    """Leave a bus as it was found."""
    # Without a bus there is nothing to leave, and `close` would let the simulated load of this process settle.
    if drive.health() is not None:
        drive.close()


def bus_lines(drive: Drive) -> tuple[str, ...]:
    """Describe the health of the connection for people; () without a bus."""
    health = drive.health()
    return () if health is None else health.lines()
