# SPDX-License-Identifier: BSD-3-Clause
"""`load` and `save`, which choose the format by the name of a file."""

import sys
from importlib.metadata import EntryPoint
from pathlib import Path

import pytest
from command_line import a_map

from grid_map_core_py import GridMap, GridMapError, LayerNotFoundError, MissingPackageError
from grid_map_core_py.files import Format, _formats, load, save
from grid_map_core_py.files._formats import find_format, formats
from grid_map_core_py.testing import assert_maps_equal

pytestmark = pytest.mark.usefixtures("in_folder")


@pytest.mark.parametrize("name", ["a.npz", "A.NPZ"])
def test_map_round_trips_by_file_name(in_folder, name):
    save(a_map(), name)
    assert_maps_equal(load(name), a_map())
    one = load(in_folder / name, layers=["variance"])
    assert_maps_equal(one, a_map().without_layers(["elevation", "color"]))
    with pytest.raises(LayerNotFoundError, match="'none'; available: elevation, variance, color"):
        load(name, layers=["none"])


@pytest.mark.parametrize(
    ("name", "options", "expected"),
    [
        ("a.tif", {"crs": "EPSG:25832"}, "geotiff"),
        ("a.tif", {"bits": 32}, "height_image"),
        ("a.png", {}, "height_image"),
        ("a.yaml", {}, "map_server"),
    ],
)
def test_options_decide_between_formats_of_one_ending(name, options, expected):
    assert find_format(Path(name), options, writes=True).name == expected


@pytest.mark.parametrize(
    ("call", "error", "message"),
    [
        (lambda: load("none.npz"), GridMapError, "none.npz: cannot be read: No such file"),
        (lambda: load("a.doc"), GridMapError, "a.doc: expected a file or folder of one of"),
        (
            lambda: load("a.npz", tpic=1),
            GridMapError,
            r"tpic: expected an option .* npz \(layers\)",
        ),
        (lambda: save(a_map(), "a.pcd"), GridMapError, "a.pcd: expected a name of one of"),
        (lambda: save(a_map(), "a.npz", bits=8), GridMapError, r"bits: .* npz \(compress\)"),
        (lambda: save(a_map(), "a", format="pcd"), GridMapError, "expected one that is written"),
    ],
)
def test_unknown_name_is_one_error(call, error, message):
    Path("a.doc").write_text("text")
    save(a_map(), "a.npz")
    with pytest.raises(error, match=message):
        call()


@pytest.mark.parametrize(
    ("package", "call"),
    [
        ("trimesh", lambda: load("a.stl")),
        ("rasterio", lambda: save(a_map(), "a.tif")),
    ],
)
def test_package_that_a_format_lacks_is_named(package, call, monkeypatch):
    Path("a.stl").write_text("hello")
    monkeypatch.setitem(sys.modules, package, None)
    with pytest.raises(MissingPackageError, match=rf"a\..*pip install {package}"):
        call()


# --- formats of other packages --------------------------------------------------------------------


@pytest.fixture
def plug_in(monkeypatch):
    """Return a function that installs a package with formats."""

    def add(**entries: str) -> None:
        points = [EntryPoint(name, value, _formats.GROUP) for name, value in entries.items()]
        monkeypatch.setattr(_formats, "entry_points", lambda **_: points)
        formats.cache_clear()

    yield add
    monkeypatch.undo()
    formats.cache_clear()


def a_text(_: object, layers: object = None) -> GridMap:
    assert layers is None
    return a_map()


EXACT = Format(name="text", description="numbers", endings=(".txt",), load=a_text)


def test_broken_format_leaves_others_usable(plug_in):
    plug_in(broken="no_such_module:FORMAT", text=f"{__name__}:EXACT")
    with pytest.warns(UserWarning, match=r"format 'broken' of no_such_module:FORMAT: cannot be"):
        assert "text" in formats()
    Path("a.txt").write_text("1")
    assert load("a.txt") == a_map()
    save(a_map(), "a.npz")
    assert_maps_equal(load("a.npz"), a_map())


@pytest.mark.parametrize("name", ["a.mcap", "a.db3", "tree.bt", "bag"])
def test_a_format_of_a_missing_package_names_it(plug_in, name):
    plug_in()
    Path("bag").mkdir()
    Path("bag/metadata.yaml").write_text("rosbag2_bagfile_information: {}")
    with pytest.raises(
        MissingPackageError, match=f"{name}: a .* needs the package 'grid_map_ros_py'"
    ):
        load(name)
