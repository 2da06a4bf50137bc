"""State directory: files that survive between two runs of the command line.

`<root>/<machine name>/` holds the retained memory of the controller, the plant of the simulator, and traces. It is
locked while a run uses it.
"""

from __future__ import annotations

import hashlib
import json
import os
from collections.abc import Sequence
from datetime import UTC, datetime
from pathlib import Path
from typing import TYPE_CHECKING, Final, NamedTuple

from gantryctl.errors import StateError, UsageError
from gantryctl.files import indented_json, remove_drafts, write_whole
from gantryctl.runtime import Retained, RetainedMemory, StateLock
from gantryctl.trace.naming import oldest_first

if TYPE_CHECKING:
    from gantryctl.machine import Machine

STATE_VARIABLE: Final = "GANTRYCTL_STATE"
_PLANT_FILE: Final = "plant.json"
_BUS_FILE: Final = "bus.json"
_OWNER_FILE: Final = "machine.json"
SERVICE_SOCKET: Final = "control.sock"
"""Local socket of a running service, in the machine's directory."""


class PeerName:
    """The address of the socket, through a handle of its directory; a context manager."""

    # A socket address takes 108 bytes; the path of a state directory may be longer.
    def __init__(self, directory: Path) -> None:
        self._handle = os.open(directory, os.O_PATH | os.O_DIRECTORY)
        self.address = f"/proc/self/fd/{self._handle}/{SERVICE_SOCKET}"

    def __enter__(self) -> str:
        return self.address

    def __exit__(self, *_: object) -> None:
        os.close(self._handle)


TIME_FORMAT: Final = "%Y-%m-%dT%H:%M:%SZ"
"""Date and time in records, UTC."""


def time_text(when: datetime) -> str:
    """Date and time for a record.

    Args:
        when: in UTC.
    """
    # Without its zone: the C code of datetime asks a zone by a name that it makes anew at each call, and CPython keeps
    # such names in its cache of methods, up to 512 of 64 bytes: blocks that grow for days and look like a leak.
    return when.replace(tzinfo=None).strftime(TIME_FORMAT)


def now_text() -> str:
    """Date and time now, for a record."""
    return time_text(datetime.now(UTC))


def state_root() -> Path:
    """`$GANTRYCTL_STATE`, else `$XDG_STATE_HOME/gantryctl`, else `~/.local/state/gantryctl`."""
    named = os.environ.get(STATE_VARIABLE)
    if named:
        return Path(named)
    # XDG Base Directory Specification: state goes to $XDG_STATE_HOME, and to ~/.local/state where that is not set.
    base = os.environ.get("XDG_STATE_HOME")
    return (Path(base) if base else Path.home() / ".local" / "state") / "gantryctl"


def last_recording() -> Path:
    """The newest recording that any command has left in the state directory.

    Of one machine the one with the highest number, of several machines by date.

    Raises:
        UsageError: there is no recording.
    """
    root = state_root()
    folders = [[*folder.glob("*.parquet"), *folder.glob("*.arrows")] for folder in root.glob("*/traces")]
    newest = [oldest_first(files)[-1] for files in folders if files]
    if not newest:
        raise UsageError(f"no recording under {root} yet: `gantryctl move` makes one, or name a file")
    return max(newest, key=lambda file: file.stat().st_mtime_ns)


class BusSummary(NamedTuple):
    """Telegrams of the last run of a drive on a bus: when it ended, and lines for people."""

    ended: str
    lines: tuple[str, ...]


def last_bus(machine: Machine) -> BusSummary | None:
    """What the last run of a machine has counted on its bus; None before the first, and for a damaged file."""
    try:
        data = json.loads((state_root() / machine.name / _BUS_FILE).read_text(encoding="utf-8"))
        return BusSummary(str(data["ended"]), tuple(map(str, data["lines"])))
    except (OSError, ValueError, KeyError, TypeError):
        return None


def plant_hash(machine: Machine) -> str:
    """Hash of everything the simulated plant is made of."""
    # Control, speeds and monitors are left out: a change there leaves the plant standing where it stands.
    parts = {
        name: getattr(machine, name).model_dump(mode="json")
        for name in ("drive", "plant", "axis", "motor", "brake")
    }
    return hashlib.sha256(json.dumps(parts, sort_keys=True).encode()).hexdigest()


def state_hash(machine: Machine) -> str:
    """Hash of everything that retained memory and plant mean something by: gear, motor, encoder, plant."""
    # Who reads recordings and journals has no machine: its tables take a tenth of a second.
    from gantryctl.machine import identity_hash

    # Zero and rest position are counts of this encoder behind this gear; the bus that leads to it may be another one.
    return f"{identity_hash(machine)}-{plant_hash(machine)}"


