"""OPC UA: passwords, and who guesses them."""

from __future__ import annotations

import struct
import time
from typing import Any

import pytest

asyncua = pytest.importorskip("asyncua", reason="the extra [opcua] is not installed")
from asyncua import ua  # noqa: E402
from asyncua.crypto.uacrypto import encrypt_rsa15, load_certificate  # noqa: E402

from support.opcua_bench import CLIENT, PASSWORD, Bench, Run  # noqa: E402
from support.opcua_wire import password  # noqa: E402

pytestmark = pytest.mark.filterwarnings("ignore")  # of asyncua itself
MODES = ua.MessageSecurityMode


def test_a_password_in_another_cipher_than_that_of_the_policy_is_not_looked_at(run: Run) -> None:
    """RSA PKCS 1.5 would tell a stranger byte by byte whether a guess decrypts."""

    async def check(bench: Bench) -> None:
        wire = await bench.open("Basic256Sha256", MODES.SignAndEncrypt)
        assert await wire.create(bench.certificate("client"), CLIENT) == "Good"
        server = await load_certificate(str(bench.root / "opcua" / "certificate.der"))
        secret = PASSWORD.encode() + wire.server_nonce
        token = password("viewer", "")
        token.Password = encrypt_rsa15(server.public_key(), struct.pack("<I", len(secret)) + secret)
        token.EncryptionAlgorithm = "http://www.w3.org/2001/04/xmlenc#rsa-1_5"
        assert await wire.activate(token) == "BadIdentityTokenInvalid"
        assert await wire.activate(password("viewer", PASSWORD)) == "Good"

    run(check)


def test_an_admitted_login_opens_one_session(run: Run) -> None:
    """Its password stays nowhere: the next session is checked against the file of users again."""

    async def check(bench: Bench) -> None:
        people = bench.listener.wall.people
        assert await people.admit("viewer", PASSWORD, b"certificate", "client", "192.0.2.7")
        asked = (
            ("other", PASSWORD, b"certificate"),
            ("viewer", "wrong", b"certificate"),
            ("viewer", PASSWORD, b""),
        )
        assert [people.get_user(None, *each) for each in asked] == [None] * 3
        assert people.get_user(None, "viewer", PASSWORD, b"certificate").name == "viewer"
        assert people.get_user(None, "viewer", PASSWORD, b"certificate") is None

    run(check)


def test_guessing_locks_the_guesser_out_and_nobody_else(run: Run) -> None:
    async def check(bench: Bench) -> None:
        (bench.trusted / "stranger.der").write_bytes(bench.certificate("stranger"))
        await bench.listener.sweep()
        wire = await bench.open("Basic256Sha256", MODES.SignAndEncrypt, "stranger")
        assert await wire.create(bench.certificate("stranger"), CLIENT) == "Good"
        for _ in range(6):
            assert await wire.activate(password("viewer", "wrong wrong wrong")) == "BadUserAccessDenied"
        # Locked: the right one is refused, too, from this client and for this account.
        assert await wire.activate(password("viewer", PASSWORD)) == "BadUserAccessDenied"
        assert await wire.activate(password("other", PASSWORD)) == "Good"
        mine = await bench.session("Basic256Sha256", MODES.SignAndEncrypt)
        assert (await mine.ask(ua.ReadRequest()))[0] == "Good"

    run(check)


def test_guesses_with_ever_new_names_cost_no_more_than_a_check_a_second(run: Run) -> None:
    async def check(bench: Bench) -> None:
        wire = await bench.open("Basic256Sha256", MODES.SignAndEncrypt)
        assert await wire.create(bench.certificate("client"), CLIENT) == "Good"
        checked = 0
        people = bench.listener.wall.people
        check_one = people._users.check

        def counted(*how: str) -> Any:
            nonlocal checked
            checked += 1
            return None

        people._users.check = counted
        begin_s = time.monotonic()
        try:
            for n in range(60):
                assert await wire.activate(password(f"name{n}", "wrong wrong wrong")) == "BadUserAccessDenied"
        finally:
            people._users.check = check_one
        # Ten at once, then one a second.
        assert checked <= 10 + (time.monotonic() - begin_s) + 1

    run(check)
