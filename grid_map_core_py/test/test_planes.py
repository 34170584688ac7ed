# SPDX-License-Identifier: BSD-3-Clause
"""Tests of `extract_planes`: terrains made of planes, parameters and unusual maps."""

import cv2
import numpy as np
import pytest
from hypothesis import given, strategies as st
from plane_scenes import (
    RESOLUTION,
    Rubble,
    Stones,
    outline_of,
    polygon,
    ramp,
    sampled,
    stairs,
)

from grid_map_core_py import ConfigError, GridMap, LayerNotFoundError
from grid_map_core_py.planes import PlaneParameters, extract_planes
from grid_map_core_py.testing import moved_in_buffer

# The values of upstream's parameters.yaml.
UPSTREAM = """
preprocessing: {resolution: 0.04, kernelSize: 3, numberOfRepeats: 1, increasing: False}
sliding_window_plane_extractor:
  {kernel_size: 3, planarity_opening_filter: 0, plane_inclination_threshold_degrees: 30.0,
  local_plane_inclination_threshold_degrees: 35.0, plane_patch_error_threshold: 0.02,
  min_number_points_per_label: 4, connectivity: 4, include_ransac_refinement: true,
  global_plane_fit_distance_error_threshold: 0.025,
  global_plane_fit_angle_error_threshold_degrees: 25.0}
ransac_plane_refinement:
  {probability: 0.01, min_points: 4, epsilon: 0.025, cluster_epsilon: 0.08, normal_threshold: 25.0}
contour_extraction: {marginSize: 1}
postprocessing: {extracted_planes_height_offset: 0.0, smoothing_dilation_size: 0.2}
"""


def height_at(region, x, y):
    return (region.offset - region.normal[:2] @ (x, y)) / region.normal[2]


def degrees_between(a, b):
    return np.degrees(np.arccos(np.clip(np.dot(a, b), -1, 1)))


def regions_of(surface, size, seed, parameters=None, **options):
    grid_map, _ = sampled(surface, size, seed, **options)
    return extract_planes(grid_map, parameters=parameters or PlaneParameters())


def assert_same(actual, expected):
    np.testing.assert_array_equal(actual.labels, expected.labels)
    np.testing.assert_equal([vars(region) for region in actual], [vars(r) for r in expected])


@pytest.mark.needs("shapely")
@pytest.mark.parametrize("riser", [0.10, 0.17, 0.20])
@pytest.mark.parametrize("share", [1, 6])
def test_each_tread_is_one_region(riser, share):
    from shapely import box

    for seed in range(8):
        phase = np.random.default_rng(seed).uniform(0, 0.3)
        regions = regions_of(stairs(riser, phase), (75, 30), seed, share=share)
        for step in range(-4, 4):
            low, high = phase + 0.3 * step, phase + 0.3 * (step + 1)
            if high > 1.5:
                continue
            (region,) = (part for part in regions if low < part.center[0] < high)
            assert box(low, -0.6, high, 0.6).covers(polygon(region))
            assert polygon(region).covers(box(low + 0.12, -0.48, high - 0.12, 0.48))
            assert abs(height_at(region, (low + high) / 2, 0) - riser * step) < 0.003
            assert degrees_between(region.normal, (0, 0, 1)) < 1.75


@pytest.mark.needs("shapely")
@pytest.mark.parametrize("seed", range(6))
def test_each_stepping_stone_is_one_region(seed):
    stones = Stones(seed)
    regions = regions_of(stones, (120, 72), seed)
    tops = [region for region in regions if region.center[2] > -0.3]
    assert len(tops) == 45
    for region in tops:
        center, height = stones.below(region.center[:2])
        assert abs(region.center[:2] - center).max() < 0.02
        assert abs(polygon(region).centroid.coords[0] - center).max() < 0.02
        assert abs(region.center[2] - height) < 0.005


@pytest.mark.parametrize("direction", np.radians([0, 90, 180, 270, 30, 225]))
@pytest.mark.parametrize("seed", range(3))
def test_gentle_ramp_is_one_region_and_steep_ramp_none(direction, seed):
    (region,) = regions_of(ramp(25, direction), (60, 45), seed)
    angle = np.radians(25)
    across = -np.sin(angle) * np.array([np.cos(direction), np.sin(direction)])
    assert degrees_between(region.normal, [*across, np.cos(angle)]) < 0.5
    assert region.area > 0.99 * (59 * 44) * RESOLUTION**2
    assert sum(part.area for part in regions_of(ramp(40, direction), (60, 45), seed)) < 0.01


