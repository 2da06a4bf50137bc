"""Default answers of a drive without a bus, and the common part of simulated drives."""

from __future__ import annotations

from collections.abc import Callable
from typing import Final, Protocol

from gantryctl.image import DriveRequest, DriveState, LinkHealth
from gantryctl.ports import Truth

TRUTH_COLUMNS: Final = (
    "pos_load_rad",
    "vel_load_rad_s",
    "pos_motor_rad",
    "vel_motor_rad_s",
    "pos_base_rad",
    "vel_base_rad_s",
    "torque_mesh_nm",
)
"""True state of the compiled plant, in the order of its `truth()`."""

# A load swings on for some 6 s after an emergency stop from 6 deg/s (plant equations, brake).
_SETTLE_S: Final = 30.0
# More than a period of the swing: the first mode of the gantry is near 2 Hz.
_CALM_S: Final = 0.6
# Speed of the load that still swings by some 0.0001 deg.
_CALM_RAD_S: Final = 1e-5


def state_for(state: dict[str, float], brake_presliding_rad: float) -> dict[str, float]:
    """State of a plant for one with another brake.

    The pads of a closed brake stretch by their pre-sliding way and then slip (plant equations, S3). Where the brake has
    no torque nothing slips, and the way of the shaft adds up: as a spring of the brake that has its torque again it
    would be a torque of many brakes.
    """
    way = brake_presliding_rad
    return {**state, "brake_z": max(-way, min(way, state["brake_z"]))}


class SimulatedPlant(Truth, Protocol):
    """Simulated gantry behind a virtual drive on a bus."""

    def plant_state(self) -> dict[str, float]:
        """State from which a later run goes on; {} where another process keeps it."""
        ...

    def let_pass(self, seconds: float) -> None:
        """Let time pass in which nobody sends SYNC, where neither a clock nor the bus does."""
        ...

    def settle(self) -> None:
        """Let the load come to rest after the master has left, where nothing else advances it."""
        ...

    def release(self) -> None:
        """Leave a gantry of another process alone from now on."""
        ...


class BaseDrive:
    """Answers of a drive without a bus and without a simulated load."""

    refusals: tuple[str, ...] = ()
    torque_preload = True
    reports_torque = True
    lost = False

    @property
    def truth_source(self) -> Truth | None:
        """None: the load is not simulated."""
        return None

    def set_up_again(self) -> None:
        """Nothing: such a drive is never lost."""

    def health(self) -> LinkHealth | None:
        """None: there is no bus."""
        return None

    def plant_state(self) -> dict[str, float]:
        """{}: no plant is simulated."""
        return {}


_TO_ENABLED: Final = {
    DriveState.SWITCH_ON_DISABLED: DriveState.READY_TO_SWITCH_ON,
    DriveState.READY_TO_SWITCH_ON: DriveState.SWITCHED_ON,
    DriveState.SWITCHED_ON: DriveState.OPERATION_ENABLED,
}


def next_state(state: DriveState, request: DriveRequest, *, faulty: bool, powered: bool) -> DriveState:
    """CiA 402 state of a drive without a bus after one scan, at most one transition further."""
    if faulty:
        reset = request is DriveRequest.FAULT_RESET and state is DriveState.FAULT
        return DriveState.SWITCH_ON_DISABLED if reset else DriveState.FAULT
    if request is DriveRequest.DISABLE or not powered:
        return DriveState.SWITCH_ON_DISABLED
    if request is DriveRequest.ENABLE:
        return _TO_ENABLED.get(state, state)
    # Option code 6 of 605A: a quick stop holds zero speed until it is disabled.
    if request is DriveRequest.QUICK_STOP and state is DriveState.OPERATION_ENABLED:
        return DriveState.QUICK_STOP_ACTIVE
    return state


def settle(advance: Callable[[], object], vel_load_rad_s: Callable[[], float], step_s: float) -> None:
    """Advance a plant step by step until its load has been at rest for more than a period of its swing."""
    left = round(_SETTLE_S / step_s)
    window = max(1, round(_CALM_S / step_s))
    while left > 0:
        fastest = 0.0
        for _ in range(window):
            advance()
            fastest = max(fastest, abs(vel_load_rad_s()))
        if fastest < _CALM_RAD_S:
            return
        left -= window
