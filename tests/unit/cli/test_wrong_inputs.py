"""Wrong inputs by the hundred: one line, no traceback, and one exit code for one cause, whatever the command."""

from __future__ import annotations

import io
import sys
from collections.abc import Iterator
from contextlib import redirect_stderr, redirect_stdout
from pathlib import Path
from typing import NamedTuple

import click
import pytest

from gantryctl.cli.main import INTERRUPTED, OUTPUT_CLOSED, run
from gantryctl.cli.main import cli as root
from gantryctl.cli.values import FINITE, Whole
from gantryctl.machine import default_machine_path
from support.command_line import Answer, cli, done
from support.unread import unread_stream

# --- numbers -----------------------------------------------------------------------------------------------------

NO_NUMBERS = ("five", "1_0", "\u0661\u0662", "\uff15", "0x10", "1,5", "nan", "inf", "1e400", "")
"""Words, Python's underscores, Arabic and full-width digits, hexadecimal, a comma, nothing, no finite number."""


class Place(NamedTuple):
    """Where a command takes a number."""

    words: tuple[str, ...]
    option: str


def numbers_taken(group: click.Group, words: tuple[str, ...] = ()) -> Iterator[Place]:
    """Every option of every command whose value is a number."""
    context = click.Context(group)
    for name in group.list_commands(context):
        command = group.get_command(context, name)
        assert command is not None
        for parameter in command.params:
            if isinstance(parameter, click.Option) and (
                parameter.type is FINITE or isinstance(parameter.type, Whole)
            ):
                yield Place((*words, name), parameter.opts[0])
            assert parameter.type.__class__ not in (
                type(click.INT),
                type(click.FLOAT),
                click.IntRange,
                click.FloatRange,
            ), f"{name} {parameter.name}: Python's own numbers"
        if isinstance(command, click.Group):
            yield from numbers_taken(command, (*words, name))


def test_no_option_takes_what_is_no_number() -> None:
    """Each place gets two of the words in turn, so that each word is tried at a dozen places and more."""
    places = list(numbers_taken(root))
    tried = 0
    for place in places:
        for step in (0, 1):
            word = NO_NUMBERS[(2 * tried + step) % len(NO_NUMBERS)]
            answer = cli(*place.words, place.option, word)
            assert answer.code == 2, (place, word, answer)
            assert answer.err.startswith("error: "), answer
            assert place.option in answer.err, (place, word, answer)
            assert answer.err.count("\n") == 1, answer
        tried += 1
    assert 2 * tried >= 120


# --- files -------------------------------------------------------------------------------------------------------

FILE = "FILE"
TAKE_FILES = (
    "config check FILE",
    "config show FILE",
    "config diff FILE",
    "config export --config FILE",
    "config init new.toml --sheet FILE",
    "move 5 --config FILE",
    "move 5 --program FILE:Mine",
    "jog + --for 1 --config FILE",
    "stops --config FILE",
    "speed-test --config FILE",
    "status --config FILE",
    "alarms --config FILE",
    "reset --config FILE",
    "encoder show --config FILE",
    "retain show --config FILE",
    "brake-test --config FILE",
    "identify --config FILE",
    "tune --config FILE",
    "commission --config FILE",
    "serve --config FILE",
    "doctor --config FILE",
    "journal show --config FILE",
    "accuracy stats FILE --required 0.1",
    "accuracy report --required 0.1 --measured FILE",
    "new mine --template gantry --answers FILE",
    "new mine --template gantry --motor FILE",
    "size FILE",
    "size init mine.toml --template gantry --answers FILE",
    "campaign run FILE",
    "campaign plan FILE",
    "campaign show FILE",
    "compare FILE",
    "compare --drift FILE",
    "faults run --file FILE",
    "eds check FILE",
    "can log FILE",
    "trace show FILE",
    "trace plot FILE",
    "trace export FILE --format csv",
    "backup show FILE",
    "backup restore FILE",
    "journal verify --without-key --anchor FILE",
)
NO_FILES = ("missing.log", "folder.log", "empty.log", "binary.log", "hello.log")


def prepare() -> None:
    Path("folder.log").mkdir()
    Path("empty.log").touch()
    Path("binary.log").write_bytes(bytes(range(256)) * 8)
    Path("hello.log").write_text("hello\n")


@pytest.mark.parametrize("line", TAKE_FILES)
def test_a_file_that_is_none_of_its_kind_is_a_wrong_command(line: str) -> None:
    prepare()
    before = sorted(Path().iterdir())
    for name in NO_FILES:
        # An empty table of answers has none, and every value is the template's: nothing is wrong with it.
        if name == "empty.log" and "--answers" in line:
            continue
        answer = cli(*line.replace(FILE, name).split())
        assert (answer.code, answer.out) == (2, ""), (name, answer)
        assert answer.err.startswith("error: "), answer
        assert answer.err[:-1].replace("\n", "").isprintable(), answer
        assert name in answer.err, (name, answer)
    assert sorted(Path().iterdir()) == before


# --- places ------------------------------------------------------------------------------------------------------


def test_a_file_that_cannot_be_written_there_is_a_wrong_command() -> None:
    prepare()
    Path("a_file").touch()
    done("move", "0.01")
    for place in ("nowhere/file", "folder.log", "a_file/file"):
        for line in (
            "trace export --format csv --out PLACE",
            "trace export --format parquet --out PLACE",
            "trace plot --out PLACE",
            "trace compare last last --out PLACE",
            "why --out PLACE",
            "faults run --fault A2 --out PLACE",
            "config init --improved PLACE/m.toml",
            "size init --template gantry PLACE/s.toml",
        ):
            answer = cli(
                *line.replace("PLACE/m", "nowhere/m")
                .replace("PLACE/s", "nowhere/s")
                .replace("PLACE", place)
                .split()
            )
            assert (answer.code, answer.out) == (2, ""), (line, answer)
            assert answer.err.count("\n") == 1, answer


