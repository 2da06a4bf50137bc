"""Every command line of the README and of the pages for beginners does what the page says."""

from __future__ import annotations

import re
import shlex
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

import pytest

from support.command_line import cli, done

ROOT = Path(__file__).parents[2]
PAGES = {
    "README.md": [],
    "docs/tutorials/first-gantry.md": [],
    "docs/how-to/after-an-alarm.md": ["move 0.5"],
    "docs/how-to/inject-faults.md": [],
    "docs/how-to/describe-a-machine.md": ["config init other.toml"],
    "docs/how-to/back-up-and-restore.md": ["move 0.1"],
    "docs/how-to/prove-accuracy.md": ["config init my.toml"],
    "docs/how-to/write-a-program.md": [],
}
"""Pages, and what has to happen before their first command."""

NOT_RUN = {
    "gantryctl accuracy run --ensemble": "`make demo` runs it; ten seconds and more",
    "gantryctl accuracy run --on-engine": "has tests of its own; 40 s",
    "gantryctl accuracy run --out report": "the README runs it without pages, the tutorial with them",
    "gantryctl accuracy run --config my.toml": "the tutorial runs it with a machine of its own",
    "gantryctl stops --find-quick --config": "the README runs it without a file",
    "gantryctl accuracy run --procedure B --runs 5": "five runs; ISO 230-2 over five runs has tests of its own",
    "gantryctl accuracy measure": "needs an instrument, or a minute; has tests of its own",
    "gantryctl instrument": "needs an instrument; has tests of its own",
    "gantryctl drive field": "five minutes; has tests of its own, the slow one with the count",
    "gantryctl drive sim": "a server that runs until it is stopped; has tests of its own",
    "gantryctl tune": "has tests of its own",
    "gantryctl analyse": "has tests of its own",
    "gantryctl size": "has tests of its own",
    "gantryctl bench": "has tests of its own; a minute on an idle computer",
    "gantryctl doctor": "has tests of its own; its verdict is that of the computer",
    "gantryctl campaign": "has tests of its own; hours",
    "gantryctl faults campaign": "has tests of its own; twenty minutes",
    "gantryctl faults shrink": "has tests of its own; needs a seed that broke something",
    "gantryctl faults replay --file": "has tests of its own; needs the file of a seed that broke something",
    "gantryctl faults report": "has tests of its own; needs a campaign",
    "gantryctl identify": "has tests of its own; 15 s",
    "gantryctl compare": "has tests of its own; half a minute",
    "gantryctl drive-sim": "a server that runs until it is stopped; has tests of its own",
    "gantryctl eds": "has tests of its own",
    "gantryctl commission": "has tests of its own; a minute, or a bus",
    "gantryctl can": "needs a bus; has tests of its own",
    "gantryctl move 90 --config configs/hust_can.toml": "needs a bus; has tests of its own",
    "gantryctl serve": "a server that runs until it is stopped; has tests of its own",
    "gantryctl user": "asks for a password; has tests of its own",
    "gantryctl move 90 --service": "needs a running service; has tests of its own",
}
"""Command lines that begin like this are not run here, and why."""

EXIT_CODES = {"gantryctl move 200": 2}
"""Commands that the page says are refused."""

STAND_INS = {"TABLE.csv": "paper_table2.csv", "my_table.csv": "paper_table2.csv"}
"""The reader's own files."""


class Line(NamedTuple):
    """A command, what the page shows as its output, and the keys that it tells the reader to set afterwards."""

    command: str
    output: tuple[str, ...]
    settings: tuple[tuple[str, str, str], ...]


PROGRAM = re.compile(r"`(\w+\.py)`:\n\n```python\n(.*?)```", re.DOTALL)
"""A file that the page tells the reader to write."""
SETTING = re.compile(r"`\[([a-z_.]+)\] ([a-z_0-9]+) = ([^`]+)`")


def command_of(text: str) -> str | None:
    """The command in a line of a code block, without prompt and comment."""
    text = text.strip().removeprefix("$ ")
    return text.partition("  #")[0].strip() if text.startswith("gantryctl ") else None


