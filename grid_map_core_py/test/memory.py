# SPDX-License-Identifier: BSD-3-Clause
"""Memory that calls take."""

import tracemalloc
from collections.abc import Callable
from typing import Any


def peak_of(function: Callable[..., Any], *arguments: Any, **options: Any) -> tuple[int, Any]:
    """Return the largest number of bytes allocated during a call, and the result of the call."""
    tracemalloc.start()
    try:
        result = function(*arguments, **options)
        return tracemalloc.get_traced_memory()[1], result
    finally:
        tracemalloc.stop()
