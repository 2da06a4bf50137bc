"""Plants that change after they were identified: what a drift file may say, and what is made of it."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest

from gantryctl.engineering.accuracy.verdict import Conformity
from gantryctl.engineering.comparison.drift_file import (
    Drift,
    DriftRow,
    drifts_folder,
    load_drift,
    parse_drift,
)
from gantryctl.engineering.comparison.drift_report import DriftReport, a_true, controls_of, drift_report
from gantryctl.engineering.comparison.drift_text import drift_data, notes, render_drift, tables
from gantryctl.engineering.comparison.key_figures import KeyFigures, chord_tests
from gantryctl.engineering.comparison.variants import without_load_encoder
from gantryctl.errors import ConfigError, UsageError
from gantryctl.machine import Machine, Requirement, default_machine, effective_values, with_values
from support.improved import improved_machine
from support.reports import HEAD

MOMENT = '[row.moment]\nmeaning = "more"\n[row.moment.plus]\nplant.load.eccentricity_m = 0.0101875\n'


def rows_of(text: str) -> tuple[DriftRow, ...]:
    return parse_drift(text, "d.toml", improved_machine()).rows


def changed(row: DriftRow, machine: Machine) -> dict[str, object]:
    before, after = effective_values(machine), effective_values(row.on(machine))
    return {path: value for path, value in after.items() if value != before[path]}


def test_a_row_sets_multiplies_and_adds_and_keeps_the_calibration() -> None:
    machine = improved_machine()
    text = (
        "[row.a.set]\nplant.load.eccentric_sign = 1.0\n[row.b.times]\nplant.gear_error.mesh_um = 1.5\n"
        '[row.c.plus]\n"plant.transmission.backlash_mm" = 0.15\n'
        '[row.all]\ntogether = ["a", "b", "c"]\n'
    )
    a, b, c, both = rows_of(text)
    assert changed(a, machine) == {"plant.load.eccentric_sign": 1.0}
    assert changed(b, machine) == {"plant.gear_error.mesh_um": pytest.approx(12.0)}
    assert changed(c, machine) == {"plant.transmission.backlash_mm": pytest.approx(0.2)}
    assert changed(both, machine) == changed(a, machine) | changed(b, machine) | changed(c, machine)
    assert both.on(machine).calibration == machine.calibration is not None


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("", "has no rows"),
        ('[drift]\nname = "x"\n', "has no rows"),
        ("row = 3\n", r"row = 3: must be tables \[row\.NAME\]"),
        ("[row]\na = 1\n", r"\[row\] a = 1: must be a table \[row\.a\]"),
        ("[row.a]\n", r"\[row\.a\]: changes nothing"),
        ("[row.a.set]\nplant.load.mas_kg = 1.0\n", r"plant\.load\.mas_kg: no key .*plant\.load\.mass_kg\?"),
        ("[row.a.set]\naxis.ring_ratio = 12.0\n", "axis.ring_ratio is no property of the plant"),
        ("[row.a.set]\nplant.load.mass_kg = nan\n", "mass_kg = nan: is not a finite number"),
        ("[row.a.times]\nplant.load.mass_kg = inf\n", "mass_kg = inf: is not a finite number"),
        ("[row.a.plus]\nplant.gear_error.ring_um = 1.0\n", "ring_um: is no number but takes"),
        ("[row.a.times]\nplant.wind.moment_nm = 2.0\n", "moment_nm: is 0 in hust_improved"),
        ('[row.a.plus]\nplant.load.mass_kg = "1"\n', 'mass_kg = "1": must be a number'),
        ("[row.a.set]\nplant.load.mass_kg = -1.0\n", r"\[row\.a\]: \[plant\.load\] mass_kg = -1(\.0)?: allowed"),
        ("[row.a.sets]\nplant.load.mass_kg = 1.0\n", r"\[row\.a\] sets: is not one of .*did you mean set\?"),
        ("[row.a]\nmeaning = 3\n" + MOMENT, "meaning = 3: must be text in quotes"),
        (MOMENT + '[row.b]\ntogether = ["moment"]\n', "must be the names of at least two rows"),
        (MOMENT + '[row.b]\ntogether = ["moment", "momnt"]\n', "did you mean moment"),
        (
            MOMENT + '[row.s.set]\nplant.load.eccentricity_m = 0.01\n[row.b]\ntogether = ["moment", "s"]\n',
            "two of these rows change plant.load.eccentricity_m",
        ),
        ("[row.a\n", "line 1"),
        ("[drift]\nnames = 3\n" + MOMENT, "names"),
    ],
)  # fmt: skip
def test_a_bad_file_is_refused_with_what_is_wrong(text: str, said: str) -> None:
    with pytest.raises(ConfigError, match=said) as refused:
        parse_drift(text, "d.toml", improved_machine())
    assert all(line.startswith("d.toml: ") for line in refused.value.problems)


def test_the_delivered_files_go_by_their_names(tmp_path: Path) -> None:
    machine = improved_machine()
    for file in drifts_folder().glob("*.toml"):
        drift = load_drift(file.stem, machine)
        assert drift == load_drift(file, machine)
        assert drift.description
        assert all(row.meaning != row.name for row in drift.rows)
    with pytest.raises(ConfigError, match=r"does not exist; a delivered drift file goes by its name: hust"):
        load_drift(tmp_path / "nowhere.toml", machine)


def test_a_row_may_stand_on_top_of_others() -> None:
    machine = improved_machine()
    text = (
        MOMENT + "[row.teeth.set]\nplant.switches.tooth_pitch = true\n"
        "[row.wear.times]\nplant.gear_error.mesh_um = 1.5\n"
        '[row.all]\ntogether = ["moment", "teeth"]\n'
    )
    plain = parse_drift(text, "d.toml", machine)
    moment, teeth, wear, both = plain.on_top(["teeth", "wear"]).rows
    for row, own in ((moment, plain.rows[0]), (both, plain.rows[3])):
        assert changed(row, machine) == changed(plain.rows[1], machine) | changed(
            plain.rows[2], machine
        ) | changed(own, machine)
    # What a row has already is not done to it twice.
    assert changed(wear, machine)["plant.gear_error.mesh_um"] == pytest.approx(12.0)
    assert changed(teeth, machine)["plant.gear_error.mesh_um"] == pytest.approx(12.0)
    assert plain.on_top([]) == plain
    with pytest.raises(
        UsageError, match=r"--on-top \"tooth\": is no row of d: moment, teeth, wear, all; did you mean teeth"
    ):
        plain.on_top(["tooth"])


def test_what_a_row_sets_stands_above_what_lies_below_it() -> None:
    """12 um below; 16 um of its own, and a half more than what is below it."""
    machine = improved_machine()
    key = "plant.gear_error.mesh_um"
    text = f"[row.base.set]\n{key} = 12.0\n[row.own.set]\n{key} = 16.0\n[row.wear.times]\n{key} = 1.5\n"
    base, own, wear = (
        row.on(machine).plant.gear_error.mesh_um
        for row in parse_drift(text, "d.toml", machine).on_top(["base"]).rows
    )
    assert (base, own, wear) == pytest.approx((12.0, 16.0, 18.0))


def short(machine: Machine) -> Machine:
    """The same with a short chord test."""
    return with_values(
        machine,
        {
            "accuracy.bases_deg": [60.0, 0.0],
            "accuracy.displacements_deg": [10.0, 20.0],
            "accuracy.dwell_s": 2.0,
            "accuracy.average_s": 0.5,
        },
    )


def following_nothing() -> Machine:
    """No limit is set within which anything may be followed."""
    at = "control.compensation."
    limits = {f"{at}moment_observer.active": False, f"{at}moment_observer.limit_nm": 0.0}
    return with_values(improved_machine(), limits)


@pytest.fixture(scope="module")
def report() -> DriftReport:
    # Two rows have a median between them.
    text = MOMENT + "[row.backlash.plus]\nplant.transmission.backlash_mm = 0.15\n"
    drift = parse_drift(text, "d.toml", improved_machine())
    return drift_report(short(default_machine()), short(following_nothing()), drift)


def test_every_control_has_the_figures_of_its_plant_with_the_calibration_of_the_first(
    report: DriftReport,
) -> None:
    """A run of its own, one plant at a time, gives the same bits; a stale calibration shows."""
    names = ("hust_gantry", "without the load encoder", "hust_improved")
    assert tuple(report.figures) == names
    moment = report.drift.rows[0]
    bare = moment.on(without_load_encoder(short(following_nothing())))
    alone = chord_tests([bare], "B", [0], warm_up=True)[0]
    assert report.figures[names[1]][1].a_true_b == alone.a_true_deg
    unchanged, more, gap = (a_true(row) for row in report.figures[names[1]])
    assert more > 2.0 * unchanged
    assert gap > 2.0 * unchanged


FOLLOWED = ("nothing", "moment", "moment and backlash")


def following(what: str) -> Machine:
    at = "control.compensation."
    return with_values(
        improved_machine(),
        {f"{at}{name}_observer.active": name in what for name in ("moment", "backlash")},
    )


@pytest.mark.parametrize("own", FOLLOWED)
def test_what_a_machine_may_follow_is_compared_with_what_it_follows(own: str) -> None:
    ways = controls_of(default_machine(), following(own))
    assert [ways[0].name, ways[-1].name] == ["hust_gantry", "hust_improved"]
    shown = {way.name: way.machine for way in ways}
    assert shown["hust_improved"] == following(own)
    for what in FOLLOWED:
        other = None if what == own else following(what)
        assert shown.get(f"hust_improved, {what} followed") == other
        bare = without_load_encoder(following(what))
        assert shown[f"without the load encoder, {what} followed"] == bare


def test_a_machine_that_may_follow_nothing_is_shown_once_with_its_encoder_and_once_without() -> None:
    assert [way.name for way in controls_of(default_machine(), following_nothing())] == [
        "hust_gantry", "without the load encoder", "hust_improved",
    ]  # fmt: skip


def test_a_machine_is_shown_with_the_other_end_of_its_moves_as_well() -> None:
    followed = "without the load encoder, moment and backlash followed"
    for gentle, other in ((False, f"{followed}, gentle end"), (True, f"{followed}, without a gentle end")):
        machine = with_values(improved_machine(), {"virtual_axis.gentle_end": gentle})
        ends = {
            control.name: control.machine.virtual_axis.gentle_end
            for control in controls_of(default_machine(), machine)
        }
        assert ends[followed] is gentle
        assert ends[other] is not gentle


def test_spreads_are_over_the_rows_that_change_something(report: DriftReport) -> None:
    spread = report.spread("hust_improved", a_true)
    unchanged, first, second = (a_true(row) for row in report.figures["hust_improved"])
    assert spread.unchanged == unchanged
    assert spread.median == pytest.approx(0.5 * (first + second))
    assert spread.worst == max(first, second)
    assert spread.high == pytest.approx(min(first, second) + 0.95 * abs(first - second))
    assert spread.worst_in == ("moment" if first > second else "backlash")


def test_tables_data_and_page_say_the_same(report: DriftReport) -> None:
    worst = f"{report.spread('hust_improved', a_true).worst:.4f}"
    data = drift_data(report)
    assert data["over_rows"]["hust_improved"]["a_true"]["worst"] == pytest.approx(float(worst), abs=5e-5)
    assert data["rows"][1]["changes"] == [
        {"path": "plant.load.eccentricity_m", "how": "plus", "value": 0.0101875}
    ]
    assert any(worst in cell for table in tables(report) for row in table.rows for cell in row)
    page = render_drift(report, HEAD)
    assert worst in page
    assert "nothing is identified after a change" in " ".join(notes(report))
    assert "hust_improved, " in report.verdict.text


def test_what_lies_below_every_row_is_told(report: DriftReport) -> None:
    below = replace(report, drift=report.drift.on_top(["backlash"]))
    assert any("Every row but the first has backlash too." in note for note in notes(below))
    assert drift_data(below)["on_top_of"] == ["backlash"]
    assert "all but the first on top of backlash" in render_drift(below, HEAD)
    assert "on top of" not in render_drift(report, HEAD)


@pytest.mark.parametrize(
    ("changes", "verdict", "row"),
    [
        ({}, Conformity.PASS, "b"),
        # A of 0.05 deg lies within 0.1 deg, a chord of 0.12 deg does not; nor does an angle that is a turn off.
        ({"a": {"largest_chord_a": 0.12}}, Conformity.FAIL, "a"),
        ({"a": {"largest_angle_a": 0.3}}, Conformity.FAIL, "a"),
        # A of 0.05 to 0.11 deg is not decided, whatever is proven of the larger A beside it.
        ({"a": {"a_measured_high_a": 0.11}}, Conformity.UNDECIDED, "a"),
        ({"a": {"a_measured_high_a": 0.11}, "b": {"largest_chord_a": 0.2}}, Conformity.FAIL, "b"),
    ],
)  # fmt: skip
def test_the_worst_row_is_the_worst_by_every_figure_that_is_judged(
    changes: dict[str, dict[str, float]], verdict: Conformity, row: str
) -> None:
    usual = KeyFigures(*[0.01] * len(KeyFigures._fields))
    rows = {
        name: usual._replace(
            **{"a_measured_a": a, "a_measured_high_a": a + 0.005, "largest_chord_a": 0.03, "largest_angle_a": 0.02}
            | changes.get(name, {})
        )
        for name, a in (("a", 0.05), ("b", 0.06))
    }  # fmt: skip
    drift = DriftReport(
        "one", "two", Drift("d", "", ()), "", Requirement(0.1, "by hand"), (0.0, 90.0), (("a", ""), ("b", "")),
        {"two": tuple(rows.values())},
    )  # fmt: skip
    assert drift.verdict.conformity is verdict
    assert all(f"two, {row}: " in name for name in drift.verdict.figures_deg)


def test_every_column_over_the_rows_has_its_own_figure() -> None:
    """Of 0.02 and 0.04 deg: half way 0.03, at 95 % 0.02 + 0.95 x 0.02 = 0.039."""
    usual = KeyFigures(*[0.01] * len(KeyFigures._fields))
    found = tuple(usual._replace(a_true_a=a) for a in (0.01, 0.04, 0.02))
    drift = DriftReport(
        "one", "two", Drift("d", "", ()), "", Requirement(0.1, "by hand"), (0.0, 90.0),
        (("as identified", ""), ("a", ""), ("b", "")), {"two": found},
    )  # fmt: skip
    over = tables(drift)[-1]
    (row,) = (row for row in over.rows if "A true, procedure A, deg" in row)
    assert dict(zip(over.heads, row, strict=True)) == {
        "control": "two",
        "figure": "A true, procedure A, deg",
        "as identified": "0.0100",
        "median": "0.0300",
        "95 %": "0.0390",
        "worst": "0.0400",
        "in": "a",
    }


def test_one_machine_twice_is_no_comparison() -> None:
    drift = parse_drift(MOMENT, "d.toml", default_machine())
    with pytest.raises(UsageError, match="two ways of control"):
        drift_report(default_machine(), default_machine(), drift)


def test_a_machine_without_its_calibration_is_refused() -> None:
    drift = parse_drift(MOMENT, "d.toml", improved_machine())
    with pytest.raises(ConfigError, match="gantryctl identify"):
        drift_report(default_machine(), improved_machine().calibrated(None), drift)
