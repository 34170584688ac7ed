# SPDX-License-Identifier: BSD-3-Clause
"""Write maps and messages to a Rerun recording, and create a viewer layout that shows them.

Each topic becomes an entity path, such as `grid_map` for `/grid_map`. A map has these subpaths:

- `surface`: a mesh with one set of vertex colors per layer.
- `layers/NAME/color`: image of a layer (x right, y up); cells without a value are transparent.
- `layers/NAME`: invisible image above `color`, with the values that the viewer shows on hovering.
- `legend/NAME`: color bar of a layer, labeled with the values at its ends.
- `range/NAME`: curves of the smallest, mean and largest value.
- `missing/NAME`: curve of the percentage of missing values.

Each ROS frame becomes a Rerun frame. The 3-D view has its own frame, `view`, with an origin near
the first map, because graphics hardware draws large coordinates imprecisely. Only `view` scales the
heights by `exaggeration`. All logged data is true to scale.
"""

import math
import re
from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from grid_map_core_py import GridMap
from grid_map_core_py._arrays import (
    max_of_finites,
    mean_of_finites,
    min_of_finites,
    number_of_finites,
)
from grid_map_core_py._packages import remedy_for
from grid_map_core_py.errors import required
from grid_map_core_py.plugins import check
from grid_map_ros_py import MessageError, from_serialized_message
from grid_map_ros_py.messages import view

from .._layers import titled
from ..colors import DEFAULT_COLOR_MAP, Coloring, is_empty
from ..surface import Mesh, Surface, check_max_drawn_cells
from ._messages import POSES, SHOWN, Placed

GRID_MAP_TYPE = "grid_map_msgs/msg/GridMap"

SHOWN_TYPES = frozenset({GRID_MAP_TYPE, *SHOWN})
"""Message types that `Scene.log_message` can show."""

_FAR = 1000.0
"""Local origins of distant maps are multiples of this length [m], which are exact in float32."""

_LARGEST_IMAGE = 4096
"""Largest image width and height that all graphics hardware supports [pixels]."""

_VIEW, _NO_FRAME = "view", "(no frame)"

_CURVES = (
    *((31, 119, 180), (255, 127, 14), (44, 160, 44), (214, 39, 40)),
    *((148, 103, 189), (140, 86, 75), (227, 119, 194), (23, 190, 207)),
)
"""Colors of the curves."""


def rerun(module: str = "rerun") -> Any:
    """Import a Rerun module; raise `MissingPackageError` if Rerun is not installed."""
    return required(module, "Rerun", remedy_for("rerun"))


@dataclass(frozen=True, kw_only=True)
class Style:
    """Style in which maps are drawn.

    Attributes:
        height_layer: layer with the heights [m]; empty means `elevation`, or else the first layer.
        color_layer: initial color layer; if empty, the surface is colored by height.
        color_map: Matplotlib color map of `color_layer`; other layers use the default color map.
        lower, upper: values at the ends of `color_map`; None means the smallest and the largest
            value of each map.
        exaggeration: factor by which the 3-D view scales heights.
        max_drawn_cells: maximum number of cells in a surface, or of points in a point cloud. Larger
            maps and point clouds are downsampled. 0 means no limit.
        max_image_cells: maximum number of cells in the image of a layer; larger layers are thinned
            out. 0 means no limit, except that images are at most 4096 pixels wide and high.
    """

    height_layer: str = ""
    color_layer: str = ""
    color_map: str = DEFAULT_COLOR_MAP
    lower: float | None = None
    upper: float | None = None
    exaggeration: float = 1.0
    max_drawn_cells: int = 150_000
    max_image_cells: int = 0

    def __post_init__(self) -> None:
        check_max_drawn_cells(self.max_drawn_cells)
        is_factor = np.isfinite(self.exaggeration) and self.exaggeration > 0
        check(bool(is_factor), "exaggeration", "a positive number", self.exaggeration)
        self.coloring(self.color_layer)

    def heights_of(self, layers: Iterable[str]) -> str:
        """Return the height layer, or "" if there are no layers."""
        names = [*layers]
        return self.height_layer or ("elevation" if "elevation" in names else [*names, ""][0])

    def coloring(self, layer: str, *, is_chosen: bool = True) -> Coloring:
        """Return the coloring of a layer: packed colors if the layer name ends in `color`.

        Other layers use `color_map` if `is_chosen` is true, and the default color map otherwise.
        """
        if layer.endswith("color"):
            return Coloring(mode="color", layer=layer)
        if not is_chosen:
            return Coloring(layer=layer)
        return Coloring(layer=layer, color_map=self.color_map, lower=self.lower, upper=self.upper)


