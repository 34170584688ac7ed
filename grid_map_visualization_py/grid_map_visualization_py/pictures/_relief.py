# SPDX-License-Identifier: BSD-3-Clause
"""Perspective picture of a height field, with cast shadows and ambient occlusion.

The floating horizon algorithm traces one ray per picture column over the ground, from near to far.
It draws the parts that rise above all nearer parts. Vertical lines stay vertical.

The unit of length is one cell. Ground coordinates (x, y) start at the center of the first cell.
"""

from functools import partial
from typing import TypeAlias

import numpy as np
import numpy.typing as npt
from scipy import ndimage

from ..colors import Colors

Floats: TypeAlias = npt.NDArray[np.floating]

_sampled = partial(ndimage.map_coordinates, order=1, mode="nearest")

MAX_SIDE = 1500
"""Maximum number of rows and columns; larger maps are downsampled."""

_SUPERSAMPLING = 2
_GAMMA = 2.2
_SUN_AZIMUTH, _SUN_ELEVATION = np.radians(75.0), np.radians(38.0)  # to the left of the camera
_SUNLIGHT, _SKYLIGHT = np.array([1.04, 1.0, 0.93]), np.array([0.86, 0.95, 1.12])
_SKIRT = np.array([0.085, 0.08, 0.075])  # linear color of the cut sides
_DISTANCE = 1.8  # ground distance from the map center to the camera [map diagonals]
_MARGIN = 0.03
_STEEPEST = 20.0  # maximum ratio of height to longer side; higher blocks would be too thin


