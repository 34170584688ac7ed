# SPDX-License-Identifier: BSD-3-Clause
"""Contents of `grid-map view`: rectangles, thinned maps, and bags that are too long."""

import re
import signal
from collections.abc import Callable
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from recordings import Row, rows_of

from grid_map_core_py import GridMap
from grid_map_ros_py.bags import BagWriter

pytestmark = pytest.mark.needs("mcap", "pyproj", "rasterio", "rerun", "xarray", "zarr")

CENTER = (691_600.0, 5_335_000.0)
"""Place in Munich, in the coordinates of EPSG:25832 [m]."""

Shown = tuple[dict[str, list[Row]], str]


@pytest.fixture
def shown(command, monkeypatch) -> Callable[[str], Shown]:
    """Function that runs `grid-map view` with words; it returns the rows shown, and the messages.

    The recording goes to a file in place of a page, and Ctrl-C comes as soon as it is complete.
    """
    import rerun as rr

    class Recording(rr.RecordingStream):
        def flush(self, **options: float) -> None:
            super().flush(**options)
            signal.raise_signal(signal.SIGINT)

    def run(words: str) -> Shown:
        recording = Recording("grid_map")
        recording.save("shown.rrd")
        server = SimpleNamespace(recording=recording, page_url="http://here", is_public=False)
        server.problem, server.close = "", recording.flush
        target = "grid_map_visualization_py._rerun.server.Server"
        monkeypatch.setattr(target, lambda *_, **__: server)
        code, output, error = command(f"view {words}")
        assert (code, output) == (0, "http://here\n"), error
        recording.disconnect()
        return rows_of(Path("shown.rrd")), error

    return run


@pytest.fixture(scope="module")
def files(tmp_path_factory) -> Path:
    """A folder with a sloping plane in files of several formats."""
    from grid_map_core_py import save
    from grid_map_core_py.tiled import open_map

    folder = tmp_path_factory.mktemp("files")
    whole = GridMap((90.0, 60.0), 0.1, CENTER, {"elevation": 0.0}, frame_id="utm")
    x, y = np.meshgrid(*whole.axes(), indexing="ij")
    whole["elevation"] = 0.1 * (x - CENTER[0]) + 0.2 * (y - CENTER[1])
    site = open_map(whole.to_xarray(crs="EPSG:25832"), chunks=64)
    site.to_zarr(folder / "site.zarr")
    site.to_geotiff(folder / "site.tif", cog=True)
    save(whole, folder / "site.npz")
    with BagWriter(folder / "survey") as bag:
        for number in range(4):
            bag.write("/grid_map", whole, time=(number + 1) * 10**9)
    return folder


@pytest.fixture
def command(grid_map_command, files):
    """Return `grid_map_command` in a folder with links to the files."""
    for file in files.iterdir():
        Path(file.name).symlink_to(file)
    return grid_map_command


def points_of(rows: dict[str, list[Row]], name: str = "/site") -> np.ndarray:
    """Return the vertices (N, 3) of a surface, relative to `CENTER`."""
    (row,) = rows[f"{name}/surface"]
    points = row["Mesh3D:vertex_positions"].reshape(-1, 3) + row["InstancePoses3D:translations"]
    frames = [one for path, (one, *_) in rows.items() if path.startswith("/tf/")]
    (frame,) = row["CoordinateFrame:frame"]
    (origin,) = [
        one["Transform3D:translation"] for one in frames if one["Transform3D:child_frame"] == frame
    ]
    return points + (origin - [*CENTER, 0.0])


