"""Table [plant]: the physics behind the simulated drive. Only the simulator and static checks read it."""

from __future__ import annotations

from typing import Annotated, Final, Literal

from pydantic import Field, field_validator

from gantryctl.machine.tables.fields import Table, choice, number, numbers, switch, table, text
from gantryctl.units import GRAVITY_M_S2

RING_HARMONICS = 12
PHASES = 18
PINION_PHASES = 5

# Cumulative pitch deviation of ISO 1328-1 grade 8 at 4.73 m and module 14: 0.27 mm peak to peak.
_RING_UM = (60.0, 32.0, 22.0, 17.0, 13.0, 11.0, 9.0, 8.0, 7.0, 6.0, 5.0, 5.0)
# A fit, not a prediction: 18 phases to the 24 values of the paper's table 2.
_PHASES_RAD = (
    5.9588, 3.2198, 3.4714, 0.1903, 0.5697, 3.5102, 4.9975, 0.131, 0.8568,
    4.9819, 5.105, 4.9849, 5.1094, 3.0107, 2.7736, 2.1534, 3.2887, 0.2153,
)  # fmt: skip


class LoadTable(Table):
    """[plant.load]: everything that turns with the axis, about it."""

    inertia_kg_m2: float = number(2.18e6, 0.01, 1e8, "Inertia of everything that turns.", "paper")
    mass_kg: float = number(2.0e5, 0.1, 1e7, "Turning mass.", "estimate")
    # 16.0 kN m with the mass: more than friction holds, as the paper says that the gantry would turn by itself.
    eccentricity_m: float = number(0.00815, 0.0, 10.0, "Centre of mass off the axis.", "calibrated")
    eccentric_angle_deg: float = number(
        0.0, -180.0, 180.0, "Angle at which the eccentric moment is zero.", "paper"
    )
    # The centre of mass hangs below at 0 deg: agrees with the sign of the chord errors there.
    eccentric_sign: float = number(
        -1.0,
        -1.0,
        1.0,
        "-1: restoring at that angle; +1: falling away from it. Nothing between.",
        "calibrated",
    )
    eccentric_check_moment_nm: float = number(
        50000.0, 0.0, 1e9, "Eccentric moment that stops and brake are proved with."
    )

    @property
    def eccentric_moment_nm(self) -> float:
        """Largest torque of the centre of mass about the axis, without its sign: 16.0 kN m for the defaults."""
        return self.mass_kg * GRAVITY_M_S2 * self.eccentricity_m

    @field_validator("eccentric_sign")
    @classmethod
    def _a_sign(cls, value: float) -> float:
        if abs(value) != 1.0:
            raise ValueError("allowed -1 or 1")
        return value


class PlantMotorTable(Table):
    """[plant.motor]: what the motor's name plate does not say, at the motor shaft."""

    # Size class 130, by the fifth power of the size from a catalogue value, with coupling and brake rotor.
    wave_generator_inertia_kg_m2: float = number(
        0.13, 0.0, 1e5, "Wave generator, coupling and brake rotor.", "estimate"
    )
    # 1.5 % of the rated torque peak to peak, half of it.
    torque_ripple_nm: float = number(1.9, 0.0, 1e5, "Amplitude of the torque ripple.", "catalogue")
    torque_ripple_order: int = number(
        12, 1, 1000, "Ripple periods per motor turn.", "estimate", unit="1/turn"
    )
    # 1 % of the rated torque: slots not skewed by a full pitch (Hendershot, Miller 2010).
    cogging_torque_nm: float = number(2.6, 0.0, 1e5, "Amplitude of the cogging torque.", "estimate")
    # Smallest common multiple of 36 slots and 8 poles.
    cogging_order: int = number(72, 1, 1000, "Cogging periods per motor turn.", "estimate", unit="1/turn")
    cogging_phase_rad: float = number(0.0, -6.3, 6.3, "Phase of the cogging at motor angle 0.")
    # Torque = Kt iq; a drive turns torque into current by the Kt that it was told. Peak for r.m.s. is sqrt(2) off.
    torque_constant_ratio: float = number(
        1.0, 0.5, 2.0, "Torque constant of the motor over the one that the drive was told."
    )


