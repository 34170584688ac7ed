# SPDX-License-Identifier: BSD-3-Clause
"""Invalid parameters end every demo with one message."""

from importlib.metadata import entry_points

from demos import DATA, parameters

from grid_map_ros_py.testing import refusals

REFUSED: dict[str, list[tuple[str | tuple[str, ...], str]]] = {
    "terrain_publisher": [
        ("publish_rate:=0.0", "parameter 'publish_rate': expected a positive"),
        ("resolution:=-1", "parameter 'resolution': expected a positive"),
        ("topic:=7", "parameter 'topic': expected a string"),
        ("topic:='no topic'", "parameter 'topic': expected the name of a"),
        ("file:=/nope.npz", "/nope.npz: cannot be read: No such file"),
    ],
    "demo_report": [
        ("timeout:=-1.0", "parameter 'timeout': expected a positive"),
        ("messages:=0", "parameter 'messages': expected at least 1"),
        ("output_directory:=/proc/none", "/proc/none: cannot be made a folder"),
    ],
    "elevation_mapping_robot": [("speed:=0.0", "parameter 'speed': expected a positive")],
    "elevation_mapping_report": [("duration:=.nan", "parameter 'duration': expected a positive")],
    "large_map_robot": [("speed:=0.0", "parameter 'speed': expected a positive")],
    "large_map_report": [("duration:=.nan", "parameter 'duration': expected a positive")],
    "path_planner_robot": [("file:=/nope.npz", "/nope.npz: cannot be read: No such file")],
    "path_planner_report": [("timeout:=0.0", "parameter 'timeout': expected a positive")],
    "planar_regions_robot": [("rate:=0.0", "parameter 'rate': expected a positive")],
    "planar_regions_report": [("timeout:=0.0", "parameter 'timeout': expected a positive")],
    "image_publisher": [("image_path:=/nope.png", "/nope.png: cannot be read: No such file")],
    "image_publisher.py": [("topic:='a b'", "parameter 'topic': expected the name of a topic")],
    "image_to_gridmap_demo": [("max_height:=0.0", "parameter 'max_height': expected a finite")],
    "grid_map_to_image_demo": [
        ("bits:=12", "parameter 'bits': expected 8 or 16"),
        (("lower:=1.0", "upper:=1.0"), "lower, upper: expected"),
        ("file:=/no/such/map.png", "a file in a folder that exists"),
        ("file:=/tmp/map.doc", "parameter 'file': expected a format"),
    ],
    "opencv_demo": [("publish_rate:=.nan", "parameter 'publish_rate': expected a positive")],
    "resolution_change_demo": [("interpolation:=best", "parameter 'interpolation': expected")],
    "interpolation_demo": [
        ("world:=Cosine", "parameter 'world': expected one of Sine, Poly, Gauss, Tanh, got 'Co"),
        ("interpolation_type:=linear", "expected one of Nearest, Linear, Cubic_convolution, Cubic"),
        ("groundtruth_resolution:=0.0005", "expected at most 16000000 cells, got 8000 x 8000"),
    ],
    "iterators_demo": [
        ("speed:=0.0", "parameter 'speed': expected a positive number"),
        ("repeat:=often", "parameter 'repeat': expected true or false"),
    ],
    "move_demo": [("duration:=0.0", "parameter 'duration': expected a positive number")],
    "normal_filter_comparison_demo": [
        ("shape:=torus", "parameter 'shape': expected one of wave, plane, hill, cone, got 'tor"),
        ("noise_on_map:=-0.1", "parameter 'noise_on_map': expected a number from 0 to"),
        ("outliers_percentage:=5.0", "'outliers_percentage': expected a number from 0 to 1, got"),
        ("filters.filter1.name:=some", "filter 1"),
    ],
    "octomap_to_gridmap_demo": [
        ("octomap_path:=/nope.bt", "/nope.bt: cannot be read: No such file"),
        ("octomap_service_topic:='no topic'", "parameter 'octomap_service_topic': expected"),
        (("min_y:=1.0", "max_y:=0.0"), "parameter 'max_y': expected no less than min_y, 1."),
        ((f"octomap_path:={DATA}/room.bt", "min_x:=90.0"), f"{DATA}/room.bt: "),
    ],
    "sdf_demo": [
        ("pointcloud_topic:='a b'", "parameter 'pointcloud_topic': expected the name of a topic"),
        ("elevation_layer:=7", "parameter 'elevation_layer': expected a string (quote it)"),
    ],
    "tutorial_demo": [
        ("noise:=-0.1", "parameter 'noise': expected a number from 0"),
        ("radius:=2.0", "parameter 'radius': expected at most 1.0"),
        ("outliers:=100001", "parameter 'outliers': expected a number from 0 to 100000"),
    ],
}
"""Parameters (`name:=value`) and part of the error message, by demo."""


def test_invalid_parameters_end_demos_with_one_message():
    cases = [
        (demo, (given,) if isinstance(given, str) else given, text)
        for demo, refused in REFUSED.items()
        for given, text in refused
    ]
    mains = {entry.name: entry.value for entry in entry_points(group="console_scripts")}
    messages = refusals([(mains[demo], parameters(*given)) for demo, given, _ in cases])
    for (demo, given, text), message in zip(cases, messages, strict=True):
        assert text in message, (demo, given)
