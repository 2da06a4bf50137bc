"""What an alarm says was measured, and against which limit: in the units that people read, by hand; both ways.

A value without its sign here is told without it, one with a sign has that of the way.
"""

from __future__ import annotations

from typing import NamedTuple

import pytest

from gantryctl.program.alarms.codes import Code
from gantryctl.program.alarms.words import Said
from gantryctl.units import rad
from unit.program import judges
from unit.program.judges import Acts
from unit.program.parts import BOTH, Parts

approx = pytest.approx


class Way(NamedTuple):
    """A value with the sign of the way."""

    value: float


# A judge, what it is given, the code, and the values of its message.
SAID: dict[str, tuple[Acts, float, Code, dict[str, float | Way]]] = {
    "slip": (judges.slips, rad(0.03), Code.BRK_03, {"measured": 0.03, "limit": 0.02}),
    "slip without torque": (
        judges.slips_without_torque, rad(0.03), Code.BRK_04, {"measured": 0.03, "limit": 0.02}
    ),
    "way in HOLD": (judges.moves_in_hold, rad(0.2), Code.BRK_13, {"measured": 0.2, "speed": 0.0}),
    "speed in HOLD": (judges.turns_in_hold, rad(0.2), Code.BRK_13, {"measured": 0.0, "speed": 0.2}),
    "torque in HOLD": (judges.pushes_too_much_in_hold, 80.0, Code.BRK_13, {"measured": 0.0, "speed": 0.2}),
    "ramp": (judges.turns_on_its_ramp, rad(0.6), Code.DRV_07, {"measured": 0.6, "limit": 0.5}),
    "end of the ramp": (judges.turns_after_its_ramp, rad(0.06), Code.DRV_07, {"measured": 0.06, "limit": 0.05}),
    "lag that warns": (judges.lags, rad(0.02), Code.CTL_12, {"measured": 0.02, "limit": 0.015, "trip": 0.03}),
    "lag": (judges.lags_too_far, rad(0.04), Code.CTL_03, {"measured": 0.04, "limit": 0.03, "speed": 0.0}),
    "deviation": (
        judges.does_not_obey, rad(0.6), Code.CTL_05, {"measured": Way(0.6), "command": 0.0, "limit": 0.5}
    ),
    # Each 100 ms to the other side, 5 Hz: eleven times, the first after 99 ms.
    "swing": (judges.swings, rad(0.21), Code.CTL_08, {"measured": 0.21, "rate": 5.0, "time_s": 1.099}),
    "overspeed": (judges.is_too_fast, rad(6.7), Code.CTL_04, {"measured": 6.7, "limit": 6.6}),
    "over-travel": (judges.is_beyond, rad(181.0), Code.LIM_02, {"measured": Way(181.0), "limit": Way(180.5)}),
    "brake": (judges.feels_the_brake, rad(0.02), Code.BRK_05, {"measured": 0.0, "error": 0.02}),
    "standstill": (judges.leaves_standstill, rad(0.03), Code.CTL_13, {"measured": 0.03, "limit": 0.02}),
    "torque limit": (judges.grows_at_the_torque_limit, rad(0.01), Code.CTL_07, {"measured": 0.01, "time_ms": 200.0}),
    # 200 of 257 N m
    "heavy": (judges.is_heavy, 200.0, Code.CTL_06, {"measured": 77.821, "torque": 200.0}),
    "no torque": (
        judges.loses_its_torque, rad(0.06), Code.DRV_13, {"measured": 0.0, "deviation": 0.06, "time_ms": 50.0}
    ),
    "standing count": (judges.stands_under_torque, 20.0, Code.ENC_02, {"value": Way(20.0), "time_ms": 30.0}),
    "wrong sign": (judges.pushes_with_all, 320.0, Code.ENC_12, {"speed": 0.4, "torque": Way(320.0)}),
    "speed reading": (judges.is_a_wrong_speed, rad(22.0), Code.ENC_14, {"value": Way(22.0), "limit": 21.0}),
    "proof": (judges.gives_too_much, 91.0, Code.DRV_14, {"torque": Way(91.0), "wanted": Way(30.0)}),
    "warm": (judges.is_warm("THM-01"), 0.85, Code.THM_01, {"measured": 85.0, "limit": 80.0}),
    "hot": (judges.is_warm("THM-03"), 0.96, Code.THM_03, {"measured": 96.0, "limit": 95.0}),
    "too hot": (judges.is_warm("THM-04"), 1.02, Code.THM_04, {"measured": 102.0}),
}  # fmt: skip


@BOTH
@pytest.mark.parametrize("name", SAID)
def test_an_alarm_says_what_was_measured(name: str, way: float) -> None:
    acts, given, code, expected = SAID[name]
    parts = Parts()
    acts(parts, way * given)
    said: dict[str, object] = dict(parts.alarms.active[code].values)
    for value in list(said.values()):
        if isinstance(value, Said):
            said |= value.values
    assert {key: said[key] for key in expected} == {
        key: _near(key, value, way) for key, value in expected.items()
    }


def _near(key: str, value: float | Way, way: float) -> object:
    size = way * value.value if isinstance(value, Way) else value
    # A scan of 1 ms more or less until a time is over.
    return approx(size, abs=1.01 if key == "time_ms" else 1e-2 if key == "rate" else 1e-3)
