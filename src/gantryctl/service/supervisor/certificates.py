"""Validity of the certificates that the service uses, and warnings before they expire."""

from __future__ import annotations

import ssl
from collections.abc import Iterable
from datetime import UTC, datetime, timedelta
from pathlib import Path
from typing import Final, NamedTuple

from gantryctl.errors import UsageError
from gantryctl.program.alarms.codes import Code
from gantryctl.program.alarms.log import refusal
from gantryctl.program.alarms.words import Words

WARN_DAYS: Final = 30
_DAY: Final = timedelta(days=1)
# UTCTime and GeneralizedTime (RFC 5280, section 4.1.2.5).
_TIMES: Final = {0x17: "%y%m%d%H%M%SZ", 0x18: "%Y%m%d%H%M%SZ"}
_VERSION: Final = 0xA0
# Serial number, algorithm and issuer stand before it.
_BEFORE_VALIDITY: Final = 3
_PEM: Final = b"-----BEGIN CERTIFICATE-----"


class Validity(NamedTuple):
    """Begin and end of a certificate."""

    begin: datetime
    end: datetime


def validity(file: Path) -> Validity:
    """Read the validity of the first certificate in a file, PEM or DER.

    Raises:
        UsageError: the file cannot be read, or holds no certificate.
    """
    try:
        data = file.read_bytes()
        if _PEM in data:
            first = data[data.index(_PEM) :].decode("ascii", "replace")
            length = first.index("-----END") + len("-----END CERTIFICATE-----")
            data = ssl.PEM_cert_to_DER_cert(first[:length])
        (certificate,) = _parts(data)
        fields = _parts(_parts(certificate[1])[0][1])
        place = _BEFORE_VALIDITY + (fields[0][0] == _VERSION)
        begin, end = (_time(tag, content) for tag, content in _parts(fields[place][1]))
    except OSError as fault:
        raise UsageError(f"{file}: {fault.strerror or fault}") from fault
    except (ValueError, IndexError, KeyError) as fault:
        raise UsageError(f"{file}: is no certificate (X.509, PEM or DER)") from fault
    return Validity(begin, end)


def _parts(data: bytes) -> list[tuple[int, bytes]]:
    """Split a DER sequence into its elements: tag and content."""
    found, at = [], 0
    while at < len(data):
        tag, length = data[at], data[at + 1]
        at += 2
        if length & 0x80:
            count = length & 0x7F
            length, at = int.from_bytes(data[at : at + count]), at + count
        if at + length > len(data):
            raise ValueError("cut off")
        found.append((tag, data[at : at + length]))
        at += length
    return found


def _time(tag: int, content: bytes) -> datetime:
    return datetime.strptime(content.decode("ascii"), _TIMES[tag]).replace(tzinfo=UTC)


def refuse_expired(file: Path, now: datetime) -> None:
    """Raise UsageError for a certificate that is not valid now."""
    begin, end = validity(file)
    if now >= end:
        raise UsageError(f"{file}: expired on {end:%Y-%m-%d}: browsers refuse it; get a new one")
    if now < begin:
        raise UsageError(f"{file}: is not valid before {begin:%Y-%m-%d %H:%M} UTC")


class CertificateWatch:
    """Warnings about certificates: from 30 days before the end on, once a day each."""

    def __init__(self) -> None:
        self._said: dict[Path, datetime] = {}

    def due(self, files: Iterable[Path], now: datetime) -> list[str]:
        """Return one line for each certificate whose warning is due."""
        found = []
        for file in files:
            text = _warning(file, now)
            if text and now - self._said.get(file, datetime.min.replace(tzinfo=UTC)) >= _DAY:
                self._said[file] = now
                found.append(text)
        return found


def _warning(file: Path, now: datetime) -> str:
    try:
        end = validity(file).end
    except UsageError as fault:
        return refusal(Code.SEC_11, reason=str(fault)).line
    days = (end - now) / _DAY
    if days > WARN_DAYS:
        return ""
    date = f"{end:%Y-%m-%d}"
    ended = Words.CERTIFICATE_ENDED(file=file, date=date)
    reason = Words.CERTIFICATE_ENDS(file=file, days=days, date=date) if days > 0 else ended
    return refusal(Code.SEC_11, reason=reason).line
