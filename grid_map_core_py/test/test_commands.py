# SPDX-License-Identifier: BSD-3-Clause
"""The command line with the commands and formats of the core."""

import json
import os
import signal
import subprocess
import sys
from importlib.metadata import EntryPoint, entry_points
from pathlib import Path

import numpy as np
import pytest
from command_line import PROGRAM, SECOND, a_map

from grid_map_core_py import GridMap, __version__
from grid_map_core_py._commands import _main
from grid_map_core_py.files import load_npz, save_npz


@pytest.fixture
def files(tmp_path) -> Path:
    """Return the folder of the test, with a map and other files."""
    save_npz(a_map(), tmp_path / "site.npz")
    (tmp_path / "site.rrd").write_text("no map")
    (tmp_path / "chain.yaml").write_text("filters: {}")
    return tmp_path


@pytest.fixture
def command(files, grid_map_command):  # noqa: ARG001
    """Return `grid_map_command` in the folder with the files."""
    return grid_map_command


def run(*command: str, cwd: Path) -> subprocess.CompletedProcess[str]:
    return subprocess.run(command, cwd=cwd, capture_output=True, text=True, check=False)


# --- info and inspect -----------------------------------------------------------------------------


def test_info_prints_facts_as_json(command):
    found = json.loads(command("info --json site.npz")[1])
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


def test_inspect_gives_statistics_of_finite_values(command):
    values = a_map()["elevation"]
    finite = values[np.isfinite(values)].astype(float)
    found = json.loads(command("inspect site.npz --json --bins 4")[1])
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


def test_inspect_draws_histograms(command):
    line = "inspect site.npz --layer elevation --bins 3 --histogram"
    _, text, _ = command(line)
    head, row, *_, name, low, middle, high = text.splitlines()
    assert head.split()[0] == "layer"
    assert row.split()[0] == name == "elevation"
    assert "4.2%" in row
    bars = [line.count("█") for line in (low, middle, high)]
    counts = [int(line.split()[3]) for line in (low, middle, high)]
    assert sum(counts) == 46
    assert max(bars) == 40
    assert np.argsort(bars).tolist() == np.argsort(counts).tolist()


@pytest.mark.parametrize("value", [0.0, -7.5, 3e38, -1e20])
def test_single_value_is_in_the_middle_of_its_histogram(value, command):
    save_npz(GridMap((1, 1), 0.5, layers={"flat": value}), "flat.npz")
    code, text, error = command("inspect flat.npz --json --bins 5")
    assert code == 0, error
    (flat,) = json.loads(text)["layers"]
    assert (flat["min"], flat["max"], flat["std"]) == (pytest.approx(value), flat["min"], 0.0)
    assert flat["histogram"]["counts"] == [0, 0, 4, 0, 0]


# --- convert --------------------------------------------------------------------------------------


def test_options_of_formats_reach_reader_and_writer(command):
    range_of_gray = "--black -4 --white 4"
    words = f"--layer elevation {range_of_gray} --bits 16"
    assert command(f"convert site.npz site.png {words}")[0] == 0
    words = f"--resolution 0.1 {range_of_gray} --frame odom"
    assert command(f"convert site.png back.npz {words}")[0] == 0
    back, expected = load_npz("back.npz"), load_npz("site.npz")
    assert (back.layers, back.frame_id, back.size) == (("elevation",), "odom", expected.size)
    np.testing.assert_allclose(back["elevation"], expected["elevation"], atol=8 / 65535)
    line = "convert site.npz nav/map.yaml --layer variance --mode raw"
    assert "Pass the values of free and of occupied cells as" in command(line)[2]
    line += " --data-min 0 --data-max 1"
    assert command(line)[0] == 1
    Path("nav").mkdir()
    assert command(line) == (0, "", "grid-map: 1 map in nav/map.yaml\n")
    assert json.loads(command("info nav --json")[1])["format"] == "map_server"
    assert command("convert nav nav/other.yaml")[0] == 0
    assert {path.name for path in Path("nav").iterdir()} == {
        *("map.yaml", "map.pgm", "other.yaml", "other.pgm")
    }


