"""Certificates: their end is read as the reference library reads it, and is announced in time."""

from __future__ import annotations

from datetime import UTC, datetime, timedelta
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from gantryctl.errors import UsageError
from gantryctl.service.supervisor.certificates import CertificateWatch, refuse_expired, validity

pytest.importorskip("cryptography", reason="the extra [opcua] is not installed")
from support.certificates import certificate

NOW = datetime(2030, 6, 1, 12, tzinfo=UTC)


@pytest.mark.parametrize("form", ["pem", "der"])
@pytest.mark.parametrize(
    "end", [NOW, datetime(2049, 12, 31, 23, 59, 59, tzinfo=UTC), datetime(2050, 1, 1, tzinfo=UTC)]
)
def test_the_end_is_read_from_both_forms_before_and_after_2050(
    tmp_path: Path, form: str, end: datetime
) -> None:
    """From 2050 on the time is written with four digits of the year."""
    file = certificate(tmp_path / f"some.{form}", NOW - timedelta(days=10), end)
    assert validity(file) == (NOW - timedelta(days=10), end)


def test_a_file_with_key_and_chain_is_judged_by_its_first_certificate(tmp_path: Path) -> None:
    first = certificate(tmp_path / "a.pem", NOW - timedelta(days=10), NOW).read_bytes()
    second = certificate(tmp_path / "b.pem", NOW - timedelta(days=10), NOW + timedelta(days=10)).read_bytes()
    both = tmp_path / "both.pem"
    both.write_bytes(b"a comment\n" + first + second)
    assert validity(both).end == NOW


def test_what_is_not_valid_now_is_refused_with_its_date(tmp_path: Path) -> None:
    file = certificate(tmp_path / "some.pem", NOW, NOW + timedelta(days=1))
    refuse_expired(file, NOW)
    with pytest.raises(UsageError, match=r"some\.pem: expired on 2030-06-02"):
        refuse_expired(file, NOW + timedelta(days=1))
    with pytest.raises(UsageError, match=r"is not valid before 2030-06-01 12:00 UTC"):
        refuse_expired(file, NOW - timedelta(seconds=1))


@given(st.binary(max_size=200))
def test_anything_else_is_refused_with_one_kind_of_error(
    tmp_path_factory: pytest.TempPathFactory, data: bytes
) -> None:
    file = tmp_path_factory.getbasetemp() / "other.der"
    file.write_bytes(data)
    with pytest.raises(UsageError, match="is no certificate"):
        validity(file)


def test_every_byte_cut_off_is_noticed(tmp_path: Path) -> None:
    file = certificate(tmp_path / "some.der", NOW, NOW + timedelta(days=1))
    whole = file.read_bytes()
    for length in range(0, len(whole), 7):
        file.write_bytes(whole[:length])
        with pytest.raises(UsageError):
            validity(file)


def test_the_last_thirty_days_are_announced_once_a_day(tmp_path: Path) -> None:
    file = certificate(tmp_path / "some.pem", NOW, NOW + timedelta(days=40))
    watch, hours = CertificateWatch(), [24 * 9, 24 * 11, 24 * 11 + 1, 24 * 12, 24 * 45]
    said = [watch.due([file], NOW + timedelta(hours=hour)) for hour in hours]
    assert said == [
        [],
        [f"SEC-11 {file}: expires in 29 days, on 2030-07-11"],
        [],
        [f"SEC-11 {file}: expires in 28 days, on 2030-07-11"],
        [f"SEC-11 {file}: expired on 2030-07-11"],
    ]


def test_each_certificate_has_a_warning_of_its_own(tmp_path: Path) -> None:
    files = [certificate(tmp_path / f"{n}.pem", NOW, NOW + timedelta(days=n)) for n in (3, 40, 5)]
    watch = CertificateWatch()
    assert [line.split(" in ")[1].split(",")[0] for line in watch.due(files, NOW)] == ["3 days", "5 days"]
    assert watch.due(files, NOW + timedelta(hours=1)) == []
    # The third one expires in 30 days: that is the first day of its warning.
    assert len(watch.due(files, NOW + timedelta(days=10))) == 3


@pytest.mark.parametrize(("after_s", "words"), [(-1, "expires in"), (0, "expired on"), (1, "expired on")])
def test_a_certificate_expires_until_its_end_and_has_expired_from_then_on(
    tmp_path: Path, after_s: int, words: str
) -> None:
    file = certificate(tmp_path / "some.pem", NOW - timedelta(days=9), NOW)
    (line,) = CertificateWatch().due([file], NOW + timedelta(seconds=after_s))
    assert words in line


def test_a_certificate_that_is_gone_is_told_as_one_that_ends(tmp_path: Path) -> None:
    file = tmp_path / "some.pem"
    with pytest.raises(UsageError, match=r"some\.pem: No such file or directory"):
        validity(file)
    assert CertificateWatch().due([file], NOW) == [f"SEC-11 {file}: No such file or directory"]


def der(tag: int, *parts: bytes) -> bytes:
    content = b"".join(parts)
    assert len(content) < 128
    return bytes([tag, len(content)]) + content


@pytest.mark.parametrize("version", [b"", der(0xA0, der(0x02, b"\x02"))])
def test_a_certificate_of_the_first_version_has_no_number_of_it(tmp_path: Path, version: bytes) -> None:
    """X.509 version 1 leaves it out (RFC 5280, section 4.1): serial number, algorithm and issuer come first."""
    times = der(0x30, der(0x17, b"300601120000Z"), der(0x17, b"310601120000Z"))
    body = der(0x30, version, der(0x02, b"\x07"), der(0x30), der(0x30), times, der(0x30), der(0x30))
    file = tmp_path / "some.der"
    file.write_bytes(der(0x30, body, der(0x30), der(0x03, b"\x00")))
    assert validity(file) == (NOW, datetime(2031, 6, 1, 12, tzinfo=UTC))
