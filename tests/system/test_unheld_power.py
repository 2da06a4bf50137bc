"""A service whose power nobody has control of: switched off by itself, told in the journal."""

from __future__ import annotations

import sys
from pathlib import Path

import pytest

from gantryctl.service.recorder.journal.reading import read_journal
from support.command_line import machine_file
from support.service_process import Service, add_users

pytestmark = [
    pytest.mark.skipif(sys.platform != "linux", reason="the service needs Linux"),
    pytest.mark.slow,
]
LIMIT_S = 2.0


def test_power_that_a_page_left_on_goes_off(tmp_path: Path) -> None:
    config = machine_file(tmp_path / "machine.toml", {"monitors.unheld_power_time_s": LIMIT_S})
    add_users(tmp_path)
    with Service(tmp_path, "--config", str(config)) as service:
        with service.page("viewer", queue=None) as watcher:
            with service.page("operator") as page:
                page.power_up()
                held_s = page.tags["time_s"]
                # Longer than the limit: whoever has control keeps power.
                page.until(lambda tags: tags["time_s"] > held_s + 1.5 * LIMIT_S)
                assert page.tags["power"]
                assert page.tags["unheld_power_left_s"] is None
            # The page is gone without a word.
            begun_s = watcher.until(lambda tags: tags["unheld_power_left_s"] is not None)["time_s"]
            off = watcher.until(lambda tags: tags["power_phase"] == "off")
            # The way down takes 0.6 s at most: brake 0.15 s, unloading, disabling.
            assert LIMIT_S - 0.1 <= off["time_s"] - begun_s <= LIMIT_S + 1.0
            assert off["unheld_power_left_s"] is None
            assert off["brake_open"] is False
            assert off["alarms"] == []
        entries = read_journal(service.directory)
    told = [entry for entry in entries if "nobody had control" in entry.values["text"]]
    assert len(told) == 1
