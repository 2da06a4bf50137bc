"""What the doctor reads of a system, on systems made of files."""

from __future__ import annotations

from pathlib import Path

import pytest

from gantryctl.engineering.computer.findings import Check, System, Verdict, findings, this_system
from gantryctl.engineering.computer.text import finding_lines

FILES = {
    "proc/version": "Linux version 6.12.9-rt (gcc) #1 SMP PREEMPT_RT",
    "sys/devices/system/cpu/cpu0/cpufreq/scaling_governor": "performance",
    "sys/devices/system/cpu/cpu1/cpufreq/scaling_governor": "performance",
    "sys/devices/system/cpu/isolated": "1",
    "sys/devices/system/clocksource/clocksource0/current_clocksource": "tsc",
}


def computer(root: Path, changes: dict[str, str] | None = None, **values: object) -> System:
    for name, text in (FILES | (changes or {})).items():
        path = root / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(text + "\n", encoding="ascii")
    return System(root, **({"priority_limit": 95, "load": 0.4, "processors": 2} | values))  # type: ignore[arg-type]


def verdicts(system: System) -> dict[Check, Verdict]:
    return {finding.check: finding.verdict for finding in findings(system)}


def test_a_computer_made_for_it_has_no_weakness(tmp_path: Path) -> None:
    assert set(verdicts(computer(tmp_path)).values()) == {Verdict.GOOD}


@pytest.mark.parametrize(
    ("check", "changes"),
    [
        (Check.KERNEL, {"proc/version": "Linux version 6.12.9 (gcc) #1 SMP PREEMPT_DYNAMIC"}),
        (Check.GOVERNOR, {"sys/devices/system/cpu/cpu1/cpufreq/scaling_governor": "powersave"}),
        (Check.ISOLATION, {"sys/devices/system/cpu/isolated": ""}),
        (Check.CLOCK_SOURCE, {"sys/devices/system/clocksource/clocksource0/current_clocksource": "hpet"}),
    ],
)
def test_one_weakness_shows_alone_with_its_advice(
    tmp_path: Path, check: Check, changes: dict[str, str]
) -> None:
    found = findings(computer(tmp_path, changes))
    assert [finding.check for finding in found if finding.verdict is Verdict.WEAK] == [check]
    assert len(finding_lines(found)) == len(found) + 1


@pytest.mark.parametrize(
    ("check", "value"), [(Check.PRIORITY, {"priority_limit": 20}), (Check.LOAD, {"load": 1.5})]
)
def test_rights_and_load_are_judged(tmp_path: Path, check: Check, value: dict[str, object]) -> None:
    found = verdicts(computer(tmp_path, **value))
    assert [each for each, verdict in found.items() if verdict is Verdict.WEAK] == [check]


def test_what_a_system_does_not_show_is_unknown(tmp_path: Path) -> None:
    assert set(verdicts(System(tmp_path)).values()) == {Verdict.UNKNOWN}


def test_this_computer_answers_everything() -> None:
    assert [finding.check for finding in findings(this_system())] == list(Check)
