# SPDX-License-Identifier: BSD-3-Clause
"""Chains on tiled maps and lazy datasets: the numbers of the whole map, window by window."""

import pickle
import warnings
from dataclasses import dataclass, replace

import numpy as np
import pytest
from filter_cases import ground, step_of, terrain
from filter_strategies import EXTREMES, PARAMETERS, assert_same_bits, maps
from hypothesis import given, settings, strategies as st

from grid_map_core_py import GridMap
from grid_map_core_py.tiled import open_map
from grid_map_filters_py import FilterChain, FilterError, FilterWarning, Step
from grid_map_filters_py._config import StepConfig
from grid_map_filters_py.parts._holes import FindHoles, find_holes, merged

pytestmark = pytest.mark.needs("xarray", "dask")

SUMS = ("GaussianBlur", "MeanInRadius", "NormalVectors", "Roughness", "Slope")
"""Filters whose sums are taken around a typical value of the layer, or of the tile."""

SIDES = st.tuples(st.integers(3, 17), st.integers(3, 17))


def tiled(grid_map, side):
    """Return a map as a tiled one; `side` is that of a tile, or both."""
    return replace(open_map(grid_map.to_xarray()), tile=np.broadcast_to(side, 2).tolist())


def in_tiles(site) -> GridMap:
    """Return a tiled map that is read tile by tile."""
    import dask

    layers = {name: np.empty(site.size, np.float32, order="F") for name in site.layers}
    with dask.config.set(scheduler="synchronous"):
        site.source.prepare()
    for window in site.tiles:
        for name, part in zip(layers, site.source.read(window, site.layers), strict=True):
            layers[name][window] = part
    return GridMap.from_geometry(
        site.geometry,
        layers,
        basic_layers=site.basic_layers,
        frame_id=site.frame_id,
        timestamp=site.timestamp,
    )


def both_ways(steps, grid_map, side):
    """Return the map that a chain gives in tiles, and the one that it gives as a whole."""
    chain = FilterChain(steps)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", FilterWarning)
        return in_tiles(tiled(grid_map, side).filter(chain, max_hole=1000)), chain(grid_map)


def with_hole(rows, columns, *, size=(40, 50)):
    heights = np.random.default_rng(1).normal(size=size)
    heights[rows, columns] = np.nan
    return ground(heights)


def assert_near(found, expected):
    """Compare with 1e-5 of the range of each layer."""
    assert found.layers == expected.layers
    for name in expected:
        finite = expected[name][np.isfinite(expected[name])]
        spread = float(np.ptp(finite)) if finite.size else 0.0
        slack = 1e-5 * spread + 1e-6 * np.abs(finite).max(initial=1e-3)
        np.testing.assert_allclose(found[name], expected[name], rtol=0, atol=slack, err_msg=name)


def sums_up(step):
    """Return whether the numbers depend on the order of sums."""
    name, params = type(step.filter).__name__, step.config.params
    if name in ("NormalVectors", "Slope"):
        return params.get("radius", 0) > 0 and params.get("algorithm") != "raster"
    return name in SUMS or (name == "MathExpression" and "mean" in params["expression"])


def steps_of(type_name):
    """Return a strategy for steps that can run on tiles."""
    steps = PARAMETERS[type_name].map(lambda parameters: step_of(type_name, **parameters))
    return steps.filter(lambda step: "transpose" not in step.config.params.get("expression", ""))


ON_TILES = sorted(PARAMETERS.keys() - {"PlanarRegions"})
"""Filters that can run on tiles."""


@pytest.mark.parametrize("type_name", ON_TILES)
@given(data=st.data(), side=SIDES)
@settings(max_examples=20)
def test_every_filter_in_tiles_equals_the_whole_map(type_name, data, side):
    step = data.draw(steps_of(type_name))
    sums = sums_up(step)
    grid_map = data.draw(maps(allow_moved=False, extremes=[0.0] if sums else EXTREMES))
    (assert_near if sums else assert_same_bits)(*both_ways([step], grid_map, side))


@given(data=st.data(), side=SIDES)
@settings(max_examples=40)
def test_chains_without_sums_in_tiles_give_the_same_bits(data, side):
    kinds = st.sampled_from(sorted({*ON_TILES} - {*SUMS, "Deletion"})).flatmap(steps_of)
    steps = data.draw(
        st.lists(kinds.filter(lambda step: not sums_up(step)), min_size=2, max_size=4)
    )
    grid_map = data.draw(maps(allow_moved=False))
    assert_same_bits(*both_ways(steps, grid_map, side))


