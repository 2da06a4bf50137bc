"""OPC UA: sessions of one channel, and a client that comes back after its connection was lost."""

from __future__ import annotations

import asyncio

import pytest

asyncua = pytest.importorskip("asyncua", reason="the extra [opcua] is not installed")
from asyncua import ua  # noqa: E402
from asyncua.ua.ua_binary import struct_from_binary, struct_to_binary  # noqa: E402

from gantryctl.gateway.opcua import services  # noqa: E402
from gantryctl.gateway.opcua.channel import SESSIONS_MAX  # noqa: E402
from support.opcua_bench import CLIENT, PASSWORD, Bench, Run  # noqa: E402
from support.opcua_wire import password  # noqa: E402

pytestmark = pytest.mark.filterwarnings("ignore")  # of asyncua itself
MODES = ua.MessageSecurityMode


def test_a_client_that_comes_back_gets_in_again(run: Run) -> None:
    """Its old session is over; what it asks before it has learnt that must not cost it the new one.

    As open62541 does it: the check of its connection is answered BadSessionIdInvalid while a CreateSession is on its
    way, so it sends a second one (Part 4, section 5.6.2.1: a client may have several sessions on one channel).
    """

    async def check(bench: Bench) -> None:
        lost = await bench.session("Basic256Sha256", MODES.SignAndEncrypt)
        for cut in (True, False):  # the server learns of the lost connection at once, or not yet
            if cut:
                await lost.close()
            wire = await bench.open("Basic256Sha256", MODES.SignAndEncrypt)
            wire.token, wire.server_nonce = lost.token, lost.server_nonce
            assert await wire.activate(password("viewer", PASSWORD)) == "BadSessionIdInvalid"
            assert (await wire.ask(ua.ReadRequest()))[0] == "BadSessionIdInvalid"
            made = []
            for _ in range(2):
                assert await wire.create(bench.certificate("client"), CLIENT) == "Good"
                made.append((wire.token, wire.server_nonce))
            for wire.token, wire.server_nonce in made:
                assert await wire.activate(password("viewer", PASSWORD)) == "Good"
            # One that is logged in is in nobody's way either.
            assert await wire.create(bench.certificate("client"), CLIENT) == "Good"
            assert await wire.activate(password("viewer", PASSWORD)) == "Good"
            for token in (made[0][0], made[1][0], wire.token):
                assert (await wire.ask(ua.ReadRequest(), token))[0] == "Good"
            lost = wire

    run(check)


def test_the_sessions_of_a_channel_are_apart_and_few(run: Run) -> None:
    async def check(bench: Bench) -> None:
        wire = await bench.session("Basic256Sha256", MODES.SignAndEncrypt)
        first = wire.token
        assert await wire.create(bench.certificate("client"), CLIENT) == "Good"
        assert (await wire.ask(ua.ReadRequest()))[0] == "BadSessionNotActivated"
        assert await wire.activate(password("other", PASSWORD)) == "Good"
        second = wire.token
        said, body = await wire.ask(ua.CreateSubscriptionRequest(), first)
        number = struct_from_binary(ua.CreateSubscriptionResult, body).SubscriptionId
        delete = ua.DeleteSubscriptionsRequest()
        delete.Parameters.SubscriptionIds = [number]
        assert (await wire.ask(delete, second))[0] == "BadSubscriptionIdInvalid"
        # What a client may hold does not grow with its sessions.
        for n in range(services.SUBSCRIPTIONS_MAX):
            said, _ = await wire.ask(ua.CreateSubscriptionRequest(), second)
            assert said == ("Good" if n < services.SUBSCRIPTIONS_MAX - 1 else "BadTooManySubscriptions")
        assert (await wire.ask(ua.CloseSessionRequest(DeleteSubscriptions=True), second))[0] == "Good"
        assert (await wire.ask(ua.ReadRequest(), second))[0] == "BadSessionIdInvalid"
        assert (await wire.ask(delete, first))[0] == "Good"
        # Those that are not logged in make room for new ones, the others do not.
        for _ in range(3 * SESSIONS_MAX):
            assert await wire.create(bench.certificate("client"), CLIENT) == "Good"
        (connection,) = bench.listener.connections
        assert len(connection.channel._sessions) == SESSIONS_MAX
        for n in range(SESSIONS_MAX):
            said = await wire.create(bench.certificate("client"), CLIENT)
            assert said == ("Good" if n < SESSIONS_MAX - 1 else "BadTooManySessions")
            if said == "Good":
                assert await wire.activate(password("other", PASSWORD)) == "Good"
        assert (await wire.ask(ua.ReadRequest(), first))[0] == "Good"
        # A user who is changed ends them all, and their subscriptions.
        assert not connection.channel.lapsed(bench.listener.wall.people.all())
        assert connection.channel.lapsed({})
        await wire.ask(ua.CreateSubscriptionRequest(), first)
        assert bench.listener.wall.internal.subscription_service.subscriptions
        await wire.close()
        while bench.listener.connections or bench.listener._tasks:
            await asyncio.sleep(0.01)
        assert not bench.listener.wall.internal.subscription_service.subscriptions

    run(check)


