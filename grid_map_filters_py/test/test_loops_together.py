# SPDX-License-Identifier: BSD-3-Clause
"""All compiled loops in one process: none reads the constants of another."""

import copy
import math
import sys

import numpy as np
import pytest

import grid_map_filters_py.builtin  # noqa: F401  imports all modules with cell functions
from grid_map_core_py._loops import Loop, loop
from grid_map_core_py.conversions import _point_loops as point_loops
from grid_map_core_py.elevation import (
    _clusters as clusters,
    _order as order,
    _visibility as visibility,
)
from grid_map_core_py.simulation import _ray_loops as ray_loops
from grid_map_filters_py._shared import inpaint_loop, median_loops, plane_loops
from grid_map_filters_py._shared.medians import _comparators, _sorted_keys
from grid_map_filters_py.expression import _window_loops as window_loops
from grid_map_filters_py.parts import CellFunction

pytestmark = pytest.mark.needs("numba")

COUNT, CELLS = 50, 9
RANDOM = np.random.default_rng(1)
NUMBERS = RANDOM.permutation(np.repeat([0.0, -0.0, np.nan, np.inf, -np.inf, 0.5, -0.5, 1, 2, 3], 5))
PLACES = np.sort(RANDOM.integers(0, CELLS, COUNT))
OCCUPIED, FIRSTS = np.unique(PLACES, return_index=True)
POINTS = RANDOM.uniform(-2, 2, 3 * COUNT)
POINTS[:20] = [-1, 1, 0, 1, -1, 0, 1, 1, 0.5, -1, -1, np.nan, 0, 0, 5, 0.3, 0.3, np.inf, 0, 0]
FRAME = (3, 1), COUNT, (1.0, 1.0, 0.0, 0.0, -0.5, 1e-9), (4, 4), (-1.5, 1.5)


# Points in discs, of which some are empty, have a single point, or lie in a plane.
MANY = 300
COORDINATES = RANDOM.integers(-3, 4, (3, MANY, 8)) * (RANDOM.random(MANY) < 0.8)[:, None]
MOMENTS = tuple(
    np.sum(COORDINATES[i] * COORDINATES[j], axis=1, dtype=float)
    for i in range(3)
    for j in range(i, 3)
)
SUMS = RANDOM.integers(0, 9, MANY).astype(float), *COORDINATES.sum(axis=2, dtype=float)
SPECTRUM = tuple(RANDOM.random((3, MANY)))
FLAGS = RANDOM.integers(0, 2, MANY, np.uint8), np.zeros(MANY, np.uint8)
ROOTS, WORK = RANDOM.uniform(-1, 1, MANY).astype(np.float32), plane_loops.work_memory()


# Points of a scan, sorted by cell and downwards.
ENDS = np.append(FIRSTS[1:], COUNT)
SCANNED = RANDOM.integers(-9, 9, COUNT) / 4
SCANNED = SCANNED[np.lexsort((-SCANNED, PLACES))]

# Beams over 8 x 6 cells of 0.5 m, from a sensor 1 m above row 3.2 and column 1.7.
VIEW = (3.2, 1.7, 1.0, 0.5, 0.1, 5.0), (8, 6)
BEAMS = RANDOM.uniform(-3, 3, (3, MANY))
PARTS = visibility.SECTORS * visibility.RINGS

# Beams over 7 x 9 heights, and where each begins and ends.
RAYS = np.vstack([RANDOM.uniform(0, [[6], [8], [2]], (3, MANY)), RANDOM.uniform(-1, 1, (3, MANY))])
SPANS = np.repeat([[0.0], [20.0]], MANY, axis=1)


# Windows of 3 x 3 in 7 x 9 values.
WINDOWS, HEIGHTS = (9, 5, 3), RANDOM.normal(size=63).astype(np.float32)
RANKS, KEYS = RANDOM.integers(0, 9, 35, np.int32), _sorted_keys(HEIGHTS)
PAIRS = np.array([*_comparators(9)], np.int32).ravel()


