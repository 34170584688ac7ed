# Copyright (c) 2026 grid_map_py contributors
# SPDX-License-Identifier: BSD-3-Clause
"""What there is to tell about the values of a layer."""

from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt


class LayerStatistics(NamedTuple):
    """Of the finite values of a layer; None and empty where there are none, or only colours.

    Attributes:
        name: name of the layer.
        is_color: whether it holds packed colours, going by its name.
        cells, nan, infinite: how many there are.
        deviation: standard deviation of the population.
        counts, edges: histogram, `counts[n]` from `edges[n]` to `edges[n + 1]`.
    """

    name: str
    is_color: bool
    cells: int
    nan: int
    infinite: int
    minimum: float | None = None
    maximum: float | None = None
    mean: float | None = None
    deviation: float | None = None
    counts: list[int] = []  # noqa: RUF012
    edges: list[float] = []  # noqa: RUF012

    def as_dict(self) -> dict[str, Any]:
        """Return it as JSON has it."""
        return {
            "name": self.name,
            "is_color": self.is_color,
            "cells": self.cells,
            "nan": self.nan,
            "infinite": self.infinite,
            "min": self.minimum,
            "max": self.maximum,
            "mean": self.mean,
            "std": self.deviation,
            "histogram": {"edges": self.edges, "counts": self.counts},
        }


def statistics_of(name: str, layer: npt.NDArray[np.float32], bins: int) -> LayerStatistics:
    """Return what there is to tell about a layer (rows, cols), with a histogram of `bins` bins."""
    is_color = name.endswith("color")
    nan = int(np.isnan(layer).sum())
    # In double precision neither sums nor the widths of bins overflow.
    finite = layer[np.isfinite(layer)].astype(np.float64)
    found = LayerStatistics(name, is_color, layer.size, nan, layer.size - nan - finite.size)
    if is_color or not finite.size:
        return found
    lowest, highest = float(finite.min()), float(finite.max())
    counts, edges = np.histogram(finite, bins, _range(lowest, highest))
    return found._replace(
        minimum=lowest,
        maximum=highest,
        mean=float(finite.mean()),
        deviation=float(finite.std()),
        counts=counts.tolist(),
        edges=edges.tolist(),
    )


def _range(lowest: float, highest: float) -> tuple[float, float]:
    """Return what a histogram spans, also around a single value, be it as large as it may."""
    if lowest < highest:
        return lowest, highest
    margin = max(0.5, 1e-3 * abs(lowest))
    return lowest - margin, highest + margin
