"""Foreign OPC UA clients against the table of what is allowed: Eclipse Milo, and open62541.

Each goes through all policies, modes, certificates and identities by itself and asks for every service that it knows.
Then it does what applications do: endpoints from the server, limits, registered nodes, a subscription, a lost one.
"""

from __future__ import annotations

import asyncio
import json
import os
import shutil
import subprocess
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from typing import Any

import pytest

pytest.importorskip("asyncua", reason="the extra [opcua] is not installed")
from cryptography.hazmat.primitives.serialization import (
    Encoding,
    NoEncryption,
    PrivateFormat,
    load_pem_private_key,
)

from support.opcua_bench import PASSWORD, Bench, running
from support.opcua_table import ALL, IDENTITIES, POLICIES, SECURE, opens, status_of

SOURCES = Path(__file__).parents[1] / "opcua_client"
EVIDENCE = Path(__file__).parents[2] / "docs" / "evidence" / "opcua_foreign.json"
pytestmark = pytest.mark.filterwarnings("ignore")  # of asyncua itself


def milo(folder: Path) -> list[str]:
    """Build the client of Eclipse Milo with Maven; its command."""
    if not (shutil.which("mvn") and shutil.which("javac")):
        pytest.skip("Milo needs mvn and a JDK 17")
    shutil.copytree(SOURCES / "milo", folder / "milo")
    subprocess.run(["mvn", "-q", "-B", "package"], cwd=folder / "milo", check=True)
    target = folder / "milo" / "target"
    return ["java", "-XX:TieredStopAtLevel=1", "-cp", f"{target}/classes:{target}/lib/*", "Look"]


def open62541(folder: Path) -> list[str]:
    """Build the client of open62541; its command."""
    if not (shutil.which("pkg-config") and shutil.which("cc")):
        pytest.skip("open62541 needs pkg-config and a C compiler")
    asked = ["pkg-config", "--cflags", "--libs", "--static", "open62541"]
    found = subprocess.run(asked, capture_output=True, text=True, check=False)
    if found.returncode:
        pytest.skip("pkg-config knows no open62541: the head of look.c says how to build it")
    made = folder / "look"
    subprocess.run(
        ["cc", "-O1", str(SOURCES / "open62541" / "look.c"), "-o", str(made), *found.stdout.split()],
        check=True,
    )
    return [str(made)]


def lay_out(bench: Bench, folder: Path) -> None:
    """Certificates and keys, in every form that somebody reads."""
    for name in ("client", "stranger"):
        shutil.copy(bench.root / f"{name}.der", folder)
        shutil.copy(bench.root / f"{name}.pem", folder)
        key = load_pem_private_key((bench.root / f"{name}.pem").read_bytes(), None)
        made = key.private_bytes(Encoding.DER, PrivateFormat.PKCS8, NoEncryption())
        (folder / f"{name}.key.der").write_bytes(made)
    shutil.copy(bench.root / "opcua" / "certificate.der", folder / "server.der")


async def live(bench: Bench) -> None:
    """Values that change; and no wait between two logins, which the matrix is not about."""
    for scan in range(10**9):
        await bench.space.show({"axis_state": "disabled", "scan": scan, "pos_act_deg": scan * 1e-3}, 0.0)
        await bench.listener.sweep()
        for _ in range(10):
            bench.listener.wall.people._rate._buckets.clear()
            bench.listener.wall.people._locks._failures.clear()
            await asyncio.sleep(0.02)


async def talk(command: list[str], folder: Path) -> tuple[list[dict[str, Any]], list[str]]:
    """Run a client; its lines, and what was written for the journal."""
    async with running(folder / "state") as bench:
        lay_out(bench, folder)
        values = asyncio.create_task(live(bench))
        client = await asyncio.create_subprocess_exec(
            *command, bench.address, str(folder), "viewer", PASSWORD, *(sorted(ALL) if command[0] == "java" else ()),
            stdin=subprocess.PIPE, stdout=subprocess.PIPE, limit=2**20, env={**os.environ},
        )  # fmt: skip
        assert client.stdin is not None
        assert client.stdout is not None
        rows: list[dict[str, Any]] = []
        try:
            async for line in client.stdout:
                row = json.loads(line)
                if "cut" in row:
                    for connection in list(bench.listener.connections):
                        connection.transport.abort()
                    client.stdin.write(b"\n")
                else:
                    rows.append(row)
            assert await client.wait() == 0
        finally:
            values.cancel()
            with suppress(asyncio.CancelledError):
                await values
            if client.returncode is None:
                client.kill()
                await client.wait()
        return rows, bench.texts()


