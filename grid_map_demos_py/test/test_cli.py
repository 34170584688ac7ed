# Copyright (c) 2026 grid_map_py contributors
# SPDX-License-Identifier: BSD-3-Clause
"""The command line: files in, files and text out; in processes of its own where that matters."""

import io
import json
import os
import signal
import subprocess
import sys
from itertools import pairwise
from pathlib import Path
from urllib.request import urlopen

import cv2
import numpy as np
import pytest
from command_line import CHAIN, PROGRAM, SECOND, a_map, grid_map, printed

from grid_map_core_py import GridMap
from grid_map_core_py.files import load_images, load_npz, save_npz
from grid_map_core_py.testing import assert_maps_equal
from grid_map_demos_py.cli.main import main
from grid_map_ros_py import BagReader, BagWriter, bag_maps, load_from_bag
from grid_map_ros_py.testing import Process, running, wait_until

pytest.importorskip("mcap")


@pytest.fixture(scope="module")
def files(tmp_path_factory) -> Path:
    """Return a folder with a bag, a map and a chain, for reading only."""
    folder = tmp_path_factory.mktemp("files")
    with BagWriter(folder / "survey") as bag:
        for second in (1, 2, 3):
            bag.write("/grid_map", a_map(second), time=second * SECOND + 7)
    with BagWriter(folder / "two") as bag:
        bag.write("/one", a_map(1))
        bag.write("/other", a_map(2))
        bag.write("/other", a_map(3))
    save_npz(a_map(), folder / "site.npz")
    (folder / "chain.yaml").write_text(CHAIN)
    return folder


@pytest.fixture
def command(files, tmp_path, monkeypatch, capfd):
    """Return a function that runs a command within this process, and returns what comes of it."""
    for path in files.iterdir():
        (tmp_path / path.name).symlink_to(path)
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(sys, "stdin", io.TextIOWrapper(io.BytesIO(b"nothing")))

    def run(*words: str) -> tuple[int, str, str]:
        try:
            code = main(words)
        except SystemExit as end:
            code = end.code
        return code, *capfd.readouterr()

    return run


# --- info and inspect -----------------------------------------------------------------------------


def test_info_tells_what_is_in_a_map_and_in_json_the_same(command):
    _, text, _ = command("info", "site.npz")
    assert text.startswith("site.npz: npz, ")
    rows = dict(line.split(maxsplit=1) for line in text.splitlines()[1:])
    assert rows == {
        "frame": "odom",
        "time": "3.000000000 s",
        "size": "8 x 6 cells of 0.1 m",
        "length": "0.8 x 0.6 m",
        "position": "(1, 2)",
        "layers": "elevation (basic), variance, color",
    }
    found = json.loads(command("info", "--json", "site.npz")[1])
    assert found["map"] == {
        "frame_id": "odom",
        "timestamp": 3 * SECOND,
        "size": [8, 6],
        "resolution": 0.1,
        "length": pytest.approx([0.8, 0.6]),
        "position": [1.0, 2.0],
        "start_index": [0, 0],
        "layers": ["elevation", "variance", "color"],
        "basic_layers": ["elevation"],
    }
    size = Path("site.npz").stat().st_size
    assert (found["path"], found["format"], found["bytes"]) == ("site.npz", "npz", size)


def test_info_tells_the_topics_of_a_bag_and_of_a_map_on_each(command):
    code, text, _ = command("info", "two", "--json")
    assert code == 0
    one, other = json.loads(text)["topics"]
    assert one.pop("map")["timestamp"] == SECOND
    assert other.pop("map")["start_index"] == [3, 1]
    kind = "grid_map_msgs/msg/GridMap"
    assert one == {"name": "/one", "type": kind, "count": 1, "first": SECOND, "last": SECOND}
    assert (other["count"], other["first"], other["last"]) == (2, 2 * SECOND, 3 * SECOND)
    _, text, _ = command("info", "two", "--topic", "/other", "--index", "0")
    assert "/one" not in text
    assert "map 0" in text
    assert "2.000000000 s" in text


