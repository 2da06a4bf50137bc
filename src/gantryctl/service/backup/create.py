"""Makes a backup, also of a machine whose service runs."""

from __future__ import annotations

import platform
import shutil
import tempfile
from collections.abc import Iterator
from importlib.metadata import version
from pathlib import Path, PurePosixPath
from typing import Final

from gantryctl.errors import DeviceError, StateError, UsageError
from gantryctl.machine import Machine, default_machine_path
from gantryctl.operation.state import operator_name
from gantryctl.operation.store import SERVICE_SOCKET, now_text
from gantryctl.service.backup.archive import Manifest, content_of, write_archive
from gantryctl.service.recorder.journal.key import read_key
from gantryctl.service.recorder.journal.places import FILE as JOURNAL
from gantryctl.service.recorder.journal.places import KEY, MIRROR, places_of
from gantryctl.service.recorder.journal.proof import verify_file
from gantryctl.service.recorder.journal.reading import copy_journal
from gantryctl.service.recorder.run_record import FILE as RUN
from gantryctl.service.supervisor.users import FILE as USERS

# Folders of an archive.
CONFIG: Final = "config"
STATE: Final = "state"
ACCOUNTS: Final = "accounts"
RECORDINGS: Final = "traces"
SET_ASIDE: Final = "before-restore-"
# In that of the configuration.
_ELSEWHERE: Final = PurePosixPath("from elsewhere")

# Of the machine's directory: what belongs to a running process, and what SQLite's own copy replaces.
JOURNAL_FILES: Final = (JOURNAL, f"{JOURNAL}-wal", f"{JOURNAL}-shm")
_NEVER: Final = frozenset({"lock", SERVICE_SOCKET, RUN, MIRROR, *JOURNAL_FILES})
_SECRET: Final = frozenset({"opcua/key.pem"})


def create_backup(
    machine: Machine, root: Path, out: Path, *, secrets: bool = True, recordings: bool = False
) -> Manifest:
    """Write configuration, state, journal and accounts of a machine into one file; return what it says of itself.

    The journal is copied by SQLite in one transaction and the other files are whole ones, so that a running service
    is not disturbed. The retained memory is copied first: the journal has everything that it speaks of.

    Args:
        root: the state root.
        secrets: with password hashes and private keys.
        recordings: with the recordings.

    Raises:
        UsageError: the machine has no state. StateError: a file cannot be read or written.
    """
    directory = root / machine.name
    if not directory.is_dir():
        raise UsageError(f"{directory}: {machine.name} has no state here yet: there is nothing to keep")
    try:
        with tempfile.TemporaryDirectory(dir=out.parent, prefix=".backup-") as name:
            folder = Path(name)
            config_file = _copy_config(machine, folder / CONFIG)
            for path in _state_files(directory, secrets=secrets, recordings=recordings):
                _copy(path, folder / STATE / path.relative_to(directory))
            for path, inside in ((root / USERS, USERS), (places_of(directory).key, KEY)):
                if secrets and path.exists():
                    _copy(path, folder / ACCOUNTS / inside)
            journal = _copy_journal(directory, folder / STATE)
            files = {
                path.relative_to(folder).as_posix(): content_of(path)
                for path in sorted(folder.rglob("*"))
                if path.is_file()
            }
            manifest = Manifest(
                machine.name, config_file, now_text(), operator_name(), platform.node(), version("gantryctl"),
                secrets, journal, files,
            )  # fmt: skip
            write_archive(out, manifest, folder)
    except OSError as fault:
        raise StateError(f"{fault.filename or out}: {fault.strerror or fault}") from fault
    return manifest


def _copy_config(machine: Machine, folder: Path) -> str:
    """Copy the machine file and the calibration that it names; return where it stands, "" for the program's own."""
    source = machine.source
    if source is None:
        return ""
    _copy(source, folder / source.name)
    named = machine.control.compensation.calibration
    if named and (source.parent / named).exists():
        _copy(source.parent / named, folder / calibration_inside(named))
    return "" if source.samefile(default_machine_path()) else str(source.resolve())


def calibration_inside(named: str) -> PurePosixPath:
    """Place in the archive of the calibration that a machine file names; one from elsewhere has its own."""
    path = PurePosixPath(named)
    return _ELSEWHERE / path.name if path.is_absolute() or ".." in path.parts else path


def _state_files(directory: Path, *, secrets: bool, recordings: bool) -> Iterator[Path]:
    """The files of the machine's directory; the retained memory comes first."""
    found = [path for path in directory.rglob("*") if path.is_file() and not path.is_symlink()]
    for path in sorted(found, key=lambda path: (not path.name.startswith("retain."), path)):
        inside = path.relative_to(directory)
        top = inside.parts[0]
        if inside.as_posix() in _NEVER or path.suffix == ".part" or top.startswith(SET_ASIDE):
            continue
        if (top == RECORDINGS and not recordings) or (inside.as_posix() in _SECRET and not secrets):
            continue
        yield path


def _copy(source: Path, to: Path) -> None:
    to.parent.mkdir(mode=0o700, parents=True, exist_ok=True)
    shutil.copyfile(source, to)


def _copy_journal(directory: Path, folder: Path) -> str:
    """Copy the journal in one transaction; return what is wrong with the copy, "" for a whole one or none."""
    source, to = directory / JOURNAL, folder / JOURNAL
    if not source.exists():
        return ""
    to.parent.mkdir(mode=0o700, parents=True, exist_ok=True)
    try:
        copy_journal(source, to)
        key = places_of(directory).key
        return verify_file(to, read_key(key) if key.exists() else None).wrong
    except DeviceError as fault:
        # A damaged journal is evidence: its files as they are.
        to.unlink(missing_ok=True)
        for path in directory.glob(f"{JOURNAL}*"):
            _copy(path, folder / path.name)
        return f"it cannot be read: {fault}"
