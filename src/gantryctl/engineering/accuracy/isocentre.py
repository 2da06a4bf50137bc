"""Where the isocentre goes as the axis turns: [plant.structure] under its own weight and on its tracks.

Room: x to the right, y along the axis, z up; the nozzle is at the top at 0 deg and goes to +x. u_t = (cos, 0, -sin)
and u_r = (sin, 0, cos) of the angle turn with it. Everything is linear and static, so there is nothing to integrate:

- Weight W pulls a part by W (sin u_t - cos u_r); it gives way by that over its stiffnesses along u_t and u_r, the tube
  and the nozzle on it one after the other.
- The nozzle tilts about where it is fixed by p x F / stiffness, p from there to its centre of mass, and carries the
  beam on a lever of nozzle_radius_m.
- Two rollers at +-roller_angle_deg below a ring put its centre where both touch: z = (a + b) / (2 cos), x = (a - b) /
  (2 sin), a and b the height of the track over them. Two rings carry the tube, the nozzle between them.

The star shot: the beams of all angles as lines in the plane across the axis, and the smallest circle that all of them
touch or cross (AAPM TG-142). Weight alone gives none: its lateral shift is that of one other centre.
"""

from __future__ import annotations

import itertools
import math
import random
from dataclasses import dataclass
from typing import Any, Final

import numpy as np
import numpy.typing as npt

from gantryctl.errors import UsageError
from gantryctl.machine import Machine, config_hash, is_reference_machine
from gantryctl.machine.tables.plant import StructureTable
from gantryctl.units import GRAVITY_M_S2, SIGNED, Dial, rad

FloatArray = npt.NDArray[np.float64]
# Waves of a track: one a turn is a shifted centre of the ring, found when it is mounted.
_FIRST_WAVE: Final = 2


@dataclass(frozen=True)
class Isocentre:
    """Way of the isocentre over angles. Arrays have one row an angle.

    Attributes:
        angles_deg: of the axis, shape (n,).
        shift_mm: x, y, z in the room, shape (n, 3), from the isocentre of a structure without weight on round tracks.
        tilt_mrad: of the nozzle about u_t, y and u_r, shape (n, 3).
        lateral_mm: shift of the beam across itself in the plane of rotation, shape (n,).
        star_centre_mm: x and z of the centre of the smallest circle that all beams touch or cross.
        star_radius_mm: its radius.
    """

    angles_deg: FloatArray
    shift_mm: FloatArray
    tilt_mrad: FloatArray
    lateral_mm: FloatArray
    star_centre_mm: tuple[float, float]
    star_radius_mm: float

    @property
    def span_mm(self) -> tuple[float, float, float]:
        """Range of the shift in x, y and z."""
        x, y, z = np.ptp(self.shift_mm, axis=0)
        return float(x), float(y), float(z)


def angles_of(machine: Machine, step_deg: float) -> FloatArray:
    """Angles of the travel, or of one turn of it, so far apart: where an axis never stands it has no isocentre.

    Raises:
        UsageError: they are fewer than three.
    """
    low, high = machine.axis.pos_min_deg, machine.axis.pos_max_deg
    begin = step_deg * math.ceil((low + 180.0) / step_deg - 1e-9) - 180.0
    count = math.floor((min(high, begin + 360.0 - step_deg) - begin) / step_deg + 1e-9) + 1
    if count < 3:
        raise UsageError(
            f"--step-deg {step_deg:g}: travel, {machine.axis.dial.span(low, high)} deg, has {count} such angles, and a "
            "star shot takes three: choose a smaller step"
        )
    return np.asarray(begin + step_deg * np.arange(count))


def isocentre(machine: Machine, angles_deg: FloatArray) -> Isocentre:
    """The isocentre at these angles, at least three of different direction.

    Raises:
        UsageError: the machine file says nothing of the structure; that of the reference gantry would be told.
    """
    # The defaults are those of the reference gantry, whatever its control and its drive.
    if "structure" not in machine.plant.model_fields_set and not is_reference_machine(machine):
        raise UsageError(
            f"[plant.structure]: is missing in the machine file of {machine.name}, and nobody knows where its "
            "isocentre goes: write weights, stiffnesses and tracks of this machine there"
        )
    s = machine.plant.structure
    angle = np.deg2rad(angles_deg)
    zero = np.zeros_like(angle)
    across = np.stack([np.cos(angle), zero, -np.sin(angle)], axis=1)
    outwards = np.stack([np.sin(angle), zero, np.cos(angle)], axis=1)
    along = np.array([0.0, 1.0, 0.0])

    tube, nozzle = (GRAVITY_M_S2 * mass for mass in (s.tube_mass_kg, s.nozzle_mass_kg))
    side = np.sin(angle) * (
        tube / s.tube_stiffness_tangential_n_per_m + nozzle / s.nozzle_stiffness_tangential_n_per_m
    )
    out = -np.cos(angle) * (
        tube / s.tube_stiffness_radial_n_per_m + nozzle / s.nozzle_stiffness_radial_n_per_m
    )
    # p = (0, overhang, -reach) in (u_t, y, u_r), F = nozzle (sin, 0, -cos): p x F.
    moment = nozzle * np.stack(
        [
            -s.nozzle_overhang_m * np.cos(angle),
            -s.nozzle_reach_m * np.sin(angle),
            -s.nozzle_overhang_m * np.sin(angle),
        ],
        axis=1,
    )
    tilt = moment / s.nozzle_tilt_stiffness_nm_per_rad
    # tilt x (0, 0, -radius): what the lever makes of it at the isocentre.
    side = side - s.nozzle_radius_m * tilt[:, 1]
    axial = s.nozzle_radius_m * tilt[:, 0]

    front, rear = (
        _on_rollers(s, waves, which, angle) for which, waves in enumerate((s.front_track_um, s.rear_track_um))
    )
    centre = (1.0 - s.nozzle_place) * front + s.nozzle_place * rear
    lean = (rear - front) / s.ring_distance_m
    turn = np.stack([lean[:, 1], zero, -lean[:, 0]], axis=1)
    shift = (
        np.stack([centre[:, 0], zero, centre[:, 1]], axis=1)
        + side[:, None] * across
        + axial[:, None] * along
        + out[:, None] * outwards
    )
    tilt = tilt + np.stack([np.sum(turn * across, axis=1), zero, np.sum(turn * outwards, axis=1)], axis=1)
    lateral = np.sum(shift * across, axis=1)
    star_centre, star_radius = smallest_star(angle, lateral)
    return Isocentre(
        np.asarray(angles_deg, dtype=float),
        1e3 * shift,
        1e3 * tilt,
        1e3 * lateral,
        (1e3 * star_centre[0], 1e3 * star_centre[1]),
        1e3 * star_radius,
    )


