# SPDX-License-Identifier: BSD-3-Clause
"""Create the demo data: images of the terrain, and a synthetic octomap.

    scripts/make_data.py [DIRECTORY]

Writes `terrain.png`, `terrain_16bit.png` and `room.bt`, into `data` by default.
"""

import sys
from pathlib import Path

import cv2
import numpy as np

from grid_map_core_py.conversions import change_resolution, to_image
from grid_map_demos_py.terrain import load_terrain

DATA = Path(__file__).parents[1] / "data"

VOXEL = 0.05
"""Side length [m]."""

DEPTH = 16
"""Depth of voxels in the tree; the root is centered on the origin."""


def main(folder: Path) -> None:
    """Write all files."""
    folder.mkdir(exist_ok=True)
    # One pixel per 4 x 4 cells of the terrain.
    terrain = change_resolution(load_terrain(DATA / "jacksboro_fault_dem.npz"), 0.12)
    cv2.imwrite(str(folder / "terrain_16bit.png"), to_image(terrain, "elevation", np.uint16, 4))
    gray = to_image(terrain, "elevation", np.uint8, 4)
    # The brightness of these colors grows with the value.
    colors = cv2.applyColorMap(gray[..., 0], cv2.COLORMAP_VIRIDIS)
    cv2.imwrite(str(folder / "terrain.png"), np.dstack([colors, gray[..., 3]]))
    (folder / "room.bt").write_bytes(octomap_file(room()))


# --- octomap --------------------------------------------------------------------------------------


BOXES = [
    ((0, 0, 0), (80, 60, 1)),  # floor
    ((0, 0, 49), (80, 60, 50)),  # ceiling
    ((0, 0, 0), (80, 1, 50)),  # walls
    ((0, 59, 0), (80, 60, 50)),
    ((0, 0, 0), (1, 60, 50)),
    ((79, 0, 0), (80, 60, 50)),
    ((44, 34, 14), (68, 50, 15)),  # table
    *(((x, y, 1), (x + 2, y + 2, 14)) for x in (44, 66) for y in (34, 48)),
    ((54, 8, 1), (66, 20, 9)),  # box
    *(((8 + 4 * k, 6, 1), (12 + 4 * k, 18, 4 + 3 * k)) for k in range(8)),  # stairs
]
"""First and end voxel (exclusive) of each box; together a room of 4 m x 3 m x 2.5 m."""

DOOR = (slice(0, 1), slice(22, 40), slice(1, 42))


def room() -> np.ndarray:
    """Return the voxels (N, 3) of a room around the origin, with the floor below z = 0."""
    occupied = np.zeros((80, 60, 50), dtype=bool)
    for first, end in BOXES:
        occupied[tuple(map(slice, first, end))] = True
    occupied[DOOR] = False
    return np.argwhere(occupied) - [40, 30, 1]


def octomap_file(voxels: np.ndarray) -> bytes:
    """Convert voxels (N, 3) to the bytes of an OctoMap file."""
    head = f"# Octomap OcTree binary file\nid OcTree\nsize {len(voxels)}\nres {VOXEL}\ndata\n"
    return head.encode() + write_tree(voxels + 2 ** (DEPTH - 1), DEPTH)


def write_tree(voxels: np.ndarray, depth: int) -> bytes:
    """Encode a cube of side 2^depth voxels in OctoMap's binary form: 2 bits per child, preorder."""
    numbers = ((voxels >> (depth - 1)) & 1) @ [1, 2, 4]
    word, below = 0, b""
    for number in np.unique(numbers):
        child = voxels[numbers == number]
        is_full = len(child) == 8 ** (depth - 1)
        word |= (2 if is_full else 3) << 2 * int(number)
        below += b"" if is_full else write_tree(child, depth - 1)
    return word.to_bytes(2, "little") + below


if __name__ == "__main__":
    main(Path(sys.argv[1]) if sys.argv[1:] else DATA)