class Scene:
    """Writes maps and messages to a Rerun recording and creates a matching viewer layout.

    Do not use a scene in several threads at once. The recording has two timelines: `ros_time` is
    the time in the message header, and `log_time` is the time of arrival. All times are in
    nanoseconds since the epoch.

    Args:
        recording: a `rerun.RecordingStream`.
        style: style of the maps.

    Attributes:
        size: number of written bytes.
        surfaces: number of written surfaces.
    """

    def __init__(self, recording: Any, style: Style | None = None) -> None:
        self._rr, self._rrb = rerun(), rerun("rerun.blueprint")
        self._recording, self._style = recording, style or Style()
        self.size = self.surfaces = 0
        self._maps: dict[str, list[str]] = {}
        self._present: dict[str, set[str]] = {}
        self._messages: dict[str, str] = {}
        # Archetypes that have been logged with a frame, by topic and by path below it.
        self._drawn: dict[str, dict[tuple[str, ...], list[Any]]] = {}
        self._has_milliseconds = False
        self._origins: dict[str, npt.NDArray[np.float64]] = {}
        self._first: tuple[npt.NDArray[np.float64], float] | None = None
        self._is_repeated = False
        self._laid_out: object = None
        # Errors when writing the recording file; the next log call raises the first of them.
        self._errors: list[OSError] = []
        # Rerun must not add the times of the log calls.
        self._rr.set_log_time_enabled(False, recording=recording)
        self._rr.set_log_tick_enabled(False, recording=recording)

    def log_map(self, name: str, grid_map: GridMap, *, log_time: int | None = None) -> None:
        """Write a map to the recording.

        If the map has no timestamp, its time is `log_time` on both timelines.

        Args:
            name: topic or file name of the map.
            grid_map: the map, with any start index.
            log_time: time of arrival [ns]; None means the timestamp of the map.
        """
        self._set_times(grid_map.timestamp, log_time)
        parts, layers = _parts(name), grid_map.layers
        key = "/".join(parts)
        self._is_repeated |= key in self._maps
        known = self._maps.setdefault(key, [])
        known += [layer for layer in layers if layer not in known]
        for layer in self._present.get(key, set()).difference(layers):
            for kind in ("layers", "legend", "range", "missing"):
                self._log([*parts, kind, layer], self._rr.Clear(recursive=True))
        self._present[key] = {*layers}
        heights = self._style.heights_of(layers)
        chosen = self._style.color_layer or heights
        colorings = {one: self._style.coloring(one, is_chosen=one == chosen) for one in layers}
        self._log_surface(parts, grid_map, heights, chosen, colorings)
        for layer, coloring in colorings.items():
            self._log_layer(parts, grid_map, layer, coloring)

    def log_message(self, topic: str, kind: str, data: bytes, *, log_time: int) -> bool:
        """Write a serialized message to the recording if its type is one of `SHOWN_TYPES`.

        Args:
            topic: topic of the message.
            kind: message type, such as `nav_msgs/msg/Odometry`.
            data: the message in CDR, for example from a raw subscription or a bag.
            log_time: time of arrival [ns].

        Returns:
            True if messages of this type can be shown.

        Raises:
            MessageError: the message is damaged or inconsistent. If only some of its transforms or
                markers are invalid, the others are still written.
            LimitError: a map has too many cells.
        """
        if kind == GRID_MAP_TYPE:
            self.log_map(topic, from_serialized_message(data), log_time=log_time)
            return True
        if kind not in SHOWN:
            return False
        message = view(data, kind.replace("/msg/", "/"))
        parts = _parts(topic)
        self._messages.setdefault("/".join(parts), kind)
        problem: MessageError | None = None
        for item in SHOWN[kind](self._rr, message, self._style.max_drawn_cells):
            self._set_times(item.time, log_time)
            try:
                self._log_item(topic, item)
            except MessageError as error:
                problem = problem or error
        if problem is not None:
            raise problem
        return True

    def _log_item(self, topic: str, item: Placed) -> None:
        """Log the archetypes of a part of a message, or clear earlier parts."""
        path, none = [*([] if item.is_global else _parts(topic)), *item.path], np.zeros(3)
        drawn = self._drawn.setdefault(topic, {})
        if item.kept is not None:
            for gone in sorted(drawn.keys() - item.kept):
                # `Clear` would also clear the frame, which Rerun reports as an error.
                empty = [kind.from_fields(clear_unset=True) for kind in drawn.pop(gone)]
                self._log([*path, *gone], *empty)
        elif item.frame is None:
            self._log(path, *item.archetypes(none), static=topic.endswith("tf_static"))
            self._has_milliseconds |= path[0] == "milliseconds"
        else:
            frame, origin = self._place(item.frame)
            archetypes = item.archetypes(origin)
            self._log(path, self._rr.CoordinateFrame(frame), *archetypes)
            drawn[item.path] = [type(one) for one in archetypes]

    def layout(self) -> Any:
        """Return the viewer layout (`rrb.Blueprint`) for all data logged so far."""
        self._laid_out = self._content()
        rrb = self._rrb
        images = [
            rrb.Spatial2DView(origin=_path(name, "layers", layer), name=layer)
            for name, layers in self._maps.items()
            for layer in layers
        ]
        is_crowded = len(images) > 6
        # In narrower images, titles would be cut off.
        columns = 2 if is_crowded else None
        beside = [rrb.Grid(*images, grid_columns=columns, name="layers")] if images else []
        curves = []
        if self._is_repeated:
            ranges = [
                _path(name, "range", layer)
                for name, layers in self._maps.items()
                for heights in [self._style.heights_of(layers)]
                for layer in dict.fromkeys([heights, self._style.color_layer or heights])
            ]
            missing = [
                _path(name, "missing", layer)
                for name, layers in self._maps.items()
                for layer in layers
            ]
            curves += [
                rrb.TimeSeriesView(origin="/", contents=ranges, name="range and mean"),
                rrb.TimeSeriesView(origin="/", contents=missing, name="missing values [%]"),
            ]
        if self._has_milliseconds:
            curves.append(rrb.TimeSeriesView(origin="/milliseconds", name="milliseconds"))
        if curves:
            beside.append(rrb.Tabs(*curves))
        parts = [self._surface_views()]
        if beside:
            shares = [3, 1] if is_crowded else [3, 2]
            parts.append(rrb.Vertical(*beside, row_shares=shares[: len(beside)]))
        return rrb.Blueprint(
            rrb.Horizontal(*parts, column_shares=[1, 1] if is_crowded else [3, 2][: len(parts)]),
            rrb.BlueprintPanel(state="collapsed"),
            rrb.SelectionPanel(state="collapsed"),
            rrb.TimePanel(state="collapsed", timeline="ros_time"),
            auto_views=False,
        )

    def send_layout(self) -> None:
        """Send the layout to the viewer if the layout has changed."""
        if self._laid_out != self._content():
            self._recording.send_blueprint(self.layout())

    def _set_times(self, ros_time: int, log_time: int | None) -> None:
        if self._errors:
            raise self._errors[0]
        arrival = ros_time if log_time is None else log_time
        for name, time in (("ros_time", ros_time or arrival), ("log_time", arrival)):
            self._recording.set_time(name, timestamp=np.datetime64(time, "ns"))

    def _log(self, parts: list[str], *archetypes: Any, static: bool = False) -> None:
        batches = [batch for one in archetypes for batch in one.as_component_batches()]
        self.size += sum(batch.as_arrow_array().nbytes for batch in batches)
        path = self._rr.new_entity_path(parts)
        self._recording.log(path, batches, static=static)

    def _log_surface(
        self,
        parts: list[str],
        grid_map: GridMap,
        heights: str,
        chosen: str,
        colorings: dict[str, Coloring],
    ) -> None:
        rr, path = self._rr, [*parts, "surface"]
        if heights not in colorings or chosen not in colorings:
            self._log(path, rr.Clear(recursive=False))
            return
        surface = Surface(grid_map, heights, max_drawn_cells=self._style.max_drawn_cells)
        mesh = surface.mesh(colorings[chosen])
        frame, origin = self._place(grid_map.frame_id, mesh.origin)
        if self._first is None:
            reach = float(np.hypot(*grid_map.length))
            level = mean_of_finites(mesh.vertices[:, 2]) if len(mesh.vertices) else 0.0
            center = mesh.origin - origin + [0.0, 0.0, self._style.exaggeration * level]
            self._first = center, reach
            scale = [1.0, 1.0, 1.0 / self._style.exaggeration]
            between = rr.Transform3D(scale=scale, parent_frame=frame, child_frame=_VIEW)
            self._log(["tf", _VIEW], between, static=True)
        if not len(mesh.faces):
            self._log(path, rr.Clear(recursive=False))
            return
        valid = surface.valid.ravel()
        self.surfaces += 1
        self._log(
            path,
            rr.CoordinateFrame(frame),
            rr.InstancePoses3D(translations=[mesh.origin - origin]),
            rr.Mesh3D(
                vertex_positions=mesh.vertices,
                triangle_indices=mesh.faces,
                vertex_normals=_normals(mesh),
                vertex_colors=mesh.colors,
            ),
            *(
                rr.DynamicArchetype(
                    layer,
                    components={
                        "colors": rr.components.ColorBatch(surface.colors(coloring)[valid])
                    },
                )
                for layer, coloring in colorings.items()
            ),
        )

    def _log_layer(
        self, parts: list[str], grid_map: GridMap, layer: str, coloring: Coloring
    ) -> None:
        rr = self._rr
        values = grid_map.unwrapped(layer)
        most = self._style.max_image_cells or values.size
        step = max(
            -(-max(values.shape) // _LARGEST_IMAGE), math.ceil(math.sqrt(values.size / most))
        )
        # Row and column indices of a map increase along -x and -y.
        image = np.ascontiguousarray(values.T[::step, ::-step])
        opaque = np.where(np.isfinite(image), np.uint8(255), np.uint8(0))
        picture = np.dstack([coloring(image), opaque])
        path = [*parts, "layers", layer]
        # Rerun drops dimensions of size 1 from arrays.
        size = {"width": image.shape[1], "height": image.shape[0]}
        colors = rr.Image(
            **size,
            bytes=picture.tobytes(),
            color_model="RGBA",
            datatype="U8",
            magnification_filter="nearest",
        )
        self._log([*path, "color"], colors)
        values_over_it = rr.Image(
            **size,
            bytes=image.tobytes(),
            color_model="L",
            datatype="F32",
            opacity=0.0,
            draw_order=1.0,
        )
        self._log(path, values_over_it)
        count = number_of_finites(values)
        missing = 100.0 * (1.0 - count / values.size)
        self._log([*parts, "missing", layer], rr.Scalars(missing))
        if coloring.mode != "intensity":
            return
        if count:
            three = [one(values) for one in (min_of_finites, mean_of_finites, max_of_finites)]
            names = [f"{layer} {name}" for name in ("min", "mean", "max")]
            color = _CURVES[self._maps["/".join(parts)].index(layer) % len(_CURVES)]
            lines = rr.SeriesLines(names=names, colors=[color] * 3, widths=[1.0, 2.5, 1.0])
            self._log([*parts, "range", layer], rr.Scalars(three), lines)
        else:
            self._log([*parts, "range", layer], rr.Clear(recursive=False))
        lower, upper = bounds = coloring.bounds(values)
        steps = np.linspace(lower, upper if upper > lower else lower + 1.0, 256, dtype=np.float32)
        bar = np.tile(coloring(steps), (10, 1, 1))
        self._log([*parts, "legend", layer, "bar"], rr.Image(bar, "RGB"))
        without = is_empty(coloring, values)
        ends = ["" if without else f"{bound:.4g}" for bound in bounds]
        labels = [ends[0], titled(layer, is_empty=without), ends[1]]
        places = [(0.0, 10.0), (128.0, 10.0), (256.0, 10.0)]
        look = {"radii": 0.5, "colors": (128, 128, 128), "show_labels": True}
        self._log([*parts, "legend", layer], rr.Points2D(places, labels=labels, **look))

    def _place(
        self, frame: str, position: npt.NDArray[np.float64] | None = None
    ) -> tuple[str, npt.NDArray[np.float64]]:
        """Return a Rerun frame near the maps, and the position of its origin in `frame` [m]."""
        name, is_new = frame or _NO_FRAME, frame not in self._origins
        if is_new and position is not None:
            self._origins[frame] = _FAR * np.round(position / _FAR)
        origin = self._origins.get(frame, np.zeros(3))
        if not origin.any():
            return name, origin
        near = f"{name} at {origin[0]:.0f}, {origin[1]:.0f}"
        if is_new:
            frames = {"parent_frame": name, "child_frame": near}
            self._log(["tf", near], self._rr.Transform3D(translation=origin, **frames), static=True)
        return near, origin

    def _content(self) -> object:
        """Return the state on which the layout depends, to detect changes."""
        maps = {name: tuple(layers) for name, layers in self._maps.items()}
        flags = self._has_milliseconds, self._first is None, self._is_repeated
        return maps, {**self._messages}, flags

    def _surface_views(self) -> Any:
        """Return one 3-D view per layer, colored by that layer, with the color bars below."""
        rrb = self._rrb
        chosen = [
            self._style.color_layer or self._style.heights_of(layers)
            for layers in self._maps.values()
        ]
        layers = dict.fromkeys([*chosen, *(one for some in self._maps.values() for one in some)])
        if not layers:
            return self._surface_view("3-D", "")
        tabs = []
        for layer in layers:
            legends = [
                rrb.Spatial2DView(
                    origin=_path(name, "legend", layer),
                    name=f"legend of {layer}",
                    visual_bounds=rrb.VisualBounds2D(x_range=[-40, 296], y_range=[-6, 36]),
                )
                for name, some in self._maps.items()
                if layer in some and not layer.endswith("color")
            ]
            row = [rrb.Horizontal(*legends)] if legends else []
            views = self._surface_view(layer, layer), *row
            tabs.append(rrb.Vertical(*views, row_shares=[8, 1][: len(views)], name=layer))
        return rrb.Tabs(*tabs, active_tab=0) if len(tabs) > 1 else tabs[0]

    def _surface_view(self, name: str, color_layer: str) -> Any:
        rrb = self._rrb
        surfaces = {_path(one, "surface"): layers for one, layers in self._maps.items()}
        encodings, past = rerun("rerun.blueprint.encodings"), rerun("rerun.encodings")
        mapping = encodings.VisualizerComponentMapping(
            "Mesh3D:vertex_colors",
            encodings.ComponentSourceKind.SourceComponent,
            source_component=f"{color_layer}:colors",
        )
        overrides = {
            path: self._rr.Mesh3D.from_fields().visualizer(mappings=[mapping])
            for path, layers in surfaces.items()
            if color_layer in layers
        }
        until_now = past.VisibleTimeRange(
            "ros_time",
            start=past.TimeRangeBoundary.infinite(),
            end=past.TimeRangeBoundary.cursor_relative(),
        )
        overrides |= {
            _path(topic, "trail"): rrb.VisibleTimeRanges(until_now)
            for topic, kind in self._messages.items()
            if kind in POSES
        }
        target, eye = next(iter(self._origins), _NO_FRAME), {}
        if self._first is not None:
            target = _VIEW
            center, reach = self._first
            eye["eye_controls"] = rrb.EyeControls3D(
                position=center + reach * np.array([-0.4, -0.7, 0.55]),
                look_target=center,
                eye_up=[0.0, 0.0, 1.0],
                # The camera follows the map, which may move with a robot.
                tracking_entity=next(iter(surfaces)),
            )
        return rrb.Spatial3DView(
            origin="/",
            name=name,
            contents=[*surfaces, *(f"{_path(topic)}/**" for topic in self._messages)],
            overrides=overrides,
            spatial_information=rrb.SpatialInformation(target, show_axes=True),
            line_grid=rrb.LineGrid3D(visible=True, spacing=1.0),
            **eye,
        )


def _parts(name: str) -> list[str]:
    return [part for part in re.split("/+", name) if part] or ["map"]


def _path(name: str, *parts: str) -> str:
    path: str = rerun().new_entity_path([*_parts(name), *parts])
    return path


def _normals(mesh: Mesh) -> npt.NDArray[np.float32]:
    """Return unit vertex normals (N, 3): averages over the adjacent faces, weighted by area."""
    # Differences of large heights would overflow float32.
    corners = mesh.vertices.astype(np.float64)[mesh.faces]
    faces = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    every = mesh.faces.ravel()
    sums = [
        np.bincount(every, np.repeat(faces[:, axis], 3), len(mesh.vertices)) for axis in range(3)
    ]
    # Make normals of vertices without faces point upwards; 1e-150 squared does not underflow.
    normals = np.stack(sums, axis=-1) + [0.0, 0.0, 1e-150]
    unit: npt.NDArray[np.float64] = normals / np.linalg.norm(normals, axis=-1, keepdims=True)
    return unit.astype(np.float32)