# --- nothing there yet, and what may not be ---------------------------------------------------------------------

NOTHING_YET = (
    "trace show",
    "trace plot",
    "journal show",
    "journal verify",
    "journal anchor",
    "journal export out.jsonl",
    "journal copy copy.db",
    "backup create backup.tar.gz",
    "can log --last",
)


@pytest.mark.parametrize("line", NOTHING_YET)
def test_what_was_never_made_is_told_as_a_wrong_command(line: str) -> None:
    answer = cli(*line.split())
    assert (answer.code, answer.out) == (2, ""), answer
    assert list(Path().iterdir()) == []


# --- standard input and output ----------------------------------------------------------------------------------


@pytest.mark.parametrize(
    "line",
    [
        "explain",
        "--help",
        "config show",
        "config show --json",
        "config schema",
        "faults list",
        "move 0.01 --json",
    ],
)
def test_a_closed_standard_output_ends_every_command_as_other_tools_end(line: str) -> None:
    said = io.StringIO()
    with unread_stream() as out, redirect_stdout(out), redirect_stderr(said):
        code = run(line.split())
    assert (code, said.getvalue()) == (OUTPUT_CLOSED, "")


@pytest.mark.parametrize("line", ["explain", "move 0.01"])
def test_no_standard_output_at_all_is_no_fault(line: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(sys, "stdout", None)
    assert run(line.split()) == 0


def test_an_error_that_nobody_can_read_has_its_code(monkeypatch: pytest.MonkeyPatch) -> None:
    with unread_stream() as gone:
        monkeypatch.setattr(sys, "stderr", gone)
        assert run(["move", "five"]) == 2
        monkeypatch.setattr(sys, "stderr", None)
        assert run(["move", "five"]) == 2


def test_no_standard_input_at_all_is_none_that_anybody_types_at(monkeypatch: pytest.MonkeyPatch) -> None:
    """A password, the questions of a new axis, a reading by hand."""
    monkeypatch.setattr(sys, "stdin", None)
    for line in ("user add anna --role viewer", "new rig"):
        assert run(line.split()) == 2, line


def test_an_interrupted_command_has_the_code_of_an_interrupt(monkeypatch: pytest.MonkeyPatch) -> None:
    def interrupted(*_: object) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr("gantryctl.program.alarms.table.all_codes", interrupted)
    assert cli_code("explain") == INTERRUPTED


def cli_code(*words: str) -> int:
    with redirect_stdout(io.StringIO()), redirect_stderr(io.StringIO()):
        return run(list(words))


def with_input(monkeypatch: pytest.MonkeyPatch, data: bytes, line: str) -> Answer:
    monkeypatch.setattr(sys, "stdin", io.TextIOWrapper(io.BytesIO(data)))
    return cli(*line.split())


def test_a_minus_in_the_place_of_a_file_is_standard_input(monkeypatch: pytest.MonkeyPatch) -> None:
    """The same output as with the file, but for its name."""
    done("move", "0.01")
    recording = next(Path().absolute().parent.rglob("*.parquet")).read_bytes()
    machine = default_machine_path().read_bytes()
    for line, data in (
        ("config check -", machine),
        ("config show -", machine),
        ("move 0.01 --config -", machine),
        ("trace show -", recording),
        ("trace export - --format csv --out out.csv", recording),
        ("new mine --template gantry --answers -", b"# none\n"),
    ):
        answer = with_input(monkeypatch, data, line)
        assert (answer.code, answer.err) == (0, ""), (line, answer)


def test_standard_input_is_refused_where_it_has_no_place(monkeypatch: pytest.MonkeyPatch) -> None:
    machine = default_machine_path().read_bytes()
    for line in (
        "config diff - -",
        "trace plot -",
        "identify --config -",
        "serve --config -",
        "tune --config -",
        "accuracy stats -",
    ):
        answer = with_input(monkeypatch, machine, line)
        assert (answer.code, answer.out) == (2, ""), (line, answer)
        assert "standard input" in answer.err, (line, answer)
    monkeypatch.setattr(sys, "stdin", None)
    assert "standard input is closed" in cli("config", "check", "-").err


def test_a_byte_order_mark_is_no_fault(monkeypatch: pytest.MonkeyPatch) -> None:
    mark = b"\xef\xbb\xbf"
    machine = default_machine_path()
    Path("m.toml").write_bytes(mark + machine.read_bytes())
    table = (machine.parent / "examples/paper_table2.csv").read_bytes()
    Path("t.csv").write_bytes(mark + table)
    Path("a.toml").write_bytes(mark + b"# my answers\n")
    Path("i.json").write_bytes(mark + b'{"injection": []}')
    done("config", "check", "m.toml")
    done("config", "check", "m.toml", "--json")
    assert cli("accuracy", "stats", "t.csv").out == cli("accuracy", "stats", "paper_table2.csv").out.replace(
        "paper_table2.csv", "t.csv"
    )
    done("new", "mine", "--template", "gantry", "--answers", "a.toml")
    # The mark is read over: what is wrong is told of what follows it.
    assert "there is no [[injection]] table" in cli("faults", "run", "--file", "i.json").err
    assert with_input(monkeypatch, mark + machine.read_bytes(), "config check -").code == 0
