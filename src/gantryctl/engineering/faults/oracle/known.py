"""What is known of the faults of one axis: since when they act, and what the axis may do because of them."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Final, NamedTuple

from gantryctl.engineering.faults.oracle.held import HeldUp
from gantryctl.engineering.faults.oracle.words import Instant, TrueAxis

# An alarm's cause lies at most that far back, ms: a frozen encoder at standstill is found by the dither in 500 ms.
_CAUSE_MS: Final = 3000
# What has ended explains no alarm of an axis that has moved on soundly since: every monitor of a reading or of a drive
# has seen it, or let it pass, half a second later. A sign that was wrong for 0.47 s at rest explained a torque that was
# lost 1.9 s later in a move (random seed 160507).
_OVER_MS: Final = 1000


class Effect(NamedTuple):
    """What a fault does to the promises of the axis.

    Attributes:
        feedback: the reading is in doubt, or what the drive does with it.
        at_once: it acts now, so the way to rest counts from now; else from the alarm.
        no_ramp: a quick stop has none.
        late_s: the axis goes on for so long before it shows.
    """

    feedback: bool = False
    at_once: bool = False
    no_ramp: bool = False
    late_s: float = 0.0


class KnownFaults:
    """Who injects a fault tells it here.

    Attributes:
        onset: when the last cause began to act; None without.
        no_ramp: a brake or too little torque takes its ramp from a quick stop, which has the class torque off.
        own_ramp: the drive is in the NMT state STOPPED, or no command reaches it: it takes none, and stops on a ramp of
            its own.
        pulls_away: the load may be taken away, and the position loop answers.
        late_s: the axis goes on for so long before a fault shows.
        torque_share: what a fault leaves of the torque of the drive.
        brake_late_s: a fault lets the brake close so much later. brake_share: what is left of its torque.
        reading_late_s: a fault delays every telegram of the drive by so much: none carries its time, so behind the gap
            at the beginning nothing shows it.
        contact_lies: a fault has held the contact of the brake open, or every input as it was; only the contact shows
            that the brake is closed, so that may be told later than it is so.
        encoder_lies_ms: when faults of the encoder have begun.
        state_seen_ms: until then the telegrams with the state of the drive do not come: nobody sees that a relay takes
            its torque.
        held: the controller stands still, or has stood.
        load_share: of a load that has been moved, at a motor angle: what it asks for, in parts of what the brake has.
    """

    def __init__(self) -> None:
        self.onset: Instant | None = None
        self.no_ramp = self.own_ramp = self.pulls_away = self.contact_lies = False
        self.late_s = self.brake_late_s = self.reading_late_s = 0.0
        self.brake_share = self.torque_share = 1.0
        self.encoder_lies_ms: list[int] = []
        self.state_seen_ms = 0.0
        self.held: HeldUp | None = None
        self.load_share: Callable[[float], float] | None = None
        self._onset_of_feedback = self._disobeys = False
        self._over_ms = math.inf

    def inject(self, now: Instant, effect: Effect, lasts_s: float = math.inf) -> None:
        """Something is spoilt from now on for so long; a cause that lasts keeps its first onset."""
        feedback, at_once, no_ramp, late_s = effect
        self.late_s = max(self.late_s, late_s)
        self._disobeys = self._disobeys or (feedback and not at_once)
        self.no_ramp = self.no_ramp or no_ramp
        self.pulls_away = self.pulls_away or feedback or no_ramp
        old = self.recent_onset(now.ms) is None
        if at_once and (old or (feedback and not self._onset_of_feedback)):
            self.onset, self._onset_of_feedback = now, feedback
            self._over_ms = now.ms + 1e3 * lasts_s
        elif at_once and feedback is self._onset_of_feedback:
            self._over_ms = max(self._over_ms, now.ms + 1e3 * lasts_s)

    def hold(self, now: Instant, held_s: float) -> None:
        """The controller stands still from now on for so long."""
        self.held = HeldUp(now, held_s)

    def recent_onset(self, ms: int) -> Instant | None:
        """Onset of what may be the cause of an alarm that is told now."""
        onset = self.onset
        recent = onset is not None and ms - onset.ms < _CAUSE_MS and ms < self._over_ms + _OVER_MS
        return onset if recent else None

    def begun_just_now(self, true: TrueAxis) -> bool:
        """A fault has begun to act within this scan."""
        return self.onset is not None and true.ms - self.onset.ms <= true.scans_ms(1.0) + 1.0

    def of_feedback(self, ms: int) -> bool:
        """A fault of the feedback is known that may still act."""
        return self._disobeys or (self._onset_of_feedback and self.recent_onset(ms) is not None)

    def held_way_deg(self, true: TrueAxis, since: Instant) -> float:
        """Permitted way of a spoilt feedback under a controller that stands still; 0 without."""
        return self.held.way_deg(true, since) if self.held is not None and self.of_feedback(true.ms) else 0.0

    def largest_load(self, begin: float, end: float) -> float:
        """Most that a load which has been moved asks for between two motor angles, in parts of what the brake has."""
        load = self.load_share
        if load is None:
            return 0.0
        return max(load(begin + part * (end - begin)) for part in (0.0, 0.25, 0.5, 0.75, 1.0))

    @property
    def stands_still(self) -> bool:
        """The controller stands still, and can tell nothing before it goes on."""
        return self.held is not None and self.held.went_on is None