@pytest.mark.needs("rasterio", "pyproj")
def test_the_reference_system_of_a_geotiff_stays(command):
    command("convert site.npz site.tif --crs EPSG:25832 --compress")
    command("convert site.tif same.tif --layer elevation")
    command("convert site.tif other.tif --crs EPSG:25833")
    for name, code in (("same.tif", 25832), ("other.tif", 25833)):
        assert f"crs       EPSG:{code}\n" in command(f"info {name}")[1]
    command("convert site.npz degrees.tif --crs EPSG:4326")
    warning = command("info degrees.tif")[2]
    assert warning.startswith("grid-map: warning: degrees.tif: is in degrees")
    assert warning.count("\n") == 1


def test_maps_go_through_pipes(files):
    pipeline = f"{PROGRAM} convert site.npz - --layer color | {PROGRAM} convert - - | "
    script = f"{pipeline} {PROGRAM} info - --json"
    done = run("bash", "-o", "pipefail", "-c", script, cwd=files)
    assert (done.returncode, done.stderr) == (0, "")
    found = json.loads(done.stdout)
    assert (found["map"]["layers"], found["bytes"]) == (["color"], None)


def test_points_and_meshes_become_maps(command):
    pytest.importorskip("trimesh")
    points = "0.5 0.5 1\n0.6 0.4 3\n1.5 0.5 2\n"
    properties = "".join(f"property float {axis}\n" for axis in "xyz")
    head = f"ply\nformat ascii 1.0\nelement vertex 3\n{properties}end_header\n"
    Path("cloud.ply").write_text(head + points)
    Path("ramp.obj").write_text("v 0 0 0\nv 2 0 2\nv 2 2 2\nv 0 2 0\nf 1 2 3 4\n")
    words = "--resolution 1 --reduce mean --height-layer height"
    assert command(f"convert cloud.ply cloud.npz {words}")[0] == 0
    cloud = load_npz("cloud.npz")
    assert (cloud.frame_id, cloud.layers) == ("map", ("height",))
    assert cloud.at_position("height", (0.55, 0.45)) == 2.0
    assert cloud.at_position("height", (1.5, 0.5)) == 2.0
    assert (cloud.size, cloud.position.tolist()) == ((2, 1), [1.0, 0.5])
    assert command(f"convert cloud.ply tight.npz {words} --tight")[0] == 0
    np.testing.assert_allclose(load_npz("tight.npz").position, (1.0, 0.45))
    assert command("convert ramp.obj ramp.npz --resolution 1")[0] == 0
    assert load_npz("ramp.npz")["elevation"].tolist() == [[1.5, 1.5], [0.5, 0.5]]
    _, text, _ = command("info ramp.obj --json")
    told = json.loads(text)
    assert (told["points"], told["faces"], told["upper"]) == (4, 2, [2.0, 2.0, 2.0])
    for line, expected, text in (
        ("convert ramp.obj x.npz", 1, "resolution: expected the side of a cell [m]"),
        ("convert ramp.obj x.npz --resolution 1 --reduce mean", 1, "tight are for points"),
        ("convert cloud.ply x.npz --resolution 1 --layer z", 1, "no layer 'z'; available: elev"),
        ("info cloud.ply --topic /points", 2, "--topic is for"),
        ("inspect ramp.obj", 1, "the extent is 2 x 2 x 2 m"),
    ):
        code, _, error = command(line)
        assert (code, text in error) == (expected, True), error


# --- errors ---------------------------------------------------------------------------------------

WRONG = {
    "info nowhere": (1, "nowhere: cannot be read: No such file"),
    "info chain.yaml": (1, "with the key 'image'. A filter chain runs with `grid-map filter`"),
    "info site.rrd": (1, "is written, not read; show it by `rerun site.rrd`"),
    "info -": (1, "standard input: cannot be read"),
    "inspect site.npz --bins 0": (2, "--bins: expected a number from 1"),
    "inspect site.npz --from zip": (1, "format: expected one that is read, npz"),
    "convert site.npz chain.yaml": (1, "chain.yaml: already exists; --force replaces it"),
    "convert site.npz site.jpg": (2, "expected a name of one of the formats npz"),
    "convert site.npz - --to geotiff": (2, "standard output takes npz, not geotiff"),
    "convert - x.npz --from geotiff": (2, "standard input takes npz, not geotiff"),
    "convert site.npz nowhere/map.npz": (1, "nowhere/map.npz: cannot be written"),
    "convert site.npz new.npz --crs EPSG:1": (2, "--crs is for geotiff"),
    "convert site.npz new.npz --resolution 1": (2, "--resolution is for height_image, pcd, mesh"),
    "convert site.npz new.npz --reduce mean": (2, "--reduce is for pcd, mesh"),
    "convert site.npz new.npz --as mesh": (2, "--as is for pcd, mesh"),
    "convert site.npz out.png --layer elevation --layer cost": (2, "height_image holds one layer"),
    "convert site.npz out.yaml --layer elevation --layer cost": (2, "map_server holds one layer"),
    "convert site.npz out.pgm": (2, "height_image (.png .tif .tiff)"),
    "convert site.npz new.npz --black 0": (2, "--black is for height_image"),
    "inspect site.npz --bars": (2, "unrecognized arguments: --bars"),
    "info site.npz --ind 0": (2, "unrecognized arguments: --ind 0; did you mean --index?"),
    "inspct": (2, "invalid choice: 'inspct'; known: info, inspect, convert, "),
    "info site.np": (1, "site.np: cannot be read: No such file or directory; did you mean site"),
    "convert site.npz": (2, "required: destination"),
}


