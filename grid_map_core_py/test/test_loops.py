# SPDX-License-Identifier: BSD-3-Clause
"""Loops are compiled once; machine code on disk is used only if it is fresh, whole and trusted."""

import math
import os
import signal
import subprocess
import sys
import threading
from contextlib import contextmanager
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
import pytest
from hypothesis import given, strategies as st

from grid_map_core_py._loops import Loop, _folder, _machine_code, loop
from grid_map_core_py._loops._fingerprint import described

needs_numba = pytest.mark.needs("numba")

PARTS = "def scaled(value):\n    return {factor} * value\n"
PROGRAM = """
import sys
import numpy as np
from grid_map_core_py._loops import loop
from parts import scaled

@loop("float64*", "int64", "float64*")
def scale(values, count, results):
    for i in range(count):
        results[i] = scaled(values[i])

results = np.zeros(3)
run = scale.compiled(always={always})
if run:
    run(np.array([1.0, 2.0, np.nan]), 3, results)
print(*results, "numba" in sys.modules)
"""
COMPILED, LOADED, MISSING = "True", "False", "0.0 0.0 0.0 False"


@pytest.fixture
def cache(tmp_path, monkeypatch):
    """Folder for machine code, not made yet."""
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    return tmp_path / "cache" / "grid_map_py"


@contextmanager
def opened(name):
    number = os.open(name, os.O_RDONLY)
    try:
        yield number
    finally:
        os.close(number)


@pytest.fixture
def start(tmp_path, cache):  # noqa: ARG001  processes find the folder by themselves
    """Function that starts a process which compiles or loads a loop."""

    def started(factor=2.0, *, always=False, **environ):
        folder = tmp_path / f"parts_{factor}"
        folder.mkdir(exist_ok=True)
        (folder / "parts.py").write_text(PARTS.format(factor=factor))
        path = f"{folder}:{os.environ.get('PYTHONPATH', '')}"
        command = [sys.executable, "-c", PROGRAM.format(always=always)]
        settings = {**os.environ, "PYTHONPATH": path, **environ}
        return subprocess.Popen(
            command, text=True, stdout=subprocess.PIPE, stderr=subprocess.PIPE, env=settings
        )

    return started


@pytest.fixture
def run(start):
    """Function that runs such a process and returns what it prints: the results, how it got them.

    The last word is True if it has compiled.
    """

    def finished(*arguments, **settings):
        output, errors = start(*arguments, **settings).communicate(timeout=100)
        assert errors == ""
        return output.strip()

    return finished


@needs_numba
def test_second_process_does_not_compile(run, cache):
    assert run() == f"2.0 4.0 nan {COMPILED}"
    assert run() == f"2.0 4.0 nan {LOADED}"
    assert len(list(cache.iterdir())) == 1


@needs_numba
def test_changed_callee_is_compiled_anew(run):
    assert run(2.0) == f"2.0 4.0 nan {COMPILED}"
    assert run(3.0) == f"3.0 6.0 nan {COMPILED}"
    assert run(2.0) == f"2.0 4.0 nan {LOADED}"


@needs_numba
def test_damaged_file_is_ignored_and_mended(run, cache):
    run()
    (file,) = cache.iterdir()
    content = file.read_bytes()
    file.write_bytes(content[:-1] + bytes([content[-1] ^ 1]))
    assert run() == f"2.0 4.0 nan {COMPILED}"
    assert file.read_bytes() == content


@given(place=st.integers(0, 40), bit=st.integers(0, 7), length=st.integers(0, 40))
def test_damaged_files_count_as_missing(place, bit, length):
    with TemporaryDirectory() as name, opened(name) as folder:
        _folder.write(folder, "name", b"key", b"the code!")
        content = bytearray((Path(name) / "name").read_bytes())
        content[place] ^= 1 << bit
        for damaged in (content, content[:length], b""):
            (Path(name) / "name").write_bytes(damaged)
            assert _folder.read(folder, "name", b"key") is None


@needs_numba
def test_processes_that_start_at_once_agree(start, cache):
    processes = [start() for _ in range(3)]
    outputs = [process.communicate(timeout=100) for process in processes]
    assert {output.split()[1] for output, _ in outputs} == {"4.0"}
    assert len(list(cache.iterdir())) == 1


@needs_numba
@pytest.mark.parametrize("always", [False, True])
def test_without_folder_loops_compile_only_on_demand(run, tmp_path, always):
    (tmp_path / "cache").write_text("a file in place of the folder")
    expected = f"2.0 4.0 nan {COMPILED}" if always else MISSING
    assert run(always=always) == expected