@pytest.mark.parametrize("share", [1, 6])
def test_rubble_with_outliers(share):
    wrong = labeled = found = flat = 0
    for seed in range(8):
        rubble = Rubble(seed)
        grid_map, heights = sampled(rubble, (100, 90), seed, share=share, outliers=0.05)
        x, y = grid_map.axes()
        _, numbers = rubble.sampled(x[:, None], y)
        window = np.ones((3, 3))
        is_flat = cv2.erode(numbers, window) == cv2.dilate(numbers, window)
        regions = extract_planes(grid_map)
        layers, on_plane = regions.layers(), regions.labels > 0
        wrong += (abs(layers["plane_elevation"] - heights)[on_plane] > 0.05).sum()
        labeled += on_plane.sum()
        found += (on_plane & is_flat).sum()
        flat += is_flat.sum()
    assert wrong <= 0.002 * labeled
    assert found >= 0.9 * flat


# Outlines


def assert_consistent(regions):
    """Compare outlines, areas and numbers of cells with the labels."""
    from shapely import LinearRing

    ids, counts = np.unique(regions.labels[regions.labels > 0], return_counts=True)
    assert [region.id for region in regions] == ids.tolist()
    assert [region.cells for region in regions] == counts.tolist()
    for region in regions:
        found = polygon(region)
        expected = outline_of(regions.labels, regions.geometry, region.id)
        unit = regions.geometry.resolution**2
        assert found.is_valid
        assert found.symmetric_difference(expected).area < 1e-9 * unit
        assert np.isclose(region.area, expected.area, rtol=1e-9)
        assert LinearRing(region.outer).is_ccw
        assert not any(LinearRing(hole).is_ccw for hole in region.holes)
        assert np.isclose(np.linalg.norm(region.normal), 1)
        assert region.normal[2] > 0
        assert region.cells >= 4
        assert np.linalg.eigvalsh(region.covariance).min() > -1e-9


@st.composite
def terraces(draw):
    """Draw a map whose cells are at few heights or unknown, so that regions touch everywhere."""
    rows, columns = draw(st.integers(1, 24)), draw(st.integers(1, 24))
    random = np.random.default_rng(draw(st.integers(0, 2**32)))
    coarse = random.choice([0.0, 0.01, 0.1, 0.5, np.nan, np.inf, -np.inf], (rows, columns), p=PARTS)
    heights = coarse.repeat(3, axis=0).repeat(2, axis=1)
    heights[random.random(heights.shape) < 0.03] = np.nan
    heights += random.choice([0.0, 0.3]) * np.arange(heights.shape[1]) * RESOLUTION
    grid_map = GridMap.from_array(heights, RESOLUTION, (1.0, -2.0))
    start = random.integers(heights.shape)
    return moved_in_buffer(grid_map, tuple(start.tolist()))


PARTS = [0.4, 0.2, 0.15, 0.1, 0.1, 0.03, 0.02]


@pytest.mark.needs("shapely")
@given(terraces(), st.integers(0, 2))
def test_outlines_fit_labels_of_any_terrain(grid_map, margin):
    parameters = PlaneParameters.from_mapping({"contour_extraction": {"marginSize": margin}})
    regions = extract_planes(grid_map, parameters=parameters)
    assert_consistent(regions)
    known = np.isfinite(grid_map.unwrapped("elevation"))
    assert known[regions.labels > 0].all()


# Planes


def test_covariance_describes_errors_of_planes():
    truth = np.array([0.3, 0.2, -0.1])  # height at (0, 0) and slopes
    errors = {"residuals": [], "variances": []}
    random = np.random.default_rng(3)
    for _ in range(400):
        for name, found in errors.items():
            grid_map = GridMap.from_array(np.zeros((12, 9)), RESOLUTION, (2.0, 1.0))
            x, y = np.meshgrid(*grid_map.axes(), indexing="ij")
            deviation = np.full(x.shape, 0.003)
            if name == "variances":
                deviation *= random.uniform(0.5, 1.5, x.shape)
                grid_map["variance"] = deviation**2
            noise = deviation * random.standard_normal(x.shape)
            grid_map["elevation"] = truth[0] + truth[1] * x + truth[2] * y + noise
            (region,) = extract_planes(grid_map)
            slopes = -region.normal[:2] / region.normal[2]
            height = truth[0] + truth[1:] @ region.center[:2]
            error = np.array([region.center[2] - height, *(slopes - truth[1:])])
            found.append(error @ np.linalg.solve(region.covariance, error) / 3)
            assert np.isclose(region.normal @ region.center, region.offset)
    assert 0.9 < np.mean(errors["residuals"]) < 1.1
    assert 0.9 < np.mean(errors["variances"]) < 1.1


