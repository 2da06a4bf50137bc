"""What the system says of itself that decides how late a scan is; Linux only, elsewhere unknown."""

from __future__ import annotations

import os
import sys
from collections.abc import Callable
from enum import Enum
from pathlib import Path
from typing import Final, NamedTuple

# The service asks for this priority (docs/how-to/run-as-a-service.md).
PRIORITY_WANTED: Final = 80
# Read by an instruction of the processor; every other source is a call into hardware or a hypervisor.
_FAST_CLOCKS: Final = ("tsc", "arch_sys_counter", "kvm-clock", "riscv_clocksource")


class Check(Enum):
    """What is looked at."""

    KERNEL = "kernel"
    PRIORITY = "priority"
    GOVERNOR = "governor"
    ISOLATION = "isolation"
    CLOCK_SOURCE = "clock source"
    LOAD = "load"


class Verdict(Enum):
    """Judgement of one finding."""

    GOOD = "good"
    WEAK = "weak"
    """It makes scans later than they need be."""
    UNKNOWN = "unknown"
    """The system does not show it."""


class Finding(NamedTuple):
    """One finding: what, how it is judged, and what was read."""

    check: Check
    verdict: Verdict
    found: str


class System(NamedTuple):
    """Where the findings are read; another root for tests."""

    root: Path = Path("/")
    priority_limit: int | None = None
    """Highest real-time priority that this user may ask for; None: not known."""
    load: float | None = None
    """Processes that ran or wanted to run in the last minute, as a mean; None: not known."""
    processors: int = 1

    def read(self, name: str) -> str | None:
        """Contents of a file of the system, or None."""
        try:
            return (self.root / name).read_text(encoding="ascii", errors="replace").strip()
        except OSError:
            return None


def this_system() -> System:
    """The computer that this process runs on."""
    load = os.getloadavg()[0] if hasattr(os, "getloadavg") else None
    return System(priority_limit=_priority_limit(), load=load, processors=os.cpu_count() or 1)


def _priority_limit() -> int | None:
    if sys.platform != "linux":
        return None
    import resource

    if os.geteuid() == 0:
        return os.sched_get_priority_max(os.SCHED_FIFO)
    limit = resource.getrlimit(resource.RLIMIT_RTPRIO)[0]
    return os.sched_get_priority_max(os.SCHED_FIFO) if limit == resource.RLIM_INFINITY else limit


def _kernel(system: System) -> tuple[Verdict, str]:
    version = system.read("proc/version")
    if version is None:
        return Verdict.UNKNOWN, "not Linux"
    fully = system.read("sys/kernel/realtime") == "1" or "PREEMPT_RT" in version
    words = version.split()
    name = f"{words[0]} {words[2]}" if len(words) > 2 else version
    return (Verdict.GOOD, f"{name}, PREEMPT_RT") if fully else (Verdict.WEAK, f"{name}, not PREEMPT_RT")


def _priority(system: System) -> tuple[Verdict, str]:
    limit = system.priority_limit
    if limit is None:
        return Verdict.UNKNOWN, "no limit is shown"
    return (Verdict.GOOD if limit >= PRIORITY_WANTED else Verdict.WEAK), f"up to {limit}"


def _governor(system: System) -> tuple[Verdict, str]:
    folder = system.root / "sys/devices/system/cpu"
    found = {
        governor
        for path in sorted(folder.glob("cpu[0-9]*/cpufreq/scaling_governor"))
        if (governor := system.read(str(path.relative_to(system.root))))
    }
    if not found:
        return Verdict.UNKNOWN, "the frequency is not governed here"
    verdict = Verdict.GOOD if found == {"performance"} else Verdict.WEAK
    return verdict, ", ".join(sorted(found))


def _isolation(system: System) -> tuple[Verdict, str]:
    isolated = system.read("sys/devices/system/cpu/isolated")
    if isolated is None:
        return Verdict.UNKNOWN, "not shown"
    return (Verdict.GOOD, f"processors {isolated}") if isolated else (Verdict.WEAK, "no processor")


def _clock_source(system: System) -> tuple[Verdict, str]:
    source = system.read("sys/devices/system/clocksource/clocksource0/current_clocksource")
    if source is None:
        return Verdict.UNKNOWN, "not shown"
    return (Verdict.GOOD if source in _FAST_CLOCKS else Verdict.WEAK), source


def _load(system: System) -> tuple[Verdict, str]:
    if system.load is None:
        return Verdict.UNKNOWN, "not shown"
    # One processor is left for the scan.
    verdict = Verdict.GOOD if system.load <= max(0.5, system.processors - 1.0) else Verdict.WEAK
    return verdict, f"{system.load:.1f} on {system.processors} processors"


_LOOKS: Final[dict[Check, Callable[[System], tuple[Verdict, str]]]] = {
    Check.KERNEL: _kernel,
    Check.PRIORITY: _priority,
    Check.GOVERNOR: _governor,
    Check.ISOLATION: _isolation,
    Check.CLOCK_SOURCE: _clock_source,
    Check.LOAD: _load,
}


def findings(system: System) -> tuple[Finding, ...]:
    """Everything that is looked at, in one order."""
    return tuple(Finding(check, *look(system)) for check, look in _LOOKS.items())
