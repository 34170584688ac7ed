# SPDX-License-Identifier: BSD-3-Clause
"""Draw the picture of the page on Nav2: elevation, traversability and costs side by side.

    python3 docs/images/make_nav2_picture.py [FOLDER]

writes `costs.png` into the folder, `docs/images/nav2` by default.
"""

import sys
from pathlib import Path

import matplotlib
from matplotlib.figure import Figure
from PIL import Image

from grid_map_demos_py.terrain import load_terrain
from grid_map_filters_py import FilterChain

FOLDER = Path(__file__).parent / "nav2"
DEMOS = Path(__file__).parents[2] / "grid_map_demos_py"
LAYERS = {
    "elevation": ("gist_earth", "elevation [m]"),
    "traversability": ("BrBG", "traversability"),
    "inflated_cost": ("inferno", "inflated costs"),
}


def main(folder: Path) -> None:
    """Draw the picture."""
    chain = FilterChain.from_yaml(DEMOS / "config" / "nav2_costs_filter_chain.yaml")
    terrain = load_terrain(DEMOS / "data" / "jacksboro_fault_dem.npz")
    grid_map = chain(terrain).get_submap((-2.5, 1.5), (6.0, 6.0))
    figure = Figure(figsize=(9.0, 3.0), dpi=100, layout="constrained")
    for axes, (layer, (colors, title)) in zip(figure.subplots(1, 3), LAYERS.items(), strict=True):
        # Up is +y, and unknown cells are gray.
        color_map = matplotlib.colormaps[colors].with_extremes(bad=(0.86, 0.86, 0.86))
        picture = axes.imshow(
            grid_map.unwrapped(layer)[::-1, :].T, cmap=color_map, interpolation="nearest"
        )
        axes.set_title(title, fontsize=9)
        axes.set(xticks=[], yticks=[])
        figure.colorbar(picture, ax=axes, shrink=0.8, pad=0.02).ax.tick_params(labelsize=7)
    folder.mkdir(parents=True, exist_ok=True)
    path = folder / "costs.png"
    figure.savefig(path)
    # A palette makes the file three times smaller.
    picture = Image.open(path).convert("RGB")
    picture.quantize(256, dither=Image.Dither.NONE).save(path, optimize=True)


if __name__ == "__main__":
    main(Path(sys.argv[1]) if sys.argv[1:] else FOLDER)
