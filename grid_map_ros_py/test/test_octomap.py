# SPDX-License-Identifier: BSD-3-Clause
import gzip
import itertools
import json
import math
import struct
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import assume, given, settings, strategies as st
from octomap_stand_in import Octomap, message, write_binary, write_full

from conftest import peak_memory
from grid_map_core_py import GridMap, GridMapError, LimitError
from grid_map_ros_py import MessageError, from_octomap, octomap_to_points

RECORDED = Path(__file__).parent / "data" / "octomaps.json.gz"
CASES = json.loads(gzip.decompress(RECORDED.read_bytes()))["cases"]
FORMS = [(case, form) for case in CASES for form in ("binary", "full")]
NAN = math.nan

Voxel = tuple[int, int, int]


def read(case: dict[str, Any], form: str) -> Octomap:
    about = {"id": case["id"], "resolution": case["resolution"], "binary": form == "binary"}
    return message(bytes.fromhex(case[form]), **about)


def voxels_of(leaf: list[float], resolution: float) -> list[Voxel]:
    """Return the voxels of a leaf x, y, z, side, counted from the origin."""
    *center, side, _ = leaf
    first = [round((c - side / 2) / resolution) for c in center]
    return list(itertools.product(*(range(f, f + round(side / resolution)) for f in first)))


def voxels(leaves: list[list[float]], resolution: float, *, occupied: bool) -> set[Voxel]:
    chosen = (leaf for leaf in leaves if leaf[-1] or not occupied)
    return {voxel for leaf in chosen for voxel in voxels_of(leaf, resolution)}


def to_voxels(points: np.ndarray, resolution: float) -> list[Voxel]:
    return [tuple(v) for v in np.floor(points / resolution + 1e-6).astype(int).tolist()]


def highest(found: set[Voxel], resolution: float, grid_map: GridMap) -> np.ndarray:
    """Return the heights of the columns of voxels, found by visiting every voxel."""
    heights = np.full(grid_map.size, np.nan)
    for x, y, z in found:
        cell = grid_map.get_index([(x + 0.5) * resolution, (y + 0.5) * resolution])
        heights[cell] = np.fmax(heights[cell], (z + 0.5) * resolution)
    return heights


# --- trees that OctoMap wrote ---------------------------------------------------------------------


@pytest.mark.parametrize(("case", "form"), FORMS)
def test_occupied_voxels_equal_octomap(case: dict[str, Any], form: str) -> None:
    found = to_voxels(octomap_to_points(read(case, form)), case["resolution"])
    assert len(found) == len(set(found))
    assert set(found) == voxels(case["leaves"], case["resolution"], occupied=True)


@pytest.mark.parametrize(("case", "form"), FORMS)
def test_map_covers_tree_with_highest_voxel_of_every_column(
    case: dict[str, Any], form: str
) -> None:
    resolution = case["resolution"]
    grid_map = from_octomap(read(case, form), "height")
    known = np.array(sorted(voxels(case["leaves"], resolution, occupied=False)))[:, :2]
    assert grid_map.resolution == resolution
    assert grid_map.size == tuple(np.ptp(known, axis=0) + 1)
    corner = grid_map.position + 0.5 * grid_map.length
    np.testing.assert_allclose(corner, (known.max(axis=0) + 1) * resolution)
    occupied = voxels(case["leaves"], resolution, occupied=True)
    expected = highest(occupied, resolution, grid_map)
    np.testing.assert_allclose(grid_map["height"], expected, rtol=1e-6)
    assert np.isnan(expected).any()


@pytest.mark.parametrize(("case", "form"), FORMS)
def test_bounds_exclude_voxels_by_their_center(case: dict[str, Any], form: str) -> None:
    resolution = case["resolution"]
    low, high = (-0.52, NAN, -0.4), (0.61, 0.3, 0.38)
    octomap = read(case, form)

    def is_within(voxel: Voxel) -> bool:
        center = [(k + 0.5) * resolution for k in voxel]
        return not any(c < lo or c > hi for c, lo, hi in zip(center, low, high, strict=True))

    expected = set(filter(is_within, voxels(case["leaves"], resolution, occupied=True)))
    points = octomap_to_points(octomap, min_bound=low, max_bound=high)
    assert set(to_voxels(points, resolution)) == expected
    grid_map = from_octomap(octomap, min_bound=low, max_bound=high)
    columns = np.arange(math.ceil(-0.52 / resolution - 0.5), math.floor(0.61 / resolution + 0.5))
    assert grid_map.size[0] == len(columns)
    heights = highest(expected, resolution, grid_map)
    np.testing.assert_allclose(grid_map["elevation"], heights, rtol=1e-6)


