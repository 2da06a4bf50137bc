"""The trust list of OPC UA, by hand: what is revoked, and what voids a list."""

from __future__ import annotations

from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

asyncua = pytest.importorskip("asyncua", reason="the extra [opcua] is not installed")
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
