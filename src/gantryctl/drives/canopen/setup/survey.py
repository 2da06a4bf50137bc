"""Survey of a bus: every node that answers and its dangers, by SDO reads only."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Final, NamedTuple

from gantryctl.drives.canopen.bus.link import BusLink, Frame
from gantryctl.drives.canopen.bus.node import NmtState, NodeIdentity, RemoteNode
from gantryctl.drives.canopen.cia402 import decode_statusword
from gantryctl.drives.canopen.setup.live_facts import read_facts
from gantryctl.drives.canopen.setup.parameter_check import CSV_BIT
from gantryctl.drives.profiles import places_of_maker, profile_of
from gantryctl.drives.profiles.profile import key_of
from gantryctl.errors import DeviceError
from gantryctl.image import DriveState

_HEARTBEATS: Final = range(0x701, 0x780)
_ANSWERS: Final = range(0x581, 0x600)
# SDO upload of 1000:00, which every CANopen node has (CiA 301).
_PROBE: Final = b"\x40\x00\x10\x00\x00\x00\x00\x00"
_NO_MASTER: Final = 0
_SDO_S: Final = 0.3
# A transmit queue of Linux holds ten frames unless it was made longer, and a slow bus empties it slowly.
_QUEUE_S: Final = 0.002
_QUEUE_TRIES: Final = 5
_CIA_402: Final = 402
_DANGEROUS_AT_0: Final = {
    0x6007: "6007 = 0: a silent master lets this axis run on · gantryctl writes 1 before it enables",
    0x605E: "605E = 0: a fault takes the torque off without a ramp · gantryctl writes 2",
    0x605A: "605A = 0: a quick stop takes the torque off without a ramp · gantryctl writes 2 or 6",
}


class Found(NamedTuple):
    """Node that answers.

    Attributes:
        nmt: state of its heartbeat, "silent" without one.
        modes: 6502, None where the object is missing.
        state: CiA 402 state, None for a node that is not a drive.
        remarks: dangers and deviations, each with what to do.
    """

    node: int
    nmt: str
    identity: NodeIdentity | None
    modes: int | None
    state: DriveState | None
    remarks: tuple[str, ...]


def survey(link: BusLink, listen_s: float = 1.2, nodes: range = range(1, 128)) -> tuple[Found, ...]:
    """Listen for heartbeats, read 1000:00 of every node id, and inspect those that answer."""
    heard: dict[int, int | None] = {}
    for node in nodes:
        _probe(link, node, heard)
        _take(link, 0.0005, heard)
    end = link.now_s() + listen_s
    while (left := end - link.now_s()) > 1e-6:
        _take(link, left, heard)
    return tuple(_inspect(link, node, heard[node]) for node in sorted(heard))


def _probe(link: BusLink, node: int, heard: dict[int, int | None]) -> None:
    """Ask a node id for 1000:00; where the transmit queue is full, as soon as it has room."""
    for _ in range(_QUEUE_TRIES):
        if link.send(0x600 + node, _PROBE):
            return
        _take(link, _QUEUE_S, heard)


def _take(link: BusLink, seconds: float, heard: dict[int, int | None]) -> None:
    frame: Frame | None = link.receive(max(0.0, seconds))
    if frame is None:
        return
    if frame.can_id in _HEARTBEATS:
        heard[frame.can_id - 0x700] = frame.data[0] & 0x7F if frame.data else None
    elif frame.can_id in _ANSWERS:
        heard.setdefault(frame.can_id - 0x580, None)


def _inspect(link: BusLink, number: int, nmt: int | None) -> Found:
    node = RemoteNode(link, number, _NO_MASTER, _SDO_S)
    shown = NmtState(nmt).name if nmt in set(NmtState) else "silent"
    try:
        identity = node.identity()
        modes = node.sdo.optional(0x6502)
        status = node.sdo.optional(0x6041)
    except DeviceError as silent:
        return Found(number, shown, None, None, None, (str(silent),))
    state = None if status is None else decode_statusword(status)
    try:
        remarks = _remarks(node, identity, modes, state)
    except DeviceError as silent:
        remarks = (str(silent),)
    return Found(number, shown, identity, modes, state, remarks)


def _by_profile(node: RemoteNode, identity: NodeIdentity) -> Iterator[str]:
    """The profile of a drive, and what it says of the values that the drive has now."""
    profile = profile_of(read_facts(node.sdo, identity, places_of_maker(identity.vendor)))
    if profile is None:
        return
    yield f"profile {profile.name} ({profile.tried.value})"
    for bad in profile.dangerous_defaults:
        if node.sdo.optional(*key_of(bad.object)) == bad.value:
            yield f"{bad.object} = {bad.value} as delivered: {bad.because}"


def _remarks(
    node: RemoteNode, identity: NodeIdentity, modes: int | None, state: DriveState | None
) -> tuple[str, ...]:
    """Effects of the present parameters when something breaks."""
    if state is None:
        return ("no CiA 402 drive: it has no statusword",)
    optional = node.sdo.optional
    said: list[str] = list(_by_profile(node, identity))
    # Only the low half of 1000h is standard: product codes are in the upper one, even byte-swapped, in real drives.
    if identity.device_type & 0xFFFF != _CIA_402:
        said.append(f"1000 = {identity.device_type:08X}h: the low half of a drive is 0192h (402)")
    if modes is None:
        said.append("no 6502: whether it has CSV must be shown by a test")
    elif not modes & CSV_BIT:
        said.append("6502 has no CSV (bit 8): the drive may accept mode 9 and never move")
    said += [text for index, text in _DANGEROUS_AT_0.items() if optional(index) == 0]
    watches = optional(0x1016, 1), optional(0x1400, 5)
    if watches == (None, None):
        said.append(
            "neither 1016 nor 1400:05: nothing in this drive watches the controller · it needs a watchdog beside it"
        )
    elif not any(watches):
        said.append(
            "1016 and 1400:05 = 0: nothing watches the controller · gantryctl writes what the drive has"
        )
    sync = optional(0x1005)
    if sync is None or sync & 0x7FF != 0x80:
        said.append("1005 is not 80h: the drive may not react to SYNC · gantryctl writes it where it can")
    if optional(0x603F) is None:
        said.append("no 603F: error codes come by EMCY only")
    return tuple(said)
