# Copyright (c) 2026 grid_map_py contributors
# SPDX-License-Identifier: BSD-3-Clause
"""Euclidean clusters."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as arrays

from grid_map_core_py.conversions._clusters import euclidean_clusters


def clusters_by_hand(points, groups, tolerance) -> list[frozenset[int]]:
    """Oracle: flood from point to point, looking at all others each time."""
    left, clusters = set(range(len(points))), []
    while left:
        cluster, front = set(), {left.pop()}
        while front:
            point = front.pop()
            cluster.add(point)
            near = {
                other
                for other in left
                if groups[other] == groups[point]
                and np.linalg.norm(points[other] - points[point]) <= tolerance + 1e-9
            }
            left -= near
            front |= near
        clusters.append(frozenset(cluster))
    return sorted(clusters, key=min)


def as_sets(labels) -> list[frozenset[int]]:
    members = {}
    for point, label in enumerate(labels.tolist()):
        members.setdefault(label, set()).add(point)
    return sorted(map(frozenset, members.values()), key=min)


@given(
    arrays.arrays(
        np.float64, st.tuples(st.integers(0, 60), st.just(3)), elements=st.integers(0, 6)
    ),
    st.sampled_from([1.0, 1.5, 2.0, 3.0]),
    st.data(),
)
def test_clusters_equal_flooding_by_hand(points, tolerance, data):
    """Points on a lattice: many distances equal the tolerance, and points coincide."""
    groups = data.draw(arrays.arrays(np.int64, len(points), elements=st.integers(0, 2)))
    labels = euclidean_clusters(points, groups, tolerance)
    assert as_sets(labels) == clusters_by_hand(points, groups, tolerance)


@pytest.mark.parametrize("seed", range(6))
@pytest.mark.parametrize("gap", [0.06, 0.11])
def test_touching_crowds_are_one_cluster(seed, gap):
    """The crowds are so dense that all nearest neighbors of a point are in its own crowd."""
    rng = np.random.default_rng(seed)
    crowds = [rng.normal(0, 0.001, (80, 3)) + (gap * n, 0, 0) for n in range(4)]
    points = rng.permutation(np.vstack(crowds))
    groups = np.zeros(len(points), np.int64)
    labels = euclidean_clusters(points, groups, 0.08)
    assert as_sets(labels) == clusters_by_hand(points, groups, 0.08)
    assert len(set(labels.tolist())) == (1 if gap < 0.08 else 4)


def test_dense_points_of_different_groups_stay_apart():
    points = np.repeat(np.random.default_rng(1).normal(0, 1e-3, (50, 3)), 3, axis=0)
    groups = np.tile([7, 2, 9], 50)
    labels = euclidean_clusters(points, groups, 0.1)
    assert as_sets(labels) == as_sets(groups)


def test_a_long_chain_is_one_cluster():
    points = np.zeros((5000, 3))
    points[:, 0] = 0.1 * np.arange(5000)
    groups = np.zeros(5000, np.int64)
    assert not euclidean_clusters(points, groups, 0.1).any()
    assert len(set(euclidean_clusters(points, groups, 0.0999).tolist())) == 5000


def test_more_threads_find_the_same():
    points = np.random.default_rng(1).uniform(0, 1, (500, 3))
    groups = np.zeros(500, np.int64)
    one = euclidean_clusters(points, groups, 0.1)
    assert as_sets(euclidean_clusters(points, groups, 0.1, workers=2)) == as_sets(one)
