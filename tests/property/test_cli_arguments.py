"""Any text and any number for every argument and option: refused in one line with no motion, or done within limits."""

from __future__ import annotations

import math
import os
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import click
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from gantryctl.cli.main import cli as root
from support.command_line import cli, done, plant_truth
from support.examples import examples

HERE = (
    "move", "jog", "stops", "speed-test", "accuracy", "status", "alarms", "explain", "reset", "encoder", "retain",
    "config", "trace", "sim", "completion",
)  # fmt: skip
"""Those of machine, motion and measuring; sizing, analysis, tuning and drives have tests of their own."""
TOO_LONG = {"--find-quick", "--real-time"}
NEVER_BEGINS = {
    ("accuracy", "run"): ["--out", "file"],
    ("accuracy", "measure"): ["--out", "file"],
    ("speed-test",): ["--out", "file"],
}
"""What makes a long run stop before it begins, after everything else has been judged."""


@pytest.fixture(scope="module", autouse=True)
def _place(tmp_path_factory: pytest.TempPathFactory) -> Iterator[None]:
    """One state and working directory for all examples, with files to fall over."""
    here = Path.cwd()
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("GANTRYCTL_STATE", str(tmp_path_factory.mktemp("state")))
        os.chdir(tmp_path_factory.mktemp("work"))
        Path("file").write_text("hello")
        Path("directory").mkdir()
        done("config", "init", "m.toml")
        done("sim", "reset")
        yield
    os.chdir(here)


# What the system can hand over: no NUL, bytes that are no UTF-8 as surrogates. No slash: nothing is written elsewhere.
TEXT = st.text(
    st.characters(codec="utf-8", exclude_characters="\0/")
    | st.characters(min_codepoint=0xDC80, max_codepoint=0xDCFF),
    max_size=12,
)
NUMBER = st.one_of(
    st.floats().map(repr),
    st.integers().map(str),
    st.floats(-200.0, 200.0).map(lambda x: f"{x:.3f}"),
    st.sampled_from(["1e400", "-0.0", "nan", "inf", "-inf", "1_0", "0x10", "1,5", " 1 ", "", "--", "-", "+"]),
)
NAME = st.sampled_from(["", ".", "file", "directory", "m.toml", "nowhere", "directory/x/y"])
WORD = (
    TEXT
    | NUMBER
    | NAME
    | st.sampled_from(["--json", "--help", "A", "show", "+", "paper_table2.csv", "LIM-03"])
)


def mostly(good: st.SearchStrategy[Any], other: st.SearchStrategy[Any]) -> st.SearchStrategy[Any]:
    """Four times in five the one, else the other: an example with several values is to be accepted now and then."""
    return st.integers(0, 4).flatmap(lambda k: other if k == 4 else good)


def commands() -> dict[tuple[str, ...], click.Command]:
    """Every command by its words."""
    found: dict[tuple[str, ...], click.Command] = {}
    for name in HERE:
        command = root.get_command(click.Context(root), name)
        assert command is not None
        if isinstance(command, click.Group):
            found |= {(name, sub): child for sub, child in command.commands.items()}
        else:
            found[(name,)] = command
    return found


ALL = commands()


@st.composite
def command_lines(draw: st.DrawFn) -> list[str]:
    """A command with anything for its arguments and for up to three of its options, now and then with too much."""
    words = draw(st.sampled_from(sorted(ALL)))
    line = list(words)
    options = [p for p in ALL[words].params if isinstance(p, click.Option) and not TOO_LONG & set(p.opts)]
    for option in draw(st.lists(st.sampled_from(options), max_size=3)) if options else []:
        flags = [*option.opts, *option.secondary_opts]
        line.append(draw(st.sampled_from(flags)))
        if not option.is_flag:
            line.append(draw(mostly(NUMBER, WORD)))
    for argument in ALL[words].params:
        if isinstance(argument, click.Argument) and draw(st.integers(0, 9)):
            line.append(draw(WORD))
    return line + draw(st.just([]) | st.lists(WORD, max_size=1)) + NEVER_BEGINS.get(words, [])


def judged(words: list[str]) -> int:
    """Whatever is asked: one of the five codes, a reason when it is not done, and no motion when it is refused."""
    before = plant_truth()
    answer = cli(*words)
    if answer.code in (2, 3):
        assert answer.err.startswith(("error: ", "Usage: ")), answer
        if words[:1] not in (["move"], ["jog"]):
            assert plant_truth() == before
        assert plant_truth()[0] == before[0], "refused, and yet it moved"
    if answer.code == 4:
        assert answer.err.startswith("error: "), answer
        assert cli("reset").code == 0
    return answer.code


@settings(max_examples=examples(60))
@given(command_lines())
def test_any_value_for_any_option_and_argument(words: list[str]) -> None:
    judged(words)
    stands_within(187.0)


@settings(max_examples=examples(40))
@given(
    st.lists(WORD | st.sampled_from(["config", "trace", "encoder", "show", "--json", "--help"]), max_size=3)
)
def test_any_words_at_all(words: list[str]) -> None:
    judged(words)


