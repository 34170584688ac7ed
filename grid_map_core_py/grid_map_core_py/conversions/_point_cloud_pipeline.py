# SPDX-License-Identifier: BSD-3-Clause
"""Create elevation maps from raw point clouds, with parameter files of `grid_map_pcl` (C++)."""

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, is_dataclass
from typing import Any, Literal, TypeAlias, get_type_hints

import numpy as np
import numpy.typing as npt

from .._arrays._checks import Integers, Positions, as_array, as_number, as_points
from .._arrays._pieces import expanded, slices
from .._parameters import build, check
from ..errors import ConfigError, GeometryError, GridMapError, short
from ..map._axis import BORDER_TOLERANCE
from ..map._grid_map import GridMap
from ._point_layers import fitting_geometry

_POINTS = 1 << 16  # approximate number of points per chunk, which limits the memory use
_NEIGHBORS = 8  # maximum number of nearest neighbors to which clustering first links a point

_Triple = tuple[float, ...]
_Edges: TypeAlias = list[tuple[Integers, Integers]]


@dataclass(frozen=True, kw_only=True)
class _CloudTransform:
    """Rigid transform from the cloud frame to the map frame: a rotation, then a translation.

    Attributes:
        translation: x, y, z [m].
        rotation: roll, pitch, yaw [rad]; intrinsic rotations about x, the new y, and the new z.
    """

    translation: _Triple = (0.0, 0.0, 0.0)
    rotation: _Triple = (0.0, 0.0, 0.0)

    def __post_init__(self) -> None:
        for name in ("translation", "rotation"):
            _check_triple(getattr(self, name), name)


@dataclass(frozen=True, kw_only=True)
class _OutlierRemoval:
    """Parameters of the outlier removal; see `remove_outliers`."""

    is_remove_outliers: bool = False
    mean_K: int = 10  # noqa: N815  as in upstream's files
    stddev_threshold: float = 1.0

    def __post_init__(self) -> None:
        check(self.mean_K >= 1, "mean_K", "an integer >= 1", self.mean_K)
        limit = self.stddev_threshold
        check(np.isfinite(limit), "stddev_threshold", "a finite number", limit)


@dataclass(frozen=True, kw_only=True)
class _Downsampling:
    """Parameters of the voxel filter; `voxel_size` contains the sides along x, y and z [m]."""

    is_downsample_cloud: bool = False
    voxel_size: _Triple = (0.05, 0.05, 0.05)

    def __post_init__(self) -> None:
        _check_triple(self.voxel_size, "voxel_size")
        check(min(self.voxel_size) > 0, "voxel_size", "positive numbers", self.voxel_size)


@dataclass(frozen=True, kw_only=True)
class _ClusterExtraction:
    """Parameters for clustering the points of a cell.

    Attributes:
        cluster_tolerance: largest distance between neighboring points of a cluster [m].
        min_num_points, max_num_points: clusters with fewer or more points are ignored.
        use_max_height_as_cell_elevation: use the highest cluster of a cell instead of the lowest;
            applies to height type 0.
    """

    cluster_tolerance: float = 0.3
    min_num_points: int = 2
    max_num_points: int = 1000000
    use_max_height_as_cell_elevation: bool = False

    def __post_init__(self) -> None:
        _check_length(self.cluster_tolerance, "cluster_tolerance")
        _check_range(self.min_num_points, self.max_num_points, "num_points")


