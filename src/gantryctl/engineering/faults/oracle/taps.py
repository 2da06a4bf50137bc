"""Taps on the ways that the truth takes: class-level patches of drives, plants and programs, for as long as wanted."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from typing import Any, Final

from gantryctl.drives.simulated import SimDrive
from gantryctl.drives.virtual.axis.plant import DrivePlant, StageMode
from gantryctl.drives.virtual.loop import DirectBus
from gantryctl.drives.virtual.node import DriveNode
from gantryctl.drives.virtual.nodes.group import NodeGroup
from gantryctl.engineering.faults.oracle import limits
from gantryctl.engineering.faults.oracle.axis_oracle import AxisOracle, Violation
from gantryctl.image import DriveState, InputImage, OutputImage
from gantryctl.program import AxisProgram
from gantryctl.runtime import Engine

_ENERGISED: Final = (DriveState.OPERATION_ENABLED, DriveState.QUICK_STOP_ACTIVE)
_COUNT_RAD: Final = 1.0
# Identifiers of CiA 301: NMT and SYNC; RPDO 1 to 4 and SDO requests; heartbeats.
_BROADCAST: Final = frozenset({0x000, 0x080})
_TO_NODE: Final = frozenset({0x200, 0x300, 0x400, 0x500, 0x600})
_HEARTBEAT: Final = 0x700
_SAMPLE_S: Final = 1e-3


class Oracle:
    """Every axis of one test, and what was found.

    What is injected is told it (`faults.inject`). Of a switch of the drive that a test sets by itself it knows nothing:
    the way counts from the alarm.
    """

    def __init__(self) -> None:
        self.violations: list[Violation] = []
        self.bounds = limits.REFERENCE
        """Of the axes from now on; a test of another axis than the reference gantry sets its own."""
        self.axes: dict[int, AxisOracle] = {}
        self._kept: list[object] = []
        self.last: tuple[Any, InputImage] | None = None

    def axis(self, plant: object) -> AxisOracle:
        """The oracle of the axis with this plant (a `SimDrive` or a `DrivePlant`)."""
        axis = self.axes.get(id(plant))
        if axis is None:
            axis = self.axes[id(plant)] = AxisOracle(self.violations.append, self.bounds)
            self._kept.append(plant)
        return axis

    def forget(self) -> None:
        """Forget the axes: a test that makes very many of them has done with these."""
        self.axes.clear()
        self._kept.clear()
        self.last = None

    def caught(self, invariant: str) -> list[Violation]:
        """Take the violations of one invariant out: a test that plants one expects them."""
        taken = [each for each in self.violations if each.invariant == invariant]
        self.violations[:] = [each for each in self.violations if each.invariant != invariant]
        return taken

    def command(self, axis: AxisOracle, output: OutputImage) -> None:
        """A command goes to the drive of an axis."""
        last = self.last
        if last is None:
            if axis.bound:
                axis.program_over = True
                axis.command(output, None)
            return
        self.last = None
        program, image = last
        if axis.program is not program:
            axis.bind(program)
        # A late scan gives the drive in process its last command again; the program goes on here.
        axis.program_over = False
        axis.command(output, image.operator)


class _Now:
    """The oracle that watches at present, if any, and how many want the taps."""

    oracle: Oracle | None = None
    taps: int = 0


def watched(plant: object) -> AxisOracle | None:
    """The axis with this plant, where an oracle watches it."""
    return None if _Now.oracle is None else _Now.oracle.axes.get(id(plant))


@contextmanager
def watching(oracle: Oracle) -> Iterator[Oracle]:
    """Every axis that moves meanwhile is judged by `oracle`."""
    before, _Now.oracle = _Now.oracle, oracle
    try:
        yield oracle
    finally:
        _Now.oracle = before


def _replace(stack: ExitStack, owner: type, name: str, made: Callable[[Any], Any]) -> None:
    """Put `made(original)` in the place of a method until the stack closes."""
    own, original = owner.__dict__.get(name), getattr(owner, name)
    setattr(owner, name, made(original))
    stack.callback(lambda: setattr(owner, name, own) if own is not None else delattr(owner, name))


@contextmanager
def tapped() -> Iterator[None]:
    """Install the taps, once however often it is asked; without an oracle that watches each costs one comparison.

    They are of the process: two axes in two threads would be one to them.
    """
    if _Now.taps:
        yield
        return
    with ExitStack() as stack:
        _Now.taps += 1
        stack.callback(_let_go)
        _replace(stack, AxisProgram, "scan", _program_scan)
        _replace(stack, Engine, "_stop_drive", _engine_stop)
        _replace(stack, SimDrive, "write", _sim_write)
        _replace(stack, DrivePlant, "scan", _plant_scan)
        with_bus(stack)
        yield


def _let_go() -> None:
    _Now.taps -= 1


def with_bus(stack: ExitStack) -> None:
    """The master of a bus, where it is installed."""
    try:
        from gantryctl.drives.canopen.drive import CanopenDrive
    except ModuleNotFoundError:
        return
    _replace(stack, CanopenDrive, "write", _bus_write)
    _replace(stack, DirectBus, "send", _bus_send)


def _program_scan(original: Callable[..., OutputImage]) -> Callable[..., OutputImage]:
    def scan(program: AxisProgram, image: InputImage) -> OutputImage:
        output = original(program, image)
        if _Now.oracle is not None:
            _Now.oracle.last = (program, image)
        return output

    return scan


def _engine_stop(original: Callable[..., Any]) -> Callable[..., Any]:
    """A scan has failed: the command that follows is the engine's, not the program's."""

    def stop(engine: Engine, failure: BaseException) -> Any:
        if _Now.oracle is not None:
            _Now.oracle.last = None
        return original(engine, failure)

    return stop


def _sim_write(original: Callable[..., None]) -> Callable[..., None]:
    def write(drive: SimDrive, output: OutputImage) -> None:
        oracle = _Now.oracle
        if oracle is None:
            original(drive, output)
            return
        axis = oracle.axes.get(id(drive))
        if axis is None:
            axis = oracle.axis(drive)
            sim = drive.sim
            axis.inside = sim.scan_period_s > 1.5 * _SAMPLE_S
            axis.begin(sim.truth()[2], sim.feedback(_COUNT_RAD)[3], drive.state in _ENERGISED)
        if drive.state not in _ENERGISED:
            axis.left()
        oracle.command(axis, output)
        original(drive, output)
        sim = drive.sim
        energised = drive.state in _ENERGISED
        if axis.inside:
            sample = axis.sample
            if (
                sim is not axis.sim
            ):  # a changed limit makes a new one, for the scan that has just been made too
                axis.sim = sim
                drive.sample_every(_SAMPLE_S)
                truth, brake_open = sim.truth(), sim.feedback(_COUNT_RAD)[3]
                for _ in range(round(sim.scan_period_s / _SAMPLE_S)):
                    sample(truth[2], truth[3], 0.0, brake_open, energised)
                return
            for angle, speed, _, _, torque, closed in sim.samples_taken():
                sample(angle, speed, torque, not closed, energised)
        else:
            truth, shown = sim.truth(), sim.feedback(_COUNT_RAD)
            axis.sample(truth[2], truth[3], shown[2], shown[3], energised)

    return write


def _plant_scan(original: Callable[..., None]) -> Callable[..., None]:
    def scan(plant: DrivePlant, mode: StageMode, *command: Any) -> None:
        oracle = _Now.oracle
        if oracle is None:
            original(plant, mode, *command)
            return
        axis = oracle.axes.get(id(plant))
        if axis is None:
            axis = oracle.axis(plant)
            axis.begin(plant.sim.truth()[2], plant.brake_open, energised=False)
        original(plant, mode, *command)
        truth = plant.sim.truth()
        axis.sample(truth[2], truth[3], plant.torque_nm, plant.brake_open, mode is not StageMode.OFF)

    return scan


def _bus_write(original: Callable[..., None]) -> Callable[..., None]:
    def write(drive: Any, output: OutputImage) -> None:
        oracle = _Now.oracle
        if oracle is not None:
            plant = getattr(drive.plant, "plant", None)
            if isinstance(plant, DrivePlant):
                oracle.command(oracle.axis(plant), output)
        original(drive, output)

    return write


def _drive_of(end: DriveNode | NodeGroup) -> tuple[DriveNode, tuple[int, ...]]:
    """The drive at the end of a bus, and the ids of all nodes there."""
    return (end.drive, end.node_ids) if isinstance(end, NodeGroup) else (end, (end.node_id,))


def _bus_send(original: Callable[..., None]) -> Callable[..., None]:
    def send(bus: DirectBus, message: Any, timeout: float | None = None) -> None:
        oracle, node = _Now.oracle, bus._node
        if oracle is not None and isinstance(node, DriveNode | NodeGroup):
            can_id = message.arbitration_id
            function, number = can_id & 0x780, can_id & 0x7F
            # A master has a number of its own for its heartbeat.
            drive, ids = _drive_of(node)
            own = function in _TO_NODE if number in ids else function == _HEARTBEAT
            axis = oracle.axes.get(id(drive.plant))
            if axis is not None and axis.bound and not (own or can_id in _BROADCAST):
                axis.say("INV-4", f"a frame of the controller with the identifier {can_id:03X}h")
        original(bus, message, timeout)

    return send
