# SPDX-License-Identifier: BSD-3-Clause
"""`PointCloudPipeline` makes the same elevation from raw clouds as `grid_map_pcl`."""

import numpy as np
import pytest
import yaml
from hypothesis import given, strategies as st
from hypothesis.extra import numpy as arrays
from memory import peak_of
from scipy.spatial.transform import Rotation

from grid_map_core_py import ConfigError, GeometryError, GridMapError
from grid_map_core_py.conversions import PointCloudPipeline, downsample, remove_outliers
from grid_map_core_py.conversions._point_cloud_pipeline import euclidean_clusters

UPSTREAM = """
pcl_grid_map_extraction:
  num_processing_threads: 2
  cloud_transform:
    translation: {x: 1.0, y: 2.0, z: 3.0}
    rotation: {r: 0.1, p: 0.2, y: 0.3}
  cluster_extraction:
    cluster_tolerance: 0.05
    min_num_points: 4
    max_num_points: 1000000
    use_max_height_as_cell_elevation: true
  outlier_removal:
    is_remove_outliers: true
    mean_K: 12
    stddev_threshold: 2
  downsampling:
    is_downsample_cloud: true
    voxel_size: {x: 0.02, y: 0.03, z: 0.04}
  grid_map:
    min_num_points_per_cell: 3
    max_num_points_per_cell: 5000
    resolution: 1
    height_type: 1
    height_thresh: 0.5
"""


def pipeline_of(**config) -> PointCloudPipeline:
    return PointCloudPipeline.from_config(config)


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


def heights_by_hand(pipeline: PointCloudPipeline, points, grid_map) -> np.ndarray:
    """Oracle: cell by cell and cluster by cluster."""
    cells = {}
    for point in points[np.isfinite(points).all(axis=1)]:
        cells.setdefault(grid_map.get_index(point[:2]), []).append(point)
    layer = np.full(grid_map.size, np.nan)
    for cell, members in cells.items():
        layer[cell] = height_by_hand(pipeline, np.array(members))
    return layer


def height_by_hand(pipeline, points) -> float:
    settings, extraction = pipeline.grid_map, pipeline.cluster_extraction
    if not settings.min_num_points_per_cell <= len(points) <= settings.max_num_points_per_cell:
        return np.nan
    clusters = [
        points[sorted(cluster)][:, 2]
        for cluster in clusters_by_hand(points, np.zeros(len(points)), extraction.cluster_tolerance)
        if extraction.min_num_points <= len(cluster) <= extraction.max_num_points
    ]
    if not clusters:
        return np.nan
    means = [cluster.mean() for cluster in clusters]
    if settings.height_type == 0:
        return max(means) if extraction.use_max_height_as_cell_elevation else min(means)
    near = [
        (-len(cluster), mean)
        for cluster, mean in zip(clusters, means, strict=True)
        if mean - min(means) <= settings.height_thresh
    ]
    return min(near)[1]


@given(
    arrays.arrays(
        np.float64,
        st.tuples(st.integers(1, 60), st.just(3)),
        elements=st.integers(0, 12).map(lambda number: 0.25 * number),
    ),
    st.fixed_dictionaries(
        {
            "cluster_tolerance": st.sampled_from([0.25, 0.4, 0.6]),
            "min_num_points": st.integers(0, 3),
            "max_num_points": st.integers(3, 8),
            "use_max_height_as_cell_elevation": st.booleans(),
        }
    ),
    st.fixed_dictionaries(
        {
            "resolution": st.sampled_from([0.7, 1.3, 5.0]),
            "min_num_points_per_cell": st.integers(0, 3),
            "max_num_points_per_cell": st.integers(3, 20),
            "height_type": st.sampled_from([0, 1]),
            "height_thresh": st.sampled_from([0.3, 1.0, 9.0]),
        }
    ),
)
def test_heights_equal_search_cell_by_cell(points, extraction, grid):
    pipeline = pipeline_of(num_processing_threads=1, cluster_extraction=extraction, grid_map=grid)
    grid_map = pipeline(points, layer="z", frame_id="map", timestamp=4)
    expected = heights_by_hand(pipeline, points, grid_map)
    np.testing.assert_allclose(grid_map["z"], expected, rtol=1e-6)
    assert (grid_map.frame_id, grid_map.timestamp) == ("map", 4)


# Stages


def outliers_by_hand(points, neighbors, threshold) -> np.ndarray:
    distances = []
    for number, point in enumerate(points):
        others = np.linalg.norm(np.delete(points, number, axis=0) - point, axis=1)
        distances.append(np.mean(np.sort(others)[:neighbors]))
    limit = np.mean(distances) + threshold * np.std(distances, ddof=1)
    return points[np.array(distances) <= limit]


