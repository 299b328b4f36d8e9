"""The documentation's site: Sphinx's settings, for ``make docs``.

The source folder is the whole repository, so that links between documents mean the same on the site as elsewhere. Pages
load nothing from another host: no fonts, badges, formula scripts or inventories of other projects.
"""

from __future__ import annotations

import sys
import tomllib
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from sphinx.application import Sphinx

ROOT = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(ROOT))

from docs.site.docstrings import with_examples  # noqa: E402
from docs.site.generated import with_generated  # noqa: E402

project = "fogwatch"
author = "the fogwatch authors"
release = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]["version"]
language = "en"
smartquotes = False

extensions = ["myst_nb", "sphinx.ext.autodoc", "sphinx.ext.napoleon", "sphinx_copybutton"]
root_doc = "docs/index"
include_patterns = ["docs/**", "CHANGELOG.md", "CONTRIBUTING.md", "SECURITY.md", "deploy/**"]
exclude_patterns = [".git", ".venv", "build", "dist", "runs", "docs/notebooks/*.ipynb"]

myst_heading_anchors = 4
myst_links_external_new_tab = False
nb_execution_mode = "cache"
nb_execution_raise_on_error = True
nb_execution_timeout = 300
nb_execution_cache_path = str(ROOT / "build" / "notebooks")

napoleon_use_ivar = True
autodoc_member_order = "bysource"
autodoc_typehints_format = "short"
python_use_unqualified_type_names = True

html_theme = "furo"
html_title = f"fogwatch {release}"
html_static_path = ["site/static"]
html_css_files = ["site.css"]
html_additional_pages = {"index": "redirect.html"}
templates_path = ["site/templates"]
html_copy_source = False
# A summary of each result would be fetched, which browsers refuse to pages opened from a disk.
html_show_search_summary = False
copybutton_exclude = ".linenos, .gp, .go"


def setup(app: Sphinx) -> None:
    """Have Sphinx fill in what is generated, and read docstrings as this project writes them."""
    app.connect("source-read", _generate)
    app.connect("autodoc-process-docstring", _mark_examples, priority=400)  # before napoleon


def _generate(_app: Sphinx, _name: str, source: list[str]) -> None:
    source[0] = with_generated(source[0])


def _mark_examples(_app: Sphinx, _what: str, _name: str, _object: object, _options: object, lines: list[str]) -> None:
    lines[:] = with_examples(lines)
