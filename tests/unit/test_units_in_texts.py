"""Units behind numbers that people read: those of every table of limits, and none where a table has none."""

from __future__ import annotations

from gantryctl.machine import field_specs
from gantryctl.service.protocol.tags import TAGS
from gantryctl.units import behind
from support.command_line import ODD_UNITS


def test_every_unit_of_keys_and_tags_reads_well_behind_a_limit() -> None:
    units = {spec.unit for spec in field_specs().values()} | {tag.unit for tag in TAGS}
    assert {"-", "", "deg/s", "N m"} <= units
    for unit in units:
        text = f"the tightest is the inertia: 35.71 of 40{behind(unit)}."
        assert ODD_UNITS.search(text) is None
        assert text.endswith(f" {unit}." if unit not in ("", "-") else "40.")


def test_what_every_command_of_every_test_is_searched_for_is_found() -> None:
    for odd in ("35.71 of 40 -.", "lateness p99 125.892541 us, 0 overruns", "at most 3 -)", "of 3 None,"):
        assert ODD_UNITS.search(odd), odd
    for well in ("no part of it - or all", "12.5 us", "-3.5 of 40 deg", "2 of 3 -o", "1 - 2"):
        assert ODD_UNITS.search(well) is None, well
