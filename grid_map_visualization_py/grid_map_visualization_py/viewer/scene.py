# Copyright (c) 2026 grid_map_py contributors
# SPDX-License-Identifier: BSD-3-Clause
"""Scene of a map for the browser: arrays made from a map and settings."""

import math
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from grid_map_core_py import GridMap
from grid_map_core_py.arrays import Positions, Size

from ..colors import Colors
from ..surface import Mesh, Surface
from .glb import to_glb
from .settings import AXES, Settings

Points = npt.NDArray[np.float32]

LIFT = 0.02
"""Height of lines above the surface, as a fraction of the spacing, so that they stay visible."""

SAME_VIEW = 0.001
"""Views differ if a place differs by more than this part of the reach."""

SAME_SCALE = 3.0
"""Maps are much larger or smaller than others by this factor."""


@dataclass(frozen=True)
class Scene:
    """A map as the page shows it; positions count from `mesh.origin` [m].

    Attributes:
        mesh: the surface; it may have no face.
        glb: the surface for the browser; None without a face.
        grid_lines: (N, 2, 3) ends of the lines between neighboring cells; none unless wanted.
        points: (N, 3) centers of the cells; none unless wanted.
        point_colors: (N, 3) their colors.
        vectors: (N, 2, 3) ends of the vectors; none unless wanted.
        bounds: the values at the ends of the color map; None without a color map.
        size: rows and columns of cells that are shown.
        spacing: mean distance between neighbors that are shown [m].
    """

    mesh: Mesh
    glb: bytes | None
    grid_lines: Points
    points: Points
    point_colors: Colors
    vectors: Points
    bounds: tuple[float, float] | None
    size: Size
    spacing: float


def make_scene(grid_map: GridMap, settings: Settings, max_cells: int = 0) -> Scene:
    """Return what a map looks like.

    Args:
        grid_map: the map.
        settings: what to show of it.
        max_cells: larger maps are thinned out as `Surface` says; 0 for never.

    Raises:
        LayerNotFoundError: the map lacks a layer that is to be shown.
    """
    surface = Surface(grid_map, settings.height_layer, settings.flat, max_cells)
    mesh = surface.mesh(settings.coloring)
    columns, rows = surface.valid.shape
    spacing = grid_map.resolution * math.sqrt(math.prod(grid_map.size) / (rows * columns))
    lift = np.array([0, 0, LIFT * spacing], np.float32)
    no_lines = np.empty((0, 2, 3), np.float32)
    return Scene(
        mesh,
        to_glb(mesh, shaded=settings.shaded, opacity=settings.opacity) if len(mesh.faces) else None,
        _grid_lines(surface, mesh) + lift if settings.grid_lines else no_lines,
        mesh.vertices if settings.points else mesh.vertices[:0],
        mesh.colors if settings.points else mesh.colors[:0],
        _vectors(surface, mesh, settings) if settings.vectors else no_lines,
        _bounds(surface, settings),
        (rows, columns),
        spacing,
    )


@dataclass(frozen=True, eq=False)
class View:
    """Camera position (3,) and target (3,) [m]."""

    start: Positions
    target: Positions

    @property
    def offset(self) -> Positions:
        """The way from the target to the start (3,) [m]."""
        return self.start - self.target

    @property
    def reach(self) -> float:
        """The distance from the start to the target [m]."""
        return float(np.linalg.norm(self.offset))

    def is_like(self, other: "View") -> bool:
        """Return whether two views look the same."""
        tolerance = SAME_VIEW * self.reach
        starts, targets = self.start - other.start, self.target - other.target
        return bool(max(np.abs(starts).max(), np.abs(targets).max()) <= tolerance)

    def loses(self, other: "View") -> bool:
        """Return whether the other view shows another place, or a very different scale."""
        # Heights may be wrong for a moment, and nobody wants to be taken to and fro.
        is_beside = bool(np.hypot(*(other.target - self.target)[:2]) > self.reach)
        return is_beside or not 1 / SAME_SCALE < other.reach / self.reach < SAME_SCALE


def view(mesh: Mesh, grid_map: GridMap) -> View:
    """Return the view of a map from behind and above."""
    heights = mesh.vertices[:, 2] if len(mesh.vertices) else np.zeros(1)
    target = mesh.origin + [0.0, 0.0, 0.5 * (float(heights.min()) + float(heights.max()))]
    reach = float(np.hypot(*grid_map.length))
    return View(target + reach * np.array([-0.5, -0.5, 0.6]), target)


def _grid_lines(surface: Surface, mesh: Mesh) -> Points:
    """Return the lines between neighbors of which both have a height."""
    valid = surface.valid
    number = (np.cumsum(valid) - 1).reshape(valid.shape)
    pairs = [
        np.stack([number[first][both], number[second][both]], axis=-1)
        for first, second in (
            (np.s_[:-1, :], np.s_[1:, :]),
            (np.s_[:, :-1], np.s_[:, 1:]),
        )
        for both in [valid[first] & valid[second]]
    ]
    lines: Points = mesh.vertices[np.concatenate(pairs)]
    return lines


def _vectors(surface: Surface, mesh: Mesh, settings: Settings) -> Points:
    """Return lines from the surface along its vectors, where they are finite."""
    valid = surface.valid
    layers = [surface.values(settings.vectors + axis)[valid] for axis in AXES]
    vectors = np.stack(layers, axis=-1)
    finite = np.isfinite(vectors).all(axis=-1)
    starts = mesh.vertices[finite]
    ends = starts + np.float32(settings.vector_scale) * vectors[finite]
    return np.stack([starts, ends], axis=1)


def _bounds(surface: Surface, settings: Settings) -> tuple[float, float] | None:
    coloring = settings.coloring
    if coloring.mode != "intensity":
        return None
    values = surface.values(coloring.layer or settings.height_layer)
    return coloring.scale.bounds(values)
