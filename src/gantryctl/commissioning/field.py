"""Commissioning of virtual drives with the dictionaries of real ones: how many of them this controller can run."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Final, NamedTuple

from gantryctl.commissioning.results import Outcome
from gantryctl.commissioning.run import Commissioning, Step
from gantryctl.drives.od.object_table import ObjectTable
from gantryctl.drives.od.velocity_units import unit_of_word
from gantryctl.drives.profiles.dictionary import profile_of_table
from gantryctl.errors import CommandRefused, DeviceError
from gantryctl.machine import Machine, with_values
from gantryctl.operation.ledger import LedgerRow, Standing
from gantryctl.operation.ledger.inputs import SAFETY_INPUTS
from gantryctl.operation.ledger.judging import impossible, lacks, unproven
from gantryctl.operation.ledger.silence import COMMANDS, CONTROLLER
from gantryctl.operation.store import StateStore

_WATCHES: Final = {COMMANDS, CONTROLLER}
_PER_MILLE: Final = 1000.0
_TORQUE_LIMIT: Final = (0x6072, 0)
_SPEED_UNIT: Final = (0x60A9, 0)
_DRIVE_INPUTS: Final = (0x60FD, 0)
_IO_NODE: Final = 3
# Bits behind those of the safety inputs.
_WATCHDOG: Final = {
    "can.io.node": _IO_NODE,
    "can.io.outputs.drive_enable": 0,
    "can.io.inputs.watchdog_closed": 15,
}


class FieldDrive(NamedTuple):
    """One drive of the field, and how its commissioning ended.

    Attributes:
        steps: the steps done, with their outcome.
        refused: why it was refused or a step failed, one line each; () where it was commissioned.
        needs_watchdog: it is refused because nothing in it watches the controller, and for nothing else.
        made_up, to_accept: rows of the ledger that something makes up for, and that a person must accept by name.
    """

    drive: str
    profile: str
    commissioned: bool
    steps: tuple[tuple[str, Outcome], ...]
    refused: tuple[str, ...]
    needs_watchdog: bool
    made_up: tuple[LedgerRow, ...]
    to_accept: tuple[LedgerRow, ...]


def field_machine(base: Machine, table: ObjectTable, source: str, *, watchdog: bool = False) -> Machine:
    """The machine file that a person would write for this drive, on a virtual bus.

    Args:
        base: gantry and motor, with a drive on a bus.
        source: file of the table, "" for the shipped one.
        watchdog: an I/O node holds the hardware enable of the drive, and takes it off when the controller is gone.

    Raises:
        ConfigError: the machine does not go together with the drive.
    """
    changes: dict[str, object] = {
        "can.interface": "simulated",
        "can.channel": "",
        "can.side_channel": "",
        # An EDS has one drive, a table several.
        "can.virtual_drive": source if table.complete else f"{table.drive}@{source}",
        # The status of the encoder is an object of the plain virtual drive.
        "can.encoder.index": 0,
        "brake.owner": "drive",
        **_unit(table),
        **_torque(base, table),
        **_inputs(table),
        **(_WATCHDOG if watchdog else {}),
    }
    return with_values(base, changes)


def _unit(table: ObjectTable) -> dict[str, object]:
    profile, entry = profile_of_table(table), table.entries.get(_SPEED_UNIT)
    if profile is not None and profile.units.velocity is not None:
        return {"can.velocity_unit": "profile"}
    word = entry.default if entry is not None else None
    unit = unit_of_word(word) if isinstance(word, int) else None
    return {} if unit is None else {"can.velocity_unit": unit}


def _torque(base: Machine, table: ObjectTable) -> dict[str, object]:
    """The limit of the maker's tool where no object takes it, or the meaning of 1000 where 6072 ends too early."""
    most_nm, entry = base.motor.torque_max_nm, table.entries.get(_TORQUE_LIMIT)
    if entry is None or not entry.access.writable:
        return {"can.torque_limit_in_drive_nm": most_nm}
    share = most_nm / base.motor.torque_rated_nm
    if entry.high is None or entry.high >= _PER_MILLE * share:
        return {}
    return {"can.torque_reference": _PER_MILLE * share / entry.high}


def _inputs(table: ObjectTable) -> dict[str, object]:
    """An I/O node for the inputs of a drive without 60FD."""
    if not table.lacks(*_DRIVE_INPUTS):
        return {}
    wired = {f"can.io.inputs.{name}": bit for bit, name in enumerate(SAFETY_INPUTS)}
    return {"can.io.node": _IO_NODE, **wired, **{f"can.inputs.{name}": -1 for name in SAFETY_INPUTS}}


def commission_field_drive(
    base: Machine,
    table: ObjectTable,
    source: str,
    say: Callable[[str], None],
    *,
    whole: bool = True,
    watchdog: bool = False,
) -> FieldDrive:
    """Commission one virtual drive in virtual time, up to the first step that fails.

    Args:
        say: takes a line for every step.
        whole: False leaves out the steps that need the whole travel, and no drive counts as commissioned.
        watchdog: with an I/O node that holds its hardware enable.
    """
    profile = profile_of_table(table)
    with _work(field_machine(base, table, source, watchdog=watchdog)) as work:
        done: list[tuple[str, Outcome]] = []
        refused = _start(work)
        unwatched = bool(refused) and {row.what for row in impossible(work.ledger)} == _WATCHES
        steps = () if refused else [step for step in work.left() if step.required and (whole or _short(step))]
        for step in steps:
            result = work.do(step)
            # A virtual gantry hurts nobody, so that no step is declined.
            assert result is not None
            say(f"  {step.key}: {result.outcome.value}: {result.proof}")
            done.append((step.key, result.outcome))
            if result.outcome is Outcome.FAILED:
                refused = (f"step {step.key}: {result.proof}",)
                break
        rows = work.ledger
        if not refused and whole:
            refused = tuple(row.text for row in unproven(rows))
        return FieldDrive(
            drive=table.drive,
            profile="" if profile is None else profile.name,
            commissioned=work.complete,
            steps=tuple(done),
            refused=refused,
            needs_watchdog=unwatched,
            made_up=tuple(row for row in rows if row.standing is Standing.MADE_UP),
            to_accept=lacks(rows),
        )


def _start(work: Commissioning) -> tuple[str, ...]:
    """Set the drive up; what is lacking and nothing makes up for, one line each."""
    try:
        work.start(again=False)
    except (CommandRefused, DeviceError) as reason:
        return tuple(row.text for row in impossible(work.ledger)) or (str(reason),)
    return ()


def _short(step: Step) -> bool:
    """The step does not need the whole travel, nor results of one that does."""
    return step.key not in ("turn", "bands")


@contextmanager
def _work(machine: Machine) -> Iterator[Commissioning]:
    """A commissioning whose record is of no use to anybody: it ends with the block."""
    with TemporaryDirectory() as folder, StateStore(machine, Path(folder)) as store:
        yield Commissioning(machine, store, Path(folder), lambda line: None, lambda step: True)
