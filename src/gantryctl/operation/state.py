"""Retained state of a machine that is not running: questions and acknowledgements."""

from __future__ import annotations

import getpass
import math
from collections.abc import Callable
from dataclasses import dataclass, fields, replace
from datetime import UTC, datetime
from pathlib import Path
from typing import Any, Final

from gantryctl.errors import CommandRefused, DeviceError, StateError, UsageError
from gantryctl.image import DriveState
from gantryctl.machine import Machine
from gantryctl.operation.brake_policy import LOCKED, brake_words, turned_weights
from gantryctl.operation.home_reference import (
    SHOWN_DEG,
    AbsoluteReading,
    EncoderScale,
    RestVerdict,
    judge_reference,
    why_not_referenced,
)
from gantryctl.operation.opening import (
    OpenMachine,
    keep_machine,
    leave_bus,
    new_machine,
    read_only,
    rested_at,
)
from gantryctl.operation.proofs import ledger_shown, own_ramp_deg_s2
from gantryctl.operation.store import StateStore, now_text
from gantryctl.program import Code
from gantryctl.program.axis.turns import Turns
from gantryctl.program.feedback import ENERGISED
from gantryctl.runtime import AlarmEntry, Retained
from gantryctl.units import Dial, deg
from gantryctl.wiring.compensation import lead_deg

# Retained memory is in SI units like the program; people read degrees.
_SHOWN: Final[dict[str, Callable[[Any], str]]] = {
    "_rad_s": lambda value: f"{deg(value):.6g} deg/s",
    "_rad": lambda value: f"{deg(value):.6g} deg",
    "_nm": lambda value: f"{value:.6g} N m",
    "_j": lambda value: f"{value:.6g} J",
    "_counts": lambda value: f"fine count {value}",
}

_AROUND_ZERO: Final = (
    ' · where 6064 runs from minus half the range to plus half: [can] position_range = "around 0"'
)
# The witness stands in journal lines, in reports and in `retain show`: one line.
_WITNESS_LENGTH: Final = 200


def operator_name() -> str:
    """Name of the person who gives commands: the user of the operating system."""
    try:
        return getpass.getuser()
    except (OSError, KeyError):
        return "unknown user"


@dataclass(frozen=True)
class MachineStatus:
    """State of the axis of a machine for a person who asks; `gantryctl status` in keys."""

    machine: str
    condition: str
    angle_deg: float | None
    encoder: str
    last_result: str
    last_alarm: str
    error_stop: str
    power_ups: int
    moves: int
    travelled_deg: float
    brake_test: str
    directory: str
    quick_dec_deg_s2: float
    """Deceleration of a quick stop."""
    ledger: tuple[str, ...] = ()
    """What persons have accepted, what is lacking, and what limits the speed."""
    notes: tuple[str, ...] = ()


def machine_status(machine: Machine) -> MachineStatus:
    """The state that the last run left behind; nothing is changed."""
    with StateStore(machine) as store:
        try:
            with read_only(machine, store) as found:
                retained, reading, state = found.retained, found.reading, found.feedback.state
            held, angle_deg, notes = why_not_referenced(reading), reading.angle_deg, found.notes
            # Of a drive on a bus the state is read, and nothing of its brake.
            off = "power off, brake closed" if machine.plant_is_local else "power off"
            condition = off if held is None else "may not move"
            if state in ENERGISED:
                condition = (
                    f"the drive is in {state.name.lower().replace('_', ' ')}: another controller runs it"
                )
            encoder = reading.verdict.value if held is None else held.text
        except StateError:
            raise
        # A drive that cannot be reached is no reason to hide what is retained of its machine.
        except DeviceError as fault:
            kept = None if machine.plant_is_local else store.load_retained()
            if kept is None:
                raise
            retained, angle_deg, notes = kept, None, ()
            condition, encoder = "the drive cannot be reached", str(fault)
    if retained.doubted_by:
        angle_deg = None
        # "-": no alarm has stopped the axis for it.
        since = "" if retained.doubted_by == "-" else f" since {retained.doubted_by}"
        encoder = f"in doubt{since}: service compares the angle, then reset"
    code = retained.error_stop
    if code:
        then = "only service resets it" if code in LOCKED else "then reset"
        condition = f"stopped by alarm {code}; `gantryctl explain {code}`, {then}"
    return MachineStatus(
        machine=machine.name,
        condition=condition,
        angle_deg=angle_deg,
        encoder=encoder,
        last_result=retained.last_result,
        last_alarm=retained.alarms[-1].text if retained.alarms else "",
        error_stop=code,
        power_ups=retained.power_ups,
        moves=retained.moves,
        travelled_deg=deg(retained.travelled_rad),
        brake_test=brake_words(machine, retained, datetime.now(UTC)),
        directory=str(store.directory),
        quick_dec_deg_s2=own_ramp_deg_s2(machine, store.directory) or machine.virtual_axis.quick_dec_deg_s2,
        ledger=ledger_shown(machine, store.directory),
        notes=notes,
    )


