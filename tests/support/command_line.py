"""The command line in this process, as a user sees it: exit code, standard output, standard error."""

from __future__ import annotations

import io
import json
import re
from contextlib import redirect_stderr, redirect_stdout
from pathlib import Path
from typing import Any, NamedTuple

from gantryctl.cli.main import run
from gantryctl.machine import default_machine, with_values
from gantryctl.machine.effective import to_toml
from gantryctl.operation.store import StateStore

# "35.71 of 40 -", where a table of limits has no unit; "125.892541 us", more digits than anybody measures.
ODD_UNITS = re.compile(r"\d of [\d.]+ -(?!\w)|\b\d+\.\d{6,} (?:us|ms)\b|\d (?:-|None)(?=[.,;)])")


class Answer(NamedTuple):
    code: int
    out: str
    err: str

    @property
    def json(self) -> Any:
        """Standard output as JSON in which every number is finite; a failure when it is anything else."""
        return json.loads(self.out, parse_constant=_not_finite)


class Terminal(io.StringIO):
    """A standard output that somebody looks at."""

    def isatty(self) -> bool:
        return True


def cli(*arguments: object, out: io.StringIO | None = None) -> Answer:
    """Run one command line. No traceback and no error from inside may ever reach a user."""
    out, err = out or io.StringIO(), io.StringIO()
    with redirect_stdout(out), redirect_stderr(err):
        code = run([str(argument) for argument in arguments])
    said = out.getvalue() + err.getvalue()
    assert "Traceback" not in said, said
    assert "internal:" not in said, said
    assert code in (0, 1, 2, 3, 4)
    # A refusal repeats a number as the person has typed it.
    files = [
        each for each in arguments if isinstance(each, Path) and each.suffix == ".toml" and each.is_file()
    ]
    typed = "".join(each.read_text(errors="replace") for each in files)
    assert not [odd[0] for odd in ODD_UNITS.finditer(said) if odd[0].split()[0] not in typed], said
    return Answer(code, out.getvalue(), err.getvalue())


def done(*arguments: object) -> Answer:
    """A command line that ends well and has nothing to complain about."""
    answer = cli(*arguments)
    assert (answer.code, answer.err) == (0, ""), answer
    return answer


def refused(*arguments: object) -> str:
    """What a refused command line says: one line on standard error, exit code 2, nothing on standard output."""
    answer = cli(*arguments)
    assert (answer.code, answer.out) == (2, ""), answer
    assert answer.err.startswith("error: ")
    assert answer.err.count("\n") == 1, answer.err
    assert answer.err[:-1].isprintable(), repr(answer.err)
    return answer.err


def machine_file(path: Path, changes: dict[str, object]) -> Path:
    """A machine file like the reference machine's but for some keys."""
    path.write_text(to_toml(with_values(default_machine(), changes)), encoding="utf-8")
    return path


def plant_truth() -> tuple[dict[str, float] | None, int, int]:
    """The simulated plant bit for bit, and how often it was switched on and moved: equal when nothing moved."""
    with StateStore(default_machine()) as store:
        kept, retained = store.load_plant(), store.load_retained()
    counted = (retained.power_ups, retained.moves) if retained else (0, 0)
    return (kept[0] if kept else None, *counted)


def _not_finite(word: str) -> float:
    raise AssertionError(f"{word} in JSON")
