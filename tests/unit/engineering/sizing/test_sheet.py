"""Sheets and motor files that cannot be: one clear line each."""

import pytest

from gantryctl.engineering.sizing.loading import default_sheet_path, load_sheet
from gantryctl.engineering.sizing.motors import is_motor_file, load_motors
from gantryctl.errors import ConfigError
from gantryctl.machine import configs_folder

MOTOR = configs_folder() / "motors" / "im_31kw_1150.toml"


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        (
            {"range.pos_min_deg": -0.2, "range.pos_max_deg": 0.2},
            r"pos_min_deg = -0.2 deg: must lie at least 1 deg",
        ),
        (
            {"motion.speed_min_r_min": 2.0},
            r"speed_min_r_min = 2 r/min: must be below speed_max_r_min = 1 r/min",
        ),
        ({"motion.acc_deg_s2": 7.0}, r"acc_deg_s2 = 7 deg/s2: must be at most 6 deg/s2"),
        (
            {"motion.acc_deg_s2": 0.05},
            r"speed_max_r_min = 1 r/min: is never reached: .* 720 deg .* travel is 360 deg",
        ),
        (
            {"required.stopping_angle_deg": 0.3},
            r"stopping_angle_deg = 0.3 deg: the axis travels 0.36 deg",
        ),
        (
            {"gears.torque_momentary_nm": 1000.0},
            r"torque_momentary_nm = 1000 N m: must be at least torque_rated_nm",
        ),
        (
            {"load.eccentric_check_moment_nm": 1000.0},
            r"must be at least the eccentric moment itself, .* 1.599e\+04 N m",
        ),
        (
            {"motion.sizing_time_s": 0.1},
            r"sizing_time_s = 0.1 s: the load alone puts 1.799e\+05 N m on the reducer",
        ),
        ({"duty.stops_deg": [200.0, 0.0]}, r"stops_deg = 200 deg: must lie within \[range\] -180..180 deg"),
        ({"duty.cycles": 400}, r"cycles = 400: take 70.1 h .*hours = 12 h"),
        ({"load.inertia_kg_m2": "nan"}, r"\[load\] inertia_kg_m2 = nan: is not a finite number"),
        ({"load.mass_kg": '"heavy"'}, r'\[load\] mass_kg = "heavy": is text, must be a number'),
        ({"gears.ring_ratio": 0.5}, r"\[gears\] ring_ratio = 0.5: allowed 1..100"),
    ],
)
def test_an_impossible_sheet_is_refused_in_one_line(changed_sheet, changes, message):
    path = changed_sheet(changes)
    with pytest.raises(ConfigError, match=message) as refused:
        load_sheet(path)
    assert all(line.startswith(f"{path}: [") and "\n" not in line for line in refused.value.problems)


def test_an_axis_without_ends_turns_until_it_has_its_speed(changed_sheet):
    load_sheet(changed_sheet({"motion.acc_deg_s2": 0.05, "range.pos_max_deg": '180.0\nkind = "modulo"'}))


def test_missing_and_unknown_keys_are_named(tmp_path):
    path = tmp_path / "sheet.toml"
    path.write_text(
        '[sheet]\nname = "x"\n[motion]\nspeed_max = 1.0\nstopping_angle_max_deg = 3.0\n[accuracy]\nangle_deg = 0.1\n',
        encoding="utf-8",
    )
    with pytest.raises(ConfigError) as refused:
        load_sheet(path)
    text = "\n".join(refused.value.problems)
    assert "[motion] speed_min_r_min: is missing; allowed 1e-06..200 r/min" in text
    assert "[motion] speed_max = 1.0: unknown key; did you mean speed_max_r_min?" in text
    assert "[load]: the table is missing; it must give inertia_kg_m2, mass_kg" in text
    assert "stopping_angle_max_deg = 3.0: unknown key; it is [required] stopping_angle_deg now" in text
    assert "[accuracy]: unknown table; it is [required] now" in text


def test_a_sheet_names_the_accuracy_that_it_requires(changed_sheet):
    """A machine file may leave it to a default; with a sheet that did, the default of another axis would judge."""
    path = changed_sheet({})
    text = path.read_text(encoding="utf-8")
    assert text.count("angle_deg = 0.1 ") == 1
    path.write_text(text.replace("angle_deg = 0.1 ", "# "), encoding="utf-8")
    with pytest.raises(ConfigError, match=r"\[required\] angle_deg: is missing; allowed 1e-05..5 deg"):
        load_sheet(path)


def test_a_name_plate_that_contradicts_itself_is_refused(tmp_path):
    text = MOTOR.read_text(encoding="utf-8")
    path = tmp_path / "motor.toml"
    path.write_text(
        text.replace("power_rated_kw = 31.0", "power_rated_kw = 60.0")
        .replace("torque_max_nm = 385.0", "torque_max_nm = 100.0")
        .replace("speed_max_r_min = 2000.0", "speed_max_r_min = 900.0")
        .replace("counts_per_turn = 8192", "counts_per_turn = 8000"),
        encoding="utf-8",
    )
    with pytest.raises(ConfigError) as refused:
        load_motors([path])
    text = "\n".join(refused.value.problems)
    assert "power_rated_kw = 60 kW: must be 30.95 kW within 10 %" in text
    assert "torque_max_nm = 100 N m: must be at least torque_rated_nm = 257 N m" in text
    assert "speed_max_r_min = 900 r/min: must be at least speed_rated_r_min = 1150 r/min" in text
    assert "counts_per_turn = 8000: must be a power of two" in text


def test_two_motors_of_one_name_are_refused(tmp_path):
    copy = tmp_path / "copy.toml"
    copy.write_bytes(MOTOR.read_bytes())
    with pytest.raises(ConfigError, match="another motor file has this name already"):
        load_motors([MOTOR, copy])
    assert len(load_motors([MOTOR, MOTOR])) == 1


def test_files_are_told_apart():
    assert is_motor_file(MOTOR)
    assert not is_motor_file(default_sheet_path())
    with pytest.raises(ConfigError, match="is a machine file; `gantryctl size` takes a requirement sheet"):
        is_motor_file(configs_folder() / "hust_gantry.toml")
