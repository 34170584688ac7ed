# Copyright (c) 2026 grid_map_py contributors
# SPDX-License-Identifier: BSD-3-Clause
"""Maps as pictures."""

import matplotlib
import matplotlib.image
import numpy as np
import pytest
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from grid_map_core_py import GridMap, LayerNotFoundError, color_vector_to_value
from grid_map_core_py.errors import ConfigError
from grid_map_core_py.testing import moved_in_buffer
from grid_map_visualization_py.pictures import plot, plot_3d, plot_relief, save_picture

YELLOW, PURPLE = (253, 231, 37), (68, 1, 84)
"""The ends of viridis, which Matplotlib rounds in one way and NumPy in another."""

WHITE = (255, 255, 255)


@pytest.fixture
def corner_map() -> GridMap:
    """A map that is 1 in the corner of the largest x and y, NaN beside it and else 0."""
    grid_map = GridMap((3.0, 2.0), 0.5, (10.0, 20.0), {"a": 0.0, "ground": 0.0})
    grid_map["a"][0, 0] = 1.0
    grid_map["a"][1, 0] = np.nan
    return grid_map


def flat_axes(**options: object) -> Axes:
    figure = Figure()
    FigureCanvasAgg(figure)
    return figure.add_subplot(**options)


def pixels(axes: Axes) -> np.ndarray:
    """Return the image (height, width) or (height, width, 4) on the axes."""
    return axes.images[0].get_array()


def shown_at(axes: Axes, x: float, y: float) -> tuple[int, ...]:
    """Return the color (3,) that a picture has at a position of the map."""
    figure = axes.figure
    figure.canvas.draw()
    column, row = axes.transData.transform((x, y))
    image = np.asarray(figure.canvas.buffer_rgba())
    return tuple(image[image.shape[0] - 1 - int(row), int(column), :3].tolist())


@pytest.mark.parametrize("start", [(0, 0), (3, 2)])
@pytest.mark.parametrize("shade_by", ["", "ground"])
def test_colors_lie_at_their_positions_in_the_map_frame(corner_map, start, shade_by):
    grid_map = moved_in_buffer(corner_map, start)
    axes = plot(grid_map, "a", flat_axes(), shade_by=shade_by)
    assert shown_at(axes, 11.25, 20.75) == pytest.approx(YELLOW, abs=1)
    assert shown_at(axes, 10.75, 20.75) == WHITE
    assert shown_at(axes, 11.25, 19.25) == pytest.approx(PURPLE, abs=1)
    assert shown_at(axes, 8.75, 20.75) == pytest.approx(PURPLE, abs=1)
    assert (axes.get_xlim(), axes.get_ylim()) == ((8.5, 11.5), (19.0, 21.0))
    assert (axes.get_xlabel(), axes.get_ylabel()) == ("x [m]", "y [m]")
    inverted = plot(grid_map, "a", flat_axes(), shade_by=shade_by, invert=True)
    assert shown_at(inverted, 11.25, 20.75) == pytest.approx(PURPLE, abs=1)


def test_color_bar_shows_layer_and_bounds(corner_map):
    axes = plot(corner_map, "a", flat_axes(), lower=-1, label="height [m]", title="A map")
    (bar,) = [other for other in axes.figure.axes if other is not axes]
    assert bar.get_ylabel() == "height [m]"
    assert bar.get_ylim() == (-1.0, 1.0)
    assert axes.get_title() == "A map"
    assert plot(corner_map, "a", flat_axes()).figure.axes[1].get_ylabel() == "a"
    assert len(plot(corner_map, "a", flat_axes(), color_bar=False).figure.axes) == 1


def test_values_stay_under_the_pointer(corner_map):
    image = pixels(plot(corner_map, "a", flat_axes()))
    assert image.shape == (4, 6)
    assert (image[0, -1], bool(image.mask[0, -2]), image.mask.sum()) == (1.0, True, 1)


def test_packed_colors_have_no_color_bar():
    grid_map = GridMap(
        (1, 1), 1.0, layers={"color": color_vector_to_value((255, 128, 0))[None, None]}
    )
    axes = plot(grid_map, "color", flat_axes(), color_mode="color")
    assert shown_at(axes, 0, 0) == pytest.approx((255, 128, 0), abs=1)
    assert len(axes.figure.axes) == 1


