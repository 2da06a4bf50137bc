"""Facts of a drive on the bus, read over SDO."""

from __future__ import annotations

from collections.abc import Collection, Iterable

from gantryctl.drives.canopen.bus.node import NodeIdentity
from gantryctl.drives.canopen.bus.sdo import SdoClient, SdoError, decode_object
from gantryctl.drives.od.facts import DriveFacts, ObjectFact
from gantryctl.drives.od.standard import standard_of

# CiA 301: no such object, no such sub-index. Whatever else a drive answers, the object is there.
_MISSING = (0x0602_0000, 0x0609_0011)


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
