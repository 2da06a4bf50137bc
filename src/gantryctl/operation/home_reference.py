"""Absolute reference: from a raw encoder reading to an angle, and its verdict after power-off."""

from __future__ import annotations

from enum import Enum
from fractions import Fraction
from typing import Final, NamedTuple, assert_never

from gantryctl.image import DriveIdentity
from gantryctl.program import Code
from gantryctl.program.alarms.reason import ClearedBy, Reason
from gantryctl.program.alarms.words import Said, Words
from gantryctl.runtime import Retained
from gantryctl.units import within_turn

# Settling of gears and brake: accepted, and logged from a thousandth of a degree on (fault catalogue A11, A12).
ACCEPTED_DEG: Final = 0.05
SHOWN_DEG: Final = 0.001
# Beyond this nothing tells a motion from lost turns: only the witness mark does (A13).
AMBIGUOUS_DEG: Final = 1.0


class RestVerdict(Enum):
    """Result of comparing the reading with the stored rest position."""

    OK = "ok"
    NO_ZERO = "no zero offset stored"
    OTHER_ENCODER = "another encoder"
    WRAP = "the encoder's range ends too near the travel"
    TURNS = "whole motor turns off"
    MOVED = "moved while off, to be acknowledged"
    NOT_VALID = "moved while off, position not valid"


class AbsoluteReading(NamedTuple):
    """An encoder reading and its meaning.

    Attributes:
        raw_counts: fine counts within the multiturn range. single_turn, multi_turn: the same in coarse steps and
            turns. angle_deg: gantry angle, None without a zero offset.
        moved_deg: way since the axis was left, the shorter way round the encoder's range; None if unknown.
        margin_minus_deg, margin_plus_deg: from the travel's ends to the wrap of the encoder's range; None also for a
            modulo axis.
    """

    serial: str
    raw_counts: int
    single_turn: int
    multi_turn: int
    angle_deg: float | None
    moved_deg: float | None
    margin_minus_deg: float | None
    margin_plus_deg: float | None
    verdict: RestVerdict


class EncoderScale(NamedTuple):
    """Sizes of encoder and travel.

    Attributes:
        ratio: motor turns per gantry turn. coarse_per_turn: EnDat steps per motor turn.
        pos_min_deg, pos_max_deg: the travel. stops_deg: mechanical stops; no reading beyond them can be true.
        wrap_margin_min_deg: from the travel to the wrap of the range, at least.
        axis_turn_counts: exact counts of a turn of a modulo axis; None for a linear one.
    """

    identity: DriveIdentity
    ratio: float
    coarse_per_turn: int
    pos_min_deg: float
    pos_max_deg: float
    stops_deg: tuple[float, float]
    wrap_margin_min_deg: float
    axis_turn_counts: Fraction | None = None

    @property
    def range_counts(self) -> int:
        """Fine counts in the whole multiturn range."""
        return self.identity.counts_per_turn * self.identity.turns

    @property
    def deg_per_count(self) -> float:
        """Gantry angle of a fine count."""
        return 360.0 / (self.identity.counts_per_turn * self.ratio)

    @property
    def turn_deg(self) -> float:
        """Gantry angle of a motor turn."""
        return 360.0 / self.ratio

    def centred(self, counts: float) -> float:
        """A difference of readings by the shorter way round the range, counts."""
        # A rule of the machine file keeps travel and wrap margins inside the range, so the shorter way is the true one.
        half = self.range_counts / 2
        return (counts + half) % self.range_counts - half

    @property
    def middle_counts(self) -> float:
        """From the count at 0 deg to that in the middle of travel."""
        return 0.5 * (self.pos_min_deg + self.pos_max_deg) / self.deg_per_count

    def unwrapped(self, raw_counts: float, zero_counts: int, rest_counts: int | None = None) -> float:
        """The reading on the branch on which the axis stands, counts.

        That is the one within half the range of the middle of travel; of a modulo axis, whose encoder wraps at any
        angle, the one within half the range of where it rested.
        """
        if self.axis_turn_counts is not None:
            rest = raw_counts if rest_counts is None else rest_counts
            return rest + self.centred(raw_counts - rest)
        middle = zero_counts + self.middle_counts
        return middle + self.centred(raw_counts - middle)


