# SPDX-License-Identifier: BSD-3-Clause
"""Scene of a map for `web_viewer`: settings, arrays to draw in the browser, and the view."""

import math
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from grid_map_core_py import GridMap, Interpolation
from grid_map_core_py._arrays import Positions, Size

from ..colors import Coloring, Colors, is_empty
from ..surface import Mesh, Surface
from .glb import to_glb

Points = npt.NDArray[np.float32]

GAP = 0.2
"""Height of drawings above the surface [cells], at which they remain visible."""


@dataclass(frozen=True, kw_only=True)
class ViewSettings:
    """User settings: layers to show and their style.

    `vectors` is the prefix of the vector layers, which end in x, y and z. `vector_scale` is the
    drawn length of a unit vector [m]. `history` is the maximum number of maps in the scene.
    """

    height_layer: str
    flat: bool = False
    coloring: Coloring = field(default_factory=Coloring)
    shaded: bool = True
    opacity: float = 1.0
    grid_lines: bool = False
    points: bool = False
    vectors: str = ""
    vector_scale: float = 0.1
    history: int = 1

    @property
    def layers(self) -> set[str]:
        color_layer = "" if self.coloring.mode == "flat" else self.coloring.layer
        return {self.height_layer, color_layer, *self.vector_layers} - {""}

    @property
    def vector_layers(self) -> list[str]:
        return [self.vectors + axis for axis in "xyz" if self.vectors]


@dataclass(frozen=True, eq=False)
class View:
    """Camera position `start` (3,) and point `target` (3,) at which the camera looks [m]."""

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
        poses = (self.start, self.target), (other.start, other.target)
        return np.allclose(*poses, rtol=0, atol=0.001 * self.reach)

    def loses(self, other: "View") -> bool:
        """Return True if the map of `other` is out of view, or over 3 times larger or smaller."""
        # Heights are ignored, because outliers would make the camera jump.
        is_beside = bool(np.hypot(*(other.target - self.target)[:2]) > self.reach)
        return is_beside or not 1 / 3 < other.reach / self.reach < 3


@dataclass(frozen=True)
class SurfaceScene:
    """Data that the page draws for a map.

    Attributes:
        glb: content of a GLB file with the surface; None if the surface has no faces.
        grid_lines: (N, 2, 3) lines between neighboring cells [m], relative to `mesh.origin`.
        vectors: (N, 2, 3) start and end points of the vectors [m], relative to `mesh.origin`.
        bounds: values at the ends of the color map; None without a color map. If no value is
            finite, both bounds are NaN.
        box: lowest and highest corner (3,) of the bounding box [m], map frame.
        size: number of shown rows and columns.
        spacing: mean distance between neighboring shown cells [m].
    """

    mesh: Mesh
    glb: bytes | None
    grid_lines: Points
    vectors: Points
    bounds: tuple[float, float] | None
    box: tuple[Positions, Positions]
    size: Size
    spacing: float
    view: View


def make_scene(grid_map: GridMap, settings: ViewSettings, max_drawn_cells: int = 0) -> SurfaceScene:
    coloring = settings.coloring
    surface = Surface(grid_map, settings.height_layer, settings.flat, max_drawn_cells)
    mesh = surface.mesh(coloring)
    columns, rows = surface.valid.shape
    spacing = grid_map.resolution * math.sqrt(math.prod(grid_map.size) / (rows * columns))
    lines = vectors = np.empty((0, 2, 3), np.float32)
    if settings.grid_lines:
        valid = surface.valid
        number = (np.cumsum(valid) - 1).reshape(valid.shape)
        pairs = [
            np.stack([number[first][both], number[second][both]], axis=-1)
            for first, second in ((np.s_[:-1, :], np.s_[1:, :]), (np.s_[:, :-1], np.s_[:, 1:]))
            for both in [valid[first] & valid[second]]
        ]
        # Raise the lines slightly, so that they remain visible.
        lines = mesh.vertices[np.concatenate(pairs)] + np.array([0, 0, 0.02 * spacing], np.float32)
    if settings.vectors:
        vectors = _vectors(surface, mesh, settings)
    bounds = None
    if coloring.mode == "intensity":
        values = grid_map[coloring.layer or settings.height_layer]
        bounds = (math.nan, math.nan) if is_empty(coloring, values) else surface.bounds(coloring)
    glb = None
    if len(mesh.faces):
        glb = to_glb(mesh, shaded=settings.shaded, opacity=settings.opacity)
    heights = mesh.vertices[:, 2] if len(mesh.vertices) else np.zeros(1)
    half = 0.5 * np.asarray(grid_map.length)
    low = np.append(grid_map.position - half, float(heights.min()))
    high = np.append(grid_map.position + half, float(heights.max()))
    target = 0.5 * (low + high)
    offset = float(np.hypot(*grid_map.length)) * np.array([-0.5, -0.5, 0.6])
    view = View(target + offset, target)
    return SurfaceScene(
        mesh, glb, lines, vectors, bounds, (low, high), (rows, columns), spacing, view
    )