class TransmissionTable(Table):
    """[plant.transmission]: stiffness, damping, hysteresis and backlash from motor to ring."""

    # Catalogue rows of the largest size (100), scaled by 1.3^3: 17.6 kN m are above catalogue sizes, so type and
    # stiffness are the least certain values here. At the gantry, with the rest in series: 5.12, 6.28 and 7.16e8 N
    # m/rad.
    reducer_stiffness_1_nm_per_rad: float = number(
        4.6e6, 1.0, 1e12, "First slope, at the reducer output.", "catalogue"
    )
    reducer_stiffness_2_nm_per_rad: float = number(
        6.4e6, 1.0, 1e12, "Second slope, at the reducer output.", "catalogue"
    )
    reducer_stiffness_3_nm_per_rad: float = number(
        8.1e6, 1.0, 1e12, "Third slope, at the reducer output.", "catalogue"
    )
    reducer_torque_1_nm: float = number(1850.0, 1e-4, 1e9, "End of the first slope, same place.", "catalogue")
    reducer_torque_2_nm: float = number(
        6680.0, 1e-4, 1e9, "End of the second slope, same place.", "catalogue"
    )
    rest_stiffness_nm_per_rad: float = number(
        1.5e9, 1.0, 1e14, "Everything behind the reducer in series, at the load.", "estimate"
    )
    damping_ratio: float = number(0.025, 0.0, 0.5, "Damping ratio with the motor locked.", "estimate")
    # A hysteresis loss of about 1 arcmin at the reducer output, from a catalogue: 1.3e-3 deg at the gantry, full width.
    hysteresis_torque_nm: float = number(
        2000.0, 0.0, 1e8, "Half width of the hysteresis without torque, at the load.", "catalogue"
    )
    hysteresis_load_ratio: float = number(0.1, 0.0, 1.0, "Its part in proportion to the load.", "calibrated")
    hysteresis_length_rad: float = number(
        1.0e-5, 1e-9, 0.1, "Pre-sliding length of the hysteresis, at the load.", "estimate"
    )
    # New girth gears have 0.4 to 0.8 mm; the row of 0 deg in the paper's table 2 allows about 0.1 mm at most. 0.05 mm
    # are 1.2e-3 deg at the gantry.
    backlash_mm: float = number(0.05, 0.0, 2.0, "Backlash at the ring's pitch circle.", "calibrated")


class GearErrorTable(Table):
    """[plant.gear_error]: the gear-error map, at the ring's pitch circle or at the reducer output."""

    # 338 teeth of module 14 mm: example geometry of a ring of 4.7 m.
    ring_radius_m: float = number(2.366, 0.005, 50.0, "Radius of the ring's pitch circle.", "estimate")
    pinion_teeth: int = number(26, 1, 1000, "Teeth of the pinion.", "estimate")
    ring_um: tuple[Annotated[float, Field(ge=0.0, le=1000.0)], ...] = numbers(
        _RING_UM,
        1,
        RING_HARMONICS,
        "Ring error, one amplitude per harmonic of a turn of the axis; missing harmonics are zero.",
        "standard",
    )
    reducer_2x_rad: float = number(4.0e-5, 0.0, 2e-3, "Two cycles per motor turn.", "catalogue")
    reducer_1x_rad: float = number(1.5e-5, 0.0, 8e-4, "One cycle per motor turn.", "estimate")
    reducer_4x_rad: float = number(1.0e-5, 0.0, 5e-4, "Four cycles per motor turn.", "estimate")
    output_1x_rad: float = number(9.0e-5, 0.0, 5e-3, "One cycle per turn of the reducer output.", "catalogue")
    # Run-out of 40 um peak to peak, ISO 1328 grade 7.
    pinion_1x_um: float = number(20.0, 0.0, 1000.0, "Run-out of the pinion.", "standard")
    mesh_um: float = number(8.0, 0.0, 400.0, "Tooth mesh.", "standard")
    scale: float = number(1.2, 0.0, 20.0, "Factor on every amplitude of this table.", "calibrated")
    phases_rad: tuple[Annotated[float, Field(ge=-6.3, le=6.3)], ...] = numbers(
        _PHASES_RAD,
        PHASES,
        PHASES,
        "Phases: 12 ring harmonics, reducer 2x, 1x, 4x, pinion and output 1x, mesh, one unused. "
        "The defaults are fitted to the paper's table 2, not predicted.",
        "calibrated",
    )


