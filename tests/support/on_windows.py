"""Runs command lines as if on Windows: without the modules and calls that only other systems have.

    python on_windows.py '["move", "5"]' '["status"]'      # after the output of each: `code N PLATFORM COMMAND`

Every command runs twice: first on this system, so that what other packages load is loaded, for they ask for the
platform as well; then our modules are forgotten and loaded again without it. It shows that nothing of ours reaches
for what is missing there; it shows nothing of Windows itself: its clock, its adapters, its terminal.
"""

from __future__ import annotations

import asyncio
import json
import os
import signal
import socket
import sys
from types import ModuleType

ONLY_THERE = "there"
"""First word of a command line that is not run on this system."""
MODULES = ("fcntl", "resource", "pwd", "grp", "termios", "tty", "pty", "readline", "syslog")
CALLS = {
    os: [name for name in dir(os) if name.startswith(("sched_", "SCHED_", "pread", "pwrite", "posix_", "W"))]
    + [
        "fork",
        "getuid",
        "geteuid",
        "getgid",
        "getloadavg",
        "nice",
        "uname",
        "chown",
        "fchmod",
        "setsid",
        "statvfs",
    ]
    + ["O_NOFOLLOW", "O_DIRECTORY", "O_CLOEXEC", "O_NOCTTY", "O_NONBLOCK", "O_PATH", "sysconf", "fdatasync"],
    socket: ["AF_UNIX", "AF_NETLINK", "AF_CAN", "SO_PEERCRED"],
    signal: [
        "SIGHUP",
        "SIGKILL",
        "SIGQUIT",
        "SIGUSR1",
        "SIGUSR2",
        "SIGALRM",
        "SIGPIPE",
        "setitimer",
        "pthread_sigmask",
    ],
}


# Chooses its event loop when it is loaded.
LOADED = asyncio


class _Msvcrt(ModuleType):
    """The lock of the C library of Windows, which always lets us in here."""

    LK_NBLCK = 2

    @staticmethod
    def locking(handle: int, mode: int, count: int) -> None:
        """Lock `count` bytes of a file."""
        assert (mode, count) == (_Msvcrt.LK_NBLCK, 1)
        os.fstat(handle)


def become_windows() -> None:
    """Take away what Windows has not."""
    sys.modules.update(dict.fromkeys(MODULES))
    for module, names in CALLS.items():
        for name in names:
            if hasattr(module, name):
                delattr(module, name)
    sys.modules["msvcrt"] = _Msvcrt("msvcrt")
    sys.platform = "win32"


def main() -> None:
    """Run every command line of the arguments on both."""
    lines = [json.loads(line) for line in sys.argv[1:]]
    _run(lines)
    # The core is loaded once in a process.
    for name in [each for each in sys.modules if each.startswith("gantryctl") and each != "gantryctl._core"]:
        del sys.modules[name]
    become_windows()
    _run(lines)


def _run(lines: list[list[str]]) -> None:
    from gantryctl.cli.main import run

    for line in lines:
        if line[0] == ONLY_THERE and sys.platform != "win32":
            continue
        print("code", run(line[line[0] == ONLY_THERE :]), sys.platform, *line, flush=True)


if __name__ == "__main__":
    main()
