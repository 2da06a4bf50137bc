"""Demands on a motor by hand: above its rated speed, behind a weak reducer, over a day."""

import pytest

from gantryctl.engineering.sizing.chain import machine_values
from gantryctl.engineering.sizing.checks import fit
from gantryctl.engineering.sizing.duty import duty
from gantryctl.engineering.sizing.loading import load_sheet
from gantryctl.engineering.sizing.text import further_table
from gantryctl.engineering.sizing.train import Train
from gantryctl.errors import ConfigError


def checks_of(sheet, motor):
    return {check.name: check for check in fit(sheet, motor).checks}


def test_a_motor_above_its_rated_speed_has_less_for_lasting_and_for_overload(changed_sheet, paper_motor):
    """Rated at 800 r/min it has 257 x 800 / 1144 = 179.7 N m at 1144 r/min.

    To 1 r/min in 2 s the axis asks for (2.18e6 x 0.05236 + 5e4 + 6000 + 2e4 x 0.10472) / 1144 x 1.1 = 165.6, rotor and
    input 0.362 x 0.05236 x 1144 = 21.7 and friction 9.1: 196.4 N m, above what it has there and below its name plate.
    """
    plate = paper_motor.motor.model_copy(update={"speed_rated_r_min": 800.0})
    weakened = paper_motor.model_copy(update={"motor": plate})
    checks = checks_of(load_sheet(changed_sheet({"motion.sizing_time_s": 2.0})), weakened)
    assert checks["overload time"].used == 2.0
    assert checks["normal moves"].limit == pytest.approx(179.7, abs=0.1)
    assert checks["peak torque"].used == pytest.approx(1.1 * 196.4, abs=0.2)


def test_a_quick_stop_has_what_the_reducer_bears(changed_sheet, paper_motor):
    """22 kN m behind 88 are 250 N m, whatever the motor has."""
    weak = load_sheet(changed_sheet({"gears.torque_momentary_nm": 22_000.0}))
    checks = checks_of(weak, paper_motor)
    assert checks["quick stop"].limit == pytest.approx(250.0)
    assert checks["quick stop"].used == pytest.approx(243.9, abs=0.1)
    assert machine_values(weak, paper_motor)["motor.torque_max_nm"] == pytest.approx(250.0)


def test_what_comes_back_in_a_day_is_that_of_its_cycles_over_all_of_its_hours(sheet, paper_motor):
    """40 cycles of 5387 J in 12 hours: 4.99 W."""
    day = duty(Train(sheet, paper_motor.motor.inertia_kg_m2))
    assert day.returned_j == pytest.approx(5387.0, rel=1e-3)
    assert day.returned_mean_w == pytest.approx(40.0 * 5387.0 / (12.0 * 3600.0), rel=1e-3)


def test_the_motor_holds_at_every_stop_of_a_cycle(changed_sheet, paper_motor):
    """At 30, 90 and 180 deg a half, all and nothing of the eccentric moment: 1.25 of its square at the motor."""

    def squared(hold_s):
        sheet = load_sheet(changed_sheet({"duty.stops_deg": [30.0, 90.0, 180.0], "duty.hold_s": hold_s}))
        day = duty(Train(sheet, paper_motor.motor.inertia_kg_m2))
        return day.cycle_rms_nm**2 * day.cycle_s, Train(sheet, 0.0).eccentric_nm / 1144.0

    (moving, _), (held, all_nm) = squared(0.0), squared(40.0)
    assert held - moving == pytest.approx(40.0 * 1.25 * all_nm**2, rel=1e-9)
    assert all_nm == pytest.approx(13.98, abs=0.01)


def test_the_reducer_bears_the_rollers_too_and_the_motor_what_the_moment_drives(sheet, paper_motor):
    """Reducer: (2.18e6 x 0.0068654 + 5e4 + 6000 + 2e4 x 0.10472) / 13, the first twice where it swings.

    Braking with 0.10472 rad/s2, the moment driving, each N m at the motor: load (-2.18e6 x 0.10472 - 5e4 + 6000 + 2094)
    / 1144 = -236.2, of which a tenth is lost, rotor and input -0.362 x 119.8 = -43.4, friction 9.1; at 119.8 rad/s.
    """
    train = Train(sheet, paper_motor.motor.inertia_kg_m2)
    assert train.reducer_nm(train.normal_acc_rad_s2) == pytest.approx(5620.1, abs=0.5)
    assert train.reducer_nm(train.normal_acc_rad_s2, 2.0) == pytest.approx(6771.4, abs=0.5)
    assert train.braking_power_w == pytest.approx((0.9 * 236.2 + 43.4 - 9.1) * 119.8, rel=1e-3)


def test_of_what_comes_back_the_supply_gets_less(sheet, paper_motor):
    """5387 J and 4.99 W at the shaft, 29.6 kW at most, of which a motor with an efficiency of a half gives half."""
    halved = paper_motor.motor.model_copy(update={"efficiency": 0.5})
    fitted = fit(sheet, paper_motor.model_copy(update={"motor": halved}))
    rows = dict(further_table(fitted).rows)
    assert rows["regeneration, electrical: per cycle; mean of the day"] == "2.7 kJ; 2.5 W"
    assert rows["regeneration, largest: braking as in the sizing case"] == "14.8 kW"


def test_a_motor_is_as_warm_in_a_cycle_however_long_the_day_is(changed_sheet, paper_motor):
    """Torque is off between the cycles: a day of 24 h with the same 40 cycles makes none of them lighter."""
    used = [
        checks_of(load_sheet(changed_sheet({"duty.hours": hours})), paper_motor)["thermal"].used
        for hours in (12.0, 24.0)
    ]
    assert used[0] == used[1] > 0.0


def test_wind_is_a_part_of_the_moment_that_motor_and_brake_are_held_against(changed_sheet):
    """15.99 kN m of the load and 30 of the wind are within the 50 kN m of the check, and 40 of the wind are not."""
    for moment_nm in (30_000.0, 40_000.0):
        path = changed_sheet({})
        path.write_text(f"{path.read_text()}\n[wind]\nmoment_nm = {moment_nm}\nturbulence = 0.0\n")
        if moment_nm < 34_000.0:
            load_sheet(path)
            continue
        with pytest.raises(
            ConfigError, match=r"must be at least 5.599e\+04 N m: the eccentric moment and \[wind\]"
        ):
            load_sheet(path)
