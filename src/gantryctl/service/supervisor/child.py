"""A process of the service that is kept running: started again when it ends, ended when it hangs."""

from __future__ import annotations

import asyncio
import contextlib
import os
import socket
import time
from collections.abc import Callable, Sequence
from typing import Final, NamedTuple

from gantryctl.program.alarms.codes import Code
from gantryctl.program.alarms.log import refusal
from gantryctl.program.alarms.words import Words

# Pauses before a new start; they begin again after a calm run. A killed process was back after 0.6 to 3.3 s
# (docs/evidence/service_kills.json).
_PAUSES_S: Final = (0.0, 0.1, 0.3, 0.5, 1.0, 2.0)
_CALM_S: Final = 10.0
# A process without a sign of life for so long hangs.
HANG_S: Final = 10.0
# Before the first sign: imports on a busy machine take their time.
START_S: Final = 60.0


class Relief(NamedTuple):
    """Another process in the place of a child, once: its name for people, and its command line."""

    name: str
    command: Sequence[str]


class Child:
    """One process that is kept running.

    Args:
        handles: open files that it inherits.
        critical: the service ends when it cannot be kept running.
        beat_ns: when it last gave a sign of life, on CLOCK_MONOTONIC; None when it gives none.
        relief: asked when it has ended: who takes its place until it is started again, None for nobody.
    """

    def __init__(
        self,
        name: str,
        command: Sequence[str],
        handles: Sequence[int],
        *,
        critical: bool = False,
        beat_ns: Callable[[], int] | None = None,
        relief: Callable[[], Relief | None] = lambda: None,
    ) -> None:
        self._relief = relief
        self.name, self._command, self._handles = name, list(command), tuple(handles)
        self.critical, self._beat_ns = critical, beat_ns
        self.process: asyncio.subprocess.Process | None = None
        self.starts = 0
        self._began_ns = 0
        self._ending = asyncio.Event()
        # Held while the system makes a process: `end` waits until there is one that it can end.
        self._making = asyncio.Lock()

    async def keep(self, said: Callable[[str], None]) -> None:
        """Run it until it is to end, or until a critical one has failed too often."""
        tries = 0
        while not self._ending.is_set():
            self._began_ns = time.monotonic_ns()
            how = await self._run(self._command)
            if self._ending.is_set():
                return
            if (relief := self._relief()) is not None:
                tries = 0
                said(f"{relief.name} takes the place of the {self.name}")
                how = await self._run(relief.command)
                if self._ending.is_set():
                    return
                said(f"{relief.name} {how}; the {self.name} takes its place again")
                continue
            ran_s = (time.monotonic_ns() - self._began_ns) * 1e-9
            tries = 0 if ran_s > _CALM_S else tries + 1
            if self.critical and tries > len(_PAUSES_S):
                said(f"{self.name} {how}, {tries} times: the service ends")
                return
            pause_s = _PAUSES_S[min(tries, len(_PAUSES_S)) - 1] if tries else 0.0
            again = Words.STARTED_AGAIN(how=how, pause_s=pause_s)
            said(refusal(Code.SYS_06, process=self.name, how=again).line)
            await asyncio.sleep(pause_s)

    async def _run(self, command: Sequence[str]) -> str:
        """Start it and wait; return how it ended."""
        try:
            async with self._making:
                self.process = await asyncio.create_subprocess_exec(
                    *command,
                    pass_fds=self._handles,
                    # No folder of a user: it could not be unmounted, and no relative path leads there.
                    cwd="/",
                    # A session of its own: Ctrl-C reaches the supervisor only, which ends the axis first.
                    start_new_session=True,
                )
        # Memory, handles or processes may be short now and not later (tests/system/test_service_starved.py).
        except OSError as fault:
            return f"could not be started: {fault.strerror or fault}"
        self.starts += 1
        return f"ended with code {await self.process.wait()}"

    def end_hung(self, said: Callable[[str], None], now_ns: int) -> None:
        """End it after too long without a sign of life; `keep` starts it again."""
        if self._beat_ns is None or self.process is None or self.process.returncode is not None:
            return
        beat_ns = self._beat_ns()
        lively = beat_ns > self._began_ns
        silent_s = (now_ns - (beat_ns if lively else self._began_ns)) * 1e-9
        if silent_s > (HANG_S if lively else START_S):
            silent = Words.NO_SIGN_OF_LIFE(silent_s=silent_s)
            said(refusal(Code.SYS_06, process=self.name, how=silent).line)
            with contextlib.suppress(ProcessLookupError):
                self.process.kill()

    def leave(self) -> None:
        """Keep it from being started again."""
        self._ending.set()

    async def end(self, patience_s: float) -> None:
        """Ask it to end, and kill it if it does not."""
        self.leave()
        async with self._making:
            pass
        if self.process is None or self.process.returncode is not None:
            return
        with contextlib.suppress(ProcessLookupError):
            self.process.terminate()
        try:
            await asyncio.wait_for(self.process.wait(), patience_s)
        except TimeoutError:
            with contextlib.suppress(ProcessLookupError):
                self.process.kill()
            await self.process.wait()


def notify(word: str) -> None:
    """Tell systemd READY, WATCHDOG or STOPPING; without systemd do nothing."""
    address = os.environ.get("NOTIFY_SOCKET", "")
    if not address:
        return
    if address.startswith("@"):
        address = "\0" + address[1:]
    with contextlib.suppress(OSError), socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as made:
        made.sendto(f"{word}=1".encode(), address)
