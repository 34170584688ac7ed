# SPDX-License-Identifier: BSD-3-Clause
"""Rules of style and of public names; every check detects the mistake that it is meant for."""

import ast
import importlib
import os
import re
import shutil
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest
from pages import PAGES

from scratch import PACKAGES, PYTHON_PACKAGES, ROOT, copy_tools, run

# --- `make check` and the count of tests ---------------------------------------------------------

LICENCE = "# SPDX-License-Identifier: BSD-3-Clause\n"


@pytest.fixture
def workspace(tmp_path) -> Path:
    """A workspace of packages that contain only the modules that the tests add."""
    copy_tools(tmp_path)
    shutil.copy(ROOT / "pyproject.toml", tmp_path)
    for package in PYTHON_PACKAGES:
        (tmp_path / package.name / package.name).mkdir(parents=True)
        (tmp_path / package.name / package.name / "__init__.py").touch()
        (tmp_path / package.name / "setup.py").touch()
    return tmp_path


def broken_contracts(workspace: Path, module: str, code: str) -> str:
    """Return the broken contracts of a module with this code."""
    package, _, name = module.partition(".")
    path = workspace / package / package / f"{name.replace('.', '/')}.py"
    path.parent.mkdir(exist_ok=True)
    (path.parent / "__init__.py").touch()
    path.write_text(code)
    sources = [workspace / "tools", *(workspace / path.name for path in PYTHON_PACKAGES)]
    path = ":".join([*map(str, sources), os.environ["PYTHONPATH"]])
    environ = {**os.environ, "PYTHONPATH": path}
    done = run("lint-imports", "--no-cache", environ=environ, cwd=workspace)
    assert done.returncode == (1 if "BROKEN" in done.stdout else 0), done.stderr
    return "".join(line for line in done.stdout.splitlines() if "BROKEN" in line)


@pytest.mark.parametrize(
    ("module", "imported", "complaint"),
    [
        ("grid_map_core_py.layer", "sensor_msgs.msg", "The core knows no ROS"),
        ("grid_map_core_py.limits", "grid_map_core_py.files", "The subpackages of the core"),
        ("grid_map_core_py.layer", "grid_map_ros_py", "Packages stand on each other"),
        ("grid_map_filters_py.threshold", "grid_map_ros_py", "The filters know no ROS"),
        ("grid_map_ros_py.messages._image", "rclpy", "Nodes are leaves"),
        ("grid_map_demos_py.move", "grid_map_demos_py.move_node", "Nodes are leaves"),
        (
            "grid_map_filters_py.threshold",
            "grid_map_filters_py._executables.chain",
            "Nodes are leaves",
        ),
        ("grid_map_filters_py._executables.filter_chain", "grid_map_ros_py, rclpy", ""),
    ],
)
def test_import_against_the_rules_is_found(workspace, module, imported, complaint):
    (workspace / "grid_map_demos_py/grid_map_demos_py/move_node.py").touch()
    for private in (
        "grid_map_core_py/_private",
        "grid_map_core_py/files",
        "grid_map_filters_py/_executables/chain",
    ):
        path = workspace / private.partition("/")[0] / f"{private}.py"
        path.parent.mkdir(exist_ok=True)
        (path.parent / "__init__.py").touch()
        path.touch()
    broken = broken_contracts(workspace, module, f"import {imported}\n")
    assert broken.startswith(complaint)
    assert bool(broken) == bool(complaint)


@pytest.mark.parametrize(("code", "found"), [("", True), (LICENCE, False)])
def test_file_without_licence_header_is_found(workspace, code, found):
    (workspace / "tools" / "new.py").write_text(f'{code}"""Add."""\n\nSUM = 1 + 1\n')
    command = ("check", "--no-cache", "--output-format=concise", "tools/new.py")
    done = run("ruff", *command, environ=os.environ, cwd=workspace)
    assert ("CPY001" in done.stdout or "copyright" in done.stdout) == found, done.stdout


def results(workspace: Path, suite: str, *cases: str) -> None:
    path = workspace / "build" / suite / "pytest.xml"
    path.parent.mkdir(parents=True, exist_ok=True)
    tests = "".join(f'<testcase classname="c" name="n">{case}</testcase>' for case in cases)
    path.write_text(f"<testsuites><testsuite>{tests}</testsuite></testsuites>")


def count(workspace: Path) -> tuple[int, str]:
    tool = workspace / "tools" / "test_results.py"
    done = run(sys.executable, tool, environ=os.environ, cwd=workspace)
    return done.returncode, done.stdout.splitlines()[-1]


def test_the_tests_of_all_suites_are_counted(workspace):
    for suite in ("workspace", *(path.name for path in PYTHON_PACKAGES)):
        results(workspace, suite, "", "<skipped/>")
    suites = len(PYTHON_PACKAGES) + 1
    assert count(workspace) == (0, f"{suites} passed, 0 failed, {suites} skipped")
    results(workspace, "workspace", "<failure/>", "<error/>")
    assert count(workspace) == (1, f"{suites - 1} passed, 2 failed, {suites - 1} skipped")


def test_suite_without_tests_has_failed(workspace):
    for package in PYTHON_PACKAGES:
        results(workspace, package.name, "")
    assert count(workspace) == (1, f"{len(PYTHON_PACKAGES)} passed, 1 failed, 0 skipped")


# --- style: sentences name their subject first, names of tests are short ------------------------

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


# --- public names: in `__all__` ------------------------------------------------------------------

LIBRARIES = [path for path in PYTHON_PACKAGES if path.name != "grid_map_demos_py"]
"""Packages that are imported; the demos are executables."""


def public_modules(package: Path) -> Iterator[str]:
    """Yield the modules and subpackages of a package in whose dotted name no part is private."""
    for path in sorted((package / package.name).rglob("*.py")):
        parts = path.relative_to(package).with_suffix("").parts
        parts = parts[:-1] if parts[-1] == "__init__" else parts
        if not any(part.startswith("_") for part in parts):
            yield ".".join(parts)


@pytest.mark.parametrize("package", LIBRARIES, ids=lambda path: path.name)
def test_public_modules_have_all(package):
    for name in public_modules(package):
        module = importlib.import_module(name)
        exported = getattr(module, "__all__", None)
        assert exported, f"{name}: give it an __all__, or let its name begin with _"
        assert [name for name in exported if name.startswith("_")] == []
        assert [name for name in exported if not hasattr(module, name)] == []


@pytest.mark.parametrize("package", LIBRARIES, ids=lambda path: path.name)
def test_packages_show_public_names_only(package):
    modules = {*public_modules(package)}
    for name in modules:
        module = importlib.import_module(name)
        if hasattr(module, "__path__"):
            others = {f"{name}.{other}" for other in {*dir(module)} - {*module.__all__}}
            assert others <= modules, name
