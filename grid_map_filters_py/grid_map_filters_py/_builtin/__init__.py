# SPDX-License-Identifier: BSD-3-Clause
"""Built-in filters, one per module; YAML parameters are keyword arguments of the classes."""

from ._bilateral import Bilateral as Bilateral
from ._buffer_normalizer import BufferNormalizer as BufferNormalizer
from ._color_blending import ColorBlending as ColorBlending
from ._color_fill import ColorFill as ColorFill
from ._color_map import ColorMap as ColorMap
from ._cost import Cost as Cost
from ._curvature import Curvature as Curvature
from ._deletion import Deletion as Deletion
from ._dilation import Dilation as Dilation
from ._duplication import Duplication as Duplication
from ._erosion import Erosion as Erosion
from ._footprint import Footprint as Footprint
from ._gaussian_blur import GaussianBlur as GaussianBlur
from ._inflation import Inflation as Inflation
from ._inpaint import Inpaint as Inpaint
from ._light_intensity import LightIntensity as LightIntensity
from ._math_expression import MathExpression as MathExpression
from ._mean_in_radius import MeanInRadius as MeanInRadius
from ._median_fill import MedianFill as MedianFill
from ._min_in_radius import MinInRadius as MinInRadius
from ._normal_color_map import NormalColorMap as NormalColorMap
from ._normal_vectors import NormalVectors as NormalVectors
from ._planar_regions import PlanarRegions as PlanarRegions
from ._roughness import Roughness as Roughness
from ._set_basic_layers import SetBasicLayers as SetBasicLayers
from ._sliding_window_math_expression import (
    SlidingWindowMathExpression as SlidingWindowMathExpression,
)
from ._slope import Slope as Slope
from ._step_height import StepHeight as StepHeight
from ._threshold import Threshold as Threshold
from ._traversability import Traversability as Traversability

__all__ = [name for name in dir() if not name.startswith("_")]
