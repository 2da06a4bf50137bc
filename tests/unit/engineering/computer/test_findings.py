"""What the doctor reads of a system, on systems made of files."""

from __future__ import annotations

from pathlib import Path

import pytest

from gantryctl.engineering.computer.findings import Check, System, Verdict, findings, this_system, wall_clock
from gantryctl.engineering.computer.text import finding_lines

FILES = {
    "proc/version": "Linux version 6.12.9-rt (gcc) #1 SMP PREEMPT_RT",
    "sys/devices/system/cpu/cpu0/cpufreq/scaling_governor": "performance",
    "sys/devices/system/cpu/cpu1/cpufreq/scaling_governor": "performance",
    "sys/devices/system/cpu/isolated": "1",
    "sys/devices/system/clocksource/clocksource0/current_clocksource": "tsc",
    "sys/class/net/can0/type": "280",
    "sys/class/net/can0/flags": "0x40081",
    "sys/class/net/eth0/type": "1",
    "dev/ttyACM0": "",
}


THIS = {"priority_limit": 95, "load": 0.4, "processors": 2, "adapter": ("socketcan", "can0")}


def computer(root: Path, changes: dict[str, str] | None = None, **values: object) -> System:
    for name, text in (FILES | (changes or {})).items():
        path = root / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(text + "\n", encoding="ascii")
    return System(root, **(THIS | {"state_root": root} | values))  # type: ignore[arg-type]


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
        (Check.ADAPTER, {"sys/class/net/can0/flags": "0x40080"}),
        (Check.ADAPTER, {"sys/class/net/can0/type": "1"}),
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
    found = verdicts(System(tmp_path, state_root=tmp_path))
    assert found.pop(Check.STATE) is Verdict.GOOD
    assert set(found.values()) == {Verdict.UNKNOWN}


def test_this_computer_answers_everything(tmp_path: Path) -> None:
    system = this_system(tmp_path, None)
    assert [*(finding.check for finding in findings(system)), wall_clock(system, 0.0).check] == [
        *(check for check in Check if check is not Check.WALL_CLOCK),
        Check.WALL_CLOCK,
    ]


@pytest.mark.parametrize(
    ("adapter", "verdict"),
    [
        (None, Verdict.UNKNOWN),
        (("socketcan", "can0"), Verdict.GOOD),
        (("socketcan", "can1"), Verdict.WEAK),
        (("socketcan", "eth0"), Verdict.WEAK),
        (("socketcan", ""), Verdict.WEAK),
        (("slcan", "/dev/ttyACM0@115200"), Verdict.GOOD),
        (("slcan", "/dev/ttyACM1"), Verdict.WEAK),
        (("pcan", "PCAN_USBBUS1"), Verdict.UNKNOWN),
        (("udp_multicast", "239.0.0.1"), Verdict.GOOD),
    ],
)
def test_the_adapter_of_the_machine_is_looked_for(
    tmp_path: Path, adapter: tuple[str, str] | None, verdict: Verdict
) -> None:
    assert verdicts(computer(tmp_path, adapter=adapter))[Check.ADAPTER] is verdict


def test_a_state_directory_that_cannot_be_made_is_weak(tmp_path: Path) -> None:
    assert verdicts(computer(tmp_path, state_root=tmp_path / "a" / "b"))[Check.STATE] is Verdict.GOOD
    (tmp_path / "file").write_text("", encoding="ascii")
    assert verdicts(computer(tmp_path, state_root=tmp_path / "file" / "b"))[Check.STATE] is Verdict.WEAK


@pytest.mark.parametrize(
    ("synchronised", "stepped_s", "verdict"),
    [
        (True, 0.001, Verdict.GOOD),
        (False, 0.0, Verdict.WEAK),
        (None, 0.0, Verdict.UNKNOWN),
        (True, 0.2, Verdict.WEAK),
        (True, -3600.0, Verdict.WEAK),
        (None, float("nan"), Verdict.WEAK),
    ],
)
def test_a_wall_clock_that_steps_or_drifts_is_weak(
    tmp_path: Path, synchronised: bool | None, stepped_s: float, verdict: Verdict
) -> None:
    found = wall_clock(computer(tmp_path, synchronised=synchronised), stepped_s)
    assert found.verdict is verdict
    assert len(finding_lines((found,))) == 1 + (verdict is Verdict.WEAK)
