# SPDX-License-Identifier: BSD-3-Clause
import numpy as np
import pytest
from builtin_interfaces.msg import Time
from hypothesis import given, strategies as st

from grid_map_ros_py import MessageError
from grid_map_ros_py.messages import from_stamp, to_stamp
from grid_map_ros_py.messages._fields import LATEST


@given(st.integers(0, LATEST))
def test_every_nanosecond_survives_the_message(nanoseconds: int) -> None:
    assert from_stamp(to_stamp(nanoseconds)) == nanoseconds


def test_numpy_integers_are_integers() -> None:
    assert to_stamp(np.int64(1_000_000_002)) == Time(sec=1, nanosec=2)  # type: ignore[arg-type]


@pytest.mark.parametrize("nanoseconds", [-1, LATEST + 1, 1.5, "now", None])
def test_invalid_time_is_refused(nanoseconds: int) -> None:
    with pytest.raises(MessageError, match=r"^stamp: expected .*nanoseconds.*, got ") as error:
        to_stamp(nanoseconds)
    assert error.value.found == nanoseconds
