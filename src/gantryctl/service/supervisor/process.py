"""The parent of the service's processes: starts them, starts them again, ends them; serves the local socket."""

from __future__ import annotations

import asyncio
import os
import secrets
import signal
import sys
import time
from collections.abc import Callable, Mapping, Sequence
from datetime import UTC, datetime
from functools import partial
from pathlib import Path
from typing import Final, NamedTuple

from gantryctl.errors import DeviceError
from gantryctl.machine import Machine, config_hash
from gantryctl.service.clients.console_link import LinkGiver
from gantryctl.service.clients.hub import Hub
from gantryctl.service.clients.local import LocalServer
from gantryctl.service.memory.memory import SharedMemory, Source, Word
from gantryctl.service.protocol.second_request import SECOND, SecondRequest
from gantryctl.service.recorder.retention import RetentionPolicy
from gantryctl.service.supervisor.certificates import CertificateWatch
from gantryctl.service.supervisor.child import Child, Relief, notify
from gantryctl.service.supervisor.users import Users, UserWatch

READY_S: Final = 20.0
_CONTROLLER_END_S: Final = 25.0
_END_S: Final = 8.0
_CERTIFICATES_S: Final = 3600.0
_LOOK_S: Final = 1.0
# A supervisor that was held up for so long cannot tell a process that hangs from one that was held up with it.
_HELD_UP_S: Final = 3.0


class Options(NamedTuple):
    """Options of the service beside its addresses.

    Attributes:
        policy: how much the recorder keeps.
        certificates: lists the files whose end is watched.
        second_person: what one person arms, another one executes.
        users: their changes go into the journal.
        self_test: what its checks found, by their names, for the journal.
        page: its address for people, "" without a page.
        bus_log: file of all frames of the bus, None for none.
        commissioning: its module, "" where this machine has nothing to commission.
    """

    policy: RetentionPolicy
    certificates: Callable[[], list[Path]]
    second_person: bool
    users: Users
    self_test: Mapping[str, str]
    page: str = ""
    bus_log: Path | None = None
    commissioning: str = ""


