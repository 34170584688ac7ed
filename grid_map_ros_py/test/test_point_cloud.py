# SPDX-License-Identifier: BSD-3-Clause
import math
from typing import Any

import numpy as np
import pytest
from cpp_golden import assert_header, cases
from hypothesis import given
from sensor_msgs.msg import PointCloud2
from wire import over_the_wire

from grid_map_core_py import GridMap
from grid_map_core_py.testing import grid_maps, moved_in_buffer
from grid_map_ros_py import MessageError, to_flat_point_cloud, to_point_cloud


def names(cloud: PointCloud2) -> list[str]:
    return [field.name for field in cloud.fields]


def points(cloud: PointCloud2) -> np.ndarray:
    """Return the points, read by offset and step."""
    dtype = np.dtype(
        {
            "names": names(cloud),
            "formats": ["<f4"] * len(cloud.fields),
            "offsets": [field.offset for field in cloud.fields],
            "itemsize": cloud.point_step,
        }
    )
    return np.frombuffer(cloud.data, dtype)


@pytest.mark.parametrize(("grid_map", "case"), cases("to_point_cloud"))
def test_point_clouds_equal_cpp(grid_map: GridMap, case: dict[str, Any]) -> None:
    grid_map.basic_layers = case["basic_layers"]
    cloud = to_point_cloud(grid_map, case["point_layer"], case["layers"])
    expected = case["cloud"]
    assert_header(cloud.header, expected["header"])
    fields = [
        {n: getattr(f, n) for n in ("name", "offset", "datatype", "count")} for f in cloud.fields
    ]
    assert fields == expected["fields"]
    for name in ("height", "width", "is_bigendian", "point_step", "row_step", "is_dense"):
        assert getattr(cloud, name) == expected[name]
    assert bytes(cloud.data).hex() == expected["data_hex"]


def expected_points(grid_map: GridMap, layer: str) -> list[tuple[float, float, float]]:
    """Return the expected points, found by visiting every cell."""
    found = []
    for column in range(grid_map.size[1]):
        for row in range(grid_map.size[0]):
            z = grid_map[layer][row, column]
            basic_layers_hold = all(
                math.isfinite(grid_map[name][row, column]) for name in grid_map.basic_layers
            )
            if math.isfinite(z) and basic_layers_hold:
                found.append((*grid_map.get_position((row, column)), z))
    return found


@given(grid_maps(layers=("elevation", "variance")))
def test_every_valid_cell_is_a_point_and_no_other(grid_map: GridMap) -> None:
    cloud = over_the_wire(to_point_cloud(grid_map, "variance"))
    found = np.array([points(cloud)[axis] for axis in "xyz"]).T
    expected = np.array(expected_points(grid_map, "variance"), np.float32).reshape(-1, 3)
    np.testing.assert_array_equal(found, expected)
    assert (cloud.width, cloud.row_step) == (len(expected), 16 * len(expected))
    assert len(cloud.data) == cloud.row_step


@pytest.mark.parametrize("shape", [(130, 151), (9001, 2), (2, 9001)])
def test_every_valid_cell_of_a_large_map_is_a_point(shape: tuple[int, int]) -> None:
    random = np.random.default_rng(1)
    values, more = random.random((2, *shape), np.float32)
    values[random.random(shape) < 0.1] = np.nan
    layers = {"more": more, "elevation": values}
    grid_map = moved_in_buffer(GridMap(shape, 1.0, layers=layers), (1, 1))
    found = points(to_point_cloud(grid_map, "elevation"))
    known = np.isfinite(grid_map["elevation"].ravel("F"))
    x, y = grid_map.get_positions()[known].T
    for name, expected in {"x": x, "y": y}.items():
        np.testing.assert_array_equal(found[name], expected.astype(np.float32))
    for name, layer in {"z": "elevation", "more": "more"}.items():
        np.testing.assert_array_equal(found[name], grid_map[layer].ravel("F")[known])


@pytest.mark.parametrize(
    ("layers", "expected"),
    [
        (["variance"], {"x": 0.0, "y": 0.0, "z": 1.0, "variance": 2.0}),
        (["color", "elevation"], {"rgb": 3.0, "x": 0.0, "y": 0.0, "z": 1.0}),
        (["rgb", "elevation"], {"rgb": 4.0, "x": 0.0, "y": 0.0, "z": 1.0}),
        (["color", "rgb"], {"x": 0.0, "y": 0.0, "z": 1.0, "color": 3.0, "rgb": 4.0}),
    ],
)
def test_fields_are_those_of_the_layers(layers: list[str], expected: dict[str, float]) -> None:
    values = {"elevation": 1.0, "variance": 2.0, "color": 3.0, "rgb": 4.0}
    cloud = to_point_cloud(GridMap((1, 1), 1.0, layers=values), "elevation", layers)
    assert names(cloud) == [*expected]
    assert points(cloud).tolist() == [tuple(expected.values())]


def test_cells_that_are_not_valid_are_left_out() -> None:
    values = [[1.0, math.nan], [math.inf, 2.0]]
    grid_map = GridMap((2, 2), 1.0, layers={"elevation": values})
    assert points(to_flat_point_cloud(grid_map, 0.25))["z"].tolist() == [0.25] * 4
    assert grid_map.layers == ("elevation",)
    grid_map.basic_layers = ["elevation"]
    flat = to_flat_point_cloud(grid_map)
    assert (names(flat), points(flat)["elevation"].tolist()) == (["elevation", *"xyz"], [1.0, 2.0])
    grid_map["elevation"] = math.nan
    empty = to_point_cloud(grid_map, "elevation")
    assert (names(empty), empty.width, len(empty.data)) == ([*"xyz"], 0, 0)


@pytest.mark.parametrize("axis", ["x", "y", "z"])
def test_only_the_point_layer_may_be_called_like_a_coordinate(
    axis: str,
) -> None:
    grid_map = GridMap((1, 1), 1.0, layers={"elevation": 1.0, axis: 2.0})
    with pytest.raises(MessageError, match=f"fields: expected no layer called '{axis}'"):
        to_point_cloud(grid_map, "elevation")
    assert points(to_point_cloud(grid_map, axis))["z"].tolist() == [2.0]


@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize("height", [math.nan, -math.inf, 1e39])
def test_flat_cloud_needs_a_finite_height(height: float) -> None:
    with pytest.raises(MessageError, match="height: expected a finite number, got"):
        to_flat_point_cloud(GridMap((1, 1), 1.0), height)


@pytest.mark.filterwarnings("error")
def test_coordinates_beyond_float32_are_infinite() -> None:
    grid_map = GridMap((1.0, 1.0), 1.0, position=(1e60, 0.0), layers={"elevation": 2.0})
    cloud = points(to_point_cloud(grid_map, "elevation"))
    assert [cloud[axis].tolist() for axis in "xyz"] == [[math.inf], [0.0], [2.0]]
