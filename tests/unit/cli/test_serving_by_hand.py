"""What `gantryctl serve` makes of its options: where it may listen, what it tells, and what is watched."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

from gantryctl.cli.service import serving
from gantryctl.cli.service.serving import Listen, address_of, certificate_files, opcua_command, split
from gantryctl.errors import UsageError


class Socket:
    """A socket that listens at a port of its own."""

    def getsockname(self) -> tuple[str, int]:
        return ("", 4711)


class Accounts:
    """The users file of a service with one account."""

    def __init__(self, _: Path) -> None:
        pass

    def all(self) -> dict[str, Any]:
        return {"anna": None}


def listen(address: str, *names: str, files: bool = False) -> Listen:
    return Listen(address, *((Path("page.pem"), Path("page.key")) if files else (None, None)), names)


@pytest.mark.parametrize(
    ("page", "told"),
    [
        (listen("127.0.0.1:0"), "http://127.0.0.1:4711/"),
        (listen("[::1]:0"), "http://[::1]:4711/"),
        (listen("[::]:0", "gantry.example", "other.example", files=True), "https://gantry.example:4711/"),
    ],
)
def test_the_address_that_is_told_opens_the_page(page: Listen, told: str) -> None:
    assert address_of(page, Socket()) == told  # type: ignore[arg-type]


def test_what_is_kept_of_the_start_starts_it_again() -> None:
    found = serving._options_of(listen("127.0.0.1:8650", "a", "b", files=True))
    assert found == {
        "listen": "127.0.0.1:8650",
        "tls_cert": str(Path("page.pem").resolve()),
        "tls_key": str(Path("page.key").resolve()),
        "names": ["a", "b"],
    }
    assert serving._options_of(listen("127.0.0.1:8650"))["tls_cert"] is None


def test_certificates_of_page_and_opc_ua_are_watched_each_without_the_other(tmp_path: Path) -> None:
    own, trusted = tmp_path / "opcua" / "certificate.der", tmp_path / "opcua" / "trusted" / "client.der"
    trusted.parent.mkdir(parents=True)
    for file in (own, trusted):
        file.touch()
    assert certificate_files(listen("127.0.0.1:0"), tmp_path) == [own, trusted]
    assert certificate_files(None, tmp_path) == [own, trusted]
    assert certificate_files(listen("0.0.0.0:0", files=True), None) == [Path("page.pem")]


def test_users_alone_open_no_page_to_other_machines(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Their passwords would go over the network in clear."""
    monkeypatch.setattr(serving, "Users", Accounts)
    with pytest.raises(UsageError, match="it needs --tls-cert and --tls-key"):
        serving._listener(listen("0.0.0.0:0"), tmp_path)


@pytest.mark.parametrize(
    "address", ["4840", "127.0.0.1:", ":4840", "127.0.0.1:65536", "127.0.0.1:\N{SUPERSCRIPT TWO}"]
)
def test_an_address_that_is_none_is_told_with_its_option(tmp_path: Path, address: str) -> None:
    with pytest.raises(UsageError, match=r"--opcua .*: write HOST:PORT, for example 127\.0\.0\.1:4840"):
        opcua_command(address, tmp_path, tmp_path)
    with pytest.raises(UsageError, match=r"--listen .*: write HOST:PORT, for example 127\.0\.0\.1:8650"):
        split(address)
