# SPDX-License-Identifier: BSD-3-Clause
"""The filter `Traversability`, on given and on computed measures."""

import numpy as np
import pytest
from filter_cases import filtered, run, terrain
from hypothesis import given, strategies as st

TRAVERSABILITY = "gridMapFilters/TraversabilityFilter"
ALONE = {"input_layers": ["elevation"], "output_layer": "out"}
WEIGHTS = st.just(0.0) | st.floats(1e-3, 10.0)


def traversability(layers, critical_values, **params):
    names = [f"layer{number}" for number in range(len(layers))]
    grid_map = terrain(np.shape(layers[0]), **dict(zip(names, layers, strict=True)))
    params |= {"input_layers": names, "output_layer": "out", "critical_values": critical_values}
    return run(TRAVERSABILITY, grid_map, **params)["out"]


def test_traversability_is_the_weighted_mean_of_scores():
    slope = [[0.0, 0.3, 0.6, 0.9, -0.2, np.nan, np.inf]]
    roughness = [[0.0, 0.0, 0.05, 0.1, 0.0, 0.0, 0.0]]
    result = traversability([slope, roughness], [0.6, 0.1])
    np.testing.assert_allclose(result, [[1, 0.75, 0.25, 0, 1, np.nan, np.nan]], atol=1e-7)
    result = traversability([slope, roughness], [0.6, 0.1], weights=[3, 1])
    np.testing.assert_allclose(result, [[1, 0.625, 0.125, 0, 1, np.nan, np.nan]], atol=1e-7)


@given(
    st.lists(
        st.tuples(st.floats(-1e3, 1e3, width=32), st.floats(1e-3, 1e3), WEIGHTS),
        min_size=1,
        max_size=5,
    )
)
def test_traversability_is_between_0_and_1(terms):
    values, critical, weights = zip(*terms, strict=True)
    weights = weights if any(weights) else None
    params = {"weights": weights} if weights else {}
    result = traversability([[[v]] for v in values], list(critical), **params)[0, 0]
    scores = [min(1.0, max(0.0, 1.0 - v / c)) for v, c in zip(values, critical, strict=True)]
    assert 0 <= result <= 1
    assert result == pytest.approx(np.average(scores, weights=weights), abs=1e-6)


def test_measures_separate_flat_ground_curb_and_steep_slope():
    grid_map = terrain((60, 20))
    x, y = (axis.reshape(60, 20, order="F") for axis in grid_map.get_positions().T)
    # From +x to -x: flat, a ramp of 45 degrees, flat, and a curb of 0.3 m.
    grid_map["elevation"] = np.clip(1.0 - x, 0.0, 1.0) - 0.3 * (x < -1.5) + 0.0 * y
    terms = {"Slope": 0.6, "StepHeight": 0.2, "Roughness": 0.1}
    measures = [filtered(type_name, grid_map, radius=0.2) for type_name in terms]
    result = traversability(measures, [*terms.values()])
    on_flat, on_ramp, at_curb = (
        result[grid_map.get_index((place, 0.0))] for place in (2.0, 0.5, -1.5)
    )
    assert on_flat == pytest.approx(1.0)
    assert on_ramp == pytest.approx(1 / 3, abs=1e-5)  # Steep, with steps, not rough.
    assert at_curb < 0.5
