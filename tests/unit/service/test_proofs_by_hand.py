"""What proves a journal, by hand: seals of a kind, mirrors that are cut or torn, what is read of which kind."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from gantryctl.service.recorder.journal.chain import Anchor
from gantryctl.service.recorder.journal.key import Key
from gantryctl.service.recorder.journal.mirror import Mirror, Newest, read_mirror
from gantryctl.service.recorder.journal.reading import read_journal
from gantryctl.service.recorder.journal.writer import Journal

KEY = Key(bytes(32))


def newest(seq: int) -> Newest:
    return Newest(Anchor(seq, "00", "", "journal"), 0)


def test_a_seal_is_of_one_kind() -> None:
    """By openssl dgst -sha256 -mac HMAC with a key of 64 zeros, of the kind, a zero byte and the content."""
    assert KEY.seal("event", b"x") == "9f8f3613b068920d119a1a707d2c632cf81e19aad81a3137f4456817c2e83a9f"
    assert (
        len({KEY.seal(kind, content) for kind, content in (("event", b"x"), ("newest", b"x"), ("", b"x"))})
        == 3
    )


@pytest.mark.parametrize(
    ("size", "seq", "damaged"),
    # The second writing stands first, the first one behind it in the next page.
    [(4608, 4, False), (4609, 4, True), (4607, 4, True), (4096, 4, True), (512, 4, True), (511, None, True)],
)
def test_a_mirror_that_was_cut_is_damaged_though_one_copy_is_whole(
    tmp_path: Path, size: int, seq: int | None, damaged: bool
) -> None:
    made = Mirror(tmp_path / "mirror", KEY)
    for number in (3, 4):
        made.write(newest(number))
    made.close()
    data = made.path.read_bytes()
    made.path.write_bytes(data[:size].ljust(size, b"\0"))
    shown = read_mirror(made.path, KEY)
    assert (None if shown.newest is None else shown.newest.anchor.seq, shown.damaged) == (seq, damaged)
    # Written again it is whole, and shows what was written last.
    again = Mirror(made.path, KEY)
    again.write(newest(5))
    again.close()
    after = read_mirror(made.path, KEY)
    assert after.newest is not None
    assert (after.newest.anchor.seq, after.damaged, made.path.stat().st_size) == (5, False, 4608)


def test_a_mirror_goes_on_over_its_older_copy_after_a_start(tmp_path: Path) -> None:
    for seq in range(1, 6):
        made = Mirror(tmp_path / "mirror", KEY)
        assert seq == 1 or made.shown.newest == newest(seq - 1)
        made.write(newest(seq))
        made.close()
    shown = read_mirror(tmp_path / "mirror", KEY)
    assert (shown.newest, shown.turn) == (newest(5), 5)


@pytest.mark.usefixtures("keys")
def test_events_are_read_behind_a_number_of_a_kind_and_from_either_end(tmp_path: Path) -> None:
    journal = Journal(tmp_path)
    for number in range(1, 7):
        kind = "note" if number % 2 else "command"
        record = {"utc": "", "monotonic_ns": 1, "kind": kind, "text": f"event {number}"}
        journal.append(1, 0, number, [json.dumps(record).encode()])
    journal.close()

    def read(**how: object) -> list[int]:
        return [entry.seq for entry in read_journal(tmp_path, **how)]  # type: ignore[arg-type]

    assert read() == [1, 2, 3, 4, 5, 6]
    assert read(after=2, limit=3) == [3, 4, 5]
    assert read(limit=2, newest=True) == [5, 6]
    assert read(kind="note") == [1, 3, 5]
    assert read(kind="note", limit=2, newest=True) == [3, 5]
