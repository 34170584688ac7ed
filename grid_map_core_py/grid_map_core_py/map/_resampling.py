# SPDX-License-Identifier: BSD-3-Clause
"""Resampling of layers with holes to other numbers of rows and columns.

All interpolations of OpenCV's `resize` are linear in the pixels and separable. Resizing single
pixels of value 1 gives their weights. With the weights, holes can be left out of every sum, and
any block of the result can be computed from the part of the layer that it needs.
"""

import math
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Any

import cv2
import numpy as np
import numpy.typing as npt

from .._arrays._checks import Layer, Size
from .._arrays._pieces import slices
from ..errors import GeometryError, short
from . import _ring_buffer as ring_buffer
from ._interpolation import Interpolation

if TYPE_CHECKING:
    from scipy import sparse

# Largest reach of a kernel [cells] (Lanczos); resampling by area adds half a target cell.
_REACH = 5

_CHANNELS = 4  # number of image channels that OpenCV resizes with every interpolation
_BLOCK = 2**16  # number of source and target cells in a block of a large layer
# Number of cells in a block of a small layer, whose temporaries stay small beside it.
_SMALL_BLOCK = 2**14

_TIE = 1e-9  # tolerance [cells] for target cells in the middle between two source cells


_FLAGS = {
    "nearest": cv2.INTER_NEAREST,
    "linear": cv2.INTER_LINEAR,
    "cubic": cv2.INTER_CUBIC,
    "area": cv2.INTER_AREA,
    "lanczos": cv2.INTER_LANCZOS4,
}


def resize_flag(interpolation: Interpolation | str | int) -> int:
    """Return the flag of OpenCV's `resize` for a name, an `Interpolation`, or a flag."""
    if isinstance(interpolation, int):
        return interpolation
    name = interpolation.value if isinstance(interpolation, Interpolation) else interpolation
    if name not in _FLAGS:
        known = ", ".join(_FLAGS)
        raise GeometryError(f"interpolation: expected one of {known}, got {short(name)}")
    return _FLAGS[name]


@dataclass(frozen=True)
class ResizedAxis:
    """Resampling along one axis: the source cells of each target cell, and their weights.

    Args:
        sources: number of source cells.
        targets: number of target cells.
        factor: target cells per source cell; both begin at the same border.
        interpolation: a flag of OpenCV's `resize`.
    """

    sources: int
    targets: int
    factor: float
    interpolation: int

    @property
    def picks(self) -> bool:
        """True if every target cell takes the value of one source cell."""
        return self.interpolation in (cv2.INTER_NEAREST, cv2.INTER_NEAREST_EXACT)

    @cached_property
    def nearest(self) -> npt.NDArray[np.intp]:
        """(targets,) the nearest or picked source cell of each target."""
        if self.picks:
            return self._resized(np.arange(self.sources)[:, None])[:, 0].astype(np.intp)
        centers = (np.arange(self.targets) + 0.5) / self.factor
        # Halfway between two cells, the first one counts as the nearest.
        cells = np.ceil(centers - 1.0 - _TIE)
        return np.asarray(np.clip(cells, 0, self.sources - 1), dtype=np.intp)

    @cached_property
    def weights(self) -> "sparse.csr_array":
        """(targets, sources) float32 weights of the source cells in the target cells."""
        from scipy import sparse  # slow to import

        # Sources that are too far apart to meet in one target share a line.
        by_area = self.interpolation == cv2.INTER_AREA
        reach = _REACH + (math.ceil(0.5 / self.factor) if by_area else 0)
        apart = 2 * reach + 1
        combs = np.arange(self.sources)[:, None] % apart == np.arange(apart)
        weights = self._resized(combs)
        first = self.nearest[:, None] - reach
        sources = first + (np.arange(apart) - first) % apart
        used = weights != 0
        ends = np.concatenate(([0], np.cumsum(np.count_nonzero(used, axis=1))))
        shape = self.targets, self.sources
        matrix = sparse.csr_array((weights[used], sources[used], ends), shape)
        # SciPy may sort later, which would reorder values that parts share.
        matrix.sort_indices()
        return matrix

    @cached_property
    def magnitudes(self) -> tuple["sparse.csr_array", npt.NDArray[np.float32]]:
        """(targets, sources) the weights without signs, and their sums (targets,)."""
        matrix = abs(self.weights)
        return matrix, matrix.sum(axis=1)

    def _resized(self, lines: npt.NDArray[Any]) -> npt.NDArray[np.float32]:
        """Return N lines of pixels (sources, N) resized to (targets, N)."""
        # OpenCV rounds a half to an even number of cells, which may be one too few.
        is_short = np.rint(self.sources * self.factor) < self.targets
        margin = math.ceil(1.0 / self.factor) if is_short else 0
        padded = np.pad(lines.astype(np.float32), ((0, margin), (0, 0)), mode="edge")
        # As channels of one line of pixels, none of them can leak into another.
        parts = []
        for part in slices(lines.shape[1], _CHANNELS):
            line = padded[None, :, part]
            try:
                resized = cv2.resize(
                    line, None, fx=self.factor, fy=1, interpolation=self.interpolation
                )
            except cv2.error as error:
                raise GeometryError(
                    f"interpolation: OpenCV cannot resize with {self.interpolation!r}: {error.err}"
                ) from error
            parts.append(np.asarray(resized, dtype=np.float32).reshape(-1, line.shape[2]))
        return np.concatenate(parts, axis=1)[: self.targets]