def test_info_tells_how_long_a_bag_is_and_places_to_the_millimetre(command):
    far = GridMap((4, 3), 0.5, (691_002.25, 5_334_798.625), ["elevation"])
    with BagWriter("far") as bag:
        for second in (1_700_000_000.0, 1_700_000_002.5):
            bag.write("/grid_map", far, time=int(second * SECOND))
    head, *rows = command("info", "far")[1].splitlines()
    assert head.startswith("far: bag, ")
    assert head.endswith(", 2.5 s from 2023-11-14 22:13:20 UTC")
    assert "position  (691002.25, 5334798.625)" in rows


def test_inspect_counts_and_averages_the_finite_values(command):
    values = a_map()["elevation"]
    finite = values[np.isfinite(values)].astype(float)
    found = json.loads(command("inspect", "survey", "--json", "--bins", "4")[1])
    elevation, variance, color = found["layers"]
    assert elevation["name"] == "elevation"
    assert (elevation["cells"], elevation["nan"], elevation["infinite"]) == (48, 2, 0)
    for name in ("min", "max", "mean", "std"):
        assert elevation[name] == pytest.approx(getattr(np, name)(finite))
    histogram = elevation["histogram"]
    inside = [
        ((finite >= low) & (finite < high)).sum()
        for low, high in zip(histogram["edges"][:-1], histogram["edges"][1:], strict=True)
    ]
    inside[-1] += 1  # the last bin has its upper edge
    assert histogram["counts"] == inside
    assert (variance["infinite"], variance["min"], variance["max"]) == (1, 0.25, 0.25)
    assert (color["is_color"], color["min"], color["nan"]) == (True, None, 0)


def test_inspect_draws_the_histogram_also_where_blocks_cannot_be_printed(command, files):
    words = ("inspect", "site.npz", "--layer", "elevation", "--bins", "3", "--histogram")
    _, text, _ = command(*words)
    head, row, *_, name, low, middle, high = text.splitlines()
    assert head.split()[0] == "layer"
    assert row.split()[0] == name == "elevation"
    assert "4.2%" in row
    bars = [line.count("█") for line in (low, middle, high)]
    counts = [int(line.split()[3]) for line in (low, middle, high)]
    assert sum(counts) == 46
    assert max(bars) == 40
    assert np.argsort(bars).tolist() == np.argsort(counts).tolist()
    ascii_only = printed(*words, cwd=files, environ={"PYTHONIOENCODING": "ascii"})
    assert [line.count("#") for line in ascii_only.splitlines()[-3:]] == bars


def test_a_map_without_values_is_inspected_as_well(command):
    save_npz(GridMap((1, 1), 0.5, layers={"empty": np.nan}), "empty.npz")
    code, text, _ = command("inspect", "empty.npz", "--histogram")
    assert code == 0
    assert text.splitlines()[1].split() == ["empty", "-", "-", "-", "-", "100.0%", "0"]


@pytest.mark.parametrize("value", [0.0, -7.5, 3e38, -1e20])
def test_a_single_value_is_in_the_middle_of_its_histogram(value, command):
    save_npz(GridMap((1, 1), 0.5, layers={"flat": value}), "flat.npz")
    code, text, error = command("inspect", "flat.npz", "--json", "--bins", "5")
    assert code == 0, error
    (flat,) = json.loads(text)["layers"]
    assert (flat["min"], flat["max"], flat["std"]) == (pytest.approx(value), flat["min"], 0.0)
    assert flat["histogram"]["counts"] == [0, 0, 4, 0, 0]


# --- convert --------------------------------------------------------------------------------------


def test_a_map_comes_back_the_same_through_every_format(command):
    steps = ["site.npz", "bag", "images/map.yaml", "again.npz"]
    for source, destination in pairwise(steps):
        assert command("convert", source, destination)[0] == 0
    assert_maps_equal(load_from_bag("bag", "/grid_map"), load_npz("site.npz"))
    again, images = load_npz("again.npz"), load_images("images")
    assert_maps_equal(again, images)
    assert again.geometry == load_npz("site.npz").geometry
    lost = np.abs(again["elevation"] - load_npz("site.npz")["elevation"])
    assert np.nanmax(lost) < 1e-3


