"""`gantryctl campaign` from the outside."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from support.command_line import cli, done, refused
from support.reports import CAMPAIGN


def write(name: str = "small.toml", sampling: str = "monte_carlo", **changes: str) -> Path:
    text = CAMPAIGN.replace('"sensitivity"', f'"{sampling}"')
    for old, new in changes.items():
        text = text.replace(old, new)
    Path(name).write_text(text, encoding="utf-8")
    return Path(name)


def test_run_show_plot_and_compare() -> None:
    ran = cli("campaign", "run", write(), "--threads", "2")
    assert ran.code == 0, ran.err
    assert "all 8 rows are there" in ran.out
    shown = done("campaign", "show", "small.result").out
    assert re.search(r"move_load_error_deg_s +deg/s +0\.0\d+", shown)
    assert re.search(r"move_load_error_deg_s +0\.4 deg/s +100\.0 % +63\.1 % \.\. 100\.0 %", shown)
    assert cli("campaign", "run", "small.toml", "--workers", "1", "--out", "again").code == 0
    both = done("campaign", "compare", "small.result", "again", "--json").json["results"]
    assert both["again"]["figures"] == both["small.result"]["figures"]
    assert "again" in done("campaign", "compare", "small.result", "again").out


def test_the_page_is_whole_in_itself_and_the_same_each_time() -> None:
    assert cli("campaign", "run", write(sampling="sensitivity"), "--threads", "1").code == 0
    pages = []
    for _ in range(2):
        done("campaign", "plot", "small.result", "--out", "a", "--date", "today")
        pages.append(Path("a", "campaign.html").read_text("utf-8"))
    assert pages[0] == pages[1]
    assert pages[0].count("<svg") == 4  # two distributions, two sensitivities
    assert not re.search(r'(src|href)="(?!#)', pages[0])
    assert "Sobol indices of move_base_um" in pages[0]
    assert "gantryctl campaign plot small.result --out a --date today" in pages[0]
    assert "inertia" in done("campaign", "show", "small.result").out


def test_a_discrete_factor_splits_a_population() -> None:
    write(**{
        'law = "uniform"': 'law = "discrete"', "low = 0.8": "values = [0.9, 1.1]", "high = 1.2": "weights = [1.0, 1.0]",
    })  # fmt: skip
    assert cli("campaign", "run", "small.toml").code == 0
    key = "plant.load.inertia_kg_m2"
    light, heavy = done("campaign", "show", "small.result", "--by", key, "--json").json
    assert light["part"] == {"key": key, "value": pytest.approx(0.9 * 2.18e6)}
    assert heavy["part"] == {"key": key, "value": pytest.approx(1.1 * 2.18e6)}
    plants = [part["figures"]["move_base_um"]["plants"] for part in (light, heavy)]
    assert sum(plants) == 8
    assert min(plants) >= 1
    assert "inertia_kg_m2 2.398e+06" in done("campaign", "show", "small.result", "--by", key).out
    done("campaign", "plot", "small.result", "--by", key)
    assert "does not vary here" in refused("campaign", "show", "small.result", "--by", "plant.load.mass_kg")


def test_a_run_that_goes_on_says_what_is_there() -> None:
    assert cli("campaign", "run", write(), "--threads", "1").code == 0
    again = cli("campaign", "run", write(**{"count = 8": "count = 40"}), "--json")
    assert "8 of 40 rows are there" in again.err
    assert again.json["complete"] is True
    assert again.json["there"] == 40
    assert again.json["computed"] == 32


def test_plants_that_are_refused_are_told_before_the_run_and_counted_after_it() -> None:
    beyond = write(
        **{'law = "uniform"': 'law = "normal"', "low = 0.8": "mean = 1.0", "high = 1.2": "deviation = 0.8"}
    )
    ran = cli("campaign", "run", beyond)
    assert ran.code == 0, ran.err
    assert re.search(
        r"of the first 8 plants the checks of the machine refuse \d: plant\.load\.inertia", ran.err
    )
    assert "rows have no figures and are left out" in done("campaign", "show", "small.result").out


def test_a_plan_reckons_with_what_it_measures() -> None:
    write()
    small = done(
        "campaign", "plan", "small.toml", "--measure", "0.1", "--plants", "1000", "--cores", "10", "--json"
    )
    plan = small.json
    assert plan["core_hours"] == pytest.approx(plan["row_s"] * 1000 / 3600)
    assert plan["time_s"] == pytest.approx(plan["row_s"] * 100)
    assert plan["cost"] == pytest.approx(0.04 * plan["core_hours"])
    assert 10_000 < plan["bytes"] < 10_000_000
    assert "core hours" in done("campaign", "plan", "small.toml", "--measure", "0.1").out


def test_wrong_orders_are_refused() -> None:
    write()
    assert "give one of them" in refused("campaign", "run", "small.toml", "--threads", "2", "--workers", "2")
    assert "holds no result" in refused("campaign", "show", "nowhere")
    nobody = cli("campaign", "run", "small.toml", "--cluster", "here")
    assert nobody.code == 2
    assert "such as tcp://10.0.0.1:8786" in nobody.err


def test_a_cluster_that_does_not_answer_is_named() -> None:
    write()
    nobody = cli("campaign", "run", "small.toml", "--cluster", "tcp://127.0.0.1:1")
    assert nobody.code == 3
    assert "no scheduler answers within 5 s" in nobody.err
