# SPDX-License-Identifier: BSD-3-Clause
"""Node `planar_regions` over DDS; test/terrains.py has the test with `PlanarTerrain`."""

from collections.abc import Iterator
from contextlib import contextmanager

import numpy as np
import pytest
import yaml
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from geometry_msgs.msg import PolygonStamped
from planes import is_on, points_of, regions_of, steps
from rclpy.qos import QoSProfile
from rclpy.serialization import deserialize_message, serialize_message
from test_node_costmap import wait_for_level
from visualization_msgs.msg import Marker, MarkerArray

from grid_map_core_py import GridMap
from grid_map_core_py.planes import PlanarRegions, PlaneParameters, extract_planes
from grid_map_core_py.testing import assert_maps_equal
from grid_map_msgs.msg import GridMap as GridMapMessage
from grid_map_ros_py import from_message, to_message
from grid_map_ros_py._planes import to_markers
from grid_map_ros_py.testing import Peer, Process, peer, running_node

MODULE = "grid_map_ros_py._executables.planar_regions"

UPSTREAM = """
preprocessing: {resolution: 0.04, kernelSize: 3, numberOfRepeats: 2}
sliding_window_plane_extractor: {plane_inclination_threshold_degrees: 10.0, connectivity: 4}
ransac_plane_refinement: {probability: 0.001, min_points: 4, epsilon: 0.025}
contour_extraction: {marginSize: 1}
postprocessing: {extracted_planes_height_offset: 0.0, smoothing_dilation_size: 0.2}
"""
"""Parameters with upstream's names and sections; the ramp is too steep."""

PARAMETERS = PlaneParameters.from_mapping(yaml.safe_load(UPSTREAM))


@contextmanager
def extractor(*words: str) -> Iterator[tuple[Process, Peer]]:
    with peer() as other, running_node(MODULE, *words) as node:
        other.listen("/planar_regions", MarkerArray)
        other.listen("/planar_map", GridMapMessage)
        other.listen("/diagnostics", DiagnosticArray, 10)
        yield node, other


def send(other: Peer, grid_map: GridMap) -> tuple[MarkerArray, GridMap]:
    """Publish a map; return its markers and the map with the layers of the regions."""
    other.publish("/grid_map", to_message(grid_map))
    # A new subscriber may get the last messages twice.
    stamp = to_message(grid_map).header.stamp

    def last(topic: str) -> object:
        return other.received[topic][-1] if other.received[topic] else None

    def have_come() -> bool:
        markers, result = last("/planar_regions"), last("/planar_map")
        is_here = markers is not None and markers.markers[0].header.stamp == stamp
        return is_here and result is not None and result.header.stamp == stamp

    other.wait_until(have_come, "the markers and the map")
    return last("/planar_regions"), from_message(last("/planar_map"))


def expected_markers(grid_map: GridMap, regions: PlanarRegions) -> MarkerArray:
    markers = to_markers(regions, to_message(grid_map).header)
    # Colors are float32 in messages.
    return deserialize_message(serialize_message(markers), MarkerArray)


def ids_of(markers: MarkerArray) -> set[int]:
    return {marker.id for marker in markers.markers if marker.action == Marker.ADD}


def test_map_gets_layers_and_ids_last_while_it_moves() -> None:
    maps = [steps(), steps(0.2), steps(0.2, higher=False), steps(-0.08)]
    ids = []
    with extractor() as (node, other):
        for count, grid_map in enumerate(maps, start=1):
            grid_map.timestamp = count
            regions = regions_of(*maps[:count])
            markers, result = send(other, grid_map)
            assert markers == expected_markers(grid_map, regions)
            assert_maps_equal(
                result, grid_map.with_start_index((0, 0)).with_layers(regions.layers())
            )
            ids.append(ids_of(markers))
            assert ids[-1] == {region.id for region in regions}
        # The higher tread vanishes and returns with another id.
        assert ids[0] == ids[1] == {1, 2, 3}
        assert ids[2] == {1, 3}
        assert ids[3] == {1, 3, 4}
        status = wait_for_level(other, DiagnosticStatus.OK)
        values = {value.key: value.value for value in status.values}
        assert values["regions"] == str(len(regions))
        assert float(values["ms of the last map"]) > 0
        markers, _ = send(other, steps(frame_id="map"))
        assert ids_of(markers) == {1, 2, 3}
        text = "the map has changed to 'map' with cells of 0.04 m: ids start again at 1"
        other.wait_until(lambda: text in node.text, text)


