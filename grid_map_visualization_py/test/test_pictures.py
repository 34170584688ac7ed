# SPDX-License-Identifier: BSD-3-Clause
"""Maps as pictures."""

import itertools
import math

import matplotlib.image
import numpy as np
import pytest
from matplotlib import pyplot
from matplotlib.axes import Axes
from matplotlib.backend_bases import MouseEvent
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.patches import Rectangle

from grid_map_core_py import GridMap, LayerNotFoundError, color_vector_to_value
from grid_map_core_py.errors import ConfigError
from grid_map_core_py.map import GridGeometry
from grid_map_core_py.testing import moved_in_buffer
from grid_map_core_py.tiled import open_map
from grid_map_visualization_py.pictures import plot, plot_3d, plot_relief, save_picture

YELLOW, PURPLE = (253, 231, 37), (68, 1, 84)
"""The ends of viridis, which Matplotlib rounds in one way and NumPy in another."""


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


def drawn(axes: Axes) -> np.ndarray:
    """Return the picture (height, width, 4)."""
    axes.figure.canvas.draw()
    return np.asarray(axes.figure.canvas.buffer_rgba())


def shown_at(axes: Axes, x: float, y: float) -> tuple[int, ...]:
    """Return the color (3,) that a picture has at a position of the map."""
    image = drawn(axes)
    column, row = axes.transData.transform((x, y))
    return tuple(image[image.shape[0] - 1 - int(row), int(column), :3].tolist())


@pytest.mark.parametrize("start", [(0, 0), (3, 2)])
@pytest.mark.parametrize("hillshade", [None, "ground"])
def test_colors_lie_at_their_positions_in_the_map_frame(corner_map, start, hillshade):
    grid_map = moved_in_buffer(corner_map, start)
    options = {"hillshade": hillshade, "scale_bar": False}
    axes = plot(grid_map, "a", flat_axes(), **options)
    assert shown_at(axes, 11.25, 20.75) == pytest.approx(YELLOW, abs=1)
    red, green, blue = shown_at(axes, 10.75, 20.75)
    assert red == green == blue < 240
    assert shown_at(axes, 11.25, 19.25) == pytest.approx(PURPLE, abs=1)
    assert shown_at(axes, 8.75, 20.75) == pytest.approx(PURPLE, abs=1)
    assert (axes.get_xlim(), axes.get_ylim()) == ((8.5, 11.5), (19.0, 21.0))
    assert (axes.get_xlabel(), axes.get_ylabel()) == ("x [m]", "y [m]")
    inverted = plot(grid_map, "a", flat_axes(), invert=True, **options)
    assert shown_at(inverted, 11.25, 20.75) == pytest.approx(PURPLE, abs=1)


def test_color_bar_shows_layer_and_bounds(corner_map):
    axes = plot(corner_map, "a", flat_axes(), lower=-1, label="height [m]", title="A map")
    (bar,) = [other for other in axes.figure.axes if other is not axes]
    assert bar.get_ylabel() == "height [m]"
    assert bar.get_ylim() == (-1.0, 1.0)
    assert axes.get_title() == "A map"
    assert plot(corner_map, "a", flat_axes()).figure.axes[1].get_ylabel() == "a"
    assert len(plot(corner_map, "a", flat_axes(), color_bar=False).figure.axes) == 1


@pytest.mark.parametrize("hillshade", [False, "ground"])
def test_pointer_tells_values_of_lit_pictures_too(corner_map, hillshade):
    axes = plot(corner_map, "a", flat_axes(), hillshade=hillshade)
    axes.figure.canvas.draw()
    (image,) = axes.images
    told = []
    for place in ((11.25, 20.75), (8.75, 19.25), (10.75, 20.75)):
        x, y = axes.transData.transform(place)
        told.append(image.get_cursor_data(MouseEvent("move", axes.figure.canvas, x, y)))
    assert told[:2] == [1.0, 0.0]
    assert np.ma.is_masked(told[2])
    assert image.format_cursor_data(told[0]) == "[1.000]"


@pytest.mark.parametrize("draw", [plot, plot_3d, plot_relief])
def test_color_bar_of_an_empty_layer_says_so(corner_map, draw):
    corner_map["slope"] = np.inf
    axes = flat_axes(**({"projection": "3d"} if draw is plot_3d else {}))
    draw(corner_map, "slope", axes)
    *_, bar = (*axes.figure.axes, *axes.child_axes)
    assert "slope [rad]: all cells unknown" in (bar.get_xlabel(), bar.get_ylabel())
    assert len([*bar.get_xticks(), *bar.get_yticks()]) == 0