# 9 x 7 heights with holes in a frame of one cell, and the disc of that radius.
IMAGES = np.zeros((4, 11, 9), np.float32)
IMAGES[0, 1:-1, 1:-1] = NUMBERS[:49].reshape(7, 7)[np.arange(9) % 7] + np.arange(7)
DISC = np.array([[0, -1, 0, 1, 0], [-1, 0, 0, 0, 1], [1, 1, 0, 1, 1], [0.5, 0.5, 1, 0.5, 0.5]])


def integers(*shape):
    return np.zeros(shape, np.int64)


def add_constants(constants):
    @loop("float64*", "int64")
    def add(values, count):
        for i in range(count):
            values[i] = (values[i] + constants[0]) * constants[1] / constants[2]

    return add


@loop("float64*", "int64")
def call_library(values, count):
    for i in range(count):
        values[i] = math.atan(values[i])


OWN = [call_library, *(add_constants((0.25 + i, 1.5 * i, 7.0 + i)) for i in range(4))]

ARGUMENTS = {
    **{
        made: (POINTS.astype(dtype), *FRAME, integers(COUNT), integers(1))
        for dtype, made in point_loops.FIND.items()
    },
    point_loops.keep_found: (RANDOM.integers(-2, 5, COUNT), COUNT, integers(COUNT), integers(1)),
    point_loops.keep_largest: (PLACES, NUMBERS, COUNT, np.full(CELLS, np.nan, np.float32)),
    point_loops.keep_smallest: (PLACES, NUMBERS, COUNT, np.full(CELLS, np.nan, np.float32)),
    point_loops.add_up: (PLACES, NUMBERS, COUNT, np.zeros(CELLS), np.zeros(CELLS, np.int32)),
    point_loops.make_keys: (
        PLACES,
        NUMBERS.astype(np.float32).view(np.uint32),
        COUNT,
        np.zeros(COUNT, np.uint64),
        np.zeros(CELLS, np.int32),
    ),
    point_loops.middles: (
        RANDOM.permutation(PLACES.astype(np.uint64) << 32 | RANDOM.integers(0, 99, COUNT, "u8")),
        COUNT,
        FIRSTS[np.searchsorted(OCCUPIED, np.arange(CELLS)).clip(max=len(OCCUPIED) - 1)],
        len(OCCUPIED),
        np.append(FIRSTS[1:], COUNT),
        *np.zeros((3, COUNT), np.uint32),
    ),
    # A tile of 3 x 4 cells and a margin of one, padded with two.
    plane_loops.sum_heights: (
        RANDOM.normal(size=32),
        (1, 1),
        (4, 5),
        np.array([1, 0]),
        tuple(np.zeros((4, 20))),
        tuple(np.zeros((3, 7))),
    ),
    order.deal: (
        RANDOM.permutation(PLACES),
        SCANNED,
        RANDOM.integers(1, 3, COUNT) / 8,
        COUNT,
        CELLS,
        integers(CELLS + 1),
        integers(COUNT),
        *np.zeros((2, COUNT)),
    ),
    clusters.grow_clusters: (
        FIRSTS,
        ENDS,
        len(OCCUPIED),
        SCANNED,
        RANDOM.uniform(0.01, 0.1, COUNT),
        (2.5, 0.3),
        integers(COUNT),
        *np.zeros((3, COUNT)),
    ),
    visibility.cover: (
        np.arange(48),
        RANDOM.uniform(-1, 1, 48),
        48,
        *VIEW,
        np.full(PARTS, -np.inf),
    ),
    visibility.trace: (
        *BEAMS,
        MANY,
        *VIEW,
        RANDOM.uniform(-1, 1, PARTS),
        RANDOM.uniform(-1, 1, 48),
        RANDOM.permutation(48),
        RANDOM.uniform(-2, 0, 48),
        RANDOM.uniform(-1, 1, 144),
        RANDOM.uniform(-3, 0, 48),
        np.full(48, np.inf),
        np.zeros(48, np.uint8),
    ),
    ray_loops.one_by_one: (HEIGHTS, 7, 9, RAYS.ravel(), SPANS.ravel(), MANY, np.zeros(MANY)),
    plane_loops.to_cosines: (MOMENTS, SUMS, SPECTRUM, MANY, WORK),
    plane_loops.to_normals: (
        MOMENTS,
        (SUMS[0], *SPECTRUM),
        ROOTS,
        *FLAGS,
        1e-3,
        tuple(np.zeros((3, MANY))),
        MANY,
        WORK,
    ),
    median_loops.sort_by_network: (
        HEIGHTS,
        *WINDOWS,
        RANKS,
        PAIRS,
        PAIRS.size // 2,
        np.zeros(9 * median_loops.LANES, np.float32),
        np.zeros(35, np.float32),
    ),
    median_loops.slide_sets: (
        KEYS,
        *WINDOWS,
        RANKS,
        np.zeros(63, np.int32),
        HEIGHTS[KEYS & np.uint64(63)],
        np.zeros(1, np.uint64),
        np.zeros(35, np.float32),
    ),
    inpaint_loop.inpaint: (
        tuple(IMAGES.reshape(4, -1)),
        (9, 7, 1),
        (-1.0, 30.0),
        tuple(np.vstack([DISC, np.zeros(5)]).astype(np.float32)),
        np.array([-9, -1, 0, 1, 9]),
        5,
        tuple(integers(2, 63)),
        np.ones(63, np.uint8),
        np.zeros(63, np.float32),
    ),
    window_loops.sum_squares: (
        NUMBERS[:49],
        (3, 3),
        (5, 5),
        NUMBERS[:25],
        *np.zeros((3, 35)),
        np.zeros(25),
    ),
    **dict.fromkeys(OWN, (NUMBERS, COUNT)),
}
"""Arguments by loop."""


