# SPDX-License-Identifier: BSD-3-Clause
"""Filter chains: configuration, order, memory, errors and warnings."""

import inspect
import threading
import warnings
from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest
from filter_cases import TO_OUT, step_of

from grid_map_core_py import GridMap, LayerNotFoundError
from grid_map_core_py.errors import ConfigError
from grid_map_core_py.testing import assert_maps_equal, moved_in_buffer
from grid_map_filters_py import (
    FILTERS,
    FilterChain,
    FilterConfigError,
    FilterError,
    FilterWarning,
    Step,
    warn,
)
from grid_map_filters_py._chain import describe_parameters
from grid_map_filters_py._config import StepConfig
from grid_map_filters_py._times import StepTimes

DUPLICATION = "gridMapFilters/DuplicationFilter"
MATH = "gridMapFilters/MathExpressionFilter"


def step(name, expression, output_layer="out"):
    params = {"expression": expression, "output_layer": output_layer}
    return {"name": name, "type": MATH, "params": params}


@pytest.fixture
def grid_map() -> GridMap:
    return GridMap((1.0, 2.0), 0.5, layers={"elevation": 1.0})


def test_filters_run_in_numeric_order(grid_map):
    config = {
        f"filter{number}": step(f"step{number}", f"elevation * 10 + {number}", "elevation")
        for number in range(10, 0, -1)
    }
    expected = 1.0
    for number in range(1, 11):
        expected = np.float32(expected * 10 + number)
    chain = FilterChain.from_config(config)
    assert [s.config.name for s in chain.steps] == [f"step{number}" for number in range(1, 11)]
    np.testing.assert_allclose(chain(grid_map)["elevation"], expected, rtol=1e-6)


COPY = {
    "name": "copy",
    "type": DUPLICATION,
    "params": {"input_layer": "elevation", "output_layer": "copy"},
}


def chain_of(*functions):
    return FilterChain(
        Step(StepConfig(number, function.__name__, "my/Filter"), function)
        for number, function in enumerate(functions, start=1)
    )


def shares_a_layer(grid_map):
    return grid_map.with_layers({"same": grid_map["elevation"]})


def adds_a_layer_twice(grid_map):
    array = np.ones(grid_map.size, np.float32, order="F")
    return grid_map.with_layers({"one": array, "other": array})


@pytest.mark.parametrize("start_index", [(0, 0), (1, 2)])
@pytest.mark.parametrize(
    "chain",
    [
        FilterChain([]),
        FilterChain.from_config([step("one", "elevation + 1", "other"), COPY]),
        chain_of(shares_a_layer),
        chain_of(adds_a_layer_twice, shares_a_layer),
    ],
    ids=["empty", "built in", "shared", "added twice"],
)
def test_a_result_shares_no_memory(grid_map, chain, start_index):
    grid_map.start_index = start_index
    before = grid_map.copy()
    result = chain(grid_map)
    for name in result:
        others = [result[other] for other in result if other != name]
        for layer in (grid_map["elevation"], *others):
            assert not np.shares_memory(result[name], layer)
        result[name][...] = 7.0
    assert_maps_equal(grid_map, before)
    assert grid_map.start_index == start_index


def test_without_copies_shares_unchanged_layers_of_unmoved_maps(grid_map):
    chain = FilterChain.from_config([step("one", "elevation + 1", "other")])
    result, start_index = chain.without_copies(grid_map)
    assert start_index == (0, 0)
    assert np.shares_memory(result["elevation"], grid_map["elevation"])
    assert_maps_equal(result, chain(grid_map))
    assert not any(result[name].flags.writeable for name in result)
    grid_map["elevation"] = np.arange(8).reshape(2, 4)
    grid_map.start_index = (1, 2)
    before = grid_map.copy()
    result, start_index = chain.without_copies(grid_map)
    assert (result.start_index, start_index) == ((0, 0), (1, 2))
    np.testing.assert_array_equal(result["other"], grid_map.unwrapped("elevation") + 1)
    assert_maps_equal(grid_map, before)


def writes(grid_map):
    grid_map["elevation"][0, 0] = 5.0
    return grid_map


def moves_in_place(grid_map):
    grid_map.move(grid_map.position + grid_map.resolution)
    return grid_map


