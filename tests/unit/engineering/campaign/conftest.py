"""Campaigns that take milliseconds a plant."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import pytest

from gantryctl.engineering.campaign.population import Campaign
from gantryctl.engineering.campaign.reading import parse_campaign

CAMPAIGN = """
[campaign]
name = "small"
{order}

[move]
from_deg = 0.0
to_deg = 0.2

{rest}
"""
INERTIA = """
[vary.inertia]
law = "uniform"
keys = ["plant.load.inertia_kg_m2"]
relative = true
low = 0.8
high = 1.2
"""
ORDER = 'tests = ["move"]\noutputs = ["move_load_error_deg_s"]\ncount = 8'


def campaign_text(rest: str = INERTIA, order: str = ORDER) -> str:
    return CAMPAIGN.format(order=order, rest=rest)


@pytest.fixture
def made(tmp_path: Path) -> Callable[..., Campaign]:
    """A campaign of these tables."""

    def make(rest: str = INERTIA, order: str = ORDER) -> Campaign:
        return parse_campaign(campaign_text(rest, order), "c.toml", tmp_path)

    return make
