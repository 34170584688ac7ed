# Copyright (c) 2026 grid_map_py contributors
# SPDX-License-Identifier: BSD-3-Clause
"""Style checks: sentences name their subject first, and names of tests are short."""

import ast
import re

import pytest
from pages import PAGES

from scratch import PACKAGES, ROOT

FOLDERS = [*PACKAGES, *(ROOT / name for name in ("benchmarks", "docs", "test", "tools"))]
WORDS_OF_A_TEST = 10

CLAUSE = r"(?:What|Whether|Who|Of)\s[^\n]*"
"""A subordinate clause or a genitive where the subject should stand."""

SENTENCE = re.compile(rf"(?:^(?!#)[\s>*|\d.-]*|[.!?:|]\**\s+)({CLAUSE})", re.MULTILINE)


def clauses_of_page(prose: str) -> list[str]:
    """Return the sentences of Markdown that begin with a clause; headings may."""
    return SENTENCE.findall(prose)


def clauses_of_code(source: str) -> list[str]:
    """Return the docstrings that begin with a clause, those of attributes too."""
    nodes = (node.value for node in ast.walk(ast.parse(source)) if isinstance(node, ast.Expr))
    texts = (str(node.value) for node in nodes if isinstance(node, ast.Constant))
    return [text for text in texts if re.match(CLAUSE, text)]


def long_names(source: str) -> list[str]:
    nodes = ast.walk(ast.parse(source))
    names = [node.name for node in nodes if isinstance(node, ast.FunctionDef)]
    tests = (name for name in names if name.startswith("test_"))
    return [name for name in tests if len(name.split("_")) - 1 > WORDS_OF_A_TEST]


@pytest.mark.parametrize("page", PAGES, ids=str)
def test_no_sentence_of_a_page_begins_with_a_clause(page):
    assert clauses_of_page(page.prose) == []


@pytest.mark.parametrize("folder", FOLDERS, ids=lambda path: path.name)
def test_docstrings_and_test_names_follow_the_style(folder):
    for path in sorted(folder.rglob("*.py")):
        source = path.read_text()
        assert clauses_of_code(source) == [], path
        assert long_names(source) == [], path


def test_style_checks_can_fail():
    page = "# What it is\n\nIt is. What it does is\nshown. Of all\n\n- Who asks\n"
    assert clauses_of_page(page) == ["What it does is", "Of all", "Who asks"]
    assert clauses_of_code('"""Whether it is."""\nx = 1\n"""Often."""') == ["Whether it is."]
    name = "test_" + "_".join(["word"] * (WORDS_OF_A_TEST + 1))
    assert long_names(f"def {name}(): pass\ndef test_short(): pass") == [name]