def test_loops_are_not_compiled_if_numba_is_turned_off(run):
    assert run(NUMBA_DISABLE_JIT="1") == MISSING


@needs_numba
def test_folder_that_others_can_write_is_not_trusted(run, cache):
    run()
    cache.chmod(0o777)
    assert run() == MISSING
    cache.chmod(0o700)
    assert run() == f"2.0 4.0 nan {LOADED}"


@pytest.mark.parametrize("mode", [0o777, 0o1777])
def test_folder_that_others_can_exchange_is_not_trusted(cache, mode):
    cache.parent.mkdir()
    cache.parent.chmod(mode)
    with _folder.open_folder() as folder:
        assert (folder is None) == (mode == 0o777)


def test_files_of_others_are_not_read(cache, monkeypatch):
    with _folder.open_folder() as folder:
        assert _folder.write(folder, "name", b"key", b"code")
        assert _folder.read(folder, "name", b"key") == b"code"
        assert _folder.read(folder, "name", b"other key") is None
        (cache / "name").chmod(0o622)
        assert _folder.read(folder, "name", b"key") is None
        (cache / "name").chmod(0o600)
        (cache / "link").symlink_to("name")
        assert _folder.read(folder, "link", b"key") is None
        monkeypatch.setattr(os, "geteuid", lambda: os.getuid() + 1)
        assert _folder.read(folder, "name", b"key") is None
    with _folder.open_folder() as folder:
        assert folder is None


def test_folder_is_private_and_no_link(cache):
    with _folder.open_folder() as folder:
        assert folder is not None
    assert cache.stat().st_mode & 0o777 == 0o700
    cache.rename(cache.with_name("elsewhere"))
    cache.symlink_to("elsewhere")
    with _folder.open_folder() as folder:
        assert folder is None


def test_write_removes_what_killed_processes_left(cache):
    old, new = cache / ".old.01234567.partial", cache / ".new.01234567.partial"
    with _folder.open_folder() as folder:
        for path in (old, new):
            path.touch()
        os.utime(old, (0, 0))
        assert _folder.write(folder, "name", b"key", b"code")
    assert {path.name for path in cache.iterdir()} == {new.name, "name"}


def test_full_disk_leaves_no_file(cache, full_disk):
    with _folder.open_folder() as folder, full_disk(10):
        assert not _folder.write(folder, "name", b"key", b"code")
    assert list(cache.iterdir()) == []


def test_home_of_another_user_gets_no_folder(cache, monkeypatch):
    monkeypatch.setattr(os, "geteuid", lambda: os.getuid() + 1)
    with _folder.open_folder() as folder:
        assert folder is None
    assert not cache.parent.exists()


def test_no_home_means_no_folder(monkeypatch):
    monkeypatch.delenv("XDG_CACHE_HOME", raising=False)

    def no_home():
        raise RuntimeError("no home")

    monkeypatch.setattr(Path, "home", no_home)
    with _folder.open_folder() as folder:
        assert folder is None


def functions_of(source):
    known = {"math": math, "np": np, "__name__": __name__}
    exec(source, known)  # noqa: S102
    return known


BASE = """
NUMBER = np.float32(1)
PAIR = 1, 2.0
def inner(x):
    return x + NUMBER
def used(x, y=PAIR):
    return inner(x) * math.sqrt(x) + 3 * PAIR[0]
"""


@pytest.mark.parametrize(
    ("old", "new"),
    [
        ("np.float32(1)", "np.float32(2)"),
        ("np.float32(1)", "np.float64(1)"),
        ("np.float32(1)", "1"),
        ("1, 2.0", "1, 2"),
        ("1, 2.0", "(1, (2.0,))"),
        ("x + NUMBER", "x - NUMBER"),
        ("3 *", "3.0 *"),
        ("3 *", "(lambda z: z)(3) *"),
        ("math.sqrt", "math.floor"),
        ("y=PAIR", "y=None"),
    ],
)
def test_fingerprint_differs_with_everything_used(old, new):
    assert old in BASE
    changed = described(functions_of(BASE.replace(old, new))["used"], {})
    assert described(functions_of(BASE)["used"], {}) != changed


def test_fingerprint_ignores_places_and_unused_names():
    moved = "\n\nOTHER = [1]\n" + BASE.replace("return inner", "# a remark\n    return inner")
    assert described(functions_of(BASE)["used"], {}) == described(functions_of(moved)["used"], {})


def test_fingerprint_contains_functions_in_place_of_others():
    known = functions_of(BASE + "\ndef other(x):\n    return x\n")
    used, inner, other = known["used"], known["inner"], known["other"]
    assert described(used, {}) != described(used, {inner: other})