@pytest.mark.parametrize("draw", [plot, plot_3d])
def test_ticks_show_whole_coordinates(draw):
    axes = flat_axes(**({"projection": "3d"} if draw is plot_3d else {}))
    far = GridMap((4.0, 3.0), 0.1, (691_600.0, 5_399_500.0), {"elevation": 1.0})
    draw(far, "elevation", axes).figure.canvas.draw()
    assert "5399500.0" in [text.get_text() for text in axes.get_yticklabels()]


def test_large_coordinates_fit_into_a_new_figure():
    pyplot.close("all")
    far = GridMap((4.0, 3.0), 0.1, (539_953.4, 5_819_504.2), {"elevation": 1.0})
    figure = far.plot("elevation").figure
    figure.canvas.draw()
    (x_left, x_right), _ = figure.axes[0].viewLim.get_points().T
    texts = figure.axes[0].get_xticklabels()
    boxes = [one.get_window_extent() for one in texts if x_left <= one.get_position()[0] <= x_right]
    assert len(boxes) > 2
    assert all(left.x1 < right.x0 for left, right in itertools.pairwise(boxes))
    assert min(one.get_window_extent().x0 for one in figure.axes[0].get_yticklabels()) >= 0
    pyplot.close(figure)


def test_packed_colors_have_no_color_bar():
    orange = color_vector_to_value((255, 128, 0))
    grid_map = GridMap((1, 1), 1.0, layers={"color": orange})
    axes = plot(grid_map, "color", flat_axes(), color_mode="color")
    assert shown_at(axes, 0, 0) == pytest.approx((255, 128, 0), abs=1)
    assert len(axes.figure.axes) == 1


@pytest.mark.parametrize(
    ("layer", "unit"),
    [
        *(("elevation_smooth", "m"), ("Height", "m"), ("dem", "m"), ("demand", "")),
        *(("elevation_variance", ""), ("heightmap_color", "")),
        *(("slope_max", "rad"), ("slope_deg", "")),
    ],
)
def test_layers_of_heights_are_lit_and_have_a_unit(layer, unit):
    is_lit = unit == "m"
    grid_map = GridMap((3, 2), 0.5, layers={layer: 0.0})
    grid_map[layer][2:] = 1.0
    axes = plot(grid_map, layer, flat_axes())
    assert (pixels(axes).ndim == 3) == is_lit
    assert axes.figure.axes[1].get_ylabel() == (f"{layer} [{unit}]" if unit else layer)
    assert pixels(plot(grid_map, layer, flat_axes(), hillshade=False)).ndim == 2
    assert pixels(plot(grid_map, layer, flat_axes(), hillshade=layer)).ndim == 3


def test_true_lights_the_heights_of_the_map(corner_map):
    with pytest.raises(ConfigError, match="'hillshade': expected a layer of heights, one of a, gr"):
        plot(corner_map, "a", flat_axes(), hillshade=True)
    corner_map["height"] = 0.0
    corner_map["elevation"] = np.arange(6.0)[:, None] * np.ones(4)
    expected = pixels(plot(corner_map, "a", flat_axes(), hillshade="elevation"))
    found = pixels(plot(corner_map, "a", flat_axes(), hillshade=True))
    np.testing.assert_array_equal(found, expected)


def test_slopes_away_from_the_light_are_darker():
    grid_map = GridMap((30, 30), 1.0, layers={"a": 0.5, "z": 0.0, "b": 0.5})
    grid_map["z"][10:20, :] = np.arange(10)[:, None]  # rises towards -x: away from the light
    grid_map["z"][25, 10] = np.nan
    image = pixels(plot(grid_map, "a", flat_axes(), hillshade="z", lower=0, upper=1))
    level, slope = image[15, 2, :3], image[15, 15, :3]
    assert (slope < level).all()
    np.testing.assert_allclose(image[10, 30 - 1 - 25, :3], level)
    assert (image[..., 3] == 1).all()


