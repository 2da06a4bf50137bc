"""The judge of the soak: what it must find is planted, one at a time, in a log that is otherwise good."""

from __future__ import annotations

import json
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any, TypeAlias

import numpy as np
import pytest

from gantryctl.service.command.operator import SILENCE_S
from support.service_bench import LEASE, Bench
from support.soak.stepped_clock import SteppedClock
from support.soak.verdict import (
    SLOPE_MAX_MB_H,
    clock_steps,
    judge,
    kept,
    missing_numbers,
    missing_scans,
    passed,
    read_log,
    slope_of,
    unasked,
    words,
)

Log: TypeAlias = list[dict[str, Any]]
NAMES = ("supervisor", "controller", "recorder", "gateway", "gateway.opcua")
POOL_KB = (0, 2_000, 9_000, 14_000)
"""What the recorder holds for some minutes after a file: as measured."""
NOISE_KB = 300.0


def good_log(leak_mb_h: float = 0.0, minutes: int = 122) -> Log:
    """Two hours; the recorder grows, and is noisy as its pool of buffers is."""
    chance = np.random.default_rng(14)
    pool_kb = 0
    log: Log = [{"kind": "conditions", "t_s": 0.0}]
    for n in range(minutes):
        own_kb = dict.fromkeys(NAMES, 60_000)
        pool_kb = int(chance.choice(POOL_KB)) if n % 3 == 0 else pool_kb
        own_kb["recorder"] += pool_kb + round(leak_mb_h * 1024 * n / 60 + chance.normal(0.0, NOISE_KB))
        if n % 10 == 5:
            log.append({"kind": "step", "t_s": 60.0 * n, "step_s": 3600 if n % 20 == 5 else -3600})
        log.append(
            {
                "kind": "minute", "t_s": 60.0 * n, "processes": {name: at for at, name in enumerate(NAMES)},
                "own_kb": own_kb, "handles": dict.fromkeys(NAMES, 13 + n % 3),
                "page_kb": 4000, "opcua": 1000 * n, "gestures": 5 * n, "unasked": 0,
                "rows_lost": 0, "events_lost": 0,
            }
        )  # fmt: skip
    steps_s = [float(line["step_s"]) for line in log if line["kind"] == "step"]
    log.append(
        {
            "kind": "end", "t_s": 60.0 * minutes, "journal_rows": 900, "journal_wrong": "", "journal_missing": 0,
            "clock_steps_s": steps_s, "power_ups": 40, "recordings": 44, "recordings_missing": 0,
            "recorded_rows": 4_000_000, "scans_missing": 0, "unfinished": 0,
        }
    )  # fmt: skip
    return log


def failed(log: Log) -> list[str]:
    return [each.what for each in judge(log) if each.passed is False]


def test_a_good_log_passes_in_every_criterion() -> None:
    findings = judge(good_log())
    assert all(each.passed is True for each in findings), words(findings)
    assert words(findings).endswith("verdict: pass")


def put(log: Log, kind: str, **values: Any) -> None:
    """Change every line of a kind."""
    for line in log:
        if line["kind"] == kind:
            line.update(values)


def minute(log: Log, number: int = 40) -> dict[str, Any]:
    return [line for line in log if line["kind"] == "minute"][number]


