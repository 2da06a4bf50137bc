"""OPC UA: which certificates open a channel, by the trust list and the lists of revoked ones."""

from __future__ import annotations

from datetime import UTC, datetime, timedelta
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

asyncua = pytest.importorskip("asyncua", reason="the extra [opcua] is not installed")
from asyncua import ua  # noqa: E402
from asyncua.crypto.cert_gen import load_private_key  # noqa: E402
from cryptography import x509  # noqa: E402
from cryptography.hazmat.primitives.asymmetric import ec  # noqa: E402
from cryptography.hazmat.primitives.hashes import SHA256  # noqa: E402
from cryptography.hazmat.primitives.serialization import Encoding  # noqa: E402
from cryptography.x509.oid import ExtendedKeyUsageOID, NameOID  # noqa: E402

from gantryctl.gateway.opcua import trust as trust_module  # noqa: E402
from gantryctl.gateway.opcua.trust import (  # noqa: E402
    NotTrusted,
    TrustList,
    _is_authority,
    first_of,
    speaks_for,
)
from support.opcua_bench import CLIENT, PASSWORD, Bench, Run  # noqa: E402
from support.opcua_table import SECURE  # noqa: E402
from support.opcua_wire import Refused, password  # noqa: E402

pytestmark = pytest.mark.filterwarnings("ignore")  # of asyncua itself
MODES = ua.MessageSecurityMode


async def refused(bench: Bench, key: str) -> bool:
    try:
        async with await bench.client(key=key):
            return False
    except (TimeoutError, ua.UaError, ConnectionError, OSError):
        return True


def test_the_trust_list_is_read_again_without_a_new_start(run: Run) -> None:
    async def check(bench: Bench) -> None:
        trusted = bench.root / "opcua" / "trusted"
        assert await refused(bench, "stranger")
        (trusted / "stranger.der").write_bytes((bench.root / "stranger.der").read_bytes())
        await bench.listener.sweep()
        assert not await refused(bench, "stranger")
        (trusted / "broken.der").write_bytes(b"no certificate")
        await bench.listener.sweep()  # it is left out
        assert not await refused(bench, "stranger")
        (trusted / "broken.der").unlink()
        (trusted / "stranger.der").unlink()
        await bench.listener.sweep()
        assert await refused(bench, "stranger")
        assert not await refused(bench, "client")

    run(check)


def test_a_file_of_the_list_that_is_written_over_is_read_again(tmp_path: Path) -> None:
    told: list[str] = []
    events: Any = SimpleNamespace(put=lambda kind, text: told.append(text))
    listed = TrustList(tmp_path, events)
    key = ec.generate_private_key(ec.SECP256R1())
    one, other = (of_client(key, 5).public_bytes(Encoding.DER) for _ in range(2))
    for certificate in (one, other):
        (tmp_path / "trusted" / "client.new").write_bytes(certificate)
        (tmp_path / "trusted" / "client.new").replace(tmp_path / "trusted" / "client.der")
        assert listed.refresh()
        assert not listed.refresh()
        assert listed.judge(certificate).public_bytes(Encoding.DER) == certificate
    with pytest.raises(NotTrusted, match="not in the trust list"):
        listed.judge(one)
    assert told == ["OPC UA: the trust list was read again, 1 certificates"]


@pytest.mark.parametrize(("late_us", "trusted"), [(-1, True), (0, True), (1, False)])
def test_a_certificate_counts_until_its_last_moment(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, late_us: int, trusted: bool
) -> None:
    certificate = of_client(ec.generate_private_key(ec.SECP256R1()), 5)
    (tmp_path / "trusted").mkdir()
    (tmp_path / "trusted" / "client").write_bytes(certificate.public_bytes(Encoding.DER))
    listed = TrustList(tmp_path, SimpleNamespace(put=lambda *_: None))  # type: ignore[arg-type]
    listed.refresh()
    now = certificate.not_valid_after_utc + timedelta(microseconds=late_us)
    monkeypatch.setattr(trust_module, "datetime", SimpleNamespace(now=lambda _: now))
    if trusted:
        assert listed.judge(certificate.public_bytes(Encoding.DER)) == certificate
        return
    with pytest.raises(NotTrusted, match="is valid from"):
        listed.judge(certificate.public_bytes(Encoding.DER))