def blocks(page: str) -> Iterator[Line]:
    """The commands in indented blocks (fenced ones hold other languages), each with what follows it."""
    command, output, prose = None, [], ""
    for text in page.splitlines():
        code = text.startswith("    ") and not text.lstrip().startswith(("-", "*"))
        found = command_of(text) if code else None
        if found is not None:
            if command is not None:
                yield Line(command, tuple(output), tuple(SETTING.findall(prose)))
            command, output, prose = found, [], ""
        elif code and command is not None and not prose and text.strip() != "...":
            output.append(text[4:].rstrip())
        elif text:
            prose += " " + text
    if command is not None:
        yield Line(command, tuple(output), tuple(SETTING.findall(prose)))


def left_out(command: str) -> bool:
    return any(command.startswith(start) for start in NOT_RUN)


def execute(command: str) -> str:
    """What the command prints; it ends with the exit code that the page promises."""
    words = [STAND_INS.get(word, word) for word in shlex.split(command)[1:]]
    answer = cli(*words)
    assert answer.code == EXIT_CODES.get(command, 0), (command, answer)
    return answer.out


def change(file: Path, table: str, key: str, value: str) -> None:
    """What the page tells the reader to do with an editor."""
    before, head, rest = file.read_text(encoding="utf-8").partition(f"\n[{table}]\n")
    assert head, f"{file} has no [{table}]"
    body, count = re.subn(rf"(?m)^{key} = [^#\n]*", f"{key} = {value}", rest, count=1)
    assert count, f"{file}: [{table}] has no {key}"
    file.write_text(before + head + body, encoding="utf-8")


@pytest.fixture(autouse=True)
def _place(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("GANTRYCTL_STATE", str(tmp_path / "state"))
    monkeypatch.chdir(tmp_path)


@pytest.mark.parametrize("name", PAGES)
def test_every_command_in_a_block_does_what_the_page_says(name: str) -> None:
    page = (ROOT / name).read_text(encoding="utf-8")
    for file, text in PROGRAM.findall(page):
        Path(file).write_text(text, encoding="utf-8")
    lines = list(blocks(page))
    assert len(lines) >= 3, "the page has no commands, or this test does not find them"
    assert name != "docs/tutorials/first-gantry.md" or sum(len(line.settings) for line in lines) >= 3
    for command in PAGES[name]:
        done(*command.split())
    for line in lines:
        if left_out(line.command):
            continue
        printed = execute(line.command)
        for shown in line.output:
            assert shown in printed.splitlines(), (line.command, shown, printed)
        if line.settings and " config init " in line.command:
            for table, key, value in line.settings:
                change(Path(line.command.split()[-1]), table, key, value)


def test_every_command_in_a_table_of_the_readme_prints_the_figures_beside_it() -> None:
    """Numbers with two decimals or more in the answer column are those that the command prints."""
    commands = figures = 0
    for row in (ROOT / "README.md").read_text(encoding="utf-8").splitlines():
        cells = [cell.strip(" `") for cell in row.split("|")]
        if len(cells) != 5 or not cells[2].startswith("gantryctl ") or left_out(cells[2]):
            continue
        commands += 1
        printed = execute(cells[2])
        for figure in re.findall(r"\d+\.\d{2,}", cells[3]):
            assert figure in printed, (cells[2], figure)
            figures += 1
    assert commands >= 4
    assert figures >= 5


def test_the_weak_machine_of_the_tutorial_ends_as_it_says() -> None:
    page = (ROOT / "docs/tutorials/first-gantry.md").read_text(encoding="utf-8")
    assert "`gantryctl move 30 --config weak.toml`" in page
    assert "exit\ncode 4" in page
    done("config", "init", "weak.toml")
    change(Path("weak.toml"), "control", "kvf", "0.0")
    answer = cli("move", "30", "--config", "weak.toml")
    assert answer.code == 4
    assert answer.err.startswith("warning: ")
    assert "\nerror: CTL-03 STOP" in answer.err


def test_the_program_of_the_readme_prints_and_draws_what_it_says(capsys: pytest.CaptureFixture[str]) -> None:
    page = (ROOT / "README.md").read_text(encoding="utf-8")
    (program,) = re.findall(r"```python\n(.*?)```", page, re.DOTALL)
    exec(compile(program, "README.md", "exec"), {"__name__": "__main__"})  # noqa: S102 - what the reader does
    said = re.search(r"20000 scans, the load stands at (\d+\.\d{3}) deg", capsys.readouterr().out)
    assert said
    # gear errors of this grade move the load by up to a hundredth of a degree
    assert float(said[1]) == pytest.approx(30.0, abs=0.01)
    assert Path("to_thirty.png").read_bytes().startswith(b"\x89PNG")