@dataclass(frozen=True, kw_only=True)
class _Grid:
    """Map resolution, and the rule for cell heights.

    Attributes:
        min_num_points_per_cell, max_num_points_per_cell: cells with fewer or more points are NaN.
        resolution: side of a cell [m].
        height_type: 0 selects the cluster with the smallest mean height, and 1 the cluster with the
            most points. If several clusters have the most points, the lowest of them is selected.
        height_thresh: largest height of a cluster above the lowest cluster of the cell [m]; higher
            clusters are ignored. Applies to height type 1.
    """

    min_num_points_per_cell: int = 2
    max_num_points_per_cell: int = 100000
    resolution: float = 0.1
    height_type: Literal[0, 1] = 0
    height_thresh: float = 1.0

    def __post_init__(self) -> None:
        _check_length(self.resolution, "resolution")
        check(self.height_type in (0, 1), "height_type", "0 or 1", self.height_type)
        check(self.height_thresh >= 0, "height_thresh", "a number >= 0", self.height_thresh)
        least, most = self.min_num_points_per_cell, self.max_num_points_per_cell
        _check_range(least, most, "num_points_per_cell")


@dataclass(frozen=True, kw_only=True)
class PointCloudPipeline:
    """Creates a map from a raw point cloud, with the parameters of `grid_map_pcl`.

    If the parameters enable it, outliers are removed and the cloud is downsampled. The cloud is
    then transformed to the map frame. The points of each cell are clustered, and `height_type`
    selects one cluster. Its mean height is the height of the cell. Cells without a cluster are NaN.

    Attributes:
        num_processing_threads: number of threads that search for neighbors.

    Example:
        >>> pipeline = PointCloudPipeline.from_config({"grid_map": {"resolution": 0.5}})
        >>> ground = [(x, y, 0.0) for x in (0.0, 0.1) for y in (0.0, 0.1)]
        >>> branch = [(x, y, 2.0) for x in (0.0, 0.1) for y in (0.0, 0.1)]
        >>> pipeline(ground + branch)["elevation"].tolist()
        [[0.0]]
    """

    num_processing_threads: int = 4
    cloud_transform: _CloudTransform = field(default_factory=_CloudTransform)
    cluster_extraction: _ClusterExtraction = field(default_factory=_ClusterExtraction)
    outlier_removal: _OutlierRemoval = field(default_factory=_OutlierRemoval)
    downsampling: _Downsampling = field(default_factory=_Downsampling)
    grid_map: _Grid = field(default_factory=_Grid)

    def __post_init__(self) -> None:
        threads = self.num_processing_threads
        check(threads >= 1, "num_processing_threads", "an integer >= 1", threads)

    @classmethod
    def from_config(cls, config: Mapping[str, Any]) -> "PointCloudPipeline":
        """Create a pipeline from the content of a parameter file.

        Args:
            config: content of the YAML file, with or without the top-level key
                `pcl_grid_map_extraction`. Missing parameters get the defaults of `grid_map_pcl`.

        Raises:
            ConfigError: a parameter is unknown, has the wrong type or is invalid.
        """
        config = dict(_as_mapping(_as_mapping(config).get("pcl_grid_map_extraction", config)))
        for name, kind in get_type_hints(cls).items():
            if name in config and is_dataclass(kind):
                try:
                    config[name] = _section(kind, config[name])
                except ConfigError as error:
                    raise ConfigError(f"{name}: {error}") from error
        return build(cls, config)

    def __call__(
        self,
        points: npt.ArrayLike,
        *,
        layer: str = "elevation",
        frame_id: str = "",
        timestamp: int = 0,
    ) -> GridMap:
        """Create a map that covers the cloud.

        Args:
            points: (N, 3) or wider, x, y, z [m]; points that are not finite are ignored.
            layer: name of the height layer [m].
            frame_id: frame of the map.
            timestamp: timestamp of the map [ns].

        Raises:
            GridMapError: no finite point is left after the outlier removal.
            LimitError: the map would have too many cells.
        """
        cloud = self.prepared(points)
        if not len(cloud):
            raise GridMapError("points: expected a finite one that is not an outlier, got none")
        lower, upper = cloud[:, :2].min(axis=0), cloud[:, :2].max(axis=0)
        geometry = fitting_geometry(lower, upper, self.grid_map.resolution, hold_edges=True)
        (rows, columns), _ = geometry.cells_at(cloud[:, :2])
        cells = rows + geometry.size[0] * columns
        values = np.full(geometry.size[0] * geometry.size[1], np.nan, np.float32)
        for part in self._chunks(cells):
            occupied, heights = self._heights(cells[part], cloud[part])
            values[occupied] = heights
        grid_map = GridMap.from_geometry(geometry, frame_id=frame_id, timestamp=timestamp)
        return grid_map.with_layers({layer: values.reshape(geometry.size, order="F")})

    def prepared(self, points: npt.ArrayLike) -> Positions:
        """Return the filtered and downsampled cloud (M, 3) [m] in the map frame."""
        cloud = finite_points(points)
        outliers, voxels = self.outlier_removal, self.downsampling
        if outliers.is_remove_outliers:
            cloud = remove_outliers(
                cloud,
                outliers.mean_K,
                outliers.stddev_threshold,
                workers=self.num_processing_threads,
            )
        if voxels.is_downsample_cloud:
            cloud = downsample(cloud, voxels.voxel_size)
        from scipy.spatial.transform import Rotation  # slow to import

        transform = self.cloud_transform
        rotation = Rotation.from_euler("XYZ", transform.rotation).as_matrix()
        moved: Positions = cloud @ rotation.T + transform.translation
        return moved

    def _chunks(self, cells: Integers) -> Iterator[Integers]:
        """Yield point indices (n,) for chunks of whole cells with an allowed number of points."""
        order = np.argsort(cells, kind="stable")
        sizes = np.unique(cells, return_counts=True)[1]
        least, most = self.grid_map.min_num_points_per_cell, self.grid_map.max_num_points_per_cell
        counts = (sizes >= least) & (sizes <= most)
        order, sizes = order[np.repeat(counts, sizes)], sizes[counts]
        ends = np.cumsum(sizes)
        first = 0
        while first < len(order):
            last = int(ends[np.searchsorted(ends, min(first + _POINTS, len(order)))])
            yield order[first:last]
            first = last

    def _heights(
        self, cells: Integers, points: Positions
    ) -> tuple[Integers, npt.NDArray[np.float64]]:
        """Return the cells (m,) that contain clusters, and their heights (m,) [m]."""
        extraction = self.cluster_extraction
        groups = np.unique(cells, return_inverse=True)[1]
        clusters = euclidean_clusters(
            points, groups, extraction.cluster_tolerance, workers=self.num_processing_threads
        )
        sizes = np.bincount(clusters)
        means = points[0, 2] + np.bincount(clusters, points[:, 2] - points[0, 2]) / sizes
        cell_of = np.empty(len(sizes), np.int64)
        cell_of[clusters] = cells
        valid = (sizes >= extraction.min_num_points) & (sizes <= extraction.max_num_points)
        by_size = self.grid_map.height_type == 1
        downwards = extraction.use_max_height_as_cell_elevation and not by_size
        order = np.lexsort((-means if downwards else means, cell_of))
        order = order[valid[order]]
        cells, sizes, means = cell_of[order], sizes[order], means[order]
        occupied, first, numbers = np.unique(cells, return_index=True, return_inverse=True)
        if by_size:
            near = means - means[first[numbers]] <= self.grid_map.height_thresh
            order = np.lexsort((means, -sizes, ~near, cells))
            means = means[order]
        return occupied, means[first]


