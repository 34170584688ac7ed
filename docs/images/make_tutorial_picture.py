# SPDX-License-Identifier: BSD-3-Clause
"""Draw the picture of the tutorial: by the filter, the chain and the options on the page.

    python3 docs/images/make_tutorial_picture.py [FOLDER]

writes `flood.png` into the folder, `docs/images/tutorial` by default.
"""

import re
import sys
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import yaml
from PIL import Image

from grid_map_core_py import save
from grid_map_core_py._commands import main as grid_map
from grid_map_demos_py.terrain import load_terrain
from grid_map_filters_py import FilterChain

FOLDER = Path(__file__).parent / "tutorial"
PAGE = Path(__file__).parents[1] / "tutorial.md"
TERRAIN = Path(__file__).parents[2] / "grid_map_demos_py" / "data" / "jacksboro_fault_dem.npz"
COLORS = 256
"""A palette makes the file three times smaller."""


def file(text: str, name: str) -> str:
    """Return the text of a file on the page."""
    return re.findall(rf'^```\w+ file="\S+/{name}"\n(.*?)^```$', text, re.MULTILINE | re.DOTALL)[0]


def main(folder: Path) -> None:
    """Draw the picture."""
    text = PAGE.read_text()
    names: dict[str, Any] = {"__name__": "flood_filter"}
    exec(file(text, "flood_filter.py"), names)  # noqa: S102
    parameters = yaml.safe_load(file(text, "flood.yaml"))["grid_map_filters"]["ros__parameters"]
    fill, flood = parameters["filters"].values()
    terrain = FilterChain.from_config([fill])(load_terrain(TERRAIN))
    options = re.findall(r"snapshot --topic \S+ (.*?)--out", text, re.DOTALL)[0].replace("\\", "")
    folder.mkdir(parents=True, exist_ok=True)
    path = folder / "flood.png"
    with TemporaryDirectory() as scratch:
        flooded = Path(scratch) / "flooded.npz"
        save(names["Flood"](**flood["params"])(terrain), flooded)
        assert grid_map(["plot", "--force", str(flooded), str(path), *options.split()]) == 0
    picture = Image.open(path).convert("RGB")
    picture.quantize(COLORS, dither=Image.Dither.NONE).save(path, optimize=True)


if __name__ == "__main__":
    main(Path(sys.argv[1]) if sys.argv[1:] else FOLDER)
