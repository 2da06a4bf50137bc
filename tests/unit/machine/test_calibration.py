"""Calibration files: round trip, damage, and files of another machine."""

from __future__ import annotations

from pathlib import Path

import pytest

from gantryctl.errors import ConfigError
from gantryctl.machine import (
    Calibration,
    Unknown,
    calibration_toml,
    check_belongs,
    config_hash,
    default_machine,
    default_machine_path,
    identity_hash,
    load_calibration,
    load_machine,
    with_values,
)
from gantryctl.machine.calibration import calibration_version
from gantryctl.wiring.compensation import compensation
from gantryctl.wiring.engine import build_engine
from gantryctl.wiring.simulator import sim_drive
from support.improved import improved_machine

TEXT = default_machine_path().with_name("hust_improved.calibration.toml").read_text(encoding="utf-8")


def written(tmp_path: Path, text: str) -> Path:
    path = tmp_path / "a.calibration.toml"
    path.write_text(text, encoding="utf-8")
    return path


def test_the_text_of_a_calibration_is_read_back_bit_for_bit(tmp_path: Path) -> None:
    calibration = improved_machine().calibration
    assert calibration is not None
    assert load_calibration(written(tmp_path, calibration_toml(calibration))) == calibration


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ("swing_hz = ", "swing_hz = nan #", "swing_hz"),
        ("swing_hz = ", "swing_hz = -1.0 #", "swing_hz"),
        ("stiffness_nm_per_rad = ", "stiffness_nm_per_rad = 0.0 #", "stiffness_nm_per_rad"),
        ("version = 4", "version = 0", "version"),
        ("identity = ", 'identity = "none" #', "identity"),
        ("moment_sine_nm = ", "moment_sin_nm = ", "moment_sin_nm"),
        ("[maps]", "[map]", "map"),
        ("gear_rad = [", "gear_rad = [ 5.0,", "gear_rad"),
        ("gear_rad = [", "gear_rad = [ inf,", "gear_rad"),
        ("fast = [", "fast = [ [1e300, 1e-6, 1e-6],", "fast"),
        ("[origin]", "[origin", "line"),
    ],
)
def test_a_damaged_file_is_refused_and_the_message_names_the_place(
    tmp_path: Path, old: str, new: str, said: str
) -> None:
    assert old in TEXT
    with pytest.raises(ConfigError) as refused:
        load_calibration(written(tmp_path, TEXT.replace(old, new, 1)))
    assert any("a.calibration.toml" in line and said in line for line in refused.value.problems)


def test_a_calibration_of_other_gears_is_refused() -> None:
    other = with_values(improved_machine(), {"motor.inertia_kg_m2": 0.3})
    with pytest.raises(ConfigError, match="measured on another machine"):
        compensation(other)


def test_a_calibration_of_another_encoder_is_refused_where_the_drive_is_asked() -> None:
    other = with_values(improved_machine(), {"plant.encoder.serial": "SIM-0002"})
    with pytest.raises(ConfigError, match=r"SIM-0001.*SIM-0002"):
        build_engine(other, drive=sim_drive(other))


def test_an_encoder_that_names_itself_by_nothing_is_another_one() -> None:
    """Only where no drive is asked, which is None, the serial number does not count."""
    calibration = improved_machine().calibration
    assert calibration is not None
    check_belongs(calibration, improved_machine(), None)
    with pytest.raises(ConfigError, match="SIM-0001"):
        check_belongs(calibration, improved_machine(), "")


def test_gains_profiles_and_plant_do_not_make_another_machine() -> None:
    calibration = improved_machine().calibration
    assert calibration is not None
    assert identity_hash(default_machine()) == identity_hash(improved_machine())
    check_belongs(calibration, with_values(improved_machine(), {"control.kpp_per_s": 8.0}), "SIM-0001")


