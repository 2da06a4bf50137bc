"""The fault table on axes that are no gantry: amounts, limits and places follow from the axis, the true plant judges.

A fast subset on the delivered rotary table; slow, every row of the simulated drive on eight axes.
"""

from __future__ import annotations

import pytest

from gantryctl._core import PlantParams
from gantryctl.engineering.faults.case import ReactionClass, SeenBy
from gantryctl.engineering.faults.catalogue import CATALOGUE, fault_case
from gantryctl.engineering.faults.limits import computed_deg, limit_deg
from gantryctl.engineering.faults.oracle.limits import bounds_of
from gantryctl.engineering.faults.oracle.taps import Oracle
from gantryctl.engineering.faults.physics import friction_nm
from gantryctl.engineering.faults.run import FaultRun, conditions_of, fault_machine, run_fault
from gantryctl.engineering.stops.run import StopClass, unbraked_stop_deg, worst_stop
from gantryctl.errors import UsageError
from gantryctl.machine import Machine, default_machine, with_values
from gantryctl.program.alarms.codes import Code
from gantryctl.program.monitors import drag
from gantryctl.wiring import program, simulator
from support.delivered_axes import CONFIGS, DRAFTS, axis_of
from support.fault_rows import seen_by


def against(machine: Machine, number: str, oracle: Oracle) -> list[str]:
    """What is against a row on this axis; nothing where the axis cannot come into its phase."""
    oracle.bounds = bounds_of(machine)
    case = fault_case(number)
    try:
        result = run_fault(FaultRun(case, machine))
    except UsageError as wrong:
        oracle.forget()
        # Friction holds the load of a small table: a brake that does not hold lets nothing go, and nobody notices it.
        return [] if "held by torque" in str(wrong) else [f"{number}: {wrong}"]
    oracle.forget()
    if not case.rests:
        # Nothing is left that could hold the load: the row judges that it is told in time, and the way until then.
        oracle.caught("INV-2")
        oracle.caught("INV-3")
    return [f"{number}: {fault}" for fault in (*result.faults, *seen_by(oracle, case))]


def test_the_conditions_of_the_reference_gantry_are_its_highest_speed_where_its_moment_is_largest() -> None:
    conditions = conditions_of(default_machine())
    assert conditions.speed_deg_s == 6.0
    assert conditions.angle_deg == pytest.approx(90.0)
    assert conditions.eccentric_knm == pytest.approx(15.99, abs=0.01)


@pytest.mark.parametrize(
    ("off", "slow_nm", "fast_nm"),
    [(set(), 10.5, 14.5), ({"roller"}, 5.5, 8.5), ({"motor"}, 5.0, 6.0), ({"roller", "motor"}, 0.0, 0.0)],
)
def test_an_axis_rubs_where_its_plant_does(off: set[str], slow_nm: float, fast_nm: float) -> None:
    """Behind 1144:1 5.72 kN m are 5 N m, 13,087.36 N m s/rad 0.01 of them; the speed is 100 rad/s of the motor."""
    machine = with_values(
        default_machine(),
        {
            "plant.roller_friction.coulomb_nm": 5_720.0,
            "plant.roller_friction.viscous_nm_s_per_rad": 13_087.36,
            "plant.motor_friction.coulomb_nm": 5.5,
            "plant.motor_friction.viscous_nm_s_per_rad": 0.03,
            **{f"plant.switches.{side}_friction": False for side in off},
        },
    )
    assert friction_nm(machine) == pytest.approx(slow_nm)
    assert friction_nm(machine, -100.0) == pytest.approx(fast_nm)


OFF, DOUBT = ReactionClass.TORQUE_OFF, ReactionClass.FEEDBACK
SPECIFIED = (
    (OFF, 1.0, 0.45), (OFF, 3.0, 1.4), (OFF, 6.0, 3.6),
    (DOUBT, 1.0, 0.8), (DOUBT, 3.0, 2.1), (DOUBT, 6.0, 4.5),
    (ReactionClass.STANDSTILL, 6.0, 0.35), (ReactionClass.BRAKE_SLIP, 0.0, 0.15),
)  # fmt: skip