# --- what is accepted stays within limits -----------------------------------------------------------------------------

TRAVEL_DEG = 180.0


def stands_within(before_deg: float) -> None:
    """Inside the travel, or nearer to it than before."""
    here = done("status", "--json").json
    window = 0.005
    assert abs(here["angle_deg"]) <= max(TRAVEL_DEG, abs(before_deg)) + window
    assert here["condition"] == "power off, brake closed"


@settings(max_examples=examples(25))
@given(
    start=st.floats(-186.99, 186.99),
    way=st.booleans(),
    value=mostly(st.floats(-180.0, 180.0).map(repr), NUMBER),
    speed=mostly(st.none() | st.floats(3.0, 6.0).map(repr), NUMBER),
    override=mostly(
        st.none() | st.floats(50.0, 100.0).map(repr), st.sampled_from(["0", "0.99", "101", "nan", ""])
    ),
)
def test_any_move_from_anywhere(
    start: float, way: bool, value: str, speed: str | None, override: str | None
) -> None:
    done("sim", "reset", "--angle", repr(start))
    words = ["move", "--no-trace", "--json"]
    words += [f"--speed={speed}"] if speed is not None else []
    words += [f"--override={override}"] if override is not None else []
    words += [f"--by={value}"] if way else ["--", value]
    before = plant_truth()
    answer = cli(*words)
    assert answer.code in (0, 1, 2), answer
    if answer.code == 2:
        assert answer.err.startswith("error: ")
        assert plant_truth()[0] == before[0]
        return
    stands_within(start)
    summary = answer.json["summary"]
    assert summary["peak_deg_s"] <= 6.0 * (1.0 + 1e-9)
    asked = start + float(value) if way else float(value)
    assert math.isclose(
        summary["end_deg"], asked, abs_tol=0.011
    )  # the window, and gears settling after the reset


@settings(max_examples=examples(25))
@given(
    start=st.floats(-186.99, 186.99),
    key=st.sampled_from("+-"),
    seconds=mostly(st.floats(0.0, 8.0).map(repr), NUMBER),
    speed=mostly(st.none() | st.floats(0.6, 6.0).map(repr), NUMBER),
)
def test_any_jog_from_anywhere(start: float, key: str, seconds: str, speed: str | None) -> None:
    done("sim", "reset", "--angle", repr(start))
    before = plant_truth()
    words = [
        "jog",
        key,
        f"--for={seconds}",
        "--no-trace",
        "--json",
        *([f"--speed={speed}"] if speed is not None else []),
    ]
    answer = cli(*words)
    assert answer.code in (0, 2), answer
    if answer.code == 2:
        assert answer.err.startswith("error: ")
        assert plant_truth()[0] == before[0]
        return
    stands_within(start)
    moved = done("status", "--json").json["angle_deg"] - start
    assert (moved > -0.02) if key == "+" else (moved < 0.02)  # gears settle by up to 0.01 deg


@settings(max_examples=examples(25))
@given(angle=mostly(st.floats(-187.0, 187.0).map(repr), NUMBER), witness=mostly(st.just("mark"), TEXT))
def test_any_zero(angle: str, witness: str) -> None:
    done("sim", "reset")
    before = plant_truth()
    answer = cli("encoder", "set-zero", f"--angle={angle}", f"--witness={witness}")
    assert plant_truth() == before, "the zero offset moves nothing"
    if answer.code == 0:
        shown = done("encoder", "show", "--json").json
        assert math.isclose(shown["angle_deg"], float(angle), abs_tol=1e-6)
        assert abs(shown["angle_deg"]) < 187.0
        assert min(shown["margin_minus_deg"], shown["margin_plus_deg"]) >= 5.0
        assert done("encoder", "show").out.count("\n") == 10
    else:
        assert answer.code == 2


@settings(max_examples=examples(25))
@given(
    st.binary(max_size=200)
    | st.text(st.sampled_from("base_deg,direction displacment rcw0123456789.-+\n"), max_size=200).map(
        str.encode
    )
)
def test_any_table(content: bytes) -> None:
    Path("any.csv").write_bytes(content)
    for command in (
        ["accuracy", "stats", "any.csv"],
        ["accuracy", "report", "--measured", "any.csv", "--out", "r"],
    ):
        answer = cli(*command)
        assert answer.code in (0, 1, 2)
        assert answer.err == "" or answer.err.startswith("error: any.csv: ")


@settings(max_examples=examples(25))
@given(
    content=st.binary(max_size=200), name=st.sampled_from(["plant.json", "retain.a.json", "retain.b.json"])
)
def test_any_damage_of_the_state_is_told_or_bridged(content: bytes, name: str) -> None:
    done("sim", "reset")
    folder = Path(os.environ["GANTRYCTL_STATE"]) / "hust_gantry"
    (folder / name).write_bytes(content)
    for command in (["status"], ["retain", "show"], ["encoder", "show"], ["alarms"], ["reset"]):
        answer = cli(*command)
        assert answer.code in (0, 2, 3)
        assert (answer.err == "") is (answer.code == 0)
    done("sim", "reset")
