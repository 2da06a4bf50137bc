"""What a forge shows by itself: notebooks, and state diagrams written in Mermaid."""

from __future__ import annotations

import json
import re

from docutils import nodes
from myst_parser.parsers.sphinx_ import MystParser
from sphinx.application import Sphinx

TRANSITION = re.compile(r"^\s*(\S+) --> (\S+?)(?:: (.*))?$", re.MULTILINE)


class NotebookParser(MystParser):
    """A notebook as a page: its words, and its cells as Python."""

    supported = ("notebook",)

    def parse(self, inputstring: str, document: nodes.document) -> None:
        parts = []
        for cell in json.loads(inputstring)["cells"]:
            text = "".join(cell["source"])
            parts.append(text if cell["cell_type"] == "markdown" else f"```python\n{text}\n```")
        super().parse("\n\n".join(parts), document)


def connect(app: Sphinx) -> None:
    """Tell Sphinx of both."""
    app.add_source_parser(NotebookParser)
    app.connect("source-read", _tables_of_transitions)


def _tables_of_transitions(app: Sphinx, name: str, content: list[str]) -> None:
    """A diagram is a table here: Mermaid draws in the browser, by a program larger than the rest of the site."""
    content[0] = re.sub(r"```mermaid\n(.*?)```", lambda found: _table(found[1]), content[0], flags=re.DOTALL)


def _table(diagram: str) -> str:
    rows = [
        f"| {_state(start)} | {_state(end)} | {event or ''} |"
        for start, end, event in TRANSITION.findall(diagram)
    ]
    assert len(rows) == diagram.count("-->")
    return "\n".join(("| from | to | when |", "|---|---|---|", *rows)) + "\n"


def _state(name: str) -> str:
    return "(start, end)" if name == "[*]" else name
