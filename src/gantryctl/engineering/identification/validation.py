"""What a model of the lead leaves of a motion that was not in its fit, and whether that comes again.

Noise, gusts and drift do not come again at the same angle; what a model lacks does. So what is left of the slow turns
and of a further move each way are multiplied angle by angle: the mean product is the square of the part that repeats,
and its scatter over the sectors of the way says whether it is chance (Student's t).
"""

from __future__ import annotations

import math
from typing import Final, NamedTuple

import numpy as np

from gantryctl.engineering.identification.lead import Lead
from gantryctl.engineering.identification.samples import Floats, Samples
from gantryctl.engineering.identification.waves import waves_of
from gantryctl.units import Dial

# Model that removes less than two thirds of the lead: refused, it is not worth following.
_REFUSED_PART: Final = 1.0 / 3.0
# Less than this of the lead is told by the figures alone.
_WARNED_PART: Final = 0.1
# Correlation of strangers, in standard deviations: one in a thousand is above.
_CHANCE: Final = 3.1
_SECTORS: Final = 12
# Of what repeats, in one wave: it is named; else the sector with most of it is.
_ONE_WAVE: Final = 0.25
# Places per radian of the fastest wave that is left.
_PLACES_PER_RADIAN: Final = 2.0


class Validation(NamedTuple):
    """A move each way that was not in the fit, r.m.s. and without its mean.

    Attributes:
        lead_deg: of the lead that was measured. left_deg: of what the model leaves of it.
        repeats_deg: part of what is left that the slow turns show at the same angles too; 0 where it may be chance.
        cycles: waves per turn that has most of it, 0 where it is no single wave. at_deg: sector with most of it.
    """

    lead_deg: float
    left_deg: float
    repeats_deg: float
    cycles: float
    at_deg: tuple[float, float]

    @property
    def refused(self) -> bool:
        """The model leaves more than a third of the lead, and the same again each time."""
        return self.repeats_deg > _REFUSED_PART * self.lead_deg

    @property
    def warned(self) -> bool:
        """The model lacks something."""
        return self.repeats_deg > _WARNED_PART * self.lead_deg

    def words(self, dial: Dial) -> str:
        """What is left, for people, with angles as `dial` reads them."""
        low, high = self.at_deg
        # A sector of an axis with little travel is narrower than a degree.
        low_text, high_text = (dial.text(end, ".0f" if high - low >= 2.0 else ".2f") for end in (low, high))
        what = f"a wave of {self.cycles:.4g} per turn" if self.cycles else "no single wave"
        return (
            f"a move each way that was not in the fit: of a lead of {self.lead_deg:.5f} deg the model leaves "
            f"{self.left_deg:.5f} deg, of which {self.repeats_deg:.5f} deg come again at the same angle (rms): "
            f"{what}, most of it between {low_text} and {high_text} deg"
        )


def validated(
    lead: Lead,
    turns: Samples,
    check: Samples,
    mesh_nm: Floats,
    flank_nm: float,
    delay_s: float,
    most_waves: float,
) -> Validation:
    """Judge a model by a move each way that was not in its fit.

    Args:
        mesh_nm: torque in the mesh during the check, shape (check samples,). flank_nm: where the flank changes.
        delay_s: of the instrument, taken out of the reversal map. most_waves: per turn, that pass slowly enough.
    """
    measured = check.act_rad - check.load_rad
    waves = [*lead.waves, *lead.shaken]
    seen = waves_of(check.act_rad, [wave[0] for wave in waves]) @ np.array([x for w in waves for x in w[1:]])
    left = measured - lead.at(check, mesh_nm, flank_nm) - seen - delay_s * check.vel_rad_s
    products, places = [], []
    for sign in (1.0, -1.0):
        fit_side, check_side = turns.direction == sign, check.direction == sign
        if not fit_side.any() or not check_side.any():
            continue
        at = check.act_rad[check_side]
        count = max(2 * _SECTORS, math.ceil(_PLACES_PER_RADIAN * most_waves * float(np.ptp(at))))
        edges = np.linspace(at.min(), at.max(), count + 1)
        first, second = (
            _means(edges, angle, values)
            for angle, values in (
                (turns.act_rad[fit_side], lead.left_rad[fit_side]),
                (at, left[check_side] - left[check_side].mean()),
            )
        )
        both = np.isfinite(first) & np.isfinite(second)
        places.append((edges[:-1][both], first[both] - first[both].mean(), second[both]))
        products.append(places[-1][1] * places[-1][2])
    lead_deg = math.degrees(float(np.std(measured)))
    left_deg = math.degrees(float(np.std(left)))
    low, high = math.degrees(check.act_rad.min()), math.degrees(check.act_rad.max())
    if not products or _is_chance(places):
        return Validation(lead_deg, left_deg, 0.0, 0.0, (low, high))
    most = int(
        np.argmax(np.sum([[part.sum() for part in np.array_split(e, _SECTORS)] for e in products], axis=0))
    )
    width = (high - low) / _SECTORS
    repeats_deg = math.degrees(math.sqrt(float(np.concatenate(products).mean())))
    return Validation(
        lead_deg, left_deg, repeats_deg, _wave(places), (low + most * width, low + (most + 1) * width)
    )


def _means(edges: Floats, angle_rad: Floats, values: Floats) -> Floats:
    """Mean of the values between two edges; NaN where there are none."""
    place = np.digitize(angle_rad, edges) - 1
    inside = (place >= 0) & (place < len(edges) - 1)
    sums = np.bincount(place[inside], weights=values[inside], minlength=len(edges) - 1)
    counts = np.bincount(place[inside], minlength=len(edges) - 1)
    return np.asarray(np.where(counts > 0, sums / np.maximum(counts, 1), np.nan))


def _is_chance(places: list[tuple[Floats, Floats, Floats]]) -> bool:
    """Whether both series of all directions together are no more alike than strangers."""
    mean, variance, count = 0.0, 0.0, 0
    for _, first, second in places:
        mean += float(first @ second)
        variance += float(np.sum(_lagged(first) * _lagged(second))) / len(first)
        count += len(first)
    return count == 0 or mean <= _CHANCE * math.sqrt(max(variance, 0.0))


def _lagged(values: Floats) -> Floats:
    """Sums of products of a series with itself at every lag, both signs."""
    return np.asarray(np.fft.irfft(np.abs(np.fft.rfft(values, 2 * len(values))) ** 2))


def _wave(places: list[tuple[Floats, Floats, Floats]]) -> float:
    """Waves per turn of the largest common line of both, 0 where it is less than `_ONE_WAVE` of all."""
    at, first, second = places[0]
    step = float(at[1] - at[0])
    length = 4 * len(at)
    common = np.real(np.fft.rfft(first, length) * np.conj(np.fft.rfft(second, length)))
    cycles = 2.0 * math.pi / (length * step) * np.arange(len(common))
    top = int(np.argmax(common))
    # A line that ends with the way is four places wide here, and has two of them on either side of its top.
    near = common[max(0, top - 4) : top + 5].sum()
    return float(cycles[top]) if near > _ONE_WAVE * common.sum() > 0.0 else 0.0
