"""Torque ripple: order, amplitude, and how it shrinks with the torque."""

from __future__ import annotations

import math

import numpy as np
import pytest

from gantryctl.wiring.simulator import plant_params
from physics.plants import at_instant, bare, machine


def ripple(torque: float, order: int = 12) -> np.ndarray:
    """Ripple torque over one motor turn, 64 places, from the acceleration of a rigid body."""
    p = bare("rigid", "torque_ripple", ripple_order=order)
    inertia = p.inertia_motor_kg_m2 + p.inertia_load_kg_m2 / p.ratio**2
    places = 2 * math.pi * np.arange(64) / 64
    acc = [at_instant(p, torque, pos_motor=a, vel_motor=0.0)[1]["vel_motor"] for a in places]
    return np.array(acc) * inertia - torque


def test_constants() -> None:
    p = plant_params(machine())
    assert (p.ripple_torque_nm, p.ripple_order, p.ripple_full_torque_nm) == (1.9, 12, 20.0)


@pytest.mark.parametrize(
    ("torque", "amplitude"), [(40.0, 1.9), (20.0, 1.9), (10.0, 0.95), (-5.0, 0.475), (0.0, 0.0)]
)
def test_the_ripple_is_a_sine_of_its_order_and_grows_up_to_20_nm(torque: float, amplitude: float) -> None:
    wave = ripple(torque)
    assert np.allclose(wave, amplitude * np.sin(12 * 2 * math.pi * np.arange(64) / 64), atol=1e-12)


@pytest.mark.parametrize("order", [1, 6, 24])
def test_the_order_is_that_of_the_machine_file(order: int) -> None:
    spectrum = np.abs(np.fft.rfft(ripple(40.0, order))) / 32
    assert spectrum[order] == pytest.approx(1.9, rel=1e-12)
    assert np.max(np.delete(spectrum, order)) < 1e-12
