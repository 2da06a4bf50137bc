"""Supervision of bus and drive beside the process data: traffic, complaints, mode and target, as flags of the link."""

from __future__ import annotations

from collections import deque
from typing import Final

from gantryctl.drives.canopen.bus.link import BusLink
from gantryctl.drives.canopen.bus.node import RemoteNode
from gantryctl.drives.canopen.bus.requests import SdoRequests
from gantryctl.drives.canopen.cia402 import REMOTE
from gantryctl.drives.canopen.process_image import ProcessImage
from gantryctl.drives.canopen.settings import CanopenSettings
from gantryctl.drives.canopen.setup.parameter_check import CSV
from gantryctl.image import DriveRequest, DriveState, LinkFlag

# Telegrams of a wrong length, one after the other, that are no mutilated frame any more (fault catalogue E7).
_WRONG_LENGTHS: Final = 3
# SYNC periods off by more than half, one after the other (E2).
_JITTERS: Final = 3
_JITTER: Final = 0.5
# An interface that gives frames back shows those that were really sent (E1).
_UNSEEN_S: Final = 0.030
# Load of the bus in frames without stuff bits, over so long a time; 0.95 leaves no room for ours (E13).
_LOAD_MAX: Final = 0.95
_LOAD_S: Final = 0.020
# Scans before which not all frames could be read, one after the other or among the latest: one may be a computer that
# was held up. Frames that just fit the time for reading leave a rest in every few scans only.
_CONGESTED_SCANS: Final = 2
_CONGESTED_OFTEN: Final = 3
_CONGESTED_AMONG: Final = 10
# Frames of others, without data, in this part of the bus may hold telegrams up one behind the other.
_CROWDED: Final = 0.2
_EMPTY_BITS: Final = 47
# Telegrams that contradict another one of the same SYNC, and the scans in which they come: one may be a frame that an
# adapter spoilt, two are another sender. Of 500 forged frames a second a scan of 1 ms sees every other one.
_CONTRADICTIONS: Final = 2
_CONTRADICTED_SCANS: Final = 3
# Emergency messages a second beyond which they are only counted (E12).
_EMERGENCIES_MAX: Final = 10
# The fault state shows within this time of its emergency message; one without is a complaint of its own (D12).
_COMPLAINT_S: Final = 0.030
_TOLD_S: Final = 1.0
# Mode and target are asked for this often, behind the process data. A drive in another mode may run on at its last
# speed until the answer: at 0.25 s it turned 1.50 deg from 3 deg/s, of 1.40 permitted (fault D6, scan 10 ms).
_ASK_S: Final = 0.1
_OBEYED_SCANS: Final = 3
_WORKING: Final = (
    DriveState.READY_TO_SWITCH_ON,
    DriveState.SWITCHED_ON,
    DriveState.OPERATION_ENABLED,
    DriveState.QUICK_STOP_ACTIVE,
)
_IN_FAULT: Final = (DriveState.FAULT, DriveState.FAULT_REACTION_ACTIVE)


