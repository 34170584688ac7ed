# SPDX-License-Identifier: BSD-3-Clause
"""Fusion of additional point values, such as colors and classes, into one layer per value.

Only points that were fused into the height of their cell contribute values. If a scan replaces the
height of a cell, the earlier values of the cell are deleted. The fusion methods are:

- `average`: mean over all scans, weighted with the inverse variances of the point heights.
- `latest`: mean with the same weights, but only over the last scan with points in the cell.
- `exponential`: `exponential_alpha` times the result of `latest`, plus `1 - exponential_alpha`
  times the old value.
- `max`: the largest value.
- `color`: for packed colors: the mean of each channel over the last scan with points in the cell.
- `class_bayesian`: class probabilities. Layers that match the same pattern form a set of classes.
  They contain the mean of a Dirichlet distribution, which starts with one count per class. Each
  point adds its probabilities to the counts.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .._arrays._checks import Integers, Mask
from ..conversions._point_layers import COLOR_FIELDS, as_colors
from ..conversions._point_reductions import mean_color
from ..errors import ConfigError
from ..plugins import check
from ._clusters import Sorted, in_one_order
from ._parameters import Numbers

FUSIONS = ("average", "latest", "exponential", "max", "color", "class_bayesian")


@dataclass(frozen=True)
class Chosen:
    """Scan points, and masks that select the points and cells for value fusion.

    Attributes:
        points: all scan points inside the map.
        used: (n,) mask of the points that were fused into a cell height.
        fresh: (cells,) mask of the cells whose height was set or replaced.
    """

    points: Sorted
    used: Mask
    fresh: Mask


class ValueFusion:
    """Fuses point values into layers.

    An exact name in `fusions` takes precedence over regular expressions, which must match the whole
    name. The first matching expression is used.
    """

    def __init__(self, fusions: Mapping[str, str], exponential_alpha: float) -> None:
        check(isinstance(fusions, Mapping), "value_fusions", "a mapping from names", fusions)
        for pattern, fusion in fusions.items():
            expected = f"one of {', '.join(FUSIONS)}"
            check(fusion in FUSIONS, f"value_fusions of {pattern!r}", expected, fusion)
            try:
                re.compile(pattern)
            except (re.error, TypeError) as error:
                raise ConfigError(
                    f"value_fusions: expected a regular expression, got {pattern!r}: {error}"
                ) from error
        self._fusions = dict(fusions)
        self.alpha = exponential_alpha

    def fuse(
        self,
        chosen: Chosen,
        values: Mapping[str, NDArray[Any]],
        layers: dict[str, NDArray[np.float32]],
        weights: dict[str, NDArray[np.float32]],
    ) -> None:
        """Fuse values (n,) of the points on the map into the flat `layers` (cells,), in place.

        `weights` holds the weights of `average` by layer, and the counts of `class_bayesian` by
        pattern.
        """
        sets: dict[str, list[str]] = {}
        for name in values:
            pattern, fusion = self._fusion_of(name)
            if fusion == "class_bayesian":
                sets.setdefault(pattern, []).append(name)
            else:
                self._fuse_one(name, fusion, chosen, values[name], layers, weights)
        for pattern, names in sets.items():
            size = len(chosen.fresh)
            total = _forgotten(weights.get(pattern), chosen.fresh, 0.0).astype(np.float64)
            before = np.where(total > 0.0, total, float(len(names)))
            sums, added = {}, np.zeros(size)
            for name in sorted(names):
                cells, found, _ = _used(chosen, values[name])
                sums[name] = np.bincount(cells, np.clip(found, 0.0, 1.0), size)
                added += sums[name]
            seen = added > 0.0
            for name in names:
                old = _forgotten(layers.get(name), chosen.fresh)
                share = np.where(np.isnan(old), 1.0 / len(names), old)
                mean = (share * before + sums[name]) / (before + added)
                layers[name] = np.where(seen, mean, old).astype(np.float32)
            weights[pattern] = np.where(seen, before + added, total).astype(np.float32)

    def _fusion_of(self, name: str) -> tuple[str, str]:
        if name in self._fusions:
            return name, self._fusions[name]
        for pattern, fusion in self._fusions.items():
            if re.fullmatch(pattern, name):
                return pattern, fusion
        return name, "color" if name in COLOR_FIELDS else "average"

    def _fuse_one(
        self,
        name: str,
        fusion: str,
        chosen: Chosen,
        values: NDArray[Any],
        layers: dict[str, NDArray[np.float32]],
        weights: dict[str, NDArray[np.float32]],
    ) -> None:
        size = len(chosen.fresh)
        old = _forgotten(layers.get(name), chosen.fresh)
        if fusion == "color":
            new = mean_color(*_used(chosen, as_colors(values), is_color=True)[:2], size)
            layers[name] = np.where(np.isnan(new), old, new)
            return
        cells, found, shares = _used(chosen, values)
        if fusion == "max":
            new = np.full(size, -np.inf)
            np.maximum.at(new, cells, found)
            layers[name] = np.fmax(old, np.where(new == -np.inf, np.nan, new)).astype(np.float32)
            return
        weight = np.bincount(cells, shares, size)
        seen = np.flatnonzero(weight)
        mean = np.bincount(cells, shares * found, size)[seen] / weight[seen]
        before, known = old[seen].astype(np.float64), ~np.isnan(old[seen])
        if fusion == "exponential":
            mean[known] += (1.0 - self.alpha) * (before - mean)[known]
        elif fusion == "average":
            hidden = _forgotten(weights.get(name), chosen.fresh, 0.0)
            earlier = np.where(known, hidden[seen], 0.0).astype(np.float64)
            total = earlier + weight[seen]
            mean[known] += (earlier / total * (before - mean))[known]
            hidden[seen] = np.minimum(total, np.finfo(np.float32).max)
            weights[name] = hidden
        with np.errstate(over="ignore"):
            old[seen] = mean
        layers[name] = old


def _forgotten(
    layer: NDArray[Any] | None, fresh: Mask, nothing: float = np.nan
) -> NDArray[np.float32]:
    """Return a copy of `layer` in which NaN cells and `fresh` cells become `nothing`."""
    if layer is None:
        return np.full(len(fresh), nothing, np.float32)
    copy = layer.copy()
    copy[fresh | np.isnan(layer)] = nothing
    return copy


def _used(
    chosen: Chosen, values: NDArray[Any], *, is_color: bool = False
) -> tuple[Integers, NDArray[Any], Numbers]:
    """Return the cells, values and weights of the fused points, in the order of `in_one_order`."""
    points = chosen.points
    # Packed colors are compared as bits, because many colors are NaN as float32.
    sortable = values.view(np.uint32) if is_color else values.astype(np.float64)
    order = in_one_order(points, sortable)
    found = values[order] if is_color else sortable[order]
    counts = chosen.used & (~np.isnan(found) if is_color else np.isfinite(found))
    return points.cells[points.groups][counts], found[counts], 1.0 / points.variances[counts]
