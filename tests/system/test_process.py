"""gantryctl as a process of its own: help, a closed pipe, Ctrl-C on a terminal."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
from pathlib import Path

import pytest

COMMAND = [sys.executable, "-m", "gantryctl"]


@pytest.fixture
def environment(tmp_path: Path) -> dict[str, str]:
    return {**os.environ, "GANTRYCTL_STATE": str(tmp_path), "COLUMNS": "120"}


def status(environment: dict[str, str]) -> str:
    done = subprocess.run(
        [*COMMAND, "status"], env=environment, capture_output=True, text=True, check=True, timeout=60
    )
    return done.stdout


def test_help_imports_nothing_heavy(environment: dict[str, str]) -> None:
    """Below 0.2 s is measured by the benchmarks; this is what makes it possible."""
    code = (
        "import sys; from gantryctl.cli.main import run; code = run(['--help']); "
        "heavy = {'numpy', 'pydantic', 'pyarrow', 'matplotlib', 'rich', 'gantryctl._core'}; "
        "print(code, sorted(heavy & set(sys.modules)))"
    )
    done = subprocess.run(
        [sys.executable, "-c", code], env=environment, capture_output=True, text=True, check=True, timeout=60
    )
    assert done.stdout.startswith("Usage: gantryctl")
    assert done.stdout.splitlines()[-1] == "0 []"


def test_a_reader_that_has_seen_enough_ends_a_command_as_any_other_tool(environment: dict[str, str]) -> None:
    """`gantryctl config show | head -1`, with a reader that is gone before the first byte."""
    read, write = os.pipe()
    os.close(read)
    for command in (["config", "show"], ["config", "schema"], ["explain"], ["--help"]):
        done = subprocess.run(
            [*COMMAND, *command],
            env=environment,
            stdout=write,
            stderr=subprocess.PIPE,
            timeout=60,
            check=False,
        )
        # What a shell reports of a tool that SIGPIPE has ended.
        assert (done.returncode, done.stderr) == (141, b"")
    os.close(write)


def test_a_move_that_nobody_watches_any_more_stops(environment: dict[str, str]) -> None:
    run = subprocess.Popen(
        [*COMMAND, "move", "90"], env=environment, stdout=subprocess.PIPE, stderr=subprocess.PIPE
    )
    assert run.stdout is not None
    assert run.stderr is not None
    run.stdout.readline()
    run.stdout.close()
    with run.stderr as err:
        assert err.read() == b""
    assert run.wait(60) == 1
    said = status(environment)
    assert "stopped: nobody reads its lines any more" in said
    assert "power off, brake closed" in said
    assert "angle             90" not in said


@pytest.mark.skipif(sys.platform == "win32", reason="no pseudo terminals")
@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_a_signal_in_real_time_stops_on_the_ramp(environment: dict[str, str], number: int) -> None:
    import pty

    master, slave = pty.openpty()
    run = subprocess.Popen(
        [*COMMAND, "jog", "+", "--for", "60", "--real-time"], env=environment, stdout=slave, stderr=slave
    )
    os.close(slave)
    shown = b""
    while b"continuous motion" not in shown:
        shown += os.read(master, 4096)
    run.send_signal(number)
    while True:
        try:
            shown += os.read(master, 4096)
        except OSError:  # the other end is closed: the process is gone
            break
    assert run.wait(60) == 1
    os.close(master)
    assert b"Traceback" not in shown
    assert b"stopped by the operator: " in shown
    assert b"\r" in shown, "a live line"
    assert "power off, brake closed" in status(environment)
