"""Simulated drive: CiA 402 states, brake and encoder around the compiled gantry."""

from __future__ import annotations

from collections.abc import Callable
from typing import Final, NamedTuple

from gantryctl import _core
from gantryctl._core import new_image
from gantryctl.drives.base import TRUTH_COLUMNS, BaseDrive, next_state, settle, state_for
from gantryctl.drives.faults import Faults
from gantryctl.drives.plant_values import FARTHEST_RAD, lost, with_value
from gantryctl.errors import DeviceError
from gantryctl.image import (
    DigitalInputs,
    DriveFeedback,
    DriveIdentity,
    DriveRequest,
    DriveState,
    EncoderFlag,
    LinkFlag,
    OutputImage,
)
from gantryctl.ports import Truth

# Modes of the compiled scan (core/plant).
_OFF: Final = 0
_SPEED: Final = 1
_QUICK_STOP: Final = 2
_TWO_PI: Final = 6.283185307179586
# Looked up once: an attribute of an enumeration costs 90 ns in Python 3.11, a global 14, and a scan reads six of them.
_ENABLED: Final = DriveState.OPERATION_ENABLED
_QUICK_STOPPING: Final = DriveState.QUICK_STOP_ACTIVE
_ENABLE: Final = DriveRequest.ENABLE
_NO_FLAG: Final = EncoderFlag.NONE
_NO_LINK: Final = LinkFlag.NONE
_SOUND_INPUTS: Final = DigitalInputs()


class PlantMaker(NamedTuple):
    """Parameters of the compiled gantry of a simulated drive, and the way to make it anew when one changes."""

    plant: _core.PlantParams
    drive: _core.DriveParams
    make: Callable[[_core.PlantParams, _core.DriveParams], _core.GantrySim]