def draw_relief(
    heights: Floats,
    colors: Colors,
    size: tuple[int, int],
    azimuth: float,
    elevation: float,
    scale: float,
) -> Colors:
    """Return a picture (height, width, 3) of the terrain on a white background.

    See `plot_relief` for `size`, `azimuth` and `elevation`.

    Args:
        heights: (nx, ny) heights; NaN is drawn at the height of the nearest cell.
        colors: (nx, ny, 3) red, green, blue.
        scale: factor that converts the heights to cells and exaggerates them.
    """
    width, height = (_SUPERSAMPLING * side for side in size)
    picture = np.ones((height, width, 3))
    step = -(-max(heights.shape) // MAX_SIDE)
    # Differences of large heights would overflow float32.
    heights, colors = heights[::step, ::step].astype(np.float64), colors[::step, ::step]
    # Interpolation between cell centers requires two cells per axis.
    sides = [(0, max(0, 2 - side)) for side in heights.shape]
    heights, colors = np.pad(heights, sides, "edge"), np.pad(colors, [*sides, (0, 0)], "edge")
    if np.isfinite(heights).any():
        _, nearest = ndimage.distance_transform_edt(~np.isfinite(heights), return_indices=True)
        heights = heights[tuple(nearest)]
        heights = (heights - heights.min()) * (scale / step)
        most = _STEEPEST * max(heights.shape)
        heights *= most / max(most, heights.max())
        _draw(picture, heights, (colors / 255) ** _GAMMA, azimuth, elevation)
    picture = picture.reshape(size[1], _SUPERSAMPLING, size[0], _SUPERSAMPLING, 3).mean(axis=(1, 3))
    pixels: Colors = np.rint(255 * np.clip(picture, 0.0, 1.0) ** (1 / _GAMMA)).astype(np.uint8)
    return pixels


def _draw(
    picture: Floats, heights: Floats, colors: Floats, azimuth: float, elevation: float
) -> None:
    """Draw the terrain into `picture`; heights are in cells, and the smallest height is 0."""
    rows, columns, _ = picture.shape
    last = np.array(heights.shape) - 1.0
    diagonal = float(np.hypot(*last))
    high = float(heights.max())
    base = -0.03 * diagonal

    # `depth`: distance from the camera along the viewing direction on the ground.
    forward = -np.array([np.cos(azimuth), np.sin(azimuth)])
    right = np.array([forward[1], -forward[0]])
    middle = _DISTANCE * diagonal
    eye = middle * np.tan(elevation) + high / 2
    camera = last / 2 - middle * forward

    # Scale the projection so that the block fills the picture.
    corners = np.array([(0, 0), (last[0], 0), (0, last[1]), last]) - camera
    depths = corners @ forward
    across = corners @ right / depths
    down = (eye - np.array([[base], [high]])) / depths
    focal = (1 - 2 * _MARGIN) * min(columns / np.ptp(across), rows / np.ptp(down))
    left = columns / 2 - focal * (across.min() + across.max()) / 2
    top = rows / 2 - focal * (down.min() + down.max()) / 2

    sideways = (np.arange(columns) + 0.5 - left) / focal
    directions = forward[:, None] + right[:, None] * sideways
    steps = min(max(2 * int(diagonal), 20), 4 * rows)
    depth = np.linspace(depths.min(), depths.max(), steps)
    ground = camera[:, None, None] + depth[:, None] * directions[:, None, :]
    inside = ((ground >= 0) & (ground <= last[:, None, None])).all(axis=0)
    lines = top + focal * (eye - _sampled(heights, ground)) / depth[:, None]

    pixel_rows = np.arange(rows) + 0.5
    seen = np.full((rows, columns), np.nan)
    for column in np.flatnonzero(inside.any(axis=0)):
        on_map = np.flatnonzero(inside[:, column])
        horizon = np.minimum.accumulate(lines[on_map, column])
        rising = np.flatnonzero(np.diff(horizon, prepend=np.inf) < 0)
        far_to_near = on_map[rising][::-1]
        seen[:, column] = np.interp(
            pixel_rows, horizon[rising][::-1], depth[far_to_near], left=np.nan, right=np.nan
        )
        # Draw the cut side of the block, darker where the side faces +y or -y.
        nearest = on_map[0]
        bottom = top + focal * (eye - base) / depth[nearest]
        is_cut = (pixel_rows > horizon[0]) & (pixel_rows < bottom)
        x = ground[0, nearest, column]
        picture[is_cut, column] = _SKIRT * (1.0 if min(x, last[0] - x) < 1 else 0.5)

    shown = np.isfinite(seen)
    where = camera[:, None, None] + seen * directions[:, None, :]
    light = _light(heights, azimuth - _SUN_AZIMUTH)
    for channel in range(3):
        lit = colors[..., channel] * light[..., channel]
        picture[shown, channel] = _sampled(lit, where[:, shown])


def _light(heights: Floats, sun_azimuth: float) -> Floats:
    """Return the red, green and blue light (nx, ny, 3) that the ground receives."""
    flat, up = np.cos(_SUN_ELEVATION), np.sin(_SUN_ELEVATION)
    sun = np.array([flat * np.cos(sun_azimuth), flat * np.sin(sun_azimuth), up])
    slope_x, slope_y = np.gradient(heights)
    normals = np.stack([-slope_x, -slope_y, np.ones_like(heights)], axis=-1)
    normals /= np.linalg.norm(normals, axis=-1, keepdims=True)
    sunlight = np.clip(normals @ sun, 0.0, None) / up

    reach = min(np.ptp(heights) / np.tan(_SUN_ELEVATION), max(heights.shape))
    blocked = np.zeros_like(heights)
    for distance in np.arange(1.0, reach, max(1.0, reach / 50)):
        offset = -distance * sun[:2] / flat
        towards_sun = ndimage.shift(heights, offset, order=1, mode="nearest")
        ray = heights + distance * np.tan(_SUN_ELEVATION)
        blocked = np.maximum(blocked, towards_sun - ray)
    shadow = ndimage.gaussian_filter(np.clip(blocked / 1.5, 0.0, 1.0), 1.0)
    sunlight *= 1 - 0.75 * shadow

    # Ambient occlusion: ground below its surroundings receives less light from the sky.
    skylight = np.ones_like(heights)
    for radius in (3, 8, 20):
        depth = ndimage.gaussian_filter(heights, radius) - heights
        skylight -= 0.55 * np.clip(depth / radius, -0.6, 0.6)
    share = np.clip(sunlight, 0.0, 1.0)[..., None]
    tint = _SKYLIGHT + (_SUNLIGHT - _SKYLIGHT) * share
    light: Floats = tint * (0.42 * skylight + 0.60 * sunlight)[..., None]
    return light
