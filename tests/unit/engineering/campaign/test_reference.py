"""The reference page of the campaign file is what the tables say."""

from pathlib import Path

from gantryctl.engineering.campaign.report.reference import reference_page

PAGE = Path(__file__).parents[4] / "docs" / "reference" / "campaign.md"


def test_the_page_of_the_campaign_file_is_up_to_date() -> None:
    assert PAGE.read_text(encoding="utf-8") == reference_page(), (
        "run: python -m gantryctl.engineering.campaign.report.reference docs/reference/campaign.md"
    )
