"""Tables [motor], [reducer], [encoder] and [brake]: the bought parts, at their own shafts."""

from __future__ import annotations

from typing import Literal

from gantryctl.machine.tables.fields import Table, choice, number, required_number


class MotorTable(Table):
    """[motor]: name plate, at the motor shaft."""

    power_rated_kw: float = required_number(31.0, 1e-4, 1e4, "Rated power.")
    torque_rated_nm: float = required_number(257.0, 1e-3, 1e6, "Rated torque.")
    # 1.5 x rated, the usual overload of such a motor.
    torque_max_nm: float = required_number(
        385.0, 1e-3, 1e6, "Torque limit, one value everywhere (CiA 402 object 6072)."
    )
    # The highest setting needs 1144 r/min: 0.5 % below this.
    speed_rated_r_min: float = required_number(1150.0, 0.1, 1e5, "Rated speed.")
    speed_max_r_min: float = required_number(2000.0, 0.1, 1e5, "Highest permitted speed.")
    # With power, power factor and efficiency these imply a line voltage of 316 V.
    current_rated_a: float = number(69.0, 0.01, 1e4, "Rated current, r.m.s.", "paper")
    power_factor: float = number(0.89, 0.3, 1.0, "Power factor at rated power.", "paper")
    efficiency: float = number(0.921, 0.3, 1.0, "Efficiency at rated power.", "paper")
    # The load is 7.18 times as much at the motor shaft.
    inertia_kg_m2: float = required_number(0.232, 1e-8, 1e5, "Rotor inertia, without what is mounted on it.")


class ReducerTable(Table):
    """[reducer]: limits of the reducer, at its output."""

    torque_rated_nm: float = number(17600.0, 1e-2, 1e8, "Rated torque at the reducer output.", "paper")
    torque_momentary_nm: float = number(
        35200.0, 1e-2, 1e9, "Torque at the reducer output that a stop may draw for a moment.", "estimate"
    )


class EncoderTable(Table):
    """[encoder]: absolute multiturn encoder on the motor shaft."""

    # 13 bits of a turn and 12 bits of turns: one step is 3.84e-5 deg at the gantry, the range 3.58 gantry turns.
    counts_per_turn: int = required_number(8192, 64, 2**25, "Absolute steps per motor turn.")
    turns: int = required_number(4096, 1, 2**24, "Motor turns told apart before the encoder wraps.")
    lines: int = number(2048, 1, 2**20, "Sine/cosine lines per motor turn.", "catalogue", unit="1/turn")
    # What a drive makes of one line, 2^11; others make 2^13.
    interpolation: int = number(2048, 1, 65536, "Interpolated steps per line.", "catalogue")
    wrap_margin_min_deg: float = number(
        5.0, 0.1, 180.0, "Least distance between travel and the wrap of the encoder, at the load."
    )

    @property
    def fine_counts_per_turn(self) -> int:
        """Counts per motor turn as a simulated drive evaluates them."""
        return self.lines * self.interpolation


class BrakeTable(Table):
    """[brake]: the holding brake on the motor shaft and how it is used."""

    owner: Literal["drive", "controller_output", "object_60FE"] = choice(
        "drive",
        "Who works the brake: the drive's state machine, an output of the controller, or CiA 402 object 60FE.",
    )
    torque_nm: float = number(400.0, 1e-3, 1e6, "Torque of the closed brake at the motor.", "estimate")
    close_time_ms: float = number(150.0, 1.0, 10000.0, "From command to full torque.", "estimate")
    open_time_ms: float = number(100.0, 1.0, 10000.0, "From command to no torque.", "estimate")
    hold: Literal["servo", "brake"] = choice("servo", "What holds the axis at standstill.")
    hold_brake_after_s: float = number(
        30.0, 0.5, 1000.0, 'Standstill before the brake closes; only with hold = "brake".'
    )
    # Shown before the brake opens: a drive that gives no torque must not get the load.
    proof_torque_nm: float = number(
        30.0, 1e-4, 1e6, "Torque the drive must build against the closed brake before it opens."
    )
    # At least 1.3 x the check moment, at most what the motor has beside the load (decision 0014): 56.8 N m are needed
    # here. Of brakes from 0.5 to 400 N m the weakest that passed bore 65 (docs/evidence/brake_test.json).
    test_torque_nm: float = number(
        70.0,
        1e-3,
        1e6,
        "Brake test: torque that the closed brake must bear both ways, 1.3 x the check moment or more.",
        "derived",
    )
    # An overdue test allows nothing faster than 1 deg/s (BRK-12).
    test_interval_days: float = number(7.0, 0.1, 366.0, "The next brake test is due after so long.")
    test_interval_power_ups: int = number(
        100, 1, 5000, "... or after so many power-ups, whichever comes first."
    )
    # A count for service, not a limit of the brake: 13.6 kJ a stop from 6 deg/s on the reference machine.
    emergency_stops_max: int = number(
        1000, 1, 1000000, "Stops of the turning axis by the brake after which its service is due."
    )
    sag_max_deg: float = number(
        0.02, 1e-6, 1.0, "Movement after release, or under the brake test, that is too much; at the load."
    )