def all_of(kind):
    """Return the values of a type in the modules of core and filters, and in their tables."""
    names = [name for name in sys.modules if name.startswith(("grid_map_core", "grid_map_filters"))]
    values = [value for name in names for value in vars(sys.modules[name]).values()]
    values += [item for value in values if isinstance(value, dict) for item in value.values()]
    return list({id(value): value for value in values if isinstance(value, kind)}.values())


@pytest.fixture(scope="module")
def loaded():
    """Cell functions and other loops, after all of them were loaded."""
    functions, loops = all_of(CellFunction), [*OWN, *all_of(Loop)]
    for made in (*loops, *(function._loop for function in functions)):
        assert made.compiled(always=True)
    assert len(functions) >= 8
    return functions, loops


def test_loops_together_equal_python(loaded):
    for made in loaded[1]:
        expected, found = (copy.deepcopy(ARGUMENTS[made]) for _ in range(2))
        with np.errstate(all="ignore"):
            made.function(*expected)
        made.compiled()(*found)
        for one, other in zip(expected, found, strict=True):
            np.testing.assert_array_equal(one, other, made.function.__name__)


def test_cell_functions_together_equal_numpy(loaded):
    for function in loaded[0]:
        colors = RANDOM.integers(0, 1 << 24, (function.layers, COUNT), np.uint32)
        layers = [np.roll(NUMBERS, i).astype(np.float32) for i in range(function.layers)]
        if function.takes == np.uint32:
            layers = [color.view(np.float32) for color in colors]
        numbers = tuple(np.linspace(0.1, 0.9, function.numbers, dtype=np.float32))
        taken = [layer.view(function.takes) for layer in layers]
        expected = function.plain(taken, numbers).view(np.float32)
        np.testing.assert_array_equal(function(layers, numbers), expected, str(function))