@pytest.mark.parametrize("function", [writes, moves_in_place])
@pytest.mark.parametrize("before", [(), (adds_a_layer_twice,)])
@pytest.mark.parametrize("start_index", [(0, 0), (1, 2)])
def test_a_filter_that_writes_into_its_input_fails(grid_map, function, before, start_index):
    grid_map.start_index = start_index
    untouched = grid_map.copy()
    with pytest.raises(FilterError) as caught:
        chain_of(*before, function)(grid_map)
    name = f"filter {len(before) + 1} {function.__name__!r} (my/Filter): "
    assert str(caught.value).startswith(f"{name}it writes into a layer of its input (")
    assert_maps_equal(grid_map, untouched)


def test_result_keeps_the_start_index_unless_normalized(grid_map):
    grid_map["elevation"] = np.arange(8).reshape(2, 4)
    grid_map.start_index = (1, 2)
    double = step("double", "2 * elevation")
    result = FilterChain.from_config([double])(grid_map)
    assert result.start_index == (1, 2)
    np.testing.assert_array_equal(result["out"], 2 * grid_map["elevation"])
    normalize = {"name": "normalize", "type": "gridMapFilters/BufferNormalizerFilter"}
    for config in ([normalize, double], [double, normalize]):
        normalized = FilterChain.from_config(config)(grid_map)
        assert normalized.start_index == (0, 0)
        assert_maps_equal(normalized, result)


def test_step_times_print_as_a_table():
    times = StepTimes()
    long, short = (
        Step(StepConfig(number, name, "my/Filter"), lambda grid_map: grid_map)
        for number, name in [(2, "smoothing"), (1, "cut")]
    )
    for filter_step, milliseconds in [(long, 30.0), (short, 2.5), (long, 10.0), (short, 7.5)]:
        times(filter_step, milliseconds / 1e3)
    assert str(times) == (
        "step       type       maps  last ms  mean ms  max ms  share\n"
        "cut        my/Filter     2    7.500    5.000   7.500    20%\n"
        "smoothing  my/Filter     2   10.000   20.000  30.000    80%\n"
        "sum                          17.500   25.000"
    )
    assert str(StepTimes()).splitlines()[-1].split() == ["sum", "0.000", "0.000"]


def test_missing_layer_error_names_filter_and_layers(grid_map):
    params = {"input_layer": "elevtion", "output_layer": "b"}
    chain = FilterChain.from_config([step("first", "1"), COPY | {"params": params}])
    with pytest.raises(FilterError) as caught:
        chain(grid_map)
    assert str(caught.value) == (
        f"filter 2 'copy' ({DUPLICATION}): no layer 'elevtion'; available: elevation, out; "
        "did you mean elevation?"
    )
    assert isinstance(caught.value.__cause__, LayerNotFoundError)


def test_errors_of_a_filter_name_the_filter(grid_map):
    def broken(_):
        raise ZeroDivisionError("oops")

    def empty(_):
        return None

    for function, message in [
        (broken, "ZeroDivisionError: oops"),
        (empty, "returned None instead of"),
    ]:
        name = f"filter 1 '{function.__name__}' "
        with pytest.raises(FilterError, match=rf"^{name}\(my/Filter\): {message}"):
            chain_of(function)(grid_map)


def test_warnings_go_to_the_list_of_the_caller(grid_map):
    def warns(grid_map):
        warn("careful")
        return grid_map

    collected = []
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        chain_of(warns, warns)(grid_map, warnings=collected)
    assert collected == [f"filter {n} 'warns' (my/Filter): careful" for n in (1, 2)]
    with pytest.warns(FilterWarning, match=r"^careful$"):
        warns(grid_map)


