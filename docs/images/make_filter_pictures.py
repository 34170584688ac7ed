# SPDX-License-Identifier: BSD-3-Clause
"""Draw the pictures of the pages on filters: a map before and after the chain of the page.

    python3 docs/images/make_filter_pictures.py [FOLDER]

writes one PNG per filter into the folder, `docs/images/filters` by default. A filter without an
entry in `PICTURES` is an error.
"""

import re
import sys
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path

import matplotlib
import numpy as np
import yaml
from matplotlib.axes import Axes
from matplotlib.colors import LightSource, Normalize
from matplotlib.figure import Figure

from grid_map_core_py import GridMap, color_value_to_vector, color_vector_to_value
from grid_map_filters_py import FilterChain
from grid_map_filters_py._registry import BUILT_IN

FOLDER = Path(__file__).parent / "filters"
PAGES = Path(__file__).parents[1] / "filters"
SIZE, RESOLUTION = (108, 72), 0.05
WIDTH, HEIGHT, DPI = 6.8, 2.35, 100
LIGHT = LightSource(azdeg=315.0, altdeg=45.0)
MISSING = (0.86, 0.86, 0.86)

Draw = Callable[[Axes, GridMap], None]


# --- layers and colors ----------------------------------------------------------------------------


def shaded(layer: str, limits: tuple[float, float] = (-0.6, 1.0)) -> Draw:
    """Return a function that draws heights: colored by height, lit from the upper left."""

    def draw(axes: Axes, grid_map: GridMap) -> None:
        heights = upright(grid_map.unwrapped(layer)).astype(np.float64)
        known = np.isfinite(heights)
        ground = np.where(known, heights, upright(grid_map.unwrapped("filled")))
        colors = matplotlib.colormaps["gist_earth"](Normalize(*limits)(ground))[..., :3]
        image = LIGHT.shade_rgb(
            colors, ground, vert_exag=1.0, dx=RESOLUTION, dy=RESOLUTION, blend_mode="soft"
        )
        image[~known] = MISSING
        show(axes, image, layer)

    return draw


def values(
    layer: str, limits: tuple[float, float] | None = None, colors: str = "viridis", unit: str = ""
) -> Draw:
    """Return a function that draws a layer with a color bar; missing cells are gray."""

    def draw(axes: Axes, grid_map: GridMap) -> None:
        numbers = upright(grid_map.unwrapped(layer))
        known = numbers[np.isfinite(numbers)]
        low, high = limits or (float(known.min()), float(known.max()))
        title = f"{layer} [{unit}]" if unit else layer
        picture = show(axes, numbers, title, cmap=colored(colors), vmin=low, vmax=high)
        axes.figure.colorbar(picture, ax=axes, shrink=0.8, pad=0.02).ax.tick_params(labelsize=7)

    return draw


def rgb(layer: str) -> Draw:
    """Return a function that draws a layer of packed colors."""

    def draw(axes: Axes, grid_map: GridMap) -> None:
        image = color_value_to_vector(upright(grid_map.unwrapped(layer)))
        show(axes, np.where(np.isnan(image), MISSING, image), layer)

    return draw


def buffer(layer: str) -> Draw:
    """Return a function that draws a layer as stored in the circular buffer."""

    def draw(axes: Axes, grid_map: GridMap) -> None:
        picture = {"cmap": colored("gist_earth"), "vmin": -0.6, "vmax": 1.0}
        show(axes, upright(grid_map[layer]), f"start index {grid_map.start_index}", **picture)

    return draw


def layer_names(axes: Axes, grid_map: GridMap) -> None:
    """List the layers of a map."""
    axes.set_title("layers", fontsize=8)
    axes.set(xticks=[], yticks=[])
    axes.text(0.5, 0.5, "\n".join(grid_map), ha="center", va="center", fontsize=11)


def valid_cells(axes: Axes, grid_map: GridMap) -> None:
    """Draw which cells have a value in all basic layers."""
    names = grid_map.basic_layers
    valid = np.isfinite([grid_map[name] for name in names]).all(axis=0)
    show(axes, upright(valid), f"valid by {', '.join(names)}", cmap="Greens", vmin=0, vmax=1.5)


def show(axes: Axes, image: object, title: str, **style: object) -> object:
    """Draw an image without axes."""
    axes.set_title(title, fontsize=8)
    axes.set(xticks=[], yticks=[])
    return axes.imshow(image, interpolation="nearest", **style)


def colored(name: str) -> object:
    """Return a color map whose missing values are gray."""
    return matplotlib.colormaps[name].with_extremes(bad=MISSING)


