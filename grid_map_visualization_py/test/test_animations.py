# SPDX-License-Identifier: BSD-3-Clause
"""Bags of maps as videos and animated pictures, read back by OpenCV."""

import sys
from pathlib import Path

import cv2
import matplotlib
import numpy as np
import pytest
from matplotlib.axes import Axes

from grid_map_core_py import GridMap, LayerNotFoundError
from grid_map_core_py.errors import ConfigError, MissingPackageError
from grid_map_ros_py.bags import BagReader, BagWriter
from grid_map_visualization_py.pictures import save_animation


@pytest.fixture
def survey(tmp_path) -> Path:
    """A bag of 6 maps at 5 Hz, which move by a meter each, with the values 0 to 5."""
    with BagWriter(tmp_path / "survey") as bag:
        for number in range(6):
            grid_map = GridMap((4.0, 4.0), 0.5, (number, 0.0), {"elevation": number})
            grid_map["elevation"][0, 0] = np.nan if number == 2 else number
            bag.write("/grid_map", grid_map, time=10**12 + number * 200_000_000)
    return tmp_path / "survey"


def frames_of(path: Path) -> tuple[list[np.ndarray], float]:
    """Return the frames (height, width, 3) in BGR, and how many a second has."""
    video = cv2.VideoCapture(str(path))
    frames = []
    while (read := video.read())[0]:
        frames.append(read[1])
    return frames, video.get(cv2.CAP_PROP_FPS)


@pytest.mark.parametrize(
    ("ending", "speed", "count", "rate"),
    [("mp4", 1.0, 6, 5.0), ("gif", 1.0, 6, 5.0), ("gif", 30.0, 2, 50.0)],
)
def test_animation_has_a_frame_per_map(survey, tmp_path, ending, speed, count, rate):
    path = tmp_path / f"survey.{ending}"
    path.write_bytes(b"old")
    told = []
    with BagReader(survey) as records:
        note = lambda *done: told.append(done)  # noqa: E731
        save_animation(records, "elevation", path, speed=speed, dpi=60, progress=note)
    frames, found = frames_of(path)
    assert len(frames) == count
    assert found == pytest.approx(rate, rel=0.02)
    assert [done for done in told if done[0]] == [(6 * n // count, 6) for n in range(1, count + 1)]
    assert len(told) == 6 + count
    assert sorted(file.name for file in tmp_path.iterdir()) == ["survey", path.name]
    if speed == 1.0:
        check_frames(frames)


def check_frames(frames: list[np.ndarray]) -> None:
    """Check that a square moves to the right through the colors of viridis in fixed axes."""
    colors = matplotlib.colormaps["viridis"](np.arange(6) / 5)[:, 2::-1] * 255
    middles = []
    for frame, color in zip(frames, colors, strict=True):
        # The column of the color bar has these colors, too.
        inside = frame[:, : int(0.85 * frame.shape[1])].astype(float)
        is_map = np.abs(inside - color).max(axis=-1) < 12
        middles.append(np.nonzero(is_map)[1].mean())
        assert is_map.sum() > 0.02 * is_map.size
    steps = np.diff(middles)
    assert steps.min() > 0.8 * steps.max() > 10
    # Only the map, the title and the hole change.
    changed = np.ptp(np.array(frames, int), axis=0).max(axis=-1) > 60
    _, columns = np.nonzero(changed)
    assert not changed[: int(0.02 * changed.shape[0])].any()
    assert columns.max() < 0.88 * changed.shape[1]


def test_titles_of_animations_tell_the_time(survey, monkeypatch, tmp_path):
    titles = []
    monkeypatch.setattr(Axes, "set_title", lambda _, text, **__: titles.append(text))
    with BagReader(survey) as records:
        save_animation(records, "", tmp_path / "survey.gif", title="heights", dpi=30)
    assert [text for text in titles if text.endswith(" s")] == [
        f"heights, {0.2 * number:.2f} s" for number in range(6)
    ]


@pytest.mark.parametrize("ending", ["mp4", "gif"])
def test_animation_that_fails_leaves_the_old_file(survey, tmp_path, ending, full_disk):
    path = tmp_path / f"survey.{ending}"
    path.write_bytes(b"old")
    with BagReader(survey) as records:
        with pytest.raises(LayerNotFoundError):
            save_animation(records, "b", path)
        with full_disk(1000), pytest.raises(OSError, match=r"File too large|ffmpeg"):
            save_animation(records, "", path, dpi=30)
    assert path.read_bytes() == b"old"
    assert len([*tmp_path.iterdir()]) == 2


def test_video_without_ffmpeg_is_one_clear_error(survey, tmp_path, monkeypatch):
    monkeypatch.setenv("PATH", str(tmp_path))
    monkeypatch.setitem(sys.modules, "imageio_ffmpeg", None)
    message = "a video needs the package 'ffmpeg', which is not installed: .* or write a .gif file"
    with BagReader(survey) as records, pytest.raises(MissingPackageError, match=message):
        save_animation(records, "", tmp_path / "survey.mp4")
    assert [path.name for path in tmp_path.iterdir()] == ["survey"]


@pytest.mark.parametrize(
    ("name", "options", "message"),
    [
        ("a.avi", {}, "'path': expected a name that ends in .gif or .mp4, got 'a.avi'"),
        ("a.gif", {"speed": 0.0}, "'speed': expected a positive number"),
        ("a.gif", {"speed": 1e-9}, "'speed': expected at least .* lasts at most 655 s, got 1e-09"),
        ("a.gif", {"lower": np.inf}, "'lower': expected a finite number"),
    ],
)
def test_senseless_animation_is_an_error(survey, tmp_path, name, options, message):
    with BagReader(survey) as records, pytest.raises(ConfigError, match=message):
        save_animation(records, "", tmp_path / name, **options)
