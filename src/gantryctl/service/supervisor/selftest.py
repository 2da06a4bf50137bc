"""Self-test before the service starts; nothing here moves the machine or writes its state."""

from __future__ import annotations

import json
import os
import time
from collections.abc import Callable, Sequence
from functools import partial
from importlib.metadata import distribution
from pathlib import Path
from typing import Final, NamedTuple

import gantryctl
from gantryctl.errors import GantryctlError
from gantryctl.machine import Machine
from gantryctl.operation.store import StateStore
from gantryctl.program.alarms.codes import Code
from gantryctl.program.alarms.log import refusal
from gantryctl.service.memory.memory import SharedMemory
from gantryctl.service.recorder.journal.key import made_key
from gantryctl.service.recorder.journal.places import places_of
from gantryctl.service.recorder.journal.proof import verify
from gantryctl.service.recorder.retention import MB, RetentionPolicy, free_of
from gantryctl.service.supervisor.installed import check_installed
from gantryctl.service.supervisor.private_files import exposed
from gantryctl.service.supervisor.users import Users

_NEWEST: Final = 100_000
# Names of changed files in a message; it says how many there are.
_NAMED: Final = 3


class Check(NamedTuple):
    """One check; a failed `vital` one stops the start."""

    name: str
    ok: bool
    text: str
    vital: bool


def self_test(
    machine: Machine,
    store: StateStore,
    root: Path,
    policy: RetentionPolicy,
    secrets: Sequence[Path],
    watch: Callable[[float], None] = lambda part: None,
) -> list[Check]:
    """Run all checks, also after a failed one.

    Args:
        secrets: the files that nobody else may read.
        watch: is told the part of the installed files that is checked, 0 to 1: they take most of the time.
    """
    checks: dict[str, Callable[[], tuple[bool, str]]] = {
        "installed files": partial(_installed, watch),
        "shared memory": _memory,
        "clock": _clock,
        "state": partial(_state, machine, store),
        "disk": partial(_disk, store.directory, policy),
        "journal key": partial(_key, store.directory),
        "journal": partial(_journal, store.directory),
        "users": partial(_users, root),
        "secrets": partial(_secrets, secrets),
    }
    found = []
    for name, check in checks.items():
        try:
            ok, text = check()
        except (GantryctlError, json.JSONDecodeError) as fault:
            ok, text = False, str(fault)
        # A damaged journal does not stop the start: it is moved aside, and motion waits for service.
        found.append(Check(name, ok, text, vital=name != "journal"))
    return found


def _installed(watch: Callable[[float], None]) -> tuple[bool, str]:
    """Compare the program's files with what was installed: 0.8 to 1 s of a processor, here and at no other command."""
    found = check_installed(distribution("gantryctl"), Path(gantryctl.__file__).parent, watch)
    if found is None:
        return True, "sources or an editable install: nothing to compare with"
    if found.changed:
        names = ", ".join(found.changed[:_NAMED])
        # No person may accept it: the code that would ask is the one in doubt (decision 0020).
        return False, refusal(Code.SYS_13, count=len(found.changed), files=names).line
    return True, f"{found.checked} files as installed"


def _memory() -> tuple[bool, str]:
    """Pass a record through a ring and through the sequence lock."""
    memory = SharedMemory.create()
    token = os.urandom(200)
    memory.slow.publish(token)
    found = memory.slow.read()
    whole = memory.commands[0].put(token) and memory.commands[0].take() == token
    memory.close()
    return bool(whole and found == token), "ring and sequence lock"


def _clock() -> tuple[bool, str]:
    """Check that the monotonic clock is finer than a scan."""
    step_s = time.get_clock_info("monotonic").resolution
    return step_s < 1e-5, f"CLOCK_MONOTONIC, resolution {step_s:.1e} s"


def _state(machine: Machine, store: StateStore) -> tuple[bool, str]:
    """Check that no other process runs this machine, and that its memory can be read."""
    with store:
        retained, plant = store.load_retained(), store.load_plant()
    if not machine.plant_is_local:
        return True, "no retained memory yet" if retained is None else "retained memory read"
    if (retained is None) != (plant is None):
        return False, "retained memory and simulated plant do not belong together: gantryctl sim reset"
    return True, "a new machine" if retained is None else "retained memory and plant read"


def _disk(directory: Path, policy: RetentionPolicy) -> tuple[bool, str]:
    free_mb, least = free_of(directory)() / MB, policy.event_reserve_mb
    return free_mb >= least, f"{free_mb:.0f} MB free, at least {least:g} MB for the journal"


def _journal(directory: Path) -> tuple[bool, str]:
    """Check the newest events of the journal."""
    # The newest events take a second at most; `gantryctl journal verify` checks all.
    places = places_of(directory)
    if not any(path.exists() for path in (places.database, *places.mirrors, places.anchors)):
        return True, "a new one"
    verdict = verify(directory, newest=_NEWEST)
    return not verdict.wrong, verdict.wrong or f"{verdict.rows} events, chain intact"


def _key(directory: Path) -> tuple[bool, str]:
    """Check the key that seals the journal; made where there is none."""
    path = places_of(directory).key
    made_key(path)
    return True, str(path)


def _users(root: Path) -> tuple[bool, str]:
    count = len(Users(root).all())
    return True, f"{count} users" if count else "no users yet: nobody can log in"


def _secrets(files: Sequence[Path]) -> tuple[bool, str]:
    """Check that no other user of this machine can read or change a secret."""
    found = [text for text in map(exposed, files) if text]
    return not found, "; ".join(found) or "nobody else can read them"
