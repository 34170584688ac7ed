# SPDX-License-Identifier: BSD-3-Clause
"""Draw how elevation mapping decides the height of a cell.

    python3 docs/images/make_elevation_picture.py [FOLDER]

writes `cell.png` into the folder, `docs/images/elevation` by default. Each panel is a cell seen
from the side: the points of one scan, and the height that `ElevationMapper` has afterwards.
"""

import sys
from collections.abc import Callable
from pathlib import Path

import matplotlib
import numpy as np
from matplotlib.figure import Figure
from numpy.typing import NDArray

from grid_map_core_py import GridGeometry
from grid_map_core_py.elevation import ElevationMapper, LaserModel

matplotlib.use("Agg")

FOLDER = Path(__file__).parent / "elevation"
SENSOR = LaserModel(min_radius=0.01)
NEAR = 0.05
"""Distance from the height up to which points are drawn as its support [m]."""

Points = NDArray[np.float64]
Random = np.random.Generator


def ground(random: Random, count: int = 60) -> Points:
    """Return points x, z (count, 2) of level ground [m]."""
    return np.column_stack((random.uniform(-0.045, 0.045, count), random.normal(0.0, 0.006, count)))


def upright(random: Random, count: int, width: float) -> Points:
    """Return points of something upright, 1.2 m high."""
    x, z = random.uniform(-width, width, count), random.uniform(0.0, 1.2, count)
    return np.column_stack((x + 0.02, z))


def outliers(random: Random) -> Points:
    """Return points of ground and three others."""
    return np.vstack((ground(random), [(-0.02, 0.85), (0.01, 0.5), (0.03, -0.35)]))


def table(random: Random) -> Points:
    """Return points of a table and the ground below it."""
    top = ground(random, 40) + (0.0, 0.75)
    return np.vstack((ground(random, 30), top))


PANELS: dict[str, tuple[Callable[[Random], Points], int, float]] = {
    "ground": (ground, 1, 0.0),
    "wall: supported\nin one scan": (
        lambda random: np.vstack((ground(random, 25), upright(random, 150, 0.005))),
        1,
        0.0,
    ),
    "outliers:\ntoo few points": (outliers, 1, 0.0),
    "pole: few points,\nin several scans": (
        lambda random: np.vstack((ground(random, 200), upright(random, 60, 0.02))),
        8,
        0.0,
    ),
    "table:\nthe surface": (table, 1, 0.0),
    "table with\noverhang_clearance": (table, 1, 0.6),
}
"""Points of a scan, number of scans, and `overhang_clearance`, by title."""


def height_after(scans: list[Points], clearance: float) -> float:
    """Return the height of the cell after the scans [m]."""
    mapper = ElevationMapper(
        GridGeometry((0.3, 0.3), 0.1), sensor=SENSOR, overhang_clearance=clearance
    )
    pose = np.eye(4)
    pose[2, 3] = 2.0
    for number, scan in enumerate(scans):
        points = np.column_stack((scan[:, 0], np.zeros(len(scan)), scan[:, 1] - 2.0))
        mapper.update(points, pose, timestamp=number * 100_000_000)
    return float(mapper.grid_map.at_position("elevation", (0.0, 0.0)))


def draw(path: Path) -> None:
    """Write the picture."""
    random = np.random.default_rng(2)
    figure = Figure(figsize=(9.0, 3.4), layout="constrained")
    panels = figure.subplots(1, len(PANELS), sharey=True)
    for axes, (title, (made, count, clearance)) in zip(panels, PANELS.items(), strict=True):
        scans = [made(random) for _ in range(count)]
        height = height_after(scans, clearance)
        x, z = scans[-1].T
        near = np.abs(z - height) <= NEAR
        axes.plot(x[~near], z[~near], ".", color="#9aa5b1", markersize=4)
        axes.plot(x[near], z[near], ".", color="#2b6cb0", markersize=4)
        axes.plot([-0.05, 0.05], [height, height], color="#c0392b", linewidth=2)
        axes.set_title(title, fontsize=9)
        axes.set_xlim(-0.05, 0.05)
        axes.set_xticks([])
    panels[0].set_ylabel("height [m]")
    figure.savefig(path, dpi=90)


def main(folder: Path) -> None:
    """Write the picture into a folder."""
    folder.mkdir(parents=True, exist_ok=True)
    draw(folder / "cell.png")


if __name__ == "__main__":
    main(Path(sys.argv[1]) if len(sys.argv) > 1 else FOLDER)
