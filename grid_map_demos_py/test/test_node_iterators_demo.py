# SPDX-License-Identifier: BSD-3-Clause
"""The iterators demo: every region in turn, cell after cell."""

from functools import cache

import numpy as np
import pytest
from demos import parameters
from geometry_msgs.msg import PolygonStamped

from grid_map_core_py import Polygon
from grid_map_demos_py.iterators_demo_node import REGIONS, STAR, Step, make_map, show_everything
from grid_map_msgs.msg import GridMap as GridMapMessage
from grid_map_ros_py import from_message, from_polygon
from grid_map_ros_py.testing import peer, running_node

MODULE = "iterators_demo_node"
TITLES = [*REGIONS, "a sliding window"]


@cache
def scenes() -> dict[str, list[tuple[Step, np.ndarray]]]:
    """Return the steps by title, each with the layer at that step."""
    grid_map = make_map()
    found: dict[str, list[tuple[Step, np.ndarray]]] = {}
    for step in show_everything(grid_map):
        if step.title:
            scene = found[step.title] = []
        if found:
            scene.append((step, grid_map["type"].copy()))
    return found


def shown(title: str) -> np.ndarray:
    """Return a mask (rows, cols) of the region after its last step."""
    return scenes()[title][-1][1] == 1.0


def test_regions_are_shown_in_the_order_of_cpp():
    names = "the whole map, a submap, a circle, an ellipse, a spiral, a line, a polygon"
    assert [*scenes()] == [*names.split(", "), "a sliding window"]


@pytest.mark.parametrize("title", REGIONS)
def test_region_grows_cell_by_cell_from_an_empty_map(title):
    layers = [layer for _, layer in scenes()[title]]
    assert np.isnan(layers[0]).all()
    counts = [np.count_nonzero(layer == 1.0) for layer in layers]
    # After the last cell there is a pause.
    assert counts == [*range(len(counts) - 1), counts[-2]]
    for layer in layers:
        assert np.isnan(layer[layer != 1.0]).all()


def test_regions_have_the_cells_of_cpp():
    # The core compares the regions with C++ cell by cell.
    areas = [1.0, 12 * 7 / 400, np.pi * 0.4**2, np.pi * 0.225 * 0.45, np.pi * 0.4**2, 17 / 400]
    found = [np.count_nonzero(shown(title)) / 400 for title in REGIONS]
    assert found == pytest.approx([*areas, STAR.area], rel=0.03)
    rows, columns = np.nonzero(shown("a submap"))
    assert (rows.min(), rows.max(), columns.min(), columns.max()) == (3, 14, 5, 11)
    np.testing.assert_array_equal(shown("a spiral"), shown("a circle"))
    np.testing.assert_array_equal(shown("a polygon"), shown("a polygon")[:, ::-1])


def test_the_sliding_window_blurs_the_star():
    steps = scenes()["a sliding window"]
    np.testing.assert_array_equal(steps[0][1], shown("a polygon").astype(float))
    assert len(steps) == 1 + 400 + 1
    star = steps[0][1]
    expected = [
        [star[max(i - 1, 0) : i + 2, max(j - 1, 0) : j + 2].mean() for j in range(20)]
        for i in range(20)
    ]
    np.testing.assert_allclose(steps[-1][1], expected, rtol=1e-6)


def test_polygons_are_the_star_and_the_window_around_every_cell():
    assert [step.polygon for step, _ in scenes()["a polygon"]][:2] == [STAR, None]
    star, *windows, _ = [step.polygon for step, _ in scenes()["a sliding window"]]
    assert star == STAR
    centers = make_map().get_positions()
    np.testing.assert_allclose([window.centroid for window in windows], centers, atol=1e-9)
    np.testing.assert_allclose([window.area for window in windows], 0.15**2)


def test_iterators_demo_publishes_its_map_while_cells_are_added():
    with peer() as other:
        other.listen("/grid_map", GridMapMessage)
        with running_node(f"grid_map_demos_py.{MODULE}"):
            last = from_message(other.expect("/grid_map", 30))
    assert (last.layers, last.size, last.frame_id) == (("type",), (20, 20), "map")
    # Cells come column after column.
    filled = last["type"].ravel("F") == 1.0
    assert 0 < filled.sum() < 400
    assert filled[: filled.sum()].all()


def test_fast_demo_shows_all_regions_and_keeps_the_last_map():
    last_layer = scenes()["a sliding window"][-1][1]
    last_window = scenes()["a sliding window"][-2][0].polygon
    with peer() as other:
        maps = other.received.setdefault("/grid_map", [])
        polygons = other.received.setdefault("/polygon", [])
        other.listen("/grid_map", GridMapMessage)
        other.listen("/polygon", PolygonStamped)
        with running_node(f"grid_map_demos_py.{MODULE}", *parameters("speed:=20.0")) as demo:
            other.wait_until(lambda: TITLES[-1] in demo.text, "the last region")
            other.wait_until(
                lambda: maps and np.array_equal(from_message(maps[-1])["type"], last_layer),
                "the last map",
            )
            other.wait_until(
                lambda: polygons and is_same(from_polygon(polygons[-1]), last_window),
                "the window around the last cell",
            )
            shown = [line.partition("shows ")[2].strip() for line in demo.lines if "shows " in line]
    assert shown == TITLES
    assert polygons[-1].header.frame_id == "map"


def is_same(polygon: Polygon, expected: Polygon) -> bool:
    return len(polygon) == len(expected) and np.allclose(polygon.vertices, expected.vertices)


def test_repeated_iterators_demo_starts_again():
    given = parameters("speed:=1e4", "repeat:=true")
    with running_node(f"grid_map_demos_py.{MODULE}", *given) as demo, peer() as other:
        other.wait_until(lambda: demo.text.count(TITLES[0]) == 2, "a second round")
