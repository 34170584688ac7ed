# SPDX-License-Identifier: BSD-3-Clause
"""Euclidean clusters: sets of points connected by chains of short steps."""

from collections.abc import Iterator
from typing import TypeAlias

import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components
from scipy.spatial import cKDTree

from .._arrays._checks import Integers, Positions
from .._arrays._pieces import expanded
from ..map._axis import BORDER_TOLERANCE

Edges: TypeAlias = list[tuple[Integers, Integers]]

_NEIGHBORS = 8  # number of nearest neighbors that each point is linked to in the first pass
_QUERIES = 1 << 16  # number of points that query the search tree in one call


def euclidean_clusters(
    points: Positions, groups: Integers, tolerance: float, *, workers: int = 1
) -> Integers:
    """Return the cluster (n,) of each point; clusters are numbered from 0 in no special order.

    Two points are in the same cluster when they are of the same group and steps between points of
    that group, none longer than the tolerance, lead from one to the other.

    Args:
        points: (n, 3) finite x, y, z [m].
        groups: (n,) not negative; clusters do not reach over groups.
        tolerance: longest step [m]; one within 1e-9 m of it counts.
        workers: threads that search for neighbors.
    """
    if not len(points):
        return np.zeros(0, np.int64)
    # A search tree cannot split points at the same place, of which sensors may deliver thousands.
    distinct, numbers = np.unique(np.column_stack([points, groups]), axis=0, return_inverse=True)
    points, groups = distinct[:, :3], distinct[:, 3].astype(np.int64)
    reach = tolerance + BORDER_TOLERANCE
    separated = _apart(points, groups, reach)
    _, neighbors = cKDTree(separated).query(
        separated, k=_NEIGHBORS + 1, distance_upper_bound=reach, workers=workers
    )
    # SciPy marks a missing neighbor with the index `len(points)`.
    found = neighbors < len(points)
    linked, _ = np.nonzero(found)
    edges: Edges = [(linked, neighbors[found])]
    clusters = _components(len(points), edges)
    # Only points that reached the maximum number of links may have further neighbors.
    crowded = np.flatnonzero(found[:, -1])
    edges += _missing_links(points, groups, clusters, crowded, reach, workers)
    if len(edges) > 1:
        clusters = _components(len(points), edges)
    return clusters[numbers.reshape(-1)]


def _missing_links(
    points: Positions,
    groups: Integers,
    clusters: Integers,
    crowded: Integers,
    reach: float,
    workers: int,
) -> Edges:
    """Return links between crowded points of different clusters of the same group.

    There are few such clusters, so that it is cheap to search, from each point of the smaller one,
    the nearest point of the larger.
    """
    crowded = crowded[np.argsort(clusters[crowded], kind="stable")]
    _, starts, ranks, sizes = np.unique(
        clusters[crowded], return_index=True, return_inverse=True, return_counts=True
    )
    if not len(starts):
        return []
    tree = cKDTree(_apart(points[crowded], ranks, reach))
    edges: Edges = []
    for one, other in _pairs(groups[crowded[starts]]):
        swap = sizes[one] > sizes[other]
        smaller, larger = np.where(swap, other, one), np.where(swap, one, other)
        for pairs, numbers in expanded(sizes[smaller], _QUERIES):
            asking = starts[smaller[pairs]] + numbers
            queries = _apart(points[crowded[asking]], larger[pairs], reach)
            _, nearest = tree.query(queries, distance_upper_bound=reach, workers=workers)
            found = nearest < len(crowded)
            edges.append((crowded[asking[found]], crowded[nearest[found]]))
    return edges


def _pairs(groups: Integers) -> Iterator[tuple[Integers, Integers]]:
    """Yield all pairs (n,), (n,) of places in `groups` with the same number, each pair once."""
    order = np.argsort(groups, kind="stable")
    _, starts, counts = np.unique(groups[order], return_index=True, return_counts=True)
    before = np.arange(len(groups)) - np.repeat(starts, counts)
    for places, numbers in expanded(before, _QUERIES):
        yield order[places], order[places - 1 - numbers]


def _apart(points: Positions, groups: Integers, reach: float) -> Positions:
    """Return points (n, 4) whose groups lie out of reach of each other in a fourth dimension."""
    return np.column_stack([points, 2.0 * reach * groups])


def _components(points: int, edges: Edges) -> Integers:
    ends = np.concatenate([a for a, _ in edges]), np.concatenate([b for _, b in edges])
    links = coo_array((np.ones(len(ends[0]), np.bool_), ends), shape=(points, points))
    clusters: Integers = connected_components(links, directed=False)[1].astype(np.int64)
    return clusters
