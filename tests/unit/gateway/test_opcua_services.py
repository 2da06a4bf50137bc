"""OPC UA: every service in every state of a channel, against a table of what is allowed."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import pytest

asyncua = pytest.importorskip("asyncua", reason="the extra [opcua] is not installed")
from asyncua import ua  # noqa: E402

from support.opcua_bench import CLIENT, PASSWORD, Bench, Run  # noqa: E402
from support.opcua_table import ALL, IDENTITIES, POLICIES, SECURE, opens, status_of  # noqa: E402
from support.opcua_wire import Refused, Wire, password  # noqa: E402

pytestmark = pytest.mark.filterwarnings("ignore")  # of asyncua itself
MODES = ua.MessageSecurityMode


async def differences(wire: Wire, state: str) -> list[tuple[str, str, str]]:
    """Services that answer otherwise than the table says."""
    found = []
    for service, kind in ALL.items():
        if service == "CloseSession":
            continue  # ends the session: last
        said, _ = await wire.ask(kind())
        if said != status_of(service, state):
            found.append((state, service, said))
    return found


async def cell(bench: Bench, policy: str, mode: Any, key: str, identity: str) -> list[Any]:
    """One policy, one certificate or none, one identity: all services in every state that can be reached."""
    may_open = opens(policy, mode.name.strip("_"), key)
    try:
        wire = await bench.open(policy, mode, key)
    except Refused:
        return ["refused"] if may_open else []
    try:
        if not may_open:
            return ["open"]
        if policy == "None":
            found: list[Any] = await differences(wire, "none")
            for certificate in (b"", bench.certificate("client")):
                said = await wire.create(certificate, CLIENT)
                found += [said] if said != "BadSecurityPolicyRejected" else []
                said = await wire.activate(IDENTITIES[identity][1](), signed=False)
                found += [said] if said != "BadSecurityPolicyRejected" else []
            return found
        found = await differences(wire, "open")
        said = await wire.create(bench.certificate("client"), CLIENT)
        found += [said] if said != "Good" else []
        found += await differences(wire, "created")
        expected, token = IDENTITIES[identity]
        said = await wire.activate(token())
        found += [said] if said != expected else []
        found += await differences(wire, "active" if expected == "Good" else "created")
        said, _ = await wire.ask(ua.CloseSessionRequest())
        found += [said] if said != "Good" else []
        said, _ = await wire.ask(ua.ReadRequest())
        return [*found, said] if said != "BadSessionIdInvalid" else found
    finally:
        await bench.hang_up()


def cells(*, whole: bool) -> Iterator[tuple[str, Any, str, str]]:
    """Policy, mode, certificate, identity: every identity on the channels that open, and once on all others."""
    for policy in POLICIES:
        modes = [MODES.None_] if policy == "None" else [MODES.SignAndEncrypt]
        for mode in (MODES.None_, MODES.Sign, MODES.SignAndEncrypt) if whole else modes:
            for key in ("", "client", "stranger"):
                some = ["right", "anonymous"] if opens(policy, mode.name.strip("_"), key) else ["right"]
                for identity in IDENTITIES if whole else some:
                    yield policy, mode, key, identity
    if not whole:
        for policy in SECURE:
            yield policy, MODES.Sign, "client", "right"
            yield policy, MODES.None_, "client", "right"


async def matrix(bench: Bench, *, whole: bool) -> None:
    wrong, count = [], 0
    for policy, mode, key, identity in cells(whole=whole):
        bench.listener.wall.people._rate._buckets.clear()
        bench.listener.wall.people._locks._failures.clear()
        found = await cell(bench, policy, mode, key, identity)
        count += 1
        wrong += [(policy, mode.name, key, identity, each) for each in found]
    assert not wrong, wrong[:5]
    assert count > (200 if whole else 20)


def test_nothing_is_answered_otherwise_than_the_table_says(run: Run) -> None:
    run(lambda bench: matrix(bench, whole=False))


@pytest.mark.slow
def test_nothing_is_answered_otherwise_than_the_whole_table_says(run: Run) -> None:
    run(lambda bench: matrix(bench, whole=True))


def test_a_client_without_certificate_gets_no_session_and_is_not_asked_for_a_password(run: Run) -> None:
    async def check(bench: Bench) -> None:
        wire = await bench.open("None", MODES.None_, "")
        said, _ = await wire.ask(ua.GetEndpointsRequest())
        assert said == "Good"
        assert await wire.create(b"", CLIENT) == "BadSecurityPolicyRejected"
        # As a client that goes on all the same: a password in clear opens nothing.
        assert await wire.activate(password("viewer", PASSWORD), signed=False) == "BadSecurityPolicyRejected"
        assert (await wire.ask(ua.ReadRequest()))[0] == "BadSecurityPolicyRejected"
        assert "OPC UA session" not in bench.texts()

    run(check)


def test_no_request_is_answered_before_a_channel_is_open(run: Run) -> None:
    async def check(bench: Bench) -> None:
        for request in (ua.GetEndpointsRequest(), ua.CreateSessionRequest(), ua.ReadRequest()):
            wire = await bench.wire()
            with pytest.raises(Refused, match=r"BadSecureChannelClosed|closed"):
                await wire.ask(request)

    run(check)
