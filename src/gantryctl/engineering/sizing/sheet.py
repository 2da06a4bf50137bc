"""The requirement sheet: what an axis must do, before there is a motor. One TOML file, as strict as a machine file."""

from __future__ import annotations

from typing import Annotated

from pydantic import Field

from gantryctl.machine.tables.axis import (
    AXIS_KIND,
    POS_MAX_DEG,
    POS_MIN_DEG,
    REDUCER_RATIO,
    RING_RATIO,
    AxisKind,
    FileIdentity,
)
from gantryctl.machine.tables.fields import Table, number, numbers, required_number, table
from gantryctl.machine.tables.plant import WindTable
from gantryctl.machine.tables.required import RequiredTable


class Range(Table):
    """[range]: travel, deg at the gantry; of a modulo axis, its turn."""

    kind: AxisKind = AXIS_KIND
    pos_min_deg: float = POS_MIN_DEG
    pos_max_deg: float = POS_MAX_DEG
    wrap_margin_min_deg: float = number(
        5.0, 0.1, 180.0, "Least distance between travel and the wrap of the encoder."
    )

    @property
    def told_apart_deg(self) -> float:
        """Angles that the encoder must tell apart: travel and the margin on both sides.

        That of a modulo axis may wrap anywhere; it tells the margin both ways, for motions while the axis is off.
        """
        travel = 0.0 if self.kind == "modulo" else self.pos_max_deg - self.pos_min_deg
        return travel + 2.0 * self.wrap_margin_min_deg


class Motion(Table):
    """[motion]: speeds and accelerations of the gantry."""

    speed_min_r_min: float = required_number(0.1, 1e-6, 200.0, "Lowest speed setting.")
    speed_max_r_min: float = required_number(1.0, 1e-5, 600.0, "Highest speed setting.")
    # The paper sizes with 1 s and drives with 15.25 s.
    sizing_time_s: float = required_number(
        1.0, 1e-3, 3600.0, "From standstill to the highest speed: the acceleration that sizes the motor."
    )
    acc_deg_s2: float = required_number(0.39335664335664333, 1e-5, 1e5, "Acceleration of normal moves.")


class LoadSheet(Table):
    """[load]: everything that turns with the gantry, and the rollers under it."""

    inertia_kg_m2: float = required_number(2.18e6, 0.01, 1e8, "Inertia about the axis.")
    mass_kg: float = required_number(2.0e5, 0.1, 1e7, "Turning mass.")
    eccentricity_m: float = required_number(0.00815, 0.0, 10.0, "Centre of mass off the axis.")
    eccentric_angle_deg: float = number(0.0, -180.0, 180.0, "Angle at which the eccentric moment is zero.")
    eccentric_check_moment_nm: float = required_number(
        50000.0, 0.0, 1e9, "Largest eccentric moment that motor and brake must master."
    )
    # Zero is what the paper's equations count with: the complete torque shows what that leaves out.
    friction_coulomb_nm: float = number(0.0, 0.0, 1e8, "Friction of the rollers while turning.")
    friction_viscous_nm_s_per_rad: float = number(
        0.0, 0.0, 1e10, "Growth of the rollers' friction with speed."
    )


class Gears(Table):
    """[gears]: ratio, losses and limits of the transmission."""

    reducer_ratio: float = REDUCER_RATIO
    ring_ratio: float = RING_RATIO
    input_inertia_kg_m2: float = number(
        0.0, 0.0, 1e5, "Wave generator, coupling and brake rotor, at the motor shaft."
    )
    # 0.1 with the friction without load gives an efficiency of 75 to 80 %.
    load_loss_ratio: float = number(
        0.0, 0.0, 0.9, "Part of the transmitted torque that is lost; efficiency 1/(1 + this)."
    )
    friction_coulomb_nm: float = number(0.0, 0.0, 1e5, "Friction without load, at the motor shaft.")
    friction_viscous_nm_s_per_rad: float = number(0.0, 0.0, 1e5, "Its growth with speed, at the motor shaft.")
    torque_rated_nm: float = required_number(17600.0, 1e-2, 1e8, "Rated torque at the reducer output.")
    torque_momentary_nm: float = required_number(
        35200.0, 1e-2, 1e9, "Torque at the reducer output that it bears for a moment."
    )

    @property
    def ratio(self) -> float:
        """Motor turns per gantry turn."""
        return self.reducer_ratio * self.ring_ratio