@pytest.mark.parametrize(("speed", "off_deg"), [(1.0, 0.45), (3.0, 1.4)])
def test_a_drive_off_the_bus_has_the_way_of_torque_off_where_a_watchdog_relay_takes_its_torque(
    speed: float, off_deg: float
) -> None:
    """E9: without a relay its own ramp, which is shorter; by hand 0.055 s of speed, v^2 / 2 5.5 deg/s2, and 2 %."""
    ramp_deg = 1.02 * (0.055 * speed + speed**2 / 11.0)
    alone, relay = (
        fault_machine(None, "bus", speed, 4.0, "drive", beside=beside) for beside in (False, True)
    )
    deadline = ReactionClass.DRIVE_DEADLINE
    assert limit_deg(alone, deadline, speed) == pytest.approx(ramp_deg, rel=0.1)
    assert limit_deg(relay, deadline, speed) == pytest.approx(off_deg, rel=1e-12)


@pytest.mark.parametrize("speed", [1.0, 3.0])
def test_a_heartbeat_is_missed_by_its_own_time_and_meanwhile_the_axis_goes_on(speed: float) -> None:
    """E9b: 0.1 s more of it are 0.1 s of speed, and 2 %."""
    machine = with_values(
        axis_of("draft of gantry"), {"drive.kind": "canopen", "control.scan_period_ms": 4.0}
    )
    late = with_values(machine, {"can.heartbeat_timeout_ms": machine.can.heartbeat_timeout_ms + 100.0})
    usual, later = (computed_deg(each, OFF, speed, SeenBy.HEARTBEAT) for each in (machine, late))
    assert later - usual == pytest.approx(0.102 * speed, rel=1e-9)
    # 60 ms of any other stop, 150 of the heartbeat and two scans; without torque the load sinks a little in those 60.
    assert usual - computed_deg(machine, OFF, speed) == pytest.approx(0.098 * speed, abs=0.03)


def test_a_drive_that_misses_commands_lets_go_before_a_brake_that_is_not_its_own_has_closed() -> None:
    """E10: what the simulated motor goes with the load, and at most as far again: its swing has any phase."""
    by_drive = fault_machine(None, "bus", 1.0, 4.0, "drive")
    by_60fe = with_values(by_drive, {"brake.owner": "object_60FE"})
    for speed in (0.6, 1.0, 6.0):
        ramp, free = (limit_deg(each, ReactionClass.DRIVE_DEADLINE, speed) for each in (by_drive, by_60fe))
        goes = unbraked_stop_deg(by_60fe, speed) - worst_stop(by_60fe, StopClass.QUICK, speed).angle_deg
        assert goes <= free - ramp <= goes + 0.12


LATE_WEAK_BRAKE = {"control.scan_period_ms": 10.0, "brake.close_time_ms": 200.0, "brake.torque_nm": 380.0}
"""What the specified ways allow for: scans of 10 ms, and the brake at the worst of 380 to 500 N m, within 200 ms."""


@pytest.mark.parametrize(("reaction", "speed", "way"), SPECIFIED)
def test_the_reference_gantry_keeps_what_is_specified_for_it(
    reaction: ReactionClass, speed: float, way: float
) -> None:
    """The rule for any axis, without a fitted number, gives that gantry the same with its late and weak brake.

    Within a tenth and 0.08 deg, which the specified ways have for what a following error sees at low speed; its usual
    brake makes the rule stricter. A brake that slips has a rule of its own, by the moment: 0.162 deg.
    """
    machine = default_machine()
    assert limit_deg(machine, reaction, -speed) == pytest.approx(way, rel=1e-12)
    assert computed_deg(machine, reaction, speed) <= way + 0.015
    late = with_values(machine, LATE_WEAK_BRAKE)
    assert computed_deg(late, reaction, speed) == pytest.approx(way, rel=0.11, abs=0.11)


# One row of each reaction; oscillation and ramp are judged by the axis' own speed now.
@pytest.mark.parametrize("number", ["A2", "B3", "B7", "C10", "D2", "D7", "D14"])
def test_a_fault_on_the_rotary_table(number: str, oracle: Oracle) -> None:
    assert against(axis_of("rotary_table"), number, oracle) == []