class Supervision:
    """What a drive shows beside its telegrams, judged once a scan.

    Args:
        node: emergency messages.
        process: telegrams.
        requests: for mode (6061) and target (60FF).
        settings: period, bit rate, whether bit 9 of 6041 means anything.
    """

    def __init__(
        self, node: RemoteNode, process: ProcessImage, requests: SdoRequests, settings: CanopenSettings
    ) -> None:
        self._node, self._process, self._requests = node, process, requests
        self._link: BusLink = node.link
        period_s = self._period_s = settings.period_s
        self._unseen_max = max(_OBEYED_SCANS, round(_UNSEEN_S / period_s))
        self._load_scans = max(2, round(_LOAD_S / period_s))
        self._load_bits = _LOAD_MAX * settings.bitrate * self._load_scans * period_s
        self._second = round(1.0 / period_s)
        self._ask_scans = round(_ASK_S / period_s)
        self._complaint_scans = max(_OBEYED_SCANS, round(_COMPLAINT_S / period_s))
        self._told_scans = round(_TOLD_S / period_s)
        self._remote_bit = settings.remote_bit
        self._scan = self._load_until = self._ask_at = self._jitters = self._local = 0
        self._bits = self._link.traffic.bits
        self._complaints, self._window_count = node.emergencies.complaints, node.emergencies.count
        self._window_until = 0
        self._told_until = 0
        self._complaint_at: int | None = None
        self._contradicted_at: deque[int] = deque(maxlen=_CONTRADICTIONS)
        self._contradicted = process.contradicted
        self._congested_scans, self._queue_full = 0, self._link.queue_full
        self._congested_at: deque[int] = deque(maxlen=_CONGESTED_OFTEN)
        self._others = node.unknown + self._link.traffic.filtered
        self._wrong_mode = self._stale_target = self._asks_target = self._enabled = False
        self._flags = LinkFlag.NONE
        self.complaint = 0
        """Error code of an emergency message without a fault state; 0 without one."""

    @property
    def forbids(self) -> bool:
        """Mode or target are not what an enabled drive must have."""
        return self._wrong_mode or self._stale_target

    def period(self, elapsed_s: float) -> None:
        """Take the time between two SYNCs of ours."""
        late = abs(elapsed_s - self._period_s) > _JITTER * self._period_s
        self._jitters = self._jitters + 1 if late else 0

    def begin(self) -> None:
        """The program begins to command: what a drive sent while it was set up is no contradiction."""
        self._contradicted = self._process.contradicted

    def flags(self, scan: int, state: DriveState, status: int, request: DriveRequest) -> LinkFlag:
        """Flags of this scan.

        Args:
            state, status: of the drive.
            request: of the program, in the scan before.
        """
        self._scan = scan
        flags = self._traffic(scan)
        emergencies = self._node.emergencies
        if emergencies.complaints != self._complaints or self._complaint_at is not None:
            flags |= self._unexplained(scan, state)
        if self._window_count + _EMERGENCIES_MAX < emergencies.count:
            flags |= LinkFlag.EMERGENCY_FLOOD
        if self._remote_bit and not status & REMOTE:
            flags |= self._under_local_control(state, request)
        elif self._local:
            self._local = 0
        if self._wrong_mode:
            flags |= LinkFlag.WRONG_MODE
        if self._stale_target:
            flags |= LinkFlag.STALE_TARGET
        return flags

    # --- traffic ----------------------------------------------------------------------------------------------------

    def _traffic(self, scan: int) -> LinkFlag:
        """Flags of the bus itself: its load, the telegrams, our own SYNC."""
        if scan >= self._load_until:
            self._measure_load(scan)
        flags = self._flags
        process = self._process
        if process.congested:
            self._congested_scans += 1
            self._congested_at.append(scan)
        else:
            self._congested_scans = 0
        if self._congested_scans >= _CONGESTED_SCANS or self._often_congested(scan):
            flags |= LinkFlag.OVERLOADED
        if process.contradicted != self._contradicted:
            self._contradictions(scan)
        if self._two_senders(scan):
            flags |= LinkFlag.TWO_SENDERS
        if process.age or process.inputs_age:
            flags |= LinkFlag.LATE
            if process.wrong_lengths >= _WRONG_LENGTHS:
                flags |= LinkFlag.WRONG_LENGTH
        if self._link.unseen > self._unseen_max:
            flags |= LinkFlag.SYNC_UNSEEN
        if self._jitters >= _JITTERS:
            flags |= LinkFlag.SYNC_JITTER
        if self._link.queue_full != self._queue_full:
            self._queue_full = self._link.queue_full
            flags |= LinkFlag.QUEUE_FULL
        return flags

    def _measure_load(self, scan: int) -> None:
        traffic = self._link.traffic
        bits, self._bits = self._bits, traffic.bits
        others, self._others = self._others, self._node.unknown + traffic.filtered
        # Scans that were missed are part of the time.
        scans = self._load_scans + scan - self._load_until if self._load_until else self._load_scans
        free_bits = _CROWDED * self._load_bits / _LOAD_MAX * scans / self._load_scans
        self._process.crowded = _EMPTY_BITS * (self._others - others) > free_bits
        overloaded = self._bits - bits > self._load_bits * scans / self._load_scans
        self._flags = LinkFlag.OVERLOADED if overloaded and self._load_until else LinkFlag.NONE
        self._load_until = scan + self._load_scans
        if scan >= self._window_until:
            self._window_until = scan + self._second
            self._window_count = self._node.emergencies.count

    def _often_congested(self, scan: int) -> bool:
        seen = self._congested_at
        return len(seen) == _CONGESTED_OFTEN and scan - seen[0] < _CONGESTED_AMONG

    def _contradictions(self, scan: int) -> None:
        """Note the scan of each new telegram that contradicts another one."""
        new = self._process.contradicted - self._contradicted
        self._contradicted += new
        self._contradicted_at.extend([scan] * min(new, _CONTRADICTIONS))

    def _two_senders(self, scan: int) -> bool:
        seen = self._contradicted_at
        return len(seen) == _CONTRADICTIONS and scan - seen[0] < _CONTRADICTED_SCANS

    # --- complaints -------------------------------------------------------------------------------------------------

    def _unexplained(self, scan: int, state: DriveState) -> LinkFlag:
        """EMERGENCY for a message that no fault state explains, for a second."""
        emergencies = self._node.emergencies
        if emergencies.complaints != self._complaints:
            self._complaints = emergencies.complaints
            if state in _WORKING:
                # The time for a fault state to show runs from the first of several.
                if self._complaint_at is None:
                    self._complaint_at = scan
                self.complaint = emergencies.complaint
                self._told_until = scan + self._complaint_scans + self._told_scans
        at = self._complaint_at
        if at is None:
            return LinkFlag.NONE
        if state in _IN_FAULT or scan > self._told_until:
            self._complaint_at, self.complaint = None, 0
            return LinkFlag.NONE
        return LinkFlag.EMERGENCY if scan - at >= self._complaint_scans else LinkFlag.NONE

    def _under_local_control(self, state: DriveState, request: DriveRequest) -> LinkFlag:
        wanted = request is DriveRequest.ENABLE or state in _WORKING
        self._local = self._local + 1 if wanted and state is not DriveState.UNKNOWN else 0
        return LinkFlag.LOCAL_CONTROL if self._local > _OBEYED_SCANS else LinkFlag.NONE

    # --- mode and target --------------------------------------------------------------------------------------------

    def ask(self, enabled: bool) -> None:
        """Ask for mode or target when due, after the process data of a scan.

        Args:
            enabled: the drive follows a target, or is asked to: only a resting one must be 0.
        """
        self._enabled = enabled
        # An answer that was lost must not end the asking; a slow one is waited for as long again.
        if self._scan < self._ask_at + self._ask_scans * self._requests.waiting:
            return
        self._ask_at = self._scan + self._ask_scans
        self._asks_target = not self._asks_target and not enabled
        if self._asks_target:
            self._requests.read(0x60FF, 0, self._target)
        else:
            self._requests.read(0x6061, 0, self._mode)

    def _mode(self, data: bytes | None) -> None:
        # A drive without 6061 has shown its mode when it was set up, or was refused.
        self._wrong_mode = data is not None and int.from_bytes(data[:1], "little", signed=True) != CSV

    def _target(self, data: bytes | None) -> None:
        # An answer that comes after the enable shows a target that is meant.
        if not self._enabled:
            self._stale_target = data is not None and any(data)