def upright(layer: np.ndarray) -> np.ndarray:
    """Return a layer as an image with x to the right and y upwards: (cols, rows)."""
    return layer[::-1, :].T


# --- input maps -----------------------------------------------------------------------------------


def scene() -> GridMap:
    """Return ground with a hill, a box, a curb, a rough patch, and the holes that sensors leave."""
    grid_map = GridMap(np.multiply(SIZE, RESOLUTION), RESOLUTION)
    x, y = (axis.reshape(grid_map.size, order="F") for axis in grid_map.get_positions().T)
    random = np.random.default_rng(11)
    ground = 0.8 * np.exp(-((x + 1.3) ** 2 + (y - 0.4) ** 2) / 0.8) + 0.04 * np.sin(3 * x + y)
    ground[(np.abs(x - 0.8) < 0.45) & (np.abs(y - 0.7) < 0.4)] = 0.6
    ground += np.where(y < -0.9 - 0.15 * x, -0.2, 0.0)
    rough = (x - 1.7) ** 2 + (y + 0.5) ** 2 < 0.36
    ground += random.normal(scale=np.where(rough, 0.06, 0.008))
    spread = 0.01 + 0.02 * (x - x.min()) ** 2 / 5
    grid_map["variance"] = np.where((x > 1.9) & (y > 0.9), np.nan, spread)
    grid_map["color"] = checkered(x, y, ground)
    for center, radii in [
        ((-0.2, -0.4), (0.35, 0.2)),
        ((-1.9, -1.0), (0.18, 0.18)),
        ((1.55, 0.7), (0.3, 0.45)),
        ((2.7, -1.2), (0.5, 0.35)),
    ]:
        ground[((x - center[0]) / radii[0]) ** 2 + ((y - center[1]) / radii[1]) ** 2 < 1] = np.nan
    ground[random.random(ground.shape) < 0.01] = np.nan
    grid_map["elevation"] = ground
    return FilterChain.from_config(PREPARATION)(grid_map)


def checkered(x: np.ndarray, y: np.ndarray, heights: np.ndarray) -> np.ndarray:
    """Return the colors of a camera: tints by height on a chequered floor."""
    tints = matplotlib.colormaps["terrain"](0.25 + 0.6 * (heights + 0.3))[..., :3]
    floor = np.where((np.floor(x / 0.6) + np.floor(y / 0.6)) % 2, 1.0, 0.75)
    return color_vector_to_value(np.clip(tints * floor[..., None], 0, 1))


def step(type_name: str, **params: object) -> dict[str, object]:
    """Return a step of a chain."""
    return {"name": f"{type_name} {sorted(params.items())}", "type": type_name, "params": params}


PREPARATION = [
    step("gridMapCv/InpaintFilter", input_layer="elevation", output_layer="filled", radius=0.1),
    step(
        "gridMapFilters/NormalVectorsFilter",
        input_layer="filled",
        output_layers_prefix="normal_",
        normal_vector_positive_axis="z",
        radius=0.12,
    ),
    step("gridMapFilters/NormalColorMapFilter", input_layers_prefix="normal_", output_layer="tint"),
    step("gridMapFilters/SlopeFilter", input_layers_prefix="normal_", output_layer="slope"),
    step(
        "gridMapFilters/RoughnessFilter",
        input_layer="filled",
        output_layer="roughness",
        radius=0.15,
    ),
    step(
        "gridMapFilters/StepHeightFilter",
        input_layer="filled",
        output_layer="step_height",
        radius=0.1,
    ),
    step(
        "gridMapFilters/MeanInRadiusFilter", input_layer="filled", output_layer="mean", radius=0.2
    ),
    step(
        "gridMapFilters/CostFilter",
        input_layer="step_height",
        output_layer="costs",
        free_value=0.05,
        lethal_value=0.4,
    ),
]


# --- the pictures ---------------------------------------------------------------------------------


@dataclass(frozen=True)
class Picture:
    """Layers to draw before and after the chain on the page of a filter."""

    before: Draw = field(default_factory=lambda: shaded("elevation"))
    after: Draw = field(default_factory=lambda: shaded("result"))
    start_index: tuple[int, int] = (0, 0)
    without: tuple[str, ...] = ()


FILLED = shaded("filled")
RED = (0.85, 0.2, 0.15)
DERIVED = ("costs", "filled", "mean", "normal_x", "normal_y", "normal_z", "roughness", "slope")
DERIVED += ("step_height", "tint")

