"""The machine between two runs: simulated ones live in the state directory, real ones are looked at."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from typing import NamedTuple, Protocol

from gantryctl.errors import StateError, UsageError
from gantryctl.image import DriveFeedback, DriveIdentity
from gantryctl.machine import Machine, config_hash
from gantryctl.operation.home_reference import EncoderScale
from gantryctl.operation.store import StateStore
from gantryctl.ports import Drive
from gantryctl.runtime import Retained
from gantryctl.units import deg
from gantryctl.wiring.engine import drive_of


class ReadDrive(Protocol):
    """What a question about a machine needs of its drive."""

    def identity(self) -> DriveIdentity:
        """Encoder."""
        ...

    def read(self) -> DriveFeedback:
        """Reading."""
        ...


class VirtualMachine(NamedTuple):
    """The drive and what the controller remembers of it.

    Attributes:
        notes: what had to be done to open it, in words.
    """

    drive: Drive
    retained: Retained
    notes: tuple[str, ...]


def encoder_scale(machine: Machine, drive: ReadDrive) -> EncoderScale:
    """Sizes of the encoder and the travel."""
    axis = machine.axis
    return EncoderScale(
        drive.identity(),
        machine.axis.ratio,
        machine.encoder.counts_per_turn,
        axis.pos_min_deg,
        axis.pos_max_deg,
        axis.mechanical_stop_deg,
        machine.encoder.wrap_margin_min_deg,
    )


def new_machine(machine: Machine, angle_deg: float = 0.0) -> VirtualMachine:
    """As delivered: standing at an angle with the brake closed, encoder zeroed at 0 deg.

    Raises:
        UsageError: an angle outside the mechanical stops.
    """
    limit = machine.axis.mechanical_stop_deg
    if not -limit < angle_deg < limit:
        raise UsageError(f"angle {angle_deg:g} deg: the mechanical stops are at +-{limit:g} deg")
    from gantryctl.wiring.simulator import delivered_zero_counts  # a controller on a bus loads no simulator

    drive = drive_of(machine, angle_deg)
    retained = Retained(
        machine=machine.name,
        config_hash=config_hash(machine),
        encoder_serial=drive.identity().encoder_serial,
        zero_offset_counts=delivered_zero_counts(machine),
        zero_set_by="simulator",
        zero_witness="new simulated machine, zeroed at 0 deg",
        rest_position_counts=int(drive.read().pos_act_counts),
    )
    return VirtualMachine(drive, retained, ())


def open_machine(machine: Machine, store: StateStore | None, *, to_look: bool = False) -> VirtualMachine:
    """The simulated machine as the last run left it; a new one when there is none (or without a store).

    A real one as it stands, with what the controller remembers of it.

    Args:
        to_look: only questions will be asked: a drive on a bus is read by SDO and not set up.

    Raises:
        StateError: retained memory or plant cannot be used. DeviceError: a drive on a bus cannot be reached.
    """
    if not machine.plant_is_local:
        return _real_machine(machine, store, to_look)
    if store is None:
        return new_machine(machine)
    kept = store.load_plant()
    retained = store.load_retained()
    notes = tuple(f"retained memory: {note}" for note in store.notes)
    if kept is None:
        fresh = new_machine(machine)
        if retained is None:
            return fresh._replace(notes=("a new simulated machine, standing at 0 deg",))
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
        return VirtualMachine(_kept_drive(machine, state), retained, notes)
    angle = deg(state.get("pos_load", state.get("pos_ideal", 0.0)))
    moved = new_machine(machine, angle)
    note = f"[plant] has changed since the last run: the new plant stands at the same {angle:.4f} deg, zeroed anew"
    return VirtualMachine(
        moved.drive,
        retained_of_new_plant(retained, moved.retained),
        (*notes, note),
    )


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
    )


def _real_machine(machine: Machine, store: StateStore | None, to_look: bool) -> VirtualMachine:
    if store is None:
        raise UsageError(
            f"{machine.name}: a drive on a bus has no new machine behind it; leave --fresh out, and set its zero once: "
            "gantryctl encoder set-zero"
        )
    retained = store.load_retained() or Retained(machine=machine.name, config_hash=config_hash(machine))
    notes = tuple(f"retained memory: {note}" for note in store.notes)
    if not to_look:
        return VirtualMachine(drive_of(machine), retained, notes)
    from gantryctl.wiring.canopen import read_only_drive  # only a machine on a bus loads the bus

    return VirtualMachine(read_only_drive(machine), retained, notes)


def _kept_drive(machine: Machine, state: dict[str, float]) -> Drive:
    """The drive as it was left; StateError when the state does not fit it."""
    try:
        return drive_of(machine, state=state)
    except (ValueError, KeyError) as fault:
        raise StateError(
            f"{machine.name}: the kept state of the simulated plant cannot be used ({fault}); "
            "`gantryctl sim reset` makes a new one"
        ) from fault


def keep_machine(machine: Machine, store: StateStore | None, drive: Drive, retained: Retained) -> None:
    """Put plant and memory back: the memory first, a plant without it could not be trusted."""
    if store is not None:
        store.store_retained(retained)
        if machine.plant_is_local:
            store.store_plant(drive.plant_state())


@contextmanager
def looked_at(machine: Machine, store: StateStore) -> Iterator[VirtualMachine]:
    """The machine, for questions; a bus is left again afterwards."""
    found = open_machine(machine, store, to_look=True)
    try:
        yield found
    finally:
        if machine.on_bus:
            found.drive.close()
