"""What a request may make the library read: nothing that grows beyond the bytes that came.

The library's reader believes what a message says of itself. A length below -1 moves it back, so that a few bytes are
read again and again; an array of values that have no bytes, or with dimensions that are larger than it, has as many
elements as it says. The first needs no variant. All others need one, and a client's variants are in extension objects
only: so these are looked at here, and are read if they are of a kind that has none.
"""

from __future__ import annotations

from typing import Any, Final

from asyncua import ua
from asyncua.common.utils import Buffer, NotEnoughData, ServiceError
from asyncua.ua.ua_binary import Primitives, nodeid_from_binary, struct_from_binary

_IDS: Final = ua.ObjectIds
# Numbers of the types in namespace 0, 0 for none.
_IDENTITIES: Final = frozenset(
    {
        _IDS.AnonymousIdentityToken_Encoding_DefaultBinary,
        _IDS.UserNameIdentityToken_Encoding_DefaultBinary,
        _IDS.X509IdentityToken_Encoding_DefaultBinary,
        _IDS.IssuedIdentityToken_Encoding_DefaultBinary,
    }
)
# There are no events here, and nothing is aggregated.
_FILTERS: Final = frozenset({0, _IDS.DataChangeFilter_Encoding_DefaultBinary})


class Bounded(Buffer):
    """The bytes of a message, read forwards only."""

    def read(self, size: int) -> bytes:
        """Take bytes; NotEnoughData beyond the end, and for a length below zero."""
        if size < 0:
            raise NotEnoughData(f"a length of {size}")
        return bytes(super().read(size))

    def skip(self, size: int) -> None:
        """Pass over bytes."""
        self.read(size)

    def copy(self, size: int = -1) -> Bounded:
        """The next bytes once more, or all that are left."""
        return Bounded(self._data, self._cur_pos, self._size if size < 0 else min(size, self._size))


def bounded(body: Buffer) -> Bounded:
    """The rest of a buffer of the library."""
    return Bounded(body._data, body._cur_pos, body._size)


def read_header(body: Bounded) -> Any:
    """Read a `RequestHeader`, without its additional header, which nobody has a use for (Part 4, section 7.32)."""
    head = ua.RequestHeader()
    head.AuthenticationToken = nodeid_from_binary(body)
    body.skip(8)  # the time of the client
    head.RequestHandle = Primitives.UInt32.unpack(body)
    head.ReturnDiagnostics = Primitives.UInt32.unpack(body)
    head.AuditEntryId = Primitives.String.unpack(body)
    head.TimeoutHint = Primitives.UInt32.unpack(body)
    _skip_extension(body)
    return head


def judge_identity(body: Bounded) -> None:
    """Look at the identity token in the parameters of ActivateSession.

    Raises:
        ServiceError: it is not a range.
    """
    struct_from_binary(ua.SignatureData, body)
    for part in (ua.SignedSoftwareCertificate, None):
        for _ in range(Primitives.Int32.unpack(body)):
            Primitives.String.unpack(body) if part is None else struct_from_binary(part, body)
    if _skip_extension(body) not in _IDENTITIES:
        raise ServiceError(ua.StatusCodes.BadIdentityTokenRejected)


def judge_filters(body: Bounded, *, new: bool) -> None:
    """Look at the filters in the parameters of CreateMonitoredItems (`new`) or ModifyMonitoredItems.

    Raises:
        ServiceError: one is not of a kind that this server has.
    """
    body.skip(4 + 4)  # subscription, timestamps to return
    for _ in range(Primitives.Int32.unpack(body)):
        if new:
            struct_from_binary(ua.ReadValueId, body)
        body.skip(4)  # monitoring mode, or number of the item
        body.skip(4 + 8)  # client handle, sampling interval
        if _skip_extension(body) not in _FILTERS:
            raise ServiceError(ua.StatusCodes.BadMonitoredItemFilterUnsupported)
        body.skip(4 + 1)  # queue size, discard oldest


def _skip_extension(body: Bounded) -> Any:
    """Pass over an extension object; its type in namespace 0, None for any other."""
    kind = nodeid_from_binary(body)
    # As the library reads it, so that both see the same: it knows no body in XML, and reads on after a length of -1.
    encoding = body.read(1)[0]
    if encoding > 1:
        raise ServiceError(ua.StatusCodes.BadDataEncodingUnsupported)
    if encoding:
        body.skip(Primitives.Int32.unpack(body))
    return kind.Identifier if kind.NamespaceIndex == 0 else None
