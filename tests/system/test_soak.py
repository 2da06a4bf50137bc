"""The soak itself, for two minutes with steps of the clock both ways: all but the slopes of memory is judged.

On a quiet machine: a browser that gets no processor for two seconds loses control, and that is a stop nobody asked for.
"""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

from support.browser import CHROMIUM
from support.soak.verdict import judge, read_log, words

SOAK = Path(__file__).parents[2] / "benchmarks" / "soak.py"


@pytest.mark.slow
@pytest.mark.skipif(sys.platform != "linux", reason="the service needs Linux")
@pytest.mark.skipif(not Path(CHROMIUM).exists(), reason=f"{CHROMIUM} is missing: Debian package chromium")
def test_two_minutes_of_service_with_a_clock_that_is_stepped_both_ways(tmp_path: Path) -> None:
    log = tmp_path / "soak.jsonl"
    command = [sys.executable, str(SOAK), "--hours", "0.035", "--step-min", "0.4", "--log", str(log)]
    with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True) as run:
        try:
            said, _ = run.communicate()
        finally:
            run.terminate()  # as Ctrl-C: it ends its service and its browser
    assert run.returncode == 0, said
    findings = judge(read_log(log))
    assert [each.what for each in findings if not each.what.startswith("memory") and not each.passed] == []
    assert words(findings) in said