@pytest.mark.parametrize("line", WRONG)
def test_every_mistake_is_one_line(line, refused):
    code, error = refused(line)
    expected_code, text = WRONG[line]
    assert (code, text in error) == (expected_code, True), error
    assert not list(Path().glob("out*"))


def test_only_force_replaces_a_file(command):
    for line in ("convert site.npz new.npz", "convert site.npz new.png --layer variance"):
        name = line.split()[2]
        assert command(line)[0] == 0
        before = Path(name).stat().st_ino
        code, _, error = command(line)
        assert (code, f"{name}: already exists; --force replaces it" in error) == (1, True)
        assert Path(name).stat().st_ino == before
        assert command(f"{line} --force")[0] == 0
        assert Path(name).stat().st_ino != before


def test_pipes_and_devices_are_never_replaced(command):
    os.mkfifo("pipe")
    code, _, error = command("convert site.npz pipe --to npz --force")
    assert (code, "pipe: is neither a file nor a folder" in error) == (1, True)
    assert Path("pipe").is_fifo()


def test_invisible_characters_in_names_are_escaped(command):
    save_npz(GridMap((1, 1), 0.5, layers={"\u202ered": 1.0}, frame_id="a\u2028b"), "evil.npz")
    for line in ("info evil.npz", "inspect evil.npz"):
        _, text, _ = command(line)
        assert "\u202e" not in text
        assert "\\u202ered" in text


# --- pipes and exit codes -------------------------------------------------------------------------


def test_a_closed_pipe_ends_it_silently(files):
    script = f"{PROGRAM} info site.npz | head -n 1; {PROGRAM} info site.npz | true"
    done = run("bash", "-c", script, cwd=files)
    assert done.stdout.startswith("site.npz: npz")
    assert done.stderr == ""


def test_full_disk_and_closed_output_are_one_error(files):
    info = f"{PROGRAM} info site.npz"
    convert = f"{PROGRAM} convert site.npz -"
    script = f"{info} >/dev/full; echo $?; {info} >&-; echo $?; {convert} >&-; echo $?"
    done = run("bash", "-c", script, cwd=files)
    assert done.stdout.split() == ["1", "0", "1"]
    full, closed = done.stderr.splitlines()
    assert full == "grid-map: error: No space left on device"
    assert "expected a pipe or a file at standard output" in closed


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGHUP])
def test_signal_ends_it_without_traceback_or_temporary_files(number, tmp_path):
    pipes = {"stdin": subprocess.PIPE, "stderr": subprocess.PIPE}
    command = [str(PROGRAM), "convert", "-", str(tmp_path / "out.npz")]
    environ = {**os.environ, "TMPDIR": str(tmp_path)}
    with subprocess.Popen(command, env=environ, **pipes) as process:
        process.stdin.write(bytes(10**6))
        process.stdin.flush()
        # The command copies standard input to a file first.
        while not any(path.stat().st_size for path in tmp_path.glob("grid-map-*/map.npz")):
            assert process.poll() is None
        process.send_signal(number)
        _, error = process.communicate(timeout=30)
    assert (process.returncode, error) == (-number, b"")
    assert not [*tmp_path.iterdir()]


