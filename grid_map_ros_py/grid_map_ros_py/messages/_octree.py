# SPDX-License-Identifier: BSD-3-Clause
"""Reader of the octrees in OctoMap messages and files.

Nodes are stored in preorder: each node precedes its children. A tree has one of two forms, both
little-endian:

- The binary form stores only inner nodes. A node consists of two bits for each of its eight
  children: unknown (0), free (1), occupied (2) or inner node (3).
- The full form stores every node. A node consists of its log-odds (float32), an optional color
  (three bytes), and a byte whose bits mark the existing children.

The root is a cube around the origin with 65536 voxels per side. A voxel is a node of depth 16.

Children are numbered from 0 to 7. Bit 0 of the number is set in the half of the parent with the
larger x. Bits 1 and 2 stand for y and z in the same way.
"""

from collections.abc import Iterator
from typing import Any

import numpy as np
import numpy.typing as npt

from grid_map_core_py.limits import check_cells

from ..errors import MessageError

Keys = npt.NDArray[np.int32]
"""Indices (3, N) of nodes of one depth, counted from the root corner with the smallest x, y, z."""

Voxel = npt.NDArray[np.int32]
"""Indices (3,) of a voxel, counted from the root corner with the smallest x, y, z."""

Leaves = dict[int, tuple[Keys, npt.NDArray[np.bool_]]]
"""Keys (3, N) of the leaves at each depth (0: root), and a mask (N,) of the occupied leaves."""

DEPTH = 16
"""Depth of the voxels, which are the smallest nodes; the depth of the root is 0."""

VOXELS = 2**DEPTH
"""Number of voxels along each side of the root."""

NODE_TYPES = {
    "OcTree": np.dtype([("value", "<f4"), ("children", "u1")]),
    "OcTreeStamped": np.dtype([("value", "<f4"), ("children", "u1")]),
    "ColorOcTree": np.dtype([("value", "<f4"), ("color", "u1", 3), ("children", "u1")]),
}
"""Data types of the nodes in full form. The keys are tree classes."""

_CHILDREN = np.arange(8)
_OFFSETS = ((_CHILDREN >> np.arange(3)[:, None]) & 1).astype(np.int32)
_FREE, _OCCUPIED, _INNER = 1, 2, 3


# --- reading --------------------------------------------------------------------------------------


def read_binary(data: npt.NDArray[np.uint8]) -> Leaves:
    """Return the leaves of a tree in binary form, or no leaves if `data` is empty."""
    words = _records(data, np.dtype("<u2"))
    labels = ((words[:, None] >> (2 * _CHILDREN).astype(np.uint16)) & 3).astype(np.uint8)
    if not labels.any(axis=1).all():
        raise MessageError("data", "inner nodes with children", "one without")
    leaves: Leaves = {}
    for depth, nodes, keys in _levels(labels == _INNER, DEPTH - 1, words.itemsize):
        labels_here = labels.take(nodes, axis=0)
        is_leaf = (labels_here == _FREE) | (labels_here == _OCCUPIED)
        occupied = labels_here[is_leaf] == _OCCUPIED
        leaves[depth + 1] = _child_keys(keys, is_leaf), occupied
    return leaves


def read_full(data: npt.NDArray[np.uint8], node_type: np.dtype[Any]) -> Leaves:
    """Return the leaves of a tree in full form, or no leaves if `data` is empty."""
    records = _records(data, node_type)
    if np.isnan(records["value"]).any():
        raise MessageError("data", "log-odds that are numbers", float("nan"))
    children = ((records["children"][:, None] >> _CHILDREN.astype(np.uint8)) & 1).astype(np.bool_)
    leaves: Leaves = {}
    for depth, nodes, keys in _levels(children, DEPTH, node_type.itemsize):
        is_leaf = records["children"][nodes] == 0
        # Log-odds of 0 mean a probability of 0.5.
        occupied = records["value"][nodes[is_leaf]] >= 0
        leaves[depth] = keys[:, is_leaf], occupied
    return leaves


def _records(data: npt.NDArray[np.uint8], record: np.dtype[Any]) -> npt.NDArray[Any]:
    if len(data) % record.itemsize:
        raise MessageError("data", f"nodes of {record.itemsize} bytes", f"{len(data)} bytes")
    return data.view(record)


def _levels(
    children: npt.NDArray[np.bool_], deepest: int, node_size: int
) -> Iterator[tuple[int, npt.NDArray[np.intp], Keys]]:
    """Yield the depth, the node indices (M,) and the node keys (3, M) of each tree level.

    `children` (N, 8) marks the children of each node that are stored as nodes.
    """
    if not len(children):
        return
    depths = _depths(children.sum(axis=1), node_size)
    if depths.max() > deepest:
        raise MessageError("data", f"nodes of at most depth {deepest}", int(depths.max()))
    # In preorder, nodes of equal depth are sorted by parent and child number.
    by_depth = np.argsort(depths, kind="stable")
    ends = np.cumsum(np.bincount(depths))
    keys = np.zeros((3, 1), np.int32)
    for depth, nodes in enumerate(np.split(by_depth, ends[:-1])):
        yield depth, nodes, keys
        keys = _child_keys(keys, children.take(nodes, axis=0))


