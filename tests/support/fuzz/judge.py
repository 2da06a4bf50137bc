"""What must hold while hostile clients are at work: nobody dies, nothing grows, the scan goes on and Stop works."""

from __future__ import annotations

import threading
import time
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from support.new_page import open_page
from support.service_process import Service

CHILDREN = ("controller", "recorder", "gateway", "gateway.opcua")
GROWN_MAX_MB = {"controller": 64.0, "recorder": 256.0, "gateway": 64.0, "gateway.opcua": 128.0}
"""Of one process, to its largest, from its first Stop on. The recorder holds the columns of a recording until its rows
are written, attacked or not. Others: answers of up to 1 MiB that wait, for 16 clients of OPC UA, and arenas of the
allocator."""
SCAN_MIN_HZ_PART = 0.5
"""Part of the scans that a quiet computer would make, over a minute: the host may be busy, a scan that stands is 0."""
STOP_MAX_S = 2.0
"""From pressing Stop to its reply. Its way is 20 ms; the rest is a host whose processors are taken by the attack."""
TRIES = 8


@dataclass
class Record:
    """What was seen.

    Attributes:
        stops_s: time from Stop in motion to its reply.
        new_pages_s: time until somebody who comes now has the first picture. asked_again: requests that took two tries.
        first_mb, last_mb, most_mb: resident memory by process.
    """

    stops_s: list[float] = field(default_factory=list)
    first_mb: dict[str, float] = field(default_factory=dict)
    last_mb: dict[str, float] = field(default_factory=dict)
    most_mb: dict[str, float] = field(default_factory=dict)
    scans_hz: list[float] = field(default_factory=list)
    new_pages_s: list[float] = field(default_factory=list)
    asked_again: int = 0
    faults: list[str] = field(default_factory=list)


class Judge:
    """A page that stays open from before the attack to its end, and looks at the processes.

    Args:
        calm: set while the axis is moved for a Stop: hostile clients send no stop of their own then.
        children: processes of the service that are looked at.
        session: of a browser that opens the page again; without it each new page logs in.
    """

    def __init__(
        self, service: Service, calm: threading.Event, children: Sequence[str] = CHILDREN, session: str = ""
    ) -> None:
        self._service, self._calm, self._session = service, calm, session
        self._page = service.page("operator", queue=None)
        self._numbers = {name: service.child(name) for name in children}
        self.record = Record()

    def __enter__(self) -> Judge:
        return self

    def __exit__(self, *_: object) -> None:
        self._page.__exit__(None, None, None)

    def watch(self, until_s: float, every_s: float) -> None:
        """Look until a time of `time.monotonic`, and judge once in every period."""
        self._stop()
        while time.monotonic() < until_s:
            next_s = min(until_s, time.monotonic() + every_s)
            scan, at_s = self._page.look()["scan"], time.monotonic()
            while time.monotonic() < next_s:
                self._page.look()
                self._page.say("alive")
                self._processes()
            self.record.scans_hz.append((self._page.look()["scan"] - scan) / (time.monotonic() - at_s))
            if self.record.scans_hz[-1] < SCAN_MIN_HZ_PART * 1e3 / self._page.tags["scan_period_ms"]:
                self._fault(f"{self.record.scans_hz[-1]:.0f} scans a second")
            self._new_page()
            self._stop()

    def _fault(self, what: str) -> None:
        self.record.faults.append(what)

    def _processes(self) -> None:
        """The same processes as at the start, and none that grows without end."""
        for name, number in self._numbers.items():
            found = _resident_mb(number)
            if found is None:
                self._fault(f"{name} died")
                with suppress(AssertionError):  # it is being started again
                    self._numbers[name] = self._service.child(name)
                continue
            if self.record.stops_s:  # a motion is recorded, which takes memory of its own
                self.record.first_mb.setdefault(name, found)
            self.record.last_mb[name] = found
            self.record.most_mb[name] = max(found, self.record.most_mb.get(name, 0.0))

    def grown_mb(self) -> dict[str, float]:
        """Growth of each process, to its largest."""
        return {
            name: round(self.record.most_mb[name] - first, 1) for name, first in self.record.first_mb.items()
        }

    def _new_page(self) -> None:
        """Somebody who comes now gets in."""
        try:
            opened = open_page(self._service, "service", self._session)
            opened.page.__exit__(None, None, None)
            self.record.new_pages_s.append(opened.picture_s)
            self.record.asked_again += opened.asked_again
        except Exception as fault:  # whatever it is: nobody got in
            self._fault(f"no new page: {fault!r:.200}")

    def _stop(self) -> None:
        """Stop in the middle of a motion, from the page that was open all the time."""
        self._calm.set()
        try:
            for _ in range(TRIES):
                if self._moving():
                    begin_s = time.monotonic()
                    reply = self._page.ask("stop")
                    self.record.stops_s.append(time.monotonic() - begin_s)
                    if not reply["ok"]:
                        self._fault(f"Stop was refused: {reply}")
                    if self.record.stops_s[-1] > STOP_MAX_S:
                        self._fault(f"Stop was answered after {self.record.stops_s[-1]:.2f} s")
                    self._page.until(lambda tags: abs(tags["vel_ref_deg_s"]) == 0.0)
                    return
            self._fault(f"the axis could not be moved for a Stop: {self._last}")
        except Exception as fault:  # the page that must stay open has not
            self._fault(f"the open page: {fault!r:.300}")
            self._page.__exit__(None, None, None)
            self._page = self._service.page("operator", queue=None)
        finally:
            self._calm.clear()

    def _moving(self) -> bool:
        """Whatever the hostile ones have left behind: take control, reset, switch on, move."""
        page, self._last = self._page, {}
        own = page.welcome["client"]
        if page.tags["authority_client"] != own and not self._done(
            "take", over=bool(page.tags["authority_user"])
        ):
            return False
        if page.tags["alarm_count"] and not self._done("reset"):
            return False
        if not page.tags["power"]:
            if not self._done("power", on=True):
                return False
            page.until(lambda tags: bool(tags["power"]) or tags["alarm_count"] > 0)
        for tag, value in (("override_percent", 100.0), ("speed_setting_deg_s", 1.0)):
            if not self._done("set", tag=tag, value=value):
                return False
        angle = page.look()["pos_ref_deg"]
        if not self._done("move", target_deg=angle + (20.0 if angle < 0.0 else -20.0)):
            return False
        page.until(
            lambda tags: (
                abs(tags["vel_ref_deg_s"]) > 0.5
                or not tags["power"]
                or bool(tags["at_rest"] and tags["alarm_count"])
            )
        )
        return abs(page.tags["vel_ref_deg_s"]) > 0.5

    def _done(self, kind: str, **values: Any) -> bool:
        self._last = self._page.ask(kind, **values)
        return bool(self._last["ok"])


def _resident_mb(number: int) -> float | None:
    try:
        pages = int(Path(f"/proc/{number}/statm").read_text(encoding="ascii").split()[1])
    except (FileNotFoundError, ProcessLookupError):
        return None
    # A process that has ended and waits for its parent has no pages.
    return pages * 4096 / 1e6 if pages else None
