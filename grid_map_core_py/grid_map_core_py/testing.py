# SPDX-License-Identifier: BSD-3-Clause
"""Assertions and `hypothesis` strategies for tests with maps.

Only the strategies need the package `hypothesis`.
"""

from typing import TYPE_CHECKING

import numpy as np

from .map._grid_map import GridMap

__all__ = [
    "assert_maps_equal",
    "grid_maps",
    "moved_in_buffer",
]

if TYPE_CHECKING:
    from hypothesis.strategies import SearchStrategy


def assert_maps_equal(
    actual: GridMap, expected: GridMap, *, rtol: float = 0.0, atol: float = 0.0
) -> None:
    """Assert that two maps have the same grid, frame, time, layers, basic layers and values.

    Values are compared in map order, so start indices may differ. NaN equals NaN.

    Args:
        rtol, atol: relative and absolute tolerance of the layer values.
    """
    for name in ("size", "frame_id", "timestamp", "layers", "basic_layers"):
        found, wanted = getattr(actual, name), getattr(expected, name)
        assert found == wanted, f"{name}: {found} instead of {wanted}"
    np.testing.assert_allclose(actual.resolution, expected.resolution, err_msg="resolution")
    np.testing.assert_allclose(
        actual.position, expected.position, rtol=1e-12, atol=1e-9, err_msg="position"
    )
    for layer in expected:
        np.testing.assert_allclose(
            actual.unwrapped(layer),
            expected.unwrapped(layer),
            rtol=rtol,
            atol=atol,
            err_msg=f"layer {layer!r}",
        )


def register_profiles() -> None:
    """Register the hypothesis profiles `grid_map` and `explore`, and activate `grid_map`.

    The profile `grid_map` runs the same examples every time. The profile `explore`, selected by
    `make explore`, runs more examples, and new ones every time.
    """
    from hypothesis import settings

    settings.register_profile("grid_map", deadline=None, derandomize=True, max_examples=40)
    settings.register_profile("explore", deadline=None, max_examples=1000)
    settings.load_profile("grid_map")


def moved_in_buffer(grid_map: GridMap, start_index: tuple[int, int]) -> GridMap:
    """Return an equal copy of a map with another start index, as if the map had been moved."""
    result = grid_map.copy()
    shift = np.subtract(start_index, grid_map.start_index)
    for layer in result:
        result[layer] = np.roll(result[layer], shift, axis=(0, 1))
    result.start_index = start_index
    return result


def grid_maps(
    layers: tuple[str, ...] = ("elevation",),
    max_side: int = 12,
    *,
    allow_nan: bool = True,
    allow_infinity: bool = True,
    allow_moved: bool = True,
) -> "SearchStrategy[GridMap]":
    """Return a `hypothesis` strategy that generates maps, also with one cell, NaN or infinities.

    Args:
        layers: names of the layers; the first one is sometimes a basic layer.
        max_side: largest number of cells along a side.
        allow_nan, allow_infinity: whether layers may contain NaN or infinities.
        allow_moved: whether the start index may differ from (0, 0).
    """
    from hypothesis import strategies as st
    from hypothesis.extra import numpy as arrays

    sides = st.integers(1, max_side)
    values = st.floats(-1e3, 1e3, width=32)
    if allow_nan:
        values |= st.just(np.nan)
    if allow_infinity:
        values |= st.sampled_from([np.inf, -np.inf])

    @st.composite
    def draw_map(draw: st.DrawFn) -> GridMap:
        size = draw(sides), draw(sides)
        resolution = draw(st.sampled_from([0.05, 0.1, 0.3, 1.0]))
        grid_map = GridMap(
            np.multiply(size, resolution),
            resolution,
            draw(st.tuples(st.floats(-50, 50), st.floats(-50, 50))),
            {name: draw(arrays.arrays(np.float32, size, elements=values)) for name in layers},
            basic_layers=layers[: draw(st.integers(0, 1))],
            frame_id=draw(st.sampled_from(["map", "odom", ""])),
            timestamp=draw(st.integers(0, 2**31 * 10**9 - 1)),
        )
        if allow_moved:
            grid_map.start_index = (
                draw(st.integers(0, size[0] - 1)),
                draw(st.integers(0, size[1] - 1)),
            )
        return grid_map

    return draw_map()
