"""Study of one loop on one plant: margins at each cut, closed loops, poles, modes."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from gantryctl.engineering.analysis.models.linear import ComplexArray, FloatArray
from gantryctl.engineering.analysis.models.load_side import (
    LoadSideFigures,
    WholeLoop,
    load_side_figures,
    load_side_law,
)
from gantryctl.engineering.analysis.models.margins import (
    Peak,
    PhaseFigures,
    Response,
    bandwidth_rad_s,
    frequency_grid,
    gain_limits,
    last_bandwidth_rad_s,
    peak,
    sensitivity_peak,
    smallest_phase_margin,
)
from gantryctl.engineering.analysis.models.mechanics import (
    LOAD,
    MOTOR,
    Friction,
    Mechanics,
    PlantKind,
    mechanics,
)
from gantryctl.engineering.analysis.models.modes import SwingMode, modes
from gantryctl.engineering.analysis.models.sampled import Cut, LoopSettings, SampledLoop, loop_settings
from gantryctl.machine import Machine

LOWEST_RAD_S = 0.01


class CutFigures(NamedTuple):
    """Margins at one cut.

    Attributes:
        phase: the gain crossover nearest to instability; None when the gain never passes 1.
        gain_down, gain_up: factors on the gain at which the closed loop loses stability, exact; None: none
        within 1e3.
        sensitivity: largest |1/(1 + L)|.
    """

    cut: Cut
    phase: PhaseFigures | None
    gain_down: float | None
    gain_up: float | None
    sensitivity: Peak


class ClosedFigures(NamedTuple):
    """One closed loop.

    Attributes:
        bandwidth_rad_s: where it first falls 3 dB below its value at rest; a lightly damped mode may do that
        by a notch.
        last_rad_s: where it falls below for good. peak: its largest magnitude.
    """

    name: str
    bandwidth_rad_s: float | None
    last_rad_s: float | None
    peak: Peak


@dataclass(frozen=True)
class Study:
    """The result; `loop` answers everything else.

    Attributes:
        load_side: of the whole loop, where compensations feed the load back; all else is of the motor's loop alone.
    """

    machine: Machine
    kind: PlantKind
    friction: Friction
    loop: SampledLoop
    stable: bool
    cuts: tuple[CutFigures, ...]
    closed: tuple[ClosedFigures, ...]
    modes: tuple[SwingMode, ...]
    load_side: LoadSideFigures | None

    @property
    def plant(self) -> Mechanics:
        """The linear plant."""
        return self.loop.plant

    @property
    def settings(self) -> LoopSettings:
        """Gains and timing."""
        return self.loop.settings

    def at(self, cut: Cut) -> CutFigures:
        """The margins at one cut."""
        return next(figures for figures in self.cuts if figures.cut is cut)

    def closed_loop(self, name: str) -> ClosedFigures:
        """One closed loop by its name."""
        return next(figures for figures in self.closed if figures.name == name)

    @property
    def shown_poles(self) -> ComplexArray:
        """Closed-loop poles below the scan's Nyquist frequency, one of each pair, by rising frequency."""
        poles = self.loop.poles
        shown = poles[(np.abs(poles) < math.pi / self.settings.scan_s) & (poles.imag >= 0.0)]
        return np.asarray(shown[np.argsort(np.abs(shown))])


FOLLOWING = "set-point to motor"
FOLLOWING_WITHOUT = "set-point to motor, Kvf = 0"
SWINGING = "set-point to load"
SPEED_LOOP = "speed command to motor speed"


def study(machine: Machine, kind: PlantKind, friction: Friction = Friction.NONE) -> Study:
    """Analyse the loop of a machine file on one of its linear plants."""
    loop = SampledLoop(mechanics(machine, kind, friction), loop_settings(machine))
    return Study(
        machine=machine,
        kind=kind,
        friction=friction,
        loop=loop,
        stable=loop.stable(),
        cuts=tuple(cut_figures(loop, cut) for cut in Cut),
        closed=_closed_figures(loop),
        modes=tuple(modes(loop)),
        load_side=_load_side(machine, loop),
    )


def _load_side(machine: Machine, loop: SampledLoop) -> LoadSideFigures | None:
    law = load_side_law(machine)
    return None if law is None else load_side_figures(WholeLoop(loop, law), grid_of(loop, Cut.TORQUE))


def grid_of(loop: SampledLoop, cut: Cut | None = None) -> FloatArray:
    """Frequencies up to the Nyquist frequency of a cut (None: of the scan), dense around every mode."""
    s = loop.settings
    # The scan's Nyquist frequency bounds what is held over a scan, the drive cycle's what is not.
    period = s.scan_s if cut in (None, Cut.SPEED_COMMAND) else s.cycle_s
    return frequency_grid(LOWEST_RAD_S, 0.999 * math.pi / period, swinging_poles(loop))


def swinging_poles(loop: SampledLoop) -> ComplexArray:
    """All poles near which a response of this loop may have a narrow peak or notch."""
    return np.concatenate([loop.poles, loop.inner_poles, loop.plant.held_poles(), loop.plant.free_poles()])


def cut_figures(loop: SampledLoop, cut: Cut) -> CutFigures:
    """Margins at one cut."""
    grid = grid_of(loop, cut)

    def response(w: FloatArray) -> ComplexArray:
        return loop.open_loop(cut, w)

    def stable(factor: float) -> bool:
        match cut:
            case Cut.SPEED_COMMAND:
                return loop.stable(command_gain=factor)
            case Cut.SPEED_ERROR:
                # The drive's loop alone: the position loop is open.
                return loop.stable(torque_gain=factor, command_gain=0.0)
            case Cut.TORQUE:
                return loop.stable(torque_gain=factor)

    down, up = gain_limits(stable)
    return CutFigures(cut, smallest_phase_margin(response, grid), down, up, sensitivity_peak(response, grid))


def _closed_figures(loop: SampledLoop) -> tuple[ClosedFigures, ...]:
    grid = grid_of(loop)
    transfers: dict[str, Response] = {
        FOLLOWING: lambda w: loop.following(w)[MOTOR],
        FOLLOWING_WITHOUT: lambda w: loop.following(w, kvf=0.0)[MOTOR],
        SWINGING: lambda w: loop.following(w)[LOAD],
        SPEED_LOOP: loop.speed_loop,
    }
    return tuple(_closed(name, transfer, grid) for name, transfer in transfers.items())


def _closed(name: str, transfer: Response, grid: FloatArray) -> ClosedFigures:
    first, last = bandwidth_rad_s(transfer, grid), last_bandwidth_rad_s(transfer, grid)
    return ClosedFigures(name, first, last, peak(lambda w: np.abs(transfer(w)), grid))
