"""Another node uses the identifiers of the drive's telegrams: noticed within three scans, and the true plant stops."""

from __future__ import annotations

import itertools
from collections.abc import Callable

import can
import pytest
from hypothesis import given
from hypothesis import strategies as st

from bus.bus_rig import QUICK_STOP_DEG, BusRig, bus_machine
from bus.io_machines import io_machine
from gantryctl.drives.canopen.diagnostics import TpdoWatch
from gantryctl.program import AxisState
from gantryctl.units import rad

pytestmark = pytest.mark.can

PERIOD_S = 0.002
"""500 forged telegrams a second."""
FORGED = {
    "zeros": lambda _: bytes(6 + 2),
    "stands": lambda genuine: (
        genuine
    ),  # the telegram of the beginning, for good: enabled, and the position stands
    "fault": lambda genuine: b"\x08\x02" + genuine[2:],
}
WHERE = ("between", "before the answer")
# Speed and owner of the brake take turns; every fifth row, with each scan period, is fast enough for every run.
ROWS = [
    pytest.param(
        scan_ms, number, what, where, (6.0, -3.0, 1.0)[n % 3], ("drive", "object_60FE")[n % 2],
        marks=[] if n % 5 == 4 else pytest.mark.slow,
    )
    for n, (scan_ms, number, what, where) in enumerate(
        itertools.product((1.0, 4.0, 10.0), (1, 2), FORGED, WHERE)
    )
]  # fmt: skip


class Forger:
    """A node that sends a telegram of the drive 500 times a second, between the scans or in front of the answers."""

    def __init__(self, rig: BusRig, number: int, what: str, where: str) -> None:
        self.rig, self.can_id = rig, 0x80 + 0x100 * number + rig.machine.can.node
        genuine = rig.drive.process.watches[number - 1].data
        assert genuine is not None
        self.data = FORGED[what](genuine)[: len(genuine)]
        self.begun_s = rig.engine.time_s
        self.sent = 0
        self.noticed_after: int | None = None
        """Scans from the first that a forged telegram could be seen in to the alarm."""
        self._scans = 0
        self.bus = rig.drive.link._bus
        self.before_answers = where == "before the answer"
        if self.before_answers:
            self._send, self.bus.send = self.bus.send, self._with_sync

    def _with_sync(self, msg: can.Message, timeout: float | None = None) -> None:
        if msg.arbitration_id == 0x80:
            self._due()
        self._send(msg, timeout)

    def scan(self) -> bool:
        """After each scan."""
        self._scans += self.sent > 0
        if self.noticed_after is None and "CAN-14" in self.rig.codes:
            self.noticed_after = self._scans
        if not self.before_answers:
            self._due()
        return False

    def _due(self) -> None:
        while self.sent * PERIOD_S <= self.rig.engine.time_s - self.begun_s + 1e-9:
            self.bus.deliver(self.can_id, self.data)
            self.sent += 1


@pytest.mark.parametrize(("scan_ms", "number", "what", "where", "speed", "owner"), ROWS)
def test_forged_telegrams_are_noticed_and_stop_the_axis(
    scan_ms: float, number: int, what: str, where: str, speed: float, owner: str
) -> None:
    rig = BusRig(bus_machine(owner, scan_ms)).power_up().cruise(speed)
    begun = len(rig.ticks)
    forger = Forger(rig, number, what, where)
    rig.engine.run_until(lambda _: forger.scan(), 4.0)
    assert rig.stops[0] == "CAN-14", rig.told
    assert forger.noticed_after is not None
    assert forger.noticed_after <= 3
    assert rig.axis.state is AxisState.ERROR_STOP
    assert rig.way_deg(begun - 1) < QUICK_STOP_DEG[abs(speed)]
    assert not rig.ticks[-1].brake_open
    assert not rig.enabled_again(begun)
    assert sum(rig.drive.health().contradicted) > 100
    rig.engine.close()