@pytest.mark.parametrize("size", [(1, 1), (1, 4), (3, 2)])
@pytest.mark.parametrize("value", [np.nan, np.inf, 3e38])
@pytest.mark.filterwarnings("error")
def test_any_map_gives_pictures(size, value):
    grid_map = GridMap(size, 1.0, layers={"a": value})
    grid_map["a"][0, 0] *= -1
    plot(grid_map, "a", flat_axes(), hillshade="a").figure.canvas.draw()
    plot_3d(grid_map, "a", flat_axes(projection="3d")).figure.canvas.draw()
    relief = plot_relief(grid_map, "a", flat_axes(), size=(40, 30))
    relief.figure.canvas.draw()
    block = relief.images[0].get_array()
    is_explained = any(axes.get_legend() for axes in relief.child_axes)
    has_values = bool(np.isfinite(value))
    assert ((block < 255).any(), is_explained) == (has_values, not has_values)


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
        (plot, {"color_mode": "rainbow"}, "'color_mode': expected one of .* got 'rainbow'"),
        (plot_3d, {"ax": flat_axes()}, "'ax': expected axes of the projection '3d'"),
        (plot_3d, {"max_drawn_cells": 3}, "'max_drawn_cells': expected 0 .* at least 9, got 3"),
        *(
            (draw, {"exaggeration": factor}, "'exaggeration': expected a positive number")
            for draw, factor in ((plot, 0.0), (plot_3d, -1.0), (plot_relief, np.inf))
        ),
    ],
)
def test_senseless_option_is_an_error(corner_map, draw, options, message):
    axes = flat_axes(projection="3d") if draw is plot_3d else flat_axes()
    with pytest.raises(ConfigError, match=message):
        draw(corner_map, "a", **{"ax": axes, **options})


@pytest.mark.parametrize(("layer", "options"), [("b", {}), ("a", {"hillshade": "b"})])
def test_missing_layer_is_named_beside_existing_ones(corner_map, layer, options):
    with pytest.raises(LayerNotFoundError, match="no layer 'b'; available: a, ground"):
        plot(corner_map, layer, flat_axes(), **options)


def test_plot_uses_the_current_axes_of_pyplot(corner_map):
    for draw in (plot, plot_3d):
        assert draw(corner_map, "a") is pyplot.gcf().axes[0]
        pyplot.close("all")


# --- holes, scale and north -----------------------------------------------------------------------


def legends(axes: Axes) -> list[str]:
    """Return the texts of all legends of a figure."""
    found = [other.get_legend() for other in (axes, *axes.child_axes, *axes.figure.axes)]
    return [text.get_text() for legend in dict.fromkeys(found) if legend for text in legend.texts]


@pytest.mark.parametrize("options", [{}, {"color_bar": False}, {"color_mode": "color"}])
def test_holes_are_hatched_and_in_the_legend(corner_map, options):
    axes = plot(corner_map, "a", flat_axes(), **options)
    assert legends(axes) == (["no value"] if options.get("color_bar", True) else [])
    assert axes.patches[0].get_hatch()
    axes = plot(corner_map, "ground", flat_axes(), **options)
    assert (legends(axes), [*axes.patches]) == ([], [])


@pytest.mark.parametrize("draw", [plot_3d, plot_relief])
def test_gray_cells_of_surfaces_are_in_the_legend(corner_map, draw):
    shape = {"projection": "3d"} if draw is plot_3d else {}
    axes = draw(corner_map, "ground", flat_axes(**shape), color_layer="a")
    assert legends(axes) == ["no value"]
    assert legends(draw(corner_map, "ground", flat_axes(**shape))) == []


@pytest.mark.parametrize(
    ("resolution", "length", "text"),
    [(0.5, 5.0, "5 m"), (0.0006, 0.005, "5 mm"), (0.02, 0.2, "20 cm"), (100.0, 1000.0, "1 km")],
)
def test_scale_bar_is_as_long_as_it_says(resolution, length, text):
    grid_map = GridMap((40 * resolution, 10 * resolution), resolution, layers={"a": 1.0})
    axes = plot(grid_map, "a", flat_axes())
    (bar,) = axes.artists
    assert bar.txt_label.get_text() == text
    axes.figure.canvas.draw()
    (box,) = bar.size_bar.findobj(Rectangle)
    inside = box.get_window_extent().transformed(axes.transData.inverted())
    assert inside.width == pytest.approx(length, rel=0.02)
    assert len(plot(grid_map, "a", flat_axes(), scale_bar=False).artists) == 0


