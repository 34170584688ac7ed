# SPDX-License-Identifier: BSD-3-Clause
"""`GridMap.plot`, which another package draws."""

from importlib.metadata import EntryPoint, EntryPoints

import pytest

from grid_map_core_py import GridMap
from grid_map_core_py.errors import ConfigError, MissingPackageError
from grid_map_core_py.map import _plots


def draw(*given, **options):
    return given, options


@pytest.fixture
def style(monkeypatch) -> str:
    """The name of a style that another package offers."""
    point = EntryPoint("test", f"{__name__}:draw", "grid_map_core_py.plots")
    monkeypatch.setattr(_plots, "entry_points", EntryPoints([point]).select)
    return "test"


def test_another_package_draws_the_map(style):
    grid_map = GridMap((2.0, 1.0), 1.0, layers={"a": 0.0})
    given, options = grid_map.plot("a", "axes", style=style, color_map="gray")
    assert given[0] is grid_map
    assert (given[1:], options) == (("a", "axes"), {"color_map": "gray"})
    assert grid_map.plot(style=style)[0][1:] == ("", None)


@pytest.mark.needs("xarray", "dask")
def test_tiled_maps_and_datasets_are_drawn_too(style):
    from grid_map_core_py.tiled import TiledMap, open_map

    dataset = GridMap((2.0, 1.0), 1.0, layers={"a": 0.0}).to_xarray(crs="")
    site = open_map(dataset)
    assert site.plot("a", style=style)[0] == (site, "a", None)
    for kind in (dataset, dataset["a"], dataset.chunk()):
        drawn, *rest = kind.grid_map.plot("a", style=style)[0]
        assert isinstance(drawn, TiledMap)
        assert (drawn.layers, rest) == (("a",), ["a", None])


@pytest.mark.usefixtures("style")
def test_unknown_style_is_an_error_with_the_known_ones():
    with pytest.raises(ConfigError, match=r"'style': expected one of .*test.*, got 'tset'"):
        GridMap((2.0, 1.0), 1.0).plot(style="tset")


@pytest.mark.needs("grid_map_visualization_py", "matplotlib")
def test_unknown_option_is_an_error_with_a_similar_one():
    with pytest.raises(ConfigError, match=r"options: .*, got 'cmap'; did you mean color_map"):
        GridMap((2.0, 1.0), 1.0, layers={"a": 0.0}).plot(cmap="gray")


def test_missing_package_is_named(monkeypatch):
    monkeypatch.setattr(_plots, "entry_points", lambda **_: [])
    message = "plot needs the package 'grid_map_visualization_py', which is not installed: "
    with pytest.raises(MissingPackageError, match=message):
        GridMap((2.0, 1.0), 1.0).plot()