@pytest.mark.parametrize("factor", [1.0, 2.0, 2.7, 100.0])
def test_larger_cells_have_the_highest_column(factor: float) -> None:
    octomap = read(CASES[0], "binary")
    fine, coarse = from_octomap(octomap), from_octomap(octomap, resolution=0.1 * factor)
    assert coarse.resolution == 0.1 * factor
    expected = np.full(coarse.size, np.nan)
    for position, height in zip(fine.get_positions(), fine["elevation"].ravel("F"), strict=True):
        cell = coarse.get_index(position)
        expected[cell] = np.fmax(expected[cell], height)
    np.testing.assert_array_equal(coarse["elevation"], expected)


# --- trees of any shape ---------------------------------------------------------------------------


@st.composite
def trees(draw: st.DrawFn) -> dict[tuple[int, ...], bool]:
    """Draw occupied and free leaves that do not contain one another."""
    start = draw(st.lists(st.integers(0, 7), min_size=10, max_size=12).map(tuple))
    ends = st.lists(st.integers(0, 7), min_size=1, max_size=4).map(tuple)
    chosen: dict[tuple[int, ...], bool] = {}
    for end in draw(st.lists(ends, min_size=1, max_size=12)):
        leaf = start + end
        if not any(leaf[: len(o)] == o or o[: len(leaf)] == leaf for o in chosen):
            chosen[leaf] = draw(st.booleans())
    return chosen


def first_voxel(leaf: tuple[int, ...]) -> np.ndarray:
    """Return the voxel at the corner of a leaf, counted from the corner of the tree."""
    corner, side = np.zeros(3, int), 2**16
    for child in leaf:
        side //= 2
        corner += side * np.array([child & 1, child >> 1 & 1, child >> 2])
    return corner


def described(leaves: dict[tuple[int, ...], bool]) -> list[list[float]]:
    found = []
    for leaf, occupied in leaves.items():
        side = 2 ** (16 - len(leaf))
        found.append([*(first_voxel(leaf) - 2**15 + side / 2).tolist(), side, occupied])
    return found


@settings(max_examples=60)
@given(trees())
def test_leaves_of_all_depths_are_found_in_both_forms(leaves: dict[tuple[int, ...], bool]) -> None:
    assume(min(map(len, leaves)) > 12)
    listed = described(leaves)
    log_odds = lambda occupied: struct.pack("<f", 0.0 if occupied else -0.4)  # noqa: E731
    colored = lambda occupied: log_odds(occupied) + b"rgb"  # noqa: E731
    expected = voxels(listed, 1.0, occupied=True)
    binary = message(write_binary(leaves), resolution=1.0)
    for octomap in (
        binary,
        message(write_full(leaves, log_odds), resolution=1.0, binary=False),
        message(write_full(leaves, log_odds), resolution=1.0, binary=False, id="OcTreeStamped"),
        message(write_full(leaves, colored), resolution=1.0, binary=False, id="ColorOcTree"),
    ):
        assert set(to_voxels(octomap_to_points(octomap), 1.0)) == expected
        grid_map = from_octomap(octomap)
        np.testing.assert_array_equal(grid_map["elevation"], highest(expected, 1.0, grid_map))
    box = {"min_bound": (NAN, NAN, -5.0), "max_bound": (9.0, NAN, NAN)}
    try:
        points = octomap_to_points(binary, **box)
    except MessageError:
        return
    within = {(x, y, z) for x, y, z in expected if z >= -5 and x <= 8}
    assert set(to_voxels(points, 1.0)) == within


