# SPDX-License-Identifier: BSD-3-Clause
"""Write a fractal terrain of any size, with holes, to a GeoTIFF or COG file, window by window.

    python3 benchmarks/make_terrain.py --cells 20000 --out dem.tif

A cell depends only on its position and the seed, so `terrain_window` can compute any part alone.
"""

import argparse
import sys
import time
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from grid_map_core_py import GridGeometry
from grid_map_core_py.tiled import (
    TiledMap,
)
from grid_map_core_py.tiled._source import Window

OCTAVES = tuple(2**n for n in range(11, 1, -1))
"""Wavelengths of the height noise [cells]."""

STEEPNESS = 0.1
"""Ratio of noise amplitude to wavelength."""

HOLES = (96, 24)
"""Wavelengths of the hole noise [cells]."""

HOLE_ABOVE = 0.62
"""Value of the hole noise, from -1 to 1, above which a cell is a hole."""

LOST = 0.002
"""Share of cells that are removed individually."""

CRS = "EPSG:25832"
CORNER = (680_000.0, 5_300_000.0)
"""South-west corner of the terrain [m]."""

PIECE = 64
"""Number of lines computed at once, which fit in the cache."""

Heights = NDArray[np.float32]
Places = NDArray[np.int64]


def terrain_window(rows: slice, columns: slice, cells: int, *, seed: int = 0) -> Heights:
    """Return the heights of a window of a square terrain.

    Args:
        rows, columns: the window, in map order.
        cells: side of the terrain [cells].
        seed: seed of the terrain.

    Returns:
        (rows, cols) float32, Fortran order [cell sides]; NaN in holes.
    """
    # Count from the south-west corner, so that larger terrains extend smaller terrains.
    north = cells - 1 - np.arange(columns.start, columns.stop)
    east = cells - 1 - np.arange(rows.start, rows.stop)
    heights = np.zeros((north.size, east.size), np.float32)
    for begin in range(0, north.size, PIECE):
        lines = slice(begin, begin + PIECE)
        _fill(heights[lines], north[lines], east, seed)
    return heights.T


def _fill(heights: Heights, north: Places, east: Places, seed: int) -> None:
    for wavelength in OCTAVES:
        _add_noise(heights, north, east, wavelength, wavelength * STEEPNESS, seed)
    gaps = np.zeros_like(heights)
    for wavelength in HOLES:
        _add_noise(gaps, north, east, wavelength, 1 / len(HOLES), seed + 1)
    lost = _hash(north, east, seed + 2) < np.uint32(LOST * 2**32)
    lost |= gaps > HOLE_ABOVE
    heights[lost] = np.nan


def _add_noise(
    values: Heights, north: Places, east: Places, wavelength: int, amplitude: float, seed: int
) -> None:
    """Add noise: random numbers at lattice points, smoothly interpolated in between."""
    (lines, line_share), (pixels, pixel_share) = (
        _lattice(places, wavelength) for places in (north, east)
    )
    points = _hash(lines.points, pixels.points, 31 * wavelength + seed)
    noise = points * np.float32(amplitude * 2.0**-31) - np.float32(amplitude)
    noise = _between(noise.T, lines.below, line_share).T
    values += _between(noise, pixels.below, pixel_share)


@dataclass(frozen=True)
class _Lattice:
    """Lattice points along an axis, and the index of the lattice point below each position."""

    points: Places
    below: Places


def _lattice(places: Places, wavelength: int) -> tuple[_Lattice, Heights]:
    """Return the lattice around positions, and the smooth weights (0 to 1) of the points above."""
    below, beyond = np.divmod(places, wavelength)
    first = int(below.min())
    t = beyond.astype(np.float32) / np.float32(wavelength)
    share = t * t * (np.float32(3) - np.float32(2) * t)
    return _Lattice(np.arange(first, int(below.max()) + 2), below - first), share


def _between(values: Heights, below: Places, share: Heights) -> Heights:
    """Interpolate between neighboring columns."""
    found = np.diff(values, axis=1).take(below, axis=1)
    found *= share
    found += values.take(below, axis=1)
    return found


def _hash(lines: Places, pixels: Places, seed: int) -> NDArray[np.uint32]:
    """Return a random number for each point of a rectangle; it depends only on point and seed."""
    with np.errstate(over="ignore"):
        mixed = (lines.astype(np.uint32) * np.uint32(0x9E3779B1))[:, None] + (
            pixels.astype(np.uint32) * np.uint32(0x85EBCA77)
            + np.uint32(seed) * np.uint32(0xC2B2AE3D)
        )
        for shift, factor in ((15, 0x2C1B3C6D), (12, 0x297A2D39)):
            mixed ^= mixed >> np.uint32(shift)
            mixed *= np.uint32(factor)
        mixed ^= mixed >> np.uint32(15)
    return mixed


@dataclass(frozen=True)
class Terrain:
    """The terrain as the source of a tiled map."""

    cells: int
    resolution: float
    seed: int

    layers = ("elevation",)

    def describe(self) -> str:
        return f"{self}"

    def prepare(self) -> None:
        """Do nothing: windows share no data."""

    def read(self, window: Window, names: Sequence[str]) -> list[Heights]:
        heights = terrain_window(*window, self.cells, seed=self.seed)
        heights *= np.float32(self.resolution)
        return [heights for _ in names]


def terrain(cells: int, *, resolution: float = 0.5, seed: int = 0, chunks: int = 1024) -> TiledMap:
    """Return the terrain as a tiled map that is computed window by window.

    Args:
        cells: side of the terrain [cells].
        resolution: cell size [m].
        seed: seed of the terrain.
        chunks: side of a tile [cells].
    """
    center = np.array(CORNER) + 0.5 * cells * resolution
    geometry = GridGeometry.from_size((cells, cells), resolution, center)
    return TiledMap(Terrain(cells, resolution, seed), geometry, (chunks, chunks), crs=CRS)


def main() -> None:
    """Write the file that the arguments describe."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--cells", type=int, default=20_000, help="side of the terrain")
    parser.add_argument("--out", default="dem.tif", help="the file")
    parser.add_argument("--cog", action="store_true", help="write a COG, with overviews")
    parser.add_argument("--resolution", type=float, default=0.5, help="side of a cell [m]")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--plain", action="store_true", help="do not compress")
    options = parser.parse_args()
    start = time.perf_counter()

    def show(done: int, tiles: int) -> None:
        if sys.stderr.isatty():
            sys.stderr.write(f"\r{done} of {tiles} tiles")

    site = terrain(options.cells, resolution=options.resolution, seed=options.seed)
    site.to_geotiff(
        options.out, cog=options.cog, compress=not options.plain, overwrite=True, progress=show
    )
    seconds = time.perf_counter() - start
    print(f"\r{options.out}: {options.cells} x {options.cells} cells in {seconds:.0f} s")


if __name__ == "__main__":
    main()
