"""INV-6, the load is held: torque on, or the brake closed, or closing for at most the time that it needs."""

from __future__ import annotations

from typing import Final

from gantryctl.engineering.faults.oracle.known import KnownFaults
from gantryctl.engineering.faults.oracle.limits import BRAKE_CLOSES_S
from gantryctl.engineering.faults.oracle.told import READING_SCANS
from gantryctl.engineering.faults.oracle.words import TrueAxis

# ms in which a drive that switched itself off is told as an alarm: the heartbeat is missed after 150 ms.
_TOLD_MS: Final = 200
# ms for which torque is on before the brake opens.
_TORQUE_FIRST_MS: Final = 10


class Load:
    """Who holds the load of one axis.

    Attributes:
        unheld_ms: for so long neither torque nor brake has held it.
        driven_ms: the longest of it since the torque came on: the speed that the load has given stays until the brake
            has taken it.
        off_unjudged: torque went off with the brake open, and no alarm has told it yet.
    """

    def __init__(self, known: KnownFaults) -> None:
        self._known = known
        self._on_ms = self._off_ms = -1_000_000
        self.unheld_ms = self.driven_ms = 0
        self.off_unjudged = False

    @property
    def unheld_max_ms(self) -> float:
        """For so long the load may be held by neither."""
        return 1e3 * (BRAKE_CLOSES_S + self._known.brake_late_s)

    def torque_on(self, ms: int) -> None:
        """Torque comes on."""
        self._on_ms, self.unheld_ms, self.driven_ms = ms, 0, 0

    def torque_off(self, true: TrueAxis, *, open_before: bool, commanded: bool) -> None:
        """Torque goes off.

        Args:
            open_before: the brake was open before this millisecond.
            commanded: the wire takes it off.
        """
        self._off_ms = true.ms
        self.off_unjudged = open_before and true.brake_open
        if not (self.off_unjudged and commanded) or true.told_torque_off():
            return
        if self._known.begun_just_now(true):
            # A drive that leaves by itself while it is being disabled in order does so too early: its brake closes
            # already, in the time that it has (D4 in the last 18 ms of it, seed 30154).
            self.off_unjudged = False
        else:
            true.say("INV-6", "torque taken off with the brake open, and no alarm says torque off")

    def brake_opens(self, true: TrueAxis) -> None:
        """The brake opens, behind torque; or as it was released under torque that has gone since.

        Such a release nobody withdraws before a scan has shown it and another has told it (seed 30123 at 10 ms, the
        emergency stop in the last 20 ms in which the brake opens).
        """
        just_lost = true.ms - self._off_ms <= true.scans_ms(READING_SCANS)
        if not (true.energised or just_lost) or true.ms - self._on_ms < _TORQUE_FIRST_MS:
            true.say("INV-6", "the brake opens without torque")

    def unheld(self, true: TrueAxis) -> None:
        """Torque is off: the brake must come, and an order other than brake first needs an alarm."""
        if self.off_unjudged:
            if true.told_torque_off() or true.ms < self._known.state_seen_ms:
                self.off_unjudged = False
            elif true.ms - self._off_ms > _TOLD_MS and not self._known.stands_still:
                self.off_unjudged = False
                true.say("INV-6", "torque went off with the brake open, and no alarm reports it")
        self.unheld_ms = self.unheld_ms + 1 if true.brake_open else 0
        self.driven_ms = max(self.driven_ms, self.unheld_ms)
        if self.unheld_ms > self.unheld_max_ms:
            true.say("INV-6", f"neither torque nor brake for {self.unheld_ms} ms")