class ToothPitchTable(Table):
    """[plant.tooth_pitch]: pitch deviations of single teeth; [plant.switches] tooth_pitch puts them there."""

    ring_grade: float = number(
        8.0, 1.0, 12.0, "Accuracy grade of the ring's teeth by ISO 1328-1.", "standard"
    )
    # Ground, where the ring is milled.
    pinion_grade: float = number(7.0, 1.0, 12.0, "Accuracy grade of the pinion's teeth.", "standard")
    # 1 is the worst gear that still passes: its largest single pitch deviation is f_pt, or its F_p the permitted one.
    scale: float = number(
        1.0, 0.0, 20.0, "Factor on all deviations; 1 = the limits of the grades are reached."
    )
    # Spur gears of 26 and 338 teeth, pressure angle 20 deg.
    contact_ratio: float = number(1.78, 1.05, 2.0, "Tooth pairs in mesh on average.", "derived")
    seed: int = number(1, 0, 2**31 - 1, "Seed of the deviations: another is another pair of gears.")


class ThermalTable(Table):
    """[plant.thermal]: temperatures above those of alignment; [plant.switches] thermal lets them act."""

    gears_start_k: float = number(0.0, -40.0, 60.0, "Of ring and pinion, at the start.")
    gears_end_k: float = number(0.0, -40.0, 60.0, "The same in the end.")
    # 20 t of steel with 8 W/(m2 K) over 30 m2.
    # 1e6 s would be solid steel some 4 m thick.
    gears_time_s: float = number(36000.0, 1.0, 1e6, "Time constant of the gears.", "estimate")
    motor_start_k: float = number(0.0, -40.0, 140.0, "Of the motor, at the start.")
    motor_end_k: float = number(0.0, -40.0, 140.0, "The same in the end.")
    # Catalogues of motors give 10 to 120 minutes.
    motor_time_s: float = number(1800.0, 1.0, 1e5, "Time constant of the motor.", "estimate")
    expansion_per_k: float = number(1.15e-5, 0.0, 3e-5, "Expansion of the gears: steel.", "standard")
    support_share: float = number(
        0.0,
        0.0,
        1.0,
        "Part of it that the support makes too; 0 = it keeps its size, 1 = the gap stays.",
        "estimate",
    )
    pressure_angle_deg: float = number(20.0, 10.0, 30.0, "Pressure angle of the teeth.", "standard")
    # Mineral gear oil ISO VG 220 falls from 220 mm2/s at 40 degC to half of it within 14 K (ISO 3448, ASTM D341).
    viscosity_per_k: float = number(-0.05, -0.2, 0.0, "Exponent of viscous friction.", "standard")
    # Remanence of NdFeB; SmCo has -0.0004, ferrite -0.002 (MMPA standard 0100-00).
    torque_constant_per_k: float = number(
        -0.001, -0.01, 0.01, "Growth of the motor's torque per current.", "standard"
    )


class AgeingTable(Table):
    """[plant.ageing]: breakaway that grows while contacts rest; [plant.switches] ageing lets it."""

    roller_nm: float = number(
        1500.0, 0.0, 1e8, "Growth of the rollers' breakaway after a long rest.", "estimate"
    )
    roller_time_s: float = number(10.0, 1e-3, 3000.0, "Time constant of it.", "estimate")
    # 0.24 mm at the rim: the width of a rolling contact. At most 0.2 mm on a radius of 10 mm.
    roller_length_rad: float = number(1.0e-4, 1e-9, 0.02, "Sliding angle after which it is lost.", "estimate")
    motor_nm: float = number(2.0, 0.0, 1e5, "The same of the motor, at its shaft.", "estimate")
    motor_time_s: float = number(10.0, 1e-3, 3000.0, "Time constant of it.", "estimate")
    # No contact is longer than the radius it runs on.
    motor_length_rad: float = number(0.05, 1e-7, 1.0, "Sliding angle after which it is lost.", "estimate")


