"""Table [drive]: which drive there is, and the loops that belong to it."""

from __future__ import annotations

from typing import Literal

from gantryctl.machine.tables.fields import Table, choice, number, switch, table


class SpeedLoopTable(Table):
    """[drive.speed_loop]: speed PI of the simulated drive; a real drive keeps its own."""

    # A servo cycle of a common drive series; the simulator steps by it, and the error of its scheme grows in proportion
    # to it (decision 0007).
    cycle_us: float = number(125.0, 10.0, 5000.0, "Period of the drive's speed loop.", "catalogue")
    # The paper's. It equals J / (2 x 1.5 ms) for a J of 0.2331 kg m2, nearly the rotor alone (0.232): a drive's own
    # tuning found a load that is decoupled above a few hertz. On the whole inertia it gives a damping ratio of 0.32
    # only.
    kvp_nm_s_per_rad: float = number(77.6959, 1e-8, 1e7, "Proportional gain, at the motor.", "paper")
    tvi_ms: float = number(10.0, 0.1, 2000.0, "Integral time.", "paper")
    delay_cycles: int = number(1, 0, 1, "Drive cycles from reading the speed to the torque.", "estimate")
    # 8192 steps a turn, differentiated over 125 us, are 6.1 rad/s a step and 477 N m through Kvp: unusable without a
    # filter of 2 ms or more. 2048 lines x 2048 steps make it 0.93 N m.
    feedback: Literal["ideal", "interpolated", "counts"] = choice(
        "interpolated",
        "Speed from the true angle, from lines x interpolation, or from counts_per_turn.",
        "catalogue",
    )
    overload_time_s: float = number(
        60.0, 0.1, 600.0, "How long the highest torque may be drawn, then rated torque (I2t).", "estimate"
    )


class CurrentLoopTable(Table):
    """[drive.current_loop]: first-order current loop of the simulated drive."""

    bandwidth_hz: float = number(600.0, 10.0, 10000.0, "Corner frequency of the torque.", "catalogue")
    ideal: bool = switch(False, "true = the torque follows at once.")


class DriveTable(Table):
    """[drive]: the kind of drive and its loops."""

    kind: Literal["sim", "ideal", "canopen"] = choice(
        "sim",
        "Simulated drive with the axis behind it, actual = set-point for trying programs, or a drive on a bus.",
    )
    speed_loop: SpeedLoopTable = table("Speed loop of the simulated drive.", SpeedLoopTable)
    current_loop: CurrentLoopTable = table("Current loop of the simulated drive.", CurrentLoopTable)
