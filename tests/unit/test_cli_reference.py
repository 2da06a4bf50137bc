"""The page of the commands is what the commands say."""

from pathlib import Path

from gantryctl.cli.command_page import reference_page

PAGE = Path(__file__).parents[2] / "docs" / "reference" / "cli.md"


def test_the_page_of_the_commands_is_up_to_date() -> None:
    assert PAGE.read_text(encoding="utf-8") == reference_page(), (
        "run: python -m gantryctl.cli.command_page docs/reference/cli.md"
    )