class Supervisor:
    """The service of one machine. All paths are absolute: the other processes stand in another folder.

    Args:
        config: the machine file that the controller loads. directory: the machine's state directory.
        gateway: command line of the gateway without the handle, or None for a service without a page.
        listener: handle of its listening socket. opcua: command line of the OPC UA server, or None.
        say: prints one line on the terminal of the service.
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
        self.memory.words[Word.SUPERVISOR] = os.getpid()
        self.memory.words[Word.CONTROLLER_CLEAN] = 1
        self.memory.words[Word.LEASE_MS] = round(machine.monitors.lease_ms)
        handle = self.memory.handle
        # -P: a file `json.py` in the folder where somebody starts the service is no module of it.
        run = [sys.executable, "-P", "-m"]
        # Modules by these names: they show in the list of processes.
        opens = [str(handle), str(config), config_hash(machine), str(options.users.root)]
        if options.second_person:
            opens.append("--second-person")
        controller = [*run, "gantryctl.service.controller", *opens]
        # It has the axis and its bus while the controller has not, and the same place at the shared memory.
        commissioning = Relief("commissioning", [*run, options.commissioning, *opens])
        # All but the recorder hold one end of a pipe, this process too: its other end tells the recorder when they are
        # gone, however they went, so that it ends last.
        others, self._here = os.pipe()
        words = self.memory.words

        def relief() -> Relief | None:
            # Taken once: a controller that is killed later is followed by a controller.
            wanted, words[Word.COMMISSIONING] = words[Word.COMMISSIONING], 0
            return commissioning if wanted and options.commissioning else None

        self.controller = Child("controller", controller, [handle, self._here], critical=True, relief=relief)
        recorder = [*run, "gantryctl.service.recorder", str(handle), str(directory), options.policy.to_json()]
        recorder += [str(others)]
        recorder += [] if options.bus_log is None else [str(options.bus_log)]
        self.recorder = Child(
            "recorder", recorder, [handle, others], beat_ns=partial(words.__getitem__, Word.RECORDER_NS)
        )
        self.gateway: Child | None = None
        if gateway is not None:
            # The listening socket belongs to this process: a gateway that restarts misses no connection
            # (decision 0011).
            command = [*run, *gateway, str(handle)]
            beat_ns = partial(words.__getitem__, Word.GATEWAY_NS)
            self.gateway = Child("gateway", command, [handle, listener, self._here], beat_ns=beat_ns)
        self.opcua: Child | None = None
        if opcua is not None:
            self.opcua = Child("opcua", [*run, *opcua, str(handle)], [handle, self._here])
        self._directory, self._say, self._options = directory, say, options
        self.hub = Hub(self.memory, Source.LOCAL)
        self._second = SecondRequest()

    async def run(self, ready: Callable[[], None]) -> int:
        """Run until a signal, or until the controller cannot be kept running; return the exit code.

        Raises:
            DeviceError: the controller does not start.
        """
        ended = asyncio.Event()
        loop = asyncio.get_running_loop()
        for number in (signal.SIGTERM, signal.SIGINT, signal.SIGHUP):
            loop.add_signal_handler(number, partial(self._asked_to_end, number, ended))
        self.hub.events.put("service", "self-test", None, **self._options.self_test)
        server = LocalServer(
            self._directory,
            self.hub,
            self._options.users.person,
            LinkGiver(self.memory.words, self._options.page),
        )
        keepers = {child: asyncio.create_task(child.keep(self._tell)) for child in self._children()}
        own = [asyncio.create_task(work) for work in (self.hub.run(), self._watch(), ended.wait())]
        try:
            await self._until_ready(keepers[self.controller], ended)
            await server.start()
            if not ended.is_set():
                ready()
                notify("READY")
            await asyncio.wait({*own, keepers[self.controller]}, return_when=asyncio.FIRST_COMPLETED)
            for task in own:
                if task.done() and (fault := task.exception()) is not None:
                    raise DeviceError(f"the first process of the service failed: {fault!r}")
            return 0 if ended.is_set() else DeviceError.exit_code
        finally:
            notify("STOPPING")
            await self._end()
            server.close()
            for task in (*own, *keepers.values()):
                task.cancel()

    def _asked_to_end(self, number: signal.Signals, ended: asyncio.Event) -> None:
        """End; but a person's first request is put off while torque alone holds the load, for it ends with the service.

        The system's own (SIGTERM) is not: behind it come a kill, and an end that leaves no words.
        """
        if self._holds_load and number is not signal.SIGTERM and self._second.asked() < SECOND:
            self._tell(
                "the service goes on: torque alone holds the load. Secure it; asked once more the service ends, and "
                "within 20 s nothing holds the load"
            )
            return
        ended.set()

    @property
    def _holds_load(self) -> bool:
        """Torque alone holds the load, by a controller that is alive: one that has gone holds nothing."""
        return self.hub.fresh and bool(self.hub.status()["tags"].get("power_phase") == "torque_hold")

    def _look_at_load(self) -> None:
        """Forget what was asked while torque alone held the load: the next time is another one."""
        if not self._holds_load:
            self._second.forget()

    def _children(self) -> list[Child]:
        made = (self.recorder, self.controller, self.gateway, self.opcua)
        return [child for child in made if child is not None]

    def _tell(self, text: str) -> None:
        self._say(text)
        self.hub.events.put("service", text)

    async def _watch(self) -> None:
        """Watch for hanging processes, changed users and ending certificates, once a second."""
        certificates, users = CertificateWatch(), UserWatch(self._options.users)
        before_s = certificates_s = time.monotonic() - _CERTIFICATES_S
        while True:
            now_s = time.monotonic()
            if now_s - before_s < _HELD_UP_S:
                for child in self._children():
                    child.end_hung(self._tell, time.monotonic_ns())
            before_s = now_s
            self._look_at_load()
            for text in users.changes():
                self.hub.events.put("user", text, None, file_ns=users.file_ns)
            if now_s - certificates_s >= _CERTIFICATES_S:
                certificates_s = now_s
                for text in certificates.due(self._options.certificates(), datetime.now(UTC)):
                    self._say(text)
                    self.hub.events.put("alarm", text)
            if self.hub.fresh:
                notify("WATCHDOG")
            await asyncio.sleep(_LOOK_S)

    async def _until_ready(self, keeper: asyncio.Task[None], ended: asyncio.Event) -> None:
        until_s = time.monotonic() + READY_S
        while not (self.hub.fresh or ended.is_set()):
            if time.monotonic() > until_s or keeper.done():
                raise DeviceError("the controller does not start; what it said stands above")
            await asyncio.sleep(0.02)

    async def _end(self) -> None:
        """End the axis first, then the page, then the journal."""
        # The axis must be at rest while the journal still takes events.
        self.hub.events.put("service", "the service ends")
        viewers = [child for child in (self.gateway, self.opcua) if child is not None]
        for child in viewers:
            child.leave()
        await self.controller.end(_CONTROLLER_END_S)
        for child in viewers:
            await child.end(_END_S)
        self.hub.logins.close()
        self.hub.refusals.close()
        os.close(self._here)
        await self.recorder.end(_END_S)
        self.memory.close()
