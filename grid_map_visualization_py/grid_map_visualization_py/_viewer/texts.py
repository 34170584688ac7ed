# SPDX-License-Identifier: BSD-3-Clause
"""Status, legend and cell values as HTML; names are escaped."""

import math
from collections.abc import Iterable
from dataclasses import replace
from datetime import UTC, datetime
from html import escape

import numpy as np

from grid_map_core_py import GridMap
from grid_map_core_py._arrays import Positions, Size

from ..colors import Coloring
from .glb import on_screen

TEXT = "font-size:0.8em;padding:0 1em"

FIRST_DATE = 1e9
"""Smallest time shown as a date [s]; smaller times are treated as simulation times."""


def as_table(rows: Iterable[tuple[str, str]]) -> str:
    cells = "".join(
        f"<tr><td>{escape(name)}</td><td style='text-align:right'>{escape(value)}</td></tr>"
        for name, value in rows
    )
    return f"<div style='{TEXT}'><table style='width:100%'>{cells}</table></div>"


def as_note(text: str) -> str:
    return f"<div style='{TEXT}'>{escape(text)}</div>"


def status(
    grid_map: GridMap,
    shown: Size,
    rate: float,
    silence: float,
    now: int,
    *,
    is_paused: bool = False,
) -> str:
    """Return the HTML table with the status of the map.

    `rate` is the map rate [Hz]. `silence` is the time since the last map [s]. `now` is in ns.
    """
    stamp = grid_map.timestamp
    age = 1e-9 * (now - stamp)
    cells = "{} x {}".format(*grid_map.size)
    thinned = "{} x {} of {}".format(*shown, cells)
    return as_table(
        [
            ("Frame", grid_map.frame_id or "(none)"),
            ("Cells", cells if shown == grid_map.size else thinned),
            ("Resolution", f"{grid_map.resolution:g} m"),
            ("Time", _time(1e-9 * stamp) if stamp else "(none)"),
            ("Age", f"{age:.{1 if abs(age) < 10 else 0}f} s" if stamp else "(unknown)"),
            ("Rate", f"{rate:.1f} Hz"),
            ("Last map", f"{silence:.0f} s ago{', paused' if is_paused else ''}"),
        ]
    )


def _time(seconds: float) -> str:
    if seconds < FIRST_DATE:
        return f"{seconds:.3f} s"
    date = datetime.fromtimestamp(seconds, UTC)
    return f"{date:%Y-%m-%d %H:%M:%S}.{date.microsecond // 100_000} UTC"


def legend(coloring: Coloring, bounds: tuple[float, float], title: str) -> str:
    """Return a color bar (HTML) with a title and the bounds; NaN bounds are omitted."""
    # The browser interpolates between 16 colors.
    colors = replace(coloring, lower=0.0, upper=1.0)(np.linspace(0, 1, 16, dtype=np.float32))
    stops = ",".join("rgb({},{},{})".format(*color) for color in on_screen(colors).tolist())
    lower, upper = ("" if math.isnan(bound) else f"{bound:.4g}" for bound in bounds)
    return (
        f"<div style='{TEXT}'><b>{escape(title)}</b>"
        f"<div style='height:1em;background:linear-gradient(to right,{stops})'></div>"
        f"<div style='display:flex;justify-content:space-between'><span>{lower}</span>"
        f"<span>{upper}</span></div></div>"
    )


def readout(grid_map: GridMap, position: Positions) -> str:
    """Return an HTML table with all values of the cell at `position` (2,) [m, map frame].

    The map must be unwrapped.
    """
    place = [("x", f"{position[0]:.3f} m"), ("y", f"{position[1]:.3f} m")]
    if not grid_map.is_inside(position):
        return as_table([*place, ("cell", "outside the map")])
    row, column = grid_map.get_index(position)
    # A list of pairs, not a dict, because layers may be called x, y or cell.
    values = [(layer, _text(layer, grid_map[layer][row, column])) for layer in grid_map.layers]
    table = as_table([*place, ("cell", f"{row}, {column}"), *values])
    return f"<div style='max-height:40vh;overflow:auto'>{table}</div>"


def _text(layer: str, value: np.float32) -> str:
    if math.isnan(value):
        return "no data"
    if layer.endswith("color"):
        return "#{:02x}{:02x}{:02x}".format(*Coloring("color")(np.array(value)).tolist())
    return f"{value:.6g}"
