"""`ok` means that it is on the disk: looked at by another process at the moment of the reply.

INV-8: what was acknowledged is kept; with a recorder that hangs the reply says that it is not, and nothing else waits.
"""

from __future__ import annotations

import asyncio
import json
import os
import signal
import sqlite3
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import closing
from pathlib import Path
from typing import Any

import pytest

from gantryctl.service.clients.hub import Hub
from gantryctl.service.memory.events import EventLog
from gantryctl.service.memory.memory import SharedMemory, Source, Word
from gantryctl.service.protocol.messages import compact, reply_to
from gantryctl.service.protocol.roles import Role
from gantryctl.service.recorder.journal.places import FILE
from gantryctl.service.recorder.journal.proof import verify
from gantryctl.service.recorder.journal.reading import read_journal
from gantryctl.service.recorder.retention import RetentionPolicy
from gantryctl.service.supervisor.users import Users
from gantryctl.service.supervisor.users_kept import not_kept, running
from support.marks import UNKNOWN
from support.service_process import PASSWORD, Page, Service

pytestmark = pytest.mark.skipif(sys.platform != "linux", reason="the service needs Linux")
RECORDER = ["-m", "gantryctl.service.recorder"]
LIAR = ["-m", "support.lying_recorder"]
KEPT = "SELECT 1 FROM events WHERE source = ? AND number = ?"


class Disk:
    """The journal as another process than its writer finds it."""

    def __init__(self, directory: Path) -> None:
        self._uri = f"{(directory / FILE).resolve().as_uri()}?mode=ro"

    def has(self, number: int) -> bool:
        """Whether an event of the controller is committed. Readers see no commit before its synchronisation."""
        with closing(sqlite3.connect(self._uri, uri=True)) as db:
            return db.execute(KEPT, (Source.CONTROLLER, number)).fetchone() is not None


def missing_at_reply(directory: Path, recorder: list[str], commands: int) -> int:
    """Replies of a hub whose event was not on the disk; the recorder is a process, the controller a stand-in."""
    memory = SharedMemory.create()
    memory.words[Word.BOOT], memory.words[Word.SUPERVISOR] = 9, os.getpid()
    arguments = [str(memory.handle), str(directory), RetentionPolicy().to_json(), "-1"]
    process = subprocess.Popen(
        [sys.executable, *recorder, *arguments],
        pass_fds=(memory.handle,),
        env={**os.environ, "PYTHONPATH": os.pathsep.join(sys.path)},  # the liar is one of the tests
    )
    log, missing = EventLog(memory.events[Source.CONTROLLER]), 0
    while not memory.words[Word.RECORDER_NS]:
        assert process.poll() is None
        time.sleep(0.01)

    async def whole() -> None:
        nonlocal missing
        hub = Hub(memory, Source.WEB)
        client = hub.connect("anna", Role.OPERATOR, "console")
        serving = asyncio.create_task(hub.run())
        for seq in range(1, commands + 1):
            client.take(json.dumps({"type": "reset", "seq": seq, "frame": UNKNOWN, "epoch": 1}))
            reply = reply_to(seq, journal=log.put("command", "reset: done"))
            memory.replies[Source.WEB].put(compact([client.who.client, reply]).encode())
            while not any('"reply"' in text for text in client.outgoing()):
                await asyncio.sleep(0.001)
            missing += not Disk(directory).has(seq)
        serving.cancel()

    try:
        asyncio.run(whole())
    finally:
        process.terminate()
        process.wait(30)
        memory.close()
    return missing


def test_no_reply_of_the_hub_comes_before_its_event(tmp_path: Path) -> None:
    assert missing_at_reply(tmp_path, RECORDER, 15) == 0


def test_this_test_can_fail_a_recorder_that_acknowledges_before_it_writes_is_found(tmp_path: Path) -> None:
    assert missing_at_reply(tmp_path, LIAR, 5) > 0


@pytest.fixture
def service(tmp_path: Path) -> Iterator[Service]:
    Users(tmp_path).add("physicist", Role.PHYSICIST, PASSWORD)
    with Service(tmp_path) as made:
        yield made


def settings(page: Page, count: int) -> Iterator[dict[str, Any]]:
    """Replies to so many changes of a setting."""
    for n in range(count):
        yield page.ask("set", tag="increment_deg", value=1.0 + n)


def replies_while_working(page: Page) -> Iterator[dict[str, Any]]:
    """Replies to commands of each kind that is kept first."""
    yield page.ask("power", on=True)
    page.until(lambda tags: bool(tags["power"]))
    yield from settings(page, 5)
    page.do("mode", mode="incremental")
    yield page.ask("increment", direction="forward")
    page.until(lambda tags: tags["at_rest"] and tags["axis_state"] == "standstill")
    yield page.ask("move_by", distance_deg=0.5)
    page.do("quick_stop")
    page.until(lambda tags: tags["alarm_count"] > 0 and tags["power_phase"] == "off")
    yield page.ask("acknowledge", id=page.tags["alarms"][0]["id"])
    yield page.ask("reset")


