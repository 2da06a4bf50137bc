"""Tables [control], [monitors] and [accuracy]: position loop, supervision and the accuracy test."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field

from gantryctl.machine.tables.compensation import CompensationTable
from gantryctl.machine.tables.fields import Table, choice, number, numbers, switch, table


class ControlTable(Table):
    """[control]: the scan and the position loop."""

    # The paper does not give it; 1 to 4 ms are usual for the motion cycle of a PLC, and 4 ms is the period on CAN.
    scan_period_ms: float = number(1.0, 0.1, 40.0, "Period of the scan.", "estimate")
    # Kpp barely moves the chord accuracy: what limits it lies behind the motor (gear error, wind-up, backlash).
    kpp_per_s: float = number(10.0, 0.001, 1000.0, "Gain of the position loop.", "paper")
    # 100 %: ramp and parabola leave no following error. Without it 6 deg/s lags by V / Kpp = 0.6 deg.
    kvf: float = number(1.0, 0.0, 1.5, "Velocity feed-forward; 1 = 100 %.", "paper")
    compensation: CompensationTable = table("What goes beyond the position loop.", CompensationTable)


class MonitorsTable(Table):
    """[monitors]: thresholds of the supervision, at the load; times become at least two scans."""

    # The band grows with the speed because a late reading looks like an error of speed x lateness (decision 0005).
    following_error_base_deg: float = number(0.03, 1e-6, 10.0, "Following error at rest that trips.")
    following_error_per_speed_s: float = number(
        0.012, 0.0, 5.0, "Widening of that band: base + this x |speed|."
    )
    following_error_warning_ratio: float = number(0.5, 0.05, 0.95, "Part of the band that warns.")
    following_error_time_ms: float = number(10.0, 1.0, 500.0, "How long, before it trips.")
    velocity_deviation_deg_s: float = number(
        0.5, 1e-6, 1000.0, "Measured against commanded speed that trips."
    )
    velocity_deviation_time_ms: float = number(20.0, 1.0, 1000.0, "How long, before it trips.")
    overspeed_time_ms: float = number(20.0, 1.0, 1000.0, "Overspeed before it trips.")
    standstill_window_deg: float = number(0.02, 1e-7, 10.0, "Movement at commanded standstill that trips.")
    standstill_time_ms: float = number(10.0, 1.0, 500.0, "How long, before it trips.")
    in_position_window_deg: float = number(0.005, 1e-7, 10.0, "Distance that counts as arrived.")
    in_position_dwell_ms: float = number(200.0, 1.0, 10000.0, "Time inside the window before Done.")
    in_position_tolerance_time_s: float = number(
        3.0, 0.1, 100.0, "Time after the profile's end to come into position, else alarm."
    )
    torque_saturation_time_ms: float = number(
        200.0, 1.0, 10000.0, "Time at the torque limit before it trips."
    )
    brake_feedback_time_ms: float = number(
        300.0, 1.0, 10000.0, "Time the brake's feedback may differ from its command."
    )
    power_up_time_ms: float = number(2000.0, 10.0, 60000.0, "Longest power-up, then alarm.")
    # Before that nothing but the load counts as needed: a yaw drive whose friction alone is a third of its rated torque
    # was told of a brake that drags in its first motions (BRK-02).
    running_torque_nm: float = number(
        0.0,
        0.0,
        1e6,
        "Torque of the motor that a motion may need until the axis has learned it, friction and load; less than that "
        "of the brake test counts as that.",
        "derived",
    )
    # What has been learned in one direction of motion is wrong by twice a steady wind in the other: the dish among the
    # shipped machines was told of a brake that drags as it turned round (BRK-02, 58 N m of a wind of 24).
    wind_torque_nm: float = number(
        0.0,
        0.0,
        1e6,
        "Torque of the motor by which wind, or another moment from outside, may change what a motion needs.",
        "derived",
    )
    # From the issue of the status frame that the renewal acknowledges, not from its arrival: a delayed renewal renews
    # less.
    lease_ms: float = number(
        250.0,
        20.0,
        1000.0,
        "Hold-to-run ends so long after the issue of the newest status frame that a renewal has named.",
    )
    # A holder who has gone for a moment, or whose page is loaded again, finds power as it was; a night is too long.
    unheld_power_time_s: float = number(
        300.0,
        2.0,
        7200.0,
        "The service switches power off after so long at rest with nobody in control.",
    )
    # Harder than the stop on a ramp: the drive ramps, then brake and torque off.
    door_reaction: Literal["stop", "quick_stop"] = choice(
        "stop", "What an opened room door does in motion: the jog-release ramp, or a quick stop."
    )
    encoder_battery: bool = switch(
        False,
        "A battery keeps the encoder's turns while the supply is off; its alarm is watched.",
        "catalogue",
    )
    # A motor of this size takes two to three hours to its final temperature: four time constants of the winding.
    motor_thermal_time_constant_s: float = number(
        1800.0, 10.0, 20_000.0, "After this the winding has 63 % of its final temperature rise.", "estimate"
    )
    motor_temp_max_c: float = number(
        155.0, 60.0, 250.0, "Highest temperature of the motor's winding; thermal class F.", "standard"
    )


class AccuracyTable(Table):
    """[accuracy]: the chord test and the speed test; a plan that is not given follows from travel and speed range."""

    bases_deg: tuple[Annotated[float, Field(ge=-3600.0, le=3600.0)], ...] = numbers(
        (), 0, 20, "Bases of the chord test; none: the middle of travel and a quarter of it either side."
    )
    displacements_deg: tuple[Annotated[float, Field(ge=0.01, le=179.0)], ...] = numbers(
        (), 0, 20, "Chords from every base; none: four steps of 5 deg, or of a twentieth of a shorter travel."
    )
    speeds_deg_s: tuple[Annotated[float, Field(ge=1e-6, le=1000.0)], ...] = numbers(
        (), 0, 20, "Speeds of the speed test; none: the lowest setting, half of the highest, the highest."
    )
    # The paper is silent about it; 1e-4 deg are 4.4 um at 2.5 m.
    chord_radius_m: float = number(2.5, 0.01, 100.0, "Radius of the tracker's target.", "estimate")
    # Half the maximum permissible error of a laser tracker, as usual for its typical error, averaged.
    tracker_noise_um: float = number(10.0, 0.0, 500.0, "Tracker noise per coordinate, 1 sigma.", "catalogue")
    dwell_s: float = number(6.0, 0.1, 300.0, "Rest at each point.")
    average_s: float = number(2.0, 0.01, 100.0, "Last part of the rest that is averaged.")
