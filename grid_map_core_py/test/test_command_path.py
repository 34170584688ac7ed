# SPDX-License-Identifier: BSD-3-Clause
"""The command `grid-map path`; the package of visualizations tests its pictures."""

import json
import math

import numpy as np
import pytest

from grid_map_core_py import GridMap, save
from grid_map_core_py.planning import Footprint, SlopeLimits, TravelGraph
from grid_map_core_py.testing import moved_in_buffer


@pytest.fixture
def site() -> GridMap:
    """Return a map with a wall that has a gap, and a slope."""
    site = GridMap((4.0, 3.0), 0.1, layers={"cost": 0.0}, frame_id="map")
    site["cost"][20, :22], site["cost"][5, 3] = 254.0, np.nan
    site["height"] = np.repeat(0.2 * site.axes()[0][:, None], 30, axis=1)
    return moved_in_buffer(site, (7, 11))


@pytest.fixture
def command(site, grid_map_command):
    save(site, "site.npz")
    return grid_map_command


def test_path_passes_all_options_to_the_graph(command, site):
    line = "path site.npz 1.5,1,0.5 -1.5,1.0,-3 --json --cost cost --cost-weight 2 --lethal 253 "
    line += "--elevation height --limits 20 15 20 --max-step 0.1 --footprint 0.5,0.3 --unknown free"
    found = json.loads(command(line)[1])
    text = command(line.replace("--json", ""))[1]
    graph = TravelGraph(
        site,
        cost="cost",
        cost_weight=2.0,
        lethal=253.0,
        elevation="height",
        limits=SlopeLimits(*map(math.radians, (20, 15, 20))),
        max_step=0.1,
        footprint=Footprint.rectangle(0.5, 0.3),
        unknown="free",
    )
    path = graph.path((1.5, 1.0, 0.5), (-1.5, 1.0, -3.0))
    for name in "length", "cost", "positions", "heights", "yaws":
        assert found[name] == np.asarray(getattr(path, name)).tolist()
    assert text == f"length  {path.length:.6g} m\ncost    {path.cost:.6g}\n"


def test_path_accepts_a_tolerance(command):
    line = "path site.npz 1.5,1 -0.05,1 --cost cost --lethal 253 --json"
    assert command(line)[0] == 1
    found = json.loads(command(f"{line} --tolerance 0.2")[1])
    assert found["positions"][-1][0] == pytest.approx(0.05)


@pytest.mark.usefixtures("command")
@pytest.mark.parametrize(
    ("line", "code", "text"),
    [
        ("9,9 1,1 --cost cost", 1, "start: expected a position on the map"),
        ("1;1 1,0 --cost cost", 2, "expected numbers separated by commas, got '1;1'"),
        ("1,1 1,0", 1, "no layer 'elevation'"),
        ("1,1 1,0 --elevation height --limits 95 9 9", 2, "--limits: expected 0 to 90 degrees"),
        ("1,1 1,0 --cost cost --footprint 1,2,3", 2, "--footprint: expected one or two numbers"),
        ("1,1 1,0 --cost cost -o path.txt", 2, "path.txt: expected a name that ends in .jpg, "),
        ("1,1 1,0 --cost cost -o site.png", 1, "site.png: already exists; --force replaces it"),
    ],
)
def test_path_reports_wrong_arguments_in_one_line(refused, tmp_path, line, code, text):
    (tmp_path / "site.png").touch()
    found, error = refused(f"path site.npz {line}")
    assert found == code
    assert text in error