AUTHORITY = x509.Name([x509.NameAttribute(NameOID.COMMON_NAME, "authority")])


def of_client(
    key: Any,
    days: int,
    authority: Any = None,
    *,
    begins: int = -10,
    lacks: str = "",
    purpose: x509.ObjectIdentifier = ExtendedKeyUsageOID.CLIENT_AUTH,
) -> x509.Certificate:
    """A client's certificate whose last and first day are so far away, signed by itself or by an authority.

    Args:
        lacks: one of the uses of its key that OPC UA asks for.
    """
    name = x509.Name([x509.NameAttribute(NameOID.COMMON_NAME, "dated")])
    uses = dict.fromkeys(
        ("digital_signature", "content_commitment", "key_encipherment", "data_encipherment"), True
    )
    never = dict.fromkeys(
        ("key_agreement", "key_cert_sign", "crl_sign", "encipher_only", "decipher_only"), False
    )
    now = datetime.now(UTC)
    return (
        x509.CertificateBuilder()
        .subject_name(name)
        .issuer_name(name if authority is None else AUTHORITY)
        .public_key(key.public_key())
        .serial_number(x509.random_serial_number())
        .not_valid_before(now + timedelta(days=begins))
        .not_valid_after(now + timedelta(days=days))
        .add_extension(x509.SubjectAlternativeName([x509.UniformResourceIdentifier(CLIENT)]), critical=False)
        .add_extension(
            x509.KeyUsage(**{**uses, **never, **({lacks: False} if lacks else {})}), critical=False
        )
        .add_extension(x509.ExtendedKeyUsage([purpose]), critical=False)
        .add_extension(x509.BasicConstraints(ca=False, path_length=None), critical=True)
        .sign(authority or key, SHA256())
    )


class Listed:
    """A trust list of its own, its clients, and what was told of it."""

    def __init__(self, folder: Path) -> None:
        self.folder, self.told = folder, list[str]()
        events: Any = SimpleNamespace(put=lambda kind, text: self.told.append(text))
        self.list = TrustList(folder, events)
        self.key = ec.generate_private_key(ec.SECP256R1())

    def put(self, name: str, made: Any, coding: Encoding = Encoding.DER) -> None:
        (self.folder / name).write_bytes(made.public_bytes(coding))
        self.list.refresh()

    def client(self, days: int = 5, authority: Any = None, **how: Any) -> x509.Certificate:
        return of_client(self.key, days, authority, **how)

    def opens(self, certificate: x509.Certificate) -> bool:
        try:
            return self.list.judge(certificate.public_bytes(Encoding.DER)) == certificate
        except NotTrusted:
            return False


@pytest.fixture
def listed(tmp_path: Path) -> Listed:
    return Listed(tmp_path)


@pytest.mark.parametrize(("begins", "days", "valid"), [(-10, 1, True), (-10, -1, False), (1, 10, False)])
def test_a_client_certificate_is_valid_from_its_first_day_to_its_last(
    listed: Listed, begins: int, days: int, valid: bool
) -> None:
    made = listed.client(days, begins=begins)
    listed.put("trusted/dated.der", made)
    assert listed.opens(made) is valid


def test_what_is_no_certificate_opens_nothing(listed: Listed) -> None:
    """Bytes of anybody, and a certificate that says nothing of its uses."""
    plain = (
        x509.CertificateBuilder()
        .subject_name(x509.Name([]))
        .issuer_name(x509.Name([]))
        .public_key(listed.key.public_key())
        .serial_number(7)
        .not_valid_before(datetime.now(UTC) - timedelta(days=1))
        .not_valid_after(datetime.now(UTC) + timedelta(days=1))
        .sign(listed.key, SHA256())
    )
    for each in (b"", b"nothing", plain.public_bytes(Encoding.DER)):
        with pytest.raises(NotTrusted, match="no certificate of an application"):
            listed.list.judge(each)