LIES: dict[str, tuple[Callable[[Log], object], str]] = {
    "an alarm in the journal": (lambda log: put(log, "minute", unasked=1), "stops that nobody asked for"),
    "a move that ended early": (
        lambda log: log.insert(9, {"kind": "trouble", "of": "stop", "what": "a move"}),
        "stops that nobody asked for",
    ),
    "a page that hangs": (
        lambda log: log.insert(9, {"kind": "trouble", "of": "stuck", "what": "power on"}),
        "pages that hang",
    ),
    "OPC UA that is silent for a minute": (
        lambda log: minute(log).update(opcua=minute(log, 39)["opcua"]),
        "OPC UA",
    ),
    "a controller that was started again": (
        lambda log: minute(log)["processes"].update(controller=99),
        "processes that ended",
    ),
    "a row without a place": (lambda log: put(log, "minute", rows_lost=1), "rows and events without a place"),
    "an event without a place": (
        lambda log: put(log, "minute", events_lost=1),
        "rows and events without a place",
    ),
    "a damaged journal": (lambda log: put(log, "end", journal_wrong="event 7 was changed"), "journal"),
    "an event that is missing": (lambda log: put(log, "end", journal_missing=1), "journal"),
    "an empty journal": (lambda log: put(log, "end", journal_rows=0), "journal"),
    "a scan that is missing": (lambda log: put(log, "end", scans_missing=1), "recordings"),
    "a recording that is missing": (lambda log: put(log, "end", recordings_missing=1), "recordings"),
    "power-ups that were not recorded": (lambda log: put(log, "end", recordings=39), "recordings"),
    "a file that was not finished": (lambda log: put(log, "end", unfinished=1), "recordings"),
    "a clock that was not stepped": (
        lambda log: put(log, "end", clock_steps_s=[3600.0]),
        "steps of the wall clock",
    ),
    "a page that grows": (
        lambda log: [line.update(page_kb=4000 + line["t_s"]) for line in log if line["kind"] == "minute"],
        "memory: page that stays open",
    ),
}


@pytest.mark.parametrize("lie", LIES)
def test_what_is_planted_is_found_and_nothing_else(lie: str) -> None:
    log = good_log()
    plant, found = LIES[lie]
    plant(log)
    assert failed(log) == [found]


def test_a_leak_is_told_from_noise() -> None:
    assert failed(good_log(leak_mb_h=0.2)) == []
    assert failed(good_log(leak_mb_h=3.0)) == ["memory: recorder", "memory: all processes"]


def test_a_handle_that_is_kept_with_every_power_up_fails() -> None:
    log = good_log()
    for n, line in enumerate(line for line in log if line["kind"] == "minute"):
        line["handles"]["recorder"] += n // 30
    assert failed(log) == ["handles: recorder"]


def test_a_slope_whose_interval_reaches_the_limit_is_not_passed() -> None:
    (found,) = [each for each in judge(good_log(leak_mb_h=0.8)) if each.what == "memory: recorder"]
    assert found.passed is None, found.why
    assert words([found]).endswith("verdict of what can be told: pass")


def test_a_slope_that_is_no_number_fails() -> None:
    log = good_log()
    put(log, "minute", page_kb=float("nan"))
    assert failed(log) == ["memory: page that stays open"]


def test_the_first_half_hour_is_warming_up() -> None:
    log = good_log()
    for line in log:
        if line["kind"] == "minute" and line["t_s"] < 1800.0:
            line["own_kb"]["gateway"] = 20_000 + round(line["t_s"] * 10)
    assert failed(log) == []


def test_an_unfinished_log_is_judged_as_far_as_it_goes(tmp_path: Path) -> None:
    file = tmp_path / "soak.jsonl"
    lines = [json.dumps(line) for line in good_log()[:-1]]
    file.write_text("\n".join(lines) + '\n{"kind":"min', encoding="utf-8")  # half a line: it is being written
    findings = judge(read_log(file))
    assert passed(findings)
    assert {each.what for each in findings if each.passed is None} == {
        "journal and recordings",
        "steps of the wall clock",
    }
    assert words(findings).endswith("verdict of what can be told: pass")
    short = [each for each in judge(read_log(file)[:60]) if each.what.startswith("memory")]
    assert all(each.passed is None for each in short)


def test_a_log_is_kept_with_its_verdict(tmp_path: Path) -> None:
    file = tmp_path / "soak.log"
    file.write_text(kept(good_log()), encoding="utf-8")
    assert file.read_text(encoding="utf-8").startswith("# pass  memory: supervisor: ")
    assert judge(read_log(file)) == judge(good_log())


