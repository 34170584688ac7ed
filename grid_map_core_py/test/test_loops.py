# SPDX-License-Identifier: BSD-3-Clause
"""Loops compile where numba works; otherwise the caller gets None and uses NumPy."""

import math
import os
import subprocess
import sys

import numpy as np
import pytest

from grid_map_core_py import _loops
from grid_map_core_py._loops import Loop, loop

PROGRAM = """
import sys
import numpy as np
from grid_map_core_py.simulation._rays import march
print("numba" in sys.modules, march.compiled() is not None)
"""

LINE = "numba compiles loops once, which takes some seconds"


def _scaled(value, factor):
    return value * factor


@loop(("float32*", 2), ("float64", 2), "int64", "uint32*")
def _mixed(layers, factors, count, results):
    for i in range(count):
        total = _scaled(layers[0][i], factors[0]) + math.floor(layers[1][i]) * factors[1]
        results[i] = np.uint32(total)


@pytest.fixture
def run(tmp_path):
    """Function that compiles a loop in another process and returns its output and its errors."""

    def finished(**environ):
        settings = {**os.environ, "NUMBA_CACHE_DIR": str(tmp_path / "cache"), **environ}
        command = [sys.executable, "-W", "error", "-c", PROGRAM]
        done = subprocess.run(command, env=settings, capture_output=True, text=True, check=True)
        return done.stdout, done.stderr

    return finished


@pytest.mark.needs("numba")
def test_second_process_loads_machine_code(run):
    assert run() == ("False True\n", f"{LINE}\n")
    assert run() == ("False True\n", "")


@pytest.mark.needs("numba")
def test_loops_compile_without_a_writable_folder(monkeypatch, caplog):
    import numba

    _loops._announce.cache_clear()

    njit = numba.njit

    def without_folder(*signatures, cache=False, **options):
        if cache:
            raise RuntimeError("cannot cache function: no locator available")
        return njit(*signatures, **options)

    monkeypatch.setattr(numba, "njit", without_folder)
    for made in (Loop(_mixed.function, _mixed.takes), Loop(_mixed.function, _mixed.takes)):
        assert made.compiled()
    assert caplog.messages == [LINE]


def test_loops_are_not_compiled_if_numba_is_turned_off(run):
    assert run(NUMBA_DISABLE_JIT="1") == ("False False\n", "")


def test_missing_numba_gives_none(monkeypatch):
    monkeypatch.setitem(sys.modules, "numba", None)
    assert Loop(_mixed.function, _mixed.takes).compiled() is None


@pytest.mark.needs("numba")
@pytest.mark.parametrize("order", ["C", "F"])
@pytest.mark.parametrize("writeable", [True, False])
def test_compiled_loops_give_the_results_of_python(order, writeable):
    layers = tuple(np.arange(first, first + 6, dtype=np.float32) / 4 for first in (0, 3))
    shaped = tuple(layer.reshape((2, 3), order=order) for layer in layers)
    shaped[0].flags.writeable = writeable
    results, expected = np.zeros((2, 6), np.uint32)
    _mixed.compiled()(shaped, (2.0, 3.5), 6, results)
    _mixed.function(layers, (2.0, 3.5), 6, expected)
    np.testing.assert_array_equal(results, expected)


@pytest.mark.needs("numba")
def test_array_in_pieces_is_refused():
    results = np.zeros((4, 4), np.uint32)[::2, ::2]
    with pytest.raises(TypeError, match="expected a contiguous array"):
        _mixed.compiled()((np.zeros(4, np.float32),) * 2, (2.0, 3.5), 4, results)


@pytest.mark.needs("numba")
def test_loops_that_numba_refuses_warn_once():
    @loop("float64*")
    def refused(values):
        values.no_such_method()

    with pytest.warns(RuntimeWarning, match=r"cannot compile .*refused, so NumPy is used"):
        assert refused.compiled() is None
    assert refused.compiled() is None
