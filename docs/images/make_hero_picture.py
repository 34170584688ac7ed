# SPDX-License-Identifier: BSD-3-Clause
"""Draw the picture of the README: terrain in relief, colored by traversability.

    python3 docs/images/make_hero_picture.py [FOLDER]

writes `traversability.png` into the folder, `docs/images` by default. `make demo` draws the same
from the messages of its nodes.
"""

import sys
from pathlib import Path

from PIL import Image

from grid_map_demos_py.terrain import load_terrain
from grid_map_filters_py import FilterChain
from grid_map_visualization_py.pictures import save_picture

FOLDER = Path(__file__).parent
DEMOS = Path(__file__).parents[2] / "grid_map_demos_py"
CHAIN = DEMOS / "config" / "filters_demo_filter_chain.yaml"
TERRAIN = DEMOS / "data" / "jacksboro_fault_dem.npz"
COLORS = 256
"""A palette makes the file three times smaller."""


def main(folder: Path) -> None:
    """Draw the picture."""
    folder.mkdir(parents=True, exist_ok=True)
    path = folder / "traversability.png"
    save_picture(
        FilterChain.from_yaml(CHAIN)(load_terrain(TERRAIN)),
        "elevation_inpainted",
        path,
        style="relief",
        color_layer="traversability",
        color_map="BrBG",
        lower=0.2,
        upper=1.0,
        exaggeration=1.3,
        label="traversability (1: flat and even)",
    )
    picture = Image.open(path).convert("RGB")
    picture.quantize(COLORS, dither=Image.Dither.NONE).save(path, optimize=True)


if __name__ == "__main__":
    main(Path(sys.argv[1]) if sys.argv[1:] else FOLDER)
