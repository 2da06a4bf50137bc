"""The whole draft: a requirement sheet and a motor to every value of a machine file, with its origin."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

from gantryctl.engineering.drafting.basis import Basis
from gantryctl.engineering.drafting.gains import DraftGains, first_gains, settled_gains
from gantryctl.engineering.drafting.loops import SoftLoop, loop_values, soft_loop
from gantryctl.engineering.drafting.motion import motion_values
from gantryctl.engineering.drafting.origin import Values, chosen, computed, guessed, guesses, significant
from gantryctl.engineering.drafting.plant import plant_values
from gantryctl.engineering.sizing.checks import Fit
from gantryctl.errors import ConfigError
from gantryctl.machine import Machine, field_specs
from gantryctl.machine.loading import check
from gantryctl.machine.reading import Data
from gantryctl.machine.tables.control import AccuracyTable
from gantryctl.units import rad

# A of the noise alone over standard deviation and radius: median of 500 draws, 0.0119 deg at 0.5 m with 10 um.
_NOISE_A: Final = 10.4
_NOISE_PART: Final = 0.25
# Tables whose defaults are decisions of this product or facts about any drive and bus, not about a machine.
_PRODUCT: Final = (
    "control.kvf", "control.compensation.", "brake.owner", "brake.hold", "brake.test_interval", "brake.emergency",
    "drive.kind", "drive.speed_loop.delay_cycles", "drive.speed_loop.feedback",
    "drive.current_loop.", "monitors.", "accuracy.", "axis.display", "axis.no_go_deg", "plant.brake.torque_share",
    "plant.tooth_pitch.", "plant.thermal.", "plant.ageing.", "plant.cable.", "plant.second_pinion.",
    "plant.motor.cogging",
    "plant.motor.torque_constant_ratio", "plant.structure.", "plant.encoder.interpolation",
    "plant.encoder.eccentricity", "plant.load_encoder.", "plant.uncertainty.", "plant.switches.", "plant.integration.",
)  # fmt: skip
# Where another kind of drive is described: a machine of a draft is simulated.
BUS: Final = "can."


@dataclass(frozen=True)
class Draft:
    """A machine file before it is written.

    Attributes:
        values: every key outside of [can], by dotted path in the order of the file.
        soft_loop: what this motor cannot do for the axis by its loop; None where it can.
    """

    name: str
    fit: Fit
    values: Values
    soft_loop: SoftLoop | None

    @property
    def guesses(self) -> tuple[str, ...]:
        """Dotted paths of what nobody has measured or decided."""
        return guesses(self.values)

    def machine(self) -> Machine:
        """The machine, checked like a file.

        Raises:
            ConfigError: one line per problem: the sheet asks for what the motor or the rules of a machine cannot give.
        """
        data: Data = {}
        for path, drafted in self.values.items():
            *tables, key = path.split(".")
            table = data
            for part in tables:
                table = table.setdefault(part, {})
            table[key] = list(drafted.value) if isinstance(drafted.value, tuple) else drafted.value
        return check(data, f"draft of {self.name}")


def draft(fit: Fit, name: str) -> Draft:
    """Draft a machine from a sheet and a motor that fits it; the same input, the same draft.

    Args:
        fit: sheet and motor. name: of the machine.

    Raises:
        ConfigError: the motor does not fit.
    """
    if not fit.fits:
        sheet = fit.train.sheet.sheet.name
        raise ConfigError([f"{fit.motor.name} does not fit {sheet}: {why}" for why in fit.reasons])
    basis = Basis(fit)
    first = first_gains(basis)
    sketch = _assembled(basis, name, first)
    return _assembled(basis, name, settled_gains(sketch.machine(), basis, first))


def _assembled(basis: Basis, name: str, gains: DraftGains) -> Draft:
    ruled = {
        **_identity(basis, name),
        **_required(basis),
        **motion_values(basis),
        **loop_values(basis, gains),
        **_parts(basis),
        **_accuracy(basis),
        **plant_values(basis),
    }
    specs = field_specs()
    # Whatever has no rule is a decision of the product, and is named as one: no key comes along unseen.
    product = {
        path: chosen(spec.usual)
        for path, spec in specs.items()
        if path not in ruled and path.startswith(_PRODUCT) and spec.usual is not None
    }
    values = {path: (ruled | product)[path] for path in specs if path in ruled or path in product}
    values |= {"machine.guesses": chosen(guesses(values))}
    return Draft(name, basis.fit, values, soft_loop(basis, gains))


def _identity(basis: Basis, name: str) -> Values:
    sheet = basis.sheet.sheet
    return {
        "machine.name": chosen(name),
        "machine.description": chosen(sheet.description),
        "machine.guesses": chosen(()),
    }


def _required(basis: Basis) -> Values:
    required = basis.required
    return {
        **{f"required.{key}": basis.of_sheet(f"required.{key}") for key, _ in required},
        "required.source": chosen(required.source or f"requirement sheet {basis.sheet.sheet.name}"),
    }


def _parts(basis: Basis) -> Values:
    """Motor, encoder and brake of the catalogue, reducer of the sheet."""
    motor = basis.motor
    rated, brake = motor.motor.torque_rated_nm, motor.brake.torque_nm
    return {
        **{f"motor.{key}": basis.catalogue(value) for key, value in motor.motor},
        "motor.torque_max_nm": computed(
            significant(basis.torque_max_nm, 6), f"{motor.name}, or what the reducer bears for a moment"
        ),
        "reducer.torque_rated_nm": basis.of_sheet("gears.torque_rated_nm"),
        "reducer.torque_momentary_nm": basis.of_sheet("gears.torque_momentary_nm"),
        **{f"encoder.{key}": basis.catalogue(value) for key, value in motor.encoder},
        "encoder.wrap_margin_min_deg": basis.of_sheet("range.wrap_margin_min_deg"),
        **{f"brake.{key}": basis.catalogue(value) for key, value in motor.brake},
        "brake.proof_torque_nm": computed(
            significant(min(0.1 * rated, 0.5 * brake), 3), "a tenth of rated torque"
        ),
        "brake.test_torque_nm": computed(
            basis.test_torque_nm,
            "1.5 x the moment of the check, or a fifth of the brake",
        ),
    }


def _accuracy(basis: Basis) -> Values:
    mode = basis.sheet.structure.first_mode_hz
    # Twelve swings, of which the last four are averaged.
    dwell = min(60.0, max(2.0, 12.0 / mode))
    noise_m = 1e-6 * AccuracyTable().tracker_noise_um
    beyond_noise_m = _NOISE_A * noise_m / (_NOISE_PART * rad(basis.sheet.required.angle_deg))
    return {
        "accuracy.chord_radius_m": guessed(
            significant(min(20.0, max(0.5, basis.sheet.teeth.ring_radius_m, beyond_noise_m)), 3),
            "the target at the ring, 0.5 m at least, and so far out that noise alone has a quarter of the required A",
        ),
        "accuracy.dwell_s": computed(significant(dwell, 3), "12 swings of the first mode, 2 s at least"),
        "accuracy.average_s": computed(significant(dwell / 3.0, 3), "a third of the rest"),
    }