def downsample(points: npt.ArrayLike, voxel_size: npt.ArrayLike) -> Positions:
    """Replace the points in each voxel with their mean.

    Args:
        points: (N, 3) or wider, x, y, z [m]; points that are not finite are ignored.
        voxel_size: (3,) sides of a voxel [m].

    Returns:
        (M, 3) float64, one point per occupied voxel; voxels are sorted by x, then y, then z.

    Raises:
        GeometryError: a side is not positive and finite, or is too small for the extent of the
            points.
    """
    sides = as_array(voxel_size, np.float64, "voxel_size")
    if sides.shape != (3,) or not (np.isfinite(sides).all() and (sides > 0).all()):
        raise GeometryError(f"voxel_size: expected three positive numbers, got {short(voxel_size)}")
    xyz = finite_points(points)
    if not len(xyz):
        return xyz
    places = np.floor(xyz / sides)
    places -= places.min(axis=0)
    counts = places.max(axis=0) + 1
    if not math.prod(counts.tolist()) < 2.0**62:
        raise GeometryError(
            f"voxel_size: expected fewer than 2**62 voxels, got sides {tuple(sides.tolist())} m"
        )
    voxels = np.ravel_multi_index((*places.T.astype(np.int64),), (*counts.astype(np.int64),))
    _, numbers = np.unique(voxels, return_inverse=True)
    sizes = np.bincount(numbers)
    # Average the offsets from one point, because sums of large coordinates lose precision.
    offsets = (xyz - xyz[0]).T
    means: Positions = np.column_stack([np.bincount(numbers, along) for along in offsets])
    means /= sizes[:, None]
    means += xyz[0]
    return means


