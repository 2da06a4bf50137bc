"""`gantryctl docs`: the documentation, without a network."""

from __future__ import annotations

import threading
import webbrowser
from pathlib import Path

import click

from gantryctl.cli.options import stop_signals
from gantryctl.terminal import tell


@click.command()
@click.option("--no-browser", is_flag=True, help="Only tell where it is.")
@click.option(
    "--serve", is_flag=True, help="On 127.0.0.1 until Ctrl-C, for a browser that may not read files."
)
def docs(no_browser: bool, serve: bool) -> None:
    """Open the documentation in a browser, and tell where it is. Nothing is loaded from elsewhere.

    A wheel brings it along; in a clone `make site` builds it. The same pages are Markdown in docs/.
    """
    from gantryctl.errors import UsageError

    site = _site()
    if site is None:
        raise UsageError(
            "the documentation is not built here: `make site` in a clone does it; its text is docs/index.md"
        )
    if serve:
        _serve(site, no_browser)
        return
    click.echo(site / "index.html")
    _open((site / "index.html").as_uri(), no_browser)


def _site() -> Path | None:
    """Folder of the built site: of the installed package, else of the clone that it is imported from."""
    package = Path(__file__).resolve().parents[2]
    places = (package / "site", package.parents[1] / "build" / "site")
    return next((place for place in places if (place / "index.html").is_file()), None)


def _open(address: str, no_browser: bool) -> None:
    if not no_browser and not webbrowser.open(address):
        tell("no browser can be started here; the variable BROWSER names one")


def _serve(site: Path, no_browser: bool) -> None:
    from functools import partial
    from http.server import SimpleHTTPRequestHandler, ThreadingHTTPServer

    class Quiet(SimpleHTTPRequestHandler):
        def log_message(self, format: str, *args: object) -> None:
            """Say nothing of every page."""

    with ThreadingHTTPServer(("127.0.0.1", 0), partial(Quiet, directory=str(site))) as server:
        address = f"http://127.0.0.1:{server.server_port}/"
        click.echo(f"{address} from {site}; Ctrl-C ends it")
        _open(address, no_browser)
        # Not by KeyboardInterrupt, which is lost where it comes in code whose exceptions Python ignores.
        with stop_signals(lambda: threading.Thread(target=server.shutdown, daemon=True).start()):
            server.serve_forever()
