"""From answers to a requirement sheet: every key of the sheet with its origin."""

from __future__ import annotations

import math
from collections.abc import Collection
from dataclasses import dataclass
from functools import cached_property
from typing import Final

from gantryctl.engineering.drafting.origin import (
    Drafted,
    Origin,
    Values,
    chosen,
    computed,
    guessed,
    guesses,
    significant,
)
from gantryctl.engineering.drafting.questions import BY_RULE, Answers
from gantryctl.engineering.drafting.templates import Template
from gantryctl.engineering.sizing.loading import contradictions
from gantryctl.engineering.sizing.sheet import Margins, Sheet
from gantryctl.errors import ConfigError
from gantryctl.machine.loading import check_table
from gantryctl.machine.reading import Data
from gantryctl.machine.rules.reaction import REACTION_S
from gantryctl.machine.specs import field_specs
from gantryctl.machine.tables.plant import WindTable
from gantryctl.units import DEG_S_PER_R_MIN, GRAVITY_M_S2, deg, rad

# Turns that the encoders of the delivered motors tell apart, of which the travel may take nine tenths.
_ENCODER_TURNS: Final = 0.9 * 4096
_WRAP_MARGIN_DEG: Final = 5.0
# The sizing case accelerates so many times harder than a normal move.
_SIZING: Final = 2.0
# Reserve of the reducer over the sizing case, and its momentary over its rated torque (strain-wave reducers of large
# sizes: 3.5 to 5; Harmonic Drive, CSG series). A step of the deceleration swings the load twice as far.
_RATED, _MOMENTARY, _STOP, _SWING = 1.5, 4.0, 1.25, 2.0
# The moment that stops and brake are proved with, over that of the centre of mass.
_CHECK: Final = 1.25
# At the motor shaft: of the load's inertia there, and of the torque of the sizing case; at the highest speed viscous
# friction adds these parts to the friction of bearing and motor.
_INPUT_INERTIA, _MOTOR_FRICTION, _VISCOUS_LOAD, _VISCOUS_MOTOR = 0.08, 0.025, 0.35, 0.65
_LOAD_LOSS: Final = 0.1
NO_SOURCE: Final = "usual figure, no source: replace it by yours"
"""Of a requirement of a template: it stands in the sheet, beside every verdict and in every report."""
_HOLD_S: Final = 30.0
_HOURS: Final = 8.0


@dataclass(frozen=True)
class Answered:
    """A template with the answers of a person.

    Attributes:
        given: keys that a person has answered; the others are the template's, and guesses.
    """

    template: Template
    answers: Answers
    given: frozenset[str]

    @classmethod
    def of(cls, template: Template, answers: dict[str, object]) -> Answered:
        """The template's answers, with those that are given in their place.

        Raises:
            ConfigError: an answer contradicts another.
        """
        merged = template.answers.model_copy(update=answers)
        wrong = list(_contradictions(merged))
        if wrong:
            raise ConfigError(wrong)
        return cls(template, merged, frozenset(answers))

    @property
    def speed_rad_s(self) -> float:
        """Highest speed."""
        return rad(self.answers.speed_max_r_min * DEG_S_PER_R_MIN)

    @property
    def acc_rad_s2(self) -> float:
        """Acceleration of normal moves."""
        return self.speed_rad_s / self.answers.acc_time_s

    @cached_property
    def gyration_m(self) -> float:
        """Radius of gyration; alike bodies of one density have an inertia that goes with its fifth power."""
        usual = self.template.answers.inertia_kg_m2
        return self.template.proportions.radius_of_gyration_m * math.pow(
            self.answers.inertia_kg_m2 / usual, 0.2
        )

    @property
    def mass_kg(self) -> float:
        """Mass of the load: inertia over the square of the radius of gyration."""
        return self.answers.inertia_kg_m2 / self.gyration_m**2

    @property
    def ring_radius_m(self) -> float:
        """Radius of the ring."""
        return self.template.proportions.ring_radius_ratio * self.gyration_m

    @property
    def friction_nm(self) -> float:
        """Friction of the bearing: as answered, or weight x coefficient x radius of the ring."""
        if self.answers.friction_nm != BY_RULE:
            return self.answers.friction_nm
        weight = self.mass_kg * GRAVITY_M_S2
        return significant(self.template.proportions.friction_coefficient * weight * self.ring_radius_m, 3)

    @property
    def check_moment_nm(self) -> float:
        """Moment that stops, motor and brake are proved with: 1.25 x unbalance, and the wind."""
        return _CHECK * self.answers.unbalance_nm + self.answers.wind_nm

    @cached_property
    def gear_ratio(self) -> float:
        """As answered, or the largest that the motor's speed and the turns of the encoder allow."""
        if self.answers.gear_ratio != BY_RULE:
            return self.answers.gear_ratio
        modulo = self.answers.kind == "modulo"
        travel = 0.0 if modulo else self.answers.pos_max_deg - self.answers.pos_min_deg
        by_encoder = _ENCODER_TURNS * 360.0 / (travel + 2.0 * _WRAP_MARGIN_DEG)
        by_speed = self.template.proportions.motor_speed_r_min / self.answers.speed_max_r_min
        ring = self.template.proportions.ring_ratio
        return ring * max(1.0, math.floor(min(by_encoder, by_speed) / ring))

    @property
    def steady_nm(self) -> float:
        """Moment at the axis while it turns at the highest speed, without acceleration."""
        return self.check_moment_nm + (1.0 + _VISCOUS_LOAD) * self.friction_nm

    @property
    def quick_dec_rad_s2(self) -> float:
        """Least deceleration of a quick stop, the reaction counted."""
        v = self.speed_rad_s
        return v**2 / (2.0 * (rad(self.answers.stopping_angle_deg) - v * REACTION_S))


