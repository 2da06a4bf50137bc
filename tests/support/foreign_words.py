"""Words and numbers of the reference machine and its source paper: none of them belongs into anything about another."""

from __future__ import annotations

import re
from collections.abc import Iterator
from pathlib import Path
from typing import Final

import pyarrow.parquet

WORDS: Final = re.compile(
    r"the paper\b|the paper's|Sun, Gong, Cai|dqcd24023|hust|gantry(?!ctl)|机架|论文", re.IGNORECASE
)
"""Words of the paper and of its machine, also in Chinese; "gantry" only in the name of this product."""

# Waves of its gear map, the gains of its loops, its acceleration, the radius of its ring.
NUMBERS: Final = re.compile(
    r"(?<![\w.+/=-])(338|1144|2288|4576|77\.6959|0\.3933566\d*|2\.366)(?:\.0+)?(?![\w.+/=])"
)

_MARKUP: Final = re.compile(
    r"<script\b.*?</script>|<style\b.*?</style>|data:[^\"')]*|<svg\b.*?</svg>|<[^>]*>", re.DOTALL
)
_TEXT: Final = {".toml", ".json", ".csv", ".md", ".txt", ".html", ".svg", ""}


def foreign(text: str) -> list[str]:
    """What of the reference machine stands in a text, with some letters around it."""
    found = [*WORDS.finditer(text), *NUMBERS.finditer(text)]
    return [text[max(0, hit.start() - 40) : hit.end() + 40].replace("\n", " ") for hit in found]


def foreign_in_html(page: str) -> list[str]:
    """The same of a page: words anywhere that a person can see or save, numbers in its text only."""
    # Coordinates of curves and the bytes of a recording are numbers by chance.
    visible = _MARKUP.sub(" ", page)
    scripts = re.sub(r"data:[^\"')]*|[A-Za-z0-9+/=]{200,}", "", page)
    words = [hit.group() for hit in WORDS.finditer(scripts)]
    return words + [hit.group() for hit in NUMBERS.finditer(visible)]


def foreign_in(folder: Path) -> Iterator[tuple[str, str]]:
    """File and words, over everything in a folder, at any depth."""
    for path in sorted(folder.rglob("*")):
        # The JSON schema of machine files is the same for every machine: it explains keys and their defaults. A lock
        # holds the number of a process.
        if path.is_dir() or path.name in ("machine.schema.json", "sheet.schema.json", "lock"):
            continue
        name = str(path.relative_to(folder))
        if foreign(name):
            yield name, "its name"
        if path.suffix == ".parquet":
            schema = pyarrow.parquet.read_schema(path)
            text = "\n".join([*schema.names, *(f"{k!r} {v!r}" for k, v in (schema.metadata or {}).items())])
            hits = [hit.group() for hit in WORDS.finditer(text)]
        elif path.suffix == ".html":
            hits = foreign_in_html(path.read_text(encoding="utf-8"))
        elif path.suffix in _TEXT:
            hits = foreign(path.read_text(encoding="utf-8"))
        else:
            # Pictures keep their words in plain bytes.
            hits = [hit.group() for hit in WORDS.finditer(path.read_bytes().decode("latin-1"))]
        for hit in hits:
            yield name, hit