def test_an_alarm_of_another_axis_is_none_of_the_reference_gantry() -> None:
    """ENC-14 before BRK-14 is right where the brake stops the rotor within a scan, and wrong on the gantry."""
    case = fault_case("C10")
    assert Code.ENC_14 in case.codes_on(axis_of("rotary_table"))
    slow = with_values(default_machine(), {"control.scan_period_ms": 10.0})
    assert case.codes_on(slow) == (Code.BRK_14,)
    dish = axis_of("azimuth_dish")
    assert case.codes_on(dish) == (Code.BRK_14,), "its brake does not"


def test_a_limit_that_a_weak_brake_cannot_keep_is_told(oracle: Oracle) -> None:
    """The liar: the brake has a fifth of its torque behind the back of the limit. The oracle sees it, too."""
    machine = axis_of("rotary_table")
    oracle.bounds = bounds_of(machine)
    weak = with_values(machine, {"plant.brake.torque_share": 0.2})
    result = run_fault(FaultRun(fault_case("D1"), weak))
    assert result.way_deg > limit_deg(machine, ReactionClass.TORQUE_OFF, machine.speed.setting_max_deg_s)
    assert oracle.caught("INV-1")


def test_what_counts_as_rest_goes_with_the_axis(oracle: Oracle, monkeypatch: pytest.MonkeyPatch) -> None:
    """The liar: a yaw drive judged by the rest of the gantry, a twenty-fifth of its highest speed, turns on."""
    machine = axis_of("draft of wind_turbine_yaw")
    assert against(machine, "C5", oracle) == []
    monkeypatch.setattr(program, "rest_speed_deg_s", lambda machine: 0.02)
    (wrong,) = against(machine, "C5", oracle)
    assert "INV-7" in wrong
    assert "at rest after" in wrong


def test_a_late_brake_lets_the_wind_speed_a_telescope_up(
    oracle: Oracle, monkeypatch: pytest.MonkeyPatch
) -> None:
    """0.22 deg/s in 0.35 s, from 1.998 deg/s, and what its gear gives back. The liar: five times the wind."""
    machine = axis_of("draft of telescope_azimuth")
    assert against(machine, "C11", oracle) == []
    true = simulator.plant_params

    def gale(machine: Machine) -> PlantParams:
        plant = true(machine)
        plant.wind_moment_nm *= 5.0
        return plant

    monkeypatch.setattr(simulator, "plant_params", gale)
    oracle.bounds = bounds_of(machine)
    run_fault(FaultRun(fault_case("C11"), machine))
    (fast,) = oracle.caught("INV-3")
    assert "true speed" in fast.text
    oracle.violations.clear()


@pytest.mark.parametrize("reaction", [OFF, DOUBT, ReactionClass.QUICK_STOP, ReactionClass.DRIVE_DEADLINE])
@pytest.mark.parametrize("by", SeenBy)
def test_at_rest_every_stop_has_the_way_of_standstill(reaction: ReactionClass, by: SeenBy) -> None:
    """A row of motion in a phase without one (the matrix): there was no limit at all."""
    machine = axis_of("rotary_table")
    at_rest = computed_deg(machine, ReactionClass.STANDSTILL, 0.0, SeenBy.CLASS)
    assert computed_deg(machine, reaction, 0.0, by) >= at_rest > 0.0


# Eight rows take some seconds, so a run that was ended goes on where it was: `-k "crane and rows_3"`.
ROWS = [case.number for case in CATALOGUE if case.judged and "sim" in case.buses]
PARTS = [ROWS[at : at + 8] for at in range(0, len(ROWS), 8)]


@pytest.mark.slow
@pytest.mark.parametrize("rows", PARTS, ids=[f"rows_{number}" for number in range(len(PARTS))])
@pytest.mark.parametrize("name", [*DRAFTS, *CONFIGS])
def test_every_fault_on_every_axis(name: str, rows: list[str], oracle: Oracle) -> None:
    machine = axis_of(name)
    assert [wrong for number in rows for wrong in against(machine, number, oracle)] == []


@pytest.mark.slow
def test_a_drag_that_stops_the_motion_half_a_second_late_is_found(monkeypatch: pytest.MonkeyPatch) -> None:
    """The wind helps the dish, so the mean of the drag begins far below nothing; 0.2 s more are permitted."""
    run = FaultRun(fault_case("B3"), axis_of("azimuth_dish"))
    assert run_fault(run).faults == ()
    monkeypatch.setattr(drag, "_LASTS_S", 1.5)
    assert any("permitted" in each for each in run_fault(run).faults)
