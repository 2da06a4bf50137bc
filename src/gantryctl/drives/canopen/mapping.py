"""Mapping of the process data: planned for the objects of a drive, written by plain SDO and read back."""

from __future__ import annotations

from typing import Final, NamedTuple

from gantryctl.drives.canopen.bus.sdo import SdoClient, SdoError, abort_text
from gantryctl.drives.canopen.settings import CanopenSettings
from gantryctl.errors import DeviceError

# Transmission type 1: at every SYNC. Bits 31 and 30 of a PDO identifier: not valid, no remote request (CiA 301).
SYNCHRONOUS: Final = 1
# A command of these types acts when it arrives: sooner than at the next SYNC, so no dead time grows.
_ON_ARRIVAL: Final = (254, 255)
_INVALID: Final = 0x8000_0000
_NO_RTR: Final = 0x4000_0000
_PDOS: Final = 4
_NO_AXIS: Final = "CSV axis"
_WITHOUT: Final = {0x60E4: "encoder on the ring: correct [can.load_encoder] source"}


class Signal(NamedTuple):
    """Object in a telegram."""

    obj: int
    sub: int
    bits: int
    signed: bool

    @property
    def entry(self) -> int:
        """Value of a mapping object: index, sub-index, length in bits."""
        return self.obj << 16 | self.sub << 8 | self.bits


CONTROLWORD: Final = Signal(0x6040, 0, 16, False)
TARGET_VELOCITY: Final = Signal(0x60FF, 0, 32, True)
TORQUE_OFFSET: Final = Signal(0x60B2, 0, 16, True)
OUTPUTS: Final = Signal(0x60FE, 1, 32, False)
# 60FE, bit 0 (CiA 402): set the brake.
SET_BRAKE: Final = 1
STATUSWORD: Final = Signal(0x6041, 0, 16, False)
POSITION: Final = Signal(0x6064, 0, 32, True)
VELOCITY: Final = Signal(0x606C, 0, 32, True)
TORQUE: Final = Signal(0x6077, 0, 16, True)
INPUTS: Final = Signal(0x60FD, 0, 32, False)
RING_POSITION: Final = Signal(0x60E4, 1, 32, True)
ERROR: Final = Signal(0x603F, 0, 16, False)
OPTIONAL: Final = (TORQUE_OFFSET, VELOCITY, TORQUE, INPUTS, ERROR)


class FixedMapping(DeviceError):
    """Drive whose telegrams cannot be set up."""


def encoder_signal(settings: CanopenSettings) -> Signal | None:
    """Object for the status of the encoder; None where the drive has none."""
    status = settings.encoder
    return None if status.obj == 0 else Signal(status.obj, status.sub, 8 * status.length, False)


def extra_signals(settings: CanopenSettings) -> tuple[Signal, ...]:
    """Objects of the third telegram: what the machine file asks for beyond a CSV axis."""
    status, ring = encoder_signal(settings), settings.load_encoder
    return (
        *(() if status is None else (status,)),
        *((RING_POSITION,) if ring is not None and ring.node is None else ()),
    )


class Pdo(NamedTuple):
    """Telegram; number 0 is the first of its direction."""

    number: int
    signals: tuple[Signal, ...]

    @property
    def size(self) -> int:
        """Bytes."""
        return sum(signal.bits for signal in self.signals) // 8


class Mapping(NamedTuple):
    """All telegrams of one drive."""

    rpdos: tuple[Pdo, ...]
    tpdos: tuple[Pdo, ...]
    refused: frozenset[Signal] = frozenset()
    """Objects that the drive has and cannot map."""

    @property
    def signals(self) -> frozenset[Signal]:
        """Everything that is mapped."""
        return frozenset(signal for pdo in (*self.rpdos, *self.tpdos) for signal in pdo.signals)


def plan_mapping(present: frozenset[Signal], outputs: bool, extra: tuple[Signal, ...] = ()) -> Mapping:
    """Telegrams for the objects that a drive has.

    Args:
        outputs: bits of 60FE are used.
        extra: what the machine file asks for: the encoder's status, the position of a second encoder.
    """
    # Two TPDOs have 16 bytes; 6041, 6064, 606C, 6077, 603F and 60FD need 18. Inputs are worth more than 603F: the
    # error code comes by EMCY, and a fault without one is asked for 603F (decision 0012).
    first = [CONTROLWORD, TARGET_VELOCITY, *_those(present, TORQUE_OFFSET)]
    rpdos = [Pdo(0, tuple(first))]
    if outputs:
        rpdos.append(Pdo(1, (OUTPUTS,)))
    status = [STATUSWORD, POSITION, *_those(present, TORQUE)]
    second = _those(present, VELOCITY, INPUTS if INPUTS in present else ERROR)
    if INPUTS in present and VELOCITY not in present:
        second += _those(present, ERROR)
    tpdos = [Pdo(0, tuple(status)), *([Pdo(1, tuple(second))] if second else [])]
    if extra:
        tpdos.append(Pdo(len(tpdos), extra))
    return Mapping(tuple(rpdos), tuple(tpdos))


def _those(present: frozenset[Signal], *wanted: Signal) -> list[Signal]:
    return [signal for signal in wanted if signal in present]


