# Copyright (c) 2026 grid_map_py contributors
# SPDX-License-Identifier: BSD-3-Clause
"""The filters of this package, one per module, to be used from Python.

A filter takes its parameters of YAML as keyword arguments, and is called with a map:

    >>> from grid_map_core_py import GridMap
    >>> from grid_map_filters_py.builtin import Slope
    >>> slope = Slope(input_layer="elevation", output_layer="slope")
    >>> flat = slope(GridMap((1.0, 1.0), 0.1, layers={"elevation": 0.0}))
    >>> float(flat["slope"][5, 5])
    0.0
"""

from ._bilateral import Bilateral
from ._buffer_normalizer import BufferNormalizer
from ._color_blending import ColorBlending
from ._color_fill import ColorFill
from ._color_map import ColorMap
from ._curvature import Curvature
from ._deletion import Deletion
from ._dilation import Dilation
from ._duplication import Duplication
from ._erosion import Erosion
from ._gaussian_blur import GaussianBlur
from ._inpaint import Inpaint
from ._light_intensity import LightIntensity
from ._math_expression import MathExpression
from ._mean_in_radius import MeanInRadius
from ._median_fill import MedianFill
from ._min_in_radius import MinInRadius
from ._normal_color_map import NormalColorMap
from ._normal_vectors import NormalVectors
from ._roughness import Roughness
from ._set_basic_layers import SetBasicLayers
from ._sliding_window_math_expression import SlidingWindowMathExpression
from ._slope import Slope
from ._step_height import StepHeight
from ._threshold import Threshold
from ._traversability import Traversability

__all__ = [
    "Bilateral",
    "BufferNormalizer",
    "ColorBlending",
    "ColorFill",
    "ColorMap",
    "Curvature",
    "Deletion",
    "Dilation",
    "Duplication",
    "Erosion",
    "GaussianBlur",
    "Inpaint",
    "LightIntensity",
    "MathExpression",
    "MeanInRadius",
    "MedianFill",
    "MinInRadius",
    "NormalColorMap",
    "NormalVectors",
    "Roughness",
    "SetBasicLayers",
    "SlidingWindowMathExpression",
    "Slope",
    "StepHeight",
    "Threshold",
    "Traversability",
]