def differences(rows: list[dict[str, Any]]) -> tuple[list[Any], int]:
    """What a client was answered otherwise than the table says, and how many answers it got.

    A client may give up before it asks the server, as without a certificate, or learn of a refusal only that the
    channel was closed: so of what is refused it counts that it was, and of each service the very status.
    """
    wrong: list[Any] = []
    count = 0
    for row in (each for each in rows if "policy" in each):
        cell = row["policy"], row["mode"], row["key"], row["identity"]
        may = opens(*cell[:3])
        said = row.get("session", row.get("channel"))
        expected = IDENTITIES[cell[3]][0] if cell[3] else "Good"
        count += 1
        if said == "Good" and (not may or expected != "Good" or (cell[3] and row["policy"] == "None")):
            wrong.append((*cell, said))
        if may and row["policy"] in SECURE and expected == "Good" and said != "Good":
            wrong.append((*cell, said))
        state = "active" if cell[3] else "none" if row["policy"] == "None" else "open"
        for service, answer in row.get("services", {}).items():
            count += 1
            allowed = {status_of(service, state)} if service in ALL else {"BadServiceUnsupported"}
            if answer not in allowed:
                wrong.append((*cell, service, answer))
    return wrong, count


def test_a_server_that_answers_otherwise_is_found() -> None:
    """The liars: a stranger gets in, the right user does not, a change of the axis is done."""
    row = {
        "policy": SECURE[0],
        "mode": "SignAndEncrypt",
        "key": "client",
        "identity": "right",
        "session": "Good",
    }
    inside = {**row, "services": {"Write": "BadUserAccessDenied", "Read": "Good"}}
    assert differences([inside]) == ([], 3)
    for lying in (
        {**row, "key": "stranger"},
        {**row, "mode": "Sign"},
        {**row, "identity": "anonymous"},
        {**row, "session": "BadTooManySessions"},
        {**row, "services": {"Write": "Good"}},
        {**row, "services": {"Read": "BadUserAccessDenied"}},
    ):
        assert len(differences([lying])[0]) == 1, lying


@pytest.mark.slow
@pytest.mark.parametrize("build", [milo, open62541])
def test_a_foreign_client_is_answered_as_the_table_says(
    tmp_path: Path, build: Callable[[Path], list[str]]
) -> None:
    command = build(tmp_path)
    rows, _ = asyncio.run(talk(command, tmp_path))
    wrong, count = differences(rows)
    assert not wrong, wrong[:5]
    assert len({row["policy"] for row in rows if "policy" in row}) == len(POLICIES)
    assert sum(row.get("session") == "Good" for row in rows if row.get("identity") == "right") == len(SECURE)
    used = {policy: used_of(rows, policy) for policy in SECURE}
    for policy, said in used.items():
        # All that it said: the status of its session and of its last turn are the only reasons that a client gives.
        assert {name: said.get(name) for name in USED} == USED, (policy, said)
        assert said["references_in_threes"] == said["references"] > 0, (policy, said)
    found = json.loads(EVIDENCE.read_text(encoding="utf-8")) if EVIDENCE.exists() else {}
    found[build.__name__] = {
        "version": rows[0]["version"],
        "cells": sum("policy" in row for row in rows),
        "answers": count,
        "differences": len(wrong),
        "used": used,
    }
    EVIDENCE.write_text(json.dumps(found, indent=1, sort_keys=True) + "\n", encoding="utf-8")


# What an application sees, of whatever make; the connection is cut once in between.
USED = {
    "limit_read": 1000,
    "limit_browse": 100,
    "write": "BadUserAccessDenied",
    "call": "BadUserAccessDenied",
    "changes": True,
    "changes_after_cut": True,
}


def used_of(rows: list[dict[str, Any]], policy: str) -> dict[str, Any]:
    """All that a client says of its use of one policy."""
    return {
        name: value
        for row in rows
        if policy in (row.get("look"), row.get("after"))
        for name, value in row.items()
        if name not in ("look", "after")
    }