def test_a_list_that_cannot_be_read_trusts_nobody(listed: Listed, monkeypatch: pytest.MonkeyPatch) -> None:
    made = listed.client()
    listed.put("trusted/one.der", made)
    assert listed.opens(made)

    def gone() -> None:
        raise OSError("gone")

    monkeypatch.setattr(listed.list, "_files", gone)
    assert [text for text in listed.list._read() if "nobody is trusted: gone" in text]
    assert not listed.opens(made)


def test_only_a_certificate_for_clients_is_taken(listed: Listed) -> None:
    """OPC UA Part 6, section 6.2.2: four uses of the key, and the purpose of a client."""
    wrong: list[dict[str, Any]] = [
        {"lacks": "digital_signature"},
        {"lacks": "content_commitment"},
        {"lacks": "key_encipherment"},
        {"lacks": "data_encipherment"},
        {"purpose": ExtendedKeyUsageOID.SERVER_AUTH},
    ]
    made = [listed.client(**how) for how in ({}, *wrong)]
    for number, each in enumerate(made):
        listed.put(f"trusted/{number}.der", each)
    assert listed.opens(made[0])
    for each in made[1:]:
        with pytest.raises(NotTrusted, match="not for clients"):
            listed.list.judge(each.public_bytes(Encoding.DER))


@pytest.mark.parametrize(
    ("chain", "first"),
    [
        # Tag 30h, a length in one byte or in as many as the byte behind the tag says (X.690), then what is behind it.
        ("30 02 AA BB", "30 02 AA BB"), ("30 02 AA BB 30 01 CC", "30 02 AA BB"),
        ("30 81 02 AA BB 30 01 CC", "30 81 02 AA BB"), ("30 82 00 02 AA BB CC", "30 82 00 02 AA BB"),
        ("30 82 01 00 AA", "30 82 01 00 AA"),
        ("", ""), ("30 01 AA", ""), ("31 02 AA BB", ""),
    ],
)  # fmt: skip
def test_the_first_certificate_of_a_chain_is_that_of_the_application(chain: str, first: str) -> None:
    assert first_of(bytes.fromhex(chain)) == bytes.fromhex(first)
    assert first_of(None) == b""


@pytest.mark.parametrize(
    ("ca", "signs", "purpose", "authority"),
    [
        (True, True, None, True), (True, True, ExtendedKeyUsageOID.SERVER_AUTH, True),
        (True, True, ExtendedKeyUsageOID.CLIENT_AUTH, False), (False, True, None, False), (True, False, None, False),
        (None, True, None, False), (True, False, ExtendedKeyUsageOID.SERVER_AUTH, False),
        (False, True, ExtendedKeyUsageOID.SERVER_AUTH, False),
    ],
)  # fmt: skip
def test_an_authority_issues_signs_and_is_no_client(
    ca: bool | None, signs: bool, purpose: x509.ObjectIdentifier | None, authority: bool
) -> None:
    key, now = ec.generate_private_key(ec.SECP256R1()), datetime.now(UTC)
    uses = dict.fromkeys(
        ("digital_signature", "content_commitment", "key_encipherment", "data_encipherment", "key_agreement"),
        False,
    )
    made = (
        x509.CertificateBuilder().subject_name(AUTHORITY).issuer_name(AUTHORITY).public_key(key.public_key())
    )
    made = made.serial_number(1).not_valid_before(now).not_valid_after(now + timedelta(days=1))
    usage = x509.KeyUsage(
        **uses, key_cert_sign=signs, crl_sign=True, encipher_only=False, decipher_only=False
    )
    made = made.add_extension(usage, critical=True)
    if ca is not None:
        made = made.add_extension(x509.BasicConstraints(ca=ca, path_length=None), critical=True)
    if purpose is not None:
        made = made.add_extension(x509.ExtendedKeyUsage([purpose]), critical=False)
    assert _is_authority(made.sign(key, SHA256())) is authority


