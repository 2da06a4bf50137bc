"""The side bar from the tables of docs/index.md, and codes as entries of the search."""

from __future__ import annotations

import posixpath
import re
from pathlib import PurePosixPath

from docutils import nodes
from sphinx import addnodes
from sphinx.application import Sphinx
from sphinx.transforms import SphinxTransform

HEAD = re.compile(r"^\| (?P<title>[^|]+?) \| \|$")
LINK = re.compile(r"\[[^\]]+\]\(([^)#]+\.(?:md|ipynb))\)")
CODE = re.compile(r"^((?:CFG-)?[A-Z]{3}-\d\d)\b")
DECISIONS = "docs/decisions/README"


def connect(app: Sphinx) -> None:
    """Tell Sphinx of both."""
    app.connect("source-read", _add_tables_of_contents)
    app.add_transform(Codes)


def _add_tables_of_contents(app: Sphinx, name: str, content: list[str]) -> None:
    """Each table of the index is a group of the side bar; a page that is in none of them is a warning."""
    if name == app.config.root_doc:
        content[0] += "".join(_tree(title, pages) for title, pages in _groups(content[0]))
    elif name == DECISIONS:
        content[0] += "\n\n```{toctree}\n:glob:\n:maxdepth: 1\n\n0*\n```\n"


def _groups(index: str) -> list[tuple[str, list[str]]]:
    found: list[tuple[str, list[str]]] = []
    for line in index.splitlines():
        if head := HEAD.match(line):
            found.append((head["title"], []))
        elif found and line.startswith("| "):
            found[-1][1].extend(LINK.findall(line.split("|")[1]))
    return found


def _tree(title: str, pages: list[str]) -> str:
    paths = (posixpath.normpath(posixpath.join("/docs", page)) for page in pages)
    names = "\n".join(str(PurePosixPath(path).with_suffix("")) for path in paths)
    title = title[0].upper() + title[1:]
    return f"\n\n```{{toctree}}\n:hidden:\n:titlesonly:\n:caption: {title}\n\n{names}\n```\n"


class Codes(SphinxTransform):
    """A search for ENC-01 leads to the section of that alarm, not only to its page."""

    default_priority = 700

    def apply(self, **kwargs: object) -> None:
        for section in self.document.findall(nodes.section):
            code = CODE.match(section[0].astext())
            if code is not None:
                entry = addnodes.index(entries=[("single", code[1], section["ids"][0], "main", None)])
                section.insert(1, entry)