class StateStore:
    """The state of one machine on disk; a context manager that holds the lock.

    Raises:
        StateError: the directory cannot be made, another run uses it, or it is that of another machine of this name.
    """

    def __init__(self, machine: Machine, root: Path | None = None) -> None:
        self.directory = (root or state_root()) / machine.name
        try:
            self.directory.mkdir(parents=True, exist_ok=True)
        except OSError as fault:
            raise StateError(
                f"state directory {self.directory} cannot be made: {fault.strerror or fault}"
            ) from fault
        self._memory = RetainedMemory(self.directory)
        self._lock = StateLock(self.directory, self._advice)
        self._machine = machine
        self._plant_hash = plant_hash(machine)

    def _advice(self) -> str:
        # A second controller on one machine is impossible: the service holds the lock while its process lives.
        if (self.directory / SERVICE_SOCKET).exists():
            return "the service runs this machine: add --service, or `gantryctl attach`"
        return "wait for it, or use another directory or --fresh"

    def __enter__(self) -> StateStore:
        self._lock.__enter__()
        try:
            for folder in (self.directory, self.traces):
                remove_drafts(folder)
            self._claim()
        except BaseException:
            self._lock.__exit__(None, None, None)
            raise
        return self

    def _claim(self) -> None:
        """Note the machine file that the directory belongs to, and refuse another one of the same name.

        A file that was changed goes on with its state; a copy shares it; a file that has moved takes it along.
        """
        source = self._machine.source
        if source is None:
            return
        path, mine = self.directory / _OWNER_FILE, state_hash(self._machine)
        try:
            data = json.loads(path.read_text(encoding="utf-8"))
            owner, theirs = Path(data["file"]), str(data["state"])
        # The first run; a damaged note says nothing about the state.
        except (OSError, ValueError, KeyError, TypeError):
            owner, theirs = source, ""
        if owner != source and owner.exists():
            if theirs == mine:
                return
            raise StateError(
                f"{source} and {owner} are different machines of one name, {self._machine.name}, and the state in "
                f"{self.directory} is that of the latter: give one of them another name in [machine], or another "
                f"directory in {STATE_VARIABLE}"
            )
        if (owner, theirs) != (source, mine) or not path.exists():
            write_whole(path, json.dumps({"file": str(source), "state": mine}, indent=1), private=True)

    def __exit__(self, *_raised: object) -> None:
        self._lock.__exit__(None, None, None)

    @property
    def traces(self) -> Path:
        """Folder of recordings unless another place is named."""
        return self.directory / "traces"

    @property
    def notes(self) -> tuple[str, ...]:
        """Faults of the retained memory that loading has bridged."""
        return self._memory.notes

    def load_retained(self) -> Retained | None:
        """The controller's memory; None before the first run."""
        return self._memory.load()

    def store_retained(self, record: Retained) -> None:
        """Keep the controller's memory; StateError where the directory is no longer the one that is held."""
        # A directory that was moved away is not begun anew: it may come back, and would then be another one.
        self._lock.check()
        self._memory.store(record)

    def load_plant(self) -> tuple[dict[str, float], bool] | None:
        """State of the simulated plant, and whether it belongs to this very plant; None before the first run.

        Raises:
            StateError: the file is damaged.
        """
        path = self.directory / _PLANT_FILE
        if not path.exists():
            return None
        try:
            data = json.loads(path.read_text(encoding="utf-8"))
            state = {str(k): float(v) for k, v in data["state"].items()}
            return state, data["plant"] == self._plant_hash
        except (OSError, ValueError, KeyError, TypeError, AttributeError) as fault:
            raise StateError(
                f"{path}: the simulated plant cannot be read ({fault}); `gantryctl sim reset` makes a new one"
            ) from fault

    def store_plant(self, state: dict[str, float]) -> None:
        """Keep the simulated plant, as `store_retained`."""
        self._lock.check()
        # Python writes the shortest decimal that reads back as the same float: the state survives bit for bit.
        text = indented_json({"plant": self._plant_hash, "state": state}, allow_nan=False)
        write_whole(self.directory / _PLANT_FILE, text, private=True)

    def store_bus(self, lines: Sequence[str]) -> None:
        """Keep what a run has counted on the bus, as `store_retained`."""
        self._lock.check()
        text = indented_json({"ended": now_text(), "lines": list(lines)})
        write_whole(self.directory / _BUS_FILE, text, private=True)

    def forget(self) -> None:
        """Remove plant and retained memory: the next run starts from a new machine."""
        for path in [self.directory / _PLANT_FILE, *self.directory.glob("retain.*")]:
            path.unlink(missing_ok=True)