class CableTable(Table):
    """[plant.cable]: moment of the cable chain on the load; [plant.switches] cable puts it there."""

    moment_nm: float = number(0.0, -1e8, 1e8, "At 0 deg of the axis.", "estimate")
    # 150 kg/m of cables wound on and off a drum of 2.5 m: some kN m over the travel.
    moment_1_nm_per_rad: float = number(-800.0, -1e9, 1e9, "Growth with the angle.", "estimate")
    moment_2_nm_per_rad2: float = number(0.0, -1e9, 1e9, "With its square.", "estimate")
    moment_3_nm_per_rad3: float = number(0.0, -1e9, 1e9, "With its cube.", "estimate")
    friction_nm: float = number(600.0, 0.0, 1e8, "Half width of the hysteresis.", "estimate")
    presliding_deg: float = number(0.5, 1e-4, 20.0, "Angle over which it turns over.", "estimate")


class SecondPinionTable(Table):
    """[plant.second_pinion]: a second motor, reducer and pinion; [plant.switches] second_pinion puts them there."""

    # As large as what the machine gives the first: motor, reducer, friction and gear errors are those of [motor] and
    # [plant]. Both motors share the torque u of one speed loop: u/2 + preload and u/2 - preload.
    angle_deg: float = number(
        90.0, -180.0, 180.0, "Place of the second pinion on the ring, from that of the first.", "estimate"
    )
    phases_rad: tuple[Annotated[float, Field(ge=-6.3, le=6.3)], ...] = numbers(
        (2.1, 5.6, 0.8, 4.4, 1.3),
        PINION_PHASES,
        PINION_PHASES,
        "Phases of its gear error: reducer 2x, 1x, 4x, pinion and output 1x, mesh.",
        "estimate",
    )
    # Half of 16.0 kN m of eccentric moment, 6.8 of friction and twice the 15.0 of the paper's acceleration (the load
    # swings), over 1144: 23.1 N m; a tenth more for the motors' friction, 4.2 N m for the hysteresis of the reducers.
    preload_nm: float = number(
        35.0, -1e5, 1e5, "Torque of the motors against each other, at the motor; 0 = none.", "derived"
    )
    lost: Literal["none", "first", "second"] = choice(
        "none", "Motor without torque; the other and its friction stay. The drive does not know."
    )


class RollerFrictionTable(Table):
    """[plant.roller_friction]: the support rollers, at the load."""

    # W / cos 30 x (R / r) x (rolling and bearing friction) gives 6 to 9 kN m for 200 t.
    coulomb_nm: float = number(6000.0, 0.0, 1e8, "Friction while turning.", "derived")
    breakaway_nm: float = number(6800.0, 0.0, 1e8, "Friction at the start.", "estimate")
    stribeck_deg_s: float = number(0.02, 1e-6, 1000.0, "Speed over which one becomes the other.", "estimate")
    # 2.1 kN m at 6 deg/s.
    viscous_nm_s_per_rad: float = number(2.0e4, 0.0, 1e10, "Grease and seals.", "estimate")
    # 70 um at the rim.
    presliding_rad: float = number(3.0e-5, 1e-9, 0.05, "Angle before the rollers slide.", "estimate")
    micro_damping: float = number(
        0.3, 0.0, 5.0, "Damping before sliding: this x sqrt(stiffness x J).", "estimate"
    )


