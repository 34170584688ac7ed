# SPDX-License-Identifier: BSD-3-Clause
"""Recordings of Rerun, read back with Rerun's own reader."""

import signal
import subprocess
import sys
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from recordings import (
    BEGIN,
    DELAY,
    MARKERS,
    STEP,
    Row,
    cloud,
    header,
    hills,
    occupancy_grid,
    pose,
    put_into,
    rows_of,
    transform,
    write_survey,
)

from grid_map_core_py import GridMap, LayerNotFoundError, save
from grid_map_core_py._commands import main
from grid_map_core_py.errors import ConfigError, GridMapError
from grid_map_core_py.testing import assert_maps_equal
from grid_map_ros_py import bag_messages, from_serialized_message
from grid_map_ros_py.bags import BagWriter
from grid_map_ros_py.bags._storage import GRID_MAP_TYPE, Topic
from grid_map_ros_py.testing import wait_until
from grid_map_visualization_py.rerun import Scene, Style, log_bag, recorded as writing

pytestmark = pytest.mark.needs("mcap", "rerun")


@pytest.fixture(autouse=True)
def in_new_folder(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)


@pytest.fixture(scope="module")
def survey(tmp_path_factory) -> Path:
    path = tmp_path_factory.mktemp("bags") / "survey"
    write_survey(path)
    return path


@pytest.fixture(scope="module")
def recording(survey) -> dict[str, list[Row]]:
    """Return the rows of the survey after `grid-map convert`."""
    done = convert(survey, survey.with_suffix(".rrd"))
    assert done.returncode == 0, done.stderr
    assert "grid-map: 28 messages in" in done.stderr
    return rows_of(survey.with_suffix(".rrd"))


def convert(*words: object) -> subprocess.CompletedProcess[str]:
    command = [sys.executable, "-m", "grid_map_core_py", "convert", *map(str, words)]
    return subprocess.run(command, capture_output=True, text=True, check=False)


def image(row: Row, cells: tuple[int, int]) -> np.ndarray:
    """Return the values of a layer in map order: rows against x, columns against y."""
    pixels = row["Image:buffer"].astype(np.uint8).tobytes()
    return np.frombuffer(pixels, np.float32).reshape(cells[::-1])[:, ::-1].T


def recorded(grid_map: GridMap, **options: object) -> dict[str, list[Row]]:
    save(grid_map, "map.rrd", **options)
    return rows_of(Path("map.rrd"))


def test_recording_says_that_the_reference_system_is_lost():
    grid_map = GridMap((1, 1), 0.5, layers={"elevation": 1.0})
    grid_map.crs = "EPSG:25832"
    with pytest.warns(UserWarning, match="crs: a recording of Rerun cannot hold .* it is lost"):
        save(grid_map, "map.rrd")
    for option in ("height_layer", "color_layer"):
        with pytest.raises(LayerNotFoundError, match="no layer 'nope'; available: elevation"):
            save(grid_map, "other.rrd", **{option: "nope"})


def test_maps_of_bags_keep_values_and_times(recording):
    for layer in ("elevation", "slope"):
        rows = recording[f"/grid_map/layers/{layer}"]
        assert len(rows) == 3
        for number, row in enumerate(rows):
            expected = hills(number)
            np.testing.assert_array_equal(image(row, expected.size), expected.unwrapped(layer))
            time = BEGIN + number * STEP
            assert row.times == {"ros_time": time, "log_time": time + DELAY}


def test_surface_has_true_positions_and_no_holes(recording):
    for number, row in enumerate(recording["/grid_map/surface"]):
        expected = hills(number)
        heights = expected["elevation"]
        x, y = np.meshgrid(*expected.axes(), indexing="ij")
        points = np.stack([x, y, heights], axis=-1)[np.isfinite(heights)]
        shift = row["InstancePoses3D:translations"]
        found = row["Mesh3D:vertex_positions"].reshape(-1, 3) + shift
        order = [np.lexsort(np.round(these, 3).T) for these in (found, points)]
        np.testing.assert_allclose(found[order[0]], points[order[1]], atol=1e-6)
        assert row["CoordinateFrame:frame"].tolist() == ["map"]
        assert len(row["slope:colors"]) == len(points)


