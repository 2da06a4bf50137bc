"""The page of the commands and the man page are what the commands say."""

import shutil
import subprocess
from pathlib import Path

import pytest

from gantryctl.cli.command_page import man_page, reference_page
from gantryctl.cli.main import COMMANDS

ROOT = Path(__file__).parents[2]
HOW = "run: python -m gantryctl.cli.command_page docs/reference/cli.md packaging/gantryctl.1"


@pytest.mark.parametrize(
    ("page", "made"), [("docs/reference/cli.md", reference_page), ("packaging/gantryctl.1", man_page)]
)
def test_the_pages_of_the_commands_are_up_to_date(page: str, made: object) -> None:
    assert callable(made)
    assert (ROOT / page).read_text(encoding="utf-8") == made(), HOW


def test_the_man_page_has_every_command_and_no_line_that_roff_takes_for_its_own() -> None:
    page = man_page()
    for name in COMMANDS:
        shown = name.replace("-", "\\-")
        assert f"\n.SS gantryctl {shown} " in page, name
    own = {line.split()[0] for line in page.splitlines() if line.startswith((".", "'"))}
    assert own <= {".TH", ".SH", ".SS", ".TP", ".B", ".I", ".PP"}


def test_roff_has_no_complaint() -> None:
    if shutil.which("groff") is None:
        pytest.skip("groff is not installed")
    done = subprocess.run(
        ["groff", "-man", "-ww", "-Tutf8", "-z", ROOT / "packaging" / "gantryctl.1"],
        capture_output=True,
        check=False,
        text=True,
    )
    assert (done.returncode, done.stderr) == (0, "")
