# SPDX-License-Identifier: BSD-3-Clause
"""Maps in another frame."""

import itertools

import numpy as np
import pytest
from hypothesis import given, strategies as st

import golden
from grid_map_core_py import GeometryError, GridMap, GridMapError, LayerNotFoundError
from grid_map_core_py.testing import assert_maps_equal, grid_maps

GOLDEN = golden.load("transformed_map")
# Not 0.5: such points lie on cell borders, where rounding decides the cell.
RATIOS = st.sampled_from([0.0, 0.2, 0.25, 0.45, 1.3, -1.0])


def rigid(roll=0.0, pitch=0.0, yaw=0.0, translation=(0.0, 0.0, 0.0)):
    """Return a (4, 4) transform that turns about x, then y, then z [rad], then shifts [m]."""
    matrix = np.eye(4)
    for axes, angle in (((1, 2), roll), ((2, 0), pitch), ((0, 1), yaw)):
        turn = np.eye(4)
        cosine, sine = np.cos(angle), np.sin(angle)
        turn[np.ix_(axes, axes)] = [[cosine, -sine], [sine, cosine]]
        matrix = turn @ matrix
    matrix[:3, 3] = translation
    return matrix


YAW90 = [[0, -1, 0, 0], [1, 0, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]]
ANGLES = st.floats(-3.2, 3.2) | st.sampled_from([0.0, np.pi / 6, np.pi / 4, np.pi / 2, np.pi])
SHIFTS = st.floats(-20, 20)
TRANSFORMS = st.builds(rigid, ANGLES, ANGLES, ANGLES, st.tuples(SHIFTS, SHIFTS, SHIFTS))


@st.composite
def terrains(draw, layers=("elevation", "extra")):
    """Draw maps whose heights are small enough for slopes to stay above the footprint."""
    grid_map = draw(grid_maps(layers, max_side=8))
    # After rounding, the smallest factor makes all heights equal.
    grid_map["elevation"] *= draw(st.sampled_from([1e-30, 1e-4, 1e-3]))
    grid_map["elevation"] = np.round(grid_map["elevation"], 2)
    return grid_map


def footprint(grid_map, transform):
    """Return size and center of the smallest grid round the moved corners."""
    corners = [
        transform @ [*(grid_map.position + np.multiply(signs, grid_map.length) / 2), 0.0, 1.0]
        for signs in itertools.product((1, -1), repeat=2)
    ]
    lower, upper = np.min(corners, axis=0)[:2], np.max(corners, axis=0)[:2]
    cells = np.ceil((upper - lower - 1e-9) / grid_map.resolution).astype(int)
    return tuple(np.maximum(cells, 1).tolist()), (lower + upper) / 2


def naively_transformed(grid_map, transform, height_layer, frame_id, sample_ratio, geometry):
    """Return the map point by point; only the grid of the result is given."""
    result = GridMap.from_geometry(
        geometry,
        grid_map.layers,
        basic_layers=grid_map.basic_layers,
        frame_id=frame_id,
        timestamp=grid_map.timestamp,
    )
    step = sample_ratio * grid_map.resolution
    steps = [(0.0, 0.0)]
    if sample_ratio > 0:
        steps += [(-step, 0.0), (step, 0.0), (0.0, -step), (0.0, step)]
    unmoved = grid_map.with_start_index((0, 0))
    rows, columns = unmoved.size
    for index in ((i, j) for j in range(columns) for i in range(rows)):
        height = float(unmoved[height_layer][index])
        if not np.isfinite(height):
            continue
        center = unmoved.get_position(index)
        for dx, dy in steps:
            x, y, z = (
                (row[0] * (center[0] + dx) + row[1] * (center[1] + dy)) + (row[2] * height + row[3])
                for row in transform.tolist()[:3]
            )
            if not result.is_inside((x, y)):
                continue
            target = result.get_index((x, y))
            highest = result[height_layer][target]
            if np.isnan(highest) or np.float32(z) >= highest:
                for layer in grid_map:
                    result[layer][target] = unmoved[layer][index]
                result[height_layer][target] = z
    return result


def test_equals_cpp_where_it_covers_the_footprint():
    compared = checked = 0
    for case in GOLDEN["cases"]:
        grid_map, transform = golden.to_map(GOLDEN["maps"][case["map"]]), case["transform_4x4"]
        transform = np.array(transform, dtype=np.float64)
        arguments = transform, case["height_layer"], "new_frame", case["sample_ratio"]
        result, cpp = grid_map.get_transformed_map(*arguments), case["result"]
        size, center = footprint(grid_map, transform)
        if tuple(cpp["size"]) != size:
            # C++ rounds the number of cells down.
            expected = naively_transformed(grid_map, *arguments, result.geometry)
            assert_maps_equal(result, expected)
            assert result.size == size
            np.testing.assert_allclose(result.position, center, atol=1e-9)
            np.testing.assert_allclose(result.position, cpp["position"], atol=1e-9)
            checked += 1
        elif not case["undefined_behaviour"]:
            assert_maps_equal(result, golden.to_map(cpp), rtol=1e-6)
            assert result.start_index == (0, 0)
            compared += 1
    assert (compared, checked) == (23, 13)


