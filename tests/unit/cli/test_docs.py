"""`gantryctl docs`: where the documentation is, and a server for a browser that may not read files."""

from __future__ import annotations

import signal
import threading
import urllib.request
import webbrowser
from pathlib import Path

import pytest

from gantryctl.cli.computer import docs
from support.command_line import cli


@pytest.fixture
def site(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    (tmp_path / "index.html").write_text("<p>whole</p>", encoding="utf-8")
    monkeypatch.setattr(docs, "_site", lambda: tmp_path)
    return tmp_path


def test_it_opens_the_site_and_tells_where_it_is(site: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    opened: list[str] = []
    monkeypatch.setattr(webbrowser, "open", lambda address: not opened.append(address))
    answer = cli("docs")
    assert (answer.code, answer.out.strip(), answer.err) == (0, str(site / "index.html"), "")
    assert opened == [(site / "index.html").as_uri()]
    cli("docs", "--no-browser")
    assert len(opened) == 1


def test_without_a_browser_it_still_tells_where(site: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(webbrowser, "open", lambda address: False)
    answer = cli("docs")
    assert answer.code == 0
    assert str(site) in answer.out
    assert "BROWSER" in answer.err


def test_a_server_gives_the_pages_on_this_computer_until_it_is_interrupted(
    site: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    got: list[bytes] = []

    def read(address: str) -> None:
        with urllib.request.urlopen(address) as answer:
            got.append(answer.read())
        signal.raise_signal(signal.SIGINT)

    def browser(address: str) -> bool:
        assert address.startswith("http://127.0.0.1:")
        threading.Thread(target=read, args=(address,)).start()
        return True

    monkeypatch.setattr(webbrowser, "open", browser)
    assert cli("docs", "--serve").code == 0
    assert got == [b"<p>whole</p>"]


def test_where_it_is_not_built_it_says_how(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(docs, "_site", lambda: None)
    answer = cli("docs")
    assert answer.code == 2
    assert "make site" in answer.err
