# SPDX-License-Identifier: BSD-3-Clause
"""Sphinx extension that makes the API reference from the public names of the packages.

The pages of packages, `api/grid_map_*.md`, are completed while Sphinx reads them. A page for each
subpackage and each class is written to `api/generated/`.

Each name is described once, where its import is shortest: `grid_map_core_py.GridMap`, not
`grid_map_core_py.map.GridMap`. A class has a page of its own; functions, errors and constants are
described on the page of their package or subpackage. Every page begins with a list of its names.
"""

import inspect
import pkgutil
import re
import shutil
import sys
from collections.abc import Callable, Iterable
from functools import cache
from importlib import import_module
from pathlib import Path
from textwrap import indent
from types import ModuleType

import numpy.typing as npt
from sphinx.application import Sphinx
from sphinx.errors import PycodeError
from sphinx.pycode import ModuleAnalyzer
from sphinx.util.typing import stringify_annotation

API = Path(__file__).resolve().parent / "api"
GENERATED = API / "generated"
PACKAGES = sorted(path.stem for path in API.glob("grid_map_*.md"))
"""The packages in the order of the alphabet, which is also the order of their imports."""

DIRECTIVES = {
    "Classes": "",
    "Functions": "autofunction",
    "Errors": "autoexception",
    "Constants and types": "autodata",
}
"""Kinds of names, and the directives that describe them on the page of their module."""


# --- public names ---------------------------------------------------------------------------------


@cache
def subpackages(package: str) -> list[ModuleType]:
    """Return a package and its public modules."""
    top = import_module(package)
    below = pkgutil.walk_packages(top.__path__, f"{package}.")
    return [top, *(import_module(module.name) for module in below if "._" not in module.name)]


def public_names(module: ModuleType) -> list[str]:
    """Return the names that a module exports."""
    names = list(getattr(module, "__all__", ()))
    for name in names:
        # Autodoc does not see names that are loaded on first use.
        setattr(module, name, getattr(module, name))
    return names


@cache
def places() -> dict[tuple[str, int], str]:
    """Return the module under which each public name is described; an object's id is its key."""
    found: dict[tuple[str, int], str] = {}
    for package in PACKAGES:
        for module in subpackages(package):
            for name in public_names(module):
                found.setdefault((name, id(getattr(module, name))), module.__name__)
    return found


def place(module: ModuleType, name: str) -> str:
    """Return the module under which an exported name is described."""
    return places()[name, id(getattr(module, name))]


def kind(member: object) -> str:
    """Return the title of the table that lists an object."""
    if not inspect.isclass(member):
        return "Functions" if inspect.isroutine(member) else "Constants and types"
    return "Errors" if issubclass(member, BaseException) else "Classes"


# --- pages ----------------------------------------------------------------------------------------


def write_pages(_app: Sphinx) -> None:
    """Write the pages of subpackages and classes."""
    shutil.rmtree(GENERATED, ignore_errors=True)
    for package in PACKAGES:
        for module in subpackages(package):
            folder = GENERATED / module.__name__
            folder.mkdir(parents=True)
            if module.__name__ != package:
                write(folder / "index.rst", module.__name__, description(module))
            for name in classes(module):
                text = f".. autoclass:: {module.__name__}.{name}\n   :members:\n"
                write(folder / f"{name}.rst", name, text)


def write(path: Path, title: str, text: str) -> None:
    """Write a page with a title."""
    path.write_text(f"{title}\n{'=' * len(title)}\n\n{text}", encoding="utf-8")


def complete_page_of_package(_app: Sphinx, page: str, source: list[str]) -> None:
    """Add to the page of a package its names and its subpackages."""
    folder, _, package = page.rpartition("/")
    if folder == "docs/api" and package in PACKAGES:
        names = [module.__name__ for module in subpackages(package)[1:]]
        links = toctree(f"generated/{name}/index" for name in names)
        text = f"{description(import_module(package))}\n{links}"
        source[0] += f"\n\n```{{eval-rst}}\n{text}\n```\n"