def _on_rollers(s: StructureTable, waves_um: tuple[float, ...], ring: int, angle: FloatArray) -> FloatArray:
    """Centre of a ring over angles, x and z in m: its track turns over two rollers that stay."""
    drawn = random.Random(f"{s.track_seed}, ring {ring}")  # noqa: S311 - tracks that can be repeated, no secret
    phases = [2.0 * math.pi * drawn.random() for _ in waves_um]
    beta = rad(s.roller_angle_deg)

    def height(roller: float) -> FloatArray:
        at = math.pi + roller - angle
        waves = (
            1e-6 * um * np.sin((n + _FIRST_WAVE) * at + phase)
            for n, (um, phase) in enumerate(zip(waves_um, phases, strict=True))
        )
        return np.asarray(sum(waves, np.zeros_like(angle)))

    a, b = height(beta), height(-beta)
    return np.stack([(a - b) / (2.0 * math.sin(beta)), (a + b) / (2.0 * math.cos(beta))], axis=1)


def smallest_star(angle: FloatArray, lateral: FloatArray) -> tuple[tuple[float, float], float]:
    """Centre (x, z) and radius of the smallest circle that all lines touch or cross.

    Args:
        angle: of the beams, rad, shape (n,); lateral: their offsets along u_t, any unit, shape (n,).

    The largest of |u_t c - lateral| is least where three lines have it with signs of their own (Chebyshev): every
    three lines and signs are tried.
    """
    normal = np.stack([np.cos(angle), -np.sin(angle)], axis=1)
    best = (math.inf, 0.0, 0.0)
    threes = np.array(list(itertools.combinations(range(len(angle)), 3)))
    for signs in ((1.0, 1.0, 1.0), (1.0, 1.0, -1.0), (1.0, -1.0, 1.0), (-1.0, 1.0, 1.0)):
        lines = np.concatenate(
            [normal[threes], np.broadcast_to(np.array(signs)[None, :, None], (*threes.shape, 1))], axis=2
        )
        solvable = np.abs(np.linalg.det(lines)) > 1e-9
        found = np.linalg.solve(lines[solvable], lateral[threes[solvable]][:, :, None])[:, :2, 0]
        if not len(found):
            continue
        worst = np.max(np.abs(found @ normal.T - lateral), axis=1)
        at = int(np.argmin(worst))
        best = min(best, (float(worst[at]), float(found[at, 0]), float(found[at, 1])))
    return (best[1], best[2]), best[0]


def isocentre_data(found: Isocentre, machine: Machine) -> dict[str, Any]:
    """For `--json`."""
    return {
        "machine": machine.name,
        "hash": config_hash(machine),
        "angles_deg": found.angles_deg.tolist(),
        "shift_mm": found.shift_mm.tolist(),
        "tilt_mrad": found.tilt_mrad.tolist(),
        "lateral_mm": found.lateral_mm.tolist(),
        "span_mm": list(found.span_mm),
        "star_centre_mm": list(found.star_centre_mm),
        "star_radius_mm": found.star_radius_mm,
    }


def isocentre_text(found: Isocentre, dial: Dial = SIGNED) -> str:
    """A table over angles and the star shot below it."""
    head = "   angle       x       y       z   about u_t       y     u_r   beam"
    lines = [
        "Isocentre over the angle: shift in mm, tilt in mrad, shift of the beam across itself in mm",
        head,
    ]
    for angle, shift, tilt, lateral in zip(
        found.angles_deg, found.shift_mm, found.tilt_mrad, found.lateral_mm, strict=True
    ):
        numbers = " ".join(f"{each:7.3f}" for each in shift)
        tilts = f"{tilt[0]:10.3f} {tilt[1]:7.3f} {tilt[2]:7.3f}"
        lines.append(f"{dial.text(angle, '.1f'):>8} {numbers}  {tilts} {lateral:6.3f}")
    x, y, z = found.span_mm
    lines += [
        f"Range of the shift: {x:.3f} x {y:.3f} x {z:.3f} mm",
        f"Star shot: circle of {found.star_radius_mm:.3f} mm radius "
        f"about x = {found.star_centre_mm[0]:.3f}, z = {found.star_centre_mm[1]:.3f} mm",
        "By the weight and the tracks of [plant.structure], estimates until somebody has measured them.",
    ]
    return "\n".join(lines)
