"""Process image of one drive: bytes of the telegrams to quantities and back."""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Callable
from typing import Final

from gantryctl.drives.canopen import mapping as m
from gantryctl.drives.canopen.bus.node import RemoteNode
from gantryctl.drives.canopen.diagnostics import TpdoWatch
from gantryctl.drives.canopen.mapping import Mapping, Pdo, Signal
from gantryctl.drives.canopen.scaling import BusUnits
from gantryctl.drives.canopen.settings import CanopenSettings
from gantryctl.image import EncoderFlag

_TIMES_KEPT: Final = 5000
# A position whose telegram is missing goes on with its last speed for this time: an old reading in the position loop
# is a step of the speed command (decision 0012). After that the program stops the axis (CAN-03).
_CARRIED_S: Final = 0.030


# Way within a scan, in increments, below which the age of a position makes no difference.
_WAY_MIN: Final = 1.0


# 6064 is a 32-bit number; some drives wrap it at their multiturn range instead (CiA 402 leaves it open).
SPAN_32: Final = 1 << 32


# Jumps that differ by less than this part of the range, or are smaller, lie too near to what an axis may turn through
# between two readings: the first of them counts.
_APART: Final = 8


class Unwrap:
    """Turn a wrapping position into a continuous one.

    The first reading is put into `0..range - 1`, where 0 is the end of the range: that is all that an absolute encoder
    knows. From then on the smallest step that explains the next reading counts: without a wrap, over the 32-bit wrap,
    or over the multiturn wrap.

    Args:
        range_counts: multiturn range in the unit of 6064; what does not fit 32 bits is wrapped there.
        around_zero: 6064 runs from minus half the range to plus half, not from 0.

    Attributes:
        range_counts: after so many increments the reading is the same again.
    """

    def __init__(self, range_counts: int, around_zero: bool = False) -> None:
        span = min(range_counts, SPAN_32)
        self.range_counts, self._low = span, -(span // 2) if around_zero else 0
        self._jumps = (0, *_jumps(span, around_zero))
        self._raw: int | None = None
        self._counts = 0

    def __call__(self, raw: int) -> int:
        """Continuous position of a reading."""
        last, self._raw = self._raw, raw
        if last is None:
            self._counts = (raw - self._low) % self.range_counts
        else:
            self._counts += min((raw - last + jump for jump in self._jumps), key=abs)
        return self._counts


def _jumps(span: int, around_zero: bool) -> tuple[int, ...]:
    """Steps of 6064 that are no motion."""
    # A range beyond 2^31 from 0 on wraps twice in 32 bits with a sign: in its middle, and by the rest at its end.
    at_the_end = SPAN_32 - span if span > SPAN_32 // 2 and not around_zero else span
    found: list[int] = []
    for jump in (at_the_end, SPAN_32) if around_zero else (SPAN_32, at_the_end):
        if all(abs(jump - other) * _APART > span for other in (0, *found)):
            found.append(jump)
    return tuple(sign * jump for jump in found for sign in (1, -1))


def unwrap_of(settings: CanopenSettings) -> Unwrap:
    """Unwrapping of a drive's 6064."""
    return Unwrap(settings.increments_per_turn * settings.turns, settings.position_around_zero)


class ProcessImage:
    """Telegrams of every scan and the quantities in them.

    Args:
        node: takes and sends frames.
        settings: range of the encoder, bits of the inputs.
        units: conversions.
        mapping: objects of each telegram.
        others: telegrams of the nodes beside the drive, which answer the same SYNC.
        before: process image of an earlier set-up of this drive: the position goes on from where it was.

    Attributes:
        watches: one per TPDO.
        answer_times_s: from SYNC to the last of its answers, of the latest scans with all answers.
        counts: continuous position of the last telegram in increments, in the gantry's direction.
        congested: more frames wait than the scan takes; no telegram is believed before all have been read.
        crowded: frames of others take a good part of the bus.
    """

    def __init__(
        self,
        node: RemoteNode,
        settings: CanopenSettings,
        units: BusUnits,
        mapping: Mapping,
        others: tuple[TpdoWatch, ...] = (),
        before: ProcessImage | None = None,
    ) -> None:
        self._node, self._units = node, units
        self._period_s = settings.period_s
        # Pre-defined connection set of CiA 301: RPDO n at 200h + n * 100h, TPDO n at 180h + n * 100h, plus the node
        # id.
        self._identifiers = [0x200 + 0x100 * pdo.number + settings.node for pdo in mapping.rpdos]
        self._rpdos = mapping.rpdos
        self.watches = tuple(TpdoWatch(pdo.size, settings.period_s) for pdo in mapping.tpdos)
        self._neighbours = others
        self._awaited = (*self.watches, *others)
        self._first = self.watches[0]
        self._speed = self.watches[_telegram_of(m.VELOCITY, mapping)]
        self._others = self.watches[1:] or self.watches
        self._encoder, self._encoder_bits = m.encoder_signal(settings), settings.encoder
        self._fields = tuple(_fields(pdo) for pdo in mapping.tpdos)
        self._unwrap: Unwrap = unwrap_of(settings) if before is None else before._unwrap
        mapped = mapping.signals
        self.torque_offset = m.TORQUE_OFFSET in mapped
        self.torque_known = m.TORQUE in mapped
        self._has_velocity = m.VELOCITY in mapped
        self._raw: dict[Signal, int] = {}
        self.counts = 0
        self.answer_times_s: deque[float] = deque(maxlen=_TIMES_KEPT)
        self._counts_before: int | None = None
        self._vel_rad_s = 0.0
        self._span_s = settings.period_s
        self._expected_from, self._periods = 0, 1
        self.in_time = self.congested = self.crowded = False
        """The scan still waits for telegrams; frames that could not be read in time wait before them."""
        self._ring = self.watches[_telegram_of(m.RING_POSITION, mapping)]
        for number, (pdo, watch) in enumerate(zip(mapping.tpdos, self.watches, strict=True)):
            node.listen(0x180 + 0x100 * pdo.number + settings.node, self._taker(number, watch))
        for can_id in self._identifiers:
            node.reserve(can_id)
        # 606C by SDO, while telegrams are missing, and the scan in which it was asked for.
        self._read_speed, self._read_scan = 0, -math.inf

    def _taker(self, number: int, watch: TpdoWatch) -> Callable[[bytes], None]:
        def take(data: bytes) -> None:
            # Behind frames that could not be read in time there may be several telegrams of one SYNC after another:
            # which of them is how old cannot be told.
            if self.congested:
                watch.pass_over()
            elif watch.take(data, self.in_time):
                self._unpack(number, data)

        return take

    def _unpack(self, number: int, data: bytes) -> None:
        raw = self._raw
        for signal, start, stop in self._fields[number]:
            raw[signal] = int.from_bytes(data[start:stop], "little", signed=signal.signed)
        if number == 0:
            self.counts = self._unwrap(self._units.sign * raw[m.POSITION])

    def take_position(self, raw: int) -> None:
        """Take a 6064 that came by SDO while there are no telegrams."""
        self.counts = self._unwrap(self._units.sign * raw)

    @property
    def takes_speed(self) -> Callable[[int, int], None] | None:
        """Takes a 606C that was asked for by SDO in a scan; None where the speed comes from 6064."""
        return self._take_speed if self._has_velocity else None

    def _take_speed(self, raw: int, scan: int) -> None:
        self._read_speed, self._read_scan = raw, scan

    def forget(self) -> None:
        """Invalidate all telegrams until the next ones; the position goes on from where it was."""
        for watch in self.watches:
            watch.forget()

    # --- the cycle ---------------------------------------------------------------------------------------------

    def begin(self, periods: int) -> None:
        """SYNC goes out, `periods` after the one before."""
        self._counts_before = self.counts if self.complete else None
        self._expected_from, self._periods = self.position, periods
        for watch in self.watches:
            watch.begin(periods, crowded=self.crowded)
        self._span_s = self._first.age * self._period_s

    def collect(self, answer_s: float) -> None:
        """Wait for the answers to SYNC, at most `answer_s`; dispatch every other frame meanwhile."""
        link = self._node.link
        end = link.now_s() + answer_s
        self.in_time = True
        try:
            while self._waits():
                frame = link.receive(max(0.0, end - link.now_s()))
                if frame is None:
                    break
                self._node.dispatch(frame)
                # Frames of others that wait in a row must not hold up the scan either.
                if link.now_s() > end:
                    break
        finally:
            self.in_time = False
        if not self._waits():
            self.answer_times_s.append(link.now_s() - end + answer_s)
        for number, watch in enumerate(self.watches):
            if (answer := watch.settle()) is not None:
                self._unpack(number, answer)
        for watch in self._neighbours:
            watch.settle()
        if self._first.behind and not self._first.age:
            self._first.age = self._age_by_way(self._first.behind)
        # Without 606C, or its telegram, the speed is the difference of 6064 over the time between two telegrams.
        if (
            (self._speed.age or not self._has_velocity)
            and self._counts_before is not None
            and not self._first.age
        ):
            step = self.counts - self._counts_before
            self._vel_rad_s = step / self._span_s * self._units.rad_per_increment

    def _waits(self) -> bool:
        """An answer to this SYNC is still to come."""
        for watch in self._awaited:  # noqa: SIM110 - asked after every frame: a generator costs twice as much
            if watch.waiting:
                return True
        return False

    def _age_by_way(self, behind: int) -> int:
        """Age of a position, in scans, that may answer one of some earlier SYNCs.

        The bus keeps the order of a drive's telegrams: one that was held up comes in the place of the next. Nothing in
        it says which SYNC it answers, but the axis has gone on by a known way since.
        """
        way = self.vel_rad_s / self._units.rad_per_increment * self._period_s
        lacking = self._expected_from + self._periods * way - self.counts
        # At rest they are all the same.
        return min(behind, max(0, round(lacking / way))) if abs(way) >= _WAY_MIN else 0

    def send(self, word: int, vel_rad_s: float, torque_nm: float, outputs: int) -> None:
        """Send the RPDOs."""
        values = {
            m.CONTROLWORD: word,
            m.TARGET_VELOCITY: self._units.velocity(vel_rad_s),
            m.TORQUE_OFFSET: self._units.torque(torque_nm),
            m.OUTPUTS: outputs,
        }
        for can_id, pdo in zip(self._identifiers, self._rpdos, strict=True):
            data = b"".join(
                values[signal].to_bytes(signal.bits // 8, "little", signed=signal.signed)
                for signal in pdo.signals
            )
            self._node.link.send(can_id, data)

    # --- quantities --------------------------------------------------------------------------------------------

    @property
    def complete(self) -> bool:
        """Every TPDO has been received at least once."""
        return all(watch.data is not None for watch in self.watches)

    @property
    def age(self) -> int:
        """Age of state, position and torque, in scans."""
        return self._first.age

    @property
    def speed_age(self) -> int:
        """Age of 606C, in scans; of a drive without it that of the position, from which the speed comes then."""
        age = self._speed.age if self._has_velocity else self._first.age
        return age and int(min(age, self._node.scan - self._read_scan))

    @property
    def inputs_age(self) -> int:
        """Age of the telegrams behind the first, in scans: inputs, brake contact, status of the encoder."""
        return max(watch.age for watch in self._others)

    @property
    def encoder_flags(self) -> EncoderFlag:
        """Status of the encoder, where the drive has an object for it."""
        bits, signal = self._encoder_bits, self._encoder
        if signal is None or not (word := self._raw.get(signal, 0)):
            return EncoderFlag.NONE
        flags = EncoderFlag.NONE
        for bit, flag in (
            (bits.checksum_error, EncoderFlag.CRC_ERROR),
            (bits.alarm, EncoderFlag.ALARM),
            (bits.warning, EncoderFlag.WARNING),
            (bits.battery, EncoderFlag.BATTERY),
        ):
            if bit >= 0 and word >> bit & 1:
                flags |= flag
        return flags

    @property
    def wrong_lengths(self) -> int:
        """Telegrams of the wrong length in a row, of the worst TPDO."""
        return max(watch.wrong_in_row for watch in self.watches)

    @property
    def contradicted(self) -> int:
        """Telegrams that contradict another one of the same SYNC."""
        return sum(watch.contradicted for watch in self._awaited)

    @property
    def silence(self) -> int:
        """Scans without any telegram."""
        return min(watch.age for watch in self.watches)

    @property
    def position(self) -> int:
        """6064, continuous, extrapolated to this scan's SYNC."""
        late_s = min(self._first.age * self._period_s, _CARRIED_S)
        if late_s == 0.0:
            return self.counts
        return self.counts + round(self.vel_rad_s * late_s / self._units.rad_per_increment)

    @property
    def statusword(self) -> int:
        """6041."""
        return self._raw.get(m.STATUSWORD, 0)

    @property
    def vel_rad_s(self) -> float:
        """606C, by telegram or SDO, or differences of 6064; motor side."""
        age = min(self._speed.age, self._first.age)
        if age and self._node.scan - self._read_scan < age:
            return self._read_speed * self._units.rad_s_per_unit
        if self._has_velocity and self._speed.age <= self._first.age:
            return self._raw[m.VELOCITY] * self._units.rad_s_per_unit
        return self._vel_rad_s

    @property
    def torque_nm(self) -> float:
        """6077; 0 where it cannot be mapped."""
        return self._raw.get(m.TORQUE, 0) * self._units.nm_per_unit

    @property
    def error_code(self) -> int:
        """603F, where it is mapped."""
        return self._raw.get(m.ERROR, 0)

    @property
    def input_word(self) -> int | None:
        """60FD; None where it is not mapped."""
        return self._raw.get(m.INPUTS)

    @property
    def ring(self) -> tuple[int, int]:
        """60E4:01 and its age in scans, where it is mapped."""
        return self._raw.get(m.RING_POSITION, 0), self._ring.age


def _fields(pdo: Pdo) -> tuple[tuple[Signal, int, int], ...]:
    """Each signal with its first byte and the byte behind its last."""
    found, at = [], 0
    for signal in pdo.signals:
        found.append((signal, at, at + signal.bits // 8))
        at += signal.bits // 8
    return tuple(found)


def _telegram_of(signal: Signal, mapping: Mapping) -> int:
    """Number of the telegram that a signal comes with; 0, the first, for one that is not mapped."""
    return next((n for n, pdo in enumerate(mapping.tpdos) if signal in pdo.signals), 0)
