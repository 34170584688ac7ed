# SPDX-License-Identifier: BSD-3-Clause
"""Fusion of scans and images from several sensors into one elevation map."""

import re
import time
import warnings
from collections.abc import Mapping
from copy import copy
from dataclasses import dataclass, field, replace

import numpy as np

from grid_map_core_py import GridGeometry, GridMap
from grid_map_core_py.conversions import color_vector_to_value
from grid_map_core_py.conversions._image_arrays import COLOR_LAYER
from grid_map_core_py.elevation import ElevationMapper, UpdateReport
from grid_map_core_py.elevation._parameters import Parameters
from grid_map_core_py.errors import ConfigError, GridMapError
from grid_map_core_py.plugins import check

from ..errors import MessageError
from ..messages._fields import Matrix
from ..nodes._poses import Placement
from ..nodes._scans import Cloud
from .cameras import Picture, seen_cells
from .sources import InputSource

IMAGE_FUSIONS = ("color", "latest", "exponential")
"""Fusion methods for image channels; `color` and `latest` keep the latest value."""

FORGETTING = 0.05
"""Weight of the latest value in the moving mean of durations."""

MEAN = 0.5
"""Weight of a new pixel in `exponential` fusion, the same as in elevation_mapping_cupy."""


@dataclass
class ElevationFusion:
    """Fuses scans and images into the map of an `ElevationMapper`.

    Attributes:
        follow: whether the map moves with the robot.
        covariance_scale: factor applied to all pose covariances.
        image_fusions: fusion methods of image channels, by channel name or regular expression.
        report: last report of the mapper; None before the first scan.
        milliseconds: last duration and moving mean duration of each stage [ms].
        version: number of changes to the map.
        changed: time of the last change [s], on the steady clock; None before the first change.
        warnings: warnings that the caller must log and then remove from this list.
    """

    mapper: ElevationMapper
    follow: bool = True
    covariance_scale: float = 1.0
    clears_before_scan: bool = False
    image_fusions: Mapping[str, str] = field(default_factory=dict)
    report: UpdateReport | None = field(default=None, init=False)
    milliseconds: dict[str, tuple[float, float]] = field(default_factory=dict, init=False)
    version: int = field(default=0, init=False)
    changed: float | None = field(default=None, init=False)
    warnings: list[str] = field(default_factory=list, init=False)

    def __post_init__(self) -> None:
        check(self.covariance_scale >= 0, "covariance_scale", "0 or more", self.covariance_scale)
        for pattern, fusion in self.image_fusions.items():
            known = f"one of {', '.join(IMAGE_FUSIONS)}"
            check(fusion in IMAGE_FUSIONS, f"image_channel_fusions.{pattern}", known, fusion)
            try:
                re.compile(pattern)
            except re.error as error:
                text = f"image_channel_fusions: expected a regular expression, got {pattern!r}"
                raise ConfigError(f"{text}: {error}") from error

    @property
    def grid_map(self) -> GridMap:
        """The current map; scans replace it, and images modify it in place."""
        return self.mapper.grid_map

    @property
    def fused_map(self) -> GridMap:
        """The map; if `horizontal_variances` is set, heights include the horizontal uncertainty."""
        if self.mapper.parameters.horizontal_variances:
            return self.mapper.fused_map()
        return self.mapper.grid_map

    def fuse(self, source: InputSource, cloud: Cloud, placement: Placement) -> dict[str, int]:
        """Fuse a cloud into the map, and return the number of unused points for each reason.

        After an error, the map is unchanged.
        """
        begin = time.perf_counter()
        if cloud.stamp == 0:
            raise MessageError("header.stamp", "the time of the scan", "0")
        covariance = placement.covariance
        if covariance is not None:
            covariance = self.covariance_scale * covariance
        before = self.mapper.grid_map
        if self.clears_before_scan:
            self.mapper.clear()
        try:
            with warnings.catch_warnings(record=True) as caught:
                warnings.simplefilter("always")
                self.report = self.mapper.update(
                    cloud.points,
                    placement.transform,
                    timestamp=cloud.stamp,
                    pose_covariance=covariance,
                    values=cloud.columns,
                    position=placement.center if self.follow else None,
                    sensor=source.processor.model,
                    limits=self._limits_of(source, placement),
                )
        except GridMapError:
            if self.clears_before_scan:
                self.mapper.masked_replace(before)
            raise
        self.warnings += [str(entry.message) for entry in caught]
        self._note({**self.report.milliseconds, "update": 1e3 * (time.perf_counter() - begin)})
        return {**self.report.reasons, "in contradiction to the map": self.report.points_gated}

    def paint(self, source: InputSource, picture: Picture, placement: Placement) -> None:
        """Write the channels of an image to layers, in the cells that the camera sees."""
        begin = time.perf_counter()
        count, names = picture.pixels.shape[2], tuple(source.settings.channels)
        # Three unnamed channels form one color layer.
        layers = {COLOR_LAYER: picture.pixels}
        if count != 3 or names not in ((), ("rgb",)):
            names = names or ("gray",)
            if len(names) != count:
                expected = f"expected {count} names, as the image has, got {list(names)}"
                raise GridMapError(f"input_sources.{source.name}.channels: {expected}")
            layers = {name: picture.pixels[..., k] for k, name in enumerate(names)}
        grid_map = self.mapper.grid_map
        cells, pixels = seen_cells(grid_map, "elevation", picture.camera, placement.transform)
        for name, channel in layers.items():
            new = channel[pixels]
            if new.ndim == 2:
                is_deep = new.dtype.itemsize == 2 and new.dtype.kind == "u"
                new = color_vector_to_value(new >> 8 if is_deep else new)
            new = new.astype(np.float32, copy=False)
            fusion = self._fusion_of(name)
            if name not in grid_map:
                grid_map.add(name)
            old = grid_map[name][cells]
            if fusion == "exponential":
                new = np.where(np.isnan(old), new, (1 - MEAN) * old + MEAN * new)
            grid_map[name][cells] = new
        self._note({"image": 1e3 * (time.perf_counter() - begin)})

    def lay_patch(
        self, frame: Matrix, length: tuple[float, float], height_offset: float, variance: float
    ) -> None:
        """Initialize the map with a flat patch around a frame.

        Args:
            frame: (4, 4) transform from the frame to the map frame.
            length: side lengths (x, y) of the patch [m].
            height_offset: height of the patch above the origin of the frame [m].
            variance: variance of the heights [m^2].
        """
        x, y, z = frame[:3, 3]
        if self.follow:
            self.mapper.move((x, y))
        geometry = GridGeometry(length, self.grid_map.resolution, (x, y))
        layers = {"elevation": z + height_offset, "variance": variance}
        flat = GridMap.from_geometry(geometry, layers, frame_id=self.grid_map.frame_id)
        self.mapper.masked_replace(flat)
        self._note({})

    def replace(self, grid_map: GridMap, mask_layer: str) -> None:
        """Replace the cells that another map covers; see `ElevationMapper.masked_replace`."""
        self.mapper.masked_replace(grid_map, mask_layer)
        self._note({})

    def load(self, grid_map: GridMap) -> None:
        """Move the map to the position of a saved map, and load the layers that both maps have.

        After an error, the map is unchanged.
        """
        mapper = copy(self.mapper)  # Its methods replace maps and never modify them.
        mapper.move(grid_map.position)
        mapper.clear()
        mapper.masked_replace(grid_map, mask_layer="")
        self.mapper = mapper
        self._note({})

    def time(self, stage: str, last: float) -> None:
        """Record the duration `last` of a stage [ms]."""
        _, mean = self.milliseconds.get(stage, (last, last))
        self.milliseconds[stage] = last, mean + FORGETTING * (last - mean)

    def clear(self) -> None:
        self.mapper.clear()
        self._note({})

    def _limits_of(self, source: InputSource, placement: Placement) -> Parameters:
        """Return the mapper parameters, tightened to the limits of the source."""
        given, own, processor = self.mapper.parameters, source.settings, source.processor
        # Height limits are relative to the robot in the source, but to the sensor in the mapper.
        above, below = processor.above, processor.below
        if placement.robot is not None:
            offset = float(placement.robot[2, 3] - placement.transform[2, 3])
            above, below = above + offset, below + offset
        return replace(
            given,
            min_range=max(given.min_range, own.min_range),
            max_range=min(given.max_range, own.max_range),
            ignore_points_above=min(given.ignore_points_above, above),
            ignore_points_below=max(given.ignore_points_below, below),
        )

    def _fusion_of(self, name: str) -> str:
        """Return the fusion method of a channel, found by name or by the first matching pattern."""
        found = "color" if name == COLOR_LAYER else self.image_fusions.get(name)
        matching = (f for p, f in self.image_fusions.items() if re.fullmatch(p, name))
        return found or next(matching, "latest")

    def _note(self, milliseconds: Mapping[str, float]) -> None:
        self.version += 1
        self.changed = time.monotonic()
        for stage, last in milliseconds.items():
            self.time(stage, last)
