"""Pictures of three machines: every curve inside its axes, nothing empty, no text over text."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from gantryctl.engineering.accuracy.report.page import render_speed_test
from gantryctl.engineering.accuracy.speed_test import speed_test
from gantryctl.engineering.analysis.figures import damping_over_stiffness, frequency_plots
from gantryctl.engineering.analysis.models.mechanics import PlantKind
from gantryctl.engineering.analysis.study import study
from gantryctl.engineering.report.drawing import draw_picture
from gantryctl.engineering.report.pictures import Panel, Picture, line
from gantryctl.engineering.report.recording import recorded
from gantryctl.engineering.stops import stop_table
from gantryctl.engineering.stops.page import render_stops
from gantryctl.machine import Machine, configs_folder, default_machine, load_machine
from gantryctl.units import DEG_S_PER_R_MIN, Dial
from support.command_line import cli, done
from support.figure_faults import faults_of, watched
from support.reports import CAMPAIGN, HEAD

# The reference, a dish of 5e6 kg m2 with 0.333 r/min, a table of 50 kg m2 with 5 r/min.
MACHINES = ("reference", "telescope_azimuth", "rotary_table")
# The two machines that are delivered beside the reference.
DELIVERED = ("configs/azimuth_dish", "configs/rotary_table")


@pytest.fixture(scope="module")
def files(tmp_path_factory: pytest.TempPathFactory) -> Callable[[str], Path | None]:
    """Machine files, as `gantryctl new` writes them; None for the reference."""
    folder = tmp_path_factory.mktemp("machines")

    def file(name: str) -> Path | None:
        if name in DELIVERED:
            return configs_folder() / f"{Path(name).name}.toml"
        path = folder / f"{name}.toml"
        if name == "reference" or path.exists():
            return None if name == "reference" else path
        answer = cli("new", name, "--template", name, "--gears", "0", "--out", folder)
        assert answer.code == 0, answer.err
        return path

    return file


@pytest.fixture
def machine(files: Callable[[str], Path | None], name: str) -> Machine:
    file = files(name)
    return default_machine() if file is None else load_machine(file)


def good(found: dict[str, list[str]], least: int) -> None:
    """Figures were made, and none has a fault."""
    assert len(found) >= least
    assert not {name: faults for name, faults in found.items() if faults}


# The others have the same pictures of other sizes; a second of a processor each.
@pytest.mark.parametrize(
    "name",
    [*MACHINES[:2], *(pytest.param(name, marks=pytest.mark.slow) for name in (MACHINES[2], *DELIVERED))],
)
def test_speed_test(machine: Machine, monkeypatch: pytest.MonkeyPatch) -> None:
    highest_r_min = machine.speed.setting_max_deg_s / DEG_S_PER_R_MIN
    with watched(monkeypatch) as found:
        render_speed_test(speed_test(machine, [highest_r_min]), HEAD)
    good(found, 2)


# The dish is stable down to a tenth of its gain: a crossing outside of the Nyquist diagram.
@pytest.mark.parametrize(
    "name", [pytest.param("rotary_table", marks=pytest.mark.slow), "configs/azimuth_dish"]
)
def test_analysis(machine: Machine, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    with watched(monkeypatch) as found:
        frequency_plots(study(machine, PlantKind.FULL), tmp_path)
        damping_over_stiffness(machine, tmp_path)
    good(found, 4)


@pytest.mark.slow
@pytest.mark.parametrize("name", [*MACHINES, *DELIVERED])
def test_whatever_a_command_draws(
    files: Callable[[str], Path | None], name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    file = files(name)
    given = () if file is None else ("--config", file)
    with watched(monkeypatch) as found:
        for command in (
            ("accuracy", "run", "--ensemble", "4"),
            ("speed-test",),
            ("tune",),
            ("analyse", "--plot", "--robust"),
            ("analyse", "--plot", "--plant", "two-mass"),
            ("analyse", "--plot", "--plant", "rigid"),
        ):
            answer = cli(*command, *given, "--out", tmp_path)
            assert answer.code in (0, 1), (command, answer.err)
        done("size", "--out", tmp_path)
    good(found, 20)


@pytest.mark.slow
@pytest.mark.parametrize("name", ["reference", "telescope_azimuth", "tilt_table", *DELIVERED])
def test_stops_at_every_speed(machine: Machine, monkeypatch: pytest.MonkeyPatch) -> None:
    with watched(monkeypatch) as found:
        render_stops(machine, stop_table(machine), None, HEAD)
    good(found, 1)


@pytest.mark.slow
def test_recordings_faults_and_populations(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    campaign = tmp_path / "small.toml"
    campaign.write_text(CAMPAIGN, "utf-8")
    with watched(monkeypatch) as found:
        done("move", "5")
        done("trace", "plot", "--out", tmp_path / "a.png")
        done("trace", "plot", "--out", tmp_path / "a.html")
        done("faults", "run", "--fault", "A2", "--speed", "6", "--out", tmp_path / "f.png")
        assert cli("campaign", "run", campaign, "--out", tmp_path / "result").code == 0
        done("campaign", "plot", tmp_path / "result", "--out", tmp_path)
    good(found, 7)


def planted() -> Figure:
    """A good figure, to be spoilt."""
    x = np.linspace(0.0, 10.0, 200)
    panel = Panel("time, s", "speed, deg/s", (line("one", x, np.sin(x)), line("two", x, np.cos(x))), (0.5,))
    return draw_picture(Picture("good", (panel, panel)))


def test_a_good_figure_has_no_fault() -> None:
    assert faults_of(planted()) == []


@pytest.mark.parametrize(
    ("change", "fault"),
    [
        (lambda axes: axes.set_ylim(-0.5, 2.0), "a curve leaves the height: -0.999"),
        (lambda axes: axes.set_xlim(0.0, 5.0), "a curve leaves the width"),
        (lambda axes: axes.set_ylim(-20.0, 20.0), "data cover 5 % of the height, less than 35 %"),
        (lambda axes: axes.set_xlim(-90.0, 10.0), "data cover 10 % of the width, less than 60 %"),
        (lambda axes: [curve.remove() for curve in list(axes.lines)], "nothing is drawn"),
        (lambda axes: axes.set_title("a title that is much longer than its panel is wide, " * 2), " over "),
        (lambda axes: axes.set_xticks(range(11), ["ten degrees"] * 11), "'ten degrees' over 'ten degrees'"),
        (lambda axes: axes.text(5.0, 0.0, "here") and axes.text(5.0, 0.02, "there"), "'here' over 'there'"),
        (lambda axes: axes.figure.text(0.99, 0.5, "outside"), "'outside' leaves the figure"),
        (lambda axes: axes.legend(loc="center"), "the legend covers 'one'"),
        (
            lambda axes: axes.figure.legend(*axes.get_legend_handles_labels(), loc="center left"),
            "the legend covers",
        ),
    ],
)
def test_a_planted_fault_is_found(change: Callable[[Axes], object], fault: str) -> None:
    figure = planted()
    figure.axes[1].set_title("beside")
    change(figure.axes[0])
    assert any(fault in found for found in faults_of(figure)), faults_of(figure)


def test_angles_beside_a_curve_are_read_within_their_turn_and_the_curve_goes_on() -> None:
    """From -30 to 60 deg on a 0..360 display: 330, 340 ... 0, 20 beside one curve without a jump."""
    angle = np.linspace(-30.0, 60.0, 50)
    panel = Panel(
        "angle, deg", "angle, deg", (line("a", angle, 2.0 * angle),), x_dial=Dial(0.0), y_dial=Dial(0.0)
    )
    figure = draw_picture(Picture("", (panel,)))
    figure.canvas.draw()
    (ax,) = figure.axes
    for side in (ax.xaxis, ax.yaxis):
        ticks = {
            float(label.get_text()): at
            for at, label in zip(side.get_ticklocs(), side.get_ticklabels(), strict=True)
        }
        assert all(0.0 <= read < 360.0 for read in ticks)
        assert all((read - at) % 360.0 == pytest.approx(0.0) for read, at in ticks.items())
        assert min(ticks.values()) < 0.0
    (curve,) = ax.get_lines()
    assert np.max(np.abs(np.diff(curve.get_ydata()))) < 10.0
    text = recorded(Picture("", (panel,)), "read").recording
    (told,) = json.loads(text)["panels"]
    assert (told["xBegin"], told["yBegin"]) == (0.0, 0.0)