def test_all_maps_of_a_bag_go_to_another_with_their_times_and_start_indices(command):
    words = ("--layer", "elevation", "--compress", "--frame", "site", "--output-topic", "/site")
    code, text, error = command("convert", "survey", "copy", *words)
    assert (code, text) == (0, ""), error
    assert "3/3 maps" in error
    assert error.endswith("grid-map: 3 maps in copy\n")
    with BagReader("copy", "/site") as bag:
        assert [record.time for record in bag] == [n * SECOND + 7 for n in (1, 2, 3)]
        for second, record in enumerate(bag, 1):
            actual = record.grid_map(unwrap=False)
            assert (actual.layers, actual.frame_id) == (("elevation",), "site")
            assert actual.start_index == (3, 1)
            np.testing.assert_array_equal(actual["elevation"], a_map(second)["elevation"])


def test_one_map_of_a_bag_is_the_last_or_the_one_asked_for(command):
    command("convert", "survey", "last.npz")
    command("convert", "survey", "first.npz", "--index", "0")
    command("convert", "survey", "second", "--index", "1", "--quiet")
    assert load_npz("last.npz").timestamp == 3 * SECOND
    assert load_npz("first.npz").timestamp == SECOND
    assert [one.timestamp for one in bag_maps("second", "/grid_map")] == [2 * SECOND]


def test_maps_go_through_pipes(files):
    first, second, third = "convert survey -", "filter chain.yaml - -", "info - --json"
    pipeline = f"{PROGRAM} {first} | {PROGRAM} {second} | {PROGRAM} {third}"
    done = subprocess.run(
        ["bash", "-o", "pipefail", "-c", pipeline], cwd=files, capture_output=True, check=False
    )
    assert (done.returncode, done.stderr) == (0, b"")
    found = json.loads(done.stdout)
    assert found["map"]["layers"] == ["elevation", "variance", "color", "double"]
    assert found["bytes"] is None


def test_points_and_meshes_become_maps(command):
    pytest.importorskip("trimesh")
    points = "0.5 0.5 1\n0.6 0.4 3\n1.5 0.5 2\n"
    properties = "".join(f"property float {axis}\n" for axis in "xyz")
    head = f"ply\nformat ascii 1.0\nelement vertex 3\n{properties}end_header\n"
    Path("cloud.ply").write_text(head + points)
    Path("ramp.obj").write_text("v 0 0 0\nv 2 0 2\nv 2 2 2\nv 0 2 0\nf 1 2 3 4\n")
    words = ("--resolution", "1", "--reduce", "mean", "--height-layer", "height")
    assert command("convert", "cloud.ply", "cloud.npz", *words)[0] == 0
    cloud = load_npz("cloud.npz")
    assert (cloud.frame_id, cloud.layers) == ("map", ("height",))
    assert cloud.at_position("height", (0.55, 0.45)) == 2.0
    assert cloud.at_position("height", (1.5, 0.5)) == 2.0
    assert command("convert", "ramp.obj", "ramp.npz", "--resolution", "1")[0] == 0
    assert load_npz("ramp.npz")["elevation"].tolist() == [[1.5, 1.5], [0.5, 0.5]]
    _, text, _ = command("info", "ramp.obj", "--json")
    told = json.loads(text)
    assert (told["points"], told["faces"], told["upper"]) == (4, 2, [2.0, 2.0, 2.0])
    code, _, error = command("convert", "ramp.obj", "x.npz")
    assert (code, "--resolution" in error, "2 x 2 m" in error) == (1, True, True)
    code, _, error = command("convert", "ramp.obj", "x.npz", *words)
    assert (code, "--reduce, --min-height and --max-height are for points" in error) == (1, True)
    code, _, error = command("convert", "cloud.ply", "x.npz", *words, "--layer", "z")
    assert (code, "no layer 'z'; available: height" in error) == (1, True)
    code, _, error = command("info", "cloud.ply", "--topic", "/points")
    assert (code, "cloud.ply: is no bag" in error) == (1, True)
    code, _, error = command("plot", "ramp.obj", "x.png")
    assert (code, "grid-map convert ramp.obj" in error) == (1, True)


# --- filter ---------------------------------------------------------------------------------------


