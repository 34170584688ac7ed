# SPDX-License-Identifier: BSD-3-Clause
"""All ways to visit the cells of a map give the same result."""

import sys

import numpy as np
import pytest

from grid_map_demos_py.iterator_benchmark import WAYS, main, make_map, table
from grid_map_ros_py.testing import Process

BENCHMARK = "grid_map_demos_py.iterator_benchmark"
LARGER, MEANS = WAYS.values()


@pytest.mark.parametrize("way", LARGER.values(), ids=LARGER)
def test_every_way_finds_the_larger_value_of_every_cell(way):
    grid_map = make_map(7)
    random = grid_map["random"].copy()
    way(grid_map)
    expected = [[value if value > 0 else 0 for value in row] for row in random.tolist()]
    np.testing.assert_array_equal(grid_map["larger"], np.array(expected, np.float32))
    assert 0 < (grid_map["larger"] > 0).sum() < 49
    np.testing.assert_array_equal(grid_map["random"], random)


@pytest.mark.parametrize("way", MEANS.values(), ids=MEANS)
def test_every_way_finds_the_means_of_inner_windows(way):
    grid_map = make_map(7)
    way(grid_map)
    random = grid_map["random"].tolist()
    for row, column in np.ndindex(7, 7):
        found = grid_map["mean"][row, column]
        if 0 < row < 6 and 0 < column < 6:
            window = [
                random[r][c] for r in range(row - 1, row + 2) for c in range(column - 1, column + 2)
            ]
            assert found == pytest.approx(sum(window) / 9, abs=1e-6)
        else:
            assert np.isnan(found)


def test_table_has_ways_as_rows_and_sizes_as_columns():
    head, *rows = table([4, 12])
    assert "4 x 4 [ms]" in head
    assert "12 x 12 [ms]" in head
    assert [row for row in rows if not row.startswith(" ")] == [*WAYS]
    ways = {row[2:22].strip(): row[22:].split() for row in rows if row.startswith(" ")}
    assert [*ways] == [*LARGER, *MEANS]
    for *milliseconds, nanoseconds in ways.values():
        assert len(milliseconds) == 2
        assert float(nanoseconds) == pytest.approx(1e6 * float(milliseconds[-1]) / 144, abs=5)


def test_the_benchmark_needs_no_ros_and_ends_by_itself():
    without_ros = (
        "import sys; sys.modules['rclpy'] = None; "
        f"from {BENCHMARK} import main; "
        "sys.exit(main(['50', '100', '--ros-args', '-r', '__node:=benchmark']))"
    )
    benchmark = Process([sys.executable, "-c", without_ros])
    assert benchmark.wait() == 0, benchmark.text
    assert "50 x 50 [ms]" in benchmark.text
    assert len(benchmark.lines) == 1 + len(WAYS) + len(LARGER) + len(MEANS)


@pytest.mark.parametrize("word", ["2", "2001", "-5", "many"])
def test_invalid_size_is_refused(word, capsys):
    with pytest.raises(SystemExit, match="2"):
        main([word])
    assert "usage: iterator_benchmark" in capsys.readouterr().err
