"""Figures and places of a machine that differ only where a file is not the usual one."""

from __future__ import annotations

import pytest

from gantryctl.machine import default_machine, field_specs, identity_hash, with_values
from gantryctl.machine.derived import derived
from gantryctl.machine.problems import _unit_hint
from gantryctl.machine.requirement import DEFAULT_SOURCE, required_angle, required_stopping_angle
from gantryctl.machine.tables.plant import WindTable
from gantryctl.machine.tables.required import RequiredTable
from gantryctl.machine.variation import Variation
from gantryctl.machine.wind import moment_spectrum
from support.improved import improved_machine

MACHINE = default_machine()
INERTIA = "plant.load.inertia_kg_m2"


def test_the_shortest_move_speeds_up_and_slows_down_by_its_own_accelerations() -> None:
    """6 deg/s with 0.25 and 0.5 deg/s2: 72 + 36 deg."""
    machine = with_values(MACHINE, {"virtual_axis.acc_deg_s2": 0.25, "virtual_axis.dec_deg_s2": 0.5})
    values = {each.name: each.value for each in derived(machine)}
    assert values["shortest_move_to_setting_max"] == pytest.approx(108.0)


def test_a_source_stands_beside_what_the_file_gives_and_not_beside_a_default() -> None:
    required = RequiredTable(stopping_angle_deg=4.0, source="contract 7")
    machine = MACHINE.model_copy(update={"required": required})
    assert required_stopping_angle(machine).source == "contract 7"
    assert required_angle(machine).source == DEFAULT_SOURCE


def test_a_variation_knows_what_its_machine_knows() -> None:
    improved = improved_machine()
    varied = Variation(improved, [INERTIA]).of({INERTIA: 1.01 * improved.plant.load.inertia_kg_m2})
    assert varied == with_values(improved, {INERTIA: 1.01 * improved.plant.load.inertia_kg_m2})
    assert varied.calibration is improved.calibration  # type: ignore[union-attr]
    assert improved.calibration is not None


@pytest.mark.parametrize(
    ("key", "value", "same"),
    [
        ("encoder.counts_per_turn", 16384, False), ("motor.inertia_kg_m2", 0.24, False),
        ("reducer.torque_rated_nm", 17_000.0, False), ("control.kpp_per_s", 9.0, True), (INERTIA, 2.2e6, True),
    ],
)  # fmt: skip
def test_what_a_calibration_hangs_on(key: str, value: float, same: bool) -> None:
    """Ratios, motor, reducer and encoder; neither gains nor what the simulator simulates."""
    assert (identity_hash(with_values(MACHINE, {key: value})) == identity_hash(MACHINE)) is same


def test_a_calibration_without_a_number_for_the_gap_holds_all_of_its_lost_motion() -> None:
    """Lost motion is half of the difference between both directions: twice 2e-6 rad may be backlash."""
    known = improved_machine().calibration
    assert known is not None
    maps = known.maps.model_copy(update={"reversal_rad": (-2e-6, *known.maps.reversal_rad[1:])})
    old = known.model_copy(
        update={"identified": known.identified.model_copy(update={"backlash_rad": None}), "maps": maps}
    )
    assert old.backlash_held_rad == pytest.approx(4e-6)


def test_a_value_at_the_motor_is_known_by_both_ratios_of_the_file() -> None:
    """6 deg/s behind 20 x 5 are 600 at the motor."""
    spec = field_specs()["speed.setting_max_deg_s"]
    ratios = {"axis": {"reducer_ratio": 20.0, "ring_ratio": 5.0}}
    assert spec.usual == 6.0
    assert _unit_hint(spec, 600.0, ratios).endswith(
        "100 x the usual 6: a value at the motor where one at the load belongs?"
    )
    assert _unit_hint(spec, 120.0, ratios) == ""


def test_a_wide_surface_feels_a_quarter_of_gusts_of_twice_its_width() -> None:
    """At 1 Hz and 50 m/s a gust is 50 m long; the surface has 25 m, so 1/(1 + 1)^2 of the spectrum is left.

    That of the speed is 4 x 0.1^2 x 0.1 s / 1.708^(5/6) = 0.00256047, of the moment 4 M^2 of it: 2560.47 N2 m2/Hz.
    """
    wind = WindTable(moment_nm=1000.0, turbulence=0.1, speed_m_s=50.0, length_m=5.0, width_m=25.0)
    assert moment_spectrum(wind, 1.0) == pytest.approx(2560.47, rel=1e-5)
