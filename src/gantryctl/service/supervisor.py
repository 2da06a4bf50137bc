"""The parent of the service's processes: starts them, starts them again, ends them; serves the local socket.

The controller ends first when the service ends, so that the axis is at rest while the journal still takes events.
"""

from __future__ import annotations

import asyncio
import contextlib
import secrets
import signal
import sys
import time
from collections.abc import Callable, Sequence
from datetime import UTC, datetime
from pathlib import Path
from typing import Final, NamedTuple

from gantryctl.errors import DeviceError
from gantryctl.machine import Machine, config_hash
from gantryctl.service.certificates import CertificateWatch
from gantryctl.service.hub import Hub
from gantryctl.service.keeping import Keeping
from gantryctl.service.local import LocalServer
from gantryctl.service.memory import SharedMemory, Source, Word

READY_S: Final = 20.0
_PAUSES_S: Final = (0.0, 0.1, 0.3, 0.5, 1.0, 2.0)
"""Before a process is started again; from the beginning once it has run for a while."""
_CALM_S: Final = 10.0
_CONTROLLER_END_S: Final = 25.0
_END_S: Final = 8.0
_CERTIFICATES_S: Final = 3600.0


class Child:
    """One process that is kept running.

    Args:
        handles: open files that it inherits.
        critical: the service ends when it cannot be kept running.
    """

    def __init__(
        self, name: str, command: Sequence[str], handles: Sequence[int], *, critical: bool = False
    ) -> None:
        self.name, self._command, self._handles = name, list(command), tuple(handles)
        self.critical = critical
        self.process: asyncio.subprocess.Process | None = None
        self.starts = 0
        self._ending = asyncio.Event()

    async def keep(self, said: Callable[[str], None]) -> None:
        """Run it until it is to end. Returns when a critical one fails too often."""
        tries = 0
        while not self._ending.is_set():
            began_s = time.monotonic()
            self.process = await asyncio.create_subprocess_exec(
                *self._command,
                pass_fds=self._handles,
                start_new_session=True,  # Ctrl-C is for the supervisor only
            )
            self.starts += 1
            code = await self.process.wait()
            if self._ending.is_set():
                return
            tries = 0 if time.monotonic() - began_s > _CALM_S else tries + 1
            if self.critical and tries > len(_PAUSES_S):
                said(f"{self.name} ended {tries} times (code {code}): the service ends")
                return
            pause_s = _PAUSES_S[min(tries, len(_PAUSES_S)) - 1] if tries else 0.0
            said(f"SYS-06 {self.name} ended with code {code}; started again in {pause_s:g} s")
            await asyncio.sleep(pause_s)

    def leave(self) -> None:
        """Do not start it again."""
        self._ending.set()

    async def end(self, patience_s: float) -> None:
        """Tell it to end, and end it when it does not."""
        self.leave()
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


class Options(NamedTuple):
    """What the service is told beside where it listens.

    Attributes:
        keeping: how much the recorder keeps.
        certificates: the files whose end is watched, as they are now.
        second_person: what one user arms, another one executes.
    """

    keeping: Keeping
    certificates: Callable[[], list[Path]]
    second_person: bool


class Supervisor:
    """The service of one machine.

    Args:
        config: the machine file that the controller loads. directory: the machine's state directory.
        gateway: command line of the gateway without the handle, or None for a service without a page.
        listener: handle of its listening socket. opcua: command line of the OPC UA server, or None.
        say: gets one line for whoever started the service.
        options: the rest.
    """

    def __init__(
        self,
        machine: Machine,
        config: Path,
        directory: Path,
        gateway: Sequence[str] | None,
        listener: int,
        opcua: Sequence[str] | None,
        say: Callable[[str], None],
        options: Options,
    ) -> None:
        self.memory = SharedMemory.create()
        self.memory.words[Word.BOOT] = secrets.randbits(62)
        self.memory.words[Word.CONTROLLER_CLEAN] = 1
        handle = self.memory.handle
        run = [sys.executable, "-m"]
        wanted = config_hash(machine)
        self.controller = Child(
            "controller",
            [*run, "gantryctl.service.controller", str(handle), str(config), wanted]
            + (["--second-person"] if options.second_person else []),
            [handle],
            critical=True,
        )
        recorder = [
            *run,
            "gantryctl.service.recorder",
            str(handle),
            str(directory),
            options.keeping.to_json(),
        ]
        self.recorder = Child("recorder", recorder, [handle])
        self.gateway: Child | None = None
        if gateway is not None:
            self.gateway = Child("gateway", [*run, *gateway, str(handle)], [handle, listener])
        self.opcua: Child | None = None
        if opcua is not None:
            self.opcua = Child("opcua", [*run, *opcua, str(handle)], [handle])
        self._directory, self._say, self._certificates = directory, say, options.certificates
        self.hub: Hub

    async def run(self, ready: Callable[[], None]) -> int:
        """Run until a signal or until the controller cannot be kept running; the exit code.

        Raises:
            DeviceError: the controller does not start.
        """
        ended = asyncio.Event()
        loop = asyncio.get_running_loop()
        for number in (signal.SIGTERM, signal.SIGINT, signal.SIGHUP):
            loop.add_signal_handler(number, ended.set)
        self.hub = Hub(self.memory, Source.LOCAL)
        server = LocalServer(self._directory, self.hub)
        keepers = {child: asyncio.create_task(child.keep(self._tell)) for child in self._children()}
        looking = asyncio.create_task(self.hub.run())
        watching = asyncio.create_task(self._watch_certificates())
        until_end = asyncio.create_task(ended.wait())
        try:
            await self._until_ready(keepers[self.controller], ended)
            await server.start()
            if not ended.is_set():
                ready()
            await asyncio.wait({until_end, keepers[self.controller]}, return_when=asyncio.FIRST_COMPLETED)
            return 0 if ended.is_set() else DeviceError.exit_code
        finally:
            until_end.cancel()
            await self._end()
            server.close()
            looking.cancel()
            watching.cancel()
            for keeper in keepers.values():
                keeper.cancel()

    def _children(self) -> list[Child]:
        return [
            child for child in (self.recorder, self.controller, self.gateway, self.opcua) if child is not None
        ]

    def _tell(self, text: str) -> None:
        self._say(text)
        self.hub.events.put("service", text)

    async def _watch_certificates(self) -> None:
        watch = CertificateWatch()
        while True:
            for text in watch.due(self._certificates(), datetime.now(UTC)):
                self._say(text)
                self.hub.events.put("alarm", text)
            await asyncio.sleep(_CERTIFICATES_S)

    async def _until_ready(self, keeper: asyncio.Task[None], ended: asyncio.Event) -> None:
        until_s = time.monotonic() + READY_S
        while not (self.hub.fresh or ended.is_set()):
            if time.monotonic() > until_s or keeper.done():
                raise DeviceError("the controller does not start; what it said stands above")
            await asyncio.sleep(0.02)

    async def _end(self) -> None:
        """Axis first, then page, then journal."""
        self.hub.events.put("service", "the service ends")
        lookers = [child for child in (self.gateway, self.opcua) if child is not None]
        for child in lookers:
            child.leave()
        await self.controller.end(_CONTROLLER_END_S)
        for child in lookers:
            await child.end(_END_S)
        await self.recorder.end(_END_S)
        self.memory.close()