class MotorFrictionTable(Table):
    """[plant.motor_friction]: motor, seals and reducer input, at the motor shaft."""

    coulomb_nm: float = number(5.5, 0.0, 1e5, "Friction while turning.", "estimate")
    breakaway_nm: float = number(6.5, 0.0, 1e5, "Friction at the start.", "estimate")
    stribeck_rad_s: float = number(1.0, 1e-4, 50.0, "Speed over which one becomes the other.", "estimate")
    # 3.6 N m at 1144 r/min.
    viscous_nm_s_per_rad: float = number(0.03, 0.0, 1e5, "Growth with speed.", "estimate")
    load_ratio: float = number(0.1, 0.0, 0.9, "Part of the transmitted torque that is lost.", "estimate")
    presliding_rad: float = number(0.005, 1e-7, 0.2, "Motor angle before it slides.", "estimate")
    micro_damping: float = number(
        0.3, 0.0, 5.0, "Damping before sliding: this x sqrt(stiffness x J).", "estimate"
    )


class BaseTable(Table):
    """[plant.base]: rocking of roller frames and plinth about the axis."""

    inertia_kg_m2: float = number(6.0e5, 0.01, 1e9, "Effective rocking inertia.", "estimate")
    # An anchored steel frame on concrete has 5 to 15 Hz.
    frequency_hz: float = number(7.0, 0.05, 200.0, "Rocking frequency.", "estimate")
    damping_ratio: float = number(0.03, 0.0, 0.9, "Damping ratio of the rocking.", "estimate")


class WindTable(Table):
    """[plant.wind]: moment of the wind on the load; [plant.switches] wind puts it there."""

    moment_nm: float = number(0.0, -1e9, 1e9, "Mean moment about the axis, positive as angles are.")
    turbulence: float = number(
        0.15, 0.0, 0.4, "Turbulence intensity: gusts over the mean speed, r.m.s.", "standard"
    )
    speed_m_s: float = number(10.0, 0.5, 70.0, "Mean speed of the wind.", unit="m/s")
    # 100 m at 10 m over open country.
    length_m: float = number(100.0, 5.0, 1000.0, "Length of the gusts along the wind.", "standard")
    width_m: float = number(10.0, 0.1, 200.0, "Width of the surface: smaller gusts are not felt.")
    seed: int = number(
        1, 0, 2**31 - 1, "Seed of the phases of the gusts: another is another quarter of an hour."
    )

    @property
    def largest_nm(self) -> float:
        """Mean moment and 3.5 times its r.m.s. gusts, 2 x turbulence x mean: the largest of ten minutes."""
        return abs(self.moment_nm) * (1.0 + 7.0 * self.turbulence)


class StructureTable(Table):
    """[plant.structure]: what bends under its own weight; `gantryctl accuracy isocentre` reads it, no run does."""

    tube_mass_kg: float = number(1.2e5, 0.0, 5e6, "Of the part that bends between the rings.", "estimate")
    # 1 mm of sag, and a fifth less across the side that is open for the patient.
    # 5e10 N/m: steel of 1.5 m2 in section, 6 m long, pulled.
    tube_stiffness_radial_n_per_m: float = number(1.2e9, 1e3, 5e10, "Towards the nozzle.", "estimate")
    tube_stiffness_tangential_n_per_m: float = number(1.5e9, 1e3, 5e10, "Across it.", "estimate")
    nozzle_mass_kg: float = number(
        4000.0, 0.0, 2e5, "Nozzle, or what stands for it on another axis.", "estimate"
    )
    # 2e10 N/m: steel of 0.1 m2 in section, 1 m long, pulled.
    nozzle_stiffness_radial_n_per_m: float = number(1.5e8, 1e3, 2e10, "Of its mount, radially.", "estimate")
    nozzle_stiffness_tangential_n_per_m: float = number(8.0e7, 1e3, 2e10, "Of its mount, across.", "estimate")
    # 1e11 N m/rad: a solid steel post of 1.8 m in diameter, 1 m long, bent.
    nozzle_tilt_stiffness_nm_per_rad: float = number(5.0e8, 1e3, 1e11, "Of its mount, tilting.", "estimate")
    nozzle_radius_m: float = number(2.5, 0.0, 50.0, "From its mount to the isocentre.", "estimate")
    nozzle_reach_m: float = number(1.0, 0.0, 50.0, "Its centre of mass from its mount, inwards.", "estimate")
    nozzle_overhang_m: float = number(0.3, -15.0, 15.0, "The same, along the axis.", "estimate")
    nozzle_place: float = number(0.4, -1.0, 2.0, "Between front ring (0) and rear ring (1).", "estimate")
    ring_distance_m: float = number(6.0, 0.01, 100.0, "From front to rear ring.", "estimate")
    roller_angle_deg: float = number(
        30.0, 5.0, 80.0, "Of the rollers to either side of the lowest point.", "estimate"
    )
    front_track_um: tuple[Annotated[float, Field(ge=0.0, le=2000.0)], ...] = numbers(
        (80.0, 30.0, 15.0),
        1,
        8,
        "Track of the front ring: amplitudes of 2, 3, ... waves per turn.",
        "estimate",
    )
    rear_track_um: tuple[Annotated[float, Field(ge=0.0, le=2000.0)], ...] = numbers(
        (60.0, 30.0, 15.0), 1, 8, "Track of the rear ring.", "estimate"
    )
    track_seed: int = number(1, 0, 2**31 - 1, "Seed of the phases of the tracks.")


