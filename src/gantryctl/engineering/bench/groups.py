"""The groups of `gantryctl bench`: each measures some figures in one run and holds them against their limits."""

from __future__ import annotations

import os
import statistics
import time
from collections.abc import Callable
from typing import Final

from gantryctl.engineering.bench import jobs
from gantryctl.engineering.bench.figures import Figure, medians
from gantryctl.engineering.bench.peers.compare import peers
from gantryctl.engineering.computer.scan_trial import scan_trial
from gantryctl.engineering.report.meter import Watch, nobody

_RATE: Final = "axis s/s"
# Part of the time of the batch that its turns take, about; the chord tests take the rest.
_TURNS: Final = 0.9


def batch(repeats: int, scale: float, watch: Watch = nobody) -> list[Figure]:
    """The full plant: scheme against scheme, standing against moving, many against one."""
    cores = os.cpu_count() or 1
    seconds = max(1, round(30 * scale))
    rate = medians(
        {
            "one": lambda: jobs.full("one_evaluation", seconds),
            "rk4": lambda: jobs.full("rk4", max(1, seconds // 5)),
            "rest": lambda: jobs.full("one_evaluation", seconds, moving=False),
            "single": lambda: jobs.many(1, 1, seconds, time.process_time),
            "pack": lambda: jobs.many(16, 1, seconds, time.process_time),
            "limit": lambda: jobs.arithmetic_limit(max(1, round(2e7 * scale))),
            # What threads do at once only the wall clock shows.
            "alone": lambda: jobs.many(1, 1, seconds),
            "all": lambda: jobs.many(16 * cores, cores, seconds),
        },
        repeats,
        lambda part: watch(part * _TURNS),
    )
    operations = jobs.operations()
    share = rate["pack"] * jobs.cycles_per_s() * operations / rate["limit"]
    chord = []
    for _ in range(max(1, repeats // 2)):
        chord.append(jobs.chord_test())
        watch(_TURNS + (1.0 - _TURNS) * len(chord) / max(1, repeats // 2))
    return [
        Figure("one_plant", "full plant, one", rate["one"], _RATE),
        Figure("one_over_rk4", "one evaluation / RK4, two sub-steps", rate["one"] / rate["rk4"], least=5.0),
        Figure("rest_over_move", "cost of standing / cost of moving", rate["one"] / rate["rest"], most=1.2),
        Figure("pack", "16 full plants, one thread", rate["pack"], _RATE),
        Figure("pack_over_one", "16 plants / one plant, one thread", rate["pack"] / rate["single"]),
        Figure("operations", "arithmetic of a drive cycle", operations, "flop"),
        Figure("limit_share", "16 plants, one thread / arithmetic limit", share),
        Figure("all", f"{16 * cores} full plants, {cores} threads", rate["all"], _RATE),
        Figure("all_over_one", f"{16 * cores} plants, {cores} threads / one, wall clock", rate["all"] / rate["alone"]),
        Figure("chord_s", "chord test A, compiled", statistics.median(c[0] for c in chord), "s", most=2.0),
        Figure("chord_mb", "chord test A, memory at its peak", max(c[1] for c in chord), "MB", most=400.0),
    ]  # fmt: skip


def scan(repeats: int, scale: float, watch: Watch = nobody) -> list[Figure]:
    """The shipped program, scan by scan through Python."""
    seconds = 10.0 * scale
    rate = medians(
        {
            "1 ms": lambda: jobs.engine(1.0, seconds),
            "4 ms": lambda: jobs.engine(4.0, seconds),
            "rest": lambda: jobs.engine(1.0, seconds, moving=False),
            "plant": lambda: jobs.full("one_evaluation", max(1, round(seconds))),
        },
        repeats,
        watch,
    )
    return [
        Figure("scan_1_ms", "engine, program and plant, 1 ms", rate["1 ms"], _RATE, least=50.0),
        Figure("scan_4_ms", "engine, program and plant, 4 ms", rate["4 ms"], _RATE, least=150.0),
        Figure("scan_us", "one scan of 1 ms", 1e3 / rate["1 ms"], "us"),
        Figure("scan_over_plant", "scan of 1 ms / its plant alone", rate["plant"] / rate["1 ms"]),
        Figure("rest_over_move", "cost of standing / cost of moving", rate["1 ms"] / rate["rest"], most=1.2),
    ]


def jitter(_repeats: int, scale: float, watch: Watch = nobody) -> list[Figure]:
    """Lateness of the scan in real time, as `gantryctl doctor` measures it."""
    figures, periods_ms, seconds = [], (1.0, 4.0), max(0.1, 10.0 * scale)
    done_s = 0.0

    def later(more_s: float) -> None:
        nonlocal done_s
        done_s += more_s
        watch(done_s / (seconds * len(periods_ms)))

    for period_ms in periods_ms:
        trial = scan_trial(period_ms, seconds, watch=later)
        late, name = trial.statistics.lateness, f"{period_ms:g}_ms"
        figures += [
            Figure(
                f"late_p50_{name}", f"scan of {period_ms:g} ms late, p50", late.quantile_s(0.5) * 1e6, "us"
            ),
            Figure(
                f"late_p99_{name}", f"scan of {period_ms:g} ms late, p99", late.quantile_s(0.99) * 1e6, "us"
            ),
            Figure(f"late_worst_{name}", f"scan of {period_ms:g} ms late, worst", late.worst_s * 1e6, "us"),
        ]
    return figures


def commands(repeats: int, _scale: float, watch: Watch = nobody) -> list[Figure]:
    """What a user waits for."""
    wall = medians(
        {
            "python": jobs.python_s,
            "help": lambda: jobs.command_s("--help"),
            "move": lambda: jobs.command_s("move", "5"),
        },
        repeats,
        watch,
    )
    return [
        Figure("help_s", "gantryctl --help", wall["help"], "s", most=0.2),
        Figure("help_over_python", "gantryctl --help / an empty Python", wall["help"] / wall["python"]),
        Figure("move_s", "gantryctl move 5", wall["move"], "s", most=2.0),
        Figure("move_over_python", "gantryctl move 5 / an empty Python", wall["move"] / wall["python"]),
    ]


GROUPS: Final[dict[str, Callable[[int, float, Watch], list[Figure]]]] = {
    "peers": peers,
    "batch": batch,
    "scan": scan,
    "jitter": jitter,
    "cli": commands,
}
"""Each takes how often a job takes its turn, the part of its usual length (1, and less in tests), and who watches."""
