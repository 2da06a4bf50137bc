"""The systemd unit: what it grants is enough for port 443, and nothing else grants that."""

from __future__ import annotations

import os
import shutil
import signal
import subprocess
import sys
from pathlib import Path

import pytest

pytestmark = pytest.mark.skipif(sys.platform != "linux", reason="the service needs Linux")
UNIT = Path(__file__).parents[2] / "packaging" / "gantryctl.service"
PORT = "127.0.0.1:443"
# A network of its own, where port 443 is free and no sysctl of this machine counts; then only the capabilities named.
ALONE = (
    "ip link set lo up && exec setpriv --securebits=+noroot,+no_setuid_fixup "
    '--inh-caps="-all$0" --ambient-caps="-all$0" --bounding-set="-all$0" "$@"'
)


def granted(key: str) -> list[str]:
    """Capabilities in one line of the unit."""
    (line,) = [line for line in UNIT.read_text(encoding="utf-8").splitlines() if line.startswith(f"{key}=")]
    return [name.removeprefix("CAP_").lower() for name in line.partition("=")[2].split()]


def served(root: Path, capabilities: list[str]) -> tuple[str, str]:
    """What `gantryctl serve` with these capabilities says: output and errors."""
    private = ["unshare", "--net"] if os.geteuid() == 0 else ["unshare", "--net", "--map-root-user"]
    names = "".join(f",+{name}" for name in capabilities)
    command = [*private, "sh", "-c", ALONE, names]
    if subprocess.run([*command, "true"], capture_output=True, check=False).returncode:
        pytest.skip(
            "no network of its own here: it needs unshare, ip and setpriv, and root or user namespaces"
        )
    serve = ["-P", "-m", "gantryctl", "serve", "--listen", PORT]
    environment = {**os.environ, "GANTRYCTL_STATE": str(root), "PYTHONUNBUFFERED": "1"}
    with subprocess.Popen(
        [*command, sys.executable, *serve], env=environment, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
    ) as process:  # fmt: skip
        assert process.stdout is not None
        assert process.stderr is not None
        said = ""
        for line in process.stdout:
            said += line
            if line.startswith("Ctrl-C"):
                process.send_signal(signal.SIGINT)
        return said, process.stderr.read()


def test_port_443_is_served_with_what_the_unit_grants_and_not_without(tmp_path: Path) -> None:
    ambient = granted("AmbientCapabilities")
    assert ambient == granted("CapabilityBoundingSet")
    assert f"page: http://{PORT}/" in served(tmp_path, ambient)[0]
    without = [name for name in ambient if name != "net_bind_service"]
    said, errors = served(tmp_path, without)
    assert said == ""
    assert f"--listen {PORT}: ports below 1024 need the capability CAP_NET_BIND_SERVICE" in errors


def test_systemd_finds_nothing_wrong_with_the_unit(tmp_path: Path) -> None:
    if shutil.which("systemd-analyze") is None:
        pytest.skip("systemd-analyze is not installed")
    copy = tmp_path / UNIT.name
    text = UNIT.read_text(encoding="utf-8")
    copy.write_text(text.replace("/opt/gantryctl/bin/gantryctl", sys.executable), encoding="utf-8")
    found = subprocess.run(["systemd-analyze", "verify", copy], capture_output=True, text=True, check=False)
    assert (found.returncode, found.stderr) == (0, "")
