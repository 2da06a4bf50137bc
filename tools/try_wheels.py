"""Wheels tried as a stranger would: an empty environment for each Python, no compiler, the first move.

    python tools/try_wheels.py dist python3.11 python3.12 python3.13     # `make try-wheels`

For each Python: seconds until the first move is done (environment, download, installation and move) and seconds of a
processor in it, which is what a busy computer can tell; megabytes that the installation adds, whether `serve` answers,
what `trace` says without the extra [reports], and whether the digits are those of this environment, which another
compiler has built. `aarch64` among the Pythons is Python 3.11 of that processor, emulated by qemu
(tests/support/aarch64.sh): its digits only. Exit code 1 when something is wrong.
"""

from __future__ import annotations

import json
import os
import re
import resource
import shutil
import signal
import subprocess
import sys
import tempfile
import time
import urllib.request
from collections.abc import Sequence
from pathlib import Path
from typing import Final, NamedTuple

ROOT: Final = Path(__file__).resolve().parent.parent
AARCH64: Final = ROOT / "tests" / "support" / "aarch64.sh"
BITS: Final = ROOT / "tests" / "support" / "bits.py"
FIRST_MOVE_MAX_S: Final = 60.0
ADDED_MAX_MB: Final = 300.0
"""With pyarrow; decision 0021 says why it stays."""
_SERVE_MAX_S: Final = 60.0


class Tried(NamedTuple):
    """What one Python gave.

    Attributes:
        first_move_s: from nothing to the end of the first move. first_move_cpu_s: of a processor, within that.
        added_mb: beyond the Python.
        faults: what is not as it must be.
    """

    python: str
    wheel: str
    first_move_s: float
    first_move_cpu_s: float
    added_mb: float
    faults: tuple[str, ...]


def tried(wheels: Path, python: str, digits: list[str], place: Path) -> Tried:
    """Install the wheel for a Python and use it.

    Args:
        digits: what `bits.py move` prints where another compiler has built the core.
        place: an empty folder.
    """
    begun, begun_cpu_s = time.perf_counter(), _cpu_s()
    home = place / "environment"
    _said([python, "-m", "venv", str(home)], os.environ)
    before = _bytes(home)
    version = _said(
        [str(home / "bin" / "python"), "-c", "import sys; print('%d%d' % sys.version_info[:2])"], os.environ
    )
    tag = f"cp{version.strip()}"
    wheel = next(wheels.glob(f"gantryctl-*-{tag}-{tag}-*{os.uname().machine}.whl"))
    environment = {
        **{name: text for name, text in os.environ.items() if not name.startswith(("PYTHON", "GANTRYCTL"))},
        # Nothing but this Python: no compiler, no make, no shell.
        "PATH": str(home / "bin"),
        "CC": "/nowhere/cc",
        "CXX": "/nowhere/c++",
        "GANTRYCTL_STATE": str(place / "state"),
    }
    pip = [str(home / "bin" / "python"), "-m", "pip", "--disable-pip-version-check", "install", "--quiet"]
    _said([*pip, str(wheel)], environment)
    command = str(home / "bin" / "gantryctl")
    _said([command, "move", "90"], environment)
    first_move_s, first_move_cpu_s = time.perf_counter() - begun, _cpu_s() - begun_cpu_s
    faults = [] if first_move_s <= FIRST_MOVE_MAX_S else [f"first move after {first_move_s:.0f} s"]
    added_mb = (_bytes(home) - before) / 1e6
    if added_mb > ADDED_MAX_MB:
        faults.append(f"{added_mb:.0f} MB beyond Python, {ADDED_MAX_MB:.0f} allowed")
    (recording,) = (place / "state").rglob("*.parquet")
    _said([command, "trace", "show", str(recording)], environment)
    plotted = subprocess.run(  # noqa: S603 - the command just installed
        [command, "trace", "plot", str(recording)],
        env=environment,
        capture_output=True,
        text=True,
        check=False,
    )
    if plotted.returncode != 2 or 'pip install "gantryctl[reports]"' not in plotted.stderr:
        faults.append(f"without [reports]: exit code {plotted.returncode}, {plotted.stderr!r}")
    if not _serves(command, environment):
        faults.append("serve does not answer")
    found = _said([str(home / "bin" / "python"), str(BITS), "move"], environment).split()
    # With the instruction set: the wheel must find the same one.
    if found != digits:
        faults.append(f"other digits: {found}, not {digits}")
    return Tried(python, wheel.name, first_move_s, first_move_cpu_s, added_mb, tuple(faults))


