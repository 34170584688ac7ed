# SPDX-License-Identifier: BSD-3-Clause
"""The octomap demo with a file.

Services need `octomap_msgs`; they are tested with the other optional messages of the workspace.
"""

import numpy as np
import pytest
from demos import DATA, published


def test_the_room_is_shown_below_its_ceiling():
    given = (f"octomap_path:={DATA}/room.bt", "max_z:=2", "min_x:=-1.0")
    (grid_map,), _ = published("octomap_to_gridmap_demo", *given)
    assert (grid_map.frame_id, grid_map.layers) == ("map", ("elevation",))
    assert grid_map.basic_layers == ("elevation",)
    assert grid_map.timestamp > 0
    np.testing.assert_allclose(grid_map.length, (3.0, 3.0))
    np.testing.assert_allclose(grid_map.position, (0.5, 0.0), atol=1e-9)
    # Centers of the highest voxels, of 5 cm.
    places = {"floor": (0.0, 0.0), "table": (0.8, 0.6), "box": (1.0, -0.8), "wall": (0.0, 1.475)}
    heights = {name: grid_map.at_position("elevation", xy) for name, xy in places.items()}
    expected = {"floor": -0.025, "table": 0.675, "box": 0.375, "wall": 1.975}
    assert heights == pytest.approx(expected, abs=1e-6)