def finite_points(points: npt.ArrayLike) -> Positions:
    xyz: Positions = as_points(points)[:, :3].astype(np.float64)
    finite = np.isfinite(xyz).all(axis=1)
    return xyz if finite.all() else xyz[finite]


def remove_outliers(
    points: npt.ArrayLike, mean_k: int, stddev_threshold: float, *, workers: int = 1
) -> Positions:
    """Remove points far from their neighbors, with PCL's statistical outlier removal.

    A point is removed if the mean distance to its nearest `mean_k` neighbors exceeds the average
    over all points by more than `stddev_threshold` sample standard deviations. The remaining points
    (M, 3) keep their order.

    Args:
        points: (N, 3) or wider, x, y, z [m]; points that are not finite are removed.
        mean_k: number of neighbors; limited to the number of other points.
        stddev_threshold: number of standard deviations, which may be negative.
        workers: number of threads that search for neighbors.

    Raises:
        ConfigError: `mean_k` or `stddev_threshold` is invalid.
    """
    deviations = as_number(stddev_threshold, "stddev_threshold")
    check(np.isfinite(deviations), "stddev_threshold", "a finite number", stddev_threshold)
    check(as_number(mean_k, "mean_k") >= 1, "mean_k", "an integer >= 1", mean_k)
    cloud = finite_points(points)
    neighbors = min(int(mean_k), len(cloud) - 1)
    if neighbors < 1:
        return cloud
    from scipy.spatial import cKDTree  # slow to import

    # A search tree is slow with many identical points, which sensors may deliver by the thousand.
    places, numbers, copies = np.unique(cloud, axis=0, return_inverse=True, return_counts=True)
    # SciPy marks a missing neighbor with infinite distance and the index `len(points)`.
    copies = np.append(copies, neighbors)
    tree, means = cKDTree(places), np.empty(len(places))
    nearest_ones = np.arange(1, min(neighbors + 1, len(places)) + 1)
    for part in slices(len(places), _POINTS):
        distances, found = tree.query(places[part], k=nearest_ones, workers=workers)
        others = np.cumsum(copies[found], axis=1) - 1
        counts = np.diff(np.minimum(others, neighbors), axis=1, prepend=0)
        # A missing neighbor has weight 0, but 0 times its infinite distance would be NaN.
        distances[counts == 0] = 0.0
        means[part] = (distances * counts).sum(axis=1) / neighbors
    distances = means[numbers.reshape(-1)]
    limit = distances.mean() + deviations * distances.std(ddof=1)
    kept: Positions = cloud[distances <= limit]
    return kept


