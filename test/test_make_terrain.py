# SPDX-License-Identifier: BSD-3-Clause
"""The terrain of benchmarks/make_terrain.py: each window by itself, and its files."""

import os
import sys

import numpy as np
import pytest
from scipy import ndimage

from grid_map_core_py.files import load_geotiff
from scratch import ROOT, run

sys.path.append(str(ROOT / "benchmarks"))

from make_terrain import terrain, terrain_window

pytestmark = pytest.mark.needs("dask", "rasterio")


@pytest.mark.parametrize("window", [(0, 1, 0, 1), (3, 200, 130, 131), (299, 300, 0, 300)])
def test_window_of_terrain_equals_part_of_the_whole(window):
    rows, columns = slice(*window[:2]), slice(*window[2:])
    whole = terrain_window(slice(0, 300), slice(0, 300), 300)
    part = terrain_window(rows, columns, 300)
    assert part.flags.f_contiguous
    np.testing.assert_array_equal(part, whole[rows, columns])


def test_larger_terrain_extends_smaller_one():
    # Cell (0, 0) is at the north-east.
    larger = terrain_window(slice(100, 200), slice(100, 200), 200)
    np.testing.assert_array_equal(larger, terrain_window(slice(0, 100), slice(0, 100), 100))
    other = terrain_window(slice(0, 100), slice(0, 100), 100, seed=1)
    assert (np.abs(other - larger) > 1).mean() > 0.5


def test_terrain_has_slopes_and_holes_of_a_landscape():
    heights = terrain_window(slice(0, 1000), slice(5000, 6000), 20_000)
    slopes = np.hypot(*np.gradient(heights))
    assert 0.2 < np.sqrt(np.nanmean(slopes**2)) < 0.6
    holes, _ = ndimage.label(np.isnan(heights))
    sizes = np.bincount(holes.ravel())[1:]
    assert 0.005 < np.isnan(heights).mean() < 0.05
    assert np.sum(sizes == 1) > 500
    assert 300 < sizes.max() < 20_000


@pytest.mark.parametrize("options", [[], ["--cog", "--resolution", "0.1"]])
def test_program_writes_terrain(options, tmp_path):
    program, file = ROOT / "benchmarks" / "make_terrain.py", tmp_path / "dem.tif"
    done = run(
        sys.executable, program, "--cells", "700", "--out", file, *options, environ=os.environ
    )
    assert done.returncode == 0, done.stdout + done.stderr
    resolution = 0.1 if options else 0.5
    expected = terrain_window(slice(0, 700), slice(0, 700), 700) * np.float32(resolution)
    found = load_geotiff(file)
    assert found.resolution == resolution
    np.testing.assert_array_equal(found["elevation"], expected)
    assert terrain(700, resolution=resolution).geometry == found.geometry
