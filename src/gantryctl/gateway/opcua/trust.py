"""The trust list of OPC UA: certificates of clients as files in two folders, read again when they change."""

from __future__ import annotations

from collections.abc import Iterator
from datetime import UTC, datetime
from pathlib import Path
from typing import Final

from asyncua import ua
from cryptography import x509
from cryptography.hazmat.primitives.serialization import Encoding
from cryptography.x509 import verification
from cryptography.x509.oid import ExtendedKeyUsageOID

from gantryctl.service.memory.events import EventLog

_PEM: Final = b"-----BEGIN"


class NotTrusted(Exception):
    """A certificate that opens no channel; the message says why, for the journal."""


class TrustList:
    """Certificates in `trusted/`, without those that a list in `revoked/` names; files in DER or PEM.

    A certificate is trusted by itself, or by an authority that is in the list; what may open a channel itself is no
    authority. An empty list trusts nobody. A file that cannot be read trusts nobody either: in `trusted/` it is left
    out, in `revoked/` it may name anybody, so the whole list is void.
    """

    def __init__(self, folder: Path, events: EventLog) -> None:
        self._trusted, self._revoked = folder / "trusted", folder / "revoked"
        for each in (self._trusted, self._revoked):
            each.mkdir(parents=True, exist_ok=True, mode=0o700)
        self._events = events
        self._seen: object = None
        self._known: frozenset[bytes] = frozenset()
        self._authorities: verification.Store | None = None
        self._serials: frozenset[int] = frozenset()

    def refresh(self) -> bool:
        """Read the files again if any has changed; return whether one has."""
        found: object
        try:
            stats = [(file, file.stat()) for file in self._files()]
            found = [(file, stat.st_mtime_ns, stat.st_size, stat.st_ino) for file, stat in stats]
        except FileNotFoundError:
            return False  # one has just been taken away: the next turn sees the rest
        except OSError as fault:
            found = fault.strerror
        if found == self._seen:
            return False
        first, self._seen = self._seen is None, found
        faults = self._read()
        if not first:
            self._events.put(
                "service", f"OPC UA: the trust list was read again, {len(self._known)} certificates"
            )
        for text in faults:
            self._events.put("service", f"OPC UA: the trust list: {text}")
        return True

    def judge(self, certificate: bytes) -> x509.Certificate:
        """Read a certificate (DER) that may open a channel now.

        Raises:
            NotTrusted: it may not.
        """
        try:
            found = x509.load_der_x509_certificate(certificate)
            begin, end = found.not_valid_before_utc, found.not_valid_after_utc
            usage = found.extensions.get_extension_for_class(x509.KeyUsage).value
            purposes = found.extensions.get_extension_for_class(x509.ExtendedKeyUsage).value
        except (ValueError, x509.ExtensionNotFound) as fault:
            raise NotTrusted(f"no certificate of an application: {fault}") from None
        if not begin <= datetime.now(UTC) <= end:
            raise NotTrusted(f"the certificate is valid from {begin:%Y-%m-%d} to {end:%Y-%m-%d}")
        needed = (
            usage.digital_signature,
            usage.content_commitment,
            usage.key_encipherment,
            usage.data_encipherment,
            ExtendedKeyUsageOID.CLIENT_AUTH in purposes,
        )
        # OPC UA Part 6, section 6.2.2.
        if not all(needed):
            raise NotTrusted("the certificate is not for clients of OPC UA (its key usage)")
        if found.serial_number in self._serials:
            raise NotTrusted("the certificate is revoked")
        if certificate not in self._known and not self._by_authority(found):
            raise NotTrusted("the certificate is not in the trust list")
        return found

    def _by_authority(self, certificate: x509.Certificate) -> bool:
        if self._authorities is None:
            return False
        # `judge` looks at what a client's certificate must have, and `_is_authority` has looked at the others.
        anything = verification.ExtensionPolicy.permit_all()
        authority = anything.require_present(
            x509.BasicConstraints, verification.Criticality.AGNOSTIC, lambda *_: None
        )
        policy = verification.PolicyBuilder().store(self._authorities)
        policy = policy.extension_policies(ca_policy=authority, ee_policy=anything)
        try:
            policy.build_client_verifier().verify(certificate, [])
        except verification.VerificationError:
            return False
        return True

    def _files(self) -> Iterator[Path]:
        for folder in (self._trusted, self._revoked):
            yield from sorted(file for file in folder.iterdir() if not file.name.startswith("."))

    def _read(self) -> list[str]:
        """Read all files; return what is wrong with them."""
        known, serials, faults, void = [], set(), [], False
        try:
            files = list(self._files())
        except OSError as fault:
            files, void = [], True
            faults.append(f"nobody is trusted: {fault}")
        for file in files:
            try:
                if file.parent == self._revoked:
                    serials |= {row.serial_number for row in _revoked(file.read_bytes())}
                else:
                    known.append(_certificate(file.read_bytes()))
            except (ValueError, OSError) as fault:
                void = void or file.parent == self._revoked
                less = "nobody is trusted" if file.parent == self._revoked else "it is left out"
                faults.append(f"{file.name} cannot be read, {less}: {fault}")
        if void:
            known = []
        # One that is revoked itself speaks for nobody.
        authorities = [each for each in known if _is_authority(each) and each.serial_number not in serials]
        # cryptography refuses an empty store.
        self._authorities = verification.Store(authorities) if authorities else None
        self._known = frozenset(_der(each) for each in known)
        self._serials = frozenset(serials)
        return faults


def _der(certificate: x509.Certificate) -> bytes:
    return certificate.public_bytes(Encoding.DER)


def _certificate(data: bytes) -> x509.Certificate:
    return x509.load_pem_x509_certificate(data) if _PEM in data else x509.load_der_x509_certificate(data)


def _revoked(data: bytes) -> x509.CertificateRevocationList:
    return x509.load_pem_x509_crl(data) if _PEM in data else x509.load_der_x509_crl(data)


def _is_authority(certificate: x509.Certificate) -> bool:
    # Many an application signs its own certificate as an authority, and must not sign others into the list.
    found = certificate.extensions
    try:
        issues = found.get_extension_for_class(x509.BasicConstraints).value.ca
        signs = found.get_extension_for_class(x509.KeyUsage).value.key_cert_sign
    except (x509.ExtensionNotFound, ValueError):
        return False
    try:
        purposes = found.get_extension_for_class(x509.ExtendedKeyUsage).value
    except x509.ExtensionNotFound:
        return issues and signs
    return issues and signs and ExtendedKeyUsageOID.CLIENT_AUTH not in purposes


def first_of(chain: bytes | None) -> bytes:
    """Cut the certificate of the application from a chain (DER); empty without one."""
    if not chain or len(chain) < 4 or chain[0] != 0x30:
        return b""
    count = chain[1] & 0x7F if chain[1] & 0x80 else 0
    length = int.from_bytes(chain[2 : 2 + count]) if count else chain[1]
    return chain[: 2 + count + length]


def speaks_for(certificate: x509.Certificate, application: ua.ApplicationDescription) -> bool:
    """Whether a certificate belongs to the application that a client says it is."""
    try:
        names = certificate.extensions.get_extension_for_class(x509.SubjectAlternativeName).value
    except (x509.ExtensionNotFound, ValueError):
        return False
    return application.ApplicationUri in names.get_values_for_type(x509.UniformResourceIdentifier)
