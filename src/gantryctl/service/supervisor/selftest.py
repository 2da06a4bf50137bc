"""Self-test before the service starts; nothing here moves the machine or writes its state."""

from __future__ import annotations

import json
import os
import time
from pathlib import Path
from typing import Final, NamedTuple

from gantryctl.errors import GantryctlError
from gantryctl.machine import Machine
from gantryctl.operation.store import StateStore
from gantryctl.service.memory.memory import SharedMemory
from gantryctl.service.recorder.journal import verify
from gantryctl.service.recorder.journal_file import FILE
from gantryctl.service.recorder.retention import MB, RetentionPolicy, free_of
from gantryctl.service.supervisor.users import Users

_NEWEST: Final = 100_000


class Check(NamedTuple):
    """One check; a failed `vital` one stops the start."""

    name: str
    ok: bool
    text: str
    vital: bool = True


def self_test(machine: Machine, store: StateStore, root: Path, policy: RetentionPolicy) -> list[Check]:
    """Run all checks, also after a failed one."""
    return [
        _memory(),
        _clock(),
        _state(machine, store),
        _disk(store.directory, policy),
        _journal(store.directory),
        _users(root),
    ]


def _memory() -> Check:
    """Pass a record through a ring and through the sequence lock."""
    try:
        memory = SharedMemory.create()
    except GantryctlError as fault:
        return Check("shared memory", False, str(fault))
    token = os.urandom(200)
    memory.slow.publish(token)
    found = memory.slow.read()
    whole = memory.commands[0].put(token) and memory.commands[0].take() == token
    memory.close()
    return Check("shared memory", bool(whole and found == token), "ring and sequence lock")


def _clock() -> Check:
    """Check that the monotonic clock is finer than a scan."""
    step_s = time.get_clock_info("monotonic").resolution
    return Check("clock", step_s < 1e-5, f"CLOCK_MONOTONIC, resolution {step_s:.1e} s")


def _state(machine: Machine, store: StateStore) -> Check:
    """Check that no other process runs this machine, and that its memory can be read."""
    try:
        with store:
            retained, plant = store.load_retained(), store.load_plant()
    except GantryctlError as fault:
        return Check("state", False, str(fault))
    if not machine.plant_is_local:
        return Check("state", True, "no retained memory yet" if retained is None else "retained memory read")
    if (retained is None) != (plant is None):
        return Check(
            "state", False, "retained memory and simulated plant do not belong together: gantryctl sim reset"
        )
    return Check("state", True, "a new machine" if retained is None else "retained memory and plant read")


def _disk(directory: Path, policy: RetentionPolicy) -> Check:
    free_mb, least = free_of(directory)() / MB, policy.event_reserve_mb
    return Check("disk", free_mb >= least, f"{free_mb:.0f} MB free, at least {least:g} MB for the journal")


def _journal(directory: Path) -> Check:
    """Check the newest events of the journal."""
    # A damaged journal does not stop the start: it is moved aside, and motion waits for service. The newest events take
    # a second at most; `gantryctl journal verify` checks all.
    if not (directory / FILE).exists():
        return Check("journal", True, "a new one", vital=False)
    try:
        verdict = verify(directory, newest=_NEWEST)
    except GantryctlError as fault:
        return Check("journal", False, str(fault), vital=False)
    return Check(
        "journal", not verdict.wrong, verdict.wrong or f"{verdict.rows} events, chain intact", vital=False
    )


def _users(root: Path) -> Check:
    try:
        count = len(Users(root).all())
    except (GantryctlError, json.JSONDecodeError) as fault:
        return Check("users", False, str(fault))
    return Check("users", True, f"{count} users" if count else "no users yet: nobody can log in", vital=False)
