"""Encoder on the ring: of the drive (60E4), or a node of its own (CiA 406), as an angle of the gantry."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Final

from gantryctl.drives.canopen.bus.node import RemoteNode
from gantryctl.drives.canopen.mapping import Mapping, Pdo, Signal
from gantryctl.drives.canopen.nodes.bus_node import BusNode, communication_objects
from gantryctl.drives.canopen.process_image import SPAN_32, Unwrap
from gantryctl.drives.canopen.settings import CanopenSettings, LoadEncoderSettings
from gantryctl.errors import DeviceError

_POSITION: Final = Signal(0x6004, 0, 32, False)
_ALARMS: Final = Signal(0x6503, 0, 16, False)
_TURN: Final = 2.0 * math.pi
# A standing gantry: 0.01 deg between a telegram and an SDO read some milliseconds later.
_NOISE: Final = 36_000


class RingAngle:
    """Readings of the encoder to the angle of the gantry.

    At the start the angle within half a turn of 0 is taken, and from then on it goes on over the wrap: an encoder of
    one turn cannot tell +180 deg from -180 deg. The program takes out the turn by which it differs from the motor's
    (`LoadSide`).

    Args:
        settings: steps, zero, direction.
        range_counts: where the reading wraps.
        period_s: SYNC period.
    """

    def __init__(self, settings: LoadEncoderSettings, range_counts: int, period_s: float) -> None:
        self._settings, self._period_s = settings, period_s
        self._unwrap = Unwrap(range_counts)
        self._shift: int | None = None
        self._angle = self._vel = math.nan
        self._since = 0

    def begin(self, periods: int) -> None:
        """SYNC goes out, `periods` after the one before."""
        self._since += periods

    def read(self, raw: int, age: int) -> float:
        """Angle at this scan's SYNC, rad; NaN before the first reading.

        Args:
            raw: newest reading. age: scans since it was sampled.
        """
        if age < self._since:
            self.take(raw, self._since - age)
            self._since = age
        return self.after(age)

    def take(self, raw: int, scans: int) -> None:
        """Take a reading, so many scans after the one before."""
        settings = self._settings
        turn = settings.counts_per_turn
        counts = self._unwrap(-raw if settings.inverted else raw) - settings.zero_counts
        if self._shift is None:
            self._shift = (counts + turn // 2) % turn - turn // 2 - counts
        angle = (counts + self._shift) / turn * _TURN
        step = angle - self._angle
        self._vel = 0.0 if math.isnan(step) else step / (scans * self._period_s)
        self._angle = angle

    def after(self, scans: int) -> float:
        """Angle so many scans after the last reading, rad: it is carried on with its own speed."""
        return self._angle + self._vel * scans * self._period_s if scans else self._angle


class RingEncoder:
    """Encoder node on the SYNC of the drive.

    Args:
        remote: the node, on the link of the drive.
        settings: of the axis.
        encoder: steps, zero, direction.
        in_time: whether the scan still waits for telegrams.

    Attributes:
        node: the connection.
        angle: its readings, of the node that was opened last.
    """

    def __init__(
        self,
        remote: RemoteNode,
        settings: CanopenSettings,
        encoder: LoadEncoderSettings,
        in_time: Callable[[], bool],
    ) -> None:
        self._settings, self._encoder = settings, encoder
        mapping = Mapping((), (Pdo(0, (_POSITION, _ALARMS)),))
        objects = communication_objects(settings, watches_controller=False)
        self.node = BusNode(
            remote, settings, "encoder", mapping, objects, in_time, encoder.counts_per_turn // _NOISE
        )
        self.angle = RingAngle(encoder, SPAN_32, settings.period_s)

    def open(self) -> None:
        """Set the node up; its range is what 6501 and 6502 say.

        Raises:
            DeviceError: it cannot be set up, or its range does not hold the turn of [can.load_encoder].
        """
        self.node.open()
        sdo, encoder = self.node.remote.sdo, self._encoder
        steps, turns = sdo.read(0x6501, 0), sdo.read(0x6502, 0)
        span = int.from_bytes(steps, "little") * max(1, int.from_bytes(turns, "little"))
        if span < encoder.counts_per_turn:
            raise DeviceError(
                f"node {self.node.remote.node}: the encoder has {span} steps (6501, 6502), [can.load_encoder] "
                f"counts_per_turn says {encoder.counts_per_turn} for a turn of the axis"
            )
        self.angle = RingAngle(encoder, min(span, SPAN_32), self._settings.period_s)

    def angle_rad(self) -> float:
        """Angle at this scan's SYNC; NaN for a reading that is not to be believed."""
        watch = self.node.watch
        if self.node.lost or watch.data is None:
            return math.nan
        angle = self.angle.read(int.from_bytes(watch.data[:4], "little"), watch.age)
        return math.nan if any(watch.data[4:6]) else angle
