# SPDX-License-Identifier: BSD-3-Clause
"""Cell functions give the same bits with numba and with NumPy."""

import importlib
import os
import subprocess
import sys

import numpy as np
import pytest
from hypothesis import given, strategies as st
from hypothesis.extra import numpy as arrays

from grid_map_filters_py.parts._cell_function import CellFunction, cell_function, clamp

BUILTIN = "grid_map_filters_py._builtin"
FUNCTIONS = {
    f"{module}.{name}": function
    for module in (
        "color_blending",
        "color_fill",
        "color_map",
        "curvature",
        "light_intensity",
        "normal_color_map",
    )
    for name, function in vars(importlib.import_module(f"{BUILTIN}._{module}")).items()
    if isinstance(function, CellFunction)
}
FLOATS = st.floats(width=32) | st.floats(-2, 2, width=32)
ANY_BITS = st.integers(0, 2**24 - 1) | st.just(0x7FC00000) | st.integers(0, 2**32 - 1)

PROGRAM = """
import numpy as np
from grid_map_core_py import GridMap
from grid_map_filters_py import FilterChain
grid_map = GridMap((0.3, 0.2), 0.1, layers={"elevation": [[0, 1], [0.5, np.nan], [9, -9]]})
color = {"input_layer": "elevation", "output_layer": "color", "min_value": 0.0, "max_value": 1.0,
         "min_color": [0, 0, 1], "max_color": [1, 0, 0]}
chain = FilterChain.from_config([{"name": "c", "type": "ColorMap", "params": color}])
print(*(f"{bits:x}" for bits in chain(grid_map)["color"].view(np.uint32).ravel()))
"""


@pytest.mark.parametrize("name", FUNCTIONS)
@given(data=st.data())
def test_compiled_functions_give_the_bits_of_numpy(name, data):
    function = FUNCTIONS[name]
    elements = ANY_BITS if function.takes == np.uint32 else FLOATS
    count = data.draw(st.integers(1, 40))
    layers = [
        data.draw(arrays.arrays(function.takes, count, elements=elements))
        for _ in range(function.layers)
    ]
    numbers = [data.draw(st.floats(-2, 2, width=32)) for _ in range(function.numbers)]
    compiled = function(layers, numbers)
    expected = function.plain(layers, tuple(map(np.float32, numbers)))
    # An operation with two different NaN may return either.
    np.testing.assert_array_equal(compiled, expected.view(np.float32))
    finite = ~np.isnan(compiled)
    np.testing.assert_array_equal(
        compiled.view(np.uint32)[finite], expected.view(np.uint32)[finite]
    )


@pytest.mark.parametrize("shape", [(2, 3), (1, 1), (0,), (6,)])
def test_result_has_shape_of_layers_and_fortran_order(shape):
    @cell_function(takes=np.float32, gives=np.float32, numbers=1)
    def times(value, factor):
        return value * factor[0]

    layer = np.arange(np.prod(shape), dtype=np.float32).reshape(shape, order="F")
    result = times([layer], [2])
    np.testing.assert_array_equal(result, 2 * layer)
    assert result.flags.f_contiguous
    assert result.dtype == np.float32


def test_clamp_gives_the_lowest_for_nan():
    values = np.array([np.nan, -np.inf, -1, 0.5, 2, np.inf], np.float32)
    clamped = clamp(values, np.float32(0), np.float32(1))
    np.testing.assert_array_equal(clamped, [0, 0, 0, 0.5, 1, 1])


@pytest.mark.parametrize("setting", ["MISSING", "NUMBA_DISABLE_JIT", "BROKEN"])
def test_filters_work_if_numba_is_missing_turned_off_or_broken(tmp_path, setting):
    (tmp_path / "numba").mkdir()
    (tmp_path / "numba" / "__init__.py").write_text("raise SystemError('built for another NumPy')")
    # State after a failed import.
    program = (
        PROGRAM if setting != "MISSING" else f"import sys; sys.modules['numba'] = None{PROGRAM}"
    )
    environ = {**os.environ, setting: "1"}
    if setting == "BROKEN":
        environ["PYTHONPATH"] = f"{tmp_path}:{environ.get('PYTHONPATH', '')}"
    command = [sys.executable, "-c", program]
    done = subprocess.run(
        command, capture_output=True, text=True, timeout=60, check=True, env=environ
    )
    assert done.stdout.split() == ["ff", "ff0000", "7f007f", "7fc00000", "ff0000", "ff"]
    said = "so NumPy is used: SystemError: built for another NumPy"
    assert (said in done.stderr) == (setting == "BROKEN")
