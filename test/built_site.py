# SPDX-License-Identifier: BSD-3-Clause
"""Tests that `make docs` runs on the site that it has built: search, reference, copy buttons."""

import json
import re
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest
from py_mini_racer import MiniRacer

from scratch import ROOT

SITE = ROOT / "build" / "docs"
FILTERS = sorted((ROOT / "docs" / "filters").glob("*.md"))
REFERENCE = sorted((SITE / "docs" / "api").rglob("*.html"))

# The scripts of the search need no more of a browser.
BROWSER = """
var document = {readyState: "loading", addEventListener() {}, getElementById() { return null }};
var window = globalThis, DOCUMENTATION_OPTIONS = {}, SPHINX_HIGHLIGHT_ENABLED = false;
"""

Search = Callable[[str], list[str]]


@pytest.fixture(scope="module")
def search() -> Iterator[Search]:
    """Search with the scripts of the site; pages come in the order in which it lists them."""
    with MiniRacer() as engine:
        engine.eval(BROWSER)
        for script in ("doctools.js", "language_data.js", "searchtools.js"):
            engine.eval((SITE / "_static" / script).read_text())
        engine.eval((SITE / "searchindex.js").read_text())

        def results(query: str) -> list[str]:
            call = f"Search._performSearch(...Search._parseQuery({json.dumps(query)}))"
            found = json.loads(engine.eval(f"JSON.stringify({call})"))
            return [page for page, *_ in reversed(found)]

        yield results


def words_of_page(path: Path) -> list[str]:
    (words,) = re.findall(r"<!-- words: (.*?) -->", path.read_text(encoding="utf-8"), re.DOTALL)
    return words.split(", ")


WORDS = {word for path in FILTERS for word in words_of_page(path)}


@pytest.mark.parametrize("path", FILTERS, ids=lambda path: path.stem)
def test_names_of_a_filter_find_its_page_first(search, path):
    page = f"docs/filters/{path.stem}"
    type_name = path.read_text(encoding="utf-8").partition("\n")[0].removeprefix("# ")
    name = type_name.partition("/")[2]
    short = name.removesuffix("Filter")
    in_words = path.stem.replace("_", " ")
    for query in (type_name, name, short, short.lower(), in_words, f"{in_words} filter"):
        assert search(query)[0] == page, query


@pytest.mark.parametrize("word", sorted(WORDS))
def test_word_of_filters_finds_one_of_their_pages_first(search, word):
    pages = [f"docs/filters/{path.stem}" for path in FILTERS if word in words_of_page(path)]
    assert sorted(search(word)[: len(pages)]) == pages


@pytest.mark.parametrize(
    ("query", "page"),
    [
        ("GridMap", "docs/api/generated/grid_map_core_py/GridMap"),
        ("circle_cells", "docs/api/grid_map_core_py"),
        ("filter_chain", "docs/nodes/filter_chain"),
        ("rerun_viewer", "docs/nodes/rerun_viewer"),
        ("web_viewer", "docs/nodes/web_viewer"),
        ("numba", "docs/filters"),
        ("troubleshooting", "docs/troubleshooting"),
        ("tutorial", "docs/tutorial"),
    ],
)
def test_search_finds_names_and_prefers_guides(search, query, page):
    assert search(query)[0] == page


def test_reference_has_a_page_per_class_and_no_long_page():
    texts = {path: path.read_text(encoding="utf-8") for path in REFERENCE}
    assert len(texts) > 60
    for path, text in texts.items():
        described = re.findall(r'<dl class="py class">', text)
        of_class = "generated" in path.parts and path.stem != "index"
        assert len(described) == of_class, path
        assert text.count('<dl class="py') < 60, path


@pytest.mark.parametrize("package", [path for path in REFERENCE if path.parent.name == "api"])
def test_page_of_a_package_begins_with_its_names(package):
    text = package.read_text(encoding="utf-8")
    table, description = text.find("autosummary"), text.find('<dl class="py')
    assert table > 0
    assert description == -1 or description > table


@pytest.mark.parametrize("page", ["docs/tutorial", "docs/filters/inpaint", "README"])
def test_code_blocks_have_copy_buttons(page):
    text = (SITE / f"{page}.html").read_text(encoding="utf-8")
    scripts = re.findall(r'<script src="([^"?]*copybutton\.js)', text)
    assert scripts
    assert all((SITE / page).parent.joinpath(script).exists() for script in scripts)
