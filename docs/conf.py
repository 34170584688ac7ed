# SPDX-License-Identifier: BSD-3-Clause
"""Sphinx configuration of the documentation site, used by `make docs`.

The source of the site is the whole repository, from which Sphinx takes the Markdown files. Links
between pages, and to files beside them, are therefore the same on the site and on a code host.
"""

import re
import sys
from pathlib import Path

from sphinx.application import Sphinx

DOCS = Path(__file__).resolve().parent
sys.path.insert(0, str(DOCS))

project = "grid_map for Python"
author = "grid_map_py contributors"
copyright = "2026, grid_map_py contributors"  # noqa: A001
ROOT = DOCS.parent
DESCRIPTION = (ROOT / "grid_map_core_py" / "package.xml").read_text(encoding="utf-8")
version = release = DESCRIPTION.partition("<version>")[2].partition("</version>")[0]

extensions = ["myst_parser", "sphinx.ext.napoleon", "sphinx_copybutton", "reference"]
root_doc = "docs/index"
include_patterns = [
    "*.md",
    "benchmarks/*.md",
    "docs/**.md",
    "docs/api/generated/**.rst",
    "grid_map_*/*.md",
    "grid_map_*/CHANGELOG.rst",
    "grid_map_*/data/*.md",
]
exclude_patterns = [".*", "build", "install", "log", "demo_output"]
html_theme = "furo"
html_title = project
html_copy_source = False
html_search_scorer = str(DOCS / "search_scorer.js")
copybutton_selector = "div:not(.highlight-text) > div.highlight > pre"
copybutton_prompt_text = r">>> |\.\.\. "
copybutton_prompt_is_regexp = True

myst_heading_anchors = 4
# GitHub shows folders as pages; the site cannot.
nitpick_ignore_regex = [("myst", r".*/")]

OVERVIEWS = {
    "docs/converters": "conversions/*",
    "docs/decisions/README": "*",
    "docs/demos/README": "*",
    "docs/filters": "filters/*",
}
"""Pages that have others below them in the navigation; index.md lists the rest."""

default_role = "literal"
autodoc_member_order = "bysource"
autodoc_default_options = {"show-inheritance": True}
autodoc_preserve_defaults = True
napoleon_numpy_docstring = False
napoleon_use_ivar = True
napoleon_use_rtype = False


def add_navigation(_app: Sphinx, page: str, source: list[str]) -> None:
    """Put the pages below an overview into the navigation."""
    if page in OVERVIEWS:
        below = OVERVIEWS[page]
        if page == "docs/filters":
            # Their titles, types in YAML, are too long for the navigation.
            links = re.findall(r"^\| \[\w+/(\w+)Filter\]\((\S*)\.md\)", source[0], re.MULTILINE)
            below = "\n".join(f"{name} <{path}>" for name, path in links)
        source[0] += f"\n\n```{{toctree}}\n:hidden:\n:glob:\n\n{below}\n```\n"


def add_search_words(_app: Sphinx, page: str, source: list[str]) -> None:
    """Make the page of a filter the first result of a search for its names and its words."""
    if not page.startswith("docs/filters/"):
        return
    title, _, text = source[0].removeprefix("# ").partition("\n")
    given = re.search(r"<!-- words: (.*?) -->", text, re.DOTALL)
    words = given[1].split(", ") if given else []
    entries = ", ".join(f"! {word}" for word in dict.fromkeys([*names_of_filter(title), *words]))
    source[0] = f"# {title}\n\n```{{index}} {entries}\n```\n{text}"


def names_of_filter(type_name: str) -> list[str]:
    """Return all types of a filter in YAML, and its name in words."""
    name = type_name.partition("/")[2]
    short = name.removesuffix("Filter")
    in_words = re.sub(r"(?<!^)([A-Z])", r" \1", short).lower()
    types = f"gridMapFilters/{name}", f"gridMapCv/{name}"
    return [*types, name, f"{in_words} filter", short, in_words]


def add_index(app: Sphinx, error: Exception | None) -> None:
    """Write an index.html that redirects to the first page of the site."""
    if error is None:
        target = f"{app.config.root_doc}.html"
        page = (
            f'<meta http-equiv="refresh" content="0; url={target}"><a href="{target}">{project}</a>'
        )
        Path(app.outdir, "index.html").write_text(page, encoding="utf-8")


def setup(app: Sphinx) -> None:
    """Connect the functions above to Sphinx."""
    app.connect("source-read", add_navigation)
    app.connect("source-read", add_search_words)
    app.connect("build-finished", add_index)
