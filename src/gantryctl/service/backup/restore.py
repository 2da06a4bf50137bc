"""Puts a backup back in the place of what is there; what was there is set aside, never removed."""

from __future__ import annotations

import os
import shutil
import socket
import tempfile
from contextlib import closing, suppress
from dataclasses import replace
from pathlib import Path, PurePosixPath
from typing import Final, NamedTuple

from gantryctl.errors import DeviceError, StateError, UsageError
from gantryctl.files import write_whole
from gantryctl.machine import Machine, default_machine_path, load_machine
from gantryctl.machine.reading import printable
from gantryctl.operation.state import operator_name
from gantryctl.operation.store import SERVICE_SOCKET, PeerName
from gantryctl.runtime import RetainedMemory, StateLock
from gantryctl.service.backup.archive import Manifest, extract, read_manifest
from gantryctl.service.backup.create import (
    ACCOUNTS,
    CONFIG,
    JOURNAL_FILES,
    RECORDINGS,
    SET_ASIDE,
    STATE,
    calibration_inside,
)
from gantryctl.service.recorder.journal.places import FILE as JOURNAL
from gantryctl.service.recorder.journal.places import KEY, MIRROR, places_of
from gantryctl.service.recorder.journal.proof import verify
from gantryctl.service.recorder.journal.writer import Journal
from gantryctl.service.recorder.run_record import FILE as RUN
from gantryctl.service.recorder.run_record import RunFile
from gantryctl.service.supervisor.users import FILE as USERS

_PLANT: Final = "plant.json"
# Of machine files and calibrations.
_FILE: Final = ".toml"
# Whose directory it is: the next start notes it anew, by the machine file that is in force then.
_OWNER: Final = "machine.json"
_LOCK: Final = "lock"


class Restored(NamedTuple):
    """What a restore has done.

    Attributes:
        manifest: of the backup. set_aside: folder of what was there before.
        config_file: the machine file in force; None for the reference gantry of the program.
        kept: what was not replaced, and why.
    """

    manifest: Manifest
    set_aside: Path
    config_file: Path | None
    kept: tuple[str, ...]


def restore_backup(
    archive: Path, root: Path, config_file: Path | None = None, *, accounts: bool = False
) -> Restored:
    """Restore a machine whose service does not run; its axis may not move until somebody has compared its angle.

    Nothing is changed before the whole archive was checked.

    Args:
        root: the state root.
        config_file: where the machine file goes; where it stood when the backup was made if not given.
        accounts: the accounts of the backup replace those that are here.

    Raises:
        StateError: the archive is damaged, the service runs, or a file cannot be written.
        ConfigError: the machine file of the backup is not valid.
        UsageError: somebody else's state, or a machine file that has no place.
    """
    manifest = read_manifest(archive)
    name = manifest.machine
    if Path(name).name != name or name in ("", ".", ".."):
        raise StateError(f"{archive}: {name!a} is no name of a machine")
    directory = root / name
    try:
        directory.mkdir(parents=True, exist_ok=True)
        # What root restores, the service could not read.
        if os.geteuid() != root.stat().st_uid:
            raise UsageError(f"{root} is of another user: restore as that user, the one of the service")
        _refuse_running(directory)
        with (
            StateLock(directory, lambda: "end what runs this machine first"),
            tempfile.TemporaryDirectory(dir=root, prefix=".restore-") as made,
        ):
            return _Restore(archive, Path(made), root, directory).run(config_file, accounts=accounts)
    except OSError as fault:
        raise StateError(f"{fault.filename or directory}: {fault.strerror or fault}") from fault


def _refuse_running(directory: Path) -> None:
    """Refuse while a service answers, or its recorder writes: the controller may be gone, and its lock with it."""
    if (directory / RUN).exists():
        with closing(RunFile(directory)) as run:
            if not run.hold():
                raise StateError(
                    f"{directory}: the recorder of a service still writes here: wait until it has ended"
                )
    with closing(socket.socket(socket.AF_UNIX)) as asked, suppress(OSError):
        asked.settimeout(5.0)
        with PeerName(directory) as address:
            asked.connect(address)
        raise StateError(f"{directory}: the service runs this machine: end it first")


def _synchronise(path: Path) -> None:
    with path.open("rb") as file:
        os.fsync(file.fileno())


