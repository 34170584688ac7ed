# Copyright (c) 2026 grid_map_py contributors
# SPDX-License-Identifier: BSD-3-Clause
"""README and CHANGELOG of each package list its public names and commands."""

import re

import pytest
from pages import page

from grid_map_filters_py._registry import BUILT_IN as FILTERS
from grid_map_visualization_py._registry import BUILT_IN as VISUALIZATIONS
from scratch import PACKAGES, PYTHON_PACKAGES

INTERFACES = next(path for path in PACKAGES if path.name == "grid_map_msgs")
LIBRARIES = [path for path in PYTHON_PACKAGES if path.name != "grid_map_demos_py"]


def by_name(path):
    return path.name


def words(package, file: str) -> set[str]:
    return set(re.findall(r"[\w-]+", (package / file).read_text()))


@pytest.mark.parametrize("package", PACKAGES, ids=by_name)
def test_changelog_has_the_form_that_release_tools_read(package):
    text = (package / "CHANGELOG.rst").read_text()
    first, title, last, _, *lines = text.splitlines()
    assert title == f"Changelog for package {package.name}"
    assert first == last == "^" * len(title)
    sections = re.split(r"^(.+)\n(-+)\n", "\n".join(lines), flags=re.MULTILINE)[1:]
    headings, underlines, items = sections[0::3], sections[1::3], sections[2::3]
    assert headings[0] == "Forthcoming"
    assert all(re.fullmatch(r"\d+\.\d+\.\d+ \(\d{4}-\d\d-\d\d\)", each) for each in headings[1:])
    assert [len(each) for each in headings] == [len(each) for each in underlines]
    assert all(re.fullmatch(r"\* .+\n((\* |  ).+\n?)*", each.rstrip() + "\n") for each in items)


@pytest.mark.parametrize("package", PYTHON_PACKAGES, ids=by_name)
def test_every_executable_is_in_readme_and_changelog(package):
    executables = set(re.findall(r'"(\w+) = [\w.]+:main"', (package / "setup.py").read_text()))
    assert executables - words(package, "README.md") == set()
    assert executables - words(package, "CHANGELOG.rst") == set()


@pytest.mark.parametrize("file", ["README.md", "CHANGELOG.rst"])
def test_every_message_and_service_is_in_readme_and_changelog(file):
    names = {path.stem for folder in ("msg", "srv") for path in (INTERFACES / folder).iterdir()}
    assert len(names) == 6
    assert names - words(INTERFACES, file) == set()


def test_every_filter_and_every_visualization_is_in_a_changelog():
    filters, visualizations = (
        next(path for path in PACKAGES if path.name == name)
        for name in ("grid_map_filters_py", "grid_map_visualization_py")
    )
    short = {name.partition("/")[2].removesuffix("Filter") for name in FILTERS}
    assert short - words(filters, "CHANGELOG.rst") == set()
    assert VISUALIZATIONS.keys() - words(visualizations, "CHANGELOG.rst") == set()


@pytest.mark.parametrize("package", LIBRARIES, ids=by_name)
def test_readme_and_architecture_name_every_room(package):
    paths = (package / package.name).iterdir()
    rooms = {path.stem for path in paths if path.stem[0].isalpha() and path.stem != "py"}
    assert len(rooms) > 2
    assert rooms - words(package, "README.md") == set()
    tree = page("docs/architecture.md").section("The rooms").partition(f"\n{package.name} ")[2]
    assert rooms == {*re.findall(r"^[├└]── (\w+)", tree.partition("\n\n")[0], re.MULTILINE)}