def euclidean_clusters(
    points: Positions, groups: Integers, tolerance: float, *, workers: int = 1
) -> Integers:
    """Return a cluster number (n,) for each point (n, 3) [m].

    A cluster is connected by steps of at most `tolerance` [m] (plus 1e-9 m) between points of the
    same group. Points must be finite, and `groups` (n,) nonnegative.
    """
    from scipy.spatial import cKDTree  # slow to import

    if not len(points):
        return np.zeros(0, np.int64)
    # A search tree is slow with many identical points, which sensors may deliver by the thousand.
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
    edges: _Edges = [(linked, neighbors[found])]
    clusters = _components(len(points), edges)
    # Only a point with the maximum number of links can have neighbors that it is not linked to.
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
) -> _Edges:
    """Return additional links between clusters of the same group.

    `crowded` are the points with the maximum number of links. Only these points can lack links.
    """
    from scipy.spatial import cKDTree  # slow to import

    crowded = crowded[np.argsort(clusters[crowded], kind="stable")]
    _, starts, ranks, sizes = np.unique(
        clusters[crowded], return_index=True, return_inverse=True, return_counts=True
    )
    if not len(starts):
        return []
    tree = cKDTree(_apart(points[crowded], ranks, reach))
    edges: _Edges = []
    group_of = groups[crowded[starts]]
    order = np.argsort(group_of, kind="stable")
    _, begins, counts = np.unique(group_of[order], return_index=True, return_counts=True)
    # For each cluster, the number of earlier clusters in the same group.
    before = np.arange(len(order)) - np.repeat(begins, counts)
    for places, steps in expanded(before, _POINTS):
        one, other = order[places], order[places - 1 - steps]
        swap = sizes[one] > sizes[other]
        smaller, larger = np.where(swap, other, one), np.where(swap, one, other)
        for pairs, numbers in expanded(sizes[smaller], _POINTS):
            asking = starts[smaller[pairs]] + numbers
            queries = _apart(points[crowded[asking]], larger[pairs], reach)
            _, nearest = tree.query(queries, distance_upper_bound=reach, workers=workers)
            found = nearest < len(crowded)
            edges.append((crowded[asking[found]], crowded[nearest[found]]))
    return edges


def _apart(points: Positions, groups: Integers, reach: float) -> Positions:
    """Append a coordinate that separates groups of points by at least `2 * reach`."""
    return np.column_stack([points, 2.0 * reach * groups])


def _components(points: int, edges: _Edges) -> Integers:
    from scipy.sparse import coo_array  # slow to import
    from scipy.sparse.csgraph import connected_components

    ends = np.concatenate([a for a, _ in edges]), np.concatenate([b for _, b in edges])
    links = coo_array((np.ones(len(ends[0]), np.bool_), ends), shape=(points, points))
    clusters: Integers = connected_components(links, directed=False)[1].astype(np.int64)
    return clusters


_TRIPLES = {"translation": "xyz", "rotation": "rpy", "voxel_size": "xyz"}
"""Keys of vectors that may be written as mappings, such as `{x: 0.1, y: 0.1, z: 0.1}`."""


def _as_mapping(parameters: object) -> Mapping[str, Any]:
    if not isinstance(parameters, Mapping):
        raise ConfigError(f"expected a mapping of parameters, got {short(parameters)}")
    return parameters


def _section(kind: Any, section: object) -> object:
    parameters = dict(_as_mapping(section))
    for key, letters in _TRIPLES.items():
        value = parameters.get(key)
        if isinstance(value, Mapping):
            check(set(value) == set(letters), key, f"numbers {', '.join(letters)}", dict(value))
            parameters[key] = [value[letter] for letter in letters]
    return build(kind, parameters)


def _check_length(value: float, name: str) -> None:
    check(0 < value < math.inf, name, "a positive number", value)


def _check_triple(values: _Triple, name: str) -> None:
    check(len(values) == 3 and bool(np.isfinite(values).all()), name, "three numbers", values)


def _check_range(least: int, most: int, name: str) -> None:
    check(least >= 0, f"min_{name}", "an integer >= 0", least)
    check(most >= least, f"max_{name}", f"an integer >= min_{name}, which is {least}", most)