def _depths(counts: npt.NDArray[np.intp], node_size: int) -> npt.NDArray[np.intp]:
    """Return the depths (N,) of nodes in preorder; node i has `counts[i]` children."""
    # Number of pending nodes at each position, including the node at that position.
    open_ends = np.append(0, np.cumsum(counts - 1)) + 1
    closed = np.flatnonzero(open_ends == 0)
    if not len(closed):
        raise MessageError("data", f"{open_ends[-1]} more nodes of the tree", "the end")
    if closed[0] != len(counts):
        found = f"{len(counts) * node_size} bytes"
        raise MessageError("data", f"{closed[0] * node_size} bytes, where the tree ends", found)
    # A subtree ends at the first later position with one fewer pending node. Sorting by (pending
    # nodes, position) allows a binary search for that position.
    numbers, count = np.arange(len(open_ends)), len(open_ends)
    by_open_ends = np.sort(open_ends * count + numbers)
    one_less = (open_ends[:-1] - 1) * count + numbers[:-1]
    ends = by_open_ends[np.searchsorted(by_open_ends, one_less)] % count
    # The ancestors of a node are the preceding nodes whose subtree has not ended.
    ended = np.cumsum(np.bincount(ends, minlength=len(numbers)))
    depths: npt.NDArray[np.intp] = (numbers - ended)[:-1]
    return depths


def _child_keys(keys: Keys, children: npt.NDArray[np.bool_]) -> Keys:
    """Return the keys of the children marked in `children` (N, 8), grouped by parent."""
    numbers = np.flatnonzero(children)
    child_keys: Keys = keys.take(numbers >> 3, axis=1)
    child_keys *= 2
    child_keys += _OFFSETS.take(numbers & 7, axis=1)
    return child_keys


# --- voxels ---------------------------------------------------------------------------------------


def side_of(depth: int) -> int:
    return 1 << (DEPTH - depth)


def extent(leaves: Leaves) -> tuple[Voxel, Voxel]:
    """Return the first and last voxel (3,) of the bounding box of all leaves."""
    filled = [(keys, side_of(depth)) for depth, (keys, _) in leaves.items() if keys.size]
    if not filled:
        raise MessageError("data", "a tree with leaves", "none")
    first = np.min([keys.min(axis=1) * side for keys, side in filled], axis=0)
    end = np.max([(keys.max(axis=1) + 1) * side for keys, side in filled], axis=0)
    return first, end - 1


def highest_voxels(leaves: Leaves, first: Voxel, last: Voxel) -> npt.NDArray[np.int32]:
    """Return the z index of the highest occupied voxel in each column of a box, or -1.

    The box includes the voxels `first` (3,) and `last` (3,). The result has the axes x and y.
    """
    begin, highest = first[:2] >> DEPTH, np.full((1, 1), -1, np.int32)
    for depth in range(DEPTH + 1):
        # Split each column of the previous depth into four and drop columns outside the box.
        above, begin = begin, first[:2] >> (DEPTH - depth)
        shape = (last[:2] >> (DEPTH - depth)) + 1 - begin
        row, column = begin - 2 * above
        highest = highest.repeat(2, axis=0).repeat(2, axis=1)
        highest = np.ascontiguousarray(highest[row : row + shape[0], column : column + shape[1]])
        if depth in leaves:
            keys, occupied = leaves[depth]
            x, y, z = keys.compress(occupied, axis=1)
            x -= begin[0]
            y -= begin[1]
            bottom = z * np.int32(side_of(depth))
            top = np.minimum(bottom + np.int32(side_of(depth) - 1), last[2])
            within = (x >= 0) & (x < shape[0]) & (y >= 0) & (y < shape[1])
            within &= (top >= first[2]) & (bottom <= last[2])
            cells = x[within].astype(np.intp) * shape[1] + y[within]
            np.maximum.at(highest.reshape(-1), cells, top[within])
    return highest


def occupied_voxels(leaves: Leaves, first: Voxel, last: Voxel) -> Keys:
    """Return the occupied voxels (3, N) in a box; raise `LimitError` if there are too many."""
    count = 0
    for depth, (keys, occupied) in leaves.items():
        side = np.int32(side_of(depth))
        start = keys.compress(occupied, axis=1) * side
        end = np.minimum(start + side, last[:, None] + 1)
        overlap = np.maximum(end - np.maximum(start, first[:, None]), 0)
        # Compute in float64, because the product could overflow int32.
        count += int(overlap.prod(axis=0, dtype=np.float64).sum())
    # A voxel uses as much memory as two cells.
    check_cells("data: 2 cells per voxel", (2, count))
    keys = np.empty((3, 0), np.int32)
    for depth in range(DEPTH + 1):
        keys = (2 * keys[:, :, None] + _OFFSETS[:, None]).reshape(3, -1)
        if depth in leaves:
            found, occupied = leaves[depth]
            keys = np.concatenate([keys, found.compress(occupied, axis=1)], axis=1)
        shift = DEPTH - depth
        within = (keys >= (first >> shift)[:, None]) & (keys <= (last >> shift)[:, None])
        keys = keys.compress(within.all(axis=0), axis=1)
    return keys
