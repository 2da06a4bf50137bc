"""Profiles of drive models: what no object of a drive says, as files; chosen by object 1018 and what a drive has."""

from __future__ import annotations

from gantryctl.drives.profiles.choice import (
    load_profile,
    places_of_maker,
    profile_names,
    profile_of,
)
from gantryctl.drives.profiles.profile import (
    Contradiction,
    DangerousDefault,
    DriveProfile,
    Gain,
    Saving,
    SpeedLoop,
    Tried,
    key_of,
)

__all__ = [
    "Contradiction",
    "DangerousDefault",
    "DriveProfile",
    "Gain",
    "Saving",
    "SpeedLoop",
    "Tried",
    "key_of",
    "load_profile",
    "places_of_maker",
    "profile_names",
    "profile_of",
]