class _Restore:
    """One restore, under the lock of the machine's directory."""

    def __init__(self, archive: Path, folder: Path, root: Path, directory: Path) -> None:
        self._archive, self._folder, self._root, self._directory = archive, folder, root, directory
        self._manifest = extract(archive, folder)
        self._kept: list[str] = []
        before = [path.name.removeprefix(SET_ASIDE) for path in directory.glob(f"{SET_ASIDE}*")]
        number = 1 + max((int(text) for text in before if text.isdigit()), default=0)
        self._set_aside = directory / f"{SET_ASIDE}{number:03d}"

    def run(self, config_file: Path | None, *, accounts: bool) -> Restored:
        """Replace everything; the machine file first, because its place may refuse it."""
        machine = self._machine()
        memory = RetainedMemory(self._folder / STATE).load()
        place = self._place(machine, config_file)
        for path in self._folder.rglob("*"):
            if path.is_file():
                _synchronise(path)
        self._set_aside.mkdir(mode=0o700)
        if place is not None:
            self._put_config(machine, place)
        self._put_state()
        self._put_recordings()
        self._put_accounts(replaced=accounts)
        self._put_key()
        said = f"restored by {operator_name()} from a backup of {self._manifest.made} by {self._manifest.by}"
        if memory is not None:
            # The encoder may have turned meanwhile, and its zero may have been set anew: without a rest position
            # nothing proves the angle, and no power comes on before it was compared with a mark (ENC-10).
            memory = replace(memory, rest_position_counts=None, last_result=said)
            RetainedMemory(self._directory).store(memory)
        self._write_down(said)
        return Restored(self._manifest, self._set_aside, place, tuple(self._kept))

    def _machine(self) -> Machine:
        """The machine of the backup."""
        source = Path(self._manifest.config_file or default_machine_path()).name
        path = self._folder / CONFIG / source
        if not path.exists():
            raise StateError(f"{self._archive}: damaged: {CONFIG}/{source} is missing")
        machine = load_machine(path)
        if machine.name != self._manifest.machine:
            raise StateError(
                f"{self._archive}: {CONFIG}/{source} is of {machine.name}, not of {self._manifest.machine}"
            )
        return machine

    def _place(self, machine: Machine, config_file: Path | None) -> Path | None:
        """Where the machine file goes; None where the program's own one is the same."""
        named = config_file or (Path(self._manifest.config_file) if self._manifest.config_file else None)
        assert machine.source is not None
        if named is None and machine.source.read_bytes() != default_machine_path().read_bytes():
            raise UsageError(
                f"{self._archive}: the backup is of the reference gantry of version {self._manifest.version}, which is "
                "another one than that of this version: name a file for it with --config"
            )
        # Who wrote the archive chose that place: no file but a machine's is replaced unless whoever restores names it.
        if named is not None and config_file is None and named.suffix != _FILE:
            raise UsageError(
                f"{self._archive}: the place of its machine file is {printable(named, 300)}, which does not end with "
                f"{_FILE}: name a place for it with --config"
            )
        if named is not None and not named.absolute().parent.is_dir():
            raise UsageError(f"{named}: there is no such folder; name another place with --config")
        return None if named is None else named.absolute()

    def _put_config(self, machine: Machine, place: Path) -> None:
        """Put the machine file and its calibration in place."""
        assert machine.source is not None
        named = machine.control.compensation.calibration
        files = {PurePosixPath(machine.source.name): place}
        if named:
            files[calibration_inside(named)] = place.parent / named
        for inside, to in files.items():
            path, aside = self._folder / CONFIG / inside, self._set_aside / CONFIG / inside.with_name(to.name)
            if not path.exists() or (to.exists() and to.read_bytes() == path.read_bytes()):
                continue
            # That it is a calibration was found as the machine file was read.
            if to != place and to.suffix != _FILE:
                self._kept.append(f"{to}: a calibration whose name does not end with {_FILE}")
                continue
            if to.exists():
                aside.parent.mkdir(parents=True, exist_ok=True)
                shutil.copy2(to, aside)
            write_whole(to, path.read_bytes(), make_folder=True)

    def _put_state(self) -> None:
        """Set aside what is here, and put what the backup has in its place; the retained memory comes later."""
        stays = {_LOCK, RECORDINGS, SERVICE_SOCKET, RUN}
        if self._journal_is_whole():
            stays |= {*JOURNAL_FILES, MIRROR}
        # A simulated plant is the machine itself and no memory of it: it does not turn back.
        if (self._directory / _PLANT).exists():
            stays.add(_PLANT)
            self._kept.append("the simulated machine: it stands where it stands")
        for path in sorted(self._directory.iterdir()):
            if path.name not in stays and not path.name.startswith(SET_ASIDE):
                path.rename(self._set_aside / path.name)
        for path in sorted((self._folder / STATE).glob("*")):
            if path.name not in stays | {_OWNER} and not path.name.startswith("retain."):
                path.rename(self._directory / path.name)

    def _journal_is_whole(self) -> bool:
        """Whether there is a journal that stays: no event of a whole one is taken away by an older copy."""
        if not (self._directory / JOURNAL).exists():
            return False
        try:
            verdict = verify(self._directory)
        except DeviceError:
            return False
        if not verdict.wrong:
            self._kept.append(f"the journal that is here, {verdict.rows} events")
        return not verdict.wrong

    def _put_recordings(self) -> None:
        """Add the recordings of the backup to those that are here."""
        for path in sorted((self._folder / STATE / RECORDINGS).glob("*")):
            to = self._directory / RECORDINGS / path.name
            to.parent.mkdir(exist_ok=True)
            if not to.exists():
                path.rename(to)

    def _put_accounts(self, *, replaced: bool) -> None:
        source, to = self._folder / ACCOUNTS / USERS, self._root / USERS
        if not source.exists():
            return
        if to.exists() and not replaced:
            self._kept.append("the accounts that are here; --accounts replaces them by those of the backup")
            return
        if to.exists():
            shutil.copy2(to, self._set_aside / USERS)
        write_whole(to, source.read_bytes(), private=True)

    def _put_key(self) -> None:
        """Put the key of the journal in place where there is none: without it the journal would be a stranger's."""
        source, to = self._folder / ACCOUNTS / KEY, places_of(self._directory).key
        if source.exists() and not to.exists():
            to.parent.mkdir(mode=0o700, parents=True, exist_ok=True)
            write_whole(to, source.read_bytes(), private=True)

    def _write_down(self, said: str) -> None:
        """Write into the journal that the machine was restored, if it has one."""
        path = self._directory / JOURNAL
        if path.exists():
            # As the service makes it: its group may read it.
            path.chmod(0o640)
            with closing(Journal(self._directory)) as journal:
                journal.note("service", said)