def test_other_messages_keep_places_frames_and_times(recording):
    assert recording["/tf/lidar"][0]["Transform3D:translation"].tolist() == [0, 0, 0.5]
    assert not recording["/tf/lidar"][0].times
    for number in range(3):
        moved = recording["/tf/base"][number]
        assert moved["Transform3D:translation"].tolist() == [0.25 * number, 0, 1]
        assert moved.times["ros_time"] == BEGIN + number * STEP
        strip = recording["/path"][number]["LineStrips3D:strips"].reshape(-1, 3)
        np.testing.assert_array_equal(strip[:, 0], 0.25 * np.arange(number + 1))
        points = recording["/points"][number]
        assert points["Points3D:positions"].tolist() == [0, 0, 0, 1, 2, 3]
        assert points["CoordinateFrame:frame"].tolist() == ["lidar"]
        for topic in ("odom", "goal"):
            arrows = recording[f"/{topic}/pose"][number]
            assert arrows["Arrows3D:origins"][:3].tolist() == [0.25 * number, 0, 1]
            assert arrows["Arrows3D:vectors"].reshape(3, 3).tolist() == np.eye(3).tolist()
    grid = recording["/costmap"][0]
    assert grid["GridMap:translation"].tolist() == [1, 2, 0]
    # The first row of a picture is the upper one, so it has the largest y.
    assert grid["GridMap:data"].astype(np.int8).tolist() == [50, 0, 0, 100, 0, -1]


def test_markers_of_all_shapes_are_shown_and_deleted(recording):
    places = [path for path in recording if path.startswith("/shapes/shapes/")]
    assert {int(path.rsplit("/", 1)[1]) for path in places} == {*MARKERS, 99}
    triangle = recording["/shapes/shapes/11"][0]["Mesh3D:vertex_positions"].reshape(-1, 3)
    cylinder = recording["/shapes/shapes/3"][0]
    assert cylinder["Cylinders3D:radii"].tolist() == [np.float32(0.15)]
    assert triangle.tolist() == [[11, -2, 0], [12, -2, 0], [11, -1, 0]]
    assert recording["/shapes/shapes/99"][0]["Clear:is_recursive"].all()


def test_curves_show_statistics_and_milliseconds(recording):
    values = hills(1)["elevation"]
    expected = [np.nanmin(values), np.nanmean(values), np.nanmax(values)]
    row = recording["/grid_map/range/elevation"][1]
    np.testing.assert_allclose(row["Scalars:scalars"], expected, rtol=1e-6)
    missing = recording["/grid_map/missing/elevation"][1]["Scalars:scalars"]
    np.testing.assert_allclose(missing, 100 * np.isnan(values).mean())
    stages = [
        row["Scalars:scalars"].item()
        for path, rows in recording.items()
        if path.startswith("/milliseconds/chain/")
        for row in rows
    ]
    assert stages == [2.5, 3.5, 4.5]


@pytest.mark.parametrize("color_layer", ["", "elevation"])
def test_legends_have_bounds_names_and_colors_of_layers(color_layer):
    style = Style(height_layer="slope", color_layer=color_layer, color_map="gray", lower=-1.0)
    grid_map = hills(2)
    with writing("map.rrd", style) as scene:
        scene.log_map("/grid_map", grid_map)
    rows = rows_of(Path("map.rrd"))
    viridis = [[0x44, 0x01, 0x54], [0xFD, 0xE7, 0x25]]
    for layer, title in (("elevation", "elevation [m]"), ("slope", "slope [rad]")):
        is_chosen = layer == (color_layer or "slope")
        lower = "-1" if is_chosen else f"{np.nanmin(grid_map[layer]):.4g}"
        labels = rows[f"/grid_map/legend/{layer}"][0]["Points2D:labels"].tolist()
        assert labels == [lower, title, f"{np.nanmax(grid_map[layer]):.4g}"]
        bar = rows[f"/grid_map/legend/{layer}/bar"][0]["Image:buffer"].reshape(10, 256, 3)
        assert bar[0, [0, -1]].tolist() == ([[0] * 3, [255] * 3] if is_chosen else viridis)