def test_ok_means_on_the_disk_and_a_recorder_that_hangs_delays_replies_only(service: Service) -> None:
    disk, users = Disk(service.directory), Users(service.root)
    users.set_person("physicist", "anna")
    assert not_kept(users, running(service.root)) == []
    assert "user physicist is an account of anna now, before of physicist" in texts(service)
    with service.page("physicist") as page:
        page.do("take", over=False)
        for reply in replies_while_working(page):
            assert (reply["ok"], reply["code"]) == (True, ""), reply
            assert disk.has(reply["journal"]), reply
        page.do("power", on=True)
        page.until(lambda tags: bool(tags["power"]))
        page.do("mode", mode="continuous")
        page.do("set", tag="speed_setting_deg_s", value=1.0)
        page.do("move", target_deg=20.0)
        page.until(lambda tags: tags["vel_act_deg_s"] > 0.9)
        recorder = service.child("recorder")
        os.kill(recorder, signal.SIGSTOP)
        try:
            hanging(page)
            users.set_person("physicist", "physicist")
            assert not_kept(users, running(service.root)) == ["hust_gantry"]
        finally:
            os.kill(recorder, signal.SIGCONT)
        assert not_kept(users, running(service.root)) == []
    with service.page("physicist") as page:
        page.do("take", over=False)
        (reply,) = settings(page, 1)
        assert reply["code"] == ""
    service.end()
    assert running(service.root) == []
    assert verify(service.directory).wrong == ""
    for said in ("set override_percent 50.0 (before: 100): done", "stop: done", "power False: done"):
        assert said in texts(service)


def texts(service: Service) -> list[str]:
    """Texts of the journal on the disk."""
    return [row.values["text"] for row in read_journal(service.directory)]


def hanging(page: Page) -> None:
    """The axis moves, and nothing reaches the disk."""
    scans = page.tags["scan_overruns"], page.tags["time_s"]
    reply = page.ask("set", tag="override_percent", value=50.0)
    assert (reply["ok"], reply["code"]) == (True, "JRN-03"), reply
    assert reply["values"]["reason"]["values"]["number"] == reply["journal"]
    assert page.tags["override_percent"] == 50.0  # done all the same
    stopped = page.ask("stop")
    assert (stopped["ok"], stopped["code"]) == (True, "")
    page.until(lambda tags: tags["epoch"] == stopped["epoch"])  # a picture of before the stop may still come
    off = page.ask("power", on=False)
    assert (off["ok"], off["code"]) == (True, ""), off
    page.until(lambda tags: tags["power_phase"] == "off")
    assert page.tags["journal_committed"] < page.tags["journal_sequence"]
    # The scan was not held for a second: it would show as scans that were left out, and as SYS-03.
    assert page.tags["alarm_count"] == 0
    assert scans[1] < page.tags["time_s"]


@pytest.mark.slow
def test_sixty_replies_and_their_time(
    service: Service, evidence: Callable[[str, dict[str, object]], None]
) -> None:
    disk, taken_ms, missing = Disk(service.directory), [], 0
    with service.page("physicist") as page:
        page.do("take", over=False)
        for n in range(60):
            seq, began_s = page.say("set", tag="increment_deg", value=1.0 + n), time.monotonic()
            while seq not in page.replies:
                page.take(page.socket.recv(30.0))
            taken_ms.append((time.monotonic() - began_s) * 1e3)
            reply = page.replies.pop(seq)
            assert reply["code"] == "", reply
            missing += not disk.has(reply["journal"])
            page.look()
        recorder = service.child("recorder")
        os.kill(recorder, signal.SIGSTOP)
        began_s = time.monotonic()
        codes = [reply["code"] for reply in settings(page, 5)]
        stopped_s = (time.monotonic() - began_s) / 5
        os.kill(recorder, signal.SIGCONT)
    taken_ms.sort()
    evidence(
        "replies_kept",
        {
            "replies": len(taken_ms),
            "before_the_disk": missing,
            "reply_median_ms": round(taken_ms[30], 1),
            "reply_p95_ms": round(taken_ms[57], 1),
            "reply_max_ms": round(taken_ms[-1], 1),
            "with_recorder_stopped": {"codes": codes, "reply_s": round(stopped_s, 2)},
            "load_average": os.getloadavg(),
        },
    )
    assert missing == 0
    assert codes == ["JRN-03"] * 5
