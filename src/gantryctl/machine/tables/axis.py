"""Tables [machine], [axis], [speed] and [virtual_axis]: what the axis is, how far and how fast it may go."""

from __future__ import annotations

import math
from fractions import Fraction
from typing import Annotated, Any, Final, Literal, TypeAlias

from pydantic import Field

from gantryctl.machine.tables.fields import (
    Table,
    beside,
    choice,
    number,
    pairs,
    required_number,
    switch,
    text,
    texts,
)
from gantryctl.units import SIGNED, Dial, within_turn

# Declared once for the machine file and for the requirement sheet that it may come from (`engineering.sizing`).
AxisKind: TypeAlias = Literal["linear", "modulo"]
AXIS_KIND: Final[Any] = choice("linear", "A travel with two ends, or turns without end.")
# Ten turns each way: more than a cable drum of any of these axes takes.
POS_MIN_DEG: Final[Any] = required_number(-180.0, -3600.0, 3600.0, "Lowest angle the set-point may reach.")
POS_MAX_DEG: Final[Any] = required_number(180.0, -3600.0, 3600.0, "Highest angle the set-point may reach.")
REDUCER_RATIO: Final[Any] = required_number(88.0, 1.0, 1e5, "Motor turns per turn of the reducer output.")
RING_RATIO: Final[Any] = required_number(
    13.0, 1.0, 1000.0, "Turns of the reducer output per turn of the axis."
)


class IdentityTable(Table):
    """[machine]: the machine's name."""

    name: str = Field(
        min_length=1,
        max_length=64,
        pattern=r"^[A-Za-z0-9][A-Za-z0-9_.-]*$",
        examples=["hust_gantry"],
        description="Short name, used in messages and file names: letters, digits, '_', '-', '.'.",
    )
    description: str = text("", 300, "One line for people.")


class FileIdentity(IdentityTable):
    """[machine] and [sheet]: the name, and which values nobody has measured or decided yet."""

    guesses: tuple[str, ...] = texts(
        0,
        200,
        "Keys of this file whose values are guesses, by dotted path; delete a row once its value is known.",
    )


# Keys of an axis with two ends; a modulo axis has none of them.
ENDS: Final = (
    "over_travel_min_deg", "over_travel_max_deg", "limit_switch_min_deg", "limit_switch_max_deg",
    "mechanical_stop_min_deg", "mechanical_stop_max_deg",
)  # fmt: skip
_AT: Final[Any] = Field(ge=-3600.0, le=3600.0)