PICTURES: dict[str, Picture] = {
    "gridMapCv/InpaintFilter": Picture(),
    "gridMapFilters/BilateralFilter": Picture(FILLED),
    "gridMapFilters/BufferNormalizerFilter": Picture(
        buffer("elevation"), buffer("elevation"), start_index=(40, 25)
    ),
    "gridMapFilters/ColorBlendingFilter": Picture(rgb("color"), rgb("result")),
    "gridMapFilters/ColorFillFilter": Picture(after=rgb("result")),
    "gridMapFilters/ColorMapFilter": Picture(after=rgb("result")),
    "gridMapFilters/CostFilter": Picture(
        values("slope", (0, 1.2), unit="rad"), values("result", (0, 254), "inferno")
    ),
    "gridMapFilters/CurvatureFilter": Picture(
        shaded("mean"), values("result", (-12, 12), "coolwarm", "1/m")
    ),
    "gridMapFilters/DeletionFilter": Picture(layer_names, layer_names, without=DERIVED),
    "gridMapFilters/DilationFilter": Picture(),
    "gridMapFilters/DuplicationFilter": Picture(),
    "gridMapFilters/ErosionFilter": Picture(),
    "gridMapFilters/FootprintFilter": Picture(
        values("costs", (0, 254), "inferno"), values("result", (0, 254), "inferno")
    ),
    "gridMapFilters/GaussianBlurFilter": Picture(),
    "gridMapFilters/InflationFilter": Picture(
        values("costs", (0, 254), "inferno"), values("result", (0, 254), "inferno")
    ),
    "gridMapFilters/LightIntensityFilter": Picture(rgb("tint"), rgb("result")),
    "gridMapFilters/MathExpressionFilter": Picture(FILLED, values("result", (0, 0.2), unit="m")),
    "gridMapFilters/MeanInRadiusFilter": Picture(),
    "gridMapFilters/MedianFillFilter": Picture(),
    "gridMapFilters/MinInRadiusFilter": Picture(),
    "gridMapFilters/NormalColorMapFilter": Picture(
        values("normal_x", (-1, 1), "coolwarm"), rgb("result")
    ),
    "gridMapFilters/NormalVectorsFilter": Picture(after=values("result_x", (-1, 1), "coolwarm")),
    "gridMapFilters/PlanarRegionsFilter": Picture(FILLED, values("result", colors="tab20")),
    "gridMapFilters/RoughnessFilter": Picture(after=values("result", (0, 0.08), unit="m")),
    "gridMapFilters/SetBasicLayersFilter": Picture(valid_cells, valid_cells),
    "gridMapFilters/SlidingWindowMathExpressionFilter": Picture(
        values("slope", (0, 1.2), unit="rad"), values("result", (0, 0.5), "magma", "rad")
    ),
    "gridMapFilters/SlopeFilter": Picture(after=values("result", (0, 1.2), unit="rad")),
    "gridMapFilters/StepHeightFilter": Picture(after=values("result", (0, 0.7), unit="m")),
    "gridMapFilters/ThresholdFilter": Picture(after=shaded("elevation")),
    "gridMapFilters/TraversabilityFilter": Picture(FILLED, values("result", (0, 1), "BrBG")),
}


def file_name(type_name: str) -> str:
    """Return the file name of a filter: `mean_in_radius` for MeanInRadiusFilter."""
    words = re.findall(r"[A-Z][a-z]*", type_name.partition("/")[2].removesuffix("Filter"))
    return "_".join(words).lower()


def chain_of(type_name: str) -> FilterChain:
    """Return the first chain on the page of a filter."""
    page = (PAGES / f"{file_name(type_name)}.md").read_text(encoding="utf-8")
    _, _, block = page.partition("```yaml\n")
    return FilterChain.from_config(yaml.safe_load(block.partition("```")[0])["grid_map_filters"])


def draw(type_name: str, grid_map: GridMap, path: Path) -> None:
    """Draw a map before and after a filter."""
    picture = PICTURES[type_name]
    before = grid_map.without_layers(picture.without).with_start_index(picture.start_index)
    before.basic_layers = ["elevation"]
    after = chain_of(type_name)(before)
    figure = Figure(figsize=(WIDTH, HEIGHT), dpi=DPI, layout="constrained")
    left, right = figure.subplots(1, 2)
    picture.before(left, before)
    picture.after(right, after)
    # Without its version, which matplotlib would leave in the file.
    figure.savefig(path, metadata={"Software": None})


def main(folder: Path) -> None:
    """Draw all pictures."""
    folder.mkdir(parents=True, exist_ok=True)
    grid_map = scene()
    for type_name in BUILT_IN:
        draw(type_name, grid_map, folder / f"{file_name(type_name)}.png")


if __name__ == "__main__":
    main(Path(sys.argv[1]) if sys.argv[1:] else FOLDER)
