"""Parameters: actions of written ones (commands to the axis, limits), and those stored by 1010 and 1011."""

from __future__ import annotations

import json
from collections.abc import Callable, Collection, Mapping
from functools import partial
from pathlib import Path
from typing import Final

from gantryctl.drives.od.velocity_units import unit_of_word
from gantryctl.drives.virtual.axis.drive_axis import DriveAxis
from gantryctl.drives.virtual.axis.hardware import Scaling
from gantryctl.drives.virtual.communication.abort import Abort, SdoAbort
from gantryctl.drives.virtual.communication.dictionary import Dictionary, Key
from gantryctl.errors import StateError
from gantryctl.files import write_whole

_FORMAT: Final = 1


class ParameterStore:
    """Values by index and sub-index that survive a reset, and in a file the end of the process.

    Args:
        path: the file; None keeps them in memory.
    """

    def __init__(self, path: Path | None = None) -> None:
        self._path = path
        self._values: dict[Key, int] = {}
        self.damaged = False
        """The file exists but could not be read: defaults are in force."""
        if path is not None:
            self._load(path)

    def values(self) -> Mapping[Key, int]:
        """Stored values."""
        return self._values

    def save(self, values: Mapping[Key, int], first: int, last: int) -> None:
        """Replace the stored values of a range of indices.

        Raises:
            StateError: the file cannot be written.
        """
        self._replace(
            {key: v for key, v in self._values.items() if not first <= key[0] <= last} | dict(values)
        )

    def drop(self, first: int, last: int) -> None:
        """Delete the stored values of a range of indices.

        Raises:
            StateError: the file cannot be written.
        """
        self._replace({key: v for key, v in self._values.items() if not first <= key[0] <= last})

    def _replace(self, values: dict[Key, int]) -> None:
        if self._path is not None:
            text = {f"{index:04X}:{sub:02X}": value for (index, sub), value in sorted(values.items())}
            write_whole(self._path, json.dumps({"format": _FORMAT, "values": text}, indent=1))
        self._values = values

    def _load(self, path: Path) -> None:
        try:
            data = json.loads(path.read_text())
            if data["format"] != _FORMAT:
                raise ValueError
            self._values = {_key(place): int(value) for place, value in data["values"].items()}
        except FileNotFoundError:
            return
        except (OSError, ValueError, KeyError, TypeError, AttributeError):
            # As a real drive with a damaged memory: defaults are in force, and EMCY 6310 tells (CiA 402).
            self.damaged = True


def _key(place: str) -> Key:
    index, _, sub = place.partition(":")
    return int(index, 16), int(sub, 16)


# Signatures of 1010 and 1011 (CiA 301): the bytes "save" and "load".
SAVE: Final = 0x65766173
LOAD: Final = 0x64616F6C
# Range of indices by sub-index of 1010 and 1011: all, communication, application parameters.
_GROUPS: Final = {1: (0x1000, 0xFFFF), 2: (0x1000, 0x1FFF), 3: (0x2000, 0xFFFF)}

# Windows, thresholds and ceilings in the unit of 60A9; ramps in that or in one of their own.
_SPEEDS: Final = (0x606D, 0x606F, 0x607F)
_RAMPS: Final = (0x6083, 0x6084, 0x6085)


class Parameters:
    """Hooks between the object dictionary and the axis.

    Args:
        od: the dictionary.
        axis: obeys.
        scaling: units.
        store: 1010 and 1011.
        saving: called when parameters are saved, for drives that are slow then.
        modes: that 6060 takes.
    """

    def __init__(
        self,
        od: Dictionary,
        axis: DriveAxis,
        scaling: Scaling,
        store: ParameterStore,
        saving: Callable[[], None],
        modes: Collection[int],
    ) -> None:
        self._od, self._axis, self._scaling = od, axis, scaling
        self._store, self._saving, self._modes = store, saving, modes
        self._to_drop: set[int] = set()
        od.actions[0x6040, 0] = axis.control
        od.checks[0x6060, 0] = self._check_mode
        od.checks[0x60A9, 0] = _check_unit
        od.actions[0x60A9, 0] = self._set_unit
        od.actions[0x6060, 0] = axis.reference.set_mode
        od.actions[0x6072, 0] = lambda value: axis.limit_torque(scaling.nm(value))
        for sub in (1, 2):
            od.actions[0x60C2, sub] = self._cycle_time
        for sub in _GROUPS:
            od.readers[0x1010, sub] = od.readers[0x1011, sub] = lambda: 1
            od.checks[0x1010, sub] = partial(self._save, sub)
            od.checks[0x1011, sub] = partial(self._load, sub)

    def _check_mode(self, value: int) -> None:
        if value not in self._modes:
            raise SdoAbort(Abort.VALUE)

    def _set_unit(self, word: int) -> None:
        unit = unit_of_word(word)
        if unit is None:
            return
        scaling = self._scaling
        speed, ramp = scaling.per_rad_s, scaling.ramp_per_rad_s2
        scaling.count_speed_in(unit)
        # What the bus does not see is a speed, not a number: it stays the same speed.
        for indices, change in (
            (_SPEEDS, scaling.per_rad_s / speed),
            (_RAMPS, scaling.ramp_per_rad_s2 / ramp),
        ):
            for index in indices:
                if index not in self._od.visible.objects:
                    self._od.set(index, 0, max(1, round(self._od.number(index) * change)))

    def _cycle_time(self, _value: int) -> None:
        self._axis.reference.cycle_time_written = True

    def _save(self, sub: int, value: int) -> None:
        # A wrong signature is refused with 0800 0020 (CiA 301), and nothing is stored while there is torque.
        if value != SAVE:
            raise SdoAbort(Abort.STORE)
        if self._axis.stage.energised:
            raise SdoAbort(Abort.STATE)
        first, last = _GROUPS[sub]
        try:
            self._store.save(self._od.storable(first, last), first, last)
        except StateError:
            raise SdoAbort(Abort.STORE) from None
        self._to_drop.discard(sub)
        self._saving()

    def _load(self, sub: int, value: int) -> None:
        # The defaults become valid at the next reset (CiA 301).
        if value != LOAD:
            raise SdoAbort(Abort.STORE)
        if self._axis.stage.energised:
            raise SdoAbort(Abort.STATE)
        self._to_drop.add(sub)

    def reset(self, communication_only: bool) -> bool:
        """Set power-on values, after forgetting what 1011 asked for; False if the store cannot be written."""
        written = True
        for sub in sorted(self._to_drop):
            try:
                self._store.drop(*_GROUPS[sub])
            except StateError:
                written = False
        self._to_drop.clear()
        self._od.reset(self._store.values(), communication_only)
        if self._od.known(0x60A9, 0):
            self._set_unit(self._od.number(0x60A9))
        self._axis.limit_torque(self._scaling.nm(self._od.number(0x6072)))
        return written


def _check_unit(word: int) -> None:
    if unit_of_word(word) is None:
        raise SdoAbort(Abort.VALUE)
