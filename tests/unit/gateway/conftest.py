"""Benches that the tests of the doors share."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING

import pytest

from gantryctl.gateway import door, server
from gantryctl.gateway.access import Access
from gantryctl.gateway.settings import Settings
from gantryctl.service.clients.console_link import LinkTaker
from gantryctl.service.clients.hub import Hub
from gantryctl.service.memory.memory import SharedMemory, Source

if TYPE_CHECKING:
    from support.opcua_bench import Run


@pytest.fixture(scope="session")
def run(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Run]:
    """One OPC UA server for all tests: its start takes 1.3 s of a processor."""
    from support.opcua_bench import sharing

    with sharing(tmp_path_factory.mktemp("opcua")) as made:
        yield made


@pytest.fixture
def access(tmp_path: Path) -> Iterator[Access]:
    """Of an installation without users."""
    memory = SharedMemory.create()
    settings = Settings("127.0.0.1", 1, -1, None, None, (), tmp_path, tmp_path)
    yield Access(settings, Hub(memory, Source.WEB), LinkTaker(memory.words))
    memory.close()


@pytest.fixture
def short_limits(monkeypatch: pytest.MonkeyPatch) -> None:
    """0.3 s for a request, and for an answer that nobody takes."""
    for module in (door, server):
        monkeypatch.setattr(module, "HEADER_S", 0.3)
        monkeypatch.setattr(module, "STUCK_S", 0.3)