def test_a_chain_runs_over_a_whole_bag_with_progress_and_times(command):
    code, text, error = command("filter", "chain.yaml", "survey", "out", "--timing", "--json")
    assert code == 0, error
    assert "3/3 maps" in error
    (step,) = json.loads(text)
    assert step.keys() == {"name", "type", "maps", "last_ms", "mean_ms", "max_ms"}
    assert (step["name"], step["maps"]) == ("twice", 3)
    with BagReader("out", "/filtered_map") as bag:
        for second, record in enumerate(bag, 1):
            assert record.time == second * SECOND + 7
            expected = 2 * a_map(second)["elevation"]
            actual = record.grid_map(unwrap=False)
            np.testing.assert_allclose(actual["double"], expected, rtol=1e-6)


def test_the_chain_may_come_from_a_pipe_and_times_make_room_for_the_map(files, tmp_path):
    words = ("filter", "-", "site.npz", "-", "--timing")
    done = grid_map(*words, cwd=files, stdin=CHAIN.encode())
    assert done.returncode == 0, done.stderr
    assert b"twice" in done.stderr
    (tmp_path / "out.npz").write_bytes(done.stdout)
    filtered = load_npz(tmp_path / "out.npz")
    np.testing.assert_allclose(filtered["double"], 2 * filtered["elevation"], rtol=1e-6)


def test_maps_that_cannot_be_filtered_end_it_or_are_left_out(command):
    with BagWriter("bad") as bag:
        bag.write("/grid_map", a_map(1))
        bag.write("/grid_map", a_map(2, "hight"))
    code, _, error = command("filter", "chain.yaml", "bad", "out", "--quiet")
    assert (code, Path("out").exists()) == (1, False)
    assert error.startswith("grid-map: error: map 1: filter 1 'twice'")
    code, _, error = command("filter", "chain.yaml", "bad", "out", "--keep-going", "--quiet")
    assert code == 0
    assert "left out map 1" in error
    assert len([*bag_maps("out")]) == 1


# --- plot and view --------------------------------------------------------------------------------


def test_a_picture_shows_something(command):
    pytest.importorskip("matplotlib")
    assert command("plot", "site.npz", "above.png", "--shade-by", "elevation")[0] == 0
    picture = cv2.imread("above.png")
    assert picture.shape[:2] == (770, 990)
    assert len(np.unique(picture.reshape(-1, 3), axis=0)) > 100


def test_pictures_that_are_no_png(command):
    pytest.importorskip("matplotlib")
    options = ("--lower", "-1", "--upper", "1", "--color-map", "terrain", "--title", "Here")
    assert command("plot", "survey", "surface.pdf", "--3d", *options)[0] == 0
    assert Path("surface.pdf").read_bytes().startswith(b"%PDF")
    assert command("plot", "survey", "colors.svg", "--layer", "color")[0] == 0
    assert "<svg" in Path("colors.svg").read_text()


def test_the_page_is_served_until_an_interrupt(files):
    pytest.importorskip("viser")
    command = [str(PROGRAM), "view", str(files / "survey")]
    with running(Process([*command, "--port", "0"])) as process:
        wait_until(lambda: process.lines, "the address")
        with urlopen(process.lines[0].strip()) as answer:
            assert answer.status == 200
            assert b"<html" in answer.read()


def test_a_page_without_its_layer_is_refused(command):
    pytest.importorskip("viser")
    code, _, error = command("view", "site.npz", "--layer", "elevtion")
    assert code == 1
    assert "no layer 'elevtion'; available: elevation, variance, color" in error


# --- errors ---------------------------------------------------------------------------------------

