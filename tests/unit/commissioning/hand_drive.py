"""A drive and its gantry of a few lines, for steps of commissioning by hand: what it does is written down."""

from __future__ import annotations

import math
from collections.abc import Iterator
from contextlib import contextmanager
from itertools import cycle
from types import SimpleNamespace
from typing import Any

from gantryctl.commissioning.open_loop_axis import OpenLoopAxis
from gantryctl.commissioning.results import Context, StepResult
from gantryctl.commissioning.watch import Halt, StepWatch
from gantryctl.drives.canopen.bus.sdo import SdoError
from gantryctl.engineering.report.meter import Meter
from gantryctl.image import SAFE_OUTPUT, DriveFeedback, DriveRequest, DriveState, EncoderFlag, OutputImage
from gantryctl.machine import Machine, configs_folder, load_machine, with_values
from gantryctl.runtime import Retained

MACHINE = with_values(load_machine(configs_folder() / "hust_can.toml"), {"brake.owner": "object_60FE"})
# A travel beside 0 deg, from 40 to 100; a new machine stands at 70.
AWAY = with_values(
    MACHINE,
    {
        "axis.pos_min_deg": 40.0, "axis.over_travel_min_deg": 39.0, "axis.limit_switch_min_deg": 38.0,
        "axis.mechanical_stop_min_deg": 33.0, "axis.pos_max_deg": 100.0, "axis.over_travel_max_deg": 101.0,
        "axis.limit_switch_max_deg": 102.0, "axis.mechanical_stop_max_deg": 107.0,
    },
)  # fmt: skip
PERIOD_S = 0.004
# 524 288 increments in a turn of the motor, 1144 turns of it in one of the gantry.
COUNTS_PER_DEG = 524_288 * 1144 / 360


class Objects:
    """6072, 6080 and others over SDO."""

    def __init__(self, values: dict[int, int]) -> None:
        self.values, self.keeps = values, set[int]()

    def optional(self, index: int, sub: int = 0) -> int | None:
        return self.values.get(index)

    def number(self, index: int, sub: int = 0) -> int:
        return self.values[index]

    def set(self, index: int, sub: int, value: int) -> None:
        if index not in self.values:
            raise SdoError(index, sub, 0x0602_0000)
        if index not in self.keeps:
            self.values[index] = value


