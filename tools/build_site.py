"""The documentation as a site that needs no network: `python tools/build_site.py [FOLDER]`, or in `build/site`.

Built with every warning an error (a page in no table of docs/index.md, a link or anchor without a target); then every
page is read once more as a browser would: what it refers to is there, and nothing is loaded from elsewhere.
"""

from __future__ import annotations

import shutil
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from html.parser import HTMLParser
from pathlib import Path
from typing import Final
from urllib.parse import unquote, urlsplit

ROOT: Final = Path(__file__).resolve().parent.parent
LOADED: Final = {
    "img": "src",
    "script": "src",
    "link": "href",
    "source": "src",
    "iframe": "src",
    "object": "data",
}


class Page(HTMLParser):
    """What a page refers to, what it loads, and the anchors that it has."""

    def __init__(self, text: str) -> None:
        super().__init__()
        self.links: list[str] = []
        self.loaded: list[str] = []
        self.anchors: set[str] = set()
        self.feed(text)

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        """Take what the tag refers to."""
        values = dict(attrs)
        self.anchors.update(value for name in ("id", "name") if (value := values.get(name)))
        if tag == "a" and (target := values.get("href")):
            self.links.append(target)
        if tag in LOADED and (target := values.get(LOADED[tag])):
            self.loaded.append(target)


def build(folder: Path, source: Path = ROOT) -> str:
    """Build the site of a repository unless it is newer than its sources; what Sphinx says against it, or ""."""
    made_of = [*source.glob("*.md"), *(source / "docs").rglob("*"), Path(__file__)]
    made_of += (ROOT / "build" / "wasm").rglob("*.js")
    index = folder / "searchindex.js"
    if index.is_file() and index.stat().st_mtime > max(
        path.stat().st_mtime for path in made_of if path.is_file()
    ):
        return ""
    # All of it anew: a page that Sphinx has kept gives no warning again, and codes are missing from the search.
    shutil.rmtree(folder, ignore_errors=True)
    with tempfile.TemporaryDirectory() as trees:
        sphinx = [sys.executable, "-m", "sphinx", "-q", "-W", "--keep-going", "-b", "html", "-d", trees]
        made = subprocess.run(  # noqa: S603 - this Python with paths of this repository, no shell
            [*sphinx, "-c", str(ROOT / "docs" / "site"), str(source), str(folder)],
            check=False,
            capture_output=True,
            text=True,
        )
    if made.returncode:
        shutil.rmtree(folder, ignore_errors=True)
    return made.stderr if made.returncode == 0 else made.stderr or f"sphinx: exit code {made.returncode}"


def problems(folder: Path) -> Iterator[str]:
    """What refers to nothing, and what would be loaded from elsewhere; one line each."""
    pages = {path: Page(path.read_text(encoding="utf-8")) for path in sorted(folder.rglob("*.html"))}
    for path, page in pages.items():
        for target in (*page.links, *page.loaded):
            parts = urlsplit(target)
            if parts.scheme or parts.netloc:
                if target in page.loaded and parts.scheme != "data":
                    yield f"{path.relative_to(folder)}: loads {target}"
                continue
            file = (path.parent / unquote(parts.path)).resolve() if parts.path else path
            if not file.is_file() or (
                file in pages and parts.fragment and unquote(parts.fragment) not in pages[file].anchors
            ):
                yield f"{path.relative_to(folder)}: {target} is not there"
    for path in sorted(folder.rglob("*.css")):
        if any(
            f"{word}http" in path.read_text(encoding="utf-8")
            for word in ("url(", 'url("', "url('", '@import "')
        ):
            yield f"{path.relative_to(folder)}: loads from elsewhere"


def main() -> int:
    """Build, look, say where it is; 1 when something is wrong."""
    folder = Path(sys.argv[1]).resolve() if len(sys.argv) > 1 else ROOT / "build" / "site"
    found = build(folder).splitlines() or list(problems(folder))
    print("\n".join(found) if found else f"documentation: {folder / 'index.html'}")
    return 1 if found else 0


if __name__ == "__main__":
    sys.exit(main())