def test_vanished_layers_are_cleared_when_sizes_change():
    small = GridMap((1.0, 0.5), 0.1, layers={"elevation": 2.0}, timestamp=2)
    large = GridMap((2.0, 2.0), 0.1, layers={"elevation": 1.0, "old": 0.0}, timestamp=1)
    with writing("map.rrd") as scene:
        scene.log_map("/grid_map", large)
        scene.log_map("/grid_map", small)
        small["elevation"] = np.nan
        small.timestamp = 3
        scene.log_map("/grid_map", small)
    rows = rows_of(Path("map.rrd"))
    for kind in ("layers", "legend", "range", "missing"):
        assert rows[f"/grid_map/{kind}/old"][-1]["Clear:is_recursive"].all()
        assert rows[f"/grid_map/{kind}/old"][-1].times["ros_time"] == 2
    assert len(rows["/grid_map/surface"][1]["Mesh3D:vertex_positions"]) == 3 * 10 * 5
    assert "Clear:is_recursive" in rows["/grid_map/surface"][2]
    assert np.isnan(image(rows["/grid_map/layers/elevation"][2], (10, 5))).all()


@pytest.mark.parametrize("cells", [(1, 1), (1, 4), (5, 1), (3, 2)])
@pytest.mark.parametrize("value", [1.5, 3e38, np.nan, np.inf])
@pytest.mark.filterwarnings("error")
def test_maps_of_any_shape_and_value_are_recorded(cells, value):
    grid_map = GridMap(np.multiply(cells, 0.5), 0.5, layers={"elevation": value}, timestamp=7)
    grid_map["elevation"][0, 0] *= -1
    rows = recorded(grid_map)
    np.testing.assert_array_equal(
        image(rows["/grid_map/layers/elevation"][0], cells), grid_map["elevation"]
    )
    color = rows["/grid_map/layers/elevation/color"][0]["Image:buffer"].reshape(-1, 4)
    assert (color[:, 3] == (255 if np.isfinite(value) else 0)).all()
    assert ("Mesh3D:vertex_positions" in rows["/grid_map/surface"][0]) == (
        bool(np.isfinite(value)) and min(cells) > 1
    )


@pytest.mark.filterwarnings("error")
def test_normals_of_single_cells_and_legends_without_values():
    grid_map = GridMap((0.5, 0.2), 0.1, layers={"elevation": 1.0, "slope": np.nan}, timestamp=1)
    grid_map["elevation"][3] = np.nan
    grid_map["elevation"][4, 1] = np.nan
    rows = recorded(grid_map)
    normals = rows["/grid_map/surface"][0]["Mesh3D:vertex_normals"].reshape(-1, 3)
    np.testing.assert_allclose(normals, [[0.0, 0.0, 1.0]] * 7)
    labels = rows["/grid_map/legend/slope"][0]["Points2D:labels"].tolist()
    assert labels == ["", "slope [rad]: all cells unknown", ""]


def test_titles_of_many_layers_fit_in_two_columns():
    scene = Scene(pytest.importorskip("rerun").RecordingStream("grid_map"))
    scene.log_map("/grid_map", GridMap((1.0, 1.0), 0.5, layers=dict.fromkeys("abcdefg", 1.0)))
    _, beside = scene.layout().root_container.contents
    assert beside.contents[0].grid_columns == 2