def test_one_chain_runs_in_many_threads(grid_map):
    """Four threads are in the last step at the same time, each with another map; 400 warnings."""
    all_run = threading.Barrier(4, timeout=30)

    def warns(grid_map):
        for number in range(4):
            all_run.wait()
            warn(f"{grid_map['elevation'][0, 0]} {number}")
        return grid_map

    ramp = {"min": {"value": 0, "color": [0, 0, 1]}, "max": {"value": 300, "color": [1, 0, 0]}}
    mean = {"expression": "meanOfFinites(elevation)", "edge_handling": "crop"}
    first = FilterChain.from_config([step("double", "2 * elevation", "elevation")]).steps
    color = step_of("ColorMap", **TO_OUT, **ramp)
    window = step_of("SlidingWindowMathExpression", **TO_OUT | {"output_layer": "mean"}, **mean)
    built_in = FilterChain([*first, color, window])
    chain = FilterChain([*built_in.steps, Step(StepConfig(4, "w", "F"), warns)])

    def run(height):
        start = (height % 2, height % 4)
        given = moved_in_buffer(grid_map.with_layers({"elevation": height}), start)
        collected = []
        return chain(given, warnings=collected), collected

    with ThreadPoolExecutor(4) as threads:
        results = list(threads.map(run, range(100)))
    for height, (result, collected) in enumerate(results):
        assert collected == [f"filter 4 'w' (F): {2.0 * height} {number}" for number in range(4)]
        expected = built_in(grid_map.with_layers({"elevation": height}))
        assert_maps_equal(result, expected)


def test_maps_are_unwrapped_after_a_filter_that_moves_them(grid_map):
    def moves(grid_map):
        moved = grid_map.copy()
        moved.move(grid_map.position + grid_map.resolution)
        return moved

    def looks(given):
        assert given.start_index == (0, 0)
        assert_maps_equal(given, moves(grid_map))
        return given

    assert moves(grid_map).start_index != (0, 0)
    chain_of(moves, looks)(grid_map)


GOOD = {"name": "n", "type": DUPLICATION, "params": {"input_layer": "a", "output_layer": "b"}}


def with_params(type_name, **params):
    return [{"name": "n", "type": type_name, "params": params}]


@pytest.mark.parametrize(
    ("config", "message"),
    [
        (None, "filters: expected filter1 .. filterN or a list, got nothing"),
        ("x" * 5000, "filters: expected filter1 .. filterN or a list, got 'xxx"),
        ({}, "filters: expected at least one filter, got none"),
        ({"filter1": GOOD, "filter3": GOOD}, "filters: filter2 is missing before filter3"),
        ({"filter1": GOOD, "fliter2": GOOD}, "expected filter1 .. filterN, got 'fliter2'"),
        ([{"type": DUPLICATION}], "filter 1: name: expected a string, got nothing"),
        (
            [{**GOOD, "parms": {}}],
            "filter 1: unknown entry 'parms'; expected name, type and params",
        ),
        ([{**GOOD, "params": [1]}], "filter 1 'n': params: expected a mapping, got [1] (list)"),
        ([GOOD, GOOD], "filter 2: the name 'n' is already used by filter 1"),
        (
            with_params("gridMapFilters/TresholdFilter"),
            "unknown type 'gridMapFilters/TresholdFilter'; did you mean gridMapFilters/Threshold",
        ),
        (
            with_params(DUPLICATION, input_layer="a", ouput_layer="b"),
            "unknown parameter 'ouput_layer'; known: input_layer, output_layer",
        ),
        (
            with_params(DUPLICATION, input_layer="a", output_layer=""),
            "'output_layer': expected the name of a layer",
        ),
        (
            with_params(MATH, expression="abs(a -)", output_layer="b"),
            f"filter 1 'n' ({MATH}): unexpected ')', expected a value\n    abs(a -)\n           ^",
        ),
    ],
)
def test_wrong_configurations_are_refused_with_the_place(config, message):
    with pytest.raises(FilterConfigError) as caught:
        FilterChain.from_config(config)
    assert message in str(caught.value)
    assert len(str(caught.value)) < 400
    assert isinstance(caught.value, ConfigError)


def test_parameters_are_described():
    ramp = {"min": {"value": 0, "color": [0, 0, 0]}, "max/value": 1, "nonsense": 2}
    config = {
        "filter1": {"name": "a", "type": "ColorMap", "params": ramp},
        "filter2": {"name": "b", "type": "no/Filter", "params": {"radius": 1}},
        "filter3": 7,
    }
    found = describe_parameters(config)
    assert found["filter1.params.min.value"].startswith("value that")
    assert found["filter1.params.min.color"].startswith("red, green and blue")
    assert found["filter1.params.max/value"].endswith("must exceed `min_value`")
    assert found["filter1.name"] == "name of filter1"
    assert found["filter2.type"] == "type of filter2"
    assert {"filter1.params.nonsense", "filter2.params.radius", "filter3"}.isdisjoint(found)