def judge_reference(scale: EncoderScale, raw_counts: float, retained: Retained | None) -> AbsoluteReading:
    """Compare a reading after power-on with the retained memory (fault catalogue A9 to A14)."""
    counts = int(raw_counts)
    per_turn = scale.identity.counts_per_turn
    step = per_turn // scale.coarse_per_turn
    angle = moved = minus = plus = None
    zero = retained.zero_offset_counts if retained is not None else None
    if zero is not None:
        assert retained is not None
        from_zero = scale.unwrapped(raw_counts, zero, retained.rest_position_counts) - zero
        angle = from_zero * scale.deg_per_count
        if scale.axis_turn_counts is not None:
            angle = within_turn(angle, scale.pos_min_deg, 360.0)
    if zero is not None and scale.axis_turn_counts is None:
        # 0 deg itself may lie outside the range.
        half_travel_deg = 0.5 * (scale.pos_max_deg - scale.pos_min_deg)
        below = (zero + scale.middle_counts) % scale.range_counts
        minus = below * scale.deg_per_count - half_travel_deg
        plus = (scale.range_counts - below) * scale.deg_per_count - half_travel_deg
    if retained is not None and retained.rest_position_counts is not None:
        moved = scale.centred(raw_counts - retained.rest_position_counts) * scale.deg_per_count
    reading = AbsoluteReading(
        serial=scale.identity.encoder_serial,
        raw_counts=counts,
        single_turn=counts % per_turn // step,
        multi_turn=counts // per_turn,
        angle_deg=angle,
        moved_deg=moved,
        margin_minus_deg=minus,
        margin_plus_deg=plus,
        verdict=RestVerdict.OK,
    )
    return reading._replace(verdict=_verdict(scale, retained, reading))


def _verdict(scale: EncoderScale, retained: Retained | None, reading: AbsoluteReading) -> RestVerdict:
    """The first verdict that applies."""
    # In this order: without a zero or with another encoder the numbers below mean nothing. What cannot be proven is
    # not valid: an ambiguity is no proof.
    angle, moved = reading.angle_deg, reading.moved_deg
    if angle is None:
        return RestVerdict.NO_ZERO
    assert retained is not None  # the angle is counted from its zero
    if retained.encoder_serial != scale.identity.encoder_serial:
        return RestVerdict.OTHER_ENCODER
    if scale.axis_turn_counts is None:
        assert reading.margin_minus_deg is not None
        assert reading.margin_plus_deg is not None
        if not min(reading.margin_minus_deg, reading.margin_plus_deg) >= scale.wrap_margin_min_deg:
            return RestVerdict.WRAP
        if not scale.stops_deg[0] <= angle <= scale.stops_deg[1]:
            return RestVerdict.NOT_VALID
    if moved is None:
        return RestVerdict.NOT_VALID
    if abs(moved) <= ACCEPTED_DEG:
        return RestVerdict.OK
    turns = round(moved / scale.turn_deg)
    # The brake holds the motor's shaft, so a way of whole motor turns (0.3147 deg each at the reference gantry), within
    # what settles, is a fault of the multiturn part; nobody may acknowledge it as a motion (A10).
    if abs(moved - turns * scale.turn_deg) <= ACCEPTED_DEG:
        return RestVerdict.TURNS
    return RestVerdict.MOVED if abs(moved) <= AMBIGUOUS_DEG else RestVerdict.NOT_VALID


def _why_not_valid(reading: AbsoluteReading) -> Words | Said:
    if reading.verdict is RestVerdict.NO_ZERO:
        return Words.NO_ZERO
    if reading.moved_deg is None:
        return Words.NO_REST_POSITION
    if abs(reading.moved_deg) <= AMBIGUOUS_DEG:
        return Words.BEYOND_STOPS(angle=reading.angle_deg)
    return Words.MOVED_OR_TURNS_LOST(moved=reading.moved_deg)


def why_not_referenced(reading: AbsoluteReading) -> Reason | None:
    """Why the axis may not move with this reading, or None."""
    match reading.verdict:
        case RestVerdict.OK:
            return None
        case RestVerdict.MOVED:
            values: dict[str, object] = {"moved_deg": reading.moved_deg, "limit_deg": ACCEPTED_DEG}
            return Reason(Code.ENC_09, values, ClearedBy.RESET)
        case RestVerdict.OTHER_ENCODER:
            return Reason(Code.ENC_11, {"serial": reading.serial}, ClearedBy.RESTART)
        case RestVerdict.WRAP:
            values = {"minus_deg": reading.margin_minus_deg, "plus_deg": reading.margin_plus_deg}
            return Reason(Code.CFG_ENC_01, values, ClearedBy.RESTART)
        case RestVerdict.TURNS:
            return Reason(Code.ENC_08, {"moved_deg": reading.moved_deg}, ClearedBy.RESTART)
        case RestVerdict.NO_ZERO | RestVerdict.NOT_VALID:
            return Reason(Code.ENC_10, {"why": _why_not_valid(reading)}, ClearedBy.RESTART)
        case _:
            assert_never(reading.verdict)
