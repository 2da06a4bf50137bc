"""Pictures of the first ten minutes: what the commands of the page print, as a terminal shows it, and what they draw.

    python tests/support/first_minutes.py docs/tutorials

`make screenshots` calls it. A test compares the texts with what the commands print.
"""

from __future__ import annotations

import io
import os
import re
import sys
import tempfile
from pathlib import Path
from typing import Final

from PIL import Image
from rich._export_format import CONSOLE_SVG_FORMAT
from rich.console import Console
from rich.text import Text

from support.command_line import cli

TERMINALS: Final = {
    "minute_1_move": ["gantryctl move 90"],
    "minute_3_status": ["gantryctl jog + --speed 0.6 --for 3", "gantryctl status"],
    "minute_5_stops": ["gantryctl move 200", "gantryctl stops"],
    "minute_7_fault": ["gantryctl faults run --fault A2 --scan 4", "gantryctl explain ENC-02"],
}
"""Pictures, and the commands in each, in the order of the page."""
PLOTS: Final = {"minute_2_plot": "gantryctl trace plot --out {file}"}
WIDTH: Final = 112
# Rich names fonts of another site; the name of a font that is not there is no harm, the address of one is.
FORMAT: Final = re.sub(r"@font-face \{\{.*?\}\}", "", CONSOLE_SVG_FORMAT, flags=re.DOTALL)


def terminal(name: str, commands: list[str]) -> str:
    """One picture as SVG."""
    console = Console(record=True, width=WIDTH, file=io.StringIO(), color_system=None, legacy_windows=False)
    for command in commands:
        answer = cli(*command.split()[1:])
        console.print(Text(f"$ {command}", style="bold"))
        console.print(Text(without_place((answer.out + answer.err).rstrip())))
    return console.export_svg(title=commands[0], code_format=FORMAT, unique_id=name)


def without_place(text: str) -> str:
    """What is said of this computer and this day, as any reader may see it."""
    text = text.replace(os.environ["GANTRYCTL_STATE"], "/home/anna/.local/state/gantryctl")
    return re.sub(r"-20\d{6}T\d{9}", "-20260101T120000000", text)


def terminals() -> dict[str, str]:
    """All of them, on a machine of their own in a working directory of their own."""
    before, place = os.environ.get("GANTRYCTL_STATE"), Path.cwd()
    with tempfile.TemporaryDirectory() as folder:
        os.environ["GANTRYCTL_STATE"] = folder
        os.chdir(folder)
        try:
            return {name: terminal(name, commands) for name, commands in TERMINALS.items()}
        finally:
            os.chdir(place)
            if before is None:
                del os.environ["GANTRYCTL_STATE"]
            else:
                os.environ["GANTRYCTL_STATE"] = before


def draw(folder: Path) -> None:
    """Write every picture."""
    for name, picture in terminals().items():
        (folder / f"{name}.svg").write_text(picture, encoding="utf-8")
    with tempfile.TemporaryDirectory() as state:
        os.environ["GANTRYCTL_STATE"] = state
        cli("move", "90")
        for name, command in PLOTS.items():
            cli(*command.format(file=Path(state) / "plot.png").split()[1:])
            picture = Image.open(Path(state) / "plot.png").convert("RGB")
            picture.quantize(32, dither=Image.Dither.NONE).save(folder / f"{name}.png", optimize=True)


if __name__ == "__main__":
    draw(Path(sys.argv[1]))