def tried_on_aarch64(wheels: Path, digits: list[str], place: Path) -> Tried:
    """Digits of the wheel for aarch64, which an emulated processor runs.

    Args:
        digits: what `bits.py move` prints here; its first word, the instruction set, is another there.
        place: an empty folder.
    """
    wheel = next(wheels.glob("gantryctl-*-cp311-cp311-*aarch64.whl"))
    platforms = [f"--platform=manylinux_{version}_aarch64" for version in ("2_28", "2_27", "2_26", "2_17")]
    words = [
        "install",
        "--quiet",
        "--target",
        str(place),
        "--only-binary=:all:",
        "--python-version=3.11",
        *platforms,
    ]
    pip = [sys.executable, "-m", "pip", "--disable-pip-version-check", *words]
    _said([*pip, "--find-links", str(wheels), str(wheel)], os.environ)
    begun, begun_cpu_s = time.perf_counter(), _cpu_s()
    environment = {**os.environ, "PYTHONPATH": str(place), "PYTHONDONTWRITEBYTECODE": "1"}
    found = _said([str(AARCH64), str(BITS), "move"], environment).split()
    faults = () if found[1:] == digits[1:] else (f"other digits: {found}, not {digits}",)
    taken_s, taken_cpu_s = time.perf_counter() - begun, _cpu_s() - begun_cpu_s
    return Tried("aarch64", wheel.name, taken_s, taken_cpu_s, _bytes(place) / 1e6, faults)


def _serves(command: str, environment: dict[str, str]) -> bool:
    """Whether the service starts, gives its page, and ends when told so."""
    service = subprocess.Popen(  # noqa: S603 - the command just installed
        [command, "serve", "--listen", "127.0.0.1:0"], env=environment, stdout=subprocess.PIPE, text=True
    )
    try:
        assert service.stdout is not None
        for line in service.stdout:
            found = re.search(r"http://\S+", line)
            if found:
                with urllib.request.urlopen(found[0], timeout=_SERVE_MAX_S) as page:  # noqa: S310 - our own
                    return bool(b"<html" in page.read())
        return False
    finally:
        service.send_signal(signal.SIGINT)
        service.communicate(timeout=_SERVE_MAX_S)


def _cpu_s() -> float:
    """Seconds of a processor in commands that have ended."""
    used = resource.getrusage(resource.RUSAGE_CHILDREN)
    return used.ru_utime + used.ru_stime


def _bytes(folder: Path) -> int:
    return sum(path.lstat().st_size for path in folder.rglob("*") if not path.is_dir())


def _said(command: Sequence[str], environment: os._Environ[str] | dict[str, str]) -> str:
    done = subprocess.run(  # noqa: S603 - commands of this file
        command, env=environment, capture_output=True, text=True, check=False
    )
    if done.returncode:
        raise SystemExit(f"{' '.join(command)}: exit code {done.returncode}\n{done.stdout}{done.stderr}")
    return done.stdout


def main(arguments: Sequence[str]) -> int:
    """Try the wheels of a folder on the Pythons named; JSON of it all at the end."""
    if len(arguments) < 2:
        print(__doc__)
        return 2
    digits = _said([sys.executable, str(BITS), "move"], os.environ).split()
    results = []
    for python in arguments[1:]:
        with tempfile.TemporaryDirectory() as place:
            if python == "aarch64":
                results.append(tried_on_aarch64(Path(arguments[0]), digits, Path(place)))
            elif shutil.which(python) is None:
                raise SystemExit(f"{python} is not here")
            else:
                results.append(tried(Path(arguments[0]), python, digits, Path(place)))
        print(json.dumps(results[-1]._asdict()), flush=True)
    return int(any(result.faults for result in results))


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
