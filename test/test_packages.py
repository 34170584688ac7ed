# SPDX-License-Identifier: BSD-3-Clause
"""Manifests, versions, message types, READMEs and changelogs of the packages are consistent."""

import ast
import importlib.util
import json
import os
import re
import sys
from pathlib import Path
from subprocess import CompletedProcess
from xml.etree import ElementTree

import pytest
from pages import page

from grid_map_core_py import _packages
from grid_map_filters_py._registry import BUILT_IN as FILTERS
from grid_map_msgs.srv import GetGridMap, GetGridMapInfo, ProcessFile, SetGridMap
from grid_map_ros_py.testing import environment
from grid_map_visualization_py._registry import BUILT_IN as VISUALIZATIONS
from scratch import PACKAGES, PYTHON_PACKAGES, ROOT, executables, run

ROSDEP_KEYS = {
    "PIL": "python3-matplotlib",  # matplotlib depends on Pillow
    "contourpy": "python3-matplotlib",  # matplotlib depends on contourpy
    "cv2": "python3-opencv",
    "hypothesis": "python3-hypothesis",
    "lark": "python3-lark-parser",
    "matplotlib": "python3-matplotlib",
    "mpl_toolkits": "python3-matplotlib",
    "msgspec": "viser",  # viser depends on msgspec, websockets and zstandard
    "numpy": "python3-numpy",
    "pytest": "python3-pytest",
    "scipy": "python3-scipy",
    "shapely": "python3-shapely",
    "tf2_ros": "tf2_ros_py",
    "websockets": "viser",
    "yaml": "python3-yaml",
    "zstandard": "viser",
}
"""Under which key rosdep knows a module; ROS packages are known by the names of their modules."""

TILED = {
    "dask",
    "distributed",
    "fsspec",
    "numcodecs",
    "pyproj",
    "rio_cogeo",
    "rioxarray",
    "xarray",
    "zarr",
}
"""Modules of the extras `tiled` and `geo`, and of their tests."""

OPTIONAL = {
    *("llvmlite", "numba"),
    *("rasterio", "rerun", "rerun_cli", "viser"),
} | TILED
"""Optional modules, imported on use; if one is missing, an error names the remedy."""


LIBRARIES = [path for path in PYTHON_PACKAGES if path.name != "grid_map_demos_py"]


def by_name(path: Path) -> str:
    return path.name


def imports(folder: Path) -> set[str]:
    """Return the top-level modules that the Python files in `folder` import."""
    found = set()
    for path in folder.rglob("*.py"):
        for node in ast.walk(ast.parse(path.read_text())):
            if isinstance(node, ast.Import):
                found |= {alias.name.split(".")[0] for alias in node.names}
            elif isinstance(node, ast.ImportFrom) and node.level == 0:
                found.add(node.module.split(".")[0])
    return found - set(sys.stdlib_module_names)


def declared(package: Path, *tags: str) -> set[str]:
    manifest = ElementTree.parse(package / "package.xml").getroot()
    return {element.text for tag in tags for element in manifest.iter(tag)}


def keys(modules: set[str], package: Path) -> set[str]:
    helpers = {path.stem for path in (package / "test").rglob("*.py")}
    return {ROSDEP_KEYS.get(module, module) for module in modules - helpers - {package.name}}


def words(package, file: str) -> set[str]:
    return set(re.findall(r"[\w-]+(?:\.py\b)?", (package / file).read_text()))


@pytest.mark.parametrize("package", PYTHON_PACKAGES, ids=by_name)
def test_package_declares_what_it_imports_and_nothing_else(package):
    used, used_by_tests = (
        keys(imports(package / folder), package) for folder in (package.name, "test")
    )
    run = declared(package, "depend", "exec_depend")
    optional = OPTIONAL | ({"python3-hypothesis"} & declared(package, "test_depend"))
    assert used - run - optional == set()
    assert used_by_tests - run - declared(package, "test_depend") - OPTIONAL == set()
    launched = {other.name for other in PACKAGES} | {
        "tf2_msgs",  # tf2_ros_py imports it
        "rosbag2_py",  # imported if the package mcap is missing
        "rosbag2_storage_mcap",  # plug-in of rosbag2_py
    }
    assert declared(package, "exec_depend") - used - launched == set()


@pytest.mark.parametrize("package", PYTHON_PACKAGES, ids=by_name)
def test_executables_are_installed_and_in_readme_and_changelog(package):
    for name, module in executables(package.name).items():
        assert importlib.util.find_spec(module).origin.startswith(
            str(ROOT / "install" / package.name)
        )
        installed = ROOT / "install" / package.name / "lib" / package.name / name
        assert installed.stat().st_mode & 0o111
        assert name in words(package, "README.md") & words(package, "CHANGELOG.rst")