class AxisTable(Table):
    """[axis]: travel, limits, gear ratio. Signed angles at the load; 0 deg may lie outside travel.

    Of a modulo axis `pos_min_deg` and `pos_max_deg` are the ends of its turn, and it has no other limits.
    """

    kind: AxisKind = AXIS_KIND
    pos_min_deg: float = POS_MIN_DEG
    pos_max_deg: float = POS_MAX_DEG
    over_travel_min_deg: float = beside("pos_min_deg", -0.5, -180.5, "A measured angle below it trips.")
    over_travel_max_deg: float = beside("pos_max_deg", 0.5, 180.5, "A measured angle above it trips.")
    limit_switch_min_deg: float = beside("pos_min_deg", -2.0, -182.0, "Limit switch below travel.")
    limit_switch_max_deg: float = beside("pos_max_deg", 2.0, 182.0, "Limit switch above travel.")
    mechanical_stop_min_deg: float = beside("pos_min_deg", -7.0, -187.0, "Mechanical stop below travel.")
    mechanical_stop_max_deg: float = beside("pos_max_deg", 7.0, 187.0, "Mechanical stop above travel.")
    no_go_deg: tuple[tuple[Annotated[float, _AT], Annotated[float, _AT]], ...] = pairs(
        8, "Sectors [from, to] that neither set-point nor a stop may enter; of a modulo axis in every turn."
    )
    # IEC 61217 counts gantry angles from 0 to 360 deg.
    display: Literal["-180..180", "0..360"] = choice(
        "-180..180",
        "How people read and type angles: signed, or within 0 to 360 deg; a modulo axis by its turn.",
    )
    reducer_ratio: float = REDUCER_RATIO
    ring_ratio: float = RING_RATIO
    # 117.3333 for 352/3 leads the angle of a modulo axis astray by 1.0e-4 deg with each turn, 1 deg after 10,000.
    gear_motor_turns: int = number(
        0,
        0,
        10**7,
        "Motor turns in `gear_axis_turns` turns of a modulo axis, exactly; 0: by the two ratios as written.",
    )
    gear_axis_turns: int = number(1, 1, 10**5, "Turns of the axis in `gear_motor_turns`.", unit="turns")

    @property
    def modulo(self) -> bool:
        """The axis turns without end."""
        return self.kind == "modulo"

    @property
    def gear(self) -> Fraction:
        """Motor turns per gantry turn, exactly as the machine file writes them."""
        if self.gear_motor_turns:
            return Fraction(self.gear_motor_turns, self.gear_axis_turns)
        return Fraction(repr(self.reducer_ratio)) * Fraction(repr(self.ring_ratio))

    @property
    def ratio(self) -> float:
        """Motor turns per turn of the axis."""
        return self.reducer_ratio * self.ring_ratio

    @property
    def start_angle_deg(self) -> float:
        """Angle at which a new simulated machine stands: 0 deg, or the middle of the widest stretch without it."""
        stretches = self._stretches_deg
        if any(low <= 0.0 <= high for low, high in stretches):
            return 0.0
        low, high = max(stretches, key=lambda stretch: stretch[1] - stretch[0])
        return 0.5 * (low + high)

    @property
    def sectors_deg(self) -> tuple[tuple[float, float], ...]:
        """No-go sectors, the end the larger; of a modulo axis they begin in its turn: 350 to 10 is 350 to 370."""
        return tuple(map(self._in_turn, self.no_go_deg)) if self.modulo else self.no_go_deg

    def _in_turn(self, sector: tuple[float, float]) -> tuple[float, float]:
        """A sector as it lies from the begin of the turn on, by whole turns: no rounding reaches its ends."""
        begin, end = sector
        begin -= 360.0 * math.floor((begin - self.pos_min_deg) / 360.0)
        return begin, end - 360.0 * (math.ceil((end - begin) / 360.0) - 1.0)

    @property
    def home_stretch_deg(self) -> tuple[float, float]:
        """Stretch of travel between no-go sectors in which a new machine stands."""
        at = self.start_angle_deg
        return next(stretch for stretch in self._stretches_deg if stretch[0] <= at <= stretch[1])

    @property
    def _stretches_deg(self) -> list[tuple[float, float]]:
        """What the no-go sectors leave of travel, or of the turn of a modulo axis."""
        begin, stretches = self.pos_min_deg, []
        turns = (-360.0, 0.0) if self.modulo else (0.0,)
        for low, high in sorted((a + turn, b + turn) for a, b in self.sectors_deg for turn in turns):
            if high <= begin or low >= self.pos_max_deg:
                continue
            if low > begin:
                stretches.append((begin, low))
            begin = high
        return [*stretches, (begin, self.pos_max_deg)] if begin < self.pos_max_deg else stretches

    def shown_deg(self, angle_deg: float) -> float:
        """An angle as people read it: of a modulo axis, within the turn from `pos_min_deg`."""
        return within_turn(angle_deg, self.pos_min_deg, 360.0) if self.modulo else angle_deg

    @property
    def dial(self) -> Dial:
        """How people read angles of the axis."""
        if self.modulo:
            return Dial(self.pos_min_deg)
        if self.display == "-180..180":
            return SIGNED
        stops = self.mechanical_stop_min_deg, self.mechanical_stop_max_deg
        return Dial(0.0, stops if stops[1] - stops[0] >= 360.0 else None)

    def read_deg(self, angle_deg: float) -> float:
        """An angle as people read it."""
        return self.dial.read_deg(angle_deg)

    def meant_deg(self, typed_deg: float) -> float:
        """Angle of the axis that a person means who types what the display shows."""
        low, high = self.pos_min_deg, self.pos_max_deg
        # 500 deg is no angle that the display shows, and -190 deg is one beyond travel: nothing is guessed.
        shown = 0.0 <= typed_deg <= 360.0
        if self.modulo or self.display == "-180..180" or low <= typed_deg <= high or not shown:
            return typed_deg
        turned = (typed_deg - 360.0, typed_deg + 360.0)
        return next((angle for angle in turned if low <= angle <= high), typed_deg)

    def within_stops(self, angle_deg: float) -> bool:
        """Whether the axis can stand at an angle: between its mechanical stops, or within a turn where it has none."""
        if self.modulo:
            return abs(angle_deg) <= 360.0
        return self.mechanical_stop_min_deg < angle_deg < self.mechanical_stop_max_deg

    @property
    def stops_text(self) -> str:
        """Where angles end, for messages."""
        if self.modulo:
            return "an angle of a turn lies within -360 and 360 deg"
        low, high = self.mechanical_stop_min_deg, self.mechanical_stop_max_deg
        return f"the mechanical stops are at {self.dial.text(low)} and {self.dial.text(high)} deg"