def of_authority(key: Any) -> x509.Certificate:
    """An authority's own certificate."""
    now = datetime.now(UTC)
    usage = dict.fromkeys(
        ("digital_signature", "content_commitment", "key_encipherment", "data_encipherment", "key_agreement"),
        False,
    )
    builder = x509.CertificateBuilder().subject_name(AUTHORITY).issuer_name(AUTHORITY)
    builder = builder.public_key(key.public_key()).serial_number(x509.random_serial_number())
    builder = builder.not_valid_before(now - timedelta(days=10)).not_valid_after(now + timedelta(days=10))
    builder = builder.add_extension(x509.BasicConstraints(ca=True, path_length=0), critical=True)
    signs = x509.KeyUsage(
        **usage, key_cert_sign=True, crl_sign=True, encipher_only=False, decipher_only=False
    )
    return builder.add_extension(signs, critical=True).sign(key, SHA256())


def revoking(authority: Any, *revoked: x509.Certificate) -> x509.CertificateRevocationList:
    now = datetime.now(UTC)
    made = x509.CertificateRevocationListBuilder().issuer_name(AUTHORITY).last_update(now)
    made = made.next_update(now + timedelta(days=1))
    for each in revoked:
        row = x509.RevokedCertificateBuilder().serial_number(each.serial_number).revocation_date(now).build()
        made = made.add_revoked_certificate(row)
    return made.sign(authority, SHA256())


def test_an_authority_in_the_list_speaks_for_the_clients_that_it_has_signed(listed: Listed) -> None:
    authority, other = (ec.generate_private_key(ec.SECP256R1()) for _ in range(2))
    signed, stranger = listed.client(authority=authority), listed.client(authority=other)
    assert not listed.opens(signed)
    listed.put("trusted/authority.pem", of_authority(authority), Encoding.PEM)
    assert (listed.opens(signed), listed.opens(stranger)) == (True, False)


def test_what_is_revoked_opens_nothing_and_an_authority_that_is_speaks_for_nobody(listed: Listed) -> None:
    authority = ec.generate_private_key(ec.SECP256R1())
    own, signed, alone, lost = (
        of_authority(authority),
        listed.client(authority=authority),
        listed.client(),
        listed.client(),
    )
    listed.put("trusted/authority.pem", own, Encoding.PEM)
    for name, each in (("alone", alone), ("lost", lost)):
        listed.put(f"trusted/{name}.der", each)
    assert all(map(listed.opens, (signed, alone, lost)))
    listed.put("revoked/lost.crl", revoking(authority, lost))
    assert [listed.opens(each) for each in (signed, alone, lost)] == [True, True, False]
    listed.put("revoked/own.crl", revoking(authority, own), Encoding.PEM)
    assert [listed.opens(each) for each in (signed, alone, lost)] == [False, True, False]


@pytest.mark.parametrize(("folder", "left"), [("trusted", [True, True]), ("revoked", [False, False])])
def test_a_file_that_cannot_be_read_trusts_nobody_and_one_that_revokes_may_mean_anybody(
    listed: Listed, folder: str, left: list[bool]
) -> None:
    authority = ec.generate_private_key(ec.SECP256R1())
    signed, alone = listed.client(authority=authority), listed.client()
    listed.put("trusted/authority.der", of_authority(authority))
    listed.put("trusted/alone.der", alone)
    (listed.folder / folder / "broken.der").write_bytes(b"no certificate")
    assert listed.list.refresh()
    assert [listed.opens(each) for each in (signed, alone)] == left
    less = "it is left out" if folder == "trusted" else "nobody is trusted"
    assert f"broken.der cannot be read, {less}" in listed.told[-1]


def test_a_certificate_speaks_for_its_own_application_alone() -> None:
    key = ec.generate_private_key(ec.SECP256R1())
    made = of_client(key, 5)
    for uri, own in ((CLIENT, True), (f"{CLIENT}x", False)):
        assert speaks_for(made, ua.ApplicationDescription(ApplicationUri=uri)) is own