def resample(layer: Layer, start: Size, rows: ResizedAxis, columns: ResizedAxis) -> Layer:
    """Interpolate a layer.

    A target cell whose nearest source cell is not finite takes its value, NaN or an infinity. All
    other target cells are finite: they are computed from finite source cells only.

    Args:
        layer: (rows, cols) the buffer.
        start: start index of the circular buffer.
        rows, columns: the axes, `rows.sources` by `columns.sources`.

    Returns:
        (rows.targets, columns.targets) in map order.
    """
    result: Layer = np.empty((rows.targets, columns.targets), np.float32, order="F")
    cells = min(_BLOCK, max(_SMALL_BLOCK, result.size // 3))
    step = int(cells / (rows.sources / columns.factor + rows.targets))
    for targets in slices(columns.targets, step):
        needed, weights = _part(columns.weights, targets)
        block = ring_buffer.block(layer, start, slice(0, rows.sources), needed)
        picked: Layer = block[np.ix_(rows.nearest, columns.nearest[targets] - needed.start)]
        if not rows.picks:
            finite = np.isfinite(picked)
            np.copyto(picked, _interpolate(block, rows, weights), where=finite)
        result[:, targets] = picked
    return result


def _part(weights: "sparse.csr_array", targets: slice) -> tuple[slice, "sparse.csr_array"]:
    """Return the sources of some targets, and their weights; faster than indexing twice."""
    ends = weights.indptr[targets.start : targets.stop + 1]
    used = slice(ends[0], ends[-1])
    sources = weights.indices[used]
    first, stop = int(sources.min()), int(sources.max()) + 1
    values = weights.data[used], sources - first, ends - ends[0]
    return slice(first, stop), type(weights)(values, (targets.stop - targets.start, stop - first))


def _interpolate(block: Layer, rows: ResizedAxis, columns: "sparse.csr_array") -> Layer:
    """Return the interpolated block; the values at holes have no meaning. Overwrites the block."""
    missing = ~np.isfinite(block)
    np.copyto(block, 0, where=missing)
    result = _product(rows.weights, block, columns)
    if not missing.any():
        return result
    # Beside holes, the sum of weights could vanish; there a mean with positive weights is used.
    (along, sums), across = rows.magnitudes, abs(columns)
    holes = _product(along, missing.astype(np.float32), across)
    known = np.outer(sums, across.sum(axis=1)) - holes
    with np.errstate(divide="ignore", invalid="ignore"):
        means = _product(along, block, across) / known
    return np.where(holes > 0, means, result)


def _product(rows: "sparse.csr_array", block: Layer, columns: "sparse.csr_array") -> Layer:
    product: Layer = rows @ (columns @ block.T).T
    return product
