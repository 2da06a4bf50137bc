"""The trust list of OPC UA, by hand: what is revoked, and what voids a list."""

from __future__ import annotations

import os
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

asyncua = pytest.importorskip("asyncua", reason="the extra [opcua] is not installed")
from cryptography import x509  # noqa: E402

from gantryctl.gateway.opcua import trust  # noqa: E402


def test_every_row_of_a_list_is_revoked(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Of two lists with two certificates each."""
    rows = {b"one": (5, 7), b"two": (7, 9)}
    monkeypatch.setattr(
        trust, "_revoked", lambda data: [SimpleNamespace(serial_number=each) for each in rows[data]]
    )
    events: Any = SimpleNamespace(put=lambda *_: None)
    known = trust.TrustList(tmp_path, events)
    for name in (b"one", b"two"):
        (tmp_path / "revoked" / name.decode()).write_bytes(name)
    assert known.refresh()
    assert known._serials == {5, 7, 9}
    assert not known.refresh()
    (tmp_path / "revoked" / "two").unlink()
    assert known.refresh()
    assert known._serials == {5, 7}


@pytest.mark.parametrize("renamed", [True, False])
def test_a_list_that_is_copied_here_with_its_old_time_is_read(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, renamed: bool
) -> None:
    """As `cp -p` and `rsync` do it: one of the same size in its place, or more in the same file."""
    monkeypatch.setattr(
        trust, "_revoked", lambda data: [SimpleNamespace(serial_number=each) for each in data]
    )
    known = trust.TrustList(tmp_path, SimpleNamespace(put=lambda *_: None))  # type: ignore[arg-type]
    file, draft = tmp_path / "revoked" / "list", tmp_path / "revoked" / ".draft"
    file.write_bytes(b"\x05")
    assert known.refresh()
    at = file.stat().st_mtime_ns
    if renamed:
        draft.write_bytes(b"\x07")
        draft.replace(file)
    else:
        file.write_bytes(b"\x05\x07")
    os.utime(file, ns=(at, at))
    assert known.refresh()
    assert 7 in known._serials


@pytest.mark.parametrize(
    ("revoked", "trusted"),
    [({}, 1), ({"list": b"good"}, 1), ({".list": b"bad"}, 1), ({"a": b"bad", "b": b"good"}, 0), ({"b": b"bad"}, 0)],
)  # fmt: skip
def test_a_list_of_revoked_ones_that_cannot_be_read_voids_the_other_list(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, revoked: dict[str, bytes], trusted: int
) -> None:
    """Whatever is read behind it; a file with a dot is one that is being copied here."""

    def rows(data: bytes) -> list[Any]:
        if data == b"bad":
            raise ValueError("no list")
        return [SimpleNamespace(serial_number=5)]

    monkeypatch.setattr(trust, "_revoked", rows)
    monkeypatch.setattr(trust, "_certificate", lambda data: data)
    monkeypatch.setattr(trust, "_der", lambda data: data)
    monkeypatch.setattr(trust, "_is_authority", lambda data: False)
    known = trust.TrustList(tmp_path, SimpleNamespace(put=lambda *_: None))  # type: ignore[arg-type]
    (tmp_path / "trusted" / "client").write_bytes(b"client")
    for name, data in revoked.items():
        (tmp_path / "revoked" / name).write_bytes(data)
    assert known.refresh()
    assert len(known._known) == trusted


def test_a_certificate_in_letters_may_stand_behind_a_text(monkeypatch: pytest.MonkeyPatch) -> None:
    """As `openssl x509 -text` writes it."""
    read = {
        f"load_{kind}_x509_{what}": lambda _, kind=kind: kind
        for kind in ("pem", "der")
        for what in ("certificate", "crl")
    }
    monkeypatch.setattr(trust, "x509", SimpleNamespace(**read))
    for data, kind in (
        (b"Certificate:\n  Version: 3\n-----BEGIN CERTIFICATE-----", "pem"),
        (b"0\x82", "der"),
    ):
        assert (trust._certificate(data), trust._revoked(data)) == (kind, kind)


def test_a_folder_that_cannot_be_read_trusts_nobody_until_it_can(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A list of revoked ones may be in it. What is read again stands in the journal, what is read first does not."""
    told: list[str] = []
    for reader in ("_certificate", "_der"):
        monkeypatch.setattr(trust, reader, lambda data: data)
    monkeypatch.setattr(trust, "_is_authority", lambda _: False)
    known = trust.TrustList(tmp_path, SimpleNamespace(put=lambda _, text: told.append(text)))  # type: ignore[arg-type]
    (tmp_path / "trusted" / "client").write_bytes(b"client")
    assert known.refresh()
    assert (known._known, told) == ({b"client"}, [])

    def locked() -> Any:
        raise PermissionError(13, "Permission denied")

    with monkeypatch.context() as patch:
        patch.setattr(known, "_files", locked)
        assert [known.refresh() for _ in range(2)] == [True, False]
        assert not known._known
        again = "OPC UA: the trust list was read again, 0 certificates"
        assert told == [again, "OPC UA: the trust list: nobody is trusted: [Errno 13] Permission denied"]
    assert known.refresh()
    assert known._known == {b"client"}


def test_only_the_service_adds_a_client(tmp_path: Path) -> None:
    before = os.umask(0o022)
    try:
        trust.TrustList(tmp_path, SimpleNamespace())  # type: ignore[arg-type]
    finally:
        os.umask(before)
    assert [(tmp_path / name).stat().st_mode & 0o777 for name in ("trusted", "revoked")] == [0o700] * 2


@pytest.mark.parametrize(
    ("names", "speaks"),
    [
        (["urn:own"], True), (["urn:other", "urn:own"], True), (["urn:other"], False), ([], False),
        (x509.ExtensionNotFound("none", x509.SubjectAlternativeName.oid), False), (ValueError("broken"), False),
    ],
)  # fmt: skip
def test_a_certificate_speaks_for_the_application_that_it_names(names: Any, speaks: bool) -> None:
    """And for none where it names none."""

    def extension(kind: Any) -> Any:
        assert kind is x509.SubjectAlternativeName
        if isinstance(names, Exception):
            raise names
        found = {x509.UniformResourceIdentifier: names, x509.DNSName: ["urn:own"]}
        return SimpleNamespace(value=SimpleNamespace(get_values_for_type=found.__getitem__))

    certificate: Any = SimpleNamespace(extensions=SimpleNamespace(get_extension_for_class=extension))
    application: Any = SimpleNamespace(ApplicationUri="urn:own")
    assert trust.speaks_for(certificate, application) is speaks