class PlantBrakeTable(Table):
    """[plant.brake]: how the closed brake gives way."""

    presliding_rad: float = number(5.0e-4, 1e-7, 0.02, "Motor angle before the brake slides.", "estimate")
    # For faults: the program still believes [brake] torque_nm.
    torque_share: float = number(
        1.0, 0.001, 3.0, "Part of [brake] torque_nm that it really has; below 1 it is worn."
    )


class PlantEncoderTable(Table):
    """[plant.encoder]: how the simulated encoder is mounted."""

    latency_us: float = number(62.5, 0.0, 2000.0, "Age of the angle when it is read.", "estimate")
    mounting_turns: int = number(2048, 0, 2**24, "Encoder turns at 0 deg of the axis.")
    serial: str = text("SIM-0001", 40, "Serial number the simulated encoder reports.")
    # 1 % of a signal period of 2048 lines, half and half (Heidenhain, encoders for servo drives).
    interpolation_1x_rad: float = number(1.5e-5, 0.0, 5e-3, "Error once per signal period.", "catalogue")
    interpolation_2x_rad: float = number(1.5e-5, 0.0, 5e-3, "Error twice per signal period.", "catalogue")
    # System accuracy of 20 arcsec.
    eccentricity_rad: float = number(8.0e-5, 0.0, 0.02, "Error once per motor turn.", "catalogue")
    eccentricity_phase_rad: float = number(0.0, -6.3, 6.3, "Phase of it at motor angle 0.")


SCALE_TERMS: Final = ((2.0, 1.0, 1.0), (5.0, 0.6, 2.0), (37.0, 0.4, 3.0))
"""Scale error of the encoder on the ring over one turn: waves per turn, relative amplitude, phase in rad."""


class LoadEncoderTable(Table):
    """[plant.load_encoder]: optional encoder on the ring."""

    fitted: bool = switch(False, "The controller can read it; measuring runs can in any case.")
    # 2^26 steps are 5.4e-6 deg each.
    bits: int = number(26, 8, 32, "Steps per turn of the axis, as a power of two.", "estimate", unit="bit")
    noise_rad: float = number(2.0e-7, 0.0, 1e-5, "Noise, r.m.s.", "estimate")
    scale_error_rad: float = number(4.0e-6, 0.0, 2e-4, "Amplitude of the scale-error map.", "estimate")
    latency_us: float = number(62.5, 0.0, 2000.0, "Age of the angle when it is read.", "estimate")


class SwitchesTable(Table):
    """[plant.switches]: false = the effect is exactly absent."""

    gear_error: bool = switch(True, "Gear-error map.")
    backlash: bool = switch(True, "Backlash.")
    hysteresis: bool = switch(True, "Hysteresis of the reducer.")
    roller_friction: bool = switch(True, "Friction of the rollers.")
    motor_friction: bool = switch(True, "Friction of the motor.")
    eccentric_moment: bool = switch(True, "Eccentric moment of the load.")
    base: bool = switch(True, "Rocking base.")
    torque_ripple: bool = switch(True, "Torque ripple of the motor.")
    wind: bool = switch(False, "Moment of the wind.")
    tooth_pitch: bool = switch(False, "Pitch deviations of single teeth.")
    thermal: bool = switch(False, "Temperatures: backlash, viscous friction, torque of the motor.")
    ageing: bool = switch(False, "Breakaway that grows at rest.")
    cogging: bool = switch(False, "Cogging torque of the motor.")
    encoder_errors: bool = switch(False, "Errors of the motor encoder.")
    cable: bool = switch(False, "Moment of the cable chain.")
    second_pinion: bool = switch(False, "Second motor, reducer and pinion.")
    three_slopes: bool = switch(True, "Three slopes of the reducer; false = the first slope only.")
    rigid: bool = switch(False, "One inertia without any compliance.")