def _contradictions(answers: Answers) -> list[str]:
    wrong = []
    if answers.pos_max_deg - answers.pos_min_deg < 1.0:
        wrong.append(
            f"pos_min_deg = {answers.pos_min_deg:g} deg: must lie at least 1 deg below pos_max_deg = "
            f"{answers.pos_max_deg:g} deg"
        )
    if answers.kind == "modulo" and abs(answers.pos_max_deg - answers.pos_min_deg - 360.0) > 1e-9:
        wrong.append(
            f"kind = modulo: {answers.pos_min_deg:g} to {answers.pos_max_deg:g} deg must be one turn: "
            "0 to 360, or -180 to 180"
        )
    reaction = answers.speed_max_r_min * DEG_S_PER_R_MIN * REACTION_S
    if answers.stopping_angle_deg <= 1.2 * reaction:
        wrong.append(
            f"stopping_angle_deg = {answers.stopping_angle_deg:g} deg: must be above {1.2 * reaction:.3g} deg: the "
            f"axis travels {reaction:.3g} deg at {answers.speed_max_r_min:g} r/min in the {1e3 * REACTION_S:g} ms "
            "before a stop begins"
        )
    return wrong


def sheet_values(answered: Answered, name: str) -> Values:
    """Every key of the sheet by dotted path, in the order of the file."""
    found = {
        "sheet.name": chosen(name),
        "sheet.description": chosen(
            f"{answered.template.template.description}; from a template, see guesses"
        ),
        "sheet.guesses": chosen(()),
        **_required(answered),
        **_range_and_motion(answered),
        **_load(answered),
        **_gears(answered),
        **_structure(answered),
        **_wind(answered),
        **_duty(answered),
        **_margins(answered),
    }
    ordered = {path: found[path] for path in field_specs(Sheet)}
    return ordered | {"sheet.guesses": chosen(guesses(ordered))}


def drafted_sheet(values: Values, name: str) -> Sheet:
    """The sheet itself, checked like a file.

    Raises:
        ConfigError: one line per problem; what no motor can meet is a problem too.
    """
    data: Data = {}
    for path, drafted in values.items():
        table, _, key = path.partition(".")
        value = list(drafted.value) if isinstance(drafted.value, tuple) else drafted.value
        data.setdefault(table, {})[key] = value
    sheet = check_table(Sheet, data, name)
    lines = contradictions(sheet)
    if lines:
        raise ConfigError([f"{name}: {line}" for line in lines])
    return sheet


def _answer(answered: Answered, key: str, others: Collection[str] = ()) -> Drafted:
    """An answer under its own name: of the sheet when a person gave it, else a guess of the template."""
    value = getattr(answered.answers, key)
    if key in answered.given:
        return Drafted(value, Origin.SHEET, "answered")
    return guessed(value, f"usual for a {answered.template.template.name}")


