"""A stop that the engine asks for: first-out with its own words, not "quick stop by the operator"."""

from __future__ import annotations

import math

import pytest

from gantryctl.image import DriveRequest, DriveState, LinkFlag, StopCause, SystemStop
from gantryctl.machine import configs_folder, default_machine, load_machine
from gantryctl.program import AxisState, Reaction
from gantryctl.program.alarms.table import ALARMS
from gantryctl.program.alarms.words import Said
from gantryctl.units import deg
from gantryctl.wiring.program import axis_settings
from unit.program.rig import Rig, settings

FROZEN = SystemStop(StopCause.FROZEN, 2.01, 0.05, 3.0)
CASES = {
    "SYS-02": (
        SystemStop(
            StopCause.SCAN_LATE, 0.03125, 0.03125, 3.0
        ),  # binary fractions: Chinese values have no format
        "scan 31.2 ms late (limit 31.25 ms)",
        "扫描迟到 31.25 ms（限值 31.25 ms）",
    ),
    "SYS-02 overruns": (
        SystemStop(StopCause.OVERRUNS, 6, 5, 3.0),
        "6 overruns within 1 s (limit 5)",
        "1 s 内超限 6 次（限值 5 次）",
    ),
    "SYS-03": (FROZEN, "controller frozen for 2.010 s (limit 0.050 s)", "控制器冻结 2.01 s（限值 0.05 s）"),
}


def moving() -> Rig:
    rig = Rig()
    rig.power_up()
    rig.move(90.0)
    rig.run(2.0)
    assert not rig.codes
    return rig


def in_chinese(value: object) -> object:
    return value.words.chinese.format(**value.values) if isinstance(value, Said) else value


@pytest.mark.parametrize("case", CASES)
def test_it_is_first_out_in_english_and_chinese(case: str) -> None:
    stop, english, chinese = CASES[case]
    rig = moving()
    rig.system_stop = stop
    rig.step()
    first = rig.first
    assert first.code == case.split(maxsplit=1)[0]
    assert first.reaction is Reaction.QUICK_STOP
    assert first.measured == english
    row = ALARMS[first.code].chinese
    values = {name: in_chinese(value) for name, value in first.values.items()}
    assert row.message.format(**values) == chinese
    assert rig.codes == [first.code]  # and no INT-06, "quick stop by the operator"
    rig.until(lambda: rig.axis.is_off, 5.0)
    assert rig.axis.state is AxisState.ERROR_STOP


def test_what_a_stall_has_done_to_the_bus_is_a_consequence() -> None:
    rig = moving()
    rig.system_stop = FROZEN
    rig.spoil = lambda drive: drive._replace(
        state=DriveState.QUICK_STOP_ACTIVE, link=LinkFlag.HEARTBEAT_LOST, age_scans=5
    )
    rig.step()
    assert rig.first.code == "SYS-03"
    assert len(rig.codes) > 1
    assert all(alarm.follows == "SYS-03" for alarm in rig.first.consequences)


def test_the_angle_of_the_alarm_is_that_of_the_scan_that_woke() -> None:
    """Seconds have passed since the last scan: its angle would be wrong by degrees."""
    rig = moving()
    asleep_deg = rig.pos_deg
    rig.missed = lambda scan: 500  # the drive goes on for half a second with what it was told last
    rig.step()
    rig.missed = lambda scan: 0
    rig.system_stop = FROZEN
    rig.step()
    assert abs(deg(rig.first.pos_rad) - asleep_deg) > 1.0
    assert deg(rig.first.pos_rad) == pytest.approx(rig.pos_deg, abs=0.02)


def test_it_lasts_until_a_reset_and_is_raised_once() -> None:
    rig = moving()
    rig.system_stop = FROZEN
    rig.until(lambda: rig.axis.is_off, 5.0)
    rig.run(0.1)
    assert [alarm.code for alarm in rig.axis.alarms.history].count("SYS-03") == 1
    assert rig.axis.system_stop is FROZEN
    rig.op(power=False)
    rig.op(reset=True)
    rig.step()
    rig.step()
    # As long as the engine asks for it, it comes again: the caller takes it back when the axis no longer has it.
    assert rig.codes == ["SYS-03"]
    rig.op(reset=False)
    rig.op(reset=True)
    rig.system_stop = None
    rig.run(0.01)
    assert rig.codes == []
    assert rig.axis.system_stop is None


def test_a_reset_of_the_same_scan_acknowledges_nothing() -> None:
    rig = Rig()
    rig.step()
    rig.system_stop = FROZEN
    rig.op(reset=True)
    assert rig.codes == ["SYS-03"]
    assert "SYS-03 has come only now" in rig.refused()


def brake_of(rig: Rig, held_ms: int) -> bool:
    """What the brake is told in the scan in which a controller that was held up so long makes scans again."""
    rig.missed = lambda scan: held_ms
    rig.step()
    rig.missed = lambda scan: 0
    rig.system_stop = SystemStop(StopCause.FROZEN, held_ms * 1e-3, 0.05, rig.scan * rig.period_s)
    rig.step()
    assert rig.output.request is DriveRequest.QUICK_STOP
    return bool(rig.output.brake_open)


@pytest.mark.parametrize(("held_ms", "told_open"), [(55, True), (65, False), (2000, False)])
def test_an_axis_at_rest_is_braked_as_soon_as_its_drive_may_have_stopped_by_itself(
    held_ms: int, told_open: bool
) -> None:
    """Deadline, period and tick of the drive are 60 ms; its telegrams come no sooner than 20 ms after the stall."""
    rig = Rig()
    rig.power_up()
    assert brake_of(rig, held_ms) is told_open


@pytest.mark.parametrize(("held_ms", "told_open"), [(70, True), (80, False), (300, False)])
def test_a_brake_whose_watchdog_relay_may_have_fallen_is_not_released_again(
    held_ms: int, told_open: bool
) -> None:
    """A relay of 100 ms whose last edge may be 25 ms old; the axis turns with 6 deg/s."""
    rig = Rig(config=settings(watchdog_falls_s=0.075))
    rig.power_up()
    rig.move(90.0)
    rig.run(2.0)
    assert brake_of(rig, held_ms) is told_open


@pytest.mark.parametrize("held_ms", [300, 2000])
def test_without_a_watchdog_relay_a_turning_axis_keeps_its_ramp(held_ms: int) -> None:
    assert brake_of(moving(), held_ms)


def test_the_relay_of_the_machine_file_is_that_of_the_program() -> None:
    """`watchdog_ms` = 100, an edge at least each 25 ms; the machines without a relay have no such time."""
    nodes = load_machine(configs_folder() / "hust_can_nodes.toml")
    assert nodes.can.watchdog_ms == 100.0
    assert axis_settings(nodes).power.watchdog_falls_s == pytest.approx(0.075)
    assert axis_settings(load_machine(configs_folder() / "hust_can.toml")).power.watchdog_falls_s == math.inf
    assert axis_settings(default_machine()).power.watchdog_falls_s == math.inf