@given(
    st.integers(2, 40),
    st.integers(1, 12),
    st.sampled_from([-0.5, 0.0, 0.7, 1.3, 3.0]),
    st.integers(0, 2**32),
)
def test_outliers_are_far_from_their_neighbors(count, neighbors, threshold, seed):
    points = np.random.default_rng(seed).standard_cauchy((count, 3))
    result = remove_outliers(points, neighbors, threshold)
    np.testing.assert_array_equal(result, outliers_by_hand(points, neighbors, threshold))


@pytest.mark.parametrize(("mean_k", "threshold"), [(0, 1.0), (float("nan"), 1.0), (3, np.inf)])
def test_invalid_outlier_settings_are_refused(mean_k, threshold):
    with pytest.raises(ConfigError, match=r"mean_k|stddev_threshold"):
        remove_outliers([(0, 0, 0), (1, 0, 0)], mean_k, threshold)


def test_a_lone_point_and_equal_points_are_no_outliers():
    assert len(remove_outliers([(1, 2, 3)], 5, 1.0)) == 1
    assert len(remove_outliers(np.empty((0, 3)), 5, 1.0)) == 0
    assert len(remove_outliers(np.ones((30, 3)), 5, 0.0)) == 30
    assert len(remove_outliers([(1, 2, 3), (np.nan, 0, 0)], 5, 1.0)) == 1


def test_rotation_is_about_x_then_new_y_then_new_z():
    angles = (0.3, -0.5, 1.1)
    pipeline = pipeline_of(cloud_transform={"translation": (1, 2, 3), "rotation": angles})
    points = np.random.default_rng(1).normal(size=(5, 3))
    x, y, z = map(Rotation.from_rotvec, np.diag(angles))
    expected = (x * y * z).apply(points) + (1, 2, 3)
    np.testing.assert_allclose(pipeline.prepared(points), expected, atol=1e-12)


def test_cloud_is_cleaned_before_the_transform():
    rng = np.random.default_rng(5)
    points = np.vstack([rng.uniform(0, 1, (300, 3)), [(50, 50, 50), (np.nan, 0, 0)]])
    pipeline = pipeline_of(
        cloud_transform={"rotation": (0, 0, np.pi / 2)},
        outlier_removal={"is_remove_outliers": True, "stddev_threshold": 3.0},
        downsampling={"is_downsample_cloud": True, "voxel_size": (0.5, 0.5, 2.0)},
    )
    prepared = pipeline.prepared(points)
    assert len(prepared) == 4
    quadrants = {tuple(np.floor(xy / 0.5).astype(int)) for xy in prepared[:, :2]}
    assert quadrants == {(-1, 0), (-2, 0), (-1, 1), (-2, 1)}


# Settings


def test_a_parameter_file_of_upstream_loads():
    config = yaml.safe_load(UPSTREAM)
    pipeline = PointCloudPipeline.from_config(config)
    transform, clusters, outliers, voxels, grid = (
        vars(section) for section in list(vars(pipeline).values())[1:]
    )
    assert pipeline.num_processing_threads == 2
    assert transform == {"translation": (1.0, 2.0, 3.0), "rotation": (0.1, 0.2, 0.3)}
    assert [*clusters.values()] == [0.05, 4, 1000000, True]
    assert [*outliers.values()] == [True, 12, 2.0]
    assert voxels == {"is_downsample_cloud": True, "voxel_size": (0.02, 0.03, 0.04)}
    assert [*grid.values()] == [3, 5000, 1.0, 1, 0.5]
    assert PointCloudPipeline.from_config(config["pcl_grid_map_extraction"]) == pipeline
    assert PointCloudPipeline.from_config({}) == PointCloudPipeline()


@pytest.mark.parametrize(
    ("config", "message"),
    [
        ({"grid": {}}, "unknown parameter 'grid'"),
        ({"grid_map": {"size": 1}}, "grid_map: unknown parameter 'size'"),
        ({"grid_map": 3}, "grid_map: expected a mapping"),
        ({"grid_map": {"resolution": 0}}, "grid_map: parameter 'resolution': expected a positive"),
        ({"grid_map": {"resolution": "x"}}, "grid_map: parameter 'resolution': expected a number"),
        ({"grid_map": {"height_type": 2}}, "'height_type': expected one of 0, 1"),
        ({"grid_map": {"height_thresh": -1}}, "'height_thresh': expected a number >= 0"),
        ({"grid_map": {"min_num_points_per_cell": -1}}, "'min_num_points_per_cell'"),
        ({"grid_map": {"max_num_points_per_cell": 1}}, "'max_num_points_per_cell'"),
        ({"cluster_extraction": {"cluster_tolerance": 0}}, "'cluster_tolerance'"),
        ({"cluster_extraction": {"max_num_points": 1}}, "'max_num_points'"),
        ({"outlier_removal": {"mean_K": 0}}, "'mean_K': expected an integer >= 1"),
        ({"outlier_removal": {"stddev_threshold": float("nan")}}, "'stddev_threshold'"),
        ({"downsampling": {"voxel_size": {"x": 1, "y": 1}}}, "'voxel_size': expected numbers x"),
        ({"downsampling": {"voxel_size": [1, 1]}}, "'voxel_size': expected three numbers"),
        ({"downsampling": {"voxel_size": [1, 1, 0]}}, "'voxel_size': expected positive"),
        ({"cloud_transform": {"rotation": {"x": 1, "y": 1, "z": 1}}}, "expected numbers r, p, y"),
        ({"num_processing_threads": 0}, "'num_processing_threads': expected an integer >= 1"),
        (None, "expected a mapping of parameters, got None"),
        ({"pcl_grid_map_extraction": []}, "expected a mapping of parameters"),
    ],
)
def test_invalid_settings_are_refused(config, message):
    with pytest.raises(ConfigError, match=message):
        PointCloudPipeline.from_config(config)