def test_plane_is_least_squares_fit_of_raw_heights():
    grid_map, _ = sampled(ramp(12, 1.0), (20, 15), 4)
    grid_map["elevation"][7, 7] += 0.4  # an outlier: in the region, but not in the fit
    (region,) = extract_planes(grid_map)
    assert region.cells == 300
    fitted = np.ones(grid_map.size, bool)
    fitted[7, 7] = False
    x, y = (axis[fitted] for axis in np.meshgrid(*grid_map.axes(), indexing="ij"))
    z = grid_map["elevation"][fitted].astype(float)
    design = np.column_stack([np.ones(x.size), x - x.mean(), y - y.mean()])
    (height, *slopes), squares, *_ = np.linalg.lstsq(design, z, rcond=None)
    np.testing.assert_allclose(region.center, [x.mean(), y.mean(), height], atol=1e-7)
    np.testing.assert_allclose(-region.normal[:2] / region.normal[2], slopes, atol=1e-7)
    np.testing.assert_allclose(region.rms, np.sqrt(squares[0] / x.size), rtol=1e-5)
    covariance = squares[0] / (x.size - 3) * np.linalg.inv(design.T @ design)
    np.testing.assert_allclose(region.covariance, covariance, rtol=1e-5, atol=1e-12)


def test_variances_that_are_unknown_are_ignored():
    grid_map, _ = sampled(ramp(12, 1.0), (20, 15), 4)
    expected = extract_planes(grid_map)
    for wrong in (np.nan, 0.0, -1.0, np.inf):
        grid_map["variance"] = 1e-4
        grid_map["variance"][3, 4] = wrong
        assert_same(extract_planes(grid_map), expected)


def test_large_heights_keep_precision():
    grid_map, _ = sampled(stairs(0.17, 0.1), (75, 30), 1)
    high = grid_map.copy()
    high["elevation"] += 2048.0
    low, regions = extract_planes(grid_map), extract_planes(high)
    assert (low.labels == regions.labels).mean() > 0.999
    for a, b in zip(low, regions, strict=True):
        assert abs(b.center[2] - a.center[2] - 2048.0) < 1e-3


# Maps


@pytest.mark.parametrize("size", [(1, 1), (1, 9), (2, 1), (7, 8)])
@pytest.mark.parametrize("value", [np.nan, np.inf, -np.inf])
def test_unknown_map_has_no_regions(size, value):
    regions = extract_planes(GridMap.from_array(np.full(size, value), 0.1))
    assert len(regions) == 0
    assert not regions.labels.any()
    assert regions.at((0, 0)) is None
    assert regions.nearest((0, 0), np.inf) is None
    assert np.isnan(regions.project([(0, 0, 0)])).all()
    assert np.isnan(regions.layers()["planarity"]).all()


def test_flat_maps_of_few_cells():
    for size, count in {(1, 1): 0, (1, 5): 0, (2, 2): 1, (3, 2): 1}.items():
        regions = extract_planes(GridMap.from_array(np.zeros(size), 0.1))
        assert [region.cells for region in regions] == [size[0] * size[1]] * count


def test_holes_and_infinities_change_nearby_cells_only():
    grid_map, _ = sampled(ramp(20, 0.5), (40, 33), 2)
    grid_map["elevation"][10, 10] = np.nan
    grid_map["elevation"][20, 20] = np.inf
    grid_map["elevation"][30, 12] = -np.inf
    (region,) = extract_planes(grid_map)
    assert region.cells == 40 * 33 - 3
    assert len(region.holes) == 3