def test_slopes_away_from_the_light_are_darker():
    grid_map = GridMap((30, 30), 1.0, layers={"a": 0.5, "z": 0.0, "b": 0.5})
    grid_map["z"][10:20, :] = np.arange(10)[:, None]  # rises towards -x: away from the light
    grid_map["z"][25, 10] = np.nan
    image = pixels(plot(grid_map, "a", flat_axes(), shade_by="z", lower=0, upper=1))
    level, slope = image[15, 2, :3], image[15, 15, :3]
    assert (slope < level).all()
    np.testing.assert_allclose(image[10, 30 - 1 - 25, :3], level)
    assert (image[..., 3] == 1).all()


@pytest.mark.parametrize("size", [(1, 1), (1, 4), (4, 1), (3, 2)])
@pytest.mark.parametrize("value", [np.nan, 1.0, np.inf])
def test_any_map_gives_pictures(size, value):
    grid_map = GridMap(size, 1.0, layers={"a": value})
    plot(grid_map, "a", flat_axes(), shade_by="a").figure.canvas.draw()
    plot_3d(grid_map, "a", flat_axes(projection="3d")).figure.canvas.draw()
    plot_relief(grid_map, "a", flat_axes(), size=(40, 30)).figure.canvas.draw()


def test_surface_in_three_dimensions_has_the_triangles_of_the_map(corner_map):
    axes = plot_3d(corner_map, "a", flat_axes(projection="3d"), color_layer="ground", label="g")
    (surface,) = axes.collections
    # 3 x 5 squares; two of them have three heights.
    assert len(surface.get_facecolor()) == 2 * 13 + 2
    assert (axes.get_xlim(), axes.get_ylim()) == ((8.5, 11.5), (19.0, 21.0))
    assert axes.figure.axes[1].get_ylabel() == "g"


def relief_of(grid_map: GridMap, **options: object) -> np.ndarray:
    axes = plot_relief(grid_map, "z", flat_axes(), size=(120, 90), **options)
    return np.asarray(pixels(axes)).astype(int)


def hill_map() -> GridMap:
    grid_map = GridMap((30, 20), 0.5, layers={"z": 0.0, "side": 0.0})
    x, y = (axis.reshape(grid_map.size, order="F") for axis in grid_map.get_positions().T)
    grid_map["z"] = 3 * np.exp(-(x**2 + y**2) / 20)
    grid_map["side"] = y > 0
    return grid_map


def test_relief_fills_the_picture_and_leaves_the_background_white():
    shown = (relief_of(hill_map()) < 255).any(axis=-1)
    rows, columns = np.flatnonzero(shown.any(axis=1)), np.flatnonzero(shown.any(axis=0))
    assert (np.ptp(rows) > 0.9 * 90) or (np.ptp(columns) > 0.9 * 120)
    assert not shown[[0, 0, -1, -1], [0, -1, 0, -1]].any()


@pytest.mark.parametrize(("azimuth", "left"), [(0.0, "brown"), (np.pi, "teal")])
def test_relief_is_seen_from_the_azimuth(azimuth, left):
    # Seen from +x, +y is to the right.
    image = relief_of(hill_map(), azimuth=azimuth, color_layer="side", color_map="BrBG")
    red, _, blue = np.moveaxis(image, -1, 0)
    brown_columns = np.nonzero(red > blue + 40)[1]
    teal_columns = np.nonzero(blue > red + 40)[1]
    assert min(len(brown_columns), len(teal_columns)) > 500
    assert (np.median(brown_columns) < np.median(teal_columns)) == (left == "brown")


def test_relief_of_a_moved_map_is_the_same():
    grid_map = hill_map()
    np.testing.assert_array_equal(relief_of(grid_map), relief_of(moved_in_buffer(grid_map, (7, 5))))


def test_relief_wall_casts_its_shadow_away_from_the_sun():
    # The sun stands to the left of the camera.
    grid_map = GridMap((30, 20), 0.5, layers={"z": 0.0, "white": 1.0})
    grid_map["z"][25:35, 18:20] = 4.0
    view = {"azimuth": 0.0, "elevation": 0.8}
    image = relief_of(
        grid_map, color_layer="white", color_map="gray", lower=0.0, upper=1.5, **view
    )[..., 1]
    level = np.median(image[(image > 100) & (image < 255)])
    # The cut sides are even darker.
    _, shadow = np.nonzero((image > 100) & (image < 0.85 * level))
    assert len(shadow) > 50
    assert np.median(shadow) > 60


