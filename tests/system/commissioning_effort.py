"""What it takes to commission a virtual drive on a bus: every command and every value that a person types.

Runs inside `private_network.sh`: `python commissioning_effort.py FOLDER`; prints one JSON object.
"""

from __future__ import annotations

import json
import os
import subprocess
import sys
import time
from contextlib import ExitStack
from pathlib import Path

COMMAND = [sys.executable, "-m", "gantryctl"]


class Typed(str):
    """A value that a person has to know and type; options have their names from the help."""


CAN = Typed("udp_multicast")
CONTROL = Typed("drive.sock")
CONFIG = Typed("machine.toml")
DRIVE = ["drive", "sim", "--can", CAN, "--control", CONTROL]
TRACKER = ["instrument", "sim", "--control", CONTROL]
INIT = ["config", "init", "--can", CAN]
ZERO = ["encoder", "set-zero", "--config", CONFIG, "--angle", Typed("0"), "--witness", Typed("mark")]
COMMISSION = ["commission", "--config", CONFIG, "--instrument", Typed("tcp:127.0.0.1:4711")]
# At standstill, near, the whole travel.
ANSWERS = 3
QUESTION = "[y/N]: "


def commission() -> tuple[str, int]:
    """Run the command, agree to everything but the whole travel, which takes a quarter of an hour; output, answers."""
    process = subprocess.Popen(
        [*COMMAND, *COMMISSION], stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.STDOUT
    )
    assert process.stdin is not None
    assert process.stdout is not None
    said, answers = "", 0
    while data := os.read(process.stdout.fileno(), 4096):
        said += data.decode()
        if said.endswith(QUESTION):
            question = said.rpartition("could move: ")[2]
            process.stdin.write(b"n\n" if "the whole travel" in question else b"y\n")
            process.stdin.flush()
            answers += 1
    process.wait()
    return said, answers


def main(folder: Path) -> dict[str, object]:
    os.chdir(folder)
    os.environ["GANTRYCTL_STATE"] = str(folder / "state")
    with ExitStack() as running:
        for arguments in (DRIVE, TRACKER):
            process = subprocess.Popen([*COMMAND, *arguments], stdout=subprocess.DEVNULL)
            running.callback(process.wait)
            running.callback(process.terminate)
            while not Path(CONTROL).exists():
                time.sleep(0.1)
        subprocess.run([*COMMAND, *INIT], check=True, stdout=subprocess.DEVNULL)
        subprocess.run([*COMMAND, *ZERO], check=True, stdout=subprocess.DEVNULL)
        begun_s = time.monotonic()
        out, answers = commission()
        took_s = time.monotonic() - begun_s
    commands = (DRIVE, TRACKER, INIT, ZERO, COMMISSION)
    typed = [value for arguments in commands for value in arguments if isinstance(value, Typed)]
    return {
        "commands": len(commands),
        "typed": len(typed) + ANSWERS,
        "answers": answers,
        "seconds": took_s,
        "out": out,
    }


if __name__ == "__main__":
    print(json.dumps(main(Path(sys.argv[1]))))