class Structure(Table):
    """[structure]: what machine files take from the design of the steel; a motor is chosen without it."""

    # A rule of thumb in place of it would be a guess about the one figure that decides what control can do.
    first_mode_hz: float = required_number(
        2.0, 0.02, 500.0, "Lowest natural frequency of the load with the motor held."
    )
    damping_ratio: float = number(0.025, 0.0, 0.5, "Its damping ratio.")
    # Both of the base over those of the load on its transmission.
    base_frequency_ratio: float = number(3.5, 1.0, 100.0, "Rocking frequency of the base over first_mode_hz.")
    base_inertia_ratio: float = number(0.3, 0.01, 100.0, "Rocking inertia of the base over that of the load.")


class Teeth(Table):
    """[teeth]: pinion and ring; the waves of the gear error follow from them and from the ratios."""

    pinion_teeth: int = number(20, 6, 500, "Teeth of the pinion.")
    ring_radius_m: float = required_number(2.366, 0.01, 100.0, "Radius of the ring's pitch circle.")
    # 8 is what a large milled ring has; ground ones reach 5.
    grade: float = number(8.0, 1.0, 12.0, "Accuracy grade of pinion and ring by ISO 1328-1.")
    # An adjusted pinion; as delivered it is 0.03 to 0.05.
    backlash_ratio: float = number(0.0036, 0.0, 0.2, "Backlash over the module.")


class Duty(Table):
    """[duty]: one day of work."""

    cycles: int = number(40, 1, 1000, "Cycles of work in a day.")
    hours: float = number(12.0, 0.1, 24.0, "Length of the day.")
    stops_deg: tuple[Annotated[float, Field(ge=-3600.0, le=3600.0)], ...] = numbers(
        (90.0, 180.0, -90.0, 0.0), 1, 100, "Angles of one cycle in this order; it begins at the last one."
    )
    hold_s: float = number(120.0, 0.0, 3600.0, "Time at every stop.")


class Margins(Table):
    """[margins]: how much more than needed a part must give."""

    peak_torque: float = number(1.1, 1.0, 5.0, "Torque available over the largest torque.")
    thermal: float = number(1.25, 1.0, 5.0, "Rated torque over the r.m.s. torque.")
    # As the machine file's rule on the brake: 1.3 x the check moment.
    brake: float = number(1.3, 1.0, 10.0, "Brake over the largest eccentric moment.")
    overspeed: float = number(1.1, 1.0, 3.0, "Overspeed trip over the highest speed.")
    # The paper's machine has 7.18 without the reducer's input.
    inertia_ratio_max: float = number(
        10.0, 0.1, 1000.0, "Load at the motor shaft over rotor and reducer input."
    )
    # At least a hundred steps in the required angle: 0.1 deg against 3.84e-5 deg leaves 2600.
    resolution: float = number(100.0, 1.0, 1e6, "Required accuracy over one step of the encoder.")


class Sheet(Table):
    """A complete requirement sheet."""

    sheet: FileIdentity = table("Name of the sheet.")
    required: RequiredTable = table("What the axis must do.", RequiredTable)
    range: Range = table("Travel.")
    motion: Motion = table("Speeds and accelerations.")
    load: LoadSheet = table("What turns.")
    gears: Gears = table("The transmission.")
    structure: Structure = table("How stiff it is.")
    teeth: Teeth = table("Pinion and ring.")
    wind: WindTable = table("Wind; its largest moment is in that of the check.", WindTable)
    duty: Duty = table("One day of work.", Duty)
    margins: Margins = table("How much more than needed.", Margins)