CONTINUOUS = [
    step_of("MeanInRadius", input_layer="elevation", output_layer="elevation", radius=0.2),
    step_of("GaussianBlur", input_layer="elevation", output_layer="elevation", sigma=0.1),
    step_of("Inpaint", input_layer="elevation", output_layer="elevation", radius=0.1),
    step_of("Dilation", input_layer="elevation", output_layer="other", radius=0.2),
    step_of("Roughness", input_layer="elevation", output_layer="rough", radius=0.2),
    step_of("Slope", input_layer="elevation", output_layer="slope", radius=0.2),
    step_of(
        "MathExpression",
        expression="(elevation - meanOfFinites(elevation)) ./ sumOfFinites(abs(other))",
        output_layer="elevation",
    ),
    step_of(
        "MathExpression",
        expression="elevation + maxOfFinites(other - meanOfFinites(elevation))",
        output_layer="other",
    ),
    step_of(
        "SlidingWindowMathExpression",
        input_layer="other",
        output_layer="elevation",
        expression="meanOfFinites(other) - minOfFinites(other)",
        edge_handling="crop",
    ),
]


@given(st.lists(st.sampled_from(CONTINUOUS), min_size=2, max_size=4), st.data(), SIDES)
@settings(max_examples=40)
def test_chains_with_sums_in_tiles_are_near(steps, data, side):
    grid_map = data.draw(maps(allow_moved=False, extremes=[0.0]))
    assert_near(*both_ways(steps, grid_map, side))


# --- what is read and computed --------------------------------------------------------------------


class Recorder:
    """A source that records what is read."""

    def __init__(self, site):
        self.source, self.names = site.source, set()

    def __getattr__(self, name):
        return getattr(self.source, name)

    def read(self, window, names):
        self.names.update(names)
        return self.source.read(window, names)


def chain_of(*entries):
    config = [
        {"name": f"filter{number}", "type": type_name, "params": params}
        for number, (type_name, params) in enumerate(entries)
    ]
    return FilterChain.from_config(config)


def math(expression, output_layer="out"):
    return "MathExpression", {"expression": expression, "output_layer": output_layer}


def test_a_chain_reads_only_the_layers_that_a_result_needs():
    site = tiled(terrain(a=1.0, b=2.0, c=3.0, d=4.0), 4)
    recorder = Recorder(site)
    chain = chain_of(math("a + 1", "x"), math("b + max(c)", "y"), math("2 * y", "z"))
    result = replace(site, source=recorder).filter(chain)
    assert recorder.names == set()
    result.source.prepare()
    assert recorder.names == {"c"}
    recorder.names.clear()
    np.testing.assert_array_equal(result.to_map(["x"])["x"], 2)
    assert recorder.names == {"a"}
    recorder.names.clear()
    np.testing.assert_array_equal(result.to_map(["z", "d"])["z"], 10)
    assert recorder.names == {"b", "c", "d"}


def test_quantities_of_the_whole_map_are_computed_once_and_pickled():
    grid_map = ground(np.arange(63.0).reshape(9, 7))
    site = tiled(grid_map, 4)
    recorder = Recorder(site)
    chain = chain_of(math("elevation ./ max(elevation - min(elevation))"))
    result = replace(site, source=recorder).filter(chain)
    expected = result.to_map()
    result = pickle.loads(
        pickle.dumps(replace(result, source=replace(result.source, tiled_map=site)))
    )
    recorder.names.clear()
    assert_same_bits(in_tiles(result), expected)
    assert_same_bits(expected, chain(grid_map))
    assert recorder.names == set()


def test_a_description_changes_with_parameters_and_options():
    site = tiled(terrain(elevation=1.0), 4)
    one, same, other = (
        site.filter(chain_of(math(text))).source.describe() for text in ("1", "1", "2")
    )
    assert one == same != other
    assert site.filter(chain_of(math("1")), max_hole=9).source.describe() != one
    assert site.source.describe() in one


# --- refusals -------------------------------------------------------------------------------------


@dataclass(frozen=True, kw_only=True)
class Shift:
    """A filter of another package: moves the layer by a row."""

    def __call__(self, grid_map):
        layer = grid_map["elevation"]
        shifted = np.concatenate([layer[:1], layer[:-1]])
        return grid_map.with_layers({"elevation": shifted})


