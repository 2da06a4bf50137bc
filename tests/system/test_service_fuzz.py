"""Hostile clients at every door of the running service, ten minutes at each: `tests/support/fuzz`."""

from __future__ import annotations

import sys
from pathlib import Path

import pytest

EVIDENCE = Path(__file__).parents[2] / "docs" / "evidence" / "service_fuzzed.json"
MINUTES = 10.0
pytestmark = [
    pytest.mark.skipif(sys.platform != "linux", reason="the service needs Linux"),
    pytest.mark.slow,
    pytest.mark.filterwarnings("ignore"),  # of asyncua itself
]


def test_hostile_clients_of_all_doors_break_nothing() -> None:
    pytest.importorskip("asyncua", reason="the extra [opcua] is not installed")
    from support.fuzz.__main__ import DOORS, run

    assert run(MINUTES, 1, list(DOORS), EVIDENCE) == 0
