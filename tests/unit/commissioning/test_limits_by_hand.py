"""Limits that steps of commissioning set and grant: for a test move, for a quick stop, for a watchdog."""

from __future__ import annotations

import math
from contextlib import nullcontext
from types import SimpleNamespace
from typing import Any

import pytest

from gantryctl.commissioning import steps_motion, steps_sign
from gantryctl.commissioning.stopping import steps_silence
from gantryctl.commissioning.stopping.quick_stop import QuickStop
from gantryctl.drives.canopen.bus.sdo import SdoError
from gantryctl.errors import AlarmStop, DeviceError
from gantryctl.machine import with_values
from unit.commissioning.hand_drive import MACHINE, context

pytestmark = pytest.mark.can


class Rounding:
    """Objects that hold what they are told, and so much more."""

    def __init__(self, more: int, *, refused: int = 0, lacks: tuple[int, ...] = ()) -> None:
        self.more, self.refused, self.lacks = more, refused, lacks
        self.written: dict[int, int] = {}

    def optional(self, index: int) -> int | None:
        return None if index in self.lacks else 0

    def set(self, index: int, sub: int, value: int) -> None:
        if self.refused:
            raise SdoError(index, sub, self.refused)
        self.written[index] = value

    def number(self, index: int) -> int:
        return self.written[index] + self.more


def lowered(sdo: Rounding) -> dict[int, int]:
    units = SimpleNamespace(torque_unit_nm=0.257)
    drive = SimpleNamespace(node=SimpleNamespace(sdo=sdo), opened=SimpleNamespace(units=units))
    axis: Any = SimpleNamespace(drive=drive, ratio=1144.0)
    return steps_sign._lower_limits(context(MACHINE), axis)


@pytest.mark.parametrize("more", [-2, -1, 0, 1, 2])
def test_a_limit_for_a_test_move_is_held_but_for_a_rounding(more: int) -> None:
    """Half of 257 N m are 500 per mille."""
    if abs(more) > 1:
        with pytest.raises(DeviceError, match="6072 does not take 500"):
            lowered(Rounding(more))
    else:
        assert lowered(Rounding(more))[0x6072] == 500 + more


def test_a_drive_without_such_a_limit_goes_on_and_a_silent_one_does_not() -> None:
    assert list(lowered(Rounding(0, lacks=(0x6072,)))) == [0x6080]
    assert lowered(Rounding(0, refused=0x0601_0002)) == {}
    with pytest.raises(SdoError, match="no answer"):
        lowered(Rounding(0, refused=0x0504_0000))


@pytest.mark.parametrize(
    ("dec", "doubt", "hard"),
    [(5.4, 0.0, False), (6.2, 0.0, False), (6.3, 0.2, False), (6.3, 0.0, True), (math.nan, 0.0, True)],
)
def test_a_quick_stop_is_a_seventh_harder_at_the_most(
    monkeypatch: pytest.MonkeyPatch, dec: float, doubt: float, hard: bool
) -> None:
    """5.4 deg/s2 were set: 6.21 may be seen, less what one scan more or less makes of it."""
    monkeypatch.setattr(steps_motion, "_at_speed", lambda *_: nullcontext(None))
    seen = QuickStop(way_deg=3.0, dec_deg_s2=dec, uncertainty_deg_s2=doubt)
    monkeypatch.setattr(steps_motion, "measure_quick_stop", lambda *_: seen)
    decs: list[float] = []
    if hard:
        with pytest.raises(AlarmStop, match="too hard"):
            steps_motion._quick_stop(context(MACHINE), 6.0, decs)
    else:
        assert steps_motion._quick_stop(context(MACHINE), 6.0, decs)[:2] == ("quick stop", 3.0)
        assert decs == [dec]


@pytest.mark.parametrize(
    ("wired", "falls"),
    [
        ({}, None), ({"can.outputs.watchdog": 16}, [("watchdog", 0.1)]),
        ({"can.io.node": 3, "can.io.outputs.drive_enable": 0}, [("watchdog_heartbeat", 0.15), ("watchdog", 0.05)]),
    ],
)  # fmt: skip
def test_a_watchdog_acts_within_the_time_of_its_relay_or_of_its_node(
    wired: dict[str, object], falls: list[tuple[str, float]] | None
) -> None:
    """100 ms of the relay; the heartbeat is missed after 150 ms, and the node said 50 ms for a whole silence."""
    found = steps_silence._watchdog_of(with_values(MACHINE, wired), 0.05)
    told = None if found is None else [(fall.name, fall.limit_s) for fall in found.falls]
    assert told == falls