def test_clouds_without_usable_points_are_refused():
    pipeline = PointCloudPipeline()
    with pytest.raises(GeometryError, match="points: expected x, y, z"):
        pipeline([(1, 2)])
    for points in (np.empty((0, 3)), [(np.nan, 0, 0)]):
        with pytest.raises(GridMapError, match="points: expected a finite one"):
            pipeline(points)


def test_memory_does_not_grow_with_density_of_cloud():
    """All pairs of neighbors in this cell would take more than a gigabyte."""
    points = np.random.default_rng(1).uniform(0, 0.09, (20_000, 3))
    pipeline = pipeline_of(num_processing_threads=1)
    peak, grid_map = peak_of(pipeline, points)
    np.testing.assert_allclose(grid_map["elevation"], [[points[:, 2].mean()]], rtol=1e-6)
    assert peak < 30e6


def test_many_points_at_one_place_are_fast():
    """Sensors give (0, 0, 0) where they see nothing; a search tree makes one leaf of these."""
    same = np.zeros((99_000, 3))
    cloud = np.concatenate([same, [(0.01, 0.0, 1.0)]])
    pipeline = pipeline_of(outlier_removal={"is_remove_outliers": True})
    assert pipeline(same)["elevation"].tolist() == [[0.0]]
    np.testing.assert_array_equal(remove_outliers(cloud, 3, 1.0), same)


# Clusters


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


def test_a_long_chain_is_one_cluster():
    points = np.zeros((5000, 3))
    points[:, 0] = 0.1 * np.arange(5000)
    groups = np.zeros(5000, np.int64)
    assert not euclidean_clusters(points, groups, 0.1).any()
    assert len(set(euclidean_clusters(points, groups, 0.0999).tolist())) == 5000


# Voxels


SIDES = st.sampled_from([0.25, 0.5, 1.0, 3.0])
NUMBERS = st.floats(-4, 4, width=32) | st.sampled_from([np.nan, np.inf])


def downsample_by_hand(points, sides) -> np.ndarray:
    """Oracle: sort points into a list per voxel one by one."""
    voxels = {}
    for point in points:
        if np.isfinite(point).all():
            voxels.setdefault(tuple(np.floor(point / sides)), []).append(point)
    return np.array([np.mean(voxels[key], axis=0) for key in sorted(voxels)]).reshape(-1, 3)


@given(
    arrays.arrays(np.float64, st.tuples(st.integers(0, 40), st.just(3)), elements=NUMBERS),
    st.tuples(SIDES, SIDES, SIDES),
)
def test_voxels_hold_the_mean_of_their_points(points, sides):
    result = downsample(points, sides)
    np.testing.assert_allclose(result, downsample_by_hand(points, sides), atol=1e-12)


def test_large_coordinates_keep_precision():
    points = np.array([(5e6, 5e6, 0), (5e6 + 0.001, 5e6, 0), (5e6 + 10, 5e6, 0)])
    result = downsample(points, (1, 1, 1))
    np.testing.assert_allclose(result[:, 0] - 5e6, (0.0005, 10), atol=2e-9)


@pytest.mark.parametrize(
    ("sides", "message"),
    [
        *(
            (sides, "expected three positive numbers")
            for sides in [(1, 1), (1, 1, 0), (1, -1, 1), (1, np.nan, 1), 1.0]
        ),
        ("small", "expected numbers, got 'small'"),
        ((1e-3, 1e-3, 1e-3), r"expected fewer than 2\*\*62 voxels"),
    ],
)
def test_invalid_voxels_are_refused(sides, message):
    with pytest.raises(GeometryError, match=f"voxel_size: {message}"):
        downsample([(0, 0, 0), (1e9, 1e9, 1e9)], sides)
