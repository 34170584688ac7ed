# SPDX-License-Identifier: BSD-3-Clause
"""The packages install with pip and without ROS, and from wheels and source archives."""

import shutil
import subprocess
import tarfile
import zipfile
from email import message_from_string
from importlib.metadata import distribution
from pathlib import Path

import pytest
from catkin_pkg.package_version import update_versions
from catkin_pkg.packages import find_packages

from grid_map_core_py import load
from scratch import (
    BASE_PYTHON,
    PACKAGES,
    PYTHON_PACKAGES,
    ROOT,
    executables,
    fresh_environment,
    run,
)

pytestmark = pytest.mark.timeout(600)  # allows for downloads on a busy machine

NAMES = [package.name for package in PYTHON_PACKAGES]
LIBRARIES = {
    "grid_map_core_py": {"numpy", "opencv-python-headless", "PyYAML", "scipy"},
    "grid_map_filters_py": {"grid_map_core_py==1.0.0", "lark"},
    "grid_map_ros_py": {"grid_map_core_py==1.0.0", "mcap"},
    "grid_map_visualization_py": {"grid_map_ros_py==1.0.0"},
    "grid_map_demos_py": {
        "grid_map_filters_py==1.0.0",
        "grid_map_visualization_py[pictures]==1.0.0",
    },
}
WITHOUT_ROS = """
from grid_map_core_py import GridMap, circle_cells, conversions, load, save
from grid_map_core_py.elevation import RollingMap
from numpy import uint8
grid_map = GridMap((1.0, 1.0), 0.1, layers={"elevation": 1.0})
grid_map["elevation"][circle_cells(grid_map, (0.0, 0.0), 0.2)] = 2.0
save(grid_map, "map.npz")
assert load("map.npz") == grid_map
assert conversions.to_image(grid_map, "elevation", uint8).max() == 255
from grid_map_filters_py import FILTERS, Expression, FilterChain
assert Expression("2 + 3")({}) == 5
import grid_map_ros_py as ros
for storage in ("mcap", "sqlite3"):
    ros.save_to_bag(grid_map, storage, "/map", storage=storage)
    assert ros.load_from_bag(storage) == grid_map
assert ros.from_serialized_message(ros.to_serialized_message(grid_map)) == grid_map
try:
    ros.to_message(grid_map)
except ros.MissingPackageError as error:
    assert "std_msgs" in str(error)
from grid_map_visualization_py import colors, surface
from grid_map_visualization_py.pictures import save_picture
for style in ("flat", "surface", "relief"):
    save_picture(grid_map, "elevation", "map.png", style=style)
from grid_map_demos_py.iterator_benchmark import main
"""
"""Program for the second column of the table in docs/installation.md."""


def files_in(folder: Path) -> set[Path]:
    """Return all files of the packages but those that tests running at the same time may write."""
    every = {path for package in PYTHON_PACKAGES for path in (folder / package.name).rglob("*")}
    transient = ("test", "__pycache__", ".hypothesis", ".pytest_cache")
    return {path for path in every if not {*transient} & {*path.relative_to(folder).parts[1:]}}


def site_packages(venv: Path) -> Path:
    (path,) = venv.glob("lib/python*/site-packages")
    return path


def pip(venv: Path, *arguments: str | Path) -> None:
    # Without byte code, because these programs import only a small part of the libraries.
    command = (venv / "bin/python", "-m", "pip", "install", "-q", "--no-compile", *arguments)
    done = run(*command, environ=fresh_environment())
    assert done.returncode == 0, done.stderr


def environment_with(folder: Path, *names: str, base: Path | None = None) -> Path:
    """Make an environment with packages installed with pip from this clone, without ROS.

    It also has what the environment `base` has, pip included.
    """
    options = ["--without-pip"] if base else []
    run(BASE_PYTHON, "-m", "venv", *options, folder, environ=fresh_environment())
    if base is not None:
        (site_packages(folder) / "base.pth").write_text(f"{site_packages(base)}\n")
    before = files_in(ROOT)
    pip(folder, *(f"./{name}" for name in names))
    assert files_in(ROOT) == before
    return folder


@pytest.fixture(scope="module")
def venv(tmp_path_factory) -> Path:
    """An environment with core and filters."""
    folder = tmp_path_factory.mktemp("packaging") / "venv"
    return environment_with(folder, "grid_map_core_py", "grid_map_filters_py")


@pytest.fixture(scope="module")
def everything(venv) -> Path:
    """An environment with all packages."""
    return environment_with(venv.with_name("everything"), *NAMES, base=venv)