class LocalShift(Shift):
    def reach(self, _resolution):
        return 1


class ShiftByMean(Shift):
    """A filter of another package: subtracts the mean of the layer."""

    def for_tiles_of(self, tiled_map, _options):
        means = tiled_map.over_tiles(lambda tile: (tile["elevation"].sum(), tile["elevation"].size))
        return Subtract(np.divide(*np.sum(means, axis=0)))

    def __call__(self, grid_map):
        return Subtract(grid_map["elevation"].mean())(grid_map)


@dataclass(frozen=True)
class Subtract:
    number: float

    def reach(self, _resolution):
        return 0

    def __call__(self, grid_map):
        return grid_map.with_layers({"elevation": grid_map["elevation"] - self.number})


def mine(function):
    return FilterChain([Step(StepConfig(1, "mine", "my/Filter"), function)])


def test_chains_are_refused_before_data_is_read():
    site = tiled(ground(np.eye(9)), 4)
    with pytest.raises(FilterError, match=r"'filter1'.*no layer 'hight'; available: elevation, x"):
        site.filter(chain_of(math("elevation", "x"), math("abs(hight)")))
    with pytest.raises(FilterError, match=r"'mine'.*cannot run on tiles.*`reach\(resolution\)`"):
        site.filter(mine(Shift()))


@pytest.mark.parametrize("function", [LocalShift(), ShiftByMean()])
def test_filters_of_other_packages_run_on_tiles(function):
    grid_map = ground(np.arange(63.0).reshape(9, 7))
    assert_near(*both_ways(mine(function).steps, grid_map, 4))


@pytest.mark.parametrize(
    ("expression", "place"),
    [
        ("1 + transpose(elevation)", "transpose"),
        ("elevation * elevation", "* elevation"),
        ("elevation + mean(0, 1)", "mean(0"),
        ("[elevation, elevation]", "["),
    ],
)
def test_expressions_of_whole_layers_are_refused(expression, place):
    site = tiled(terrain(elevation=1.0, mean=2.0), 4)
    with pytest.raises(FilterError, match="cannot run on tiles: this part needs whole") as caught:
        site.filter(chain_of(math(expression)))
    *_, line, caret = str(caught.value).splitlines()
    assert line.strip() == expression
    assert line[caret.index("^") :].startswith(place)


# --- expressions ----------------------------------------------------------------------------------

REDUCTIONS = {
    "min(a)": 0,
    "max(a - minOfFinites(b))": 0,
    "maxOfFinites(a) + size(b, 0) * size(b, 1)": 0,
    "numberOfFinites(a ./ b)": 0,
    "sum(b - meanOfFinites(a))": 1e-6,
    "max(sumOfFinites(a)) + norm(3)": 1e-6,
}


@pytest.mark.parametrize("expression", REDUCTIONS)
@pytest.mark.parametrize("values", [1.0, np.nan, np.inf])
def test_reductions_over_tiles_equal_those_of_the_layer(expression, values):
    random = np.random.default_rng(3)
    a, b = random.uniform(0.5, 1.5, (2, 9, 7)).astype(np.float32)
    a[random.random(a.shape) < 0.3] = np.nan
    a[0], b[2, 3] = values, values
    found, expected = both_ways(
        chain_of(math(f"a + {expression}")).steps, terrain(a=a, b=b), (4, 3)
    )
    rtol = REDUCTIONS[expression]
    np.testing.assert_allclose(found["out"], expected["out"], rtol=rtol, equal_nan=True)


# --- holes ----------------------------------------------------------------------------------------

INPAINT = "gridMapCv/InpaintFilter"


def inpaint(**params):
    return chain_of((INPAINT, {"input_layer": "elevation", "output_layer": "out"} | params))


def heights_with_holes(size, share, seed, longest=0):
    """Return noise on a slope with scattered holes, and some long ones."""
    random = np.random.default_rng(seed)
    heights = np.cumsum(random.normal(size=size), axis=0)
    heights[random.random(size) < share] = np.nan
    for _ in range(3 if longest else 0):
        (row, column), (rows, columns) = random.integers(0, size), random.integers(1, longest, 2)
        heights[row : row + rows, column : column + columns] = np.nan
    return heights


def by_place(holes):
    return sorted(np.column_stack([holes.starts, holes.ends, holes.areas]).tolist())


