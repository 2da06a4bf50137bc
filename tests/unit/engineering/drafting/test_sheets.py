"""From answers to a sheet: what a person says stands, what follows does so by rule, what nobody said is a guess."""

import pytest

from gantryctl.engineering.drafting.origin import Origin, guesses
from gantryctl.engineering.drafting.questions import answered, answered_by_options, questions
from gantryctl.engineering.drafting.sheets import NO_SOURCE, Answered, drafted_sheet, sheet_values
from gantryctl.engineering.drafting.templates import load_template, template_names
from gantryctl.engineering.drafting.writing import sheet_text
from gantryctl.engineering.sizing.loading import load_sheet
from gantryctl.errors import ConfigError, UsageError
from gantryctl.units import GRAVITY_M_S2, deg

SPEED_OF_LIGHT_M_S = 299_792_458.0


def values(template="tilt_table", **answers):
    return sheet_values(Answered.of(load_template(template), answers), "mine")


@pytest.mark.parametrize("template", template_names())
def test_the_text_of_a_sheet_is_the_sheet(template, tmp_path):
    found = values(template)
    path = tmp_path / "sheet.toml"
    path.write_text(sheet_text(found, template))
    assert load_sheet(path) == drafted_sheet(found, "sheet")
    assert load_sheet(path).sheet.guesses == guesses(found)


def test_an_answer_is_no_guess_and_what_follows_from_answers_is_computed():
    usual = values()
    own = values(inertia_kg_m2=3e4, unbalance_nm=5000.0, wind_nm=0.0)
    for path in ("load.inertia_kg_m2", "load.eccentricity_m", "load.eccentric_check_moment_nm"):
        assert usual[path].origin is Origin.GUESS
    assert own["load.inertia_kg_m2"][:2] == (3e4, Origin.SHEET)
    assert own["load.eccentric_check_moment_nm"][:2] == (1.25 * 5000.0, Origin.COMPUTED)
    moment = own["load.mass_kg"].value * GRAVITY_M_S2 * own["load.eccentricity_m"].value
    # Both figures are written with four digits.
    assert moment == pytest.approx(5000.0, rel=2e-3)
    # The mass is a guess even so: nobody said where it sits.
    assert own["load.mass_kg"].origin is Origin.GUESS


def test_a_requirement_without_a_source_is_told_as_one():
    """0.03 deg and 1 % are nobody's: sheet and every verdict say so until somebody names who requires it."""
    usual, own = values(), values(angle_deg=0.05)
    for path in ("required.angle_deg", "required.speed_error_ratio", "required.stopping_angle_deg"):
        assert usual[path].origin is Origin.GUESS
        assert NO_SOURCE in usual[path].rule
    assert usual["required.source"].value == NO_SOURCE
    # An angle that a person gave is nobody's usual figure; who requires it is open.
    assert own["required.angle_deg"][:2] == (0.05, Origin.SHEET)
    assert own["required.source"][:2] == ("not stated yet", Origin.GUESS)
    assert values(source="tender 4711")["required.source"][:2] == ("tender 4711", Origin.SHEET)


def test_a_required_angle_that_follows_from_a_published_rule_names_it():
    """Telescope: a tenth of the beam 1.2 wave lengths / diameter, here 0.098 deg at 8.4 GHz."""
    found = values("telescope_azimuth")
    assert "a tenth of the beam (IRA-INAF" in found["required.angle_deg"].rule
    assert str(found["required.source"].value).startswith("angle: a tenth of the beam")
    assert str(found["required.source"].value).endswith(f"speed and stop: {NO_SOURCE}")
    beam_deg = deg(1.2 * SPEED_OF_LIGHT_M_S / 8.4e9 / 25.0)
    assert found["required.angle_deg"].value == pytest.approx(0.1 * beam_deg, rel=0.03)


def test_the_gear_ratio_is_what_motor_speed_and_encoder_allow():
    """Tilt table: 1500 r/min at 1 r/min. Telescope: 4096 turns over 550 deg leave 2412, in steps of the ring's 20."""
    tilt, telescope = values(), values("telescope_azimuth")
    assert tilt["gears.reducer_ratio"].value * tilt["gears.ring_ratio"].value == 1500.0
    assert telescope["gears.reducer_ratio"].value * telescope["gears.ring_ratio"].value == 2400.0
    own = values(gear_ratio=900.0)
    assert own["gears.reducer_ratio"].value * own["gears.ring_ratio"].value == 900.0


def test_alike_bodies_grow_with_the_fifth_root_of_the_inertia():
    usual, large = values(), values(inertia_kg_m2=32.0 * 2e4)
    assert large["teeth.ring_radius_m"].value == pytest.approx(
        2.0 * usual["teeth.ring_radius_m"].value, rel=0.01
    )
    assert large["load.mass_kg"].value == pytest.approx(8.0 * usual["load.mass_kg"].value, rel=0.01)


def test_answers_of_a_file_and_of_options():
    assert answered('pos_min_deg = -5\nsource = "rig 3"\n', "f") == {"pos_min_deg": -5.0, "source": "rig 3"}
    assert answered_by_options(("inertia_kg_m2=1e5", "source=rig 3")) == {
        "inertia_kg_m2": 1e5,
        "source": "rig 3",
    }
    assert set(questions()) >= {"speed_max_r_min", "angle_deg", "inertia_kg_m2", "first_mode_hz"}


@pytest.mark.parametrize(
    ("options", "error", "message"),
    [
        (("inertia_kg_m2",), UsageError, "write --set KEY=VALUE; the keys are pos_min_deg"),
        (("=5",), UsageError, "write --set KEY=VALUE"),
        (("inertia=5",), ConfigError, "inertia: unknown key; did you mean inertia_kg_m2"),
        (
            ("inertia_kg_m2=heavy",),
            ConfigError,
            'inertia_kg_m2 = "heavy": is text, must be a number; allowed 0.01..',
        ),
        (("inertia_kg_m2=nan",), ConfigError, "inertia_kg_m2 = nan: is not a finite number; allowed"),
        (("inertia_kg_m2=-5",), ConfigError, "inertia_kg_m2 = -5.0: allowed"),
        (("inertia_kg_m2=[5]",), ConfigError, "inertia_kg_m2 = "),
        (("inertia_kg_m2=true",), ConfigError, "inertia_kg_m2 = true"),
        (("angle_deg=1", "angle_deg=2"), UsageError, "angle_deg is set twice"),
        ((f"source={'x' * 300}",), ConfigError, "source = "),
    ],
)
def test_wrong_answers_name_the_key_the_value_and_what_is_allowed(options, error, message):
    with pytest.raises(error) as caught:
        answered_by_options(options)
    assert message in str(caught.value)


@pytest.mark.parametrize(
    ("answers", "message"),
    [
        ({"pos_min_deg": 95.0}, "pos_min_deg = 95 deg: must lie at least 1 deg below pos_max_deg = 95 deg"),
        ({"stopping_angle_deg": 0.3}, "stopping_angle_deg = 0.3 deg: must be above 0.432 deg"),
    ],
)
def test_answers_that_contradict_each_other(answers, message):
    with pytest.raises(ConfigError) as caught:
        values(**answers)
    assert message in str(caught.value)


def test_no_template_of_that_name():
    with pytest.raises(UsageError, match="--template lathe: there is none; choose crane_slew, gantry, "):
        load_template("lathe")
