"""Ports of the scan engine: interfaces to drive, operator, program, clock and recorder."""

from __future__ import annotations

from typing import NamedTuple, Protocol, runtime_checkable

from gantryctl.image import DriveFeedback, DriveIdentity, InputImage, LinkHealth, OperatorCommand, OutputImage


# No port reads a clock except `Clock`: the same images make the same outputs again (decision 0005).
@runtime_checkable
class Drive(Protocol):
    """A servo drive with its motor, encoder, brake and hard-wired inputs.

    One scan is `read()` then `write()`. A simulated drive advances its plant by one scan period inside `write()`;
    a real one sends and returns at once. `drives.base.BaseDrive` answers everything that a drive without a bus
    need not know.
    """

    @property
    def refusals(self) -> tuple[str, ...]:
        """Why this drive may not be enabled; () when nothing forbids it."""
        ...

    @property
    def torque_preload(self) -> bool:
        """The drive takes a torque beside the speed, and reports its torque."""
        ...

    @property
    def reports_torque(self) -> bool:
        """The drive reports its torque; without it `torque_act_nm` is 0."""
        ...

    @property
    def lost(self) -> bool:
        """The drive must be set up again before it may be enabled: restarted, disconnected, or changed."""
        ...

    @property
    def truth_source(self) -> Truth | None:
        """The simulated load behind the drive; None for a real one."""
        ...

    def set_up_again(self) -> None:
        """Set a lost drive up, between two scans and with power off; raises DeviceError where that fails."""
        ...

    def health(self) -> LinkHealth | None:
        """State of the connection; None without a bus."""
        ...

    def plant_state(self) -> dict[str, float]:
        """State of a simulated plant in this process, from which a later run goes on; {} for any other."""
        ...

    def identity(self) -> DriveIdentity:
        """Identity of the connected drive; raises DeviceError when it cannot be read."""
        ...

    def read(self) -> DriveFeedback:
        """State at the beginning of this scan."""
        ...

    def write(self, output: OutputImage) -> None:
        """Send the command of this scan."""
        ...

    def close(self) -> None:
        """Leave the drive without torque and with the brake closed; may be called twice."""
        ...


@runtime_checkable
class Truth(Protocol):
    """True state of a simulated load; for traces and instruments, never part of an input image."""

    # A controller that knew the plant would remove the load error without merit (decision 0010).

    truth_columns: tuple[str, ...]
    """Column names as in the trace, e.g. pos_load_rad, vel_load_rad_s, pos_base_rad, torque_mesh_nm."""

    def truth(self) -> tuple[float, ...]:
        """True state at the beginning of this scan, in the order of `truth_columns`."""
        ...


class Operator(Protocol):
    """Source of commands: a command line, a script, the gateway."""

    def poll(self, time_s: float) -> OperatorCommand:
        """Command levels valid in this scan."""
        ...


class Program(Protocol):
    """PLC program: one call per scan, a pure function of its retained state and the image."""

    trace_columns: tuple[str, ...]

    def scan(self, image: InputImage) -> OutputImage:
        """Compute the outputs of one scan."""
        ...

    def trace_row(self) -> tuple[float, ...]:
        """Values of the last scan, in the order of `trace_columns`."""
        ...


class ScanStart(NamedTuple):
    """Start of a scan by its clock."""

    deadline: int
    """Deadline at which it begins; a later one than requested where that was missed."""
    late_s: float
    """Delay after the requested deadline, s."""


# Missed scans are never caught up: a real axis goes on meanwhile, and the next scan has the number of its deadline.
class Clock(Protocol):
    """Pace of the scans: virtual (returns at once) or real (absolute deadlines, numbered, one a period)."""

    def start(self) -> None:
        """Time zero of the first scan."""
        ...

    def wait_for(self, deadline: int) -> ScanStart:
        """Wait until `deadline`, or the first later one that can be met."""
        ...

    def elapsed_s(self) -> float:
        """Seconds since the start of the present scan; 0 in virtual time."""
        ...


class Recorder(Protocol):
    """Recording with one row per scan."""

    def record(self, row: tuple[float, ...]) -> None:
        """Append one row; the columns are fixed at construction."""
        ...

    def close(self) -> None:
        """Finish the recording; may be called twice."""
        ...
