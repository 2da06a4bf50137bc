"""Benches that the tests of the doors share."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING

import pytest

from gantryctl.gateway import door, server

if TYPE_CHECKING:
    from support.opcua_bench import Run


@pytest.fixture(scope="session")
def run(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Run]:
    """One OPC UA server for all tests: its start takes 1.3 s of a processor."""
    from support.opcua_bench import sharing

    with sharing(tmp_path_factory.mktemp("opcua")) as made:
        yield made


@pytest.fixture
def short_limits(monkeypatch: pytest.MonkeyPatch) -> None:
    """0.3 s for a request, and for an answer that nobody takes."""
    for module in (door, server):
        monkeypatch.setattr(module, "HEADER_S", 0.3)
        monkeypatch.setattr(module, "STUCK_S", 0.3)