A = """{name: a, type: gridMapFilters/MathExpressionFilter,
                 params: {expression: elevation + 1, output_layer: elevation}}"""
B = """{name: b, type: gridMapFilters/ThresholdFilter,
                 params: {layer: elevation, upper_threshold: 1e-3, set_to: .nan}}"""

ROS2 = f"""
grid_map_filters:
  ros__parameters:
    input_topic: /grid_map
    filters:
      filter1: {A}
      filter2: {B}
"""

FLAT = """
/**:
  ros__parameters:
    filters.filter1.name: a
    filters.filter1.type: gridMapFilters/MathExpressionFilter
    filters.filter1.params: {expression: elevation + 1, output_layer: elevation}
    filters.filter2:
      name: b
      type: gridMapFilters/ThresholdFilter
      params.layer: elevation
      params.upper_threshold: 1e-3
      params.set_to: .nan
"""

NAMESPACED = f"""
robot:
  mapping: {{ros__parameters: {{other: 1}}}}
  filtering:
    ros__parameters:
      filters: {{filter1: {A}, filter2: {B}}}
"""

FORMS = {
    "ros 2": (ROS2, "filters"),
    "other name": (ROS2.replace(" filters:", " my_chain:"), "my_chain"),
    "ros 1": (f"grid_map_filters: [{A}, {B}]", "filters"),
    "flat": (FLAT, "filters"),
    "namespaced": (NAMESPACED, "filters"),
    "list alone": (f"[{A}, {B}]", "filters"),
    "named alike": (ROS2.replace("grid_map_filters:", "filters:"), "filters"),
}


@pytest.mark.parametrize(("text", "name"), FORMS.values(), ids=FORMS)
def test_chain_loads_from_every_form_of_yaml(tmp_path, grid_map, text, name):
    path = tmp_path / "chain.yaml"
    path.write_text(text)
    chain = FilterChain.from_yaml(path, name)
    assert [s.config.name for s in chain.steps] == ["a", "b"]
    assert np.isnan(chain(grid_map)["elevation"]).all()


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("filters: {filter1: {name: a}, filter1: {name: b}}", "'filter1' occurs twice"),
        (
            "a: {ros__parameters: {filters: 1, filters.filter1.name: a}}",
            "'filters': expected no value, as there are parameters below it, got 1",
        ),
        ("a: {ros__parameters: {x: 1}}", "found no filter chain 'filters'"),
        (
            "a: {ros__parameters: {filters: {}}}\nb: {ros__parameters: {filters: {}}}",
            "more than one node has 'filters': /a, /b",
        ),
    ],
)
def test_file_without_exactly_one_chain_is_refused(tmp_path, text, message):
    path = tmp_path / "chain.yaml"
    path.write_bytes(text.encode("utf-8", "surrogateescape"))
    with pytest.raises(FilterConfigError) as caught:
        FilterChain.from_yaml(path)
    assert message in str(caught.value)
    assert str(caught.value).startswith(f"{path}: ")


def test_missing_file_is_an_error_with_a_similar_name(tmp_path):
    (tmp_path / "chain.yaml").write_text("[]")
    with pytest.raises(FilterConfigError, match=r"No such file .*; did you mean chain\.yaml\?"):
        FilterChain.from_yaml(tmp_path / "chian.yaml")


def test_chain_and_filter_refuse_what_is_not_a_map():
    slope = FILTERS["Slope"](input_layer="elevation", output_layer="slope")
    for call in (FilterChain([]), slope):
        with pytest.raises(FilterError, match=r"a GridMap, got dict. dataset.grid_map.filter"):
            call({})
    with pytest.raises(FilterConfigError, match=r"Step objects, got Slope.*from_config"):
        FilterChain([slope])


def test_misspelled_parameter_of_a_class_gets_a_suggestion():
    layers = {"input_layer": "elevation", "output_layer": "slope"}
    with pytest.raises(ConfigError, match=r"unknown parameter 'radus'; .*did you mean radius\?$"):
        FILTERS["Slope"](**layers, radus=0.3)
    with pytest.raises(ConfigError, match=r"^missing parameter 'output_layer'$"):
        FILTERS["Slope"](input_layer="elevation")
    assert "radius" in inspect.signature(FILTERS["Slope"]).parameters
