"""The service started in a folder that somebody else may write to, with paths from there."""

from __future__ import annotations

import json
import os
import signal
import ssl
import subprocess
import sys
import time
import urllib.request
from contextlib import suppress
from pathlib import Path

import pytest

from gantryctl.errors import DeviceError, UsageError
from gantryctl.machine import default_machine_path
from gantryctl.service.recorder.journal.reading import read_journal
from support.service_process import PATIENCE_S, Service, add_users

pytestmark = pytest.mark.skipif(sys.platform != "linux", reason="the service needs Linux")
# Each of them is imported by all processes of the service.
PLANTED = ("json.py", "typing.py", "asyncio.py", "gantryctl.py", "numpy.py")


def certificate() -> None:
    """`cert.pem` and `key.pem` of localhost, in this folder."""
    made = subprocess.run(
        ["openssl", "req", "-x509", "-newkey", "ec", "-pkeyopt", "ec_paramgen_curve:P-256", "-nodes", "-days", "60",
         "-subj", "/CN=localhost", "-addext", "subjectAltName=DNS:localhost", "-out", "cert.pem", "-keyout", "key.pem"],
        capture_output=True, check=False,
    )  # fmt: skip
    assert made.returncode == 0, made.stderr


def controller_of(service: Service) -> str:
    """What the page says about the controller, or why it says nothing."""
    trusting = ssl.create_default_context(cafile="cert.pem")
    with (
        suppress(OSError),
        urllib.request.urlopen(
            f"https://{service.address}/api/v1/health", context=trusting, timeout=PATIENCE_S
        ) as answer,
    ):
        return str(json.load(answer)["controller"])
    return "no answer"


def journal_of(service: Service) -> str:
    """All texts; none while the recorder is still starting."""
    with suppress(DeviceError, UsageError):  # damaged as it is being written, not there yet
        return " ".join(row.values["text"] for row in read_journal(service.directory))
    return ""


def until(service: Service, text: str) -> None:
    """Wait until the journal has a text and the page says that the controller lives."""
    end_s = time.monotonic() + PATIENCE_S
    while controller_of(service) != "ok" or text not in journal_of(service):
        assert time.monotonic() < end_s, service.errors()


def test_no_module_of_the_folder_is_imported_and_its_paths_lead_where_they_should(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    for name in PLANTED:
        (tmp_path / name).write_text(
            f"open({str(tmp_path / 'imported')!r}, 'a').write(__file__ + '\\n')\nraise SystemExit(1)\n"
        )
    certificate()
    Path("machine.toml").write_bytes(default_machine_path().read_bytes())
    root = Path("state")
    root.mkdir()
    add_users(root)
    options = [
        "--config",
        "machine.toml",
        "--tls-cert",
        "cert.pem",
        "--tls-key",
        "key.pem",
        "--name",
        "localhost",
    ]
    with Service(root, *options) as service:
        until(service, "controller started")
        names = ("controller", "recorder", "gateway")
        assert {os.readlink(f"/proc/{service.child(name)}/cwd") for name in names} == {"/"}
        # Those that are started again find everything, too.
        before = [service.child(name) for name in names]
        for process in before:
            os.kill(process, signal.SIGKILL)
        until(service, "SYS-05")
    assert not (tmp_path / "imported").exists()
    assert {path.name for path in tmp_path.iterdir()} == {
        *PLANTED,
        "cert.pem",
        "key.pem",
        "machine.toml",
        "state",
        "state-keys",
    }
