"""A browser on another machine, as far as the service can tell: TLS, a cookie for it only, slow without the switch."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from pathlib import Path

import pytest

TESTS = Path(__file__).parents[2]
PRIVATE = [str(TESTS / "support" / "private_network.sh")]
CAPPED = "Too fast without the enabling switch: press it, or set a lower speed."


@pytest.mark.slow  # needs a network namespace
def test_a_remote_screen_logs_in_over_tls_and_is_slow_without_the_enabling_switch(tmp_path: Path) -> None:
    possible = subprocess.run([*PRIVATE, "true"], capture_output=True, text=True, check=False)
    if possible.returncode:
        pytest.skip(f"no network namespace: {possible.stderr.strip()}")
    command = [*PRIVATE, sys.executable, str(Path(__file__).with_name("remote_screen.py")), str(tmp_path)]
    paths = [str(TESTS), *filter(None, os.environ.get("PYTHONPATH", "").split(os.pathsep))]
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join(paths)}
    done = subprocess.run(command, capture_output=True, text=True, check=False, timeout=110, env=environment)
    assert done.returncode == 0, done.stderr
    found = json.loads(done.stdout)
    assert "ERR_CERT_AUTHORITY_INVALID" in found["stranger"]
    (cookie,) = found["cookies"]
    assert (cookie["secure"], cookie["httpOnly"], cookie["sameSite"]) == (True, True, "Strict")
    assert cookie["name"].startswith("__Host-")
    assert found["readable"] == ""  # no script sees it
    assert found["hsts"] == "max-age=31536000"
    assert found["plain"].startswith("https://")  # asked for with http: the browser remembers
    assert found["cap"] == "Remote screen: 1.00 °/s without enabling switch"
    assert found["fast"] == [CAPPED, CAPPED]
    assert found["slow"] == [True, True]
