# SPDX-License-Identifier: BSD-3-Clause
"""Runs a function on many tiles with the program's Dask scheduler.

The default scheduler is a thread pool in this process. If the program creates a
`dask.distributed.Client`, this module uses the client's cluster. `dask.config.set(scheduler=...)`
selects another local scheduler.
"""

import itertools
import pickle
import time
import warnings
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import FIRST_COMPLETED, Future, ThreadPoolExecutor, wait
from contextvars import ContextVar, copy_context
from functools import cache, lru_cache
from operator import length_hint
from typing import Any, TypeVar

from .._arrays._freed_memory import keep_memory
from ..errors import GridMapError, required

T = TypeVar("T")
P = TypeVar("P")


_AHEAD = 2  # maximum number of running and queued calls per thread of this process

_PER_BATCH = 16
"""Number of calls per worker in a batch, for local schedulers other than the thread pool."""

_TASKS = 4  # maximum number of running and queued tasks per thread of a cluster

_PER_TASK = 8
"""Maximum number of calls per task. A cluster scheduler needs about 1 ms for each task."""

_PERIOD = 1.0  # interval at which the threads of a cluster are counted [s]; their number may change


def in_any_order(function: Callable[[P], T], parts: Iterable[P]) -> Iterator[tuple[P, T]]:
    """Yield each part and `function(part)` as soon as the result is available.

    Parts are taken from `parts` on demand, so they are never all stored. Closing the iterator
    cancels queued calls, but not running calls in threads of this process.

    Raises:
        GridMapError: the cluster is lost, or several workers died while computing the same part.
        Exception: any exception that a call raises; no further call is started.
    """
    required("dask", "tiled maps")
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
                    # Context variables contain, for example, the thread count of a filter chain.
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

    # The function is pickled here, because the scheduler may unpickle task arguments.
    call = required("cloudpickle", "tiled maps on a cluster").dumps(function)
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
                # The last tasks contain fewer parts, so that all threads finish at the same time.
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
            # A received result is valid even if the worker has died since.
            if not isinstance(result, list):
                raise _error(client, result)
            future.release()
            yield from zip(running.pop(future), _values(*result), strict=True)
    finally:
        # The scheduler drops released tasks. `cancel` would wait for a scheduler that is lost.
        ready.clear()
        for future in running:
            future.release()


def _values(values: list[T], warned: list[Warning]) -> list[T]:
    """Return the results of a finished task, and issue its warnings in this process."""
    for warning in warned:
        warnings.warn(warning, stacklevel=3)
    return values


def _error(client: Any, result: Any = None) -> BaseException:
    """Return the exception to raise for a failed task or a lost cluster."""
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


_warned: ContextVar[list[Warning] | None] = ContextVar("_warned", default=None)
"""Warnings issued by the task that the current thread of a worker runs."""


@cache
def _collect_warnings() -> None:
    """Redirect warnings to `_warned`, because `catch_warnings` would affect all threads."""
    show: Any = warnings.showwarning

    def collect(warning: Any, *details: Any, **options: Any) -> None:
        warned = _warned.get()
        show(warning, *details, **options) if warned is None else warned.append(warning)

    warnings.showwarning = collect  # type: ignore[assignment]


def _call_each(pickled: bytes, group: list[Any]) -> list[list[Any]]:
    """Call a pickled function with each part; return the results and the warnings."""
    keep_memory()
    _collect_warnings()
    token = _warned.set(warned := list[Warning]())
    try:
        function = _unpickled(pickled)
        return [[function(part) for part in group], warned]
    finally:
        _warned.reset(token)
