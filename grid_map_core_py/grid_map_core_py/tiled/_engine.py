# Copyright (c) 2026 grid_map_py contributors
# SPDX-License-Identifier: BSD-3-Clause
"""One function for many tiles, by the scheduler of Dask that the program has chosen.

Without any choice these are threads of this process. A `dask.distributed.Client` in the program
takes its cluster; `dask.config.set(scheduler=...)` chooses another local scheduler.
"""

import itertools
import os
from collections.abc import Callable, Iterable, Iterator
from typing import Any, TypeVar

from ..errors import required

T = TypeVar("T")
P = TypeVar("P")

_PER_THREAD = 16
"""Tasks that a local scheduler gets at once for each thread: the last ones wait for each other."""

_PER_WORKER = 4
"""Tasks of a cluster that wait for each of its threads."""


def in_any_order(function: Callable[[P], T], parts: Iterable[P]) -> Iterator[tuple[P, T]]:
    """Yield each part and `function(part)` as they are ready.

    Only a bounded number of parts is taken in advance, so that neither this process nor the
    scheduler holds all of them.

    Args:
        function: it and the parts are pickled if other processes compute.
        parts: what it is called with, one after the other.

    Raises:
        Exception: a call has failed. Further parts are not begun.
    """
    required("dask", "tiled maps", _REMEDY)
    client = _client()
    yield from _on_cluster(client, function, parts) if client else _here(function, parts)


_REMEDY = "pip install 'grid_map_core_py[tiled]'"


def _client() -> Any:
    """Return the client of a cluster that is the default of the program, or None."""
    from dask.base import get_scheduler

    owner = getattr(get_scheduler(), "__self__", None)
    return owner if hasattr(owner, "submit") and hasattr(owner, "scatter") else None


def _here(function: Callable[[P], T], parts: Iterable[P]) -> Iterator[tuple[P, T]]:
    from dask import config
    from dask.base import get_scheduler
    from dask.threaded import get as in_threads

    get = get_scheduler() or in_threads
    threads = config.get("num_workers", None) or os.cpu_count() or 1
    rest = iter(parts)
    while batch := [*itertools.islice(rest, _PER_THREAD * threads)]:
        keys = [f"tile-{number}" for number in range(len(batch))]
        calls = {key: (function, part) for key, part in zip(keys, batch, strict=True)}
        yield from zip(batch, get(calls, keys), strict=True)


def _on_cluster(
    client: Any, function: Callable[[P], T], parts: Iterable[P]
) -> Iterator[tuple[P, T]]:
    from distributed import as_completed

    rest = iter(parts)
    threads = sum(client.nthreads().values()) or 1
    first = [*itertools.islice(rest, _PER_WORKER * threads)]
    part_of = {client.submit(function, part, pure=False): part for part in first}
    running = as_completed(list(part_of), with_results=True)
    try:
        for future, result in running:
            part = part_of.pop(future)
            for following in itertools.islice(rest, 1):
                added = client.submit(function, following, pure=False)
                part_of[added] = following
                running.add(added)
            yield part, result
            future.release()
    finally:
        client.cancel(list(part_of), force=True)