WRONG = {
    "info nowhere": (1, "nowhere: no such file or folder"),
    "info nowhere.npz": (1, "nowhere.npz: cannot be read"),
    "info chain.yaml": (1, "chain.yaml: cannot be read: no file of a map"),
    "info -": (1, "standard input: cannot be read"),
    "info two --topic /none": (1, "no topic '/none'; topics: /one"),
    "inspect two": (1, "2 topics of maps, name one"),
    "inspect survey --index 7": (1, "no map 7: 3 maps on /grid_map"),
    "inspect site.npz --index 1": (1, "is no bag, --topic and --index are for bags"),
    "inspect site.npz --layer none": (1, "no layer 'none'; available: elevation"),
    "inspect site.npz --bins 0": (2, "--bins: expected a number from 1"),
    "convert site.npz survey": (1, "survey: is there already; --force replaces it"),
    "convert survey survey --force": (1, "is the source, too"),
    "convert site.npz map.mcap": (2, "a bag is a folder, leave out the .mcap"),
    "convert site.npz site.yaml": (2, "FOLDER/map.yaml"),
    "convert site.npz site.jpg": (2, "expected a name that ends in"),
    "convert site.npz - --to bag": (2, "standard output takes npz, not bag"),
    "convert site.npz nowhere/map.npz": (1, "nowhere/map.npz: cannot be written"),
    "convert site.npz new.npz --crs EPSG:25832": (2, "--crs is for geotiff, and this is npz"),
    "convert site.npz new.npz --output-topic /x": (2, "--output-topic is for bag"),
    "convert site.npz new.npz --resolution 1": (2, "--resolution is for point clouds"),
    "convert site.npz new.npz --reduce mean": (2, "--reduce is for point clouds"),
    "convert site.npz new.npz --as mesh": (2, "--as is for point clouds"),
    "convert site.npz new.npz --bits 8": (2, "--bits is for images, and this is npz"),
    "info .": (1, "no bag: a folder without metadata.yaml"),
    "filter none.yaml site.npz out.npz": (1, "none.yaml: No such file or directory"),
    "filter - - out.npz": (2, "cannot both come from standard input"),
    "filter chain.yaml site.npz out.npz --json": (2, "--timing"),
    "plot site.npz map.jpg": (2, "expected a name that ends in .png, .pdf, .svg"),
    "info survey --ind 0": (2, "unrecognized arguments: --ind 0"),
    "inspect site.npz --bars": (2, "--bars (see 'grid-map inspect --help')"),
    "plot site.npz map.png --dpi 5000": (2, "--dpi: expected a number from 1 to 1200"),
    "plot site.npz map.png --lower -1e-3 --upper -inf": (1, "'upper': expected a finite number"),
    "plot site.npz map.png --max-cells 9": (2, "--max-cells goes with --3d only"),
    "plot site.npz map.png --color-map virids": (1, "did you mean viridis"),
    "plot site.npz nowhere/map.png": (1, "nowhere/map.png: cannot be written: No such file"),
    "plot site.npz site.npz": (2, "expected a name"),
    "view site.npz --port 99999": (2, "--port: expected a number from 0 to 65535"),
    "dance": (2, "invalid choice: 'dance'"),
    "convert site.npz": (2, "required: destination"),
}


@pytest.mark.parametrize("line", WRONG)
def test_what_is_wrong_is_said_in_one_line(line, command):
    code, output, error = command(*line.split())
    expected_code, text = WRONG[line]
    assert (code, output) == (expected_code, "")
    assert error.startswith("grid-map: error: ")
    assert text in error
    assert error.count("\n") == 1
    assert not list(Path().glob("out*"))


def test_what_is_there_is_replaced_by_force_alone(command):
    for line in ("convert site.npz new.npz", "plot site.npz new.png", "convert site.npz new"):
        name = line.split()[-1]
        assert command(*line.split())[0] == 0
        before = Path(name).stat().st_ino
        code, _, error = command(*line.split())
        assert (code, f"{name}: is there already; --force replaces it" in error) == (1, True)
        assert Path(name).stat().st_ino == before
        assert command(*line.split(), "--force")[0] == 0
        assert Path(name).stat().st_ino != before


@pytest.mark.parametrize("line", ["convert site.npz pipe --to npz", "plot site.npz pipe.png"])
def test_pipes_and_devices_are_never_replaced(line, command):
    name = line.split()[2]
    os.mkfifo(name)
    code, _, error = command(*line.split(), "--force")
    assert (code, f"{name}: is neither a file nor a folder" in error) == (1, True)
    assert Path(name).is_fifo()


def test_an_error_keeps_what_is_there(command):
    save_npz(a_map(2, "hight"), "bad.npz")
    save_npz(a_map(1), "out.npz")
    before = Path("out.npz").read_bytes()
    code, _, error = command("filter", "chain.yaml", "bad.npz", "out.npz", "--force")
    assert (code, "hight" in error) == (1, True)
    assert Path("out.npz").read_bytes() == before
    assert not [path for path in Path().iterdir() if "partial" in path.name]


