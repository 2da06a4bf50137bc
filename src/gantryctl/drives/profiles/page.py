"""The reference page of the shipped profiles, `docs/reference/drive-profiles.md`."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Final

from gantryctl.drives.profiles.choice import load_profile, profile_names
from gantryctl.drives.profiles.profile import DriveProfile

_HEAD: Final = """# Drive profiles

Written by `python -m gantryctl.drives.profiles.page docs/reference/drive-profiles.md`; do not edit, a test compares.
The files are in `configs/drives`; [choose a drive profile](../how-to/choose-a-drive-profile.md) says how one is chosen
and written.

A profile says what no object of the drive says. *Virtual drive*: held against a virtual drive with the model's object
dictionary, never against the hardware. *From the manual, not tried*: nobody has held it against anything. What had no
source was left out.

| profile | drive | speed in 60FF | CSV | tried |
|---|---|---|---|---|
"""
_CSV: Final = 9


def reference_page() -> str:
    """The whole page."""
    profiles = [load_profile(name) for name in profile_names()]
    rows = "".join(
        f"| [`{p.name}`](#{p.name}) | {p.maker} {p.model} | {p.units.velocity or 'set by the tool'} | "
        f"{'yes' if _CSV in p.modes else 'no'} | {p.tried.value} |\n"
        for p in profiles
    )
    return f"{_HEAD}{rows}\n" + "\n".join(_section(profile) for profile in profiles)


def profile_lines(profile: DriveProfile) -> tuple[tuple[str, str], ...]:
    """What a profile says, as name and text; for the page and for `drive profiles show`."""
    match, units, loop = profile.match, profile.units, profile.speed_loop
    told_apart = [f"has {place}" for place in match.has] + [f"lacks {place}" for place in match.lacks]
    codes = ", ".join(f"{code:X}h" for code in match.products) or "any product code"
    gains = [] if loop is None else [("kp", loop.kp), *([("ki", loop.ki)] if loop.ki is not None else [])]
    return (
        ("drive", f"{profile.maker} {profile.model}"),
        ("tried", profile.tried.value),
        ("chosen by", ", ".join([f"vendor {match.vendor:X}h", codes, *told_apart])),
        ("speed", _speed(profile)),
        ("ramps", f"{_size(units.ramp_size)}{units.ramp or units.velocity or 'unit of speed'} a second"),
        ("position", units.position),
        ("torque", f"{units.torque}; 6076 in {_rated(units.rated_torque_per_nm)}"),
        ("modes", ", ".join(map(str, profile.modes)) + ("" if _CSV in profile.modes else ": no CSV (9)")),
        *((f"gain {name}", f"{gain.object}, {gain.unit or 'unit not known'}") for name, gain in gains),
        ("stores by", profile.saving.text),
        *((f"default {bad.object} = {bad.value}", bad.because) for bad in profile.dangerous_defaults),
        *((f"lacks {what}", text) for what, text in profile.lacks.items()),
        *((f"error {code}h", text) for code, text in profile.error_texts.items()),
        *(("source", text) for text in profile.sources),
    )


def _section(profile: DriveProfile) -> str:
    rows = "".join(f"| {name} | {text} |\n" for name, text in profile_lines(profile))
    return f"## {profile.name}\n\n| | |\n|---|---|\n{rows}"


def _speed(profile: DriveProfile) -> str:
    unit = profile.units.velocity
    if unit is None:
        return "set in the maker's tool: `[can] velocity_unit` must name it"
    return f"{unit}, written to 60A9" if profile.units.velocity_by_60A9 else unit


def _size(size: float) -> str:
    return "" if size == 1.0 else f"{size:g} "


def _rated(per_nm: float) -> str:
    return {1e3: "mN m", 1e6: "uN m"}.get(per_nm, f"1/{per_nm:g} N m")


if __name__ == "__main__":
    Path(sys.argv[1]).write_text(reference_page(), encoding="utf-8")