def _from(answered: Answered, value: float, rule: str, *keys: str) -> Drafted:
    """A figure of a person's answers; a guess as long as one of them is the template's."""
    known = all(key in answered.given for key in keys)
    return computed(significant(value), rule) if known else guessed(significant(value), rule)


def _required(answered: Answered) -> Values:
    source, basis = answered.answers.source, answered.template.template.angle_source
    angle, stopping = (_answer(answered, key) for key in ("angle_deg", "stopping_angle_deg"))
    if angle.origin is Origin.GUESS:
        angle = guessed(angle.value, f"{angle.rule}: {basis or NO_SOURCE}")
    if stopping.origin is Origin.GUESS:
        stopping = guessed(stopping.value, f"{stopping.rule}: {NO_SOURCE}")
    return {
        "required.angle_deg": angle,
        "required.speed_error_ratio": guessed(0.01, f"1 % of the highest speed: {NO_SOURCE}"),
        "required.stopping_angle_deg": stopping,
        "required.source": Drafted(source, Origin.SHEET)
        if source
        else guessed(_unstated(answered), "stands beside every verdict; nobody named it"),
    }


def _unstated(answered: Answered) -> str:
    """What stands beside a verdict where nobody said who requires it."""
    if "angle_deg" in answered.given:
        return "not stated yet"
    basis = answered.template.template.angle_source
    return f"angle: {basis}; speed and stop: {NO_SOURCE}" if basis else NO_SOURCE


def _range_and_motion(answered: Answered) -> Values:
    speed, acc = answered.answers.speed_max_r_min, answered.acc_rad_s2
    return {
        "range.kind": _answer(answered, "kind"),
        "range.pos_min_deg": _answer(answered, "pos_min_deg"),
        "range.pos_max_deg": _answer(answered, "pos_max_deg"),
        "range.wrap_margin_min_deg": chosen(_WRAP_MARGIN_DEG),
        "motion.speed_min_r_min": chosen(significant(0.1 * speed), "a tenth of the highest speed"),
        "motion.speed_max_r_min": _answer(answered, "speed_max_r_min"),
        "motion.sizing_time_s": chosen(
            significant(answered.answers.acc_time_s / _SIZING), "twice the acceleration of a normal move"
        ),
        "motion.acc_deg_s2": _from(
            answered, deg(acc), "highest speed / acc_time_s", "speed_max_r_min", "acc_time_s"
        ),
    }


def _load(answered: Answered) -> Values:
    answers, friction = answered.answers, answered.friction_nm
    weight = answered.mass_kg * GRAVITY_M_S2
    moments = "1.25 x unbalance + wind"
    own = answers.friction_nm != BY_RULE
    return {
        "load.inertia_kg_m2": _answer(answered, "inertia_kg_m2"),
        "load.mass_kg": guessed(significant(answered.mass_kg), f"inertia / ({answered.gyration_m:.3g} m)^2"),
        "load.eccentricity_m": _from(
            answered, answers.unbalance_nm / weight, "unbalance / weight", "unbalance_nm", "inertia_kg_m2"
        ),
        "load.eccentric_angle_deg": guessed(0.0, "where the load hangs at rest"),
        "load.eccentric_check_moment_nm": _from(
            answered, answered.check_moment_nm, moments, "unbalance_nm", "wind_nm"
        ),
        "load.friction_coulomb_nm": Drafted(friction, Origin.SHEET, "answered")
        if own
        else guessed(
            friction, f"{answered.template.proportions.friction_coefficient:g} x weight x ring radius"
        ),
        "load.friction_viscous_nm_s_per_rad": guessed(
            significant(_VISCOUS_LOAD * friction / answered.speed_rad_s, 3),
            "0.35 x friction at the highest speed",
        ),
    }