def test_names_from_files_do_not_reach_the_terminal_as_they_are(command):
    save_npz(GridMap((1, 1), 0.5, layers={"\x1b[31mred": 1.0}, frame_id="a\nb"), "evil.npz")
    for line in ("info evil.npz", "inspect evil.npz"):
        _, text, _ = command(*line.split())
        assert "\x1b" not in text
        assert "\\x1b[31mred" in text


# --- being a good program -------------------------------------------------------------------------


def test_it_is_silent_when_nobody_reads_on(files):
    script = f"{PROGRAM} info site.npz | head -n 1; {PROGRAM} info site.npz | true"
    done = subprocess.run(
        ["bash", "-c", script], cwd=files, capture_output=True, text=True, check=False
    )
    assert done.stdout.startswith("site.npz: npz")
    assert done.stderr == ""


def test_it_says_that_the_disk_is_full_and_does_without_output(files):
    info = f"{PROGRAM} info site.npz"
    convert = f"{PROGRAM} convert site.npz -"
    script = f"{info} >/dev/full; echo $?; {info} >&-; echo $?; {convert} >&-; echo $?"
    done = subprocess.run(
        ["bash", "-c", script], cwd=files, capture_output=True, text=True, check=False
    )
    assert done.stdout.split() == ["1", "0", "1"]
    full, closed = done.stderr.splitlines()
    assert full == "grid-map: error: No space left on device"
    assert "expected a pipe or a file at standard output" in closed


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_a_signal_ends_it_without_a_traceback_and_without_remains(number, files, tmp_path):
    fifo = tmp_path / "chain.yaml"
    os.mkfifo(fifo)
    words = ["filter", str(fifo), str(files / "survey"), str(tmp_path / "out")]
    process = Process([str(PROGRAM), *words])
    try:
        # Opening it waits for the reader.
        with fifo.open("w"):
            process.send(number)
            assert process.wait() == 128 + number
        assert process.text == ""
        assert [path.name for path in tmp_path.iterdir()] == ["chain.yaml"]
    finally:
        process.kill()


def test_help_comes_without_the_packages_that_take_long_to_import():
    heavy = ("numpy", "cv2", "matplotlib", "yaml", "scipy", "rclpy", "argcomplete", "viser")
    code = (
        "import sys\nfrom grid_map_demos_py.cli.main import make_parser\n"
        "make_parser().format_help()\n"
        f"print([name for name in {heavy} if name in sys.modules])"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout == "[]\n"


def test_files_without_messages_take_no_ros(files, tmp_path):
    code = (
        "import sys\n"
        "for name in ('rclpy', 'grid_map_msgs', 'geometry_msgs', 'sensor_msgs', 'std_msgs'):\n"
        "    sys.modules[name] = None\n"
        "from grid_map_demos_py.cli.main import main\n"
        "print(*(main(line.split()) for line in sys.argv[1:]))\n"
    )
    lines = [
        f"filter {files}/chain.yaml {files}/site.npz out.npz",
        "convert out.npz images --to images",
        f"info {files}/survey",
    ]
    done = subprocess.run(
        [sys.executable, "-c", code, *lines],
        cwd=tmp_path,
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.stdout == "0 0 1\n", done.stderr
    assert "'grid-map doctor' tells what is missing" in done.stderr


def test_without_matplotlib_a_picture_says_what_to_install(files, tmp_path):
    code = (
        "import sys; sys.modules['matplotlib'] = None\n"
        "from grid_map_demos_py.cli.main import main\n"
        "sys.exit(main(sys.argv[1:]))"
    )
    words = ("plot", str(files / "site.npz"), "map.png")
    done = subprocess.run(
        [sys.executable, "-c", code, *words],
        cwd=tmp_path,
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 1
    assert "needs the package 'matplotlib', which is not installed: " in done.stderr


@pytest.mark.parametrize("name", ["info", "inspect", "convert", "filter", "plot", "view", "doctor"])
def test_every_command_has_help(name, command):
    code, text, _ = command(name, "--help")
    assert code == 0
    assert text.startswith(f"usage: grid-map {name}")
    assert name in command("--help")[1]


def test_without_a_command_there_is_help_as_well(command):
    code, text, error = command()
    assert (code, text) == (2, "")
    assert error == command("--help")[1]


def test_it_tells_its_version(command):
    assert command("--version")[1].startswith("grid-map ")