def test_empty_tree_has_no_points_and_the_extent_of_bounds() -> None:
    nothing = message(b"")
    free = message(write_binary({(0,) * 15: False}), resolution=0.5)
    assert np.isnan(from_octomap(free)["elevation"]).all()
    for octomap in (nothing, free):
        assert octomap_to_points(octomap).shape == (0, 3)
    with pytest.raises(MessageError, match="data: expected a tree with leaves, got 'none'"):
        from_octomap(nothing)
    grid_map = from_octomap(nothing, min_bound=(-1, -0.5, 0), max_bound=(1, 0.5, 1))
    assert grid_map.size == (20, 10)
    assert np.isnan(grid_map["elevation"]).all()


# --- errors ---------------------------------------------------------------------------------------

GOOD = read(CASES[0], "binary")
FULL = read(CASES[0], "full")
DEEP = struct.pack("<H", 3) * 16 + struct.pack("<H", 2)


MALFORMED = {
    "cut off": (replace(GOOD, data=GOOD.data[:-2]), r"data: expected \d+ more nodes of the tree"),
    "cut in two": (replace(GOOD, data=GOOD.data[:-1]), "data: expected nodes of 2 bytes, got"),
    "more follows": (replace(GOOD, data=GOOD.data * 2), "bytes, where the tree ends, got '888"),
    "too deep": (message(DEEP), "data: expected nodes of at most depth 15, got 16"),
    "very deep": (message(DEEP[:-2] * 9999 + DEEP[-2:]), "nodes of at most depth 15, got"),
    "no children": (message(b"\0\0"), "data: expected inner nodes with children, got 'one with"),
    "log-odds": (
        message(struct.pack("<fB", math.nan, 0), binary=False),
        "data: expected log-odds that are numbers, got nan",
    ),
    "other tree": (replace(FULL, id="SurfelTree"), "id: expected one of OcTree, .*'SurfelTree'"),
    "flag": (replace(GOOD, binary=False), "data: expected"),
    "no resolution": (replace(GOOD, resolution=0.0), "resolution: expected the side of a voxel"),
    "inf resolution": (replace(GOOD, resolution=math.inf), "resolution: expected the side"),
    "huge": (
        message(write_binary({(0,) * 16: True, (7,) * 16: True})),
        "extent: expected at most 16000000 cells, got 65536 x 65536",
    ),
    "huge and full": (
        message(write_full({(n,) * 16: True for n in (0, 7)}, lambda _: bytes(4)), binary=False),
        "extent: expected at most 16000000 cells, got 65536 x 65536",
    ),
    "all occupied": (message(struct.pack("<H", 0xAAAA)), "extent: expected at most 16000000 cells"),
    "all full": (
        message(bytes(4) + b"\xff" + bytes(5) * 8, binary=False),
        "extent: expected at most 16000000 cells",
    ),
}


@pytest.mark.parametrize("kind", MALFORMED)
def test_malformed_octomap_gets_one_error_that_names_the_field(kind: str) -> None:
    octomap, text = MALFORMED[kind]

    def read() -> None:
        with pytest.raises(GridMapError, match=text):
            from_octomap(octomap)

    assert peak_memory(read) < 1e6 + 300 * len(octomap.data)


def test_excessive_number_of_voxels_is_refused() -> None:
    text = "data: 2 cells per voxel: expected at most 16000000 cells, got 2 x 281474976710656"
    with pytest.raises(LimitError, match=text):
        octomap_to_points(message(struct.pack("<H", 0xAAAA)))
    few = octomap_to_points(
        message(struct.pack("<H", 0xAAAA)), min_bound=(0, 0, 0), max_bound=(0.3, 0.2, 0.1)
    )
    assert len(few) == 6


NO_VOXELS = "min_bound, max_bound: expected voxels between them"


@pytest.mark.parametrize(
    ("options", "text"),
    [
        ({"min_bound": (1, NAN, NAN), "max_bound": (0, NAN, NAN)}, NO_VOXELS),
        ({"min_bound": (NAN, NAN, 1e9)}, NO_VOXELS),
        ({"min_bound": (1e9,) * 3, "max_bound": (2e9,) * 3}, NO_VOXELS),
        ({"min_bound": (0, 0)}, "min_bound: expected x, y and z"),
        ({"resolution": 0.05}, r"resolution: expected at least that of the tree, 0\.1"),
    ],
)
def test_invalid_argument_is_named(options: Any, text: str) -> None:
    with pytest.raises(MessageError, match=text):
        from_octomap(GOOD, **options)
