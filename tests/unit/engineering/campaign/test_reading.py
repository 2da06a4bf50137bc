"""A campaign file is checked like a machine file: each problem names the place, the value, the limit and what to do."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import pytest

from gantryctl.engineering.campaign.population import Campaign
from gantryctl.engineering.campaign.reading import load_campaign, shipped_campaigns
from gantryctl.engineering.campaign.run import survey
from gantryctl.errors import ConfigError
from gantryctl.machine import default_machine, with_values
from gantryctl.machine.effective import to_toml

from .conftest import INERTIA, ORDER

Made = Callable[..., Campaign]


def law(name: str, numbers: str, keys: str = "plant.load.inertia_kg_m2", part: str = "vary") -> str:
    return f'[{part}.x]\nlaw = "{name}"\nkeys = ["{keys}"]\n{numbers}\n'


WRONG = {
    "an unknown law": ('[vary.x]\nlaw = "beta"', r"\[vary\.x\] law = .beta.: allowed uniform, normal"),
    "an unknown key": (
        law("uniform", "low = 1.0\nhigh = 2.0", "plant.load.inertia"),
        r"\[vary\.x\] keys: plant\.load\.inertia: no key has this path; did you mean plant\.load\.inertia_kg_m2",
    ),
    "a value beyond the limit": (
        law("uniform", "low = 2e6\nhigh = 9e8"),
        r"\[vary\.x\]: gives \[plant\.load\] inertia_kg_m2 = 9e\+08 kg m2, allowed 0\.01\.\.100000000 kg m2",
    ),
    "a relative value beyond the limit": (
        law("discrete", "relative = true\nvalues = [1.0, 50.0]"),
        r"gives \[plant\.load\] inertia_kg_m2 = 1\.09e\+08",
    ),
    "ends in the wrong order": (law("uniform", "low = 3e6\nhigh = 2e6"), r"low = 3e\+06: must be below high"),
    "a spread below 1": (law("lognormal", "median = 1e6\nspread = 0.9"), r"spread = 0\.9"),
    "an unknown number": (
        law("normal", "mean = 1e6\ndeviation = 1.0\nsigma = 2.0"),
        "sigma = 2.0: unknown key",
    ),
    "too few weights": (
        law("discrete", "values = [1e6, 2e6]\nweights = [1.0]"),
        "has 1 numbers, must have 2",
    ),
    "weights of nothing": (
        law("discrete", "values = [1e6]\nweights = [0.0]"),
        "at least one must be above 0",
    ),
    "a part of nothing": (
        law("uniform", "relative = true\nlow = 0.5\nhigh = 2.0", "plant.load.eccentric_angle_deg"),
        "is 0 in hust_gantry",
    ),
    "a word": (
        law("uniform", "low = 0.0\nhigh = 1.0", "plant.integration.scheme"),
        r"is no number .*put its value into \[set\]",
    ),
    "parts of a whole number": (
        law("uniform", "low = 8.0\nhigh = 12.0", "plant.motor.torque_ripple_order"),
        'use law = "discrete"',
    ),
    "a key twice": (INERTIA + law("uniform", "low = 1e6\nhigh = 2e6"), "varies in another table"),
    "no table": ("[vary]\nx = 3", r"\[vary\] x = 3: must be a table"),
    "nothing varies": ("", "nothing varies"),
    "drift without identification": (
        INERTIA + law("uniform", "low = 1e6\nhigh = 2e6", part="drift"),
        r"\[drift\]: changes plants after their identification, and nothing here is identified",
    ),
    "drift of control": (
        INERTIA
        + '[improved]\nmachine = "hust_improved.toml"\n'
        + law("uniform", "low = 1.0\nhigh = 2.0", "control.kpp_per_s", "drift"),
        r"control\.kpp_per_s is no property of the plant",
    ),
    "an unknown variant": (
        INERTIA + '[improved]\nmachine = "hust_improved.toml"\nvariants = ["gear_map_alon"]\n',
        "did you mean gear_map_alone",
    ),
    "a limit of nothing": (
        INERTIA + "[limits]\nmove_load_error = [0.1]",
        "did you mean move_load_error_deg_s",
    ),
    "a limit below 0": (
        INERTIA + "[limits]\nmove_load_error_deg_s = [-0.1]",
        "must be an array of numbers above 0",
    ),
    "a wrong setting": (
        INERTIA + '[set]\n"plant.load.mass_kg" = 1.0',
        r"\[set\].*\[plant\.load\] mass_kg = 1\.0",
    ),
}


@pytest.mark.parametrize("name", WRONG)
def test_a_wrong_file_is_refused_with_a_line_that_says_what_to_do(name: str, made: Made) -> None:
    rest, said = WRONG[name]
    with pytest.raises(ConfigError, match=said) as refused:
        made(rest)
    assert all(line.startswith("c.toml: ") for line in refused.value.problems)


@pytest.mark.parametrize(
    ("order", "said"),
    [
        ('tests = ["chord"]', "tests: .chord. is not one of chord_test, speed_test"),
        (
            'tests = ["stops"]\noutputs = ["a_true_deg"]',
            "outputs: .a_true_deg. is not one of quick_stop_angle_deg",
        ),
        (
            'machine = "nowhere.toml"',
            "no such file, neither beside the campaign file nor among the shipped ones",
        ),
        ('machine = "hust_can.toml"', 'plants of a campaign are simulated: use "sim"'),
        ('sampling = "sensitivity"\ncount = 100', "must be a power of 2: 64 or 128"),
        ('sampling = "sobol"\ncount = 100_000_000', "at most 16777216"),
        ('sampling = "latin_hypercube"\ncount = 100_000_000', "has at most 20000000 plants"),
        ("count = 1", r"count = 1: allowed 2\.\.1000000000"),
        ("seed = 1.5", "seed = 1.5: is a number with a point, must be a whole number"),
        ('name = "a/b"', r"name = .a/b."),
        ("tests = 3", r"tests = 3: is a whole number, must be an array of words in quotes"),
        ("tests = [3]", r"tests\[0\] = 3: is a whole number, must be text in quotes"),
        ("tests = []", r"tests = \[\]: has 0 words; allowed 1 to 4 words in quotes"),
    ],
)
def test_a_wrong_order_is_refused(order: str, said: str, made: Made) -> None:
    with pytest.raises(ConfigError, match=said):
        made(INERTIA, order)


def test_several_problems_come_in_one_run(made: Made) -> None:
    with pytest.raises(ConfigError) as refused:
        made('[vary.x]\nlaw = "beta"\n[limits]\nx = 3', 'tests = ["chord"]')
    assert len(refused.value.problems) >= 3


def test_a_name_of_nothing_lists_what_is_shipped() -> None:
    with pytest.raises(ConfigError, match=r"a shipped campaign goes by its name: .*gears"):
        load_campaign("nothing")


@pytest.mark.parametrize("name", shipped_campaigns())
def test_a_shipped_campaign_is_right_and_its_first_plants_are_possible(name: str) -> None:
    campaign = load_campaign(name)
    assert campaign.name == name
    tried, refused = survey(campaign)
    # Laws without an end pass limits somewhere; one plant in a hundred would change the answer.
    assert sum(refused.values()) <= 0.01 * tried


def test_a_machine_beside_the_file_comes_first(tmp_path: Path, made: Made) -> None:
    shipped = made(INERTIA, ORDER).hash
    other = with_values(default_machine(), {"plant.load.mass_kg": 1.9e5})
    (tmp_path / "hust_gantry.toml").write_text(to_toml(other), "utf-8")
    assert made(INERTIA, ORDER).hash != shipped


def test_what_the_machine_requires_is_the_limit_where_the_campaign_names_none(
    made: Made, tmp_path: Path
) -> None:
    strict = {"required.angle_deg": 0.01, "required.source": "tender 4711"}
    text = to_toml(with_values(default_machine(), strict)).replace('name = "hust_gantry"', 'name = "dish"')
    (tmp_path / "dish.toml").write_text(text, encoding="utf-8")
    order = 'machine = "dish.toml"\ntests = ["chord_test", "stops"]\ncount = 8'
    campaign = made(INERTIA + "[limits]\na_measured_deg = [0.5]", order)
    assert campaign.limits == {
        "a_measured_deg": (0.5,),
        "a_true_deg": (0.01,),
        "angle_error_deg": (0.01,),
        "quick_stop_angle_deg": (4.0,),
    }
    assert set(campaign.required) == {"a_true_deg", "angle_error_deg", "quick_stop_angle_deg"}
    assert set(campaign.required.values()) == {"dish (tender 4711)"}
