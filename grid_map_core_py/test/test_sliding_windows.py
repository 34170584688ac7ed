# SPDX-License-Identifier: BSD-3-Clause
"""Windows around cells, one by one and all at once."""

import numpy as np
import pytest
from hypothesis import given, strategies as st

import golden
from grid_map_core_py import GeometryError, GridMap, GridMapError, LayerNotFoundError
from grid_map_core_py.regions import map_cells, sliding_windows, window_array
from grid_map_core_py.testing import grid_maps, moved_in_buffer

by_map = golden.by_map("iterators")
ALL_EDGES = ["inside", "crop", "empty", "mean"]
odd_sizes = st.sampled_from([1, 3, 5, 7, 15])


@by_map
def test_windows_equal_cpp(name, case):
    """C++ refuses moved maps (contract 3: works on any start index), and misses the border cells
    of windows that are set to one cell after they began as larger ones, with "inside".
    """
    grid_map = golden.to_map(golden.load("iterators")["maps"][name])
    moved = grid_map.start_index != (0, 0)
    compared = 0
    for window in case["sliding_window"]:
        edges, size = window["edge_handling"], window.get("window_size")
        if size is not None and size % 2 == 0:
            assert not window["ok"]
            with pytest.raises(GeometryError, match="window_size: expected an odd number"):
                sliding_windows(grid_map, "elevation", edges, size)
            compared += 1
            continue
        length = window.get("set_window_length")
        found = list(sliding_windows(grid_map, "elevation", edges, size, window_length=length))
        size = size or window.get("resulting_window_size")
        if moved or (length is not None and size == 1 and edges == "inside"):
            continue
        assert [list(index) for index, _ in found] == window["index"]
        for (_, values), expected in zip(found, window.get("data", []), strict="data" in window):
            np.testing.assert_allclose(values, np.array(expected, np.float32), rtol=1e-6)
        compared += 1
    assert compared >= (4 if moved else 28)


def windows_by_hand(grid_map, edges, size):
    """Oracle: look at the world cell by cell, in the order of the buffer."""
    world, half = grid_map.unwrapped("elevation"), size // 2
    around = np.pad(world, half, constant_values=np.nan)
    is_world = np.pad(np.ones(world.shape, bool), half)
    for index in golden.pairs(map_cells(grid_map)):
        row, column = ((np.array(index) - grid_map.start_index) % world.shape).tolist()
        part = slice(row, row + size), slice(column, column + size)
        window, seen = around[part].copy(), is_world[part]
        if edges == "inside" and not seen.all():
            continue
        if edges == "crop":
            window = window[seen.any(axis=1)][:, seen.any(axis=0)]
        finite = window[np.isfinite(window)].astype(np.float64)
        if edges == "mean" and finite.size:
            window[~seen] = finite.mean()
        yield tuple(index), window


@pytest.mark.parametrize("edges", ALL_EDGES)
@given(grid_map=grid_maps(max_side=6), size=st.sampled_from([1, 3, 5, 9]))
def test_windows_are_slices_of_the_world(edges, grid_map, size):
    found = list(sliding_windows(grid_map, "elevation", edges, size))
    expected = list(windows_by_hand(grid_map, edges, size))
    assert [index for index, _ in found] == [index for index, _ in expected]
    for (_, values), (_, wanted) in zip(found, expected, strict=True):
        assert values.dtype == np.float32
        # Values near 1000 that cancel out leave the rounding error of double precision.
        np.testing.assert_allclose(values, wanted, rtol=1e-6, atol=1e-9)


@pytest.mark.parametrize("edges", ["inside", "empty", "mean"])
@given(grid_map=grid_maps(max_side=8), size=odd_sizes)
def test_window_array_of_moved_map_equals_unmoved(edges, grid_map, size):
    # A length is rounded to cells, then made odd by adding one.
    length = max(size - 1.4, 0.4) * grid_map.resolution
    windows = window_array(grid_map, "elevation", edges, window_length=length)
    assert windows.dtype == np.float32
    one_by_one = list(sliding_windows(moved_in_buffer(grid_map, (0, 0)), "elevation", edges, size))
    assert windows.shape[0] * windows.shape[1] == len(one_by_one)
    for (row, column), window in one_by_one:
        margin = size // 2 if edges == "inside" else 0
        np.testing.assert_array_equal(windows[row - margin, column - margin], window)


def test_windows_are_read_only_snapshots_of_the_layer():
    grid_map = GridMap((0.3, 0.3), 0.1, layers={"elevation": 1.0})
    for edges in ALL_EDGES:
        grid_map["elevation"] = 1.0
        for index, window in sliding_windows(grid_map, "elevation", edges, 3):
            assert (window[np.isfinite(window)] == 1.0).all()
            grid_map["elevation"][index] = 5.0
            with pytest.raises(ValueError, match="read-only"):
                window[0, 0] = 0.0
    with pytest.raises(ValueError, match="read-only"):
        window_array(grid_map, "elevation", "mean", 3)[0, 0, 0, 0] = 0.0


@pytest.mark.parametrize("windows", [sliding_windows, window_array])
def test_wrong_arguments_are_refused_before_the_first_window(windows):
    grid_map = GridMap((0.8, 0.8), 0.1, layers=["elevation"])
    for size in (0, 2, -1, 2.5, "3"):
        with pytest.raises(GeometryError, match="window_size: expected an odd number of cells"):
            windows(grid_map, "elevation", "empty", size)
    for length in (0.0, -1.0, np.nan, np.inf):
        with pytest.raises(GeometryError, match="window_length: expected a length > 0"):
            windows(grid_map, "elevation", "empty", window_length=length)
    for both_or_none in ({}, {"window_size": 3, "window_length": 0.3}):
        with pytest.raises(GeometryError, match="window_size, window_length: expected one of them"):
            windows(grid_map, "elevation", "empty", **both_or_none)
    with pytest.raises(GridMapError, match=r"edge_handling: expected one of inside, .*'wrap'"):
        windows(grid_map, "elevation", "wrap", 3)
    with pytest.raises(LayerNotFoundError, match="elevtion"):
        windows(grid_map, "elevtion", "empty", 3)
    with pytest.raises(GridMapError, match="expected one of inside, empty, mean"):
        window_array(grid_map, "elevation", "crop", 3)