def read_retained(machine: Machine) -> Retained | None:
    """The retained memory as it is; None when the machine has never run."""
    with StateStore(machine) as store:
        return store.load_retained()


def retained_rows(retained: Retained) -> list[tuple[str, str]]:
    """Name and value of everything retained, with units; alarms counted."""
    rows = []
    for field in fields(retained):
        name, value = field.name, getattr(retained, field.name)
        unit = next((unit for unit in _SHOWN if name.endswith(unit)), "")
        name = name.removesuffix(unit)
        if field.name == "alarms":
            text = f"{len(value)} (gantryctl alarms)"
        elif value in (None, ""):
            text = "-"
        elif unit:
            text = _SHOWN[unit](value)
        else:
            text = str(value)
        rows.append((name.replace("_", " "), text))
    return rows


def reset_machine(machine: Machine, root: Path | None = None) -> str:
    """Acknowledge the alarm of the last stop or a small motion while off, and reset a drive's fault; in words.

    Args:
        root: of the states; that of this user when not given.

    Raises:
        CommandRefused: the position is not valid; a reset cannot make it so. DeviceError: the drive stays in fault.
    """
    # It never enables and never moves; power then needs a new rising edge (states of the axis).
    who, when = operator_name(), now_text()
    with StateStore(machine, root) as store, read_only(machine, store) as opened:
        retained, reading = opened.retained, opened.reading
        done = []
        if reading.verdict is RestVerdict.MOVED:
            text = f"{Code.ENC_09} acknowledged by {who}: moved {reading.moved_deg:+.3f} deg while off"
            entry = AlarmEntry(str(Code.ENC_09), text, when)
            retained = replace(
                rested_at(opened, retained, reading.raw_counts), alarms=(*retained.alarms, entry)
            )
            done.append(text)
        elif (reason := why_not_referenced(reading)) is not None:
            raise CommandRefused(reason.text)
        if retained.error_stop:
            done.append(f"{retained.error_stop} acknowledged by {who}; the axis stays without power")
            retained = replace(
                retained, error_stop="", last_result=f"reset of {retained.error_stop} by {who}"
            )
        if retained.doubted_by:
            assert reading.angle_deg is not None
            at = machine.axis.dial.text(reading.angle_deg, ".3f")
            done.append(f"the encoder's angle of {at} deg is accepted by {who}")
            retained = replace(retained, doubted_by="")
        if retained.brake_failed:
            done.append(f"{Code.BRK_08} acknowledged by {who}: {retained.brake_failed}")
            retained = replace(retained, brake_failed="", last_result=f"reset of {Code.BRK_08} by {who}")
        if opened.feedback.state is DriveState.FAULT:
            done.append(_reset_drive(machine))
        if not done:
            return "nothing to reset"
        keep_machine(machine, store, opened.drive, retained)
    return "; ".join(done)


