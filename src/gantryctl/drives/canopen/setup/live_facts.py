"""Facts of a drive on the bus, read over SDO."""

from __future__ import annotations

from collections.abc import Collection, Iterable
from dataclasses import replace
from typing import Final

from gantryctl.drives.canopen.bus.node import NodeIdentity
from gantryctl.drives.canopen.bus.sdo import SdoClient, SdoError, decode_object
from gantryctl.drives.od.facts import DriveFacts, ObjectFact
from gantryctl.drives.od.standard import standard_of

# CiA 301: no such object, no such sub-index. Whatever else a drive answers, the object is there.
_MISSING: Final = (0x0602_0000, 0x0609_0011)
# Attempt to write a read-only object. What a drive refuses in its present state, or as a value, can be written.
_READ_ONLY: Final = 0x0601_0002
# What is asked of every drive beside its parameters: commands, feedback, telegrams, and what may be missing.
ASKED: Final = (
    (0x1400, 1), (0x1400, 2), (0x1600, 0), (0x1800, 1), (0x1800, 2), (0x1A00, 0), (0x603F, 0), (0x6040, 0), (0x6041, 0),
    (0x6060, 0), (0x6061, 0), (0x6064, 0), (0x606C, 0), (0x6077, 0), (0x60B1, 0), (0x60B2, 0), (0x60FD, 0), (0x60FE, 1),
    (0x60FF, 0),
)  # fmt: skip


def read_facts(
    sdo: SdoClient,
    identity: NodeIdentity,
    objects: Iterable[tuple[int, int]],
    refused: Collection[tuple[int, int]] = (),
) -> DriveFacts:
    """Ask a drive for objects: which of them it has, and the values that they hold now.

    Args:
        refused: objects for which the drive has taken no value; of the others the standard says whether it does.

    Raises:
        DeviceError: the drive does not answer any more.
    """
    found = {place: _read(sdo, place, place not in refused) for place in objects}
    known = {place: fact for place, fact in found.items() if fact is not None}
    return DriveFacts(
        identity.vendor, identity.product, identity.revision, identity.serial, identity.software, known
    )


def _read(sdo: SdoClient, place: tuple[int, int], takes: bool) -> ObjectFact | None:
    known = standard_of(*place)
    writable = takes and known is not None and known.access.writable
    # CiA 301 has nothing that can be mapped below 2000h but the error register; a refused mapping shows at the set-up.
    mappable = place[0] >= 0x2000
    try:
        return ObjectFact(writable, mappable, decode_object(*place, sdo.read(*place)))
    except SdoError as refused:
        if refused.silent:
            raise
        return None if refused.code in _MISSING else ObjectFact(writable, mappable)
    except ValueError:
        # An object of another type than the standard gives it: it is there, and its value means something else.
        return ObjectFact(writable, mappable)


def read_only_of(sdo: SdoClient, places: Iterable[tuple[int, int]]) -> frozenset[tuple[int, int]]:
    """Objects that cannot be written, shown by writing the value that they hold."""
    found = set()
    for place in places:
        try:
            sdo.write(*place, sdo.read(*place))
        except SdoError as refused:
            if refused.silent:
                raise
            if refused.code == _READ_ONLY:
                found.add(place)
    return frozenset(found)


def with_mapped(facts: DriveFacts, unmapped: Iterable[tuple[int, int]]) -> DriveFacts:
    """The same drive, knowing what it maps into no telegram, and that a transmission type which stays is fixed."""
    objects = dict(facts.objects)
    for place in unmapped:
        if place in objects:
            objects[place] = replace(objects[place], mappable=False)
    kind = objects.get(_KIND_OF_COMMANDS)
    if kind is not None and kind.default != _AT_SYNC:
        objects[_KIND_OF_COMMANDS] = replace(kind, writable=False)
    return replace(facts, objects=objects)


_KIND_OF_COMMANDS: Final = (0x1400, 2)
_AT_SYNC: Final = 1


def without_csv(facts: DriveFacts) -> DriveFacts:
    """The same drive, knowing that it takes no mode 9."""
    modes = facts.objects[0x6060, 0]
    return replace(facts, objects={**facts.objects, (0x6060, 0): replace(modes, high=8)})