def test_same_input_with_any_start_index_yields_same_bits():
    grid_map, _ = sampled(Rubble(5), (60, 47), 5, outliers=0.05)
    before = grid_map.copy()
    first = extract_planes(grid_map)
    cv2.setNumThreads(1)
    try:
        assert_same(extract_planes(before.copy()), first)
    finally:
        cv2.setNumThreads(-1)
    assert grid_map == before
    for start in ((1, 0), (0, 46), (31, 20)):
        assert_same(extract_planes(moved_in_buffer(grid_map, start)), first)


def test_layers_describe_regions():
    grid_map, heights = sampled(stairs(0.17, 0.1), (40, 30), 1, share=1)
    grid_map["elevation"][5, 5] = np.nan
    regions = extract_planes(grid_map)
    layers = regions.layers()
    np.testing.assert_array_equal(layers["plane_id"], regions.labels)
    outside = regions.labels == 0
    np.testing.assert_array_equal(np.isnan(layers["plane_elevation"]), outside)
    assert abs(layers["plane_elevation"] - heights)[~outside].max() < 0.01
    assert np.isnan(layers["planarity"][5, 5])
    assert (layers["planarity"][~outside] == 1).all()
    assert (layers["planarity"] == 0).any()
    assert all(layer.dtype == np.float32 and layer.flags.f_contiguous for layer in layers.values())


# Parameters


def test_yaml_of_upstream_loads_unmodified(tmp_path):
    path = tmp_path / "parameters.yaml"
    path.write_text(UPSTREAM)
    parameters = PlaneParameters.from_yaml(path)
    assert parameters == PlaneParameters.from_mapping({"contour_extraction": {"marginSize": 1}})
    grid_map, _ = sampled(ramp(5, 0), (12, 10), 1)
    assert extract_planes(grid_map, parameters=parameters)[0].cells == 10 * 8


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("preprocesing: {}", "unknown parameter 'preprocesing'.* did you mean preprocessing"),
        ("preprocessing: {kernelsize: 3}", "preprocessing: unknown .* did you mean kernelSize"),
        ("preprocessing: {kernelSize: 4}", "'kernelSize': expected 3 or 5"),
        ("preprocessing: 3", "'preprocessing': expected a mapping"),
        ("contour_extraction: {marginSize: 0.5}", "'marginSize': expected an integer"),
        ("- 1", "'parameters': expected sections"),
    ],
)
def test_wrong_parameters_are_refused(tmp_path, text, message):
    path = tmp_path / "wrong.yaml"
    path.write_text(text)
    with pytest.raises(ConfigError, match=f"wrong.yaml.*{message}"):
        PlaneParameters.from_yaml(path)


def test_wrong_arguments_are_refused():
    grid_map, _ = sampled(ramp(5, 0), (12, 10), 1)
    with pytest.raises(LayerNotFoundError, match="did you mean elevation"):
        extract_planes(grid_map, "elevatoin")
    with pytest.raises(ConfigError, match=r"'parameters': expected PlaneParameters, got {}"):
        extract_planes(grid_map, parameters={})


WINDOWS = "sliding_window_plane_extractor"
STRICTER = {
    "planarity_opening_filter": 2,
    "kernel_size": 5,
    "min_number_points_per_label": 100,
    "plane_patch_error_threshold": 0.005,
    "global_plane_fit_distance_error_threshold": 0.006,
    "global_plane_fit_angle_error_threshold_degrees": 5.0,
    "local_plane_inclination_threshold_degrees": 5.0,
}


def test_stricter_parameters_find_fewer_cells():
    grid_map, _ = sampled(Rubble(3), (60, 47), 5, outliers=0.05)
    most = (extract_planes(grid_map).labels > 0).sum()
    sections = [{WINDOWS: {name: value}} for name, value in STRICTER.items()]
    for section in ({"preprocessing": {"numberOfRepeats": 0}}, *sections):
        parameters = PlaneParameters.from_mapping(section)
        assert 0 < (extract_planes(grid_map, parameters=parameters).labels > 0).sum() < most, (
            section
        )


def test_steep_regions_are_removed():
    parameters = {WINDOWS: {"plane_inclination_threshold_degrees": 20.0}}
    parameters = PlaneParameters.from_mapping(parameters)
    assert len(regions_of(ramp(19, 0), (20, 20), 1, parameters)) == 1
    assert len(regions_of(ramp(21, 0), (20, 20), 1, parameters)) == 0
