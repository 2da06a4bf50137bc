"""Hostile clients at the doors of a service that is started for it: `python -m support.fuzz --minutes 10`.

HTTP, WebSocket and OPC UA, one after the other, each for so many minutes, on loopback only. Every case is made of the
seed and its number. It ends by itself, with status 1 where anything did not hold.
"""

from __future__ import annotations

import argparse
import asyncio
import itertools
import json
import os
import socket
import subprocess
import sys
import tempfile
import threading
import time
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from random import Random
from typing import Any

from asyncua.crypto.cert_gen import setup_self_signed_certificate
from cryptography.x509.oid import ExtendedKeyUsageOID

from support.fuzz.doors import Attack, Target
from support.fuzz.http import Http
from support.fuzz.judge import GROWN_MAX_MB, Judge
from support.fuzz.opcua import Keys, OpcUa
from support.fuzz.websocket import WebSockets
from support.opcua_looker import APPLICATION
from support.service_process import PASSWORD, Service, add_users

DOORS = ("http", "websocket", "opcua")
ROLES = ("viewer", "operator", "physicist", "admin")
SESSIONS, WORKERS, CLIENTS = 6, 6, 4
CASE_MAX_S = 30.0


async def make_clients(root: Path, opcua: Path) -> list[Keys]:
    """Certificates that the service will trust."""
    made, uses = [], [ExtendedKeyUsageOID.CLIENT_AUTH]
    trusted = opcua / "trusted"
    trusted.mkdir(parents=True)
    for n in range(CLIENTS):
        key, certificate = root / f"client{n}.pem", root / f"client{n}.der"
        await setup_self_signed_certificate(
            key, certificate, APPLICATION, "localhost", uses, {"commonName": f"c{n}"}
        )
        (trusted / certificate.name).write_bytes(certificate.read_bytes())
        made.append(Keys(certificate, key, APPLICATION, "viewer", PASSWORD))
    return made


async def work(attack: Attack, door: str, seed: int, numbers: Any, until_s: float) -> None:
    """Cases until the time is over; what a client of ours cannot do any more is no fault of the service."""
    while time.monotonic() < until_s:
        name = f"{door}/{seed}/{next(numbers)}"
        try:
            await asyncio.wait_for(attack.case(name, Random(name)), CASE_MAX_S)
        except TimeoutError:
            attack.found.fault(name, f"no end within {CASE_MAX_S} s")
        except OSError as fault:
            attack.found.answers[f"{type(fault).__name__}"] += 1


def attacking(attack: Attack, door: str, seed: int, until_s: float) -> None:
    """All workers of one door, in the thread that calls."""

    async def whole() -> None:
        numbers = itertools.count()
        await asyncio.gather(*(work(attack, door, seed, numbers, until_s) for _ in range(WORKERS)))

    asyncio.run(whole())


def once(name: str, make: Callable[[str], Attack]) -> None:
    """One case again, by its name."""
    attack = make(name.partition("/")[0])
    asyncio.run(attack.case(name, Random(name)))
    print(dict(attack.found.answers), attack.found.faults)


def run(minutes: float, seed: int, doors: list[str], log: Path | None, case: str = "") -> int:
    """Attack a service of its own."""
    with tempfile.TemporaryDirectory(prefix="fuzz-") as folder:
        root = Path(folder)
        add_users(root)
        clients = asyncio.run(make_clients(root, root / "hust_gantry" / "opcua"))
        with socket.create_server(("127.0.0.1", 0)) as free:
            opcua_port = free.getsockname()[1]
        with Service(root, "--opcua", f"127.0.0.1:{opcua_port}") as service:
            host, _, port = service.address.partition(":")
            _until_listening(opcua_port)
            cookies = {user: [service.log_in(user) for _ in range(SESSIONS)] for user in ROLES}
            calm = threading.Event()

            def make(door: str) -> Attack:
                target = Target(host, int(port), cookies, calm)
                if door == "opcua":
                    return OpcUa(opcua_port, clients, root / "hust_gantry" / "opcua" / "certificate.der")
                return Http(target) if door == "http" else WebSockets(target)

            if case:
                once(case, make)
                return 0
            found = {door: attack(service, calm, make(door), door, seed, minutes) for door in doors}
        found["errors"] = [
            # Lines of the day are no errors.
            line
            for line in service.errors().splitlines()
            if line.strip() and not line.startswith("journal anchor:")
        ][:50]
        found["journal"] = _verified(root)
    good = all(not found[door]["faults"] for door in doors) and not found["errors"] and found["journal"] == 0
    made = {"minutes_of_each_door": minutes, "seed": seed, "ok": good, **found}
    text = json.dumps(made, indent=1, ensure_ascii=False)
    print(text)
    if log is not None:
        log.write_text(text + "\n", encoding="utf-8")
    return 0 if good else 1


def attack(
    service: Service, calm: threading.Event, hostile: Attack, door: str, seed: int, minutes: float
) -> dict[str, Any]:
    """One door: what was sent, what was answered, what did not hold."""
    with Judge(service, calm) as judge:
        until_s = time.monotonic() + 60.0 * minutes
        thread = threading.Thread(target=attacking, args=(hostile, door, seed, until_s), daemon=True)
        thread.start()
        judge.watch(until_s, min(60.0, 20.0 * minutes))
        thread.join(2 * CASE_MAX_S)
        seen, faults = judge.record, judge.record.faults
        grown = judge.grown_mb()
    faults += [f"{name} grew by {mb} MB" for name, mb in grown.items() if not mb <= GROWN_MAX_MB[name]]
    faults += ["the attack did not end"] if thread.is_alive() else []
    return {
        "cases": hostile.found.cases,
        "faults": [*faults, *hostile.found.faults],
        "answers": dict(sorted(hostile.found.answers.items())),
        "stops": len(seen.stops_s),
        "stop_longest_s": round(max(seen.stops_s, default=float("nan")), 3),
        "new_page_longest_s": round(max(seen.new_pages_s, default=float("nan")), 2),
        "scans_hz_least": round(min(seen.scans_hz), 1),
        "memory_grown_mb": grown,
        "memory_last_mb": {name: round(mb, 1) for name, mb in seen.last_mb.items()},
    }


def _until_listening(port: int) -> None:
    end_s = time.monotonic() + 60.0
    while time.monotonic() < end_s:
        with suppress(OSError), socket.create_connection(("127.0.0.1", port), timeout=1.0):
            return
        time.sleep(0.1)
    raise AssertionError("OPC UA does not listen")


def _verified(root: Path) -> int:
    """Exit status of `gantryctl journal verify`."""
    command = [sys.executable, "-P", "-m", "gantryctl", "journal", "verify"]
    return subprocess.run(command, env={**os.environ, "GANTRYCTL_STATE": str(root)}, check=False).returncode


if __name__ == "__main__":
    options = argparse.ArgumentParser(prog="python -m support.fuzz", description=__doc__)
    options.add_argument("--minutes", type=float, default=10.0, help="of each door")
    options.add_argument("--seed", type=int, default=1)
    options.add_argument("--doors", nargs="+", choices=DOORS, default=list(DOORS))
    options.add_argument("--log", type=Path, help="where the result goes, as JSON")
    options.add_argument("--case", default="", help="only this case, as a fault names it")
    chosen = options.parse_args()
    sys.exit(run(chosen.minutes, chosen.seed, chosen.doors, chosen.log, chosen.case))