def test_the_interval_of_a_slope_has_the_true_one_in_95_of_100() -> None:
    chance = np.random.default_rng(1)
    time_s = np.arange(60) * 60.0
    hits, sets = 0, 400
    for _ in range(sets):
        values = 50.0 + SLOPE_MAX_MB_H * time_s / 3600.0 + chance.normal(0.0, 1.0, 60)
        slope = slope_of(time_s.tolist(), values.tolist())
        hits += slope.low <= SLOPE_MAX_MB_H <= slope.high
    # Binomial: 0.95 of 400 with a deviation of 4.4.
    assert abs(hits - 0.95 * sets) < 3 * 4.4


def test_outliers_do_not_move_a_slope() -> None:
    time_s = [60.0 * n for n in range(90)]
    values = [50.0 + (500.0 if n % 5 == 4 else 0.0) for n in range(90)]  # one of five
    assert slope_of(time_s, values).value == pytest.approx(0.0, abs=1e-9)


def test_gaps_are_counted() -> None:
    whole = [(1, source, number) for source in (0, 2) for number in range(1, 40)]
    assert missing_numbers(whole) == 0
    assert missing_numbers([each for each in whole if each[2] not in (7, 8)]) == 4
    # Every scan of 1 ms, then rest with a row in 100 ms, then every scan again.
    time_s = [0.001 * n for n in [*range(100), *range(200, 1000, 100), *range(901, 950)]]
    spacing_s = [0.001] * 100 + [0.101] + [0.1] * 7 + [0.001] * 49
    assert missing_scans(time_s, spacing_s, 0.001) == 0
    del time_s[130:133], spacing_s[130:133]
    assert missing_scans(time_s, spacing_s, 0.001) == 3


def test_steps_of_the_clock_are_read_from_events_in_any_order() -> None:
    ahead = {0.0: 5.0, 100.0: 3605.0, 200.0: 5.0, 300.0: 5.0, 400.0: -3595.0}
    events = [(monotonic_s + offset_s, monotonic_s) for monotonic_s, offset_s in ahead.items()]
    assert clock_steps(reversed(events)) == [3600.0, -3600.0, -3600.0]


def told(bench: Bench) -> list[str]:
    """What the controller has told the journal of that nobody asked for."""
    found = []
    while (record := bench.event_ring.take()) is not None:
        event = json.loads(record)
        if unasked(event["kind"], event["text"]):
            found.append(event["text"])
    return found


def test_the_ends_of_keys_and_of_control_are_told_apart_in_the_words_of_the_service() -> None:
    bench = Bench()
    who = bench.who()
    bench.powered(who)
    bench.do(who, "jog", lease=LEASE, direction="forward")
    bench.hold(1.0)
    bench.do(who, "release", lease=LEASE)
    bench.rest_after_s()
    assert told(bench) == []
    bench.do(who, "jog", lease=f"{LEASE[:-1]}b", direction="forward")
    bench.rest_after_s()
    (text,) = told(bench)
    assert text.startswith("hold-to-run: ")
    bench.lively = False
    bench.scans(round((SILENCE_S + 0.5) / bench.engine.period_s))
    (text,) = told(bench)
    assert "was silent" in text


@pytest.mark.skipif(sys.platform != "linux", reason="LD_PRELOAD")
def test_only_the_wall_clock_of_the_other_program_is_stepped(tmp_path: Path) -> None:
    clock = SteppedClock(tmp_path, 7200)
    code = """
import sys, time
from datetime import datetime
for _ in sys.stdin:
    print(time.time(), datetime.now().timestamp(), time.monotonic(), flush=True)
"""
    with subprocess.Popen(
        [sys.executable, "-c", code],
        env=clock.environment,
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        text=True,
    ) as other:
        assert other.stdin is not None
        assert other.stdout is not None
        for step_s in (0, 3600, -3600, -3600):
            clock.offset_s += step_s
            before = time.time(), time.monotonic()
            other.stdin.write("\n")
            other.stdin.flush()
            wall_s, also_s, monotonic_s = map(float, other.stdout.readline().split())
            after = time.time(), time.monotonic()
            # Between the two readings here: both are of the same clocks.
            assert before[0] <= wall_s - clock.offset_s <= after[0]
            assert before[0] <= also_s - clock.offset_s <= after[0]
            assert before[1] <= monotonic_s <= after[1]
        other.stdin.close()
