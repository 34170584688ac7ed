# SPDX-License-Identifier: BSD-3-Clause
"""Tests of `PlanarRegions`: queries, convex polygons inside a region, and lasting ids."""

import numpy as np
import pytest
from plane_scenes import RESOLUTION, Rubble, polygon, sampled, stairs

from grid_map_core_py import GeometryError, GridMap, GridMapError
from grid_map_core_py.planes import convex_inside, extract_planes


@pytest.fixture(scope="module")
def rubble():
    grid_map, _ = sampled(Rubble(1, 3.2, 8), (90, 71), 1, outliers=0.03)
    return extract_planes(grid_map)


@pytest.fixture(scope="module")
def positions(rubble):
    """Random positions on and around the map, vertices, and middles of edges."""
    random = np.random.default_rng(0)
    region = max(rubble, key=lambda region: region.area)
    middles = 0.5 * (region.outer + np.roll(region.outer, -1, axis=0))
    return np.concatenate(
        [random.uniform(-2.2, 2.2, (300, 2)), region.outer, middles, *region.holes]
    )


def test_regions_are_read_only_sequence_in_order_of_ids(rubble):
    assert [region.id for region in rubble] == list(range(1, len(rubble) + 1))
    assert [region.id for region in rubble[1:3]] == [2, 3]
    assert repr(rubble).startswith(f"PlanarRegions({len(rubble)} regions in 'map'")
    for array in (rubble.labels, rubble[0].outer, rubble[-1].normal):
        with pytest.raises(ValueError, match="read-only"):
            array[...] = 0


# Queries


@pytest.mark.needs("shapely")
@pytest.mark.parametrize("limit", [None, 0.1, np.inf])
def test_at_and_nearest_equal_shapely(rubble, positions, limit):
    from shapely import Point

    found = 0
    for position in positions:
        gaps = {region.id: polygon(region).distance(Point(position)) for region in rubble}
        region = rubble.at(position) if limit is None else rubble.nearest(position, limit)
        if region:
            assert gaps[region.id] <= min(*gaps.values(), limit or 0) + 1e-9
        else:
            assert min(gaps.values()) > (limit or 0)
        found += region is not None
    assert 100 < found <= len(positions)


@pytest.mark.parametrize("distance", [0.1, 0.2, 0.3, 0.6])
def test_nearest_region_may_be_at_largest_distance(distance):
    regions = extract_planes(GridMap((2.0, 2.0), 0.1, layers={"elevation": 0.0}))
    assert regions.nearest((0.95 + distance, 0.0), distance) is not None
    assert regions.nearest((0.95 + distance, 0.0), distance - 1e-6) is None


@pytest.mark.needs("shapely")
def test_project_equals_shapely(rubble, positions):
    from shapely import Point, shortest_line

    random = np.random.default_rng(1)
    points = random.uniform(-0.3, 0.6, (len(positions), 3))
    # Small offsets: on the grid, several vertices of a region may be equally near.
    points[:, :2] = positions + 1e-5 * random.standard_normal(positions.shape)
    projected = rubble.project(points)
    for point, found in zip(points, projected, strict=True):
        candidates = []
        for region in rubble:
            x, y = shortest_line(polygon(region), Point(point[:2])).coords[0]
            z = (region.offset - region.normal[:2] @ (x, y)) / region.normal[2]
            candidates.append((x, y, z))
        gaps = np.linalg.norm(np.array(candidates) - point, axis=1)
        np.testing.assert_allclose(found, candidates[gaps.argmin()], atol=1e-9)
        assert rubble.at(found[:2]) is not None


def test_unknown_points_are_projected_to_nan(rubble):
    projected = rubble.project(np.array([[0, 0, 0], [np.nan, 0, 0], [0, np.inf, 0]]))
    assert np.isfinite(projected).all(axis=1).tolist() == [True, False, False]
    assert rubble.project(np.empty((0, 3))).shape == (0, 3)


def test_wrong_arguments_are_refused(rubble):
    with pytest.raises(GeometryError, match="position: expected two finite numbers"):
        rubble.at((0, np.nan))
    for distance in (-1, np.nan):
        with pytest.raises(GeometryError, match="max_distance: expected a distance"):
            rubble.nearest((0, 0), distance)
    with pytest.raises(GeometryError, match=r"points: expected shape \(N, 3\)"):
        rubble.project((0, 0, 0))
    for position in ((9, 9), rubble[0].outer[0]):
        with pytest.raises(GeometryError, match="position: expected a position inside"):
            convex_inside(rubble[0], position)
    with pytest.raises(GeometryError, match="vertices: expected an integer of at least 3, got 2"):
        convex_inside(rubble[0], rubble[0].center[:2], 2)


# Convex polygons


def assert_convex_inside(region, position, corners, most=16):
    from shapely import Point, Polygon

    inside = Polygon(corners)
    assert 3 <= len(corners) <= most
    assert inside.is_valid
    assert inside.exterior.is_ccw
    assert inside.convex_hull.area - inside.area < 1e-12
    assert polygon(region).covers(inside)
    assert inside.contains(Point(position))
    return inside.area


def positions_inside(region, count, seed):
    from shapely import Point

    random, shape, found = np.random.default_rng(seed), polygon(region).buffer(-0.002), []
    while len(found) < count:
        position = random.uniform(region.outer.min(axis=0), region.outer.max(axis=0))
        if shape.contains(Point(position)):
            found.append(position)
    return found


