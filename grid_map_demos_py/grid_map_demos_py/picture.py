# Copyright (c) 2026 grid_map_py contributors
# SPDX-License-Identifier: BSD-3-Clause
"""Pictures of maps."""

from pathlib import Path

import matplotlib
import numpy as np
import numpy.typing as npt
from matplotlib.colors import LightSource, Normalize
from matplotlib.figure import Figure

from grid_map_core_py import GridMap

LIGHT = LightSource(azdeg=315.0, altdeg=45.0)


def save_picture(
    grid_map: GridMap,
    layer: str,
    path: Path,
    *,
    shade_by: str,
    title: str,
    label: str,
    color_map: str = "gist_earth",
    limits: tuple[float, float] | None = None,
    exaggeration: float = 1.5,
) -> None:
    """Write a layer as a hill-shaded picture with axes in metres and a colour bar.

    Args:
        grid_map: the map.
        layer: gives the colours; cells that are not finite are left white.
        path: PNG file, replaced once the new one is complete.
        shade_by: layer of heights [m] that the light falls on, without NaN.
        title: above the picture.
        label: of the colour bar.
        color_map: name in matplotlib.
        limits: values at the ends of the colour map; None means the range of the layer.
        exaggeration: factor on the heights for the shading.
    """
    values = upright(grid_map, layer)
    low, high = limits or _range(values)
    normalize = Normalize(low, high)
    colors = matplotlib.colormaps[color_map](normalize(np.nan_to_num(values, nan=low)))
    shaded = LIGHT.shade_rgb(
        colors[..., :3],
        upright(grid_map, shade_by).astype(np.float64),
        vert_exag=exaggeration,
        dx=grid_map.resolution,
        dy=grid_map.resolution,
        blend_mode="soft",
    )
    shaded[~np.isfinite(values)] = 1.0
    figure = Figure(figsize=(9.0, 7.0), dpi=110, layout="constrained")
    axes = figure.add_subplot()
    axes.imshow(shaded, extent=extent(grid_map), interpolation="nearest")
    axes.set(title=title, xlabel="x [m]", ylabel="y [m]")
    mappable = matplotlib.cm.ScalarMappable(normalize, color_map)
    figure.colorbar(mappable, ax=axes, label=label, shrink=0.85)
    temporary = path.with_name(f".{path.name}.part")
    try:
        figure.savefig(temporary, format="png")
        temporary.replace(path)
    finally:
        temporary.unlink(missing_ok=True)


def _range(values: npt.NDArray[np.float32]) -> tuple[float, float]:
    finite = values[np.isfinite(values)]
    return (float(finite.min()), float(finite.max())) if finite.size else (0.0, 1.0)


def upright(grid_map: GridMap, layer: str) -> npt.NDArray[np.float32]:
    """Return a layer as an image with x to the right and y upwards: (cols, rows)."""
    return grid_map.unwrapped(layer)[::-1, :].T


def extent(grid_map: GridMap) -> tuple[float, float, float, float]:
    """Return the smallest and largest x, then y, of the map [m]."""
    (x0, y0), (x1, y1) = (grid_map.position + side * 0.5 * grid_map.length for side in (-1.0, 1.0))
    return float(x0), float(x1), float(y0), float(y1)
