# SPDX-License-Identifier: BSD-3-Clause
"""The filter `MathExpression`."""

import numpy as np
import pytest
from filter_cases import run, terrain

from grid_map_filters_py import FilterError


def test_number_fills_layer_and_wrong_shape_is_refused():
    grid_map = terrain((4, 3), a=2.0)
    type_name = "gridMapFilters/MathExpressionFilter"
    result = run(type_name, grid_map, expression="sum(a)", output_layer="out")
    np.testing.assert_array_equal(result["out"], np.full((4, 3), 24.0))
    with pytest.raises(
        FilterError, match=r"shape \(3, 4\); expected a scalar or the map's \(4, 3\)"
    ):
        run(type_name, grid_map, expression="transpose(a)", output_layer="out")