@given(terrains(), TRANSFORMS, RATIOS)
def test_equals_a_loop_over_all_points(grid_map, transform, ratio):
    before = grid_map.copy()
    result = grid_map.get_transformed_map(transform, "elevation", "new", ratio)
    size, center = footprint(grid_map, transform)
    np.testing.assert_allclose(result.position, center, atol=1e-9)
    assert result.size == size
    expected = naively_transformed(grid_map, transform, "elevation", "new", ratio, result.geometry)
    assert_maps_equal(result, expected)
    assert_maps_equal(grid_map, before)
    assert grid_map.start_index == before.start_index


@pytest.mark.parametrize("size", [(40_000, 1), (1, 40_000), (2, 20_000), (200, 300)])
def test_maps_of_many_cells_are_complete_and_in_order(size):
    values = np.arange(np.prod(size)).reshape(size)
    grid_map = GridMap(size, 1.0, layers={"elevation": 0.0, "number": values})
    result = grid_map.get_transformed_map(rigid(translation=(0, 0, 5)), "elevation", "new")
    np.testing.assert_array_equal(result["number"], values)
    assert (result["elevation"] == 5).all()
    # Turned edge-on, all cells of a column fall into one cell; the highest one stays.
    edge = grid_map.get_transformed_map(rigid(pitch=np.pi / 2), "elevation", "new")
    assert edge.size == (1, size[1])
    lowest = grid_map.get_transformed_map(rigid(pitch=-np.pi / 2), "elevation", "new")
    np.testing.assert_array_equal(edge["number"][0], values[-1])
    np.testing.assert_array_equal(lowest["number"][0], values[0])


def test_far_from_the_origin_every_cell_finds_its_place():
    for shift in np.random.default_rng(1).uniform(4e6, 6e6, (20, 3)):
        grid_map = GridMap((4, 3), 0.1, layers={"elevation": 0.0, "number": np.ones((40, 30))})
        result = grid_map.get_transformed_map(rigid(translation=shift), "elevation", "utm")
        assert result.size == (40, 30)
        assert (result["number"] == 1).all()


def test_rounded_and_integer_transforms_are_taken():
    grid_map = GridMap((4, 2), 1.0, layers={"elevation": 1.0})
    rounded = np.round(rigid(yaw=0.7, pitch=0.1), 4).astype(np.float32)
    assert grid_map.get_transformed_map(rounded, "elevation", "new").size == (5, 5)
    assert grid_map.get_transformed_map(YAW90, "elevation", "new").size == (2, 4)


BAD_TRANSFORMS = {
    "three by four": (np.eye(4)[:3], r"expected \(4, 4\) finite numbers"),
    "text": ("identity", "transform: expected numbers, got 'identity'"),
    "ragged": ([[1, 0], [0]], "transform: expected numbers"),
    "complex": (np.eye(4) * (1 + 0j), "transform: expected numbers"),
    "NaN": (np.full((4, 4), np.nan), r"expected \(4, 4\) finite numbers"),
    "transposed": (rigid(translation=(1, 2, 3)).T, r"\(0, 0, 0, 1\) as the last row"),
    "scaled": (np.diag([2.0, 2.0, 2.0, 1.0]), "scales, shears or mirrors"),
    "mirrored": (np.diag([-1.0, 1.0, 1.0, 1.0]), "scales, shears or mirrors"),
}


@pytest.mark.parametrize(
    ("transform", "message"), BAD_TRANSFORMS.values(), ids=BAD_TRANSFORMS.keys()
)
def test_a_transform_that_is_not_rigid_is_refused(transform, message):
    grid_map = GridMap((4, 2), 1.0, layers=["elevation"])
    with pytest.raises(GeometryError, match=message):
        grid_map.get_transformed_map(transform, "elevation", "new")


def test_invalid_arguments_are_refused():
    grid_map = GridMap((4, 2), 1.0, layers=["elevation"])
    with pytest.raises(LayerNotFoundError, match="no layer 'height'; available: elevation"):
        grid_map.get_transformed_map(np.eye(4), "height", "new")
    with pytest.raises(GridMapError, match="frame_id: expected a string"):
        grid_map.get_transformed_map(np.eye(4), "elevation", 5)
    for ratio in (np.nan, np.inf, "much"):
        with pytest.raises(GeometryError, match="sample_ratio: expected a"):
            grid_map.get_transformed_map(np.eye(4), "elevation", "new", ratio)