@pytest.mark.parametrize(("prefix", "numbers"), [([], "2 15 1"), (["nohup"], "2 15")])
def test_hangup_stays_ignored_under_nohup(prefix, numbers, tmp_path):
    code = (
        "from grid_map_core_py._commands import on_end\nprint(*map(int, on_end(lambda *_: None)))"
    )
    done = run(*prefix, sys.executable, "-c", code, cwd=tmp_path)
    assert done.stdout.split() == numbers.split()


# --- commands of packages -------------------------------------------------------------------------


def test_help_imports_neither_packages_nor_numpy(tmp_path):
    heavy = ("numpy", "cv2", "matplotlib", "yaml", "scipy", "rclpy", "argcomplete", "viser")
    code = (
        "import sys\nfrom grid_map_core_py._commands import main\n"
        "try:\n    main(['--help'])\nexcept SystemExit:\n    pass\n"
        f"found = [name for name in {heavy} if name in sys.modules]\n"
        "print(found, [name for name in sys.modules if name.startswith('grid_map_filters')])"
    )
    assert run(sys.executable, "-c", code, cwd=tmp_path).stdout.endswith("\n[] []\n")


@pytest.mark.skipif(
    not entry_points(group="grid_map_core_py.commands"), reason="runs from sources, not installed"
)
def test_commands_of_the_core_work_without_other_packages(files):
    blocked = ("rclpy", "grid_map_msgs", "sensor_msgs", "std_msgs", "mcap", "rasterio", "lark")
    others = ("grid_map_ros_py", "grid_map_filters_py", "grid_map_visualization_py")
    code = (
        f"import sys\nfor name in {(*blocked, *others)}:\n    sys.modules[name] = None\n"
        "from grid_map_core_py._commands import main\n"
        "print([main(line.split()) for line in sys.argv[1:]], file=sys.stderr)\n"
    )
    lines = [
        "inspect site.npz",
        "convert site.npz copy.npz",
        "convert copy.npz slope.png --layer elevation",
        "info copy.npz",
        "info survey.mcap",
        "plot copy.npz map.png",
        "convert copy.npz map.tif",
        "play survey",
    ]
    errors = run(sys.executable, "-c", code, *lines, cwd=files).stderr.splitlines()
    assert errors[-1] == "[0, 0, 0, 0, 1, 1, 1, 1]"
    assert any("play: the" in line and "Source ROS 2, then the w" in line for line in errors)
    assert any("survey.mcap: a bag needs the package 'grid_map_ros_py'" in line for line in errors)
    assert any("plot: the command of grid_map_visualization_py" in line for line in errors)
    assert any("GeoTIFF needs the package 'rasterio'" in line for line in errors)


@pytest.fixture
def plug_in(monkeypatch, tmp_path):
    """Install a package with two commands; one of them is broken."""
    package = tmp_path / "dancing"
    package.mkdir()
    (package / "__init__.py").write_text("raise SystemError('imported')")
    (package / "dance.py").write_text("raise OSError('no shoes')")
    monkeypatch.syspath_prepend(str(tmp_path))
    names = {"dance": "dancing.dance", "gone": "no_such_package.gone", "info": "dancing.info"}
    points = [EntryPoint(name, value, _main.GROUP) for name, value in names.items()]
    monkeypatch.setattr(_main, "entry_points", lambda **_: points)


@pytest.mark.usefixtures("plug_in")
def test_broken_command_leaves_others_usable(command):
    code, text, _ = command("--help")
    assert code == 0
    assert "command of dancing.dance\n" in text
    assert command("info site.npz")[0] == 0
    for name, reason in (("dance", "imported"), ("gone", "No module named 'no_such_package'")):
        code, _, error = command(name)
        assert code == 1
        assert error.startswith(f"grid-map: error: {name}: the command of ")
        assert reason in error


def test_help_is_complete_and_shown_without_a_command(command):
    _, listed, _ = command("--help")
    for name in ("info", "inspect", "convert", "doctor"):
        code, text, _ = command(f"{name} --help")
        assert code == 0
        assert text.startswith(f"usage: grid-map {name}")
        assert name in listed
    ros = [e for e in entry_points(group=_main.GROUP) if e.value.startswith("grid_map_ros_py")]
    assert " ".join(listed.split()).count("(needs ROS 2)") == len(ros)
    assert command("") == (2, "", listed)
    assert command("--version")[1] == f"grid-map {__version__}\n"