def test_the_certificate_of_somebody_else_opens_no_session(run: Run) -> None:
    async def check(bench: Bench) -> None:
        # Certificates are public: a stranger names the trusted one in CreateSession.
        with pytest.raises(Refused, match="BadSecurityChecksFailed"):
            await bench.open("Basic256Sha256", MODES.SignAndEncrypt, "stranger")
        assert "not in the trust list" in bench.texts()[-1]
        (bench.trusted / "stranger.der").write_bytes(bench.certificate("stranger"))
        await bench.listener.sweep()
        wire = await bench.open("Basic256Sha256", MODES.SignAndEncrypt, "stranger")
        assert await wire.create(bench.certificate("client"), CLIENT) == "BadCertificateInvalid"
        assert await wire.create(bench.certificate("stranger"), "urn:another") == "BadCertificateUriInvalid"
        # A refused CreateSession leaves nothing behind that could be activated.
        assert await wire.activate(password("viewer", PASSWORD)) == "BadSessionIdInvalid"
        assert await wire.create(bench.certificate("stranger"), CLIENT) == "Good"
        assert (
            await wire.activate(password("viewer", PASSWORD), signed=False)
            == "BadApplicationSignatureInvalid"
        )
        assert (await wire.ask(ua.ReadRequest()))[0] == "BadSessionNotActivated"

    run(check)


def test_a_trusted_client_does_not_make_others_trusted(run: Run) -> None:
    async def check(bench: Bench) -> None:
        # The library's own certificates say that they are an authority.
        issuer = x509.load_der_x509_certificate(bench.certificate("client"))
        assert issuer.extensions.get_extension_for_class(x509.BasicConstraints).value.ca
        stranger = x509.load_der_x509_certificate(bench.certificate("stranger"))
        builder = x509.CertificateBuilder().subject_name(stranger.subject).issuer_name(issuer.subject)
        builder = builder.public_key(stranger.public_key()).serial_number(7)
        builder = builder.not_valid_before(stranger.not_valid_before_utc)
        builder = builder.not_valid_after(stranger.not_valid_after_utc)
        for extension in stranger.extensions:
            builder = builder.add_extension(extension.value, extension.critical)
        made = builder.sign(await load_private_key(bench.root / "client.pem"), SHA256())
        (bench.root / "minted.der").write_bytes(made.public_bytes(Encoding.DER))
        (bench.root / "minted.pem").write_bytes((bench.root / "stranger.pem").read_bytes())
        with pytest.raises(Refused, match="BadSecurityChecksFailed"):
            await bench.open("Basic256Sha256", MODES.SignAndEncrypt, "minted")

    run(check)


async def crl(bench: Bench) -> bytes:
    """A list that revokes the client."""
    certificate = x509.load_der_x509_certificate(bench.certificate("client"))
    now = datetime.now(UTC)
    row = (
        x509.RevokedCertificateBuilder().serial_number(certificate.serial_number).revocation_date(now).build()
    )
    made = x509.CertificateRevocationListBuilder().issuer_name(certificate.subject).last_update(now)
    made = made.next_update(now + timedelta(days=1)).add_revoked_certificate(row)
    key = await load_private_key(bench.root / "client.pem")
    return made.sign(key, SHA256()).public_bytes(Encoding.DER)


@pytest.mark.parametrize("how", ["emptied", "revoked", "revocation list damaged"])
def test_taking_trust_away_ends_all_sessions_at_once(run: Run, how: str) -> None:
    async def check(bench: Bench) -> None:
        wires = [await bench.session(policy, MODES.SignAndEncrypt) for policy in SECURE]
        bench.texts()
        if how == "emptied":
            for file in bench.trusted.iterdir():
                file.unlink()
        else:
            revoked = bench.trusted.with_name("revoked") / "list.der"
            revoked.write_bytes(await crl(bench) if how == "revoked" else b"no list")
        await bench.listener.sweep()
        for wire in wires:
            with pytest.raises((Refused, ConnectionError)):
                await wire.ask(ua.ReadRequest())
        assert sum("OPC UA session ended" in text for text in bench.texts()) == len(wires)
        with pytest.raises(Refused, match="BadSecurityChecksFailed"):
            await bench.open("Basic256Sha256", MODES.SignAndEncrypt)

    run(check)


def test_a_list_that_is_empty_from_the_start_trusts_nobody(run: Run) -> None:
    async def check(bench: Bench) -> None:
        for file in bench.trusted.iterdir():
            file.unlink()
        await bench.listener.sweep()
        assert not any(bench.trusted.iterdir())
        with pytest.raises(Refused):
            await bench.open("Basic256Sha256", MODES.SignAndEncrypt)

    run(check)