@pytest.mark.parametrize("package", PACKAGES, ids=by_name)
def test_all_packages_carry_one_version(package):
    versions = {ElementTree.parse(path / "package.xml").findtext("version") for path in PACKAGES}
    assert len(versions) == 1
    if package in PYTHON_PACKAGES:
        assert importlib.import_module(package.name).__version__ in versions


HASHES = {
    "msg/GridMap": "343b0e72887541beda6b035cc053f2d6fffaad9d6dcb2773c15a808dfca31fde",
    "msg/GridMapInfo": "0a36d6b5bc9af8463d1d5a5008ef9fcac0c1373ba090f80c3594e47cc565b745",
    "srv/GetGridMap": "3ff0927db3d7a2ccf9d619e2332e7a5e0114c336219cd991230beb09bd661273",
    "srv/GetGridMapInfo": "fc6dea3589dd11355399dd457473495665118eaf78d6124905b42b309480c423",
    "srv/ProcessFile": "58adbbe82a3148c0620c86ab4685c3557e1e2e6101c6575061549b7d10b4c875",
    "srv/SetGridMap": "4d47ec2cbb19fa8e05809708a85a6189a826891c8643e447366fff4936404f5f",
}
"""Those of the messages are from bags that C++ nodes recorded; a hash covers all fields."""


@pytest.mark.parametrize("name", HASHES)
def test_types_have_the_hashes_of_the_released_package(name):
    path = ROOT / f"install/grid_map_msgs/share/grid_map_msgs/{name}.json"
    found = {
        entry["type_name"]: entry["hash_string"]
        for entry in json.loads(path.read_text())["type_hashes"]
    }
    assert found[f"grid_map_msgs/{name}"] == f"RIHS01_{HASHES[name]}"


def test_package_of_messages_gives_way_to_an_installed_one(tmp_path):
    config = tmp_path / "ros/share/grid_map_msgs/cmake/grid_map_msgsConfig.cmake"
    config.parent.mkdir(parents=True)
    config.touch()
    build, prefix = tmp_path / "build", tmp_path / "install"
    source = ("-S", ROOT / "grid_map_msgs", f"-DCMAKE_INSTALL_PREFIX={prefix}")
    environ = {**os.environ, "CMAKE_PREFIX_PATH": str(tmp_path / "ros")}
    configured = run("cmake", *source, "-B", build, environ=environ)
    assert f"Use grid_map_msgs from {config.parent}" in configured.stdout
    assert run("cmake", "--install", build, environ=environ).returncode == 0
    assert not prefix.exists()


PLACE = "frame_id: string, position_x: double, position_y: double"


@pytest.mark.parametrize(
    ("message", "fields"),
    [
        (
            GetGridMap.Request,
            f"{PLACE}, length_x: double, length_y: double, layers: sequence<string>",
        ),
        (GetGridMap.Response, "map: grid_map_msgs/GridMap"),
        (GetGridMapInfo.Response, "info: grid_map_msgs/GridMapInfo"),
        (SetGridMap.Request, "map: grid_map_msgs/GridMap"),
        (ProcessFile.Request, "file_path: string, topic_name: string"),
        (ProcessFile.Response, "success: boolean"),
    ],
)
def test_services_have_the_fields_of_cpp_in_order(message, fields):
    found = message.get_fields_and_field_types()
    assert ", ".join(f"{name}: {kind}" for name, kind in found.items()) == fields


def test_apt_packages_are_of_the_sourced_distribution(monkeypatch):
    monkeypatch.setattr(_packages, "_DISTRIBUTION", "kilted")
    assert _packages.remedy_for("nav2_msgs.msg").startswith("apt install ros-kilted-nav2-msgs")
    pages = [*ROOT.glob("*.md"), *ROOT.glob("docs/**/*.md"), *ROOT.glob("grid_map_*/*.md")]
    code = [*ROOT.glob("tools/*.py"), *ROOT.glob("grid_map_*_py/grid_map_*_py/**/*.py")]
    assert len(pages) > 20
    assert len(code) > 100
    assert [path for path in pages + code if "ros-jazzy-" in path.read_text()] == []


# --- README and CHANGELOG -------------------------------------------------------------------------


@pytest.mark.parametrize("package", PACKAGES, ids=by_name)
def test_changelog_has_the_form_that_release_tools_read(package):
    text = (package / "CHANGELOG.rst").read_text()
    first, title, last, _, *lines = text.splitlines()
    assert title == f"Changelog for package {package.name}"
    assert first == last == "^" * len(title)
    sections = re.split(r"^(.+)\n(-+)\n", "\n".join(lines), flags=re.MULTILINE)[1:]
    headings, underlines, items = sections[0::3], sections[1::3], sections[2::3]
    # After a release, the first section is that of the release.
    released = headings[headings[0] == "Forthcoming" :]
    assert all(re.fullmatch(r"\d+\.\d+\.\d+ \(\d{4}-\d\d-\d\d\)", each) for each in released)
    assert [len(each) for each in headings] == [len(each) for each in underlines]
    assert all(re.fullmatch(r"\* .+\n((\* |  ).+\n?)*", each.rstrip() + "\n") for each in items)


