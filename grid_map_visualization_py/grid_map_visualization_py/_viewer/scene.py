# Copyright (c) 2026 grid_map_py contributors
# SPDX-License-Identifier: BSD-3-Clause
"""Scene of a map: the arrays that the browser draws."""

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


@dataclass(frozen=True)
class Scene:
    """Map as the page shows it; positions are relative to `mesh.origin` [m].

    Attributes:
        mesh: the surface; it may have no face.
        glb: the surface as a GLB file; None without a face.
        grid_lines: (N, 2, 3) ends of lines between neighboring cells; empty unless requested.
        points: (N, 3) centers of the cells; empty unless requested.
        point_colors: (N, 3) their colors.
        vectors: (N, 2, 3) ends of the vectors; empty unless requested.
        bounds: values at the ends of the color map; None without a color map.
        size: number of rows and columns of shown cells.
        spacing: mean distance between neighboring shown cells [m].
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
    """Return the scene of a map.

    Args:
        grid_map: the map.
        settings: layers and style.
        max_cells: limit of the cells, as for `Surface`.

    Raises:
        LayerNotFoundError: the map lacks a layer of the settings.
    """
    surface = Surface(grid_map, settings.height_layer, settings.flat, max_cells)
    mesh = surface.mesh(settings.coloring)
    columns, rows = surface.valid.shape
    spacing = grid_map.resolution * math.sqrt(math.prod(grid_map.size) / (rows * columns))
    # Lines stay visible a little above the surface.
    lift = np.array([0, 0, 0.02 * spacing], np.float32)
    no_lines = np.empty((0, 2, 3), np.float32)
    coloring, bounds = settings.coloring, None
    if coloring.mode == "intensity":
        values = surface.values(coloring.layer or settings.height_layer)
        bounds = coloring.scale.bounds(values)
    return Scene(
        mesh,
        to_glb(mesh, shaded=settings.shaded, opacity=settings.opacity) if len(mesh.faces) else None,
        _grid_lines(surface, mesh) + lift if settings.grid_lines else no_lines,
        mesh.vertices if settings.points else mesh.vertices[:0],
        mesh.colors if settings.points else mesh.colors[:0],
        _vectors(surface, mesh, settings) if settings.vectors else no_lines,
        bounds,
        (rows, columns),
        spacing,
    )


@dataclass(frozen=True, eq=False)
class View:
    """Camera pose: `start` (3,) is the position of the camera, `target` (3,) its aim [m]."""

    start: Positions
    target: Positions

    @property
    def offset(self) -> Positions:
        """Vector from the target to the start (3,) [m]."""
        return self.start - self.target

    @property
    def reach(self) -> float:
        """Distance between start and target [m]."""
        return float(np.linalg.norm(self.offset))

    def is_like(self, other: "View") -> bool:
        """Return True if both views look the same."""
        tolerance = 0.001 * self.reach
        starts, targets = self.start - other.start, self.target - other.target
        return bool(max(np.abs(starts).max(), np.abs(targets).max()) <= tolerance)

    def loses(self, other: "View") -> bool:
        """Return True if the target of the other view is out of sight, or its size differs much."""
        # Heights are ignored, because outliers would move the camera back and forth.
        is_beside = bool(np.hypot(*(other.target - self.target)[:2]) > self.reach)
        return is_beside or not 1 / 3 < other.reach / self.reach < 3


def view(mesh: Mesh, grid_map: GridMap) -> View:
    """Return a view of the whole map from behind and above."""
    heights = mesh.vertices[:, 2] if len(mesh.vertices) else np.zeros(1)
    target = mesh.origin + [0.0, 0.0, 0.5 * (float(heights.min()) + float(heights.max()))]
    reach = float(np.hypot(*grid_map.length))
    return View(target + reach * np.array([-0.5, -0.5, 0.6]), target)


def _grid_lines(surface: Surface, mesh: Mesh) -> Points:
    """Return lines between neighboring cells that both have a height."""
    valid = surface.valid
    number = (np.cumsum(valid) - 1).reshape(valid.shape)
    pairs = [
        np.stack([number[first][both], number[second][both]], axis=-1)
        for first, second in ((np.s_[:-1, :], np.s_[1:, :]), (np.s_[:, :-1], np.s_[:, 1:]))
        for both in [valid[first] & valid[second]]
    ]
    lines: Points = mesh.vertices[np.concatenate(pairs)]
    return lines


def _vectors(surface: Surface, mesh: Mesh, settings: Settings) -> Points:
    """Return lines from the surface along the finite vectors."""
    valid = surface.valid
    layers = [surface.values(settings.vectors + axis)[valid] for axis in AXES]
    vectors = np.stack(layers, axis=-1)
    finite = np.isfinite(vectors).all(axis=-1)
    starts = mesh.vertices[finite]
    ends = starts + np.float32(settings.vector_scale) * vectors[finite]
    return np.stack([starts, ends], axis=1)