@given(
    st.tuples(st.integers(1, 30), st.integers(1, 30)),
    st.sampled_from([0.0, 0.1, 0.4, 0.6, 1.0]),
    st.tuples(st.integers(1, 9), st.integers(1, 9)),
    st.integers(0, 2**32),
)
def test_holes_across_tiles_equal_those_of_the_whole_map(size, share, side, seed):
    grid_map = ground(heights_with_holes(size, share, seed))
    site = tiled(grid_map, side)
    find = FindHoles("elevation", site.geometry, 0)
    found = merged([find(site.get_block(*window)) for window in site.tiles], site.tiles.counts)
    _, expected = find_holes(np.isnan(grid_map["elevation"]))
    assert by_place(found) == by_place(expected)


LIMITS = st.fixed_dictionaries(
    {"radius": st.sampled_from([0.1, 0.2, 0.3])},
    optional={"enclosed_holes_only": st.just(True), "max_hole_area": st.sampled_from([0.05, 2.0])},
)


@given(LIMITS, st.sampled_from([0.0, 0.02, 0.1]), st.integers(7, 40), st.integers(0, 2**32))
@settings(max_examples=15)
def test_holes_wider_than_tiles_are_filled_without_a_seam(limits, share, side, seed):
    grid_map = ground(heights_with_holes((120, 90), share, seed, longest=50))
    found, expected = (
        result["out"] for result in both_ways(inpaint(**limits).steps, grid_map, side)
    )
    slack = 1e-6 * (np.nanmax(expected) - np.nanmin(expected))
    np.testing.assert_allclose(found, expected, rtol=0, atol=slack)


def test_too_long_hole_is_refused_before_the_first_tile():
    grid_map = with_hole(slice(10, 12), slice(5, 26))
    site = tiled(grid_map, 8)
    with pytest.raises(FilterError, match=r"'filter0'.*2 x 21 cells around \(0.9, 0.95\).*leave"):
        site.filter(inpaint(radius=0.1), max_hole=20).source.prepare()
    found = in_tiles(site.filter(inpaint(radius=0.1), max_hole=21))
    assert_same_bits(found, inpaint(radius=0.1)(grid_map))


@pytest.mark.parametrize("side", [5, 8, 21, 64])
def test_long_holes_are_left_as_they_are_in_all_tiles(side):
    grid_map = with_hole(slice(10, 12), slice(5, 26))
    grid_map["elevation"][30:35, 8:30:7] = np.inf
    options = {"max_hole": 20, "large_holes": "leave"}
    found = in_tiles(tiled(grid_map, side).filter(inpaint(radius=0.1), **options))["out"]
    expected = inpaint(radius=0.1)(grid_map)["out"]
    expected[10:12, 5:26] = np.nan
    np.testing.assert_array_equal(found, expected)


# --- datasets of xarray ---------------------------------------------------------------------------


def test_chain_on_a_lazy_dataset_equals_that_on_the_map():
    grid_map = with_hole(slice(10, 14), slice(20, 23), size=(60, 47))
    normals = {"output_layers_prefix": "normal_", "normal_vector_positive_axis": "z"}
    chain = chain_of(
        (INPAINT, {"input_layer": "elevation", "output_layer": "filled", "radius": 0.2}),
        ("NormalVectors", {"input_layer": "filled", "radius": 0.2} | normals),
        ("Slope", {"input_layers_prefix": "normal_", "output_layer": "slope"}),
    )
    dataset = grid_map.to_xarray()
    at_once = dataset.grid_map.filter(chain)
    assert at_once.grid_map.to_map() == chain(grid_map)
    later = dataset.chunk(x=17, y=13).grid_map.filter(chain, max_hole=12)
    assert later["slope"].chunks == ((17, 17, 17, 9), (13, 13, 13, 8))
    found = later.compute()
    for name in at_once:
        np.testing.assert_allclose(found[name], at_once[name], atol=1e-5, err_msg=name)


# --- warnings -------------------------------------------------------------------------------------


def test_warnings_about_layers_come_once_before_data_is_read():
    with pytest.warns(FilterWarning, match="'filter0'.*no layer x to delete") as caught:
        site = tiled(ground(np.eye(9)), 4).filter(chain_of(("Deletion", {"layers": ["x"]})))
    assert len(caught) == 1
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        in_tiles(site)


def test_layer_without_values_is_one_warning():
    site = tiled(terrain(elevation=np.nan), 3).filter(inpaint(radius=0.1), max_hole=9)
    with pytest.warns(FilterWarning, match="no finite cell") as caught:
        in_tiles(site)
    assert len(caught) == 1
