"""The profile of an object dictionary, for drives in software; a controller of a real drive reads none."""

from __future__ import annotations

from gantryctl.drives.od.object_table import ObjectTable, facts_of_table
from gantryctl.drives.profiles.choice import load_profile, profile_names, profile_of
from gantryctl.drives.profiles.profile import DriveProfile


def profile_of_table(table: ObjectTable) -> DriveProfile | None:
    """By the name of a shipped table, else as of a drive; None where no profile fits."""
    named = [profile for profile in map(load_profile, profile_names()) if profile.table == table.drive]
    return named[0] if named else profile_of(facts_of_table(table))
