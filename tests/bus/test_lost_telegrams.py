"""Telegrams of the drive that are lost: what came with them is not believed, and the rest still is."""

from __future__ import annotations

import itertools

import pytest

from bus.bus_rig import FEEDBACK_DEG, NOMINAL_M, QUICK_STOP_DEG, BusRig, bus_machine, few_at_1_ms
from gantryctl.drives.virtual.axis.cia402 import State
from gantryctl.program import AxisState, PowerPhase

pytestmark = pytest.mark.can

STATE_AND_POSITION, SPEED_AND_INPUTS = 1, 2
LOST = ((STATE_AND_POSITION,), (SPEED_AND_INPUTS,), (STATE_AND_POSITION, SPEED_AND_INPUTS))
# Lost for good, or for 60 ms; owner of the brake and scan period take turns.
ROWS = [
    (speed, lost, for_good, ("drive", "object_60FE")[n % 2], (1.0, 4.0, 10.0)[n // 2 % 3])
    for n, (speed, lost, for_good) in enumerate(itertools.product((6.0, -3.0, 1.0), LOST, (True, False)))
]


@pytest.mark.parametrize(("speed", "lost", "for_good", "owner", "scan_ms"), few_at_1_ms(ROWS))
def test_a_lost_telegram_ends_in_a_quick_stop(
    speed: float, lost: tuple[int, ...], for_good: bool, owner: str, scan_ms: float
) -> None:
    machine = bus_machine(owner, scan_ms, changes={"plant.load.eccentricity_m": NOMINAL_M})
    rig = BusRig(machine, 60.0).power_up().cruise(speed)
    begun = len(rig.ticks)
    for number in lost:
        rig.drop_telegram(number, None if for_good else round(60.0 / scan_ms))
    rig.run(4.0)
    assert rig.way_deg(begun - 1) < QUICK_STOP_DEG[abs(speed)]
    assert rig.stops[0] == "CAN-03", rig.told
    assert rig.axis.power.phase is PowerPhase.OFF, rig.axis.power.phase
    assert not rig.ticks[-1].brake_open
    assert rig.ticks[-1].state is State.SWITCH_ON_DISABLED
    assert not rig.enabled_again(begun)
    told = rig.first_told
    if for_good:
        # One lost: nothing else is raised, and nothing is said that came with the telegram.
        assert ("the angle is not known" in told) == (STATE_AND_POSITION in lost), told
        torque = "orque off commanded" in told or "orque off and brake commanded" in told
        assert torque == (STATE_AND_POSITION in lost), told
        assert ("brake commanded" in told) == (SPEED_AND_INPUTS in lost), told
        assert ("press the emergency stop" in told) == torque, told
    else:
        assert rig.stops == ["CAN-03"], rig.told
        # Motor side, 0.05 deg as for every angle that is told.
        said = float(told.partition("axis moved ")[2].partition(" to ")[2].partition(" deg")[0])
        assert said == pytest.approx(rig.ticks[-1].pos_deg, abs=0.05)
    rig.engine.close()


def test_a_stop_without_the_speed_telegram_is_judged_by_the_position() -> None:
    """The speed comes from 6064 then: at rest is at rest, and no stop is told that still moves."""
    rig = BusRig(bus_machine("object_60FE")).power_up().cruise(6.0)
    rig.drop_telegram(SPEED_AND_INPUTS)
    rig.run(6.0)
    assert rig.stops == ["CAN-03"]
    assert "at rest after" in rig.first_told
    at_rest_ms = int(rig.first_told.partition("at rest after ")[2].partition(" ms")[0])
    # From 6 deg/s at 5.4 deg/s2, and a quarter of a second of swing at most.
    assert 1111 <= at_rest_ms < 1111 + 250
    rig.engine.close()


@pytest.mark.parametrize("scan_ms", [4.0, 10.0])
@pytest.mark.parametrize(
    ("late_us", "speed"),
    [
        (1000, 6.0),
        (-1000, -1.0),
        *(pytest.param(*row, marks=pytest.mark.slow) for row in ((1000, -1.0), (-1000, 6.0))),
    ],
)
def test_a_sample_a_millisecond_late_whose_speed_telegram_is_lost_stops_nothing(
    scan_ms: float, speed: float, late_us: int
) -> None:
    """The step of the position is a quarter too long then: no speed, and no acceleration, is taken from it."""
    rig = BusRig(bus_machine("object_60FE", scan_ms)).power_up().cruise(speed)
    for lost in (1, 2):
        rig.drop_telegram(SPEED_AND_INPUTS, lost)
        rig.node._owed_us += late_us
        rig.run(scan_ms * 1e-3)
        rig.node._owed_us -= late_us
        rig.run(0.5)
    assert rig.codes == [], rig.told
    assert rig.axis.state is AxisState.DISCRETE_MOTION
    rig.command(power=False)
    rig.run(4.0)
    rig.engine.close()


@pytest.mark.parametrize(("fault", "value"), [("position_offset", 1_000_000), ("freeze_position", True)])
def test_a_feedback_fault_that_begins_as_a_speed_telegram_is_lost_is_found(fault: str, value: object) -> None:
    rig = BusRig(bus_machine("object_60FE")).power_up().cruise(6.0)
    begun = len(rig.ticks)
    rig.drop_telegram(SPEED_AND_INPUTS, 1)
    setattr(rig.node.faults, fault, value)
    rig.run(4.0)
    assert rig.stops[0].startswith("ENC-"), rig.told
    assert rig.way_deg(begun - 1) < FEEDBACK_DEG[6.0]
    assert rig.axis.power.phase is PowerPhase.OFF
    rig.engine.close()