@pytest.mark.needs("xarray", "pyproj")
def test_maps_with_a_reference_system_show_north(corner_map):
    dataset = corner_map.to_xarray(crs="EPSG:25832")
    for kind in (dataset, dataset["a"], open_map(dataset)):
        _, north = plot(kind, "a", flat_axes()).artists
        assert north.txt.get_text().endswith("N")
    assert len(plot(corner_map.to_xarray(), "a", flat_axes()).artists) == 1


# --- other kinds of maps, and larger ones ---------------------------------------------------------


@pytest.mark.parametrize("style", ["flat", "relief", "surface"])
def test_maps_plot_themselves(corner_map, style):
    axes = flat_axes(**({"projection": "3d"} if style == "surface" else {}))
    assert corner_map.plot("a", axes, style=style, title="A map") is axes
    assert len(axes.collections if style == "surface" else axes.images) == 1
    assert axes.get_title() == "A map"


@pytest.mark.needs("xarray")
def test_datasets_and_tiled_maps_give_the_same_pictures(corner_map):
    corner_map["elevation"] = corner_map["a"] + np.arange(6.0)[:, None]
    grid_map = moved_in_buffer(corner_map, (3, 2))
    dataset = grid_map.to_xarray()
    ascending = dataset.sortby(["x", "y"]).transpose("y", "x")
    kinds = (dataset, dataset["elevation"], ascending, open_map(dataset))
    for draw, options in ((plot, {}), (plot_3d, {"projection": "3d"}), (plot_relief, {})):
        expected = drawn(draw(grid_map, "", flat_axes(**options)))
        for kind in kinds if draw is plot else kinds[:1]:
            found = drawn(draw(kind, "", flat_axes(**options)))
            np.testing.assert_allclose(np.int16(found), expected, atol=3)
    with pytest.raises(ConfigError, match=r"expected a GridMap, a TiledMap, or .* got an array"):
        plot(np.zeros((3, 3)), "a", flat_axes())


def shown_blocks(axes: Axes) -> tuple[np.ndarray, np.ndarray]:
    """Return the drawn values or colors in map order, and their opacities."""
    image = axes.images[0]
    array = np.ma.filled(image.get_array(), np.nan)[:, ::-1].swapaxes(0, 1)
    if array.ndim == 3:
        return array[..., :3], array[..., 3]
    opacity = image.get_alpha()
    return array, np.isfinite(array) if opacity is None else opacity[:, ::-1].T