@pytest.mark.parametrize(
    ("draw", "options", "message"),
    [
        (plot_relief, {"elevation": 0.0}, "'elevation': expected an angle between 0 and pi / 3"),
        (plot_relief, {"azimuth": np.nan}, "'azimuth': expected a finite angle"),
        (plot_relief, {"size": (0, 5)}, "'size': expected a width and height"),
        (plot, {"color_map": "virids"}, "'virids'; did you mean viridis"),
        (plot, {"color_mode": "rainbow"}, "'color_mode': expected one of .* got 'rainbow'"),
        (plot_3d, {"ax": flat_axes()}, "'ax': expected axes of the projection '3d'"),
        (plot_3d, {"max_drawn_cells": 3}, "'max_drawn_cells': expected 0 .* at least 9, got 3"),
        *(
            (draw, {"exaggeration": factor}, "'exaggeration': expected a positive number")
            for draw in (plot, plot_3d, plot_relief)
            for factor in (0.0, -1.0, np.nan, np.inf)
        ),
    ],
)
def test_senseless_option_is_an_error(corner_map, draw, options, message):
    axes = flat_axes(projection="3d") if draw is plot_3d else flat_axes()
    with pytest.raises(ConfigError, match=message):
        draw(corner_map, "a", **{"ax": axes, **options})


@pytest.mark.parametrize(("layer", "options"), [("b", {}), ("a", {"shade_by": "b"})])
def test_missing_layer_is_named_beside_existing_ones(corner_map, layer, options):
    with pytest.raises(LayerNotFoundError, match="no layer 'b'; available: a, ground"):
        plot(corner_map, layer, flat_axes(), **options)


def test_plot_uses_the_current_axes_of_pyplot(corner_map):
    matplotlib.use("agg")
    from matplotlib import pyplot

    try:
        assert plot(corner_map, "a") is pyplot.gcf().axes[0]
        assert plot_3d(corner_map, "a") is pyplot.gcf().axes[0]
    finally:
        pyplot.close("all")


# --- on disk --------------------------------------------------------------------------------------


@pytest.mark.parametrize("style", ["flat", "surface", "relief"])
def test_saved_picture_replaces_the_old_file(corner_map, tmp_path, style):
    path = tmp_path / "picture.png"
    path.write_bytes(b"old")
    save_picture(corner_map, "a", path, style=style, title="t", label="a")
    image = matplotlib.image.imread(path)
    assert image.shape[0] > 300
    assert len(np.unique(image.reshape(-1, image.shape[-1]), axis=0)) > 50
    assert [file.name for file in tmp_path.iterdir()] == ["picture.png"]


@pytest.mark.parametrize(
    ("ending", "start"),
    [("jpg", b"\xff\xd8\xff"), ("JPEG", b"\xff\xd8\xff"), ("png", b"\x89PNG"), ("pdf", b"%PDF")],
)
def test_ending_of_the_name_decides_the_kind_of_picture(corner_map, tmp_path, ending, start):
    path = tmp_path / f"map.{ending}"
    save_picture(corner_map, "a", path)
    assert path.read_bytes().startswith(start)


@pytest.mark.parametrize("name", ["map.bmp", "map", "map.png.old", ".png"])
def test_name_with_another_ending_is_refused(corner_map, tmp_path, name):
    expected = "'path': expected a name that ends in .jpeg, .jpg, .pdf, .png, .svg, got"
    with pytest.raises(ConfigError, match=expected):
        save_picture(corner_map, "a", tmp_path / name)
    assert [*tmp_path.iterdir()] == []


def test_failed_picture_keeps_the_old_one(corner_map, tmp_path):
    path = tmp_path / "picture.png"
    path.write_bytes(b"old")
    with pytest.raises(LayerNotFoundError):
        save_picture(corner_map, "b", path)
    assert path.read_bytes() == b"old"
    assert [file.name for file in tmp_path.iterdir()] == ["picture.png"]


@pytest.mark.parametrize("limit", [0, 1000, 5000])
@pytest.mark.parametrize("ending", ["png", "pdf", "svg"])
def test_full_disk_keeps_the_old_picture(tmp_path, corner_map, full_disk, limit, ending):
    path = tmp_path / f"picture.{ending}"
    path.write_bytes(b"old")
    with full_disk(limit), pytest.raises(OSError, match="File too large"):
        save_picture(corner_map, "a", path, title="picture")
    assert path.read_bytes() == b"old"
    assert [*tmp_path.iterdir()] == [path]
    with pytest.raises(FileNotFoundError, match=f"there is no folder {tmp_path}/none: '.*picture"):
        save_picture(corner_map, "a", tmp_path / "none" / path.name)