def _gears(answered: Answered) -> Values:
    inertia, ratio = answered.answers.inertia_kg_m2, answered.gear_ratio
    ring = answered.template.proportions.ring_ratio
    sizing = _SIZING * answered.acc_rad_s2
    rated = _RATED * (inertia * sizing + answered.steady_nm) / ring
    stop = _STOP * (_SWING * inertia * answered.quick_dec_rad_s2 + answered.check_moment_nm) / ring
    friction = _MOTOR_FRICTION * (inertia * sizing + answered.steady_nm) / ratio
    how = "answered" if answered.answers.gear_ratio != BY_RULE else "what motor speed and encoder allow"
    return {
        "gears.reducer_ratio": _from(answered, ratio / ring, how, "gear_ratio"),
        "gears.ring_ratio": guessed(ring, f"usual for a {answered.template.template.name}"),
        "gears.input_inertia_kg_m2": guessed(
            significant(_INPUT_INERTIA * inertia / ratio**2, 3), "0.08 x inertia at the motor shaft"
        ),
        "gears.load_loss_ratio": guessed(_LOAD_LOSS, "usual reducer"),
        "gears.friction_coulomb_nm": guessed(
            significant(friction, 3), "2.5 % of the torque of the sizing case"
        ),
        "gears.friction_viscous_nm_s_per_rad": guessed(
            significant(_VISCOUS_MOTOR * friction / (answered.speed_rad_s * ratio), 3),
            "0.65 x that at full speed",
        ),
        "gears.torque_rated_nm": guessed(
            significant(rated), "1.5 x sizing case; choose one from a catalogue"
        ),
        "gears.torque_momentary_nm": guessed(
            significant(max(_MOMENTARY * rated, stop)), "4 x that, or what a quick stop swings up to"
        ),
    }


def _structure(answered: Answered) -> Values:
    proportions = answered.template.proportions
    usual = f"usual for a {answered.template.template.name}"
    ratios = ("damping_ratio", "base_frequency_ratio", "base_inertia_ratio")
    return {
        "structure.first_mode_hz": _answer(answered, "first_mode_hz"),
        **{f"structure.{key}": guessed(getattr(proportions, key), usual) for key in ratios},
        "teeth.pinion_teeth": guessed(proportions.pinion_teeth, usual),
        "teeth.ring_radius_m": guessed(
            significant(answered.ring_radius_m, 3), f"{proportions.ring_radius_ratio:g} x radius of gyration"
        ),
        "teeth.grade": guessed(proportions.grade, usual),
        "teeth.backlash_ratio": guessed(proportions.backlash_ratio, usual),
    }


def _wind(answered: Answered) -> Values:
    usual = WindTable()
    if answered.answers.wind_nm == 0.0:
        return {f"wind.{key}": chosen(value) for key, value in usual}
    mean = answered.answers.wind_nm / (1.0 + 7.0 * usual.turbulence)
    return {
        "wind.moment_nm": _from(answered, mean, "largest moment / (1 + 7 x turbulence)", "wind_nm"),
        "wind.turbulence": guessed(usual.turbulence, "open country"),
        "wind.speed_m_s": guessed(usual.speed_m_s, "in work"),
        "wind.length_m": guessed(usual.length_m, "10 m above open country"),
        "wind.width_m": guessed(significant(4.0 * answered.gyration_m, 2), "4 x radius of gyration"),
        "wind.seed": chosen(usual.seed),
    }


def _duty(answered: Answered) -> Values:
    low, high = answered.answers.pos_min_deg, answered.answers.pos_max_deg
    stops = tuple(round(low + part * (high - low), 1) for part in (0.75, 0.95, 0.25, 0.5))
    way = sum(abs(b - a) for a, b in zip((stops[-1], *stops[:-1]), stops, strict=True))
    time = way / deg(answered.speed_rad_s) + len(stops) * (_HOLD_S + answered.answers.acc_time_s)
    # Half of the hours in motion and at the stops.
    cycles = max(1, min(1000, math.floor(0.5 * 3600.0 * _HOURS / time)))
    return {
        "duty.cycles": guessed(cycles, "half of the day"),
        "duty.hours": guessed(_HOURS, "one shift"),
        "duty.stops_deg": guessed(stops, "3/4, 19/20, 1/4 and 1/2 of travel"),
        "duty.hold_s": guessed(_HOLD_S, "at every stop"),
    }


def _margins(answered: Answered) -> Values:
    proportions = answered.template.proportions
    usual: dict[str, float] = dict(Margins())
    own = usual | {"resolution": proportions.resolution, "inertia_ratio_max": proportions.inertia_ratio_max}
    return {f"margins.{key}": chosen(value) for key, value in own.items()}