def test_a_null_array_means_an_empty_one(run: Run) -> None:
    """open62541 sends one for an empty list; asyncua's own structures have 0 elements instead."""

    async def check(bench: Bench) -> None:
        wire = await bench.session("Basic256Sha256", MODES.SignAndEncrypt)
        for request, name in (
            (ua.ReadRequest(), "NodesToRead"),
            (ua.RegisterNodesRequest(), "NodesToRegister"),
            (ua.UnregisterNodesRequest(), "NodesToUnregister"),
            (ua.DeleteSubscriptionsRequest(), "SubscriptionIds"),
            (ua.SetPublishingModeRequest(), "SubscriptionIds"),
        ):
            setattr(request.Parameters, name, None)
            assert b"\xff\xff\xff\xff" in struct_to_binary(request.Parameters)
            assert (await wire.ask(request))[0] == "Good", name

    run(check)


def test_nobody_takes_the_session_of_somebody_else(run: Run) -> None:
    async def check(bench: Bench) -> None:
        (bench.trusted / "stranger.der").write_bytes(bench.certificate("stranger"))
        await bench.listener.sweep()
        mine = await bench.session("Basic256Sha256", MODES.SignAndEncrypt)
        assert len(mine.token.Identifier) == 32  # random bytes, no number that counts up
        plain = await bench.open("None", MODES.None_, "")
        other = await bench.open("Basic256Sha256", MODES.SignAndEncrypt, "stranger")
        for wire, said in ((plain, "BadSecurityPolicyRejected"), (other, "BadSessionIdInvalid")):
            wire.token, wire.server_nonce = mine.token, mine.server_nonce
            assert await wire.activate(password("viewer", "wrong wrong wrong")) == said
            assert await wire.activate(password("other", PASSWORD)) == said
            assert (await wire.ask(ua.ReadRequest()))[0] == said
        # Its own session does not open mine either, and mine goes on.
        assert await other.create(bench.certificate("stranger"), CLIENT) == "Good"
        assert await other.activate(password("other", PASSWORD)) == "Good"
        assert (await other.ask(ua.ReadRequest(), mine.token))[0] == "BadSessionIdInvalid"
        assert (await mine.ask(ua.ReadRequest()))[0] == "Good"
        subscription = ua.CreateSubscriptionRequest()
        subscription.Parameters.RequestedPublishingInterval = 1000.0
        said, body = await mine.ask(subscription)
        number = struct_from_binary(ua.CreateSubscriptionResult, body).SubscriptionId
        delete = ua.DeleteSubscriptionsRequest()
        delete.Parameters.SubscriptionIds = [number]
        assert (await other.ask(delete))[0] == "BadSubscriptionIdInvalid"
        transfer = ua.TransferSubscriptionsRequest()
        transfer.Parameters.SubscriptionIds = [number]
        assert (await other.ask(transfer))[0] == "BadServiceUnsupported"
        assert (await mine.ask(delete))[0] == "Good"

    run(check)


def test_the_token_of_a_session_cannot_be_guessed(run: Run) -> None:
    async def check(bench: Bench) -> None:
        tokens = []
        for _ in range(2):
            wire = await bench.session("Basic256Sha256", MODES.SignAndEncrypt)
            tokens.append(wire.token.Identifier)
        assert tokens[0] != tokens[1]
        # Of 32 random bytes 30 are different; 16 or fewer in one of 10^12.
        assert all(len(token) == 32 and len(set(token)) > 16 for token in tokens)

    run(check)


def test_a_session_needs_32_random_bytes_of_its_client(run: Run) -> None:
    """The server signs them: with fewer an old signature could be used again (Part 4, section 5.6.2.2)."""

    async def check(bench: Bench) -> None:
        wire = await bench.open("Basic256Sha256", MODES.SignAndEncrypt)
        for nonce, said in ((0, "BadNonceInvalid"), (31, "BadNonceInvalid"), (32, "Good"), (33, "Good")):
            assert await wire.create(bench.certificate("client"), CLIENT, nonce=nonce) == said

    run(check)


def test_a_silent_session_lives_for_a_minute_at_the_most(run: Run) -> None:
    """A client that is gone holds a place and what waits for it."""

    async def check(bench: Bench) -> None:
        wire = await bench.open("Basic256Sha256", MODES.SignAndEncrypt)
        for asked_ms, given_ms in ((30_000.0, 30_000.0), (60_000.0, 60_000.0), (3_600_000.0, 60_000.0)):
            assert await wire.create(bench.certificate("client"), CLIENT, asked_ms) == "Good"
            assert wire.silence_ms == given_ms

    run(check)
