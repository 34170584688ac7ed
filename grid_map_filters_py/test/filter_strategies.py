# SPDX-License-Identifier: BSD-3-Clause
"""Random parameters of every registered filter, and random maps for them."""

import numpy as np
from filter_cases import LAYERS
from hypothesis import strategies as st

from grid_map_core_py.testing import grid_maps

LAYER = st.sampled_from(LAYERS)
OUTPUT = st.sampled_from([*LAYERS, "out"])
LENGTH = st.sampled_from([0.0, 0.04, 0.05, 0.1, 0.15, 0.3, 0.5, 1.0])
POSITIVE = st.sampled_from([0.04, 0.1, 0.3, 0.5])
NUMBER = st.sampled_from([-2.5, 0.0, 0.5, 1.0, 700.0])
SHARE = st.floats(0.0, 1.0)
COLOR = st.tuples(SHARE, SHARE, SHARE)

EXPRESSIONS = st.sampled_from(
    [
        "elevation + other",
        "acos(elevation / 700) * 180 / pi",
        "cwiseMin(abs(elevation), 3) .* sin(other) - cos(n_x) ^ 3",
        "where(elevation > other, exp(-square(n_x)), min(other, n_y))",
        "atan2(elevation, other) + log(abs(n_z)) + tan(n_x) .* tanh(n_y)",
        "meanOfFinites(elevation) - other",
        "transpose(transpose(elevation))",
        "other - max(elevation) * size(n_x, 1)",
        "where(elevation > absmax(other ./ minOfFinites(elevation)), numberOfFinites(n_x), other)",
        "square(elevation - meanOfFinites(elevation)) ./ (1 + norm(abs(n_x) ./ maxOfFinites(n_x)))",
        "3",
    ]
)
WINDOW_EXPRESSIONS = st.sampled_from(
    [
        "meanOfFinites(elevation)",
        "sqrt(sumOfFinites(square(elevation - meanOfFinites(elevation))))",
        "max(elevation) - min(elevation)",
        "mean(elevation) + exp(sumOfFinites(sin(elevation)))",
        "sum(elevation, 0) * transpose(sum(elevation, 0)) + elevation(0, 0)",
    ]
)


def parameters(**strategies):
    """Return a strategy for mappings; None leaves a parameter out."""
    return st.fixed_dictionaries(strategies).map(
        lambda drawn: {name: value for name, value in drawn.items() if value is not None}
    )


def layer_to_layer(**strategies):
    return parameters(input_layer=LAYER, output_layer=OUTPUT, **strategies)


NORMALS = parameters(input_layers_prefix=st.just("n_"), output_layer=OUTPUT)
DISC = layer_to_layer(radius=LENGTH)
FILLING_DISC = layer_to_layer(radius=LENGTH, compute_empty_cells=st.booleans())