def _reset_drive(machine: Machine) -> str:
    """Reset the fault of a drive on a bus."""
    from gantryctl.wiring.canopen import reset_drive_fault  # only a machine on a bus loads the bus

    state = reset_drive_fault(machine)
    if state is DriveState.FAULT:
        raise DeviceError(
            "the drive stays in fault: its cause is still there · `gantryctl drive status` shows it; remove it, then "
            "reset again"
        )
    return f"the fault of the drive is reset, the drive is in {state.name.lower().replace('_', ' ')}"


def reset_simulation(machine: Machine, angle_deg: float | None) -> str:
    """Replace the simulated machine and its memory by new ones; angle as of `new_machine`."""
    if not machine.plant_is_local:
        raise UsageError(f"{machine.name}: its drive is on a bus; there is nothing simulated to reset")
    fresh = new_machine(machine, angle_deg)
    with StateStore(machine) as store:
        store.forget()
        keep_machine(machine, store, fresh.drive, fresh.retained)
    leave_bus(fresh.drive)
    standing_deg = machine.axis.start_angle_deg if angle_deg is None else angle_deg
    at = machine.axis.dial.text(standing_deg)
    return f"{machine.name}: a new simulated machine stands at {at} deg, brake closed"


def _check_standing(machine: Machine, store: StateStore, seen: OpenMachine) -> None:
    """Refuse a zero of an axis that another controller runs, or that moves.

    Raises:
        CommandRefused: it is not at standstill behind its brake.
    """
    if seen.feedback.state in ENERGISED:
        raise CommandRefused("the drive is enabled: the zero is set at standstill with the brake closed")
    if machine.plant_is_local:
        return
    # Between two readings lie the questions of an opening, some dozens of milliseconds.
    with read_only(machine, store) as again:
        counts = again.feedback.pos_act_counts - seen.feedback.pos_act_counts
    moved_deg = seen.scale.centred(counts) * seen.scale.deg_per_count
    if not abs(moved_deg) < SHOWN_DEG:
        raise CommandRefused(
            f"the axis moves, {moved_deg:+.3f} deg between two readings: the zero is set at standstill with the brake "
            "closed"
        )


def _turned_deg(opened: OpenMachine, motor_deg: float) -> float | None:
    """How much more every angle is by a new zero; None where the angle so far was not known."""
    reading = opened.reading
    known = reading.verdict is RestVerdict.OK and not opened.retained.doubted_by
    return motor_deg - reading.angle_deg if known and reading.angle_deg is not None else None


_ZERO_KEYS: Final = (
    "zero_offset_counts", "rest_position_counts", "zero_set_by", "zero_set_at", "zero_witness",
)  # fmt: skip


@dataclass(frozen=True)
class EncoderReport:
    """The absolute reference in words and numbers."""

    reading: AbsoluteReading
    retained: Retained
    scale: EncoderScale
    dial: Dial

    def as_dict(self) -> dict[str, Any]:
        """Plain values."""
        kept = {name: getattr(self.retained, name) for name in _ZERO_KEYS}
        return self.reading._asdict() | {"verdict": self.reading.verdict.value} | kept

    def rows(self) -> list[tuple[str, str]]:
        """Name and value for a terminal."""
        r, kept, identity = self.reading, self.retained, self.scale.identity
        held = why_not_referenced(r)
        margins = "-"
        if self.scale.axis_turn_counts is not None:
            half_deg = 0.5 * self.scale.range_counts * self.scale.deg_per_count
            margins = f"none: a modulo axis; a way of less than {half_deg:.1f} deg while off is told"
        if r.margin_minus_deg is not None and r.margin_plus_deg is not None:
            margins = f"{r.margin_minus_deg:.1f} deg below the travel, {r.margin_plus_deg:.1f} deg above"
        zero, rest = kept.zero_offset_counts, kept.rest_position_counts
        sizes = f"{self.scale.coarse_per_turn} steps x {identity.turns} turns"
        return [
            ("encoder", f"{r.serial}: {sizes}, {identity.counts_per_turn} fine counts/turn"),
            ("reading", f"turn {r.multi_turn}, step {r.single_turn} (fine count {r.raw_counts})"),
            ("zero offset", "not set" if zero is None else f"fine count {zero}"),
            ("zero set by", f"{kept.zero_set_by or '-'} {kept.zero_set_at}".strip()),
            ("witness", kept.zero_witness or "-"),
            ("angle", "unknown" if r.angle_deg is None else f"{self.dial.text(r.angle_deg, '.5f')} deg"),
            ("wrap margin", margins),
            ("stored rest position", "-" if rest is None else f"fine count {rest}"),
            ("moved while off", "-" if r.moved_deg is None else f"{r.moved_deg:+.5f} deg"),
            ("verdict", r.verdict.value if held is None else held.text),
        ]


