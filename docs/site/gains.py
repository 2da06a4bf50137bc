"""Gains that a reader drags (`make wasm`): their scripts are loaded by the page that has a place for them."""

from __future__ import annotations

from pathlib import Path
from typing import Any, Final

from sphinx.application import Sphinx

MADE: Final = Path(__file__).parents[2] / "build" / "wasm"
SCRIPTS: Final = ("gains_data.js", "site/gains.js")
STYLE: Final = "site/gains.css"
PLACE: Final = 'class="gains-to-drag"'


def connect(app: Sphinx) -> None:
    """Tell Sphinx of them; a site that is built without them keeps the words that stand in their place."""
    files = [MADE / name for name in (*SCRIPTS, STYLE)]
    if all(file.is_file() for file in files):
        app.config.html_static_path += [str(file) for file in files]
        app.connect("html-page-context", _load)


def _load(app: Sphinx, page: str, template: str, context: dict[str, Any], doctree: object) -> None:
    if PLACE in context.get("body", ""):
        for name in SCRIPTS:
            app.add_js_file(Path(name).name)
        app.add_css_file(Path(STYLE).name)