def test_polygons_come_while_subscribed_one_per_region() -> None:
    regions = regions_of(steps())
    with extractor() as (node, other):
        send(other, steps())
        # The subscriber comes after the map.
        other.listen("/planar_polygons", PolygonStamped, QoSProfile(depth=100))
        other.expect("/planar_polygons", len(regions))
        polygons = other.received["/planar_polygons"]
        for region, polygon in zip(regions, polygons, strict=True):
            assert polygon.header == to_message(steps()).header
            corners = points_of(polygon.polygon.points)
            np.testing.assert_allclose(corners[:, :2], region.outer, atol=1e-6)
            assert is_on(region, corners)
        text = (
            "planar_terrain needs the package 'convex_plane_decomposition_msgs', which is not "
            "installed: build its ROS 2 port in your workspace. Without it, the node publishes no"
        )
        assert node.text.count(text) == 1


def test_yaml_of_upstream_sets_the_parameters(tmp_path) -> None:
    file = tmp_path / "parameters.yaml"
    content = {"planar_regions": {"ros__parameters": yaml.safe_load(UPSTREAM)}}
    file.write_text(yaml.safe_dump(content))
    with extractor("--ros-args", "--params-file", str(file)) as (node, other):
        markers, _ = send(other, steps())
        assert markers == expected_markers(steps(), extract_planes(steps(), parameters=PARAMETERS))
        assert len(ids_of(markers)) == 2
        assert "unknown parameters" not in node.text


def test_unusable_map_is_named_and_the_next_is_used() -> None:
    wrong = steps().with_layers({"height": np.zeros((50, 41))}).without_layers(["elevation"])
    text = "no layer 'elevation'; available: color, height. Set the parameter height_layer"
    with extractor() as (node, other):
        for _ in range(3):
            other.publish("/grid_map", to_message(wrong))
        line = f"dropped a message of /grid_map: {text}"
        other.wait_until(lambda: line in node.text, line)
        values = wait_for_level(other, DiagnosticStatus.ERROR).values
        assert text in [value.value for value in values if value.key == "last error"]
        markers, _ = send(other, steps())
        assert markers == expected_markers(steps(), regions_of(steps()))
        wait_for_level(other, DiagnosticStatus.OK)


@pytest.mark.parametrize(
    ("heights", "text"),
    [
        (np.nan, "layer 'elevation' has 0 known cells"),
        (np.indices((50, 41)).sum(axis=0) % 2, "layer 'elevation' has 2050 known cells. Check the"),
    ],
)
def test_map_without_regions_removes_them_and_warns(heights, text: str) -> None:
    empty, later = steps(), steps()
    empty.timestamp, later.timestamp = 1, 2
    empty["elevation"] = heights
    text = f"no planar regions on /grid_map: {text}"
    with extractor() as (node, other):
        send(other, steps())
        markers, result = send(other, empty)
        assert [marker.action for marker in markers.markers] == [Marker.DELETEALL]
        assert not result["plane_id"].any()
        assert np.isnan(result["plane_elevation"]).all()
        assert text in wait_for_level(other, DiagnosticStatus.WARN).message
        other.wait_until(lambda: text in node.text, text)
        # No id is used again.
        markers, _ = send(other, later)
        assert min(ids_of(markers)) > 3
        wait_for_level(other, DiagnosticStatus.OK)