def test_far_maps_keep_the_precision_of_their_cells():
    grid_map = GridMap((2.0, 2.0), 0.1, (500_000.25, 5_300_000.75), frame_id="utm")
    grid_map["elevation"] = 1.0
    rows = recorded(grid_map, exaggeration=3.0)
    near = "utm at 500000, 5300000"
    surface = rows["/grid_map/surface"][0]
    assert surface["CoordinateFrame:frame"].tolist() == [near]
    assert surface["InstancePoses3D:translations"].tolist() == [0.25, 0.75, 0]
    places = {path: row[0] for path, row in rows.items() if path.startswith("/tf/")}
    frames = {row["Transform3D:child_frame"].item(): row for row in places.values()}
    assert frames[near]["Transform3D:translation"].tolist() == [500_000, 5_300_000, 0]
    assert frames[near]["Transform3D:parent_frame"].tolist() == ["utm"]
    assert frames["view"]["Transform3D:parent_frame"].tolist() == [near]
    np.testing.assert_allclose(frames["view"]["Transform3D:scale"], [1, 1, 1 / 3])


def test_wrong_messages_are_left_out_with_warnings():
    grid, points = occupancy_grid(BEGIN), cloud(BEGIN, np.zeros((2, 3)))
    grid.info.width = 4
    points.fields.pop()
    goal = SimpleNamespace(header=header(BEGIN, "map"), pose=pose(0.0, np.nan, 0.0))
    both = transform(BEGIN, "map", "lost", np.nan, 0.0, 0.0)
    both.transforms += transform(BEGIN, "map", "base", 1.0, 0.0, 0.0).transforms
    with BagWriter("bag") as bag:
        put_into(bag, "/costmap", "nav_msgs/OccupancyGrid", 1, grid)
        put_into(bag, "/points", "sensor_msgs/PointCloud2", 2, points)
        for time in 3, 4, 5:
            put_into(bag, "/goal", "geometry_msgs/PoseStamped", time, goal)
        put_into(bag, "/tf", "tf2_msgs/TFMessage", 6, both)
        put_into(bag, "/costmap", "nav_msgs/OccupancyGrid", 7, occupancy_grid(BEGIN))
    with writing("a.rrd") as scene, pytest.warns(UserWarning, match="left out: ") as caught:
        assert log_bag(scene, "bag") == 1
    place = "bag/bag_0.mcap: message 0 on"
    assert [str(one.message).removeprefix("left out: ") for one in caught] == [
        f"{place} /costmap: data: expected 4 x 2 cells, got 6",
        f"{place} /points: fields: expected x, y and z, got 'none named z'",
        f"{place} /goal: pose.position.y: expected a finite number, got nan",
        f"{place} /tf: translation.x: expected a finite number, got nan",
        "2 more messages on /goal",
    ]
    rows = rows_of(Path("a.rrd"))
    assert len(rows["/costmap"]) == 1
    assert ("/tf/base" in rows, "/tf/lost" in rows) == (True, False)


@pytest.mark.parametrize(
    ("name", "hint", "warning"),
    [
        (
            "a.mcap",
            "reads up to the last whole chunk; 'mcap recover' repairs the file",
            "a.mcap: is damaged and read up to",
        ),
        ("bag", "leaves out such maps", "left out: bag/bag_0.mcap: message 1 on /grid_map: "),
    ],
)
def test_damaged_bags_are_one_error_that_recover_mends(survey, name, hint, warning):
    data = bytearray(next(survey.glob("*.mcap")).read_bytes())
    at = data.rindex(b"elevation\0", 0, data.rindex(b"grid_map_msgs/msg/GridMap")) + 5
    data[at : at + 4] = b"\xff\xfe\xfd\xfc"
    Path("a.mcap").write_bytes(data)
    with BagWriter("bag") as bag:
        bag.write("/grid_map", hills(0), time=1)
        bag.write_serialized("/grid_map", Topic(GRID_MAP_TYPE, "cdr"), 2, b"\0")
    Path("old.rrd").write_text("old")
    before = sorted(Path().iterdir())
    done = convert(name, "old.rrd", "--force")
    assert (done.returncode, done.stderr.count("\n")) == (1, 1)
    assert done.stderr.startswith(f"grid-map: error: {name}")
    assert done.stderr.endswith(f"; recover=True (--recover) {hint}\n")
    assert (sorted(Path().iterdir()), Path("old.rrd").read_text()) == (before, "old")
    done = convert(name, "old.rrd", "--force", "--recover")
    assert done.stderr.startswith(f"grid-map: warning: {warning}"), done.stderr
    assert done.stderr.endswith(" messages in old.rrd\n")


