"""Speed of the whole thing, with every ratio measured in one run: `python benchmarks/run.py [--json] [--repeats N]`.

The jobs of a ratio take turns, and medians are compared: a busy machine slows both. Nothing here is asserted by a
test; the limits are those of the requirements and the exit code is 1 when one is missed.
"""

from __future__ import annotations

import argparse
import json
import platform
import statistics
import sys
import tempfile
from collections.abc import Callable
from dataclasses import asdict, dataclass
from pathlib import Path

import jobs


@dataclass
class Result:
    """One figure, with its limit where there is one."""

    name: str
    value: float
    unit: str
    least: float | None = None
    most: float | None = None

    @property
    def met(self) -> bool:
        """Within its limit, or without one."""
        return (self.least is None or self.value >= self.least) and (
            self.most is None or self.value <= self.most
        )


def medians(runs: dict[str, Callable[[], float]], repeats: int) -> dict[str, float]:
    """Median of each job, all taking turns."""
    values: dict[str, list[float]] = {name: [] for name in runs}
    for _ in range(repeats):
        for name, run in runs.items():
            values[name].append(run())
    return {name: statistics.median(v) for name, v in values.items()}


def rigid(repeats: int) -> list[Result]:
    """The compiled loop against plain C and pure Python."""
    with tempfile.TemporaryDirectory() as folder:
        program = jobs.compile_c(Path(folder))
        ends = [jobs.rigid_c(program)[1], jobs.rigid_core()[1], jobs.rigid_python()[1]]
        ends.append(jobs.rigid_python(inlined=True)[1])
        if not all(jobs.close_enough(end, ends[0]) for end in ends):
            raise SystemExit(f"the loops do not do the same job: motor at {ends} rad")
        rate = medians(
            {
                "c": lambda: jobs.rigid_c(program)[0],
                "core": lambda: jobs.rigid_core()[0],
                "python": lambda: jobs.rigid_python()[0],
                "inlined": lambda: jobs.rigid_python(inlined=True)[0],
            },
            repeats,
        )
    return [
        Result("rigid job: plain C", rate["c"], "axis s/s"),
        Result("rigid job: compiled loop", rate["core"], "axis s/s"),
        Result("rigid job: pure Python, one function a law", rate["python"], "axis s/s"),
        Result("rigid job: pure Python, all inlined", rate["inlined"], "axis s/s"),
        Result("compiled loop / plain C", rate["core"] / rate["c"], "", least=0.7),
        Result("compiled loop / pure Python", rate["core"] / rate["python"], "", least=20.0),
        Result("plain C / pure Python", rate["c"] / rate["python"], ""),
    ]


def full_plant(repeats: int) -> list[Result]:
    """The whole plant: scheme against scheme, standing against moving."""
    rate = medians(
        {
            "one": lambda: jobs.full("one_evaluation", 30),
            "rk4": lambda: jobs.full("rk4", 6),
            "rest": lambda: jobs.full("one_evaluation", 30, moving=False),
        },
        repeats,
    )
    return [
        Result("full plant: one evaluation", rate["one"], "axis s/s"),
        Result("full plant: RK4, two sub-steps", rate["rk4"], "axis s/s"),
        Result("one evaluation / RK4", rate["one"] / rate["rk4"], "", least=5.0),
        Result("cost of standing / cost of moving", rate["one"] / rate["rest"], "", most=1.2),
    ]


def engine(repeats: int) -> list[Result]:
    """The shipped program scan by scan."""
    rate = medians(
        {
            "1 ms": lambda: jobs.engine(1.0),
            "4 ms": lambda: jobs.engine(4.0),
            "rest": lambda: jobs.engine(1.0, moving=False),
        },
        repeats,
    )
    return [
        Result("engine and program, 1 ms scan", rate["1 ms"], "axis s/s", least=50.0),
        Result("engine and program, 4 ms scan", rate["4 ms"], "axis s/s", least=150.0),
        Result("engine: cost of standing / cost of moving", rate["1 ms"] / rate["rest"], "", most=1.2),
    ]


def commands(repeats: int) -> list[Result]:
    """What a user waits for."""
    wall = medians(
        {
            "help": lambda: jobs.command_s("--help"),
            "move": lambda: jobs.command_s("move", "5"),
        },
        repeats,
    )
    chord = [jobs.chord_test() for _ in range(max(1, repeats // 2))]
    return [
        Result("gantryctl --help", wall["help"], "s", most=0.2),
        Result("gantryctl move 5", wall["move"], "s", most=2.0),
        Result("chord test A, compiled", statistics.median(c[0] for c in chord), "s", most=2.0),
        Result("chord test A, memory at its peak", max(c[1] for c in chord), "MB", most=400.0),
    ]


def table(results: list[Result]) -> str:
    """The results as people read them."""
    lines = []
    for r in results:
        limit = f">= {r.least:g}" if r.least is not None else f"<= {r.most:g}" if r.most is not None else ""
        verdict = "" if not limit else "ok" if r.met else "MISSED"
        digits = 0 if r.value >= 100 else 2
        lines.append(f"{r.name:44} {r.value:10.{digits}f} {r.unit:9} {limit:9} {verdict}")
    return "\n".join(lines)


def main() -> int:
    """Measure everything; 1 when a limit is missed."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--json", action="store_true", help="print JSON and nothing else")
    parser.add_argument(
        "--repeats", type=int, default=5, help="how often each job takes its turn (default 5)"
    )
    options = parser.parse_args()
    if options.repeats < 1:
        parser.error("--repeats must be at least 1")
    results = [r for group in (rigid, full_plant, engine, commands) for r in group(options.repeats)]
    if options.json:
        machine = {
            "python": platform.python_version(),
            "processor": platform.machine(),
            "system": platform.system(),
        }
        print(
            json.dumps(
                {"machine": machine, "results": [asdict(r) | {"met": r.met} for r in results]}, indent=2
            )
        )
    else:
        print(table(results))
    return 0 if all(r.met for r in results) else 1


if __name__ == "__main__":
    sys.exit(main())
