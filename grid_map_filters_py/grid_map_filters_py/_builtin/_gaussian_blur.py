# SPDX-License-Identifier: BSD-3-Clause
"""`gridMapFilters/GaussianBlurFilter`"""

import math
from dataclasses import dataclass
from typing import Any

import cv2
import numpy as np
import numpy.typing as npt

from grid_map_core_py._arrays import Layer
from grid_map_core_py.plugins import check

from ..parts._disc import Disc, disc_reach
from ..parts._layer_filter import AroundTypicalValue, check_radius


@dataclass(frozen=True, kw_only=True)
class GaussianBlur(AroundTypicalValue):
    """Smooth a layer with the Gaussian-weighted mean of the finite values around each cell.

    The weights of the finite values are normalized to a sum of 1, so holes and borders add no bias.
    This method is normalized convolution (H. Knutsson and C.-F. Westin, 1993).

    Attributes:
        sigma: standard deviation of the Gaussian [m].
        radius: half width of the kernel along x and y [m]; by default 3 times `sigma`.
        compute_empty_cells: also fill non-finite cells that have a finite value within the kernel.
    """

    sigma: float
    radius: float | None = None
    compute_empty_cells: bool = False

    def __post_init__(self) -> None:
        check(math.isfinite(self.sigma) and self.sigma > 0, "sigma", "a length > 0 [m]", self.sigma)
        check_radius(self.radius or 0.0)

    def reach(self, resolution: float) -> float:
        return disc_reach(self._radius, resolution)

    def _filter_around(
        self, offset: float, layer: Layer, resolution: float
    ) -> npt.NDArray[np.float64]:
        mask = np.isfinite(layer)
        values = np.subtract(layer, offset, dtype=np.float64)
        np.copyto(values, 0.0, where=~mask)
        disc = Disc(self._radius, resolution, layer.shape)
        mean = self._blur(values, disc)
        del values
        with np.errstate(invalid="ignore"):
            mean /= self._blur(mask.view(np.uint8), disc)
        mean += offset
        if not self.compute_empty_cells:
            mean[~mask] = np.nan
        return mean

    @property
    def _radius(self) -> float:
        return 3 * self.sigma if self.radius is None else self.radius

    def _blur(self, image: npt.NDArray[Any], disc: Disc) -> npt.NDArray[np.float64]:
        with np.errstate(over="ignore"):
            scaled = (steps * (disc.resolution / self.sigma) for steps in disc.offsets)
            rows, columns = (np.exp(-0.5 * np.square(steps)) for steps in scaled)
        blurred = cv2.sepFilter2D(
            image.T, cv2.CV_64F, rows, columns, borderType=cv2.BORDER_CONSTANT
        )
        return np.asarray(blurred.T, dtype=np.float64)