class HandDrive:
    """It enables in one scan and follows at once.

    Attributes:
        way, shown: speed of the gantry, and of 606C, as part of the command.
        push: motor torque, as part of that asked for beside the speed; `torque_nm` at any speed.
        quick_dec: ramp of its quick stop, deg/s2; `after`: state and brake when it has ended.
        wrote: every output. spoil: changes the feedback.
        leashes: of the steps that have opened it, and whether it must follow.
        ways: directions in which they turn it, by their sign.
    """

    def __init__(self, **what: Any) -> None:
        self.way = self.shown = self.push = 1.0
        self.torque_nm, self.quick_dec, self.obeys, self.follows = 0.0, 5.4, True, False
        self.quick_state = DriveState.QUICK_STOP_ACTIVE
        self.spoil = lambda seen: seen
        self.__dict__.update(what)
        self.settings = SimpleNamespace(period_s=PERIOD_S, follows_bit=False, brake_close_s=0.15)
        self.link = SimpleNamespace(stepped=True, now_s=lambda: 0.0)
        self.process = SimpleNamespace(statusword=0, torque_known=True)
        self.silent_process_data = self.silent_heartbeat = self.lost = False
        self.torque_preload = self.reports_torque = True
        self.sdo = Objects({0x6072: 1498, 0x6080: 1239})
        self.node = SimpleNamespace(sdo=self.sdo)
        units = SimpleNamespace(torque_unit_nm=0.257)
        rows = [SimpleNamespace(place="608F:01", verdict="ok")]
        self.opened = SimpleNamespace(units=units, rows=rows, settings=self.settings)
        self.wrote: list[OutputImage] = []
        self.leashes: list[tuple[float, bool]] = []
        self.ways: list[float] = []
        self.deg = self.speed = self.torque = 0.0
        self.state, self.brake_open, self.quick = DriveState.SWITCH_ON_DISABLED, False, False

    def identity(self) -> SimpleNamespace:
        return SimpleNamespace(counts_per_turn=524_288)

    def write(self, output: OutputImage) -> None:
        self.wrote.append(output)
        wanted_deg_s = math.degrees(output.vel_cmd_rad_s) / 1144
        if output.request is DriveRequest.ENABLE:
            self.state, self.speed = DriveState.OPERATION_ENABLED, self.way * wanted_deg_s
        elif output.request is DriveRequest.QUICK_STOP and self.obeys:
            left = max(0.0, abs(self.speed) - self.quick_dec * PERIOD_S)
            self.state, self.speed = self.quick_state, math.copysign(left, self.speed)
        elif output.request is DriveRequest.QUICK_STOP:
            self.speed = 0.0
        elif self.state is not DriveState.FAULT or output.request is DriveRequest.FAULT_RESET:
            self.state, self.speed = DriveState.SWITCH_ON_DISABLED, 0.0
        self.torque = self.push * output.torque_ff_nm + self.torque_nm
        self.brake_open = output.brake_open and self.state is DriveState.OPERATION_ENABLED
        self.deg += self.speed * PERIOD_S

    def read(self) -> DriveFeedback:
        speed = self.shown / self.way * self.speed if self.way else 0.0
        return self.spoil(
            DriveFeedback(
                self.state,
                round(self.deg * COUNTS_PER_DEG),
                math.radians(speed) * 1144,
                self.torque,
                self.brake_open,
                False,
                0.0,
                EncoderFlag.NONE,
            )
        )

    def resume(self) -> None:
        self.lost = False

    def close(self) -> None:
        self.wrote.append(SAFE_OUTPUT)


def answering(drive: HandDrive, *times_s: float) -> HandDrive:
    """From now on its telegrams answer SYNC after these times, one after the other; infinite: too late for the scan."""
    left, read = cycle(times_s), drive.read
    drive.process.answer_times_s = kept = list[float]()

    def reads() -> DriveFeedback:
        time_s = next(left)
        if math.isfinite(time_s):
            kept.append(time_s)
        return read()

    drive.read = reads  # type: ignore[method-assign]
    return drive


def axis_of(
    drive: HandDrive,
    leash_deg: float = 10.0,
    *,
    start_deg: float = 0.0,
    following: bool = True,
    halt: Halt | None = None,
) -> OpenLoopAxis:
    watch = StepWatch(Meter(lambda line: None, 1.0, lambda: 0.0), halt or Halt())
    retained = Retained("m", "h")
    return OpenLoopAxis(
        MACHINE,
        drive,
        drive.read(),
        start_deg,
        leash_deg,
        retained,
        watch,
        following=following,  # type: ignore[arg-type]
    )


def opens(drive: HandDrive) -> Any:
    """Stands for `open_loop_axis`."""

    @contextmanager
    def opened(
        c: Context, leash_deg: float, part: str = "", *, following: bool = True, way: float = 0.0
    ) -> Iterator[OpenLoopAxis]:
        drive.leashes.append((leash_deg, following))
        drive.ways.append(way)
        yield axis_of(drive, leash_deg, following=following)

    return opened


def context(machine: Machine = MACHINE, **results: StepResult) -> Context:
    none: Any = None
    watch = StepWatch(Meter(lambda line: None, 1.0, lambda: 0.0), Halt())
    return Context(machine, none, none, results, (), lambda line: None, watch, None, "")


def enabled(**what: Any) -> tuple[HandDrive, Any]:
    """A drive and its axis, enabled, on a leash of 10 deg."""
    drive = HandDrive(**what)
    axis = axis_of(drive, 10.0)
    axis.enable()
    return drive, axis