def best_hull(region, position, seed):
    """Return the area of a large convex polygon, found by many random searches.

    Each adds vertices of the outline and other positions one by one, in random order, as long as
    the convex hull stays inside the region.
    """
    from shapely import MultiPoint, Point, prepare

    random, shape = np.random.default_rng(seed), polygon(region).buffer(1e-9)
    prepare(shape)
    points = np.concatenate([region.outer, *region.holes, positions_inside(region, 30, seed)])
    best = 0.0
    for _ in range(12):
        angle, stretch = random.uniform(0, np.pi), np.exp(random.uniform(-2, 2))
        turn = np.array([[np.cos(angle), np.sin(angle)], [-np.sin(angle), np.cos(angle)]])
        distances = np.hypot(*((points - position) @ turn.T * (1, stretch)).T)
        hull = Point(position)
        for number in np.argsort(random.choice([-1, 1]) * distances):
            larger = hull.union(MultiPoint([points[number]])).convex_hull
            hull = larger if shape.covers(larger) else hull
        best = max(best, hull.area)
    return best


@pytest.mark.needs("shapely")
@pytest.mark.parametrize("seed", range(5))
def test_convex_polygon_has_most_of_best_area(seed):
    grid_map, _ = sampled(Rubble(seed, 1.6, 5), (36, 33), seed)
    for region in extract_planes(grid_map):
        (start, end), inward = region.outer[:2], np.array([[0, 1], [-1, 0]])
        along = (end - start) / np.linalg.norm(end - start)
        near = 0.5 * (start + end) + 1e-3 * along @ inward
        for position in (*positions_inside(region, 2, seed), near):
            corners = convex_inside(region, position)
            area = assert_convex_inside(region, position, corners)
            assert area >= 0.7 * best_hull(region, position, seed)
            for most in (3, 5):
                corners = convex_inside(region, position, most)
                assert 0 < assert_convex_inside(region, position, corners, most) <= area


@pytest.mark.needs("shapely")
def test_convex_polygon_avoids_edges_in_line_with_position():
    from shapely import Point

    grid_map = GridMap((2.0, 2.0), 0.1)
    near_x, near_y = (np.abs(axis) < 0.5 for axis in grid_map.axes())
    grid_map["elevation"] = np.where(near_x[:, None] & near_y, 0.3, 0.0)
    floor = next(region for region in extract_planes(grid_map) if region.holes)
    inside = [one for one in grid_map.get_positions() if polygon(floor).contains(Point(one))]
    assert len(inside) > 100
    for position in inside:
        assert_convex_inside(floor, position, convex_inside(floor, position))


# Ids


def moved_terrain(surface, center, seed):
    """Return a map of a surface around a center, in whole cells."""
    position = np.asarray(center) * RESOLUTION
    shifted = lambda x, y: surface(x + position[0], y + position[1])  # noqa: E731
    grid_map, _ = sampled(shifted, (60, 50), seed, share=1)
    return GridMap.from_array(grid_map["elevation"], RESOLUTION, position)


@pytest.mark.parametrize("seed", range(3))
def test_ids_stay_while_map_moves(seed):
    random, center = np.random.default_rng(seed), np.zeros(2, int)
    surface, previous, before, used = stairs(0.17, 0.1), None, {}, set()
    for frame in range(50):
        grid_map = moved_terrain(surface, center, frame)
        previous = extract_planes(grid_map, previous=previous)
        here = {int((region.center[0] - 0.1) // 0.3): region.id for region in previous}
        assert len(set(here.values())) == len(previous) >= 7
        for tread, number in here.items():
            # A tread that has left the map returns with a new id.
            assert number == before[tread] if tread in before else number not in used
        before = here
        used.update(here.values())
        center += random.integers(1, 31, 2) * random.choice([-1, 1], 2)


def floors(wall):
    """Return a map of a floor, divided by a wall of some rows if `wall` is a slice."""
    heights = np.zeros((50, 20))
    heights[wall] = 0.5
    return GridMap.from_array(heights, RESOLUTION)


def test_larger_part_keeps_id_when_regions_part_and_join():
    whole = extract_planes(floors(slice(0)))
    parted = extract_planes(floors(slice(30, 31)), previous=whole)
    large, small = sorted(parted, key=lambda region: -region.area)
    assert (large.id, small.id) == (1, 2)
    joined = extract_planes(floors(slice(0)), previous=parted)
    assert [region.id for region in joined] == [1]
    again = extract_planes(floors(slice(10, 11)), previous=joined)
    assert sorted(region.id for region in again) == [1, 3]
    assert max(again, key=lambda region: region.area).id == 1


def test_frames_without_regions_do_not_free_ids():
    regions = extract_planes(floors(slice(30, 31)))
    assert [region.id for region in regions] == [1, 2]
    unknown = GridMap.from_array(np.full((50, 20), np.nan), RESOLUTION)
    nothing = extract_planes(unknown, previous=extract_planes(unknown, previous=regions))
    assert len(nothing) == 0
    assert [region.id for region in extract_planes(floors(slice(0)), previous=nothing)] == [3]


def test_maps_without_overlap_share_no_ids():
    first = extract_planes(floors(slice(0)))
    for position in ((2.0, 0.0), (0.0, -40.0), (1e12, 0.0)):
        away = floors(slice(0))
        away.position = position
        assert [region.id for region in extract_planes(away, previous=first)] == [2]


@pytest.mark.parametrize(
    ("changed", "message"),
    [
        ({"frame_id": "odom"}, "in 'odom' with .*, got 'map'"),
        ({"resolution": 0.1}, r".* cells of 0\.1 m, got .* 0\.04 m"),
    ],
)
def test_previous_regions_of_other_frame_or_resolution_are_refused(changed, message):
    options = {"resolution": RESOLUTION} | changed
    grid_map = GridMap.from_array(np.zeros((20, 20)), **options)
    with pytest.raises(GridMapError, match=f"previous: expected regions {message}"):
        extract_planes(grid_map, previous=extract_planes(floors(slice(0))))
