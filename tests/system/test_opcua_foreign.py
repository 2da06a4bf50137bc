"""OPC UA with a client that is not ours: node-opcua on the running service."""

from __future__ import annotations

import asyncio
import json
import shutil
import socket
import subprocess
import sys
from contextlib import suppress
from pathlib import Path

import pytest

from support.service_process import PASSWORD, Service, add_users

CLIENT = Path(__file__).parents[1] / "opcua_client"
NODE = Path(sys.executable).with_name("node")
pytestmark = [
    pytest.mark.skipif(sys.platform != "linux", reason="the service needs Linux"),
    pytest.mark.skipif(not (CLIENT / "node_modules").is_dir(), reason="`make pytest` fetches node-opcua"),
]


def certificate(folder: Path) -> tuple[Path, Path]:
    """Of a client, in the forms that node-opcua reads."""
    pytest.importorskip("asyncua", reason="the extra [opcua] is not installed")
    from asyncua.crypto.cert_gen import setup_self_signed_certificate
    from cryptography import x509
    from cryptography.hazmat.primitives.serialization import Encoding
    from cryptography.x509.oid import ExtendedKeyUsageOID

    key, der, pem = folder / "client.key", folder / "client.der", folder / "client.pem"
    uses = [ExtendedKeyUsageOID.CLIENT_AUTH]
    asyncio.run(
        setup_self_signed_certificate(key, der, "urn:example:client", "localhost", uses, {"commonName": "c"})
    )
    pem.write_bytes(x509.load_der_x509_certificate(der.read_bytes()).public_bytes(Encoding.PEM))
    return key, pem


def test_node_opcua_reads_the_axis_and_can_change_nothing(tmp_path: Path) -> None:
    add_users(tmp_path)
    key, pem = certificate(tmp_path)
    trusted = tmp_path / "hust_gantry" / "opcua" / "trusted"
    trusted.mkdir(parents=True)
    shutil.copy(tmp_path / "client.der", trusted)
    with socket.create_server(("127.0.0.1", 0)) as free:
        port = free.getsockname()[1]

    def listening(_: object) -> bool:
        with suppress(OSError), socket.create_connection(("127.0.0.1", port), timeout=1.0):
            return True
        return False

    with Service(tmp_path, "--opcua", f"127.0.0.1:{port}") as service:
        with service.page("viewer") as page:
            page.until(listening)
        address = f"opc.tcp://127.0.0.1:{port}/gantryctl"
        done = subprocess.run(
            [NODE, CLIENT / "look.mjs", address, pem, key, "viewer", PASSWORD, tmp_path / "pki"],
            capture_output=True, text=True, timeout=60, check=False,
        )  # fmt: skip
        assert done.returncode == 0, done.stderr[-2000:]
        said = json.loads(done.stdout.splitlines()[-1])
    assert said.pop("position") == pytest.approx(0.0, abs=0.01)
    assert said.pop("disabled") is True
    assert said.pop("machine") == "hust_gantry"
    assert said.pop("Aes128_Sha256_RsaOaep") is True
    assert said.pop("Aes256_Sha256_RsaPss") is True
    assert said.pop("registered") == pytest.approx(0.0, abs=0.01)
    assert said.pop("unit") == 17476  # DD, degree
    assert said.pop("range") >= 360.0
    assert set(said) == {"write", "plain", "signed", "old", "anonymous", "wrong"}
    assert "Good" not in said.values()
    assert "done" not in said.values()
