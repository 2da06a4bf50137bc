"""Choice of a profile: by its name, or by what a drive says of itself."""

from __future__ import annotations

import functools
from collections.abc import Mapping
from pathlib import Path

from gantryctl.drives.od.facts import DriveFacts
from gantryctl.drives.profiles.profile import DriveProfile, key_of, read_profile
from gantryctl.errors import UsageError
from gantryctl.machine import configs_folder


@functools.cache
def _shipped() -> Mapping[str, DriveProfile]:
    folder = configs_folder() / "drives"
    return {path.stem: read_profile(path) for path in sorted(folder.glob("*.toml"))}


def profile_names() -> tuple[str, ...]:
    """Names of the shipped profiles."""
    return tuple(_shipped())


def load_profile(name: str) -> DriveProfile:
    """A shipped profile by its name, or one of the user by its file.

    Raises:
        UsageError: there is no such profile. ConfigError: the file is not a profile.
    """
    if name.lower().endswith(".toml"):
        return read_profile(Path(name))
    found = _shipped().get(name)
    if found is None:
        raise UsageError(
            f"there is no drive profile '{name}'; there are: {', '.join(_shipped())}, or FILE.toml"
        )
    return found


def profile_of(facts: DriveFacts) -> DriveProfile | None:
    """The profile of a drive by object 1018 and what it has; None where none fits, or several do."""
    found = [profile for profile in _shipped().values() if profile.match.fits(facts)]
    return found[0] if len(found) == 1 else None


def places_of_maker(vendor: int) -> tuple[tuple[int, int], ...]:
    """Objects by which the models of a maker are told apart."""
    matches = [profile.match for profile in _shipped().values() if profile.match.vendor == vendor]
    return tuple({key_of(place): None for match in matches for place in (*match.has, *match.lacks)})