def on_surface(grid_map: GridMap, settings: ViewSettings, points: Positions) -> Positions:
    """Move points (N, 3) [m, map frame] to just above the surface, where the surface is known."""
    result = np.array(points, np.float64)
    gap = GAP * grid_map.resolution
    inside = np.flatnonzero(grid_map.is_inside(result[:, :2]))
    if settings.flat:
        result[:, 2] = gap
    elif len(inside):
        layer, places = settings.height_layer, result[inside, :2]
        heights = np.asarray(grid_map.at_position(layer, places, Interpolation.LINEAR))
        known = np.isfinite(heights)
        result[inside[known], 2] = heights[known] + gap
    return result


class Drawing(NamedTuple):
    """Lines and triangles above the maps; positions [m] are in the map frame.

    Attributes:
        lines: (N, 2, 3) start and end of each line.
        line_colors: (N, 2, 3) uint8 red, green, blue.
        triangles: (M, 3, 3) corners.
        triangle_colors: (M, 3, 3) uint8 red, green, blue.
    """

    lines: Positions
    line_colors: Colors
    triangles: Positions
    triangle_colors: Colors
    opacity: float = 1.0


EMPTY = Drawing(
    np.empty((0, 2, 3)),
    np.empty((0, 2, 3), np.uint8),
    np.empty((0, 3, 3)),
    np.empty((0, 3, 3), np.uint8),
)


def drawn_path(points: Positions, color: tuple[int, int, int]) -> Drawing:
    """Return a line through points (N, 3) [m]."""
    lines = np.stack([points[:-1], points[1:]], axis=1)
    return EMPTY._replace(lines=lines, line_colors=np.full(lines.shape, color, np.uint8))


def raised(drawing: Drawing, grid_map: GridMap, settings: ViewSettings) -> Drawing:
    """Raise a drawing slightly, to keep it visible; if `settings.flat`, start at height zero."""
    gap = np.array([0.0, 0.0, GAP * grid_map.resolution])
    flat = np.array([1.0, 1.0, 0.0 if settings.flat else 1.0])
    lines, triangles = drawing.lines * flat + gap, drawing.triangles * flat + gap
    return drawing._replace(lines=lines, triangles=triangles)


def _vectors(surface: Surface, mesh: Mesh, settings: ViewSettings) -> Points:
    layers = [surface.values(layer)[surface.valid] for layer in settings.vector_layers]
    vectors = np.stack(layers, axis=-1)
    finite = np.isfinite(vectors).all(axis=-1)
    starts = mesh.vertices[finite]
    ends = starts + np.float32(settings.vector_scale) * vectors[finite]
    return np.stack([starts, ends], axis=1)


def hit(mesh: Mesh, start: Positions, direction: Positions) -> Positions | None:
    """Return the first point (3,) [m, map frame] where a ray hits a mesh, or None if it misses.

    The ray begins at `start` (3,) [m, map frame]. `direction` (3,) may have any nonzero length.
    Triangles are hit from either side.

    Source: Möller and Trumbore, Fast, Minimum Storage Ray/Triangle Intersection, 1997.
    """
    direction = np.asarray(direction, dtype=np.float64)
    direction = direction / np.linalg.norm(direction)
    corners = mesh.vertices.astype(np.float64)
    first, second, third = (corners[mesh.faces[:, k]] for k in range(3))
    side, other = second - first, third - first
    offset = np.asarray(start, dtype=np.float64) - mesh.origin - first
    normal = np.cross(direction, other)
    volume = np.einsum("ij,ij->i", side, normal)
    across = np.cross(offset, side)
    area = np.einsum("ij,ij->i", side, side)
    # Triangles parallel to the ray cause divisions by zero; the mask below excludes them.
    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
        u = np.einsum("ij,ij->i", offset, normal) / volume
        v = across @ direction / volume
        distance = np.einsum("ij,ij->i", other, across) / volume
        is_hit = (np.abs(volume) > 1e-12 * area) & (u >= 0) & (v >= 0) & (u + v <= 1)
        is_hit &= distance > 0
    if not is_hit.any():
        return None
    point: Positions = start + distance[is_hit].min() * direction
    return point