def test_values_that_may_change_are_refused():
    numbers = [1]
    with pytest.raises(TypeError, match=r"a loop cannot use \[1\]"):
        described(lambda: numbers, {})


@loop(("float32*", 2), ("float64", 2), "int64", "uint32*")
def _mixed(layers, factors, count, results):
    for i in range(count):
        results[i] = np.uint32(layers[0][i] * factors[0] + math.floor(layers[1][i]) * factors[1])


@needs_numba
@pytest.mark.usefixtures("cache")
def test_compiled_loops_give_the_results_of_python():
    layers = tuple(np.linspace(first, 50, 7, dtype=np.float32) for first in (0, 3))
    results, expected = np.zeros((2, 7), np.uint32)
    _mixed.compiled(always=True)(layers, (2.0, 3.5), 7, results)
    _mixed.function(layers, (2.0, 3.5), 7, expected)
    np.testing.assert_array_equal(results, expected)


@needs_numba
@pytest.mark.parametrize(
    "layers",
    [
        (np.zeros(7, np.float32), np.zeros(7)),
        (np.zeros(7, np.float32), np.zeros(14, np.float32)[::2]),
        (np.zeros(7, np.float32),) * 3,
    ],
)
@pytest.mark.usefixtures("cache")
def test_wrong_arguments_are_refused(layers):
    with pytest.raises(TypeError, match="expected"):
        _mixed.compiled(always=True)(layers, (2.0, 3.5), 7, np.zeros(7, np.uint32))


@needs_numba
@pytest.mark.usefixtures("cache")
def test_loops_must_compile_until_machine_code_is_on_disk(monkeypatch):
    first, second = (Loop(_mixed.function, _mixed.takes) for _ in range(2))
    monkeypatch.setenv("NUMBA_DISABLE_JIT", "1")
    assert not first.must_compile()
    monkeypatch.delenv("NUMBA_DISABLE_JIT")
    assert first.must_compile()
    assert second.must_compile()
    first.compiled()
    assert not first.must_compile()
    assert not second.must_compile()


@needs_numba
@pytest.mark.usefixtures("cache")
def test_read_only_folder_is_read_and_not_written(monkeypatch):
    assert Loop(_mixed.function, _mixed.takes).compiled()
    monkeypatch.setattr(os, "access", lambda *_, **__: False)
    assert Loop(_mixed.function, _mixed.takes).compiled()
    other = Loop(_mixed.function, (*_mixed.takes[:-1], "float64*"))
    assert not other.must_compile()
    assert other.compiled() is None
    assert other.compiled(always=True)


@needs_numba
@pytest.mark.usefixtures("cache")
def test_llvmlite_that_does_not_work_warns(monkeypatch):
    monkeypatch.setattr("llvmlite.binding.create_mcjit_compiler", None)
    with pytest.warns(RuntimeWarning, match="numba cannot be used, NumPy does its work"):
        assert Loop(_mixed.function, _mixed.takes).compiled() is None


@needs_numba
@pytest.mark.usefixtures("cache")
def test_loops_that_numba_refuses_warn_once():
    @loop("float64*", "int64")
    def allocates(values, count):
        values[0] = np.sort(np.ones(count))[0]

    with pytest.warns(RuntimeWarning, match=r"numba cannot compile .*allocates, NumPy does"):
        assert allocates.compiled() is None
    assert allocates.compiled() is None


@needs_numba
@pytest.mark.usefixtures("cache")
def test_threads_compile_a_loop_once():
    @loop("float64*", "int64")
    def count_up(values, count):
        for i in range(count):
            values[i] = i

    found = []
    threads = [threading.Thread(target=lambda: found.append(count_up.compiled())) for _ in range(4)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert len(set(found)) == 1


@needs_numba
@pytest.mark.usefixtures("cache")
def test_process_forked_during_compilation_can_compile(monkeypatch):
    begun, compiled = threading.Event(), _machine_code.compiled

    def compiled_later(*arguments):
        begun.set()
        return compiled(*arguments)

    monkeypatch.setattr(_machine_code, "compiled", compiled_later)
    thread = threading.Thread(target=Loop(_mixed.function, _mixed.takes).compiled)
    thread.start()
    begun.wait()
    child = os.fork()
    if child == 0:
        signal.alarm(200)
        other = Loop(_mixed.function, (*_mixed.takes[:-1], "float64*"))
        os._exit(other.compiled() is None)
    thread.join()
    assert os.waitpid(child, 0)[1] == 0
