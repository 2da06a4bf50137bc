"""Which motors fit, which do not, and why; and the machine file that follows."""

import pytest

from gantryctl.engineering.sizing.chain import as_tables, machine_values, sized_machine
from gantryctl.engineering.sizing.checks import fit, usable_torque_nm
from gantryctl.engineering.sizing.loading import load_sheet
from gantryctl.engineering.sizing.motors import delivered_motors, load_motors
from gantryctl.errors import ConfigError
from gantryctl.machine import config_hash, default_machine, effective_values, parse_machine
from gantryctl.machine.effective import to_toml


def test_the_paper_s_motor_fits_with_its_overload(sheet, paper_motor):
    fitted = fit(sheet, paper_motor)
    assert fitted.fits
    assert fitted.reasons == []
    names = [check.name for check in fitted.checks]
    assert "overload time" in names
    peak = next(check for check in fitted.checks if check.name == "peak torque")
    assert paper_motor.motor.torque_rated_nm < peak.used < paper_motor.motor.torque_max_nm


def test_delivered_motors_and_what_is_wrong_with_them(sheet):
    fits = {
        fitted.motor.name: fitted
        for fitted in (fit(sheet, motor) for motor in load_motors(delivered_motors()))
    }
    assert {name for name, fitted in fits.items() if fitted.fits} == {
        "im_31kw_1150",
        "im_40kw_1150",
        "pm_37kw_1000",
    }
    assert fits["im_22kw_1150"].reasons[0].startswith("peak torque: 35")
    assert fits["pm_25kw_1000"].reasons[0].startswith("inertia ratio: 10.4")
    assert all(fitted.motor.identity.source for fitted in fits.values())


def test_above_the_rated_speed_less_torque_is_left(sheet, paper_motor):
    assert paper_motor.torque_at_nm(257.0, 1144.0) == 257.0
    assert paper_motor.torque_at_nm(257.0, 2300.0) == pytest.approx(128.5)
    assert paper_motor.torque_at_nm(257.0, 0.0) == 257.0


def test_the_reducer_limits_a_strong_motor(sheet):
    strong = next(motor for motor in load_motors(delivered_motors()) if motor.name == "pm_37kw_1000")
    assert usable_torque_nm(sheet, strong) == pytest.approx(35200.0 / 88.0)
    assert machine_values(sheet, strong)["motor.torque_max_nm"] == pytest.approx(400.0)


def test_a_motor_that_cannot_hold_the_load_is_refused(changed_sheet, paper_motor):
    """An eccentric moment of 400 kN m is 350 N m at the motor: more than rated torque, and than the brake holds."""
    heavy = load_sheet(
        changed_sheet(
            {
                "load.eccentric_check_moment_nm": 4e5,
                "gears.torque_rated_nm": 1e5,
                "gears.torque_momentary_nm": 1e5,
            }
        )
    )
    fitted = fit(heavy, paper_motor)
    assert not fitted.fits
    words = " ".join(fitted.reasons)
    assert "holding: 349.7 N m needed (largest eccentric moment at standstill), 257 N m given" in words
    assert "brake: 454.5 N m needed" in words
    with pytest.raises(ConfigError, match=r"im_31kw_1150 does not fit hust_gantry: .*holding"):
        sized_machine(default_machine(), fitted)


@pytest.mark.parametrize(
    ("changes", "reason"),
    [
        ({"required.angle_deg": 0.001}, "encoder step"),
        ({"range.wrap_margin_min_deg": 180.0, "gears.reducer_ratio": 300.0}, "encoder range"),
        ({"gears.reducer_ratio": 170.0}, "speed"),
        ({"duty.hold_s": 0.0, "duty.cycles": 1, "margins.thermal": 5.0}, None),
        ({"margins.inertia_ratio_max": 4.0}, "inertia ratio"),
    ],
)
def test_other_reasons(changed_sheet, paper_motor, changes, reason):
    fitted = fit(load_sheet(changed_sheet(changes)), paper_motor)
    assert fitted.fits is (reason is None)
    if reason is not None:
        assert any(why.startswith(reason) for why in fitted.reasons)


def test_sheet_and_motor_give_the_reference_machine(sheet, paper_motor):
    """One chain: every number of the sheet and the motor is the number of the machine file."""
    values, machine = machine_values(sheet, paper_motor), default_machine()
    in_force = effective_values(machine)
    assert {path: in_force[path] for path in values} == values
    sized = sized_machine(machine, fit(sheet, paper_motor))
    assert config_hash(sized) == config_hash(machine)
    assert config_hash(parse_machine(to_toml(sized))) == config_hash(machine)


def test_the_machine_is_judged_by_what_its_sheet_requires(changed_sheet, paper_motor):
    strict = load_sheet(
        changed_sheet(
            {
                "required.angle_deg": 0.01,
                "required.speed_error_ratio": 0.001,
                "required.stopping_angle_deg": 4.5,
                "required.source": '"contract 7, clause 3"',
            }
        )
    )
    machine = sized_machine(default_machine(), fit(strict, paper_motor))
    assert machine.required == strict.required
    unnamed = load_sheet(changed_sheet({"required.source": '""'}))
    made = sized_machine(default_machine(), fit(unnamed, paper_motor))
    assert made.required.source == "requirement sheet hust_gantry"


def test_another_sheet_is_another_machine(changed_sheet, paper_motor):
    slow = load_sheet(changed_sheet({"motion.speed_max_r_min": 0.5, "range.pos_min_deg": -100.0}))
    machine = sized_machine(default_machine(), fit(slow, paper_motor))
    assert machine.speed.setting_max_deg_s == 3.0
    assert machine.speed.command_clamp_deg_s == 3.15
    assert machine.axis.pos_min_deg == -100.0


def test_tables_stand_in_a_machine_file(sheet, paper_motor):
    text = as_tables(machine_values(sheet, paper_motor))
    assert "[motor]\npower_rated_kw = 31.0  # kW\n" in text
    given = (
        '[machine]\nname = "sized"\n\n'
        + text
        + "\n[control]\nscan_period_ms = 1.0\nkpp_per_s = 10.0\nkvf = 1.0\n"
    )
    assert parse_machine(given).motor.torque_rated_nm == 257.0