@pytest.mark.parametrize(
    ("name", "place"),
    [
        ("site.zarr", "--position"),
        ("site.zarr", "--lat"),
        ("site.tif", "--position"),
        ("site.tif", "--lat"),
        ("survey", "--index 0 --position"),
    ],
)
def test_rectangle_of_a_file_is_shown_alone(shown, name, place):
    from pyproj import Transformer

    x, y = 12.04, -7.03
    where = f"{place} {CENTER[0] + x} {CENTER[1] + y}"
    if place == "--lat":
        to_earth = Transformer.from_crs("EPSG:25832", "EPSG:4326")
        latitude, longitude = to_earth.transform(CENTER[0] + x, CENTER[1] + y)
        where = f"--lat {latitude} --lon {longitude}"
    rows, error = shown(f"{name} {where} --length 4 3")
    assert error == ""
    points = points_of(rows, f"/{Path(name).stem}")
    for axis, (center, side) in enumerate([(x, 4.0), (y, 3.0)]):
        found = points[:, axis].min(), points[:, axis].max()
        np.testing.assert_allclose(found, [center - side / 2, center + side / 2], atol=0.1)
    np.testing.assert_allclose(points[:, 2], points[:, :2] @ [0.1, 0.2], atol=1e-4)


NEITHER = "expected --position or --lat and --lon, with --length; got"


@pytest.mark.parametrize(
    ("words", "code", "text"),
    [
        ("site.zarr --position 999 0 --length 5 5", 1, "(999.0, 0.0) of length (5.0, 5.0) does no"),
        ("site.tif --position 1 nan --length 5 5", 1, "position: expected two finite numbers, got"),
        ("site.tif --position 1 2 --length -5 5", 1, "length: expected no negative numbers"),
        ("site.zarr --position 1 2", 2, f"{NEITHER} --position"),
        ("site.zarr --lon 11", 2, f"{NEITHER} --lon"),
        ("site.zarr --lat 48 --length 5 5", 2, f"{NEITHER} --lat and --length"),
        ("site.tif --lat 95 --lon 11 --length 5 5", 2, "--lat and --lon: expected a place in"),
        ("site.npz --lat 48 --lon 11 --length 5 5", 1, "are for zarr and geotiff, and this is npz"),
        ("survey --position 1 2 --length 5 5", 2, "a rectangle needs one map of the bag: select"),
        ("site.zarr --most-shown 0", 2, "--most-shown: expected a positive number, got 0"),
        ("site.zarr --port 99999", 1, "served at 127.0.0.1:99999: bind(): port must be 0-65535"),
        ("site.zarr --layer elevtion", 1, "no layer 'elevtion'; available: elevation"),
    ],
)
def test_mistakes_are_one_line(words, code, text, refused):
    found, error = refused(f"view {words}")
    assert (found, text in error) == (code, True), error


@pytest.mark.parametrize("name", ["site.zarr", "site.tif"])
def test_map_beyond_the_limit_is_thinned(shown, name):
    rows, error = shown(f"{name} --max-cells 300000")
    step = int(re.fullmatch(r"grid-map: one of (\d+) x \1 cells is shown; .*\n", error)[1])
    points = points_of(rows)
    assert 50_000 < len(points) <= 300_000
    for axis, side in enumerate((90.0, 60.0)):
        steps = np.diff(np.unique(np.round(points[:, axis], 3)))
        np.testing.assert_allclose(steps, 0.1 * step, rtol=0.02)
        assert side - 0.2 * step < np.ptp(points[:, axis]) < side
    # Cells of an overview are means, which may lie half a cell beside their places.
    np.testing.assert_allclose(points[:, 2], points[:, :2] @ [0.1, 0.2], atol=0.015 * step)


def test_bag_without_the_color_layer_is_a_warning(shown):
    rows, error = shown("survey --color-layer nope")
    assert not any("Mesh3D:vertex_positions" in row for row in rows["/grid_map/surface"])
    assert error == "grid-map: warning: no map has the layer 'nope', so there is no surface\n"


def test_bag_is_shown_up_to_a_size(shown):
    assert len(shown("survey")[0]["/grid_map/surface"]) == 4
    rows, error = shown("survey --most-shown 20")
    times = [row.times["log_time"] for row in rows["/grid_map/surface"]]
    assert times == [10**9, 2 * 10**9]
    text = "messages after 2.000 s are left out: 20 MB are full (--most-shown)"
    assert error == f"grid-map: {text}\n"