def configure(sdo: SdoClient, node: int, outputs: bool, extra: tuple[Signal, ...] = ()) -> Mapping:
    """Write the mapping in PRE-OPERATIONAL, read it back and return it; leave out what the drive cannot map.

    Raises:
        DeviceError: a needed object cannot be mapped, or the drive reads back another mapping; FixedMapping where
            its telegrams cannot be changed at all.
    """
    # 6077 cannot be mapped, or 60B1, 60B2, 603F are missing, in many drives: of 30 real EDS files 20 have no 603F, and
    # only two drive families have all twelve objects of a speed axis. So optional objects stay optional.
    sizes = {signal: _bits(sdo, signal) for signal in OPTIONAL}
    present = frozenset(signal for signal, bits in sizes.items() if bits == signal.bits)
    # 60B2 has 32 bits in one real drive, where the standard gives it 16.
    unmapped = frozenset(signal for signal, bits in sizes.items() if bits and bits != signal.bits)
    while True:
        plan = plan_mapping(present, outputs, extra)
        try:
            refused = write_mapping(sdo, node, plan)
        except SdoError as fixed:
            if fixed.silent:
                raise
            raise FixedMapping(
                f"node {node}: {fixed}: its telegrams are fixed, and without a telegram of 6040 with 60FF, and of 6041 "
                "with 6064, there is no CSV axis"
            ) from None
        if refused is None:
            check_mapping(sdo, node, plan)
            return plan._replace(refused=unmapped)
        signal = refused.signal
        if signal not in present:
            raise DeviceError(
                f"node {node}: {refused.text}; without it there is no "
                + _WITHOUT.get(
                    signal.obj,
                    "status of the encoder: correct [can.encoder]" if signal in extra else _NO_AXIS,
                )
            )
        present -= {signal}
        unmapped |= {signal}


def _bits(sdo: SdoClient, signal: Signal) -> int:
    """Size that the drive gives an object; 0 where it has none."""
    try:
        return 8 * len(sdo.read(signal.obj, signal.sub))
    except SdoError as refused:
        if refused.silent:
            raise
        return 0


def _rows(node: int, plan: Mapping) -> list[tuple[int, int, Pdo | None]]:
    """Communication object, identifier and telegram of every PDO, used or not."""
    receive = {pdo.number: pdo for pdo in plan.rpdos}
    transmit = {pdo.number: pdo for pdo in plan.tpdos}
    rows: list[tuple[int, int, Pdo | None]] = []
    for number in range(_PDOS):
        rows.append((0x1400 + number, 0x200 + 0x100 * number + node, receive.get(number)))
        rows.append((0x1800 + number, (0x180 + 0x100 * number + node) | _NO_RTR, transmit.get(number)))
    return rows


class Unmapped(NamedTuple):
    """Signal that a node refuses to map, and its abort code."""

    signal: Signal
    code: int

    @property
    def text(self) -> str:
        """For people: the object and why."""
        place = f"{self.signal.obj:04X}:{self.signal.sub:02X}"
        return f"object {place} cannot be mapped ({abort_text(self.code)})"


def write_mapping(sdo: SdoClient, node: int, plan: Mapping) -> Unmapped | None:
    """Write telegram by telegram; return what the drive refuses, or None."""
    # The procedure of CiA 301: PDO invalid, count 0, entries, count n, transmission type, PDO valid. Object by object,
    # whatever the EDS says: a library that follows it writes no entry where the EDS declares the mapping as ARRAY.
    for communication, cob_id, pdo in _rows(node, plan):
        if pdo is None:
            _switch_off(sdo, communication, cob_id)
            continue
        mapping = communication + 0x200
        sdo.set(communication, 1, cob_id | _INVALID)
        sdo.set(mapping, 0, 0, 1)
        for sub, signal in enumerate(pdo.signals, start=1):
            try:
                sdo.set(mapping, sub, signal.entry, 4)
            except SdoError as refused:
                if refused.silent:
                    raise
                return Unmapped(signal, refused.code)
        sdo.set(mapping, 0, len(pdo.signals), 1)
        _make_synchronous(sdo, communication)
        sdo.set(communication, 1, cob_id, 4)
    return None


def _make_synchronous(sdo: SdoClient, communication: int) -> None:
    """Write transmission type 1; an RPDO with a fixed type that acts on arrival will do."""
    try:
        sdo.set(communication, 2, SYNCHRONOUS, 1)
    except SdoError as refused:
        if refused.silent or communication >= _FIRST_TPDO or sdo.number(communication, 2) not in _ON_ARRIVAL:
            raise


_FIRST_TPDO: Final = 0x1800


def _switch_off(sdo: SdoClient, communication: int, cob_id: int) -> None:
    """Make an unused telegram invalid; a drive with fewer telegrams has nothing to switch off."""
    now = sdo.optional(communication, 1)
    if now is not None and not now & _INVALID:
        sdo.set(communication, 1, cob_id | _INVALID, 4)


def check_mapping(sdo: SdoClient, node: int, plan: Mapping) -> None:
    """Read the mapping back.

    Raises:
        DeviceError: it is not what was written.
    """
    # Read back and compared: what a drive has accepted is not always what it does.
    wrong = []
    for communication, cob_id, pdo in _rows(node, plan):
        if pdo is None:
            continue
        mapping = communication + 0x200
        kind = sdo.number(communication, 2)
        on_arrival = communication < _FIRST_TPDO and kind in _ON_ARRIVAL
        wanted = [
            (communication, 1, cob_id, 0x9FFF_FFFF),
            (communication, 2, kind if on_arrival else SYNCHRONOUS, 0xFF),
            (mapping, 0, len(pdo.signals), 0xFF),
            *((mapping, sub, signal.entry, 0xFFFF_FFFF) for sub, signal in enumerate(pdo.signals, start=1)),
        ]
        for index, sub, want, mask in wanted:
            have = sdo.number(index, sub)
            if have & mask != want & mask:
                wrong.append(f"{index:04X}:{sub:02X} = {have:X}, written {want:X}")
    if wrong:
        raise DeviceError(f"node {node}: the process data mapping did not take: {'; '.join(wrong)}")