def test_forged_telegrams_of_a_node_beside_the_drive_stop_the_axis_too() -> None:
    """Inputs of an I/O node: all of them good, whatever the node says."""
    rig = BusRig(io_machine()).power_up().cruise(3.0)
    begun = len(rig.ticks)
    bus = rig.drive.link._bus

    def forge() -> bool:
        for _ in range(2):
            bus.deliver(0x183, bytes(8))
        return False

    rig.engine.run_until(lambda _: forge(), 4.0)
    assert rig.stops[0] == "CAN-14", rig.told
    assert rig.way_deg(begun - 1) < QUICK_STOP_DEG[3.0]
    rig.engine.close()


def test_only_service_goes_on_and_the_drive_is_set_up_again() -> None:
    rig = BusRig(bus_machine()).power_up().cruise(3.0)
    forger = Forger(rig, 1, "zeros", "between")
    rig.engine.run_until(lambda _: forger.scan(), 2.0)
    assert rig.drive.lost
    rig.command(power=False, move=False)
    rig.run(0.1)
    rig.command(reset=True)
    rig.run(0.1)
    assert rig.axis.refusal is not None
    assert "service role" in rig.axis.refusal.text
    rig.engine.close()


@pytest.mark.parametrize("spoilt", ["twice", "one"])
def test_what_a_disturbed_bus_does_is_no_second_sender(spoilt: str) -> None:
    """The same telegram twice, and a single spoilt frame in a while."""
    rig = BusRig(bus_machine(scan_ms=4.0))
    rig.power_up()
    rig.command(move=True, target_rad=rad(12.0), speed_rad_s=rad(3.0))
    watch = rig.drive.process.watches[0]
    bus = rig.drive.link._bus

    def again() -> bool:
        assert watch.data is not None
        if spoilt == "twice":
            bus.deliver(0x182, watch.data)
        elif spoilt == "one" and rig.engine.scan % 5 == 0:
            bus.deliver(0x182, bytes(8))
        return False

    rig.engine.run_until(lambda _: again(), 1.0)
    assert rig.codes == []
    rig.command(power=False, move=False)
    rig.until(lambda: rig.axis.is_off, 10.0)
    rig.engine.close()


def watched(steps: Callable[[TpdoWatch], None]) -> TpdoWatch:
    watch = TpdoWatch(1)
    steps(watch)
    return watch


def test_a_late_answer_behind_a_newer_one_contradicts_nothing() -> None:
    def steps(watch: TpdoWatch) -> None:
        watch.begin()
        watch.settle()  # no answer
        watch.begin()
        watch.take(b"1", True)
        watch.take(b"2", True)
        watch.settle()

    watch = watched(steps)
    assert watch.contradicted == 0
    assert watch.data == b"2"


@given(st.lists(st.sampled_from(("here", "late", "lost", "twice")), min_size=20, max_size=60))
def test_lost_late_and_doubled_telegrams_never_contradict(fates: list[str]) -> None:
    """Each telegram of a drive that keeps their order: in time, behind the next SYNC, never, or twice."""
    watch, behind = TpdoWatch(1), b""
    for k, fate in enumerate(fates):
        watch.begin()
        frames, behind = [behind] if behind else [], b""
        data = bytes((k,))
        match fate:
            case "here":
                frames.append(data)
            case "twice":
                frames += [data, data]
            case "late":
                behind = data
        for frame in frames:
            watch.take(frame, True)
        watch.settle()
    assert watch.contradicted == 0


def test_a_contradicted_answer_is_not_used() -> None:
    def steps(watch: TpdoWatch) -> None:
        for genuine, forged in ((b"1", b""), (b"2", b"9")):
            watch.begin()
            watch.take(genuine, True)
            if forged:
                watch.take(forged, True)
            watch.settle()

    watch = watched(steps)
    assert (watch.data, watch.age, watch.contradicted) == (b"1", 1, 1)


def test_a_wrong_length_beside_the_answer_contradicts_too() -> None:
    def steps(watch: TpdoWatch) -> None:
        watch.begin()
        watch.take(b"", True)
        watch.take(b"1", True)
        watch.settle()

    watch = watched(steps)
    assert (watch.wrong_length, watch.contradicted) == (1, 1)
