# SPDX-License-Identifier: BSD-3-Clause
"""Representations of maps in notebooks: an HTML table with small pictures, and a PNG picture.

Pictures show the map from above, with x to the right and y upwards. Colors range from dark blue
(smallest finite value) to yellow (largest). NaN cells are transparent. Layers whose name ends in
`color` are treated as packed colors.
"""

from __future__ import annotations

import base64
import html

import cv2
import numpy as np

from .._arrays._checks import as_text
from .._arrays._statistics import max_of_finites, mean_of_finites, min_of_finites
from ._grid_map import GridMap

THUMBNAIL = 96  # longer side of a layer's picture in the table [pixels]
PICTURE = 480  # longer side of the single picture [pixels]
_OPAQUE = 255


def to_html(grid_map: GridMap) -> str:
    title = (
        f"GridMap: {grid_map.size[0]} x {grid_map.size[1]} cells of {grid_map.resolution:g} m, "
        f"{as_text(grid_map.length)} m around {as_text(grid_map.position)} "
        f"in {grid_map.frame_id!r}, {grid_map.timestamp} ns"
    )
    columns = ("layer", "min", "max", "mean", "NaN", "")
    head = "".join(f"<th>{name}</th>" for name in columns)
    body = "".join(_row(grid_map, layer) for layer in grid_map)
    return f"<p>{html.escape(title)}</p><table><tr>{head}</tr>{body}</table>"


def to_png(grid_map: GridMap) -> bytes | None:
    """Return a PNG of the first basic layer, else of the first layer; None without layers."""
    layers = (*grid_map.basic_layers, *grid_map.layers)
    return _png(grid_map, layers[0], PICTURE) if layers else None


def _row(grid_map: GridMap, layer: str) -> str:
    name = html.escape(layer)
    values = grid_map[layer]
    shown = [f"<b>{name}</b>" if layer in grid_map.basic_layers else name]
    if layer.endswith("color"):
        shown += 3 * [""]
    else:
        numbers = (min_of_finites(values), max_of_finites(values), mean_of_finites(values))
        shown += [f"{number:.4g}" for number in numbers]
    shown.append(f"{np.isnan(values).mean():.1%}")
    picture = base64.b64encode(_png(grid_map, layer, THUMBNAIL)).decode()
    shown.append(f'<img alt="{name}" src="data:image/png;base64,{picture}">')
    return "<tr>" + "".join(f"<td>{cell}</td>" for cell in shown) + "</tr>"


def _png(grid_map: GridMap, layer: str, side: int) -> bytes:
    """Return a PNG picture whose longer side has `side` pixels."""
    # The first cell has the largest x and y; the first pixel shows the smallest x and largest y.
    values = grid_map.unwrapped(layer).T[:, ::-1]
    height, width = values.shape
    scale = side / max(height, width)
    shape = max(1, round(scale * width)), max(1, round(scale * height))
    resized = cv2.resize(np.ascontiguousarray(values), shape, interpolation=cv2.INTER_NEAREST)
    seen = np.asarray(resized, np.float32)
    if layer.endswith("color"):
        from ..conversions._packed_colors import color_value_to_bytes

        pixels = np.stack(color_value_to_bytes(seen)[::-1], axis=-1)
    else:
        # The colors span the range of the whole layer. `fmax` turns NaN into 0.
        low, high = min_of_finites(grid_map[layer]), max_of_finites(grid_map[layer])
        factor = _OPAQUE / (high - low) if high > low else 0.0
        with np.errstate(over="ignore", invalid="ignore"):
            steps = (seen - np.float32(low)) * np.float32(factor)
        steps = np.fmin(np.fmax(steps, 0), _OPAQUE).astype(np.uint8)
        pixels = np.asarray(cv2.applyColorMap(steps, cv2.COLORMAP_VIRIDIS), np.uint8)
    alpha = np.where(np.isnan(seen), 0, _OPAQUE).astype(np.uint8)
    _, data = cv2.imencode(".png", np.dstack([pixels, alpha]))
    return data.tobytes()
