"""Whatever a machine file is, the answer is a machine or finished lines; never a traceback, never a wait."""

import os
import time

import pytest

from gantryctl.errors import ConfigError
from gantryctl.machine import (
    default_machine,
    default_machine_path,
    load_machine,
    parse_machine,
    with_values,
)
from gantryctl.machine.reading import MAX_BYTES, MAX_LINE
from support.frames_left import leaves_frames

TEXT = default_machine_path().read_text(encoding="utf-8")


def only_problem(call, *arguments):
    start = time.monotonic()
    with pytest.raises(ConfigError) as caught:
        call(*arguments)
    assert time.monotonic() - start < 5.0
    assert len(caught.value.problems) == 1
    assert caught.value.exit_code == 2
    assert str(caught.value).isprintable()
    return caught.value.problems[0]


def test_a_refused_machine_leaves_no_frames() -> None:
    wrong = {"plant.load.eccentric_sign": 0.5}
    assert not leaves_frames(lambda: with_values(default_machine(), wrong), ConfigError)


@pytest.mark.parametrize(
    ("content", "words"),
    [
        (TEXT.encode("utf-16"), "byte-order mark"),
        (b"a = 1\0", "binary (a zero byte at 5)"),
        (b"# fine\na = '\xff'", "line 2: byte 0xff is not UTF-8"),
        (b"#" * (MAX_BYTES + 1), "larger than 256 KB"),
        (b"#" + b"x" * MAX_LINE, f"line 1 has {MAX_LINE + 1} characters, allowed {MAX_LINE}"),
        (b"\x80" * 1000, "line 1: byte 0x80 is not UTF-8"),
    ],
)
def test_contents_that_are_no_machine_file(tmp_path, content, words):
    path = tmp_path / "f.toml"
    path.write_bytes(content)
    line = only_problem(load_machine, path)
    assert line.startswith(f"{path}: ")
    assert words in line


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("[machine]\nname = 'x'\nname = 'y'\n", "line 3, column 11: the key is given twice: name = 'y'"),
        ("[machine]\nname = 'x'\nname = 'y'", "line 3: the key is given twice: name = 'y'"),
        ("[machine]\n[machine]\n", "line 2, column 9: the table is given twice: [machine]"),
        ("[machine", "line 1: Expected ']'"),
        ("[machine]\nname = hust\n", 'line 2, column 8: not a value; text stands in "quotes"'),
        ("[axis]\npos_max_deg = 180.\n", "line 2"),
        ("[axis]\npos_max_deg 180\n", "line 2, column 13: a key needs '=' and a value: pos_max_deg 180"),
        ("[axis]\n= 180\n", "line 2, column 1: neither a key"),
        ("a = '\x1b[31m'", "line 1"),
        ("a = [" * 60 + "]" * 60, "not a value"),
        ("a = " + "[\n" * 3000 + "]\n" * 3000, "nested deeper than 8 levels"),
        ("a = " + "[" * 9 + "]" * 9, "nested deeper than 8 levels"),
        ("a." * 9 + "b = 1", "nested deeper than 8 levels"),
        ("[" + "a." * 200 + "b]", "nested deeper than 8 levels"),
        ("\n".join("a." * 240 + f"b{i} = 1" for i in range(400)), "nested deeper than 8 levels"),
        ("a = '\ud800'", "not a text that UTF-8 can hold"),
        ("x" * (MAX_BYTES + 1), "larger than 256 KB"),
    ],
    ids=range(17),
)
def test_text_that_is_no_machine_file(text, words):
    line = only_problem(parse_machine, text, "f.toml")
    assert line.startswith("f.toml: ")
    assert words in line


def test_paths_that_cannot_be_read(tmp_path):
    missing = tmp_path / "missing.toml"
    assert only_problem(load_machine, missing) == (
        f"{missing}: does not exist; `gantryctl config init` writes one to start from"
    )
    assert "is not a file" in only_problem(load_machine, tmp_path)
    assert "is not a file" in only_problem(load_machine, "/dev/zero")
    assert only_problem(load_machine, "a\0b").startswith("a\\x00b: cannot be read: ")
    assert "cannot be read: File name too long" in only_problem(load_machine, "x" * 5000)
    loop = tmp_path / "loop"
    loop.symlink_to(loop)
    assert "cannot be read" in only_problem(load_machine, loop)
    pipe = tmp_path / "pipe"
    os.mkfifo(pipe)
    assert "is not a file" in only_problem(load_machine, pipe)


def test_a_file_without_permission(tmp_path, monkeypatch):
    path = tmp_path / "f.toml"
    path.write_text(TEXT, encoding="utf-8")

    def refuse(*_):
        raise PermissionError(13, "Permission denied")

    monkeypatch.setattr("gantryctl.machine.reading.open", refuse, raising=False)  # root may read everything
    assert only_problem(load_machine, path) == f"{path}: cannot be read: Permission denied"


def test_a_huge_number_of_problems_is_answered_in_time_and_cut():
    start = time.monotonic()
    with pytest.raises(ConfigError) as caught:
        parse_machine("\n".join(f"pos_max_de{i} = 1" for i in range(9000)), "f.toml")
    assert time.monotonic() - start < 5.0
    assert len(caught.value.problems) == 501
    assert caught.value.problems[-1] == "f.toml: and 8504 problems more"


@pytest.mark.parametrize(
    "number", ["1" + "0" * 450, "-1" + "0" * 450, "0x" + "f" * 450, "1e400", "-1e400", "nan", "-inf"]
)
@pytest.mark.parametrize(
    "key", ["pos_max_deg = 180.0", "reducer_ratio = 88.0", "turns = 4096", 'name = "hust_gantry"']
)
def test_numbers_beyond_every_type(key, number):
    with pytest.raises(ConfigError) as caught:
        parse_machine(TEXT.replace(key, f"{key.partition('=')[0]} = {number}"), "f.toml")
    assert any(key.partition(" ")[0] in line for line in caught.value.problems)


def test_line_ends_of_other_systems(tmp_path):
    path = tmp_path / "f.toml"
    path.write_bytes(TEXT.replace("\n", "\r\n").encode())
    assert load_machine(path) == default_machine()
