"""Run one command line, and print on standard error which files it had entered when the service was told to move.

A file is entered when one of its functions is called; importing it is no entry. Only `cli` and `operation` count.
"""

from __future__ import annotations

import inspect
import json
import sys
from pathlib import Path
from types import FrameType
from typing import Any

import gantryctl
from gantryctl.cli.main import main
from gantryctl.service.clients.link import ServiceLink

ROOT = Path(gantryctl.__file__).parent
COUNTED = ("cli", "operation")


def run() -> None:
    entered: dict[str, None] = {}
    say = ServiceLink.say

    def note(frame: FrameType, event: str, _: Any) -> None:
        if event == "call" and frame.f_code.co_flags & inspect.CO_OPTIMIZED:
            entered[frame.f_code.co_filename] = None

    def say_and_print(link: ServiceLink, kind: str, **values: Any) -> int:
        number = say(link, kind, **values)
        if kind in ("move", "move_by"):
            sys.setprofile(None)
            inside = [Path(name).relative_to(ROOT) for name in entered if Path(name).is_relative_to(ROOT)]
            counted = [str(file) for file in inside if file.parts[0] in COUNTED]
            print(json.dumps(counted), file=sys.stderr)
        return number

    ServiceLink.say = say_and_print
    sys.setprofile(note)
    main()


if __name__ == "__main__":
    run()
