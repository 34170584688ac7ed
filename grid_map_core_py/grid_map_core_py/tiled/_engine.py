# SPDX-License-Identifier: BSD-3-Clause
"""Runs one function on many tiles with the Dask scheduler that the program has chosen.

The default is a pool of threads in this process. A `dask.distributed.Client` in the program selects
its cluster; `dask.config.set(scheduler=...)` selects another local scheduler.
"""

import itertools
import pickle
import time
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import FIRST_COMPLETED, Future, ThreadPoolExecutor, wait
from contextvars import copy_context
from functools import lru_cache
from operator import length_hint
from typing import Any, TypeVar

from .._arrays._freed_memory import keep_memory
from ..errors import GridMapError, required

T = TypeVar("T")
P = TypeVar("P")

REMEDY = "pip install 'grid_map_core_py[tiled]'"

_AHEAD = 2
"""Calls in progress or waiting, for each thread of this process."""

_PER_BATCH = 16
"""Calls that another local scheduler gets at once, for each of its processes."""

_TASKS = 4
"""Tasks in progress or waiting, for each thread of a cluster."""

_PER_TASK = 8
"""Largest number of calls in a task: the scheduler of a cluster needs about 1 ms for each task."""

_PERIOD = 1.0
"""Time between counts of the threads of a cluster, which may grow or shrink [s]."""


def in_any_order(function: Callable[[P], T], parts: Iterable[P]) -> Iterator[tuple[P, T]]:
    """Yield each part with `function(part)` as soon as it is ready.

    Parts are taken as they are needed, so that neither this process nor the scheduler holds all of
    them. Closing the iterator cancels the calls that wait; threads of this process finish the calls
    in progress.

    Args:
        function: pickled together with the parts if other processes compute.
        parts: arguments of the calls.

    Raises:
        GridMapError: the cluster is lost, or several workers died while they computed one part.
        Exception: a call failed; no further call begins.
    """
    required("dask", "tiled maps", REMEDY)
    from dask import base, config, system, threaded

    find: Any = base.get_scheduler
    get = find()
    client = getattr(get, "__self__", None)
    threads = int(config.get("num_workers", None) or system.CPU_COUNT)
    rest = iter(parts)
    if hasattr(client, "submit") and hasattr(client, "scatter"):
        yield from _on_cluster(client, function, rest)
        return
    if get is not None and get is not threaded.get:
        while batch := [*itertools.islice(rest, _PER_BATCH * threads)]:
            calls = {f"tile-{number}": (function, part) for number, part in enumerate(batch)}
            yield from zip(batch, get(calls, [*calls]), strict=True)
        return
    running: dict[Future[T], P] = {}
    with ThreadPoolExecutor(threads, "tiles") as pool:
        try:
            while True:
                for part in itertools.islice(rest, _AHEAD * threads - len(running)):
                    # The context holds the limits of the caller, for example.
                    running[pool.submit(copy_context().run, function, part)] = part
                if not running:
                    return
                for future in wait(running, return_when=FIRST_COMPLETED).done:
                    yield running.pop(future), future.result()
        finally:
            pool.shutdown(wait=False, cancel_futures=True)


def _on_cluster(
    client: Any, function: Callable[[P], T], rest: Iterator[P]
) -> Iterator[tuple[P, T]]:
    from distributed import as_completed

    # Pickled once, because schedulers may unpickle the arguments of tasks.
    call = required("cloudpickle", "tiled maps on a cluster", REMEDY).dumps(function)
    running: dict[Any, list[P]] = {}
    completed: Any = as_completed
    ready = completed(with_results=True, raise_errors=False)
    most, counted = 0, -_PERIOD
    try:
        while True:
            if time.monotonic() - counted > _PERIOD:
                if client.status != "running":
                    raise _error(client)
                try:
                    counts: dict[str, int] = client.nthreads()
                except (OSError, TimeoutError) as error:
                    raise _error(client) from error
                most, counted = _TASKS * max(1, sum(counts.values())), time.monotonic()
            while len(running) < most:
                # The last tasks are small, so that all threads finish at about the same time.
                share = length_hint(rest, _PER_TASK * most) // most
                group = [*itertools.islice(rest, max(min(_PER_TASK, share), 1))]
                if not group:
                    break
                future = client.submit(_call_each, call, group, pure=False)
                running[future] = group
                ready.add(future)
            if not running:
                return
            future, result = next(ready)
            # A result counts even if its worker died after it was fetched.
            if not isinstance(result, list):
                raise _error(client, result)
            future.release()
            yield from zip(running.pop(future), result, strict=True)
    finally:
        # The scheduler forgets released tasks; `cancel` would wait for a scheduler that is lost.
        ready.clear()
        for future in running:
            future.release()


def _error(client: Any, result: Any = None) -> BaseException:
    """Return the error of a task without results, or of a lost cluster."""
    from distributed import KilledWorker

    if not isinstance(result, tuple):
        return GridMapError(f"the cluster at {client.scheduler.address} is lost")
    error: BaseException = result[1]
    if isinstance(error, KilledWorker):
        return GridMapError(
            f"{error.allowed_failures + 1} workers died one after the other while they computed "
            "the same tile. They may need more memory"
        )
    return error


_unpickled = lru_cache(maxsize=4)(pickle.loads)


def _call_each(pickled: bytes, group: list[Any]) -> list[Any]:
    keep_memory()
    function = _unpickled(pickled)
    return [function(part) for part in group]