def test_pages_of_packages_list_messages_filters_and_visualizations():
    interfaces, filters, visualizations = (
        next(path for path in PACKAGES if path.name == name)
        for name in ("grid_map_msgs", "grid_map_filters_py", "grid_map_visualization_py")
    )
    names = {path.stem for folder in ("msg", "srv") for path in (interfaces / folder).iterdir()}
    assert len(names) == 6
    assert names <= words(interfaces, "README.md") & words(interfaces, "CHANGELOG.rst")
    short = {name.partition("/")[2].removesuffix("Filter") for name in FILTERS}
    assert short - words(filters, "CHANGELOG.rst") == set()
    assert VISUALIZATIONS.keys() - words(visualizations, "CHANGELOG.rst") == set()


@pytest.mark.parametrize("package", LIBRARIES, ids=by_name)
def test_readme_and_architecture_name_every_subpackage(package):
    paths = [path for path in (package / package.name).iterdir() if path.stem[0].isalpha()]
    public = {path.stem for path in paths if path.suffix in ("", ".py")}
    assert len(public) > 2
    assert public - words(package, "README.md") == set()
    section = page("docs/architecture.md").section("The packages")
    described = section.partition(f"\n{package.name} ")[2].partition("\n\n")[0]
    subpackages = {path.name for path in paths if path.is_dir()}
    assert subpackages - {*re.findall(r"\w+", described)} == set()


# --- tests beside ROS -----------------------------------------------------------------------------

STAND_IN = """
from _pytest.pathlib import import_path

def pytest_pycollect_makemodule(module_path, parent):
    import_path(module_path, root=parent.config.rootpath)
"""
"""Plug-in that imports the modules of tests while it collects, as launch_testing of ROS does."""

NO_KEYS = {
    *("argcomplete", "imageio_ffmpeg", "ipykernel", "mcap", "nbclient", "nbformat", "playwright"),
    *("pypcd4", "rasterio", "rerun_notebook", "rosbags", "trimesh"),
}

WITHOUT_KEYS = NO_KEYS | TILED
"""Modules that rosdep does not know, so that a machine with ROS lacks them."""

HIDE = """
from functools import partial
from importlib.machinery import PathFinder

find_spec = PathFinder.find_spec

def find(name, path=None, target=None):
    return None if name.partition(".")[0] in {hidden} else find_spec(name, path, target)

PathFinder.find_spec = partial(find)  # which pytest cannot bind
"""


def run_tests(package: Path, folder: Path, hidden: set[str], *words: str) -> CompletedProcess[str]:
    """Run pytest in the folder of a package with the stand-in, without the hidden modules."""
    (folder / "launch_testing_stand_in.py").write_text(STAND_IN)
    (folder / "sitecustomize.py").write_text(HIDE.format(hidden=sorted(hidden)))
    path = f"{folder}:{os.environ['PYTHONPATH']}"
    command = (sys.executable, "-m", "pytest", "-q", "-p", "launch_testing_stand_in", *words)
    return run(*command, environ={**environment(), "PYTHONPATH": path}, cwd=package)


@pytest.mark.parametrize("package", PYTHON_PACKAGES, ids=by_name)
def test_launch_testing_collects_tests_without_optional_modules(package, tmp_path):
    done = run_tests(package, tmp_path, OPTIONAL | WITHOUT_KEYS, "--collect-only")
    assert done.returncode == 0, done.stdout
    *tests, _, last = done.stdout.splitlines()
    assert re.fullmatch(rf"{len(tests)} tests collected in .*", last), last
    modules = {path.name for path in (package / "test").glob("test_*.py")}
    assert modules == {Path(test.partition("::")[0]).name for test in tests}


def test_tests_of_a_package_run_or_are_skipped_beside_ros(tmp_path):
    files = ("test/test_files.py", "test/test_costmap.py")
    done = run_tests(PYTHON_PACKAGES[0], tmp_path, WITHOUT_KEYS, *files)
    assert done.returncode == 0, done.stdout
    assert re.search(r"\n[1-9]\d* passed, [1-9]\d* skipped in", done.stdout), done.stdout


def test_one_line_says_that_hypothesis_is_missing(tmp_path):
    done = run_tests(PYTHON_PACKAGES[0], tmp_path, {"hypothesis"})
    assert (done.returncode, done.stdout) == (4, "")
    (line,) = done.stderr.strip().splitlines()
    assert "hypothesis, which is not installed: run `rosdep install" in line