@pytest.mark.parametrize("size", [(1, 1), (30, 1), (1, 31), (12, 9), (13, 10)])
@pytest.mark.parametrize("mode", ["intensity", "color"])
@pytest.mark.parametrize("start", [(0, 0), (11, 8)])
def test_blocks_have_the_means_of_their_cells(size, mode, start):
    random = np.random.default_rng(5)
    grid_map = GridMap.from_geometry(GridGeometry.from_size(size, 0.5, (3.0, 4.0)), layers=["a"])
    red, green, blue = random.integers(0, 256, (3, *size))
    packed = (red * 2**16 + green * 2**8 + blue).astype(np.uint32).view(np.float32)
    values = packed if mode == "color" else random.normal(size=size).astype(np.float32)
    values[random.random(size) < 0.15] = np.nan
    values[random.random(size) < 0.1] = np.inf
    grid_map["a"] = values
    moved = moved_in_buffer(grid_map, (start[0] % size[0], start[1] % size[1]))
    axes = plot(moved, "a", flat_axes(), color_mode=mode, max_drawn_cells=9)
    means, opacity = shown_blocks(axes)
    side = math.ceil(math.sqrt(size[0] * size[1] / 9))
    assert opacity.shape == tuple(-(-cells // side) for cells in size)
    for row, column in np.ndindex(opacity.shape):
        here = np.s_[row * side : (row + 1) * side, column * side : (column + 1) * side]
        kept = np.isfinite(values[here])
        share = kept.mean()
        partial = min(max(share, 1 / 3), 2 / 3)
        assert opacity[row, column] == pytest.approx(share if share in (0, 1) else partial)
        if share and mode == "color":
            mean = [channel[here][kept].mean() / 255 for channel in (red, green, blue)]
            np.testing.assert_allclose(means[row, column], mean, rtol=1e-5)
        elif share:
            mean = values[here][kept].astype(float).mean()
            np.testing.assert_allclose(means[row, column], mean, atol=1e-6)
    # The blocks begin at the largest x and y; the axes end with the map.
    _, right, _, top = axes.images[0].get_extent()
    assert (right, top) == (axes.get_xlim()[1], axes.get_ylim()[1])
    assert axes.get_xlim()[1] == 3.0 + size[0] / 4
    assert axes.get_xlim()[0] == 3.0 - size[0] / 4


def test_large_maps_are_drawn_at_the_pixels_of_the_axes():
    grid_map = GridMap((200.0, 150.0), 0.1, layers={"a": 0.0})
    grid_map["a"][1234, 567] = np.nan
    grid_map["a"][0, 0] = 1.0
    axes = plot(grid_map, "a", flat_axes())
    height, width = pixels(axes).shape
    assert 250 < width < 500
    assert width * 1500 == pytest.approx(height * 2000, rel=0.01)
    # The bounds are those of the cells, not of the means.
    assert axes.images[0].norm.vmax == 1.0
    # The single hole is lighter than the dark ground around it.
    image = drawn(axes)[::-1]
    column, row = axes.transData.transform((100 - 123.45, 75 - 56.75)).astype(int)
    around = image[row - 2 : row + 3, column - 2 : column + 3, 1]
    assert around.max() > 40 > around.min()
    assert pixels(plot(grid_map, "a", flat_axes(), max_drawn_cells=0)).shape == (1500, 2000)


@pytest.mark.needs("rasterio", "xarray", "dask")
def test_rasters_are_drawn_from_their_overviews(tmp_path):
    import rasterio

    grid_map = GridMap((256.0, 192.0), 0.1, layers=["elevation"])
    x, y = grid_map.axes()
    grid_map["elevation"] = 0.1 * x[:, None] + np.sin(0.1 * y)
    path = tmp_path / "map.tif"
    open_map(grid_map.to_xarray()).to_geotiff(path)
    expected = plot(grid_map, "", flat_axes(), hillshade=False)
    # A base that is damaged is not read.
    with rasterio.open(path, "r+", IGNORE_COG_LAYOUT_BREAK="YES") as raster:
        window = ((0, 64), (0, raster.width))
        raster.write(np.full((1, 64, raster.width), np.nan, np.float32), window=window)
    found = plot(open_map(path), "", flat_axes(), hillshade=False)
    for place in ((-120.0, 94.0), (0.0, 95.0), (100.0, 0.0), (127.0, -95.0)):
        assert shown_at(found, *place) == pytest.approx(shown_at(expected, *place), abs=8)


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


JPEG = b"\xff\xd8\xff"
"""The first bytes of an image file."""


@pytest.mark.parametrize(
    ("ending", "start"), [("jpg", JPEG), ("JPEG", JPEG), ("pdf", b"%PDF"), ("SVG", b"<?xml")]
)
def test_ending_of_the_name_decides_the_kind_of_picture(corner_map, tmp_path, ending, start):
    path = tmp_path / f"map.{ending}"
    save_picture(corner_map, "a", path, dpi=30)
    assert path.read_bytes().startswith(start)


@pytest.mark.parametrize("name", ["map.bmp", "map", "map.png.old", ".png"])
def test_name_with_another_ending_is_refused(corner_map, tmp_path, name):
    expected = "'path': expected a name that ends in .jpeg, .jpg, .pdf, .png or .svg, got"
    with pytest.raises(ConfigError, match=expected):
        save_picture(corner_map, "a", tmp_path / name)
    assert [*tmp_path.iterdir()] == []


@pytest.mark.parametrize("ending", ["png", "pdf"])
def test_failures_keep_the_old_picture(tmp_path, corner_map, full_disk, ending):
    path = tmp_path / f"picture.{ending}"
    path.write_bytes(b"old")
    with pytest.raises(LayerNotFoundError):
        save_picture(corner_map, "b", path)
    with full_disk(1000), pytest.raises(OSError, match="File too large"):
        save_picture(corner_map, "a", path)
    assert path.read_bytes() == b"old"
    assert [*tmp_path.iterdir()] == [path]
    with pytest.raises(FileNotFoundError, match=f"there is no folder {tmp_path}/none: '.*picture"):
        save_picture(corner_map, "a", tmp_path / "none" / path.name)