PARAMETERS = {
    "Bilateral": layer_to_layer(
        sigma_space=POSITIVE, sigma_range=POSITIVE, radius=st.none() | LENGTH
    ),
    "BufferNormalizer": parameters(),
    "ColorBlending": parameters(
        background_layer=LAYER,
        foreground_layer=LAYER,
        output_layer=OUTPUT,
        opacity=SHARE,
        blend_mode=st.sampled_from(["normal", "hard_light", "soft_light"]),
    ),
    "ColorFill": parameters(
        red=SHARE, green=SHARE, blue=SHARE, mask_layer=st.none() | LAYER, output_layer=OUTPUT
    ),
    "ColorMap": layer_to_layer(
        min_value=st.just(-3.0), max_value=POSITIVE, min_color=COLOR, max_color=COLOR
    ),
    "Cost": layer_to_layer(
        free_value=NUMBER,
        lethal_value=st.just(-3.0),
        unknown=st.sampled_from(["unknown", "lethal", "free"]),
        lethal_layer=st.just("other"),
        lethal_above=NUMBER,
    ),
    "Curvature": layer_to_layer(),
    "Deletion": parameters(layers=st.lists(st.just("other"), max_size=1)),
    "Dilation": FILLING_DISC,
    "Duplication": layer_to_layer(),
    "Erosion": FILLING_DISC,
    "Footprint": layer_to_layer(
        footprint=st.just("[[0.2, 0.1], [-0.1, 0.1], [-0.1, -0.1], [0.2, -0.05]]"),
        yaws=st.integers(1, 5),
        statistic=st.sampled_from(["min", "mean", "max"]),
        directions=st.sampled_from(["worst", "best"]),
    ),
    "GaussianBlur": layer_to_layer(
        sigma=POSITIVE, radius=st.none() | LENGTH, compute_empty_cells=st.booleans()
    ),
    "Inflation": layer_to_layer(
        inscribed_radius=st.just(0.04),
        inflation_radius=LENGTH,
        cost_scaling_factor=POSITIVE,
        inflate_unknown=st.booleans(),
        inflate_around_unknown=st.booleans(),
    ),
    "Inpaint": DISC,
    "LightIntensity": parameters(
        input_layers_prefix=st.just("n_"),
        output_layer=OUTPUT,
        light_direction=st.just([0.3, 0.1, -1]),
    ),
    "MathExpression": parameters(expression=EXPRESSIONS, output_layer=OUTPUT),
    "MeanInRadius": DISC,
    "MedianFill": layer_to_layer(
        fill_hole_radius=LENGTH,
        filter_existing_values=st.booleans(),
        existing_value_radius=LENGTH,
        fill_mask_layer=st.sampled_from(["n_z", "mask"]),
        num_erode_dilation_iterations=st.integers(0, 2),
        debug=st.booleans(),
        debug_infill_mask_layer=st.just("opened"),
    ).filter(lambda drawn: drawn["output_layer"] != drawn["fill_mask_layer"]),
    "MinInRadius": DISC,
    "NormalColorMap": NORMALS,
    "NormalVectors": parameters(
        input_layer=LAYER,
        output_layers_prefix=st.sampled_from(["n_", "out_"]),
        normal_vector_positive_axis=st.sampled_from("xyz"),
        algorithm=st.sampled_from(["area", "raster"]),
        radius=LENGTH,
    ),
    "PlanarRegions": layer_to_layer(
        kernel_size=st.sampled_from([3, 5]), marginSize=st.integers(0, 1)
    ),
    "Roughness": DISC,
    "SetBasicLayers": parameters(layers=st.lists(LAYER, unique=True)),
    "SlidingWindowMathExpression": parameters(
        input_layer=st.just("elevation"),
        output_layer=OUTPUT,
        expression=WINDOW_EXPRESSIONS,
        compute_empty_cells=st.booleans(),
        edge_handling=st.sampled_from(["inside", "crop", "empty", "mean"]),
        window_size=st.sampled_from([1, 3, 5, 11]),
        window_length=st.none() | st.sampled_from([0.1, 0.3]),
    ),
    "Slope": NORMALS | layer_to_layer(radius=LENGTH),
    "StepHeight": DISC
    | layer_to_layer(radius=LENGTH, second_window_radius=LENGTH, critical_value=POSITIVE),
    "Threshold": parameters(
        condition_layer=LAYER, output_layer=LAYER, lower_threshold=NUMBER, set_to=NUMBER
    ),
    "Traversability": parameters(
        input_layers=st.just(["elevation", "other"]),
        output_layer=OUTPUT,
        critical_values=st.just([1.0, 300.0]),
    ),
}
"""For every registered filter, random parameters; its layers are those of the maps below."""

EXTREMES = np.float32([-0.0, 0.0, 1e-30, 3e38, -3e38, 1e20, 1000.25])


@st.composite
def maps(draw, allow_moved=True, extremes=EXTREMES):
    """Draw a map with holes, infinities and extremes, terrain or noise, often moved."""
    grid_map = draw(grid_maps(LAYERS[:1], max_side=20, allow_moved=allow_moved))
    random = np.random.default_rng(draw(st.integers(0, 2**32)))
    base = draw(st.sampled_from([0.0, 1000.0]))
    for name in LAYERS:
        heights = base + np.cumsum(random.normal(size=grid_map.size), axis=0)
        heights[random.random(grid_map.size) < draw(st.sampled_from([0.0, 0.3]))] = np.nan
        strange = random.random(grid_map.size) < draw(st.sampled_from([0.0, 0.05]))
        heights[strange] = random.choice([*extremes, np.inf, -np.inf], strange.sum())
        grid_map[name] = heights.astype(np.float32)
    grid_map.basic_layers = LAYERS[:1]
    return grid_map


def assert_same_bits(found, expected):
    assert found.layers == expected.layers
    assert found.basic_layers == expected.basic_layers
    assert found.size == expected.size
    assert found.start_index == expected.start_index
    for name in expected:
        # Bits of colors mean something in a NaN, too; the smaller one of 0.0 and -0.0 is any.
        bits = [(layer[name] + np.float32(0)).view(np.uint32) for layer in (found, expected)]
        np.testing.assert_array_equal(*bits, err_msg=name)
