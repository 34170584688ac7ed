# SPDX-License-Identifier: BSD-3-Clause
"""`PlanarRegionsFilter`: the labels of `extract_planes` as a layer."""

import numpy as np
import pytest
from filter_cases import TO_OUT, ground, run

from grid_map_core_py.planes import PlaneParameters, extract_planes
from grid_map_core_py.testing import moved_in_buffer
from grid_map_filters_py import FilterConfigError

STAIRS = 0.2 * (np.arange(40) // 8)[:, None] + 0.003 * np.random.default_rng(0).normal(
    size=(40, 30)
)


@pytest.mark.parametrize("start", [(0, 0), (13, 7)])
def test_filter_writes_labels_of_regions(start):
    heights = STAIRS.copy()
    heights[20, 20] = np.nan
    grid_map = moved_in_buffer(ground(heights, 0.04), start)
    for params in ({}, {"marginSize": 1}, {"kernel_size": 5, "numberOfRepeats": 2}):
        sections = {
            "contour_extraction": {"marginSize": params.get("marginSize", 0)},
            "preprocessing": {"numberOfRepeats": params.get("numberOfRepeats", 1)},
            "sliding_window_plane_extractor": {"kernel_size": params.get("kernel_size", 3)},
        }
        expected = extract_planes(grid_map, parameters=PlaneParameters.from_mapping(sections))
        assert len(expected) >= 5
        result = run("PlanarRegions", grid_map, **TO_OUT, **params)
        assert result.start_index == start
        np.testing.assert_array_equal(result.unwrapped("out"), expected.labels)


def test_wrong_parameters_are_refused():
    with pytest.raises(FilterConfigError, match="'kernel_size': expected an odd number"):
        run("PlanarRegions", ground(STAIRS), **TO_OUT, kernel_size=2)
