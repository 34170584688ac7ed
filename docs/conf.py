# Copyright (c) 2026 grid_map_py contributors
# SPDX-License-Identifier: BSD-3-Clause
"""Sphinx configuration of the documentation site, used by `make docs`.

The source of the site is the whole repository, from which Sphinx takes the Markdown files. Links
between pages, and to files beside them, are therefore the same on the site and on a code host.
"""

import pkgutil
import re
from collections.abc import Callable
from importlib import import_module
from pathlib import Path
from textwrap import indent
from types import ModuleType

import numpy.typing as npt
from sphinx.application import Sphinx
from sphinx.util.typing import stringify_annotation

project = "grid_map for Python"
author = "grid_map_py contributors"
copyright = "2026, grid_map_py contributors"  # noqa: A001
ROOT = Path(__file__).resolve().parents[1]
DESCRIPTION = (ROOT / "grid_map_core_py" / "package.xml").read_text(encoding="utf-8")
version = release = DESCRIPTION.partition("<version>")[2].partition("</version>")[0]

extensions = ["myst_parser", "sphinx.ext.autodoc", "sphinx.ext.napoleon"]
root_doc = "docs/index"
include_patterns = [
    "*.md",
    "benchmarks/*.md",
    "docs/**.md",
    "grid_map_*/*.md",
    "grid_map_*/CHANGELOG.rst",
    "grid_map_*/data/*.md",
]
exclude_patterns = [".*", "build", "install", "log", "demo_output"]
html_theme = "furo"
html_title = project
html_copy_source = False

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
        source[0] += f"\n\n```{{toctree}}\n:hidden:\n:glob:\n\n{OVERVIEWS[page]}\n```\n"


def add_modules(_app: Sphinx, page: str, source: list[str]) -> None:
    """Append to a page of the API reference the public names of its package, room by room."""
    if not page.startswith("docs/api/grid_map_"):
        return
    package = import_module(page.rpartition("/")[2])
    below = pkgutil.walk_packages(package.__path__, f"{package.__name__}.")
    rooms = [import_module(module.name) for module in below if "._" not in module.name]
    elsewhere = {name for room in rooms for name in public_names(room)}
    elsewhere |= {x for x in public_names(package) if is_borrowed(getattr(package, x), package)}
    source[0] += section(package, [x for x in public_names(package) if x not in elsewhere])
    offered = [f"`{name}`" for name in public_names(package) if name in elsewhere]
    if offered:
        source[0] += f"\nAlso offers {', '.join(offered)}, described in the rooms.\n"
    for room in rooms:
        names = [x for x in public_names(room) if not is_borrowed(getattr(room, x), package)]
        source[0] += section(room, names) if names else ""


def public_names(module: ModuleType) -> list[str]:
    """Return the names that a package, a room or a module exports."""
    names = list(getattr(module, "__all__", ()))
    for name in names:
        # Autodoc does not see names that are loaded on first use.
        setattr(module, name, getattr(module, name))
    return names


def is_borrowed(member: object, package: ModuleType) -> bool:
    """Return whether another package defines a class or function."""
    owner = getattr(member, "__module__", package.__name__)
    return owner.partition(".")[0] != package.__name__


def section(module: ModuleType, names: list[str]) -> str:
    """Return a section with the docstrings of a module and of these names in it."""
    members = f"\n   :members: {', '.join(names)}" if names else "\n   :no-members:"
    name = module.__name__
    return f"\n\n## {name}\n\n```{{eval-rst}}\n.. automodule:: {name}{members}\n```\n"


ARRAY_LIKE = stringify_annotation(npt.ArrayLike, "smart")
Docstring = Callable[[Sphinx, str, str, object, object, list[str]], None]


def rewrites(change: Callable[[str], str]) -> Docstring:
    """Return an autodoc hook that applies `change` to every docstring."""

    def rewrite(
        _app: Sphinx, _what: str, _name: str, _of: object, _options: object, lines: list[str]
    ) -> None:
        lines[:] = change("\n".join(lines)).split("\n")

    return rewrite


def list_returns(text: str) -> str:
    """Turn several return values into a list, which Napoleon cannot do."""
    section = re.search(r"^(Returns|Yields):\n((?: {4}.*\n)+)", text, re.MULTILINE)
    if not section or len(re.findall(r"^ {4}[\w, ]+: ", section[2], re.MULTILINE)) < 2:
        return text
    entries = re.sub(r"^ {4}(?=\S)", "    * ", section[2], flags=re.MULTILINE)
    entries = re.sub(r"^ {8,}", "      ", entries, flags=re.MULTILINE)
    return text.replace(section[0], f":{section[1].lower()}:\n{entries}")


def escape(text: str) -> str:
    """Mark examples and trees as code, and escape stars and bars that are mathematical signs."""
    tree = re.compile(r"^\w+.*\n(?:[ │]*[├└]── .*(?:\n|$))+", re.MULTILINE)
    text = tree.sub(lambda found: "::\n\n" + indent(found[0], "    ") + "\n", text)
    text = re.sub(r"(?<!:):\n\n(?= {4}\S)", "::\n\n", text)
    sign = re.compile(r"(?<=[\w)\]])[*|]|[*|](?=[\w(])")
    is_code = re.compile(r" *(>>>|\.\.\.)")
    lines = text.split("\n")
    return "\n".join(x if is_code.match(x) else sign.sub(r"\\\g<0>", x) for x in lines)


Signature = tuple[str, str | None]


def shorten(
    _app: Sphinx,
    _what: str,
    _name: str,
    _of: object,
    _options: object,
    takes: str | None,
    gives: str | None,
) -> Signature | None:
    """Shorten array types in a signature to the names used in the code."""
    return None if takes is None else (short(takes), gives and short(gives))


def short(text: str) -> str:
    """Return `text` with array types under their usual names."""
    array = (
        r"~numpy\.ndarray\[tuple\[~typing\.Any, \.\.\.\], ~numpy\.dtype\[~?(?:numpy\.)?([\w.]+)\]\]"
    )
    return re.sub(array, r"NDArray[\1]", text.replace(ARRAY_LIKE, "ArrayLike"))


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
    app.connect("source-read", add_modules)
    app.connect("autodoc-process-docstring", rewrites(escape), priority=400)
    app.connect("autodoc-process-docstring", rewrites(list_returns), priority=410)
    app.connect("autodoc-process-signature", shorten)
    app.connect("build-finished", add_index)
