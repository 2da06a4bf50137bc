"""Simulated drive: CiA 402 states, brake and encoder around the compiled gantry."""

from __future__ import annotations

from typing import Final

from gantryctl import _core
from gantryctl.drives.base import TRUTH_COLUMNS, BaseDrive, next_state, settle
from gantryctl.errors import DeviceError
from gantryctl.image import (
    DigitalInputs,
    DriveFeedback,
    DriveIdentity,
    DriveRequest,
    DriveState,
    EncoderFlag,
    OutputImage,
)
from gantryctl.ports import Truth

# Modes of the compiled scan (core/plant).
_OFF: Final = 0
_SPEED: Final = 1
_QUICK_STOP: Final = 2
_TWO_PI: Final = 6.283185307179586


class SimDrive(BaseDrive):
    """Servo drive with the gantry behind it; `write` advances both by one scan.

    To the program it is a drive like any other. A fault, an open emergency stop or missing mains takes the torque off
    and closes the brake. `trip`, `lose_turns` and the inputs are for tests and not part of the `Drive` port.

    Args:
        sim: drive loops and plant; its state moves on.
        serial: serial number of the encoder.
        counts_per_turn: fine counts per motor turn.
        turns: multiturn range of the encoder.
        limit_switch_rad: gantry angle of both limit switches, rad.
    """

    truth_columns: tuple[str, ...] = TRUTH_COLUMNS

    def __init__(
        self, sim: _core.GantrySim, serial: str, counts_per_turn: int, turns: int, limit_switch_rad: float
    ) -> None:
        self.sim = sim
        self.state = DriveState.SWITCH_ON_DISABLED
        self.encoder_flags = EncoderFlag.NONE
        self.error_code = 0
        self.estop_ok = self.mains_ready = self.enabling_switch = True
        self._identity = DriveIdentity("simulated drive", serial, counts_per_turn, turns)
        self._count_rad = _TWO_PI / counts_per_turn
        self._range_counts = counts_per_turn * turns
        self._limit_switch_rad = limit_switch_rad
        self._inputs = DigitalInputs()
        self._feedback = sim.feedback
        self._scan = sim.scan
        self._wrap_counts = 0.0
        self.power_on()

    def power_on(self) -> None:
        """Read the encoder as after mains on: only the absolute value within its range is known."""
        counts = self._feedback(self._count_rad)[0]
        self._wrap_counts = counts // self._range_counts * self._range_counts

    def identity(self) -> DriveIdentity:
        """Serial number and resolution of the encoder."""
        return self._identity

    def read(self) -> DriveFeedback:
        """State at the beginning of this scan."""
        counts, vel, torque, brake_open, limited, overload, _ = self._feedback(self._count_rad)
        return DriveFeedback(
            self.state,
            counts - self._wrap_counts,
            vel,
            torque,
            brake_open,
            limited,
            overload,
            self.encoder_flags,
            self.error_code,
            False,
            0,
            self._digital_inputs(),
            self.sim.ring_reading(),
        )

    def write(self, output: OutputImage) -> None:
        """Follow the request and advance drive and gantry by one scan."""
        # The reading of scan k is the state at k x period, its command acts from then on, and the plant advances here
        # by one period: no transport delay between controller and drive (decision 0005).
        request = output.request
        # Nearly every scan of a move needs no transition: the state machine is left out then.
        if (
            request is not DriveRequest.ENABLE
            or self.state is not DriveState.OPERATION_ENABLED
            or self.error_code
            or not (self.estop_ok and self.mains_ready)
        ):
            self._transition(request)
        state = self.state
        if state is DriveState.OPERATION_ENABLED:
            self._scan(_SPEED, output.vel_cmd_rad_s, output.torque_ff_nm, output.brake_open)
        elif state is DriveState.QUICK_STOP_ACTIVE:
            self._scan(_QUICK_STOP, 0.0, output.torque_ff_nm, output.brake_open)
        else:
            self._scan(_OFF, 0.0, 0.0, False)

    @property
    def truth_source(self) -> Truth:
        """The drive itself: it holds the plant."""
        return self

    def plant_state(self) -> dict[str, float]:
        """State of drive loops, motor, load and base."""
        return dict(self.sim.state)

    def truth(self) -> tuple[float, ...]:
        """True state of load, motor and base; see `truth_columns`."""
        return self.sim.truth()

    def close(self) -> None:
        """Torque off and brake closed; the plant advances until the load is at rest."""
        self.state = DriveState.SWITCH_ON_DISABLED
        settle(lambda: self._scan(_OFF, 0.0, 0.0, False), lambda: self.sim.truth()[1], self.sim.scan_period_s)

    def trip(self, error_code: int) -> None:
        """Raise a fault inside the drive: torque off, brake closed, until a fault reset."""
        if error_code <= 0:
            raise DeviceError(f"an error code is a number above 0, got {error_code}")
        self.error_code = error_code

    def lose_turns(self, turns: int) -> None:
        """Shift the multiturn part of the encoder, as after a fault of its gear or battery."""
        self.sim.count_offset += turns * self._identity.counts_per_turn

    def _digital_inputs(self) -> DigitalInputs:
        pos = self.sim.truth()[0]
        limit = self._limit_switch_rad
        inputs = self._inputs
        now = (self.estop_ok, self.enabling_switch, pos > -limit, pos < limit, self.mains_ready)
        if now != inputs:
            inputs = self._inputs = DigitalInputs(*now)
        return inputs

    def _transition(self, request: DriveRequest) -> None:
        powered, faulty = self.estop_ok and self.mains_ready, self.error_code != 0
        self.state = next_state(self.state, request, faulty=faulty, powered=powered)
        if self.state is not DriveState.FAULT:
            self.error_code = 0