def test_without_its_file_a_compensation_says_what_to_do(tmp_path: Path) -> None:
    path = tmp_path / "m.toml"
    path.write_text(default_machine_path().with_name("hust_improved.toml").read_text("utf-8"), "utf-8")
    machine = load_machine(path)
    assert machine.calibration is None
    with pytest.raises(ConfigError, match="gantryctl identify"):
        compensation(machine)


def test_a_calibration_stays_with_changed_values_and_out_of_the_hash() -> None:
    machine = improved_machine()
    assert with_values(machine, {"control.kvf": 0.9}).calibration == machine.calibration
    assert machine.calibrated(None).calibration is None
    assert config_hash(machine.calibrated(None)) == config_hash(machine)


def test_the_ideal_drive_has_nothing_to_compensate() -> None:
    assert compensation(with_values(improved_machine(), {"drive.kind": "ideal"})) is None


@pytest.mark.parametrize(("all_nm", "behind_nm"), [(9e3, 4.5e3), (-10.0, 0.0)])
def test_a_friction_behind_the_mesh_that_is_not_known_is_half_and_never_below_0(
    all_nm: float, behind_nm: float
) -> None:
    base = improved_machine().calibration
    assert base is not None
    identified = base.identified.model_copy(update={"friction_nm": all_nm, "friction_load_nm": None})
    assert base.model_copy(update={"identified": identified}).friction_behind_mesh_nm == behind_nm


@pytest.mark.parametrize(("version", "fits"), [(1, True), (0, False), (-1, False)])
def test_versions_of_calibrations_begin_with_1(tmp_path: Path, version: int, fits: bool) -> None:
    path = written(tmp_path, f"[origin]\nversion = {version}\n")
    if fits:
        assert calibration_version(path) == version
    else:
        with pytest.raises(ConfigError, match="is no calibration file"):
            calibration_version(path)


def test_a_number_is_known_or_unknown_and_not_both() -> None:
    calibration = improved_machine().calibration
    assert calibration is not None
    told = calibration.model_dump()
    assert Calibration.model_validate(told) == calibration
    with pytest.raises(ValueError, match="must have every number that"):
        Calibration.model_validate({**told, "unknown": {**told["unknown"], "swing_hz": Unknown.TOO_WIDE}})


def with_numbers(**numbers: float | None) -> Calibration:
    calibration = improved_machine().calibration
    assert calibration is not None
    return calibration.model_copy(update={"identified": calibration.identified.model_copy(update=numbers)})


def test_what_is_no_number_of_its_own_is_taken_from_what_holds_it() -> None:
    """Lost motion is twice the reversal of the map; of friction half is thought to lie behind the mesh."""
    unknown = with_numbers(backlash_rad=None, friction_load_nm=None, friction_nm=5000.0)
    assert unknown.backlash_held_rad == 2.0 * abs(unknown.maps.reversal_rad[0]) > 0.0
    assert unknown.friction_behind_mesh_nm == 2500.0
    assert with_numbers(friction_load_nm=None, friction_nm=-10.0).friction_behind_mesh_nm == 0.0
    known = with_numbers(backlash_rad=1e-5, friction_load_nm=700.0, friction_nm=5000.0)
    assert (known.backlash_held_rad, known.friction_behind_mesh_nm) == (1e-5, 700.0)


def test_a_file_of_an_earlier_version_keeps_the_reasons_that_it_gives(tmp_path: Path) -> None:
    """It knows nothing of backlash and of friction behind the mesh, and says itself why there is no swing."""
    lines = [
        line
        for line in TEXT.splitlines()
        if not line.startswith(("backlash_rad", "friction_load_nm", "swing_hz"))
    ]
    text = "\n".join(lines).replace("[unknown]", '[unknown]\nswing_hz = "no_windup"')
    found = load_calibration(written(tmp_path, text))
    assert found.unknown["swing_hz"] is Unknown.NO_WINDUP
    assert found.unknown["backlash_rad"] is Unknown.OLDER
