# SPDX-License-Identifier: BSD-3-Clause
"""The traversability chain on a map that the C++ nodes recorded, and their result.

C++ squeezes the inpainted layer through 8 bits, and decides by rounding which cells exactly on the
edge of a disc belong to it. This library does neither (contracts 6 and 3). Each step is therefore
compared on C++'s own input, where all are equal; the inpainted and the smooth layer in steps of 8
bits; and the derived layers as far as the quantisation lets them.
"""

import itertools
from pathlib import Path

import numpy as np
import pytest
from scipy.ndimage import binary_dilation, correlate

from grid_map_core_py import GridMap
from grid_map_filters_py import FilterChain
from grid_map_filters_py.parts._disc import Disc

DATA = Path(__file__).parent / "data"
CHAIN = DATA / "traversability.yaml"


def recorded(name: str) -> GridMap:
    with np.load(DATA / "traversability.npz") as file:
        *length, resolution, x, y = file[f"{name}/geometry"]
        layers = [key for key in file if key.startswith(f"{name}/") and key != f"{name}/geometry"]
        values = {key.removeprefix(f"{name}/"): file[key] for key in layers}
    return GridMap(length, resolution, (x, y), values)


@pytest.fixture(scope="module")
def source() -> GridMap:
    return recorded("grid_map")


@pytest.fixture(scope="module")
def theirs() -> GridMap:
    return recorded("filtered_map")


@pytest.fixture(scope="module")
def ours(source) -> GridMap:
    return FilterChain.from_yaml(CHAIN)(source)


def difference(ours, theirs, layer) -> np.ndarray:
    """Return absolute differences in 8-bit steps of the range of the layer."""
    expected = theirs[layer]
    return np.abs(ours[layer] - expected) / (np.ptp(expected[np.isfinite(expected)]) / 255)


def test_chain_gives_the_recorded_layers(ours, theirs):
    assert ours.layers == theirs.layers
    assert ours.geometry == theirs.geometry
    assert (ours.frame_id, ours.timestamp) == (theirs.frame_id, theirs.timestamp)
    for layer in theirs:
        np.testing.assert_array_equal(np.isnan(ours[layer]), np.isnan(theirs[layer]))


def test_later_steps_equal_cpp_on_its_own_layers(theirs):
    layers = ("elevation", "elevation_inpainted", "elevation_smooth")
    given = theirs.without_layers(name for name in theirs if name not in layers)
    steps = FilterChain.from_yaml(CHAIN).steps
    assert steps[4].config.name == "surface_normals"
    result = FilterChain(steps[4:])(given)
    assert set(result.layers) == set(theirs.layers)
    for layer in theirs:
        span = np.nanmax(theirs[layer]) - np.nanmin(theirs[layer])
        np.testing.assert_allclose(result[layer], theirs[layer], rtol=0, atol=1e-5 * span)


def closest_mean(inpainted: GridMap, expected: np.ndarray) -> np.ndarray:
    """Return the smallest distance to a mean over a disc with any of the four edge cells.

    The radius of 0.06 m is three cells of 0.02 m: four centers are exactly on the edge.
    """
    heights = inpainted["elevation_inpainted"]
    offset, known = np.nanmean(heights, dtype=float), np.isfinite(heights)
    values = np.where(known, heights - offset, 0.0)
    kernel = Disc(0.06, inpainted.resolution, inpainted.size).kernel
    closest = np.full(inpainted.size, np.inf)
    for taken in itertools.product((0.0, 1.0), repeat=4):
        chosen = kernel.copy()
        for cell, weight in zip([(0, 3), (6, 3), (3, 0), (3, 6)], taken, strict=True):
            chosen[cell] = weight
        count = correlate(known.astype(float), chosen, mode="constant")
        mean = correlate(values, chosen, mode="constant") / count + offset
        closest = np.minimum(closest, np.abs(mean - expected))
    return closest


def test_mean_differs_from_cpp_only_on_the_rim(theirs):
    assert closest_mean(theirs, theirs["elevation_smooth"]).max() <= 1e-6


def test_smooth_layer_is_within_an_8_bit_step_outside_holes(source, ours, theirs):
    step = np.ptp(theirs["elevation_smooth"]) / 255
    disc = Disc(0.06, source.resolution, source.size)
    is_near_hole = binary_dilation(~np.isfinite(source["elevation"]), disc.kernel)
    assert (~is_near_hole).mean() > 0.3
    assert closest_mean(ours, theirs["elevation_smooth"])[~is_near_hole].max() <= step


def test_inpainted_layer_is_within_an_8_bit_step(source, ours, theirs):
    """In holes, C++ fills from quantized cells, so that errors of some steps add up.

    One or two cells from the border of the map OpenCV 5 fills otherwise than OpenCV 4.
    """
    holes = ~np.isfinite(source["elevation"])
    inner = np.zeros(source.size, dtype=bool)
    inner[2:-2, 2:-2] = True
    steps = difference(ours, theirs, "elevation_inpainted")
    assert holes.sum() == 589
    assert steps[~holes].max() <= 1.0
    assert (steps > 1.0).sum() <= 80
    assert steps[holes & inner].max() <= 11


@pytest.mark.parametrize(
    ("layer", "steps"),
    [
        ("elevation_smooth", 1.0),
        ("normal_vectors_x", 1.0),
        ("normal_vectors_y", 1.0),
        ("normal_vectors_z", 2.0),
        ("slope", 2.0),
        ("roughness", 2.0),
        ("edges", 2.0),
        ("traversability", 3.0),
    ],
)
def test_derived_layers_are_within_few_8_bit_steps(ours, theirs, layer, steps):
    difference_in_steps = difference(ours, theirs, layer)
    assert np.median(difference_in_steps) <= steps
    assert np.quantile(difference_in_steps, 0.9) <= 4 * steps