def test_full_disk_is_one_error_and_no_file(survey, full_disk):
    Path("old.rrd").write_text("old")
    before = sorted(Path().iterdir())
    with full_disk(100_000):
        done = convert(survey, "old.rrd", "--force")
    assert done.stderr == "grid-map: error: old.rrd: cannot be written: File too large\n"
    assert done.returncode == 1
    assert sorted(Path().iterdir()) == before
    assert Path("old.rrd").read_text() == "old"


def test_full_disk_ends_a_long_recording_early(full_disk):
    def write() -> None:
        with writing("a.rrd") as scene:
            for number in range(20_000):
                scene.log_map("/grid_map", hills(0), log_time=number)
            pytest.fail("It went on.")

    with full_disk(0), pytest.raises(GridMapError, match="File too large"):
        write()


@pytest.mark.parametrize("options", [[], ["--topic", "/grid_map"]])
def test_interrupted_conversion_leaves_nothing(options):
    """The bag is long, so that the signal comes in the middle."""
    with BagWriter("long") as bag:
        for number in range(500):
            bag.write("/grid_map", hills(number % 4), time=number)
    command = [sys.executable, "-m", "grid_map_core_py", "convert", "long", "out.rrd", *options]
    with subprocess.Popen(command, stderr=subprocess.PIPE) as process:
        wait_until(lambda: [*Path().glob(".out.rrd.*.partial")], "the beginning of the file")
        process.send_signal(signal.SIGINT)
        process.communicate()
    assert process.returncode == -signal.SIGINT
    assert [path.name for path in Path().iterdir()] == ["long"]


def test_chosen_maps_of_a_bag_are_converted_alone(survey):
    assert main(["convert", str(survey), "all.rrd", "--topic", "/grid_map"]) == 0
    rows = rows_of(Path("all.rrd"))
    assert len(rows["/grid_map/surface"]) == 3
    assert rows["/grid_map/surface"][1].times["log_time"] == BEGIN + STEP + DELAY
    assert "/odom/pose" not in rows
    assert main(["convert", str(survey), "one.rrd", "--index", "0"]) == 0
    assert len(rows_of(Path("one.rrd"))["/grid_map/surface"]) == 1


def test_files_that_cannot_be_written_are_errors():
    with pytest.raises(GridMapError, match=r"nowhere/map\.rrd: cannot be written: there is no"):
        save(hills(0), "nowhere/map.rrd")
    with pytest.raises(ConfigError, match="exaggeration"):
        save(hills(0), "map.rrd", exaggeration=0.0)
    assert not Path("map.rrd").exists()


def test_bag_messages_have_types_times_and_data(survey):
    kinds = {"nav_msgs/msg/Odometry", "grid_map_msgs/msg/GridMap"}
    found = list(bag_messages(survey, kinds))
    assert [one.topic for one in found[:2]] == ["/odom", "/grid_map"]
    assert [one.time for one in found] == sorted(one.time for one in found)
    assert {one.type for one in found} == kinds
    assert_maps_equal(from_serialized_message(found[1].data), hills(0))
