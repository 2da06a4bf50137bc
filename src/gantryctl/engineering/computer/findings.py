"""What the system says of itself: how late a scan is, whose time the journal has, what this user may; else unknown."""

from __future__ import annotations

import os
import sys
from collections.abc import Callable
from enum import Enum
from pathlib import Path
from typing import Final, NamedTuple

# The service asks for this priority (docs/how-to/run-as-a-service.md).
PRIORITY_WANTED: Final = 80
_TIME_ERROR: Final = 5
_STEP_S: Final = 0.05
"""A wall clock that is kept right by its rate goes on within this, in the time of a trial."""
_WITHOUT_ADAPTER: Final = ("simulated", "udp_multicast", "virtual")
# ARPHRD_CAN of <linux/if_arp.h>.
_CAN_TYPE: Final = "280"
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
    WALL_CLOCK = "wall clock"
    STATE = "state"
    ADAPTER = "CAN adapter"


class Verdict(Enum):
    """Judgement of one finding."""

    GOOD = "good"
    WEAK = "weak"
    """It makes scans later than they need be, or something else fails that will be wanted."""
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
    synchronised: bool | None = None
    """Something keeps the wall clock right; None: not known."""
    state_root: Path = Path("/")
    """Where state is kept, or would be made."""
    adapter: tuple[str, str] | None = None
    """Interface of python-can and channel of the machine; None: it has no bus."""

    def read(self, name: str) -> str | None:
        """Contents of a file of the system, or None."""
        try:
            return (self.root / name).read_text(encoding="ascii", errors="replace").strip()
        except OSError:
            return None


def this_system(state_root: Path, adapter: tuple[str, str] | None) -> System:
    """The computer that this process runs on."""
    load = os.getloadavg()[0] if hasattr(os, "getloadavg") else None
    return System(priority_limit=_priority_limit(), load=load, processors=os.cpu_count() or 1,
        synchronised=_synchronised(), state_root=state_root, adapter=adapter,
    )  # fmt: skip


def _synchronised() -> bool | None:
    """Whether the kernel counts its clock as synchronised; adjtimex(2)."""
    if sys.platform != "linux":
        return None
    import ctypes

    adjtimex = getattr(ctypes.CDLL(None, use_errno=True), "adjtimex", None)
    if adjtimex is None:
        return None
    # struct timex, 208 bytes with 64-bit words, all zero: nothing is set. The answer is the state of the clock.
    state: int = adjtimex(ctypes.create_string_buffer(256))
    return None if state < 0 else state != _TIME_ERROR


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


def _state(system: System) -> tuple[Verdict, str]:
    place = next(folder for folder in (system.state_root, *system.state_root.parents) if folder.exists())
    # A directory that is there, or the one in which it would be made.
    if place.is_dir() and os.access(place, os.W_OK | os.X_OK):
        return Verdict.GOOD, str(system.state_root)
    return Verdict.WEAK, f"{place}: no right to write there"


def _adapter(system: System) -> tuple[Verdict, str]:
    if system.adapter is None:
        found = [path.name for path in _can_networks(system)]
        return Verdict.UNKNOWN, f"the machine asks for none; here: {', '.join(found) or 'none of SocketCAN'}"
    interface, channel = system.adapter
    name = f"{interface} {channel}".strip()
    if interface == "socketcan":
        folder = system.root / "sys/class/net" / channel
        if folder not in _can_networks(system):
            return Verdict.WEAK, f"{name}: there is no such CAN network"
        # Bit 0 of the flags is IFF_UP; a CAN network without a carrier still says "unknown" as its state.
        up = int(system.read(f"sys/class/net/{channel}/flags") or "0", 16) & 1
        return (Verdict.GOOD, f"{name}, up") if up else (Verdict.WEAK, f"{name}: is down")
    if interface in _WITHOUT_ADAPTER:
        return Verdict.GOOD, f"{name}: needs none"
    if channel.startswith("/dev/"):
        device = system.root / channel.lstrip("/").partition("@")[0]
        if not device.exists():
            return Verdict.WEAK, f"{name}: there is no such device"
        if not os.access(device, os.R_OK | os.W_OK):
            return Verdict.WEAK, f"{name}: no right to use it"
        return Verdict.GOOD, name
    return Verdict.UNKNOWN, f"{name}: its driver tells when it is opened: gantryctl can scan"


def _can_networks(system: System) -> list[Path]:
    folders = sorted((system.root / "sys/class/net").glob("*"))
    return [each for each in folders if system.read(f"sys/class/net/{each.name}/type") == _CAN_TYPE]


def wall_clock(system: System, stepped_s: float) -> Finding:
    """Whether the wall clock is right, and stays so: the journal has its times from it, and never a scan.

    Args:
        stepped_s: how much it went on more than the steady clock while somebody watched.
    """
    if not abs(stepped_s) <= _STEP_S:
        return Finding(Check.WALL_CLOCK, Verdict.WEAK, f"stepped by {stepped_s:+.3f} s during the trials")
    if system.synchronised is None:
        return Finding(Check.WALL_CLOCK, Verdict.UNKNOWN, "not shown; no step during the trials")
    if system.synchronised:
        return Finding(Check.WALL_CLOCK, Verdict.GOOD, "synchronised, no step during the trials")
    return Finding(Check.WALL_CLOCK, Verdict.WEAK, "not synchronised")


_LOOKS: Final[dict[Check, Callable[[System], tuple[Verdict, str]]]] = {
    Check.KERNEL: _kernel,
    Check.PRIORITY: _priority,
    Check.GOVERNOR: _governor,
    Check.ISOLATION: _isolation,
    Check.CLOCK_SOURCE: _clock_source,
    Check.LOAD: _load,
    Check.STATE: _state,
    Check.ADAPTER: _adapter,
}


def findings(system: System) -> tuple[Finding, ...]:
    """Everything that is looked at before a trial, in one order."""
    return tuple(Finding(check, *look(system)) for check, look in _LOOKS.items())
