"""Outputs of a controller that is not well, bit by bit, and a ring encoder in alarm."""

from __future__ import annotations

import math
from dataclasses import replace
from types import SimpleNamespace

import pytest

from gantryctl.drives.canopen.nodes.outputs import OutputWriter
from gantryctl.drives.canopen.nodes.ring_encoder import RingEncoder
from gantryctl.drives.canopen.settings import InputBits, IoNodeSettings, OutputBits
from gantryctl.image import DriveRequest, OutputImage
from gantryctl.wiring.canopen import canopen_settings
from unit.drives.canopen.canopen_bench import machine

pytestmark = pytest.mark.can


def words(well: bool, scans: int = 200) -> list[int]:
    """60FE:01 with the enable of the drive at bit 0 and the watchdog at bit 1."""
    writer = OutputWriter(
        replace(canopen_settings(machine()), outputs=OutputBits(drive_enable=0, watchdog=1))
    )
    found = []
    for _ in range(scans):
        writer.take(OutputImage(DriveRequest.ENABLE), brake_released=False, well=well)
        found.append(writer.drive_word & 3)
    return found


def test_the_watchdog_has_edges_and_the_enable_is_on_while_all_is_well() -> None:
    assert set(words(True)) == {1, 3}


def test_a_watchdog_relay_at_the_node_has_its_edges_too() -> None:
    """Bit 2 of 6200: an edge every 24 ms, of 100 ms after which the relay opens, and no bit of the drive."""
    node = IoNodeSettings(3, InputBits(), OutputBits(watchdog=2))
    writer = OutputWriter(replace(canopen_settings(machine()), outputs=OutputBits(), io=node))
    found = []
    for _ in range(14):
        writer.take(OutputImage(DriveRequest.ENABLE), brake_released=False, well=True)
        found.append((writer.node_word, writer.drive_word & ~1))
    assert found == [(4, 0)] * 6 + [(0, 0)] * 6 + [(4, 0)] * 2


def test_a_drive_that_is_not_heard_gets_no_edge_and_no_enable() -> None:
    assert set(words(False)) == {0}


@pytest.mark.parametrize(
    ("data", "lost", "known"),
    [
        ("10 00 00 00 00 00", False, True), ("10 00 00 00 01 00", False, False), ("10 00 00 00 00 80", False, False),
        ("10 00 00 00 00 00", True, False), ("", False, False),
    ],
)  # fmt: skip
def test_a_ring_encoder_in_alarm_or_lost_has_no_angle(data: str, lost: bool, known: bool) -> None:
    """Bytes 4 and 5 are 6503, its alarms."""
    ring = object.__new__(RingEncoder)
    watch = SimpleNamespace(data=bytes.fromhex(data) or None, received=1, age=0)
    ring.node = SimpleNamespace(lost=lost, watch=watch)  # type: ignore[assignment]
    ring.angle = SimpleNamespace(read=lambda counts, age: 1.5)  # type: ignore[assignment]
    # The scan of the telegram, and the next, in which the same telegram is one scan old.
    for age in (0, 1):
        watch.age = age
        assert math.isfinite(ring.angle_rad()) is known
