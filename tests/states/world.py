"""The real program, with the real operator of the service or a panel, in front of a stub drive: one event a scan.

Time stands still for the operator's clock except where an event lets people fall silent.
"""

from __future__ import annotations

from typing import Any, Final

from gantryctl.image import InputImage, Mode, OutputImage
from gantryctl.machine import default_machine
from gantryctl.program import Axis, GantryProgram
from gantryctl.program.monitors.torque_model import TorqueModel
from gantryctl.program.settings import AxisSettings
from gantryctl.service.command.inbox import Inbox
from gantryctl.service.command.operator import ServiceOperator
from gantryctl.service.command.permit import Permit
from gantryctl.service.protocol.messages import Identity, to_record
from states.abstraction import Roots, kept
from states.brief_settings import PERIOD_S
from states.people import NOTHING, PANEL, Event, Journal, Now, Panel, Wire
from states.snapshot import Keeper
from states.stub_drive import StubDrive
from support.marks import newest_mark

# Longer than the holder of control may be silent, and than anything stays armed.
_SILENCE_S: Final = 11.0
_EPOCH: Final = 10
_MACHINE: Final = default_machine()
# These name the lease of the key that is held; a press has a new one, made from the number of its message.
_OF_THE_HELD_KEY: Final = ("renew", "release")


class Unlearned(TorqueModel):
    """A torque model that learns nothing: its knowledge is a number without end, and judges a dragging brake only."""

    def add(self, *_: float) -> None:
        """Take no sample."""


class World:
    """One axis with everything that a state consists of.

    Args:
        people: the operator of the service takes commands from people; else a panel gives levels.

    Attributes:
        output: of the last scan. image: its input.
    """

    def __init__(self, config: AxisSettings, *, people: bool) -> None:
        self.drive, self.now = StubDrive(), Now()
        axis = self.axis = Axis(config, 0.0)
        axis.monitors.drag.model = Unlearned(config.law.ratio, config.power.torque_rated_nm)
        self.program = GantryProgram(axis, service=not people)
        self.panel, self.operator = Panel(), None
        self.wires = Wire(), Wire()
        if people:
            journal: Any = Journal()
            self.inbox = Inbox(self.wires, (Wire(), Wire()), journal)
            self.operator = ServiceOperator(
                _MACHINE,
                self.program,
                self.inbox,
                Permit(axis, journal, journal),
                lambda *_: None,
                self.panel.levels._replace(mode=Mode.NONE),
                epoch=_EPOCH,
                now=self.now,
            )
        self.source = self.operator or self.panel
        self.roots = Roots(self.program, self.source, self.drive, self.now)
        self.keeper = Keeper(self.roots.all, kept)
        self.output = OutputImage()
        self._seq = 0
        # The first reading has nothing before it to be compared with.
        self.scan(NOTHING)

    def scan(self, event: Event) -> OutputImage:
        """One scan of operator, program and drive, in which `event` happens."""
        self._happen(event)
        axis, operator = self.axis, self.operator
        scan = axis.scan + 1
        levels = self.panel.levels if operator is None else operator.poll(scan * PERIOD_S)
        self.image = InputImage(scan, scan * PERIOD_S, self.drive.read(axis), levels)
        self.output = self.program.scan(self.image)
        if operator is not None:
            operator.settle()
        self.drive.advance(self.output, axis)
        return self.output

    def _happen(self, event: Event) -> None:
        drive = self.drive
        if event.drive is not None:
            drive.happen(event.drive)
        if event.silence:
            self.now.time_s += _SILENCE_S
        if self.operator is None:
            self.panel.do(event, drive.pos_rad)
        elif event.who is not None:
            self._send(event, event.who, self.operator)

    def _send(self, event: Event, who: Identity, operator: ServiceOperator) -> None:
        self._seq += 1
        operator.frames.tick(operator.now())
        raw: dict[str, Any] = {
            "type": event.kind,
            "seq": self._seq,
            "frame": newest_mark(operator, who.client),
            **dict(event.values),
        }
        if event.kind not in ("alive", "stop", "quick_stop", "release"):
            raw["epoch"] = operator.authority.epoch - (1 if event.old else 0)
        if event.kind == "jog":
            raw["lease"] = f"{self._seq:016x}"
        elif event.kind in _OF_THE_HELD_KEY:
            raw["lease"] = operator.hold._lease or f"{0:016x}"
        self.wires[0].put(to_record(who, raw))

    def parts(self, event: Event) -> tuple[Event, ...]:
        """The scans that an event takes: one, but for the buttons of the panel."""
        return self.panel.parts(event) if self.operator is None else (event,)

    def can(self, event: Event) -> bool:
        """Whether an event would be judged in this scan: no command waits before it, and no gap is due."""
        if self.operator is None:
            return self.panel.can(event)
        return event.stops or event.who is None or not (self.operator._gap or self.inbox.others)

    @property
    def holder(self) -> Identity | None:
        """Who has control; at a panel whoever stands before it."""
        return PANEL if self.operator is None else self.operator.authority.holder

    @property
    def wants_power(self) -> bool:
        """The level of power."""
        return self.source.levels.power