class SimDrive(BaseDrive):
    """Servo drive with the gantry behind it; `write` advances both by one scan.

    To the program it is a drive like any other. A fault, an open emergency stop or missing mains takes the torque off
    and closes the brake. `faults`, `trip`, `lose_turns` and `change_plant` inject faults and are no part of the `Drive`
    port.

    Args:
        sim: drive loops and plant; its state moves on.
        maker: its parameters, for a fault that changes one.
        serial: serial number of the encoder.
        counts_per_turn: fine counts per motor turn.
        turns: multiturn range of the encoder.
        limit_switches_rad: gantry angles of the lower and the upper limit switch, rad.
    """

    truth_columns: tuple[str, ...] = TRUTH_COLUMNS

    def __init__(
        self,
        sim: _core.GantrySim,
        maker: PlantMaker,
        serial: str,
        counts_per_turn: int,
        turns: int,
        limit_switches_rad: tuple[float, float],
    ) -> None:
        self.sim = sim
        self._maker = maker
        self.state = DriveState.SWITCH_ON_DISABLED
        self.error_code = 0
        self.faults = Faults()
        # A fault was in force in the last scan: its end has to be noticed too.
        self._spoilt = False
        self._frozen_counts: float | None = None
        self._shares = (1.0, 1.0, 0.0)
        self._sample_cycles = 0
        self._identity = DriveIdentity("simulated drive", serial, counts_per_turn, turns)
        self._count_rad = _TWO_PI / counts_per_turn
        self._range_counts = counts_per_turn * turns
        self._farthest_counts = FARTHEST_RAD / self._count_rad
        self._lower_switch_rad, self._upper_switch_rad = limit_switches_rad
        self._inputs = _SOUND_INPUTS
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
        counts, vel, torque, brake_open, limited, overload, _, ring, pos_load = self._feedback(
            self._count_rad
        )
        if not -self._farthest_counts < counts < self._farthest_counts:
            raise lost(counts * self._count_rad)
        spoilt, within = self.faults.spoilt, self._lower_switch_rad < pos_load < self._upper_switch_rad
        if spoilt or self._inputs is not _SOUND_INPUTS or not within:
            self._read_inputs(pos_load)
        reading = new_image(
            DriveFeedback,
            self.state,
            counts - self._wrap_counts,
            vel,
            torque,
            brake_open,
            limited,
            overload,
            _NO_FLAG,
            self.error_code,
            False,
            0,
            self._inputs,
            ring,
            _NO_LINK,
            "",
            None,
            0,
            0,
            True,
            0.0,
            -1,
        )
        return self._spoilt_reading(reading) if spoilt else reading

    def write(self, output: OutputImage) -> None:
        """Follow the request and advance drive and gantry by one scan."""
        # The reading of scan k is the state at k x period, its command acts from then on, and the plant advances here
        # by one period: no transport delay between controller and drive (decision 0005).
        if self._spoilt or self.faults.spoilt:
            self._write_spoilt(output)
            return
        request = output.request
        # Nearly every scan of a move needs no transition: the state machine is left out then.
        if request is not _ENABLE or self.state is not _ENABLED or self.error_code:
            self._transition(request)
        state = self.state
        if state is _ENABLED:
            self._scan(_SPEED, output.vel_cmd_rad_s, output.torque_ff_nm, output.brake_open)
        elif state is _QUICK_STOPPING:
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

    @property
    def plant_params(self) -> _core.PlantParams:
        """Parameters of the plant in force."""
        return self._maker.plant

    def sample_every(self, period_s: float) -> None:
        """Take samples of the true state inside each scan (`GantrySim.samples_taken`), each so many whole cycles."""
        self._sample_cycles = max(1, round(period_s / self._maker.drive.cycle_s))
        self.sim.sample_every(self._sample_cycles)

    def change_plant(self, name: str, value: float) -> None:
        """Change a plant parameter, as the load changes when a couch is dropped into it.

        Raises:
            UsageError: no such parameter, or a value that no plant can have.
        """
        self._maker = self._maker._replace(plant=with_value(self._maker.plant, name, value))
        self._remake()

    def _read_inputs(self, pos_load_rad: float) -> None:
        faults = self.faults
        minus_ok, plus_ok = pos_load_rad > self._lower_switch_rad, pos_load_rad < self._upper_switch_rad
        now = DigitalInputs(
            faults.estop_ok, faults.enabling_switch, minus_ok, plus_ok, faults.mains_ready,
            faults.collision_ok, faults.door_ok, faults.estop_ok_2, faults.motion_permit,
        )  # fmt: skip
        # The object of the scan before, while nothing has changed: whoever watches it compares no more than that.
        if now != self._inputs:
            self._inputs = _SOUND_INPUTS if now == _SOUND_INPUTS else now

    def _transition(self, request: DriveRequest) -> None:
        powered, faulty = self.faults.powered, self.error_code != 0
        if self.faults.stuck_state and (request is DriveRequest.FAULT_RESET or (powered and not faulty)):
            return
        self.state = next_state(self.state, request, faulty=faulty, powered=powered)
        if self.state is not DriveState.FAULT:
            self.error_code = 0

    # --- with a fault in force -----------------------------------------------------------------------------------

    def _spoilt_reading(self, reading: DriveFeedback) -> DriveFeedback:
        faults = self.faults
        counts, vel = reading.pos_act_counts, reading.vel_act_rad_s
        if faults.freeze_position:
            if self._frozen_counts is None:
                self._frozen_counts = counts
            counts, vel = self._frozen_counts, 0.0
        inputs = reading.inputs
        if faults.limit_minus_ok is not None:
            inputs = inputs._replace(limit_minus_ok=faults.limit_minus_ok)
        if faults.limit_plus_ok is not None:
            inputs = inputs._replace(limit_plus_ok=faults.limit_plus_ok)
        ignores = faults.ignore_target and self.state is _ENABLED
        return reading._replace(
            pos_act_counts=counts + faults.position_offset,
            vel_act_rad_s=vel if faults.velocity_reading is None else faults.velocity_reading,
            torque_act_nm=reading.torque_act_nm + faults.torque_offset,
            brake_open=reading.brake_open if faults.brake_feedback is None else faults.brake_feedback,
            encoder=EncoderFlag(faults.encoder_flags),
            warning=faults.warning,
            inputs=inputs,
            motor_temp_c=faults.motor_temp_c,
            link=LinkFlag.IGNORES_COMMAND if ignores else LinkFlag.NONE,
        )

    def _write_spoilt(self, output: OutputImage) -> None:
        faults = self.faults
        self._spoilt = bool(faults.spoilt)
        self._apply_levels()
        self._transition(output.request)
        state = self.state
        mode, vel, torque, brake_open = _OFF, 0.0, 0.0, False
        if state in (_ENABLED, _QUICK_STOPPING):
            brake_open = output.brake_open
            torque = faults.command_sign * output.torque_ff_nm
            mode, vel = self._spoilt_command(output)
        if faults.no_torque:
            mode = _OFF
        if faults.brake is not None:
            brake_open = faults.brake == "open"
        self._scan(mode, vel, torque, brake_open)

    def _spoilt_command(self, output: OutputImage) -> tuple[int, float]:
        """Mode of the compiled scan and its speed command while there is torque."""
        faults = self.faults
        # The last figure of the feedback is the speed set-point of the drive in the last scan.
        if self.state is _QUICK_STOPPING:
            return (
                (_SPEED, self._feedback(self._count_rad)[6]) if faults.quick_stop_off else (_QUICK_STOP, 0.0)
            )
        if faults.ignore_target:
            return _SPEED, self._feedback(self._count_rad)[6]
        if faults.never_move:
            return _QUICK_STOP, 0.0
        return _SPEED, faults.command_sign * output.vel_cmd_rad_s

    def _apply_levels(self) -> None:
        """Hand what changes the compiled gantry to it."""
        faults, sim = self.faults, self.sim
        if not faults.freeze_position:
            self._frozen_counts = None
        shares = (faults.torque_limit_share, faults.brake_torque_share, faults.brake_close_slow_s)
        if shares != self._shares:
            self._shares = shares
            self._remake()
            sim = self.sim
        if faults.encoder_gain != sim.encoder_gain:
            sim.encoder_gain = faults.encoder_gain

    def _remake(self) -> None:
        """Put the state into a gantry with other parameters: those of the compiled one are fixed."""
        limit, grip, slow_s = self._shares
        plant, drive = self._maker.plant.copy(), self._maker.drive.copy()
        drive.torque_max_nm *= limit
        drive.brake_close_s += slow_s
        plant.brake_torque_nm *= grip
        state = self.sim.state
        self.sim = self._maker.make(plant, drive)
        self.sim.state = state_for(state, plant.brake_presliding_rad)
        self.sim.sample_every(self._sample_cycles)
        self._feedback, self._scan = self.sim.feedback, self.sim.scan
