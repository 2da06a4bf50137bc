"""Pictures over time and over the uncertain stiffness: step, ramp, parabola; damping; measured frequency response."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

import numpy as np

from gantryctl.engineering.analysis.figures import BLUE, GREEN, GREY, INK, ORANGE, RED, figure, name_of
from gantryctl.engineering.analysis.models.linear import ComplexArray, FloatArray
from gantryctl.engineering.analysis.models.mechanics import PlantKind
from gantryctl.engineering.analysis.models.paper_loop import rigid_loop
from gantryctl.engineering.analysis.models.responses import Reference, TimeResponse, time_response
from gantryctl.engineering.analysis.models.robust import running_damping, sketch_damping
from gantryctl.machine import Machine
from gantryctl.units import deg, rad

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from gantryctl.engineering.analysis.measured.response import Measured
    from gantryctl.engineering.analysis.study import Study

STEP_DEG: Final = 0.01
_SWING_S: Final = 4.0
_SHORT_S: Final = 0.5


def time_responses(study: Study, folder: Path) -> Path:
    """Step of angle, speed and acceleration: what is left of them at motor and load, eq. (5) beside a rigid plant."""
    path = folder / "responses.png"
    machine = study.machine
    sizes = {
        Reference.STEP: rad(STEP_DEG),
        Reference.RAMP: rad(machine.speed.setting_min_deg_s),
        Reference.PARABOLA: rad(machine.virtual_axis.acc_deg_s2),
    }
    duration = _SHORT_S if study.kind is PlantKind.RIGID else _SWING_S
    titles = {
        Reference.STEP: f"angle jumps by {STEP_DEG:g} deg (no set-point speed)",
        Reference.RAMP: f"speed jumps to {machine.speed.setting_min_deg_s:g} deg/s, the lowest setting",
        Reference.PARABOLA: f"acceleration jumps to {machine.virtual_axis.acc_deg_s2:.3g} deg/s2: a profile's corner",
    }
    with figure(path, f"Following error: {name_of(study)}", 3, 1, figsize=(8.6, 7.4)) as axes:
        for axis, reference in zip(axes, Reference, strict=True):
            response = time_response(study.loop, reference, sizes[reference], duration)
            time = response.time_s
            axis.plot(time, 1e3 * deg(1.0) * response.pos_err_load_rad, color=ORANGE, label="load")
            axis.plot(
                time, 1e3 * deg(1.0) * response.pos_err_motor_rad, color=BLUE, label="motor, as measured"
            )
            if study.kind is PlantKind.RIGID:
                _equation_5(axis, machine, response)
            axis.axhline(0.0, color=INK, linewidth=0.7)
            axis.set_title(titles[reference])
            axis.set(ylabel="error in mdeg", xlim=(0.0, duration))
        axes[0].legend(loc="upper right", ncols=3)
        axes[-1].set_xlabel("time in s")
    return path


def _equation_5(axis: Axes, machine: Machine, response: TimeResponse) -> None:
    """The continuous rigid loop of the paper under the same reference."""
    times = response.time_s[1::5].tolist()
    size = response.size
    if response.reference is Reference.STEP:
        values = size * (1.0 - rigid_loop(machine, kvf=0.0).step(times))
    elif response.reference is Reference.RAMP:
        values = rigid_loop(machine).ramp_error(size, times)
    else:
        values = rigid_loop(machine).parabola_error(size, times)
    axis.plot(times, 1e3 * deg(1.0) * values, color=GREY, linestyle="--", label="eq. (5)")


def damping_over_stiffness(machine: Machine, folder: Path) -> Path:
    """Damping of the load mode over the stiffness nobody knows, for three structural dampings; unstable below 0."""
    path = folder / "damping.png"
    stiffness = np.geomspace(1e8, 4e9, 140)
    shown = ((0.005, RED), (0.01, ORANGE), (0.025, BLUE))
    title = f"Damping that the loop leaves the load: {machine.name}, configured gains"
    with figure(path, title, 1, 2, figsize=(9.6, 4.2), sharey=True) as axes:
        models = (
            ("two masses, continuous (the sketch)", sketch_damping),
            ("full plant with base, as it runs", running_damping),
        )
        for axis, (name, model) in zip(axes, models, strict=True):
            for zeta, colour in shown:
                damping = model(machine, zeta)
                values = np.array([damping(float(k)) for k in stiffness])
                axis.semilogx(stiffness, 100.0 * values, color=colour, label=f"{100.0 * zeta:g} % structural")
                axis.fill_between(
                    stiffness,
                    100.0 * values,
                    0.0,
                    where=values < 0.0,
                    color=colour,
                    alpha=0.25,
                    linewidth=0.0,
                )
            axis.axhline(0.0, color=INK, linewidth=0.9)
            axis.axvspan(0.3e9, 1.2e9, color=GREY, alpha=0.13, linewidth=0.0)
            axis.text(0.6e9, 2.55, "uncertain\nstiffness", fontsize=8, ha="center", va="top", color=INK)
            axis.set_title(name)
            axis.set(xlabel="stiffness at the gantry in N m/rad", xlim=(1e8, 4e9), ylim=(-1.0, 2.6))
        axes[0].set_ylabel("damping of the load mode in %")
        axes[0].text(1.1e8, -0.93, "below 0: the swing grows", fontsize=8, color=INK)
        axes[1].legend(loc="upper right")
    return path


def measured_response(results: Sequence[Measured], folder: Path) -> Path:
    """The plant and the position loop, measured (dots) and of the linear model (lines), one column a condition."""
    path = folder / "measured.png"
    count = len(results)
    title = (
        "Frequency response measured on the running axis (dots) and the linear model (lines)\n"
        "hollow: noise, gear error or resolution; shaded: more than 3 dB or 20 deg apart"
    )
    options: dict[str, Any] = {"sharex": True, "sharey": "row", "squeeze": False}
    with figure(path, title, 3, count, figsize=(3.9 * count, 8.4), **options) as axes:
        for column, result in enumerate(results):
            _measured_column(axes[:, column], result)
        axes[0, 0].set_ylabel("plant: speed per torque\n|.| in dB (rad/s per N m)")
        axes[1, 0].set_ylabel("phase of the plant in deg")
        axes[2, 0].set_ylabel("position loop, cut at the\nspeed command: |L| in dB")
        for axis in axes[-1]:
            axis.set_xlabel("frequency in Hz")
    return path


def _measured_column(axes: Sequence[Axes], result: Measured) -> None:
    condition, dots = result.condition, result.measured
    fine = np.geomspace(dots.hz[0], dots.hz[-1], 800)
    model = result.model_at(fine)
    good = result.trusted > 0.0
    rows = (
        (_db(dots.plant), _db(model.plant)),
        (np.angle(dots.plant, deg=True), np.angle(model.plant, deg=True)),
        (_db(dots.position_open), _db(model.position_open)),
    )
    for axis, (points, line) in zip(axes, rows, strict=True):
        _shade(axis, result.off)
        axis.semilogx(fine, line, color=BLUE, linewidth=1.2)
        axis.semilogx(dots.hz[good], points[good], "o", color=ORANGE, markersize=3.2)
        axis.semilogx(dots.hz[~good], points[~good], "o", color=ORANGE, markersize=3.2, fillstyle="none")
    axes[1].set_yticks(np.arange(-180.0, 181.0, 90.0))
    axes[2].axhline(0.0, color=INK, linewidth=0.7)
    how = f"{condition.torque_nm:.3g} N m" + (
        f", {condition.vel_deg_s:g} deg/s" if condition.vel_deg_s else ""
    )
    axes[0].set_title(f"{condition.name}: {how}\nmodel: friction {condition.friction.value}")


def _db(values: ComplexArray) -> FloatArray:
    return np.asarray(20.0 * np.log10(np.abs(values)))


def _shade(axis: Axes, hz: FloatArray) -> None:
    for value in hz.tolist():
        axis.axvspan(value / 1.05, value * 1.05, color=GREEN, alpha=0.16, linewidth=0.0)