@pytest.fixture(scope="module")
def archives(venv) -> Path:
    """A folder with source archives and wheels of a release, whose version `bloom` would set."""
    pip(venv, "build", "setuptools>=77", "twine", "wheel")
    folder, sources = venv.with_name("archives"), venv.with_name("sources")
    for package in PACKAGES:
        shutil.copytree(package, sources / package.name)
    release = find_packages(sources)
    update_versions({sources / path: found for path, found in release.items()}, "1.0.0")
    before = files_in(sources)
    for package in PYTHON_PACKAGES:
        command = (venv / "bin/python", "-m", "build", "--no-isolation", "--outdir", folder)
        done = run(*command, sources / package.name, environ=fresh_environment())
        assert done.returncode == 0, done.stderr
    assert files_in(sources) == before
    return folder


def libraries(requirements: list[str]) -> set[str]:
    """Return the names of the requirements outside of extras."""
    always = [text for text in requirements if "extra ==" not in text]
    return {text.split(">")[0] for text in always}


COMMANDS = """
    info site.npz
    inspect site.npz
    convert site.npz site.png --layer elevation
    convert site.npz nav2.yaml --layer elevation --mode raw
    filter chain.yaml site.npz filtered.npz
    doctor
"""

CHAIN = """
filters:
  - name: twice
    type: gridMapFilters/MathExpressionFilter
    params: {expression: 2 * elevation, output_layer: double}
"""

SAVE_SITE = """
from grid_map_core_py import GridMap, save
save(GridMap((1.0, 1.0), 0.1, layers={"elevation": 1.0}), "site.npz")
"""


def grid_map(environment: Path, folder: Path, *words: str) -> subprocess.CompletedProcess[str]:
    command = (environment / "bin/grid-map", *words)
    return run(*command, environ=fresh_environment(), cwd=folder)


@pytest.fixture
def site(venv, tmp_path) -> Path:
    """A folder with the file of a map."""
    run(venv / "bin/python", "-c", SAVE_SITE, environ=fresh_environment(), cwd=tmp_path)
    return tmp_path


def test_grid_map_has_the_commands_of_installed_packages(venv, site):
    (site / "chain.yaml").write_text(CHAIN)
    for line in COMMANDS.strip().splitlines():
        done = grid_map(venv, site, *line.split())
        assert done.returncode == 0, done.stderr
    assert (load(site / "filtered.npz")["double"] == 2.0).all()
    listed = grid_map(venv, site, "--help").stdout
    assert "    filter " in listed
    assert "    plot " not in listed
    done = grid_map(venv, site, "info", "survey.mcap")
    assert done.returncode == 1
    assert "a bag needs the package 'grid_map_ros_py', which is not installed" in done.stderr


def test_grid_map_reads_bags_and_draws_without_ros(everything, site):
    for line in ("convert site.npz survey", "info survey", "plot survey map.png"):
        done = grid_map(everything, site, *line.split())
        assert done.returncode == 0, done.stderr
    assert {"survey", "map.png"} <= {path.name for path in site.iterdir()}


def test_packages_work_without_ros_after_pip_install(everything, tmp_path):
    command = (everything / "bin/python", "-c", WITHOUT_ROS)
    done = run(*command, environ=fresh_environment(), cwd=tmp_path)
    assert done.returncode == 0, done.stderr


@pytest.mark.parametrize("name", NAMES)
def test_archives_describe_the_package_with_licence_and_types(archives, name):
    (path,) = archives.glob(f"{name}-*.whl")
    with zipfile.ZipFile(path) as wheel:
        files = wheel.namelist()
        text = wheel.read(f"{name}-1.0.0.dist-info/METADATA").decode()
    assert f"{name}/py.typed" in files
    assert any(path.endswith("/LICENSE") for path in files)
    described = message_from_string(text)
    assert described["License-Expression"] == "BSD-3-Clause"
    is_library = name in ("grid_map_core_py", "grid_map_filters_py")
    assert described["Requires-Python"] == (">=3.10" if is_library else ">=3.11")
    assert described["Description-Content-Type"] == "text/markdown"
    assert described.get_payload().startswith(f"# {name}\n")
    assert any("Documentation, https://" in url for url in described.get_all("Project-URL"))
    assert "](../" not in described.get_payload()
    assert libraries(described.get_all("Requires-Dist")) == LIBRARIES[name]
    (source,) = archives.glob(f"{name}-*.tar.gz")
    with tarfile.open(source) as archive:
        licence = archive.extractfile(f"{name}-1.0.0/LICENSE").read()
    assert licence == (ROOT / "LICENSE").read_bytes()


def test_archives_are_fit_for_the_index(archives, venv):
    files = sorted(archives.iterdir())
    done = run(venv / "bin/twine", "check", "--strict", *files, environ=fresh_environment())
    assert done.returncode == 0, done.stdout


def test_pip_puts_only_the_command_line_on_the_path(everything):
    nodes = {script for name in NAMES for script in executables(name)}
    assert nodes & {path.name for path in (everything / "bin").iterdir()} == set()


@pytest.mark.parametrize("name", NAMES)
def test_colcon_build_leaves_libraries_to_rosdep(name):
    """apt does not know the names of PyPI, and scripts that check requirements would not start."""
    assert libraries(distribution(name).requires or []) == set()