class UncertaintyTable(Table):
    """[plant.uncertainty]: how far the plant may lie from this file; the quick stop is certified over it."""

    # What campaigns vary before a gantry is built (configs/campaigns/sensitivity.toml).
    inertia_ratio: float = number(
        0.2, 0.0, 0.5, "Half width of the band of the load's inertia before it is identified.", "estimate"
    )
    friction_ratio: float = number(
        0.2, 0.0, 0.9, "The same of every friction, rollers and motor.", "estimate"
    )
    stiffness_ratio: float = number(
        0.2, 0.0, 0.9, "The same of every stiffness of the transmission.", "estimate"
    )
    # Magnets lose some 0.1 % a kelvin, and name plates round.
    torque_constant_ratio: float = number(
        0.03, 0.0, 0.3, "The same of the torque that the motor gives for the torque asked of it.", "estimate"
    )
    # 5.4 deg/s2 leave 2.4 of 385 N m: `gantryctl stops --find-quick` prints how much inertia that is.
    identified_inertia_ratio: float = number(
        0.005,
        0.0,
        0.25,
        "How much heavier than this file an identified load may be: every check of the quick stop takes it so.",
    )


class IntegrationTable(Table):
    """[plant.integration]: how the simulator steps through a drive cycle."""

    # About six times as fast as Runge-Kutta, 1.6e-5 deg away from it over the 180 deg move (decision 0007).
    scheme: Literal["one_evaluation", "rk4"] = choice(
        "one_evaluation", "One force evaluation per drive cycle, or classical Runge-Kutta."
    )
    rk4_steps: int = number(2, 1, 64, 'Sub-steps per drive cycle; only with scheme = "rk4".')


class PlantTable(Table):
    """[plant]: all of the simulated physics."""

    load: LoadTable = table("What turns with the axis.", LoadTable)
    motor: PlantMotorTable = table("Motor, beyond its name plate.", PlantMotorTable)
    transmission: TransmissionTable = table("From motor to ring.", TransmissionTable)
    gear_error: GearErrorTable = table("Gear-error map.", GearErrorTable)
    roller_friction: RollerFrictionTable = table("Support rollers.", RollerFrictionTable)
    motor_friction: MotorFrictionTable = table("Motor and reducer input.", MotorFrictionTable)
    base: BaseTable = table("Rocking base.", BaseTable)
    wind: WindTable = table("Moment of the wind.", WindTable)
    tooth_pitch: ToothPitchTable = table("Single teeth.", ToothPitchTable)
    thermal: ThermalTable = table("Temperatures.", ThermalTable)
    ageing: AgeingTable = table("Breakaway after rest.", AgeingTable)
    cable: CableTable = table("Cable chain.", CableTable)
    second_pinion: SecondPinionTable = table("Second pinion.", SecondPinionTable)
    structure: StructureTable = table("What bends.", StructureTable)
    brake: PlantBrakeTable = table("Brake lining.", PlantBrakeTable)
    encoder: PlantEncoderTable = table("Mounting of the motor encoder.", PlantEncoderTable)
    load_encoder: LoadEncoderTable = table("Encoder on the ring.", LoadEncoderTable)
    switches: SwitchesTable = table("Effects on and off.", SwitchesTable)
    uncertainty: UncertaintyTable = table("How far the plant may lie from this file.", UncertaintyTable)
    integration: IntegrationTable = table("Integration of the equations.", IntegrationTable)
