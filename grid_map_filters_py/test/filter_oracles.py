# SPDX-License-Identifier: BSD-3-Clause
"""Oracles of filters: loops over cells, in double precision."""

import math

import numpy as np


def loop(function, layer) -> np.ndarray:
    """Return the values of a function for every cell."""
    result = np.full(layer.shape, np.nan)
    for cell in np.ndindex(layer.shape):
        result[cell] = function(*cell)
    return result


def in_disc(layer, resolution, radius, row, column) -> list[float]:
    """Return the finite values in a closed disc around a cell."""
    return [
        float(layer[r, c])
        for r, c in np.ndindex(layer.shape)
        if math.hypot(r - row, c - column) * resolution <= radius + 1e-9
        and math.isfinite(layer[r, c])
    ]


def in_square(layer, half_width, row, column) -> list[float]:
    """Return the finite values in the square around a cell."""
    return [
        float(layer[r, c])
        for r, c in np.ndindex(layer.shape)
        if max(abs(r - row), abs(c - column)) <= half_width and math.isfinite(layer[r, c])
    ]


def extreme_in_disc(choose, layer, resolution, radius, *, fill) -> np.ndarray:
    """Return an extreme of the finite values in discs; without `fill`, only for finite cells."""

    def extreme(*cell):
        values = in_disc(layer, resolution, radius, *cell)
        return choose(values) if values and (fill or finite(layer, cell)) else np.nan

    return loop(extreme, layer)


def min_in_radius(layer, resolution, radius) -> np.ndarray:
    return extreme_in_disc(min, layer, resolution, radius, fill=False)


def mean_in_radius(layer, resolution, radius) -> np.ndarray:
    def mean(*cell):
        values = in_disc(layer, resolution, radius, *cell)
        return sum(values) / len(values) if values else np.nan

    return loop(mean, layer)


def inflation(costs, resolution, inscribed, radius, scaling, *, unknown, around) -> np.ndarray:
    """Return costs inflated as in Nav2; `costs` holds 0 to 254, or NaN for unknown."""
    sources = [cell for cell in np.ndindex(costs.shape) if costs[cell] == 254]
    if around:
        sources += [cell for cell in np.ndindex(costs.shape) if not finite(costs, cell)]

    def inflated(*cell):
        cells = min((math.dist(cell, source) for source in sources), default=math.inf)
        distance, cost = cells * resolution, 0
        if cells == 0:
            cost = 254
        elif cells <= math.ceil(radius / resolution):
            fraction = math.exp(-scaling * (distance - inscribed)) if distance > inscribed else 1.0
            cost = 253 if distance <= inscribed else int(252 * fraction)
        if finite(costs, cell):
            return max(cost, costs[cell])
        return cost if cost >= (1 if unknown else 253) else np.nan

    return loop(inflated, costs)


def finite(layer, cell) -> bool:
    return math.isfinite(layer[cell])


def upper_median(values) -> float:
    return sorted(values)[len(values) // 2] if values else np.nan


def median_fill(layer, mask, hole_cells, existing_cells=None) -> np.ndarray:
    """Fill cells of the mask; None for `existing_cells` keeps existing values."""

    def filled(*cell):
        half_width = existing_cells if finite(layer, cell) else hole_cells
        if not mask[cell] or half_width is None:
            return layer[cell]
        return upper_median(in_square(layer, half_width, *cell))

    return loop(filled, layer)


def fill_mask(layer, iterations) -> tuple[np.ndarray, np.ndarray]:
    """Return the opened mask of finite cells, and its closing."""
    opened = dilated(eroded(np.isfinite(layer)))
    closed = opened
    for step in [dilated] * iterations + [eroded] * iterations:
        closed = step(closed)
    return opened, closed


def eroded(mask) -> np.ndarray:
    return loop(lambda r, c: mask[max(r - 1, 0) : r + 2, max(c - 1, 0) : c + 2].all(), mask) == 1


def dilated(mask) -> np.ndarray:
    return loop(lambda r, c: mask[max(r - 1, 0) : r + 2, max(c - 1, 0) : c + 2].any(), mask) == 1


def curvature(layer, resolution) -> np.ndarray:
    rows, columns = layer.shape

    def height(row, column):
        return float(layer[min(max(row, 0), rows - 1), min(max(column, 0), columns - 1)])

    def at(row, column):
        center = height(row, column)
        if not math.isfinite(center):
            return np.nan
        total = 0.0
        for ahead, behind in [((1, 0), (-1, 0)), ((0, 1), (0, -1))]:
            ends = (
                height(row + ahead[0], column + ahead[1]),
                height(row + behind[0], column + behind[1]),
            )
            difference = (sum(ends) / 2 - center) / resolution**2
            total += difference if math.isfinite(difference) else 0.0
        return -2 * total

    return loop(at, layer)


def to_bytes(color) -> tuple[int, int, int]:
    """Return red, green, blue of a color value."""
    bits = int(np.float32(color).view(np.uint32))
    return bits >> 16 & 255, bits >> 8 & 255, bits & 255


def blend(background, foreground, mode, opacity) -> list[float]:
    """Return the channels of two blended colors, from 0 to 255 and not clamped."""
    below, above = ([byte / 255 for byte in to_bytes(color)] for color in (background, foreground))
    dark = sum(above) / 3 < 0.5
    mixed = []
    for b, f in zip(below, above, strict=True):
        if mode == "normal":
            over = f
        elif mode == "soft_light":
            over = (1 - 2 * f) * b * b + 2 * b * f
        else:
            over = 2 * b * f if dark else 1 - 2 * (1 - b) * (1 - f)
        mixed.append(255 * ((1 - opacity) * b + opacity * over))
    return mixed
