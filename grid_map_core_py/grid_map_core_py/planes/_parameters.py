# SPDX-License-Identifier: BSD-3-Clause
"""Parameters of `extract_planes`, with the names and sections of convex_plane_decomposition."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from .._parameters import build, check
from ..errors import ConfigError
from ..files._shared import load_yaml


class Section:
    def __post_init__(self) -> None:
        for name, value in vars(self).items():
            if name == "kernelSize":
                check(value in (3, 5), name, "3 or 5 [cells]", value)
            elif name == "kernel_size":
                check(value >= 3 and value % 2, name, "an odd number from 3 on [cells]", value)
            elif name.endswith("_degrees"):
                check(0 < value < 90, name, "an angle between 0 and 90 [degrees]", value)
            elif name.endswith("error_threshold"):
                check(0 < value < math.inf, name, "a positive length [m]", value)
            elif isinstance(value, int):
                check(value >= 0, name, "no negative number", value)


@dataclass(frozen=True, kw_only=True)
class Preprocessing(Section):
    """Median filter that removes outliers before the search for planes.

    Attributes:
        kernelSize: width of the median filter [cells], 3 or 5.
        numberOfRepeats: number of times the median filter is applied.
        resolution, increasing: accepted, but without effect.
    """

    resolution: float = 0.04
    kernelSize: int = 3  # noqa: N815
    numberOfRepeats: int = 1  # noqa: N815
    increasing: bool = False


@dataclass(frozen=True, kw_only=True)
class SlidingWindow(Section):
    """Thresholds for the planes of windows around cells, and for the planes of regions.

    Attributes:
        kernel_size: width of the window around each cell [cells], odd.
        planarity_opening_filter: radius [cells] of the opening (erosion, dilation) of planar areas.
        plane_inclination_threshold_degrees: largest inclination of a region.
        local_plane_inclination_threshold_degrees: largest inclination of a window's plane.
        plane_patch_error_threshold: largest RMS deviation of a window from its plane [m].
        min_number_points_per_label: smallest number of cells per region.
        global_plane_fit_distance_error_threshold: largest distance of a cell from its region's
            plane, along z [m].
        global_plane_fit_angle_error_threshold_degrees: largest angle between the plane of a window
            and the plane of its region.
        connectivity, include_ransac_refinement: accepted, but without effect.
    """

    kernel_size: int = 3
    planarity_opening_filter: int = 0
    plane_inclination_threshold_degrees: float = 30.0
    local_plane_inclination_threshold_degrees: float = 35.0
    plane_patch_error_threshold: float = 0.02
    min_number_points_per_label: int = 4
    connectivity: int = 4
    include_ransac_refinement: bool = True
    global_plane_fit_distance_error_threshold: float = 0.025
    global_plane_fit_angle_error_threshold_degrees: float = 25.0


@dataclass(frozen=True, kw_only=True)
class ContourExtraction(Section):
    """Safety margin of the regions.

    Attributes:
        marginSize: width removed along each region's border [cells].
    """

    marginSize: int = 0  # noqa: N815


SECTIONS: dict[str, type[Any]] = {
    "preprocessing": Preprocessing,
    "sliding_window_plane_extractor": SlidingWindow,
    "contour_extraction": ContourExtraction,
}
"""Class of each section that has an effect."""

UNUSED = "ransac_plane_refinement", "postprocessing"
"""Sections of convex_plane_decomposition that are accepted without effect."""


@dataclass(frozen=True, kw_only=True)
class PlaneParameters:
    """Parameters of `extract_planes`, grouped as in the C++ package convex_plane_decomposition.

    The defaults are those of the C++ package, except `marginSize`: it is in cells, and its default
    is 0. The sections `ransac_plane_refinement` and `postprocessing` are accepted, but without
    effect.

    Example:
        >>> parameters = {"contour_extraction": {"marginSize": 1}}
        >>> PlaneParameters.from_mapping(parameters).contour_extraction
        ContourExtraction(marginSize=1)
    """

    preprocessing: Preprocessing = field(default_factory=Preprocessing)
    sliding_window_plane_extractor: SlidingWindow = field(default_factory=SlidingWindow)
    contour_extraction: ContourExtraction = field(default_factory=ContourExtraction)

    @classmethod
    def from_mapping(cls, sections: Mapping[str, Any]) -> PlaneParameters:
        """Create parameters from nested mappings: section names, then parameter names.

        Raises:
            ConfigError: a section or parameter is unknown, or has a wrong type or value.
        """
        check(isinstance(sections, Mapping), "parameters", "sections of parameters", sections)
        built = {name: values for name, values in sections.items() if name not in UNUSED}
        for name in built.keys() & SECTIONS.keys():
            values = {} if built[name] is None else built[name]
            check(isinstance(values, Mapping), name, "a mapping of names to values", values)
            try:
                built[name] = build(SECTIONS[name], values)
            except ConfigError as error:
                raise ConfigError(f"{name}: {error}") from error
        return build(cls, built)

    @classmethod
    def from_yaml(cls, path: str | Path) -> PlaneParameters:
        """Read parameters from a file such as `parameters.yaml` of convex_plane_decomposition.

        Raises:
            ConfigError: a section or parameter is unknown, or has a wrong type or value.
        """
        content = load_yaml(path)
        try:
            return cls.from_mapping({} if content is None else content)
        except ConfigError as error:
            raise ConfigError(f"{path}: {error}") from error