def description(module: ModuleType) -> str:
    """Return docstring and tables of a module, and the descriptions of all but its classes."""
    names = public_names(module)
    # The last line lets the tables below use full names.
    parts = [f".. automodule:: {module.__name__}\n   :no-members:\n\n.. currentmodule:: None\n"]
    by_kind = {each: [x for x in names if kind(getattr(module, x)) == each] for each in DIRECTIVES}
    for each, listed in by_kind.items():
        parts += table(each, (f"~{place(module, name)}.{name}" for name in listed))
    if "." not in module.__name__:
        parts += table("Subpackages", (part.__name__ for part in subpackages(module.__name__)[1:]))
    for each, listed in by_kind.items():
        described = (x for x in listed if DIRECTIVES[each] and place(module, x) == module.__name__)
        parts += [f".. {DIRECTIVES[each]}:: {module.__name__}.{name}\n" for name in described]
    folder = "" if "." in module.__name__ else f"generated/{module.__name__}/"
    return "\n".join([*parts, toctree(f"{folder}{name}" for name in classes(module))])


def table(title: str, names: Iterable[str]) -> list[str]:
    """Return a table of names with the first sentences of their docstrings, or an empty list."""
    rows = "".join(f"   {name}\n" for name in names)
    return [f".. rubric:: {title}\n\n.. autosummary::\n   :nosignatures:\n\n{rows}"] * bool(rows)


def classes(module: ModuleType) -> list[str]:
    """Return the classes that are described under this module."""
    names = (name for name in public_names(module) if kind(getattr(module, name)) == "Classes")
    return [name for name in names if place(module, name) == module.__name__]


def toctree(pages: Iterable[str]) -> str:
    """Return a directive that puts pages below this one in the navigation."""
    return ".. toctree::\n   :hidden:\n\n" + "".join(f"   {page}\n" for page in pages)


# --- docstrings -----------------------------------------------------------------------------------


def keep_colons(
    _app: Sphinx, what: str, _name: str, _of: object, _options: object, lines: list[str]
) -> None:
    """Begin the docstring of a property with an empty comment.

    Napoleon takes the words before a colon in its first line for a type.
    """
    if what in ("attribute", "property"):
        lines[:0] = ["..", ""]


def describe_constant(
    _app: Sphinx, what: str, name: str, _of: object, _options: object, lines: list[str]
) -> None:
    """Describe a constant by the text below its assignment, in place of its class's docstring."""
    if what == "data":
        lines[:] = escape("\n".join(text_below_assignment(name))).split("\n")


def text_below_assignment(name: str) -> list[str]:
    """Return the lines of text that describe a constant in the private module that assigns it."""
    module, _, last = name.rpartition(".")
    package, value = module.partition(".")[0], getattr(import_module(module), last)
    for other in list(sys.modules):
        if other.partition(".")[0] != package or vars(sys.modules[other]).get(last) is not value:
            continue
        try:
            texts = ModuleAnalyzer.for_module(other).find_attr_docs()
        except PycodeError:
            continue
        if ("", last) in texts:
            return list(texts["", last])
    return []


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


# --- signatures -----------------------------------------------------------------------------------

ARRAY_LIKE = stringify_annotation(npt.ArrayLike, "smart")


def shorten(
    _app: Sphinx,
    _what: str,
    _name: str,
    _of: object,
    _options: object,
    takes: str | None,
    gives: str | None,
) -> tuple[str, str | None] | None:
    """Shorten array types in a signature to the names used in the code."""
    return None if takes is None else (short(takes), gives and short(gives))


def short(text: str) -> str:
    """Return `text` with array types under their usual names."""
    array = (
        r"~numpy\.ndarray\[tuple\[~typing\.Any, \.\.\.\], ~numpy\.dtype\[~?(?:numpy\.)?([\w.]+)\]\]"
    )
    return re.sub(array, r"NDArray[\1]", text.replace(ARRAY_LIKE, "ArrayLike"))


def setup(app: Sphinx) -> dict[str, bool]:
    """Connect the functions above to Sphinx."""
    app.setup_extension("sphinx.ext.autodoc")
    app.setup_extension("sphinx.ext.autosummary")
    app.connect("builder-inited", write_pages)
    app.connect("source-read", complete_page_of_package)
    app.connect("autodoc-process-docstring", keep_colons, priority=390)
    app.connect("autodoc-process-docstring", rewrites(escape), priority=400)
    app.connect("autodoc-process-docstring", rewrites(list_returns), priority=410)
    # Napoleon has priority 500.
    app.connect("autodoc-process-docstring", describe_constant, priority=600)
    app.connect("autodoc-process-signature", shorten)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
