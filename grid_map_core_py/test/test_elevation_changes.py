# SPDX-License-Identifier: BSD-3-Clause
"""Changes of an elevation map beside scans: of its place and its parameters."""

import numpy as np
import pytest

from grid_map_core_py import ConfigError, GeometryError, GridGeometry
from grid_map_core_py.elevation import ElevationMapper
from grid_map_core_py.testing import assert_maps_equal

POSE = np.eye(4)
POSE[2, 3] = 1.0
POINTS = [[0.1, 0.1, -1.0], [1.1, 0.1, -0.5]]


def mapper(**parameters: float) -> ElevationMapper:
    made = ElevationMapper(GridGeometry(np.array([4.0, 3.0]), 0.5), **parameters)
    made.update(POINTS, POSE, timestamp=0, values={"gray": [1.0, 2.0]})
    return made


def test_move_equals_the_move_of_an_update() -> None:
    moved, updated = mapper(), mapper()
    moved.move((1.2, -0.4))
    moved.update(POINTS, POSE, timestamp=1, values={"gray": [3.0, 4.0]})
    updated.update(POINTS, POSE, timestamp=1, values={"gray": [3.0, 4.0]}, position=(1.2, -0.4))
    assert_maps_equal(moved.grid_map, updated.grid_map)
    with pytest.raises(GeometryError):
        moved.move((np.nan, 0.0))


def test_configured_mapper_equals_one_made_so() -> None:
    changed, made = mapper(), mapper(mahalanobis_distance_threshold=9.0, exponential_alpha=0.2)
    changed.configure(mahalanobis_distance_threshold=9.0, exponential_alpha=0.2)
    assert changed.parameters == made.parameters
    for each in (changed, made):
        each.update(np.add(POINTS, (0, 0, 0.1)), POSE, timestamp=1)
    assert_maps_equal(changed.grid_map, made.grid_map)


@pytest.mark.parametrize(
    "wrong", [{"max_variance": 1e-9}, {"threshold": 1.0}, {"horizontal_variances": True}]
)
def test_wrong_change_keeps_all_parameters(wrong: dict[str, float]) -> None:
    made = mapper()
    before = made.parameters
    with pytest.raises(ConfigError):
        made.configure(**wrong)
    assert made.parameters == before
