"""The documentation as a site: `make site`. Pages are the Markdown of the repository as a forge shows it."""

from __future__ import annotations

import sys
import tomllib
from pathlib import Path
from typing import Final

from sphinx.application import Sphinx

HERE: Final = Path(__file__).parent
ROOT: Final = HERE.parents[1]
sys.path.insert(0, str(HERE))

import gains  # noqa: E402
import navigation  # noqa: E402
import sources  # noqa: E402
import words  # noqa: E402

project = "gantryctl"
author = "gantryctl contributors"
version = release = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]["version"]

extensions = ["myst_parser"]
root_doc = "docs/index"
include_patterns = ["docs/**", "README.md", "CONTRIBUTING.md", "SECURITY.md", "CHANGELOG.md"]
# What is looked through for pages: everything else is left out by name, since node_modules alone has 10,000 files.
exclude_patterns = [f"{path.name}/**" for path in ROOT.iterdir() if path.is_dir() and path.name != "docs"]
source_suffix = {".md": "markdown", ".ipynb": "notebook"}
myst_heading_anchors = 4
myst_links_external_new_tab = False

# A warning for whatever has no target; `-W` makes it an error.
nitpicky = True

html_theme = "furo"
html_title = f"gantryctl {version}"
html_copy_source = False
html_show_sourcelink = False
html_show_copyright = False
html_show_sphinx = False
html_last_updated_fmt = None
html_static_path = ["site.css", "site.js"]
html_css_files = ["site.css"]
html_js_files = ["site.js"]
html_search_language = words.SearchBoth.lang
html_extra_path = ["index.html"]
pygments_style = "friendly"
pygments_dark_style = "github-dark"


def setup(app: Sphinx) -> None:
    """What Sphinx calls first."""
    navigation.connect(app)
    gains.connect(app)
    sources.connect(app)
    app.add_search_language(words.SearchBoth)
