"""One input at one door, judged: only the promised error leaves it, within its time, within its memory."""

from __future__ import annotations

import time
import warnings
from pathlib import Path
from typing import Final

from support.coverage_fuzz.targets import Target

CPU_MAX_S: Final = 0.1
MEMORY_MAX_MB: Final = 200.0
CORPUS: Final = Path(__file__).resolve().parents[2] / "data" / "fuzz"
"""A folder for each target; `base` holds the files that patches change."""
_STATUS: Final = Path("/proc/self/status")


class TooSlow(AssertionError):
    """An input that takes too long."""


class TooMuch(AssertionError):
    """An input that takes too much memory."""


def memory_mb(field: str) -> float:
    """VmRSS: memory of this process now; VmHWM: the most since it was last set back."""
    (line,) = (line for line in _STATUS.read_text("ascii").splitlines() if line.startswith(f"{field}:"))
    return int(line.split()[1]) / 1024.0


def set_back_peak() -> None:
    """VmHWM is VmRSS again: another test of this process may have had more than the input takes."""
    Path("/proc/self/clear_refs").write_text("5", "ascii")  # proc(5)


def judge(target: Target, data: bytes, cpu_max_s: float = CPU_MAX_S, tries: int = 3) -> bool:
    """Whether the door took the input; False where it refused it with its own error.

    Args:
        cpu_max_s: processor time of this thread. tries: the shortest of so many counts, on a busy computer.

    Raises:
        TooSlow, TooMuch: a limit is passed. Exception: what left the door and was not promised.
    """
    set_back_peak()
    before_mb, took_s, taken = memory_mb("VmRSS"), [], True
    for _ in range(tries):
        begun_s = time.thread_time()
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            try:
                target.run(data)
            except target.promised:
                taken = False
        took_s.append(time.thread_time() - begun_s)
        if took_s[-1] <= cpu_max_s:
            break
    if min(took_s) > cpu_max_s:
        raise TooSlow(
            f"{len(data)} bytes took {min(took_s):.3f} s of processor time, allowed {cpu_max_s:g} s"
        )
    more_mb = memory_mb("VmHWM") - before_mb
    if more_mb > MEMORY_MAX_MB:
        raise TooMuch(f"{len(data)} bytes took {more_mb:.0f} MB, allowed {MEMORY_MAX_MB:g} MB")
    return taken
