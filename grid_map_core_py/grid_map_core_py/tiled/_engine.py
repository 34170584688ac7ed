# SPDX-License-Identifier: BSD-3-Clause
"""One function for many tiles, by the scheduler of Dask that the program has chosen.

Without any choice these are threads of this process. A `dask.distributed.Client` in the program
takes its cluster; `dask.config.set(scheduler=...)` chooses another local scheduler.
"""

import itertools
import time
from collections.abc import Callable, Iterable, Iterator, Sequence
from concurrent.futures import FIRST_COMPLETED, Future, ThreadPoolExecutor, wait
from contextvars import copy_context
from functools import lru_cache
from operator import length_hint
from typing import Any, NamedTuple, TypeVar

from .._arrays._freed_memory import keep_memory
from ..errors import GridMapError, required

T = TypeVar("T")
P = TypeVar("P")

_REMEDY = "pip install 'grid_map_core_py[tiled]'"

_WAITING = 2
"""Calls that are begun or wait, for each thread of this process."""

_PER_BATCH = 16
"""Calls that another local scheduler gets at once for each process: the last ones wait."""

_PER_WORKER = 4
"""Tasks that are begun or wait, for each thread of a cluster."""

_TASK = 0.5
"""Time of a task of a cluster [s]; a task has several parts that are computed sooner. The cluster
takes about a millisecond for each task, and a worker unpacks what parts share only once."""

_MOST = 256
"""Largest number of parts of a task."""

_PERIOD = 1.0
"""Time after which the threads of a cluster, which may grow, are counted again [s]."""


def in_any_order(function: Callable[[P], T], parts: Iterable[P]) -> Iterator[tuple[P, T]]:
    """Yield each part and `function(part)` as they are ready.

    Only a bounded number of parts is taken in advance, so that neither this process nor the
    scheduler holds all of them. When the iterator is closed, calls that wait are canceled; threads
    of this process finish those that they have begun.

    Args:
        function: it and the parts are pickled if other processes compute.
        parts: what it is called with, one after the other.

    Raises:
        GridMapError: the cluster is lost, or workers die of a part again and again.
        Exception: a call has failed. Further parts are not begun.
    """
    required("dask", "tiled maps", _REMEDY)
    from dask import threaded

    get, client = _scheduler()
    if client:
        return _on_cluster(client, function, parts)
    if get is None or get is threaded.get:
        return _in_threads(function, parts)
    return _in_batches(get, function, parts)


def _scheduler() -> tuple[Any, Any]:
    """Return the function `get` of the scheduler of the program, and its client, or None."""
    from dask import base

    find: Any = base.get_scheduler
    get = find()
    owner = getattr(get, "__self__", None)
    return get, owner if hasattr(owner, "submit") and hasattr(owner, "scatter") else None


def _threads() -> int:
    from dask import config, system

    return int(config.get("num_workers", None) or system.CPU_COUNT)


def _in_threads(function: Callable[[P], T], parts: Iterable[P]) -> Iterator[tuple[P, T]]:
    threads, rest = _threads(), iter(parts)
    running: dict[Future[T], P] = {}
    with ThreadPoolExecutor(threads, "tiles") as pool:
        try:
            while True:
                for part in itertools.islice(rest, _WAITING * threads - len(running)):
                    # Limits, for example, are those of the caller.
                    running[pool.submit(copy_context().run, function, part)] = part
                if not running:
                    return
                for future in wait(running, return_when=FIRST_COMPLETED).done:
                    yield running.pop(future), future.result()
        finally:
            pool.shutdown(wait=False, cancel_futures=True)


def _in_batches(get: Any, function: Callable[[P], T], parts: Iterable[P]) -> Iterator[tuple[P, T]]:
    rest = iter(parts)
    while batch := [*itertools.islice(rest, _PER_BATCH * _threads())]:
        keys = [f"tile-{number}" for number in range(len(batch))]
        calls = {key: (function, part) for key, part in zip(keys, batch, strict=True)}
        yield from zip(batch, get(calls, keys), strict=True)


def _on_cluster(
    client: Any, function: Callable[[P], T], parts: Iterable[P]
) -> Iterator[tuple[P, T]]:
    from distributed import as_completed

    rest = iter(parts)
    # Workers unpickle it once. Newer schedulers unpickle all arguments of tasks.
    call = required("cloudpickle", "tiled maps on a cluster", _REMEDY).dumps(function)
    running: dict[Any, Sequence[P]] = {}
    completed: Any = as_completed
    ready = completed(with_results=True, raise_errors=False)
    size, most, counted = 1, 0, -_PERIOD
    try:
        while True:
            if time.monotonic() - counted > _PERIOD:
                most, counted = _PER_WORKER * _threads_of(client), time.monotonic()
            while len(running) < most:
                # All threads are to finish at the same time.
                share = length_hint(rest, _MOST * most) // most
                group = [*itertools.islice(rest, max(min(size, share), 1))]
                if not group:
                    break
                future = client.submit(_call_each, call, group, pure=False)
                running[future] = group
                ready.add(future)
            if not running:
                return
            future, result = next(ready)
            seconds, results = _checked(result, client)
            finished = running.pop(future)
            future.release()
            yield from zip(finished, results, strict=True)
            size = min(max(int(_TASK * len(finished) / max(seconds, 1e-9)), 1), _MOST)
    finally:
        # The scheduler forgets them. `cancel` would wait for a scheduler that is lost.
        ready.clear()
        for future in running:
            future.release()


def _threads_of(client: Any) -> int:
    """Return the number of threads of a cluster, at least 1."""
    if client.status != "running":
        raise _lost(client)
    try:
        threads: dict[str, int] = client.nthreads()
    except (OSError, TimeoutError) as error:
        raise _lost(client) from error
    return max(1, sum(threads.values()))


class _Results(NamedTuple):
    """Results of the parts of a task."""

    seconds: float
    """Time that the worker took."""
    values: list[Any]


def _checked(result: Any, client: Any) -> _Results:
    """Return what a task has returned, or raise its error.

    The state of the future says less: a result counts even if its worker died after it was fetched.
    """
    from distributed import KilledWorker

    if isinstance(result, _Results):
        return result
    if not isinstance(result, tuple):
        raise _lost(client)
    error = result[1]
    if isinstance(error, KilledWorker):
        raise GridMapError(
            f"{error.allowed_failures + 1} workers died one after the other while they computed "
            "the same tile. They may need more memory"
        ) from error
    raise error


def _lost(client: Any) -> GridMapError:
    return GridMapError(f"the cluster at {client.scheduler.address} is lost")


@lru_cache(maxsize=4)
def _unpacked(pickled: bytes) -> Any:
    import pickle

    return pickle.loads(pickled)


def _call_each(pickled: bytes, group: Sequence[Any]) -> _Results:
    """Compute some parts on a worker."""
    keep_memory()
    function, begin = _unpacked(pickled), time.perf_counter()
    results = [function(part) for part in group]
    return _Results(time.perf_counter() - begin, results)