def encoder_report(machine: Machine) -> EncoderReport:
    """Read the encoder and judge its reading."""
    with StateStore(machine) as store, read_only(machine, store) as opened:
        return EncoderReport(opened.reading, opened.retained, opened.scale, machine.axis.dial)


def set_encoder_zero(machine: Machine, angle_deg: float, witness: str) -> str:
    """Set the zero offset so that the present reading means `angle_deg`; what was done, in words.

    Raises:
        UsageError: an angle outside the mechanical stops, no witness.
        CommandRefused: the axis is not at standstill, or the encoder's range would wrap too near the travel.
    """
    if not machine.axis.within_stops(angle_deg):
        raise UsageError(f"--angle {angle_deg:g}: {machine.axis.stops_text}")
    witness = witness.strip()
    if not witness:
        raise UsageError("--witness: say what proves the angle, for example a mark or a protocol number")
    if not witness.isprintable() or len(witness) > _WITNESS_LENGTH:
        raise UsageError(f"--witness: one line of at most {_WITNESS_LENGTH} printable characters")
    with StateStore(machine) as store, read_only(machine, store) as opened:
        scale, counts = opened.scale, opened.feedback.pos_act_counts
        _check_standing(machine, store, opened)
        # A map corrects the angle shown as well as the command (decision 0010): the motor stands ahead of the load.
        motor_deg = angle_deg + lead_deg(machine, angle_deg)
        zero = round(counts - motor_deg / scale.deg_per_count)
        turn, span = scale.axis_turn_counts, scale.range_counts
        zero = zero % span if turn is None else Turns(turn, zero).kept_zero(int(counts), span)
        retained = replace(
            opened.retained,
            encoder_serial=scale.identity.encoder_serial,
            zero_offset_counts=zero,
            previous_offset_counts=opened.retained.zero_offset_counts,
            rest_position_counts=int(counts),
            zero_set_by=operator_name(),
            zero_set_at=now_text(),
            zero_witness=witness,
            torque_weights=turned_weights(machine, opened.retained, _turned_deg(opened, motor_deg)),
        )
        # Refused here, the offset is not stored: a reading that jumps by the whole range in motion comes too late.
        reading = judge_reference(scale, counts, retained)
        margins = (reading.margin_minus_deg, reading.margin_plus_deg)
        margin = min((each for each in margins if each is not None), default=math.inf)
        if margin < machine.encoder.wrap_margin_min_deg:
            raise CommandRefused(
                f"{Code.CFG_ENC_01} · with this zero the encoder's range wraps {margin:.1f} deg from the travel, "
                f"[encoder] wrap_margin_min_deg = {machine.encoder.wrap_margin_min_deg:g} · turn the encoder on its "
                "shaft, or mount it with its range centred" + _AROUND_ZERO * machine.on_bus
            )
        keep_machine(machine, store, opened.drive, retained)
    at = machine.axis.dial.text(angle_deg)
    return f"zero set by {retained.zero_set_by}: the axis stands at {at} deg ({retained.zero_witness})"