class SpeedTable(Table):
    """[speed]: the speed chain in deg/s at the load, from the slowest setting to the overspeed trip."""

    setting_min_deg_s: float = number(0.6, 1e-6, 1000.0, "Lowest speed setting (0.1 r/min).", "paper")
    setting_max_deg_s: float = number(6.0, 1e-4, 3600.0, "Highest speed setting (1 r/min).", "paper")
    creep_deg_s: float = number(0.1, 1e-6, 360.0, "Service creep, a limit of its own.")
    # Each limit of the chain lies above the one before, so that the milder one acts first: setting, clamp of the
    # command, ceiling in the drive, trip.
    command_clamp_deg_s: float = number(
        6.3,
        1e-4,
        4000.0,
        "Clamp of the speed command; above the highest setting it is the "
        "correction reserve of the position loop, at least 5 %.",
    )
    drive_ceiling_deg_s: float = number(
        6.5, 1e-4, 4000.0, "Speed limit inside the drive (CiA 402 object 6080)."
    )
    overspeed_trip_deg_s: float = number(6.6, 1e-4, 4400.0, "Measured speed that trips.")


class VirtualAxisTable(Table):
    """[virtual_axis]: dynamics of the set-point at the load, with three decelerations."""

    # A step of the acceleration swings a load on a spring up to twice as far; the paper drives trapezoids all the same.
    profile: Literal["trapezoid", "jerk_limited"] = choice(
        "trapezoid", "Shape of a move: constant acceleration, or limited jerk.", "paper"
    )
    # 15.25 s and 45.76 deg from rest to 6 deg/s: no move below 91.52 deg reaches the highest setting. The sizing
    # case, 1 s to 6 deg/s, asks for 15.25 times as much.
    acc_deg_s2: float = number(
        450.0 / 1144.0, 1e-5, 1e5, "Acceleration (450 deg/s2 at the motor, divided by 1144).", "paper"
    )
    dec_deg_s2: float = number(450.0 / 1144.0, 1e-5, 1e5, "Normal deceleration.", "paper")
    jerk_deg_s3: float = number(
        0.788, 1e-5, 1e7, 'Jerk of a move; only with profile = "jerk_limited".', "estimate"
    )
    # An axis whose gears have a gap stops on one of their flanks, and not somewhere between: the load is slowed down by
    # its own friction, 0.16 deg/s2 on the reference gantry, once the deceleration falls below that.
    gentle_end: bool = switch(False, "End moves to an angle gently, against backlash; jerk-limited only.")
    end_dec_deg_s2: float = number(0.2, 1e-5, 1e5, "Deceleration from which a gentle end begins.", "estimate")
    end_jerk_deg_s3: float = number(0.15, 1e-6, 1e7, "Jerk of a gentle end.", "estimate")
    # With the deceleration of a move an axis at 6 deg/s would need 46 deg to stop after the key is let go.
    jog_release_dec_deg_s2: float = number(2.0, 1e-5, 1e5, "Deceleration when a jog key is let go.")
    jog_release_jerk_deg_s3: float = number(20.0, 1e-4, 1e7, "Jerk of the jog-release ramp.")
    # v^2 / (2 x angle) for the permitted 4 deg from 6 deg/s are 4.5 deg/s2; 4.95 with a reaction time of 60 ms.
    quick_dec_deg_s2: float = number(
        5.4, 1e-4, 1e5, "Deceleration of the quick stop, a step without jerk limit.", "derived"
    )
