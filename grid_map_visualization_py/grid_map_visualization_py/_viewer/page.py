# SPDX-License-Identifier: BSD-3-Clause
"""Web page with a scene and controls. Browsers share the controls, but not the view."""

import io
from collections import deque
from collections.abc import Callable, Container, Iterable, Sequence
from contextlib import redirect_stdout, suppress
from http import HTTPStatus
from itertools import count
from typing import Any

import cv2
import numpy as np
import numpy.typing as npt
from scipy.spatial.transform import Rotation

from grid_map_core_py._arrays import Positions
from grid_map_core_py._packages import remedy_for
from grid_map_core_py.errors import required

from .._layers import titled
from .._web import PageError, is_allowed, is_loopback, listen, names_of, url_of
from ..colors import DEFAULT_COLOR_MAP, Coloring, color_map_names
from ..surface import Mesh
from .axes import axes_around
from .glb import to_glb
from .scene import EMPTY, Drawing, SurfaceScene, View, ViewSettings
from .texts import as_note, legend

LARGEST_MESSAGE = 16_000_000
"""Maximum size of a message, such as a screenshot [bytes]. A larger message ends the connection."""

FIRST_COLOR_MAPS = ("viridis", "turbo", "terrain", "BrBG", "coolwarm", "gray")
"""Color maps at the top of the drop-down list."""

MODES: dict[str, Any] = {"layer": "intensity", "packed color layer": "color", "one color": "flat"}
"""Modes of `Coloring`, by label on the page."""

LARGEST_VALUE, LARGEST_SCALE = 3e38, 1e9
"""Largest magnitude that users can enter for color bounds (within float32) and vector scale."""

MOST_EXAGGERATED = 20.0
"""Maximum factor by which drawn heights are scaled."""

NO_LAYER = "(no map yet)"
NO_TOPIC = "(no topic)"
NO_VECTORS = "(none)"
GRID_COLOR, VECTOR_COLOR, MARKER_COLOR = (0, 0, 0), (0, 160, 0), (255, 0, 200)
PATH_COLOR = MARKER_COLOR
LINE_WIDTH = 4.0
"""Width of the lines of drawings [pixels]."""

AXES_COLOR = (128, 128, 128)
"""Gray, visible on white and on black backgrounds."""

FRAME_SIZE = 0.08
"""Axis length of a drawn coordinate frame, as a fraction of the initial distance to the camera."""

AMBIENT = 0.3
"""Fraction of the light on level ground that is ambient; the rest is sunlight."""

TO_SUN = (-1.0, 0.6, 1.2)
"""Vector towards the sun (x, y, z), of any length."""

SHADOWLESS = {"cast_shadow": False, "receive_shadow": False}


class Page:
    """Web page that shows maps and provides controls."""

    def __init__(
        self,
        host: str,
        port: int,
        height_layer: str,
        color_layer: str = "",
        color_map: str = DEFAULT_COLOR_MAP,
        allowed_hosts: Sequence[str] = (),
        topic: str = NO_TOPIC,
    ) -> None:
        mode: Any = "color" if color_layer.endswith("color") else "intensity"
        coloring = Coloring(mode, color_layer, color_map)
        self._server = _serve(host, port, names_of(host, allowed_hosts))
        self.url = url_of(host, self._server.get_port())
        self.is_public = not is_loopback(host)
        self._axes: Any = None
        self._drawn_axes: object = None
        # Scene node, label and size of each coordinate frame.
        self._frames: dict[str, tuple[Any, Any]] = {}
        # Drawing and scene node, by name.
        self._drawings: dict[str, tuple[Drawing, Any]] = {}
        self._shown: list[Any] = []
        # Scene parts of each map, by name of the map node.
        self._parts: dict[str, list[Any]] = {}
        self._exaggeration, self._base = 1.0, 0.0
        self._loading: Any = None
        self._replaces = False
        self._clicks: deque[tuple[Positions, Positions]] = deque(maxlen=1)
        self._marker: Any = None
        self._marked: Positions | None = None
        self._scene: SurfaceScene | None = None
        self._view: View | None = None
        self._aim: View | None = None
        scene = self._server.scene
        scene.configure_default_lights(enabled=False)
        scene.configure_environment_map(None)
        # On level ground, the intensities add up to pi, because viser divides them by pi.
        scene.add_light_ambient("/lights/ambient", intensity=AMBIENT * np.pi)
        sun = (1 - AMBIENT) * np.linalg.norm(TO_SUN) / TO_SUN[2]
        scene.add_light_directional("/lights/sun", intensity=sun * np.pi, position=TO_SUN)
        self._make_controls(ViewSettings(height_layer=height_layer, coloring=coloring), topic)

    @property
    def is_watched(self) -> bool:
        return bool(self._server.get_clients())

    @property
    def is_paused(self) -> bool:
        return bool(self._paused.value)

    @property
    def topic(self) -> str:
        return str(self._topic.value)

    def settings(self) -> ViewSettings:
        """Return the selected settings; raise `ConfigError` if the color bounds are invalid."""
        chosen = {name: control.value for name, control in self._style.items()}
        colors = {name: control.value for name, control in self._colors.items()}
        if self._automatic.value:
            colors |= {"lower": None, "upper": None}
        red, green, blue = colors["color"]
        colors |= {"mode": MODES[colors["mode"]], "color": red << 16 | green << 8 | blue}
        if chosen["vectors"] == NO_VECTORS:
            chosen["vectors"] = ""
        return ViewSettings(coloring=Coloring(**colors), **chosen)

    def offer_topics(self, topics: Iterable[str]) -> None:
        """Set the topics in the drop-down list; the selected topic is always included."""
        _offer(self._topic, tuple(sorted({self.topic, *topics})), self.topic)

    def offer(self, layers: tuple[str, ...]) -> None:
        """Set the layers in the drop-down lists; select defaults if selected layers are missing."""
        heights = self._style["height_layer"]
        _offer(heights, layers, "elevation")
        _offer(self._colors["layer"], layers, heights.value)
        _offer(self._style["vectors"], (NO_VECTORS, *vector_prefixes(layers)), NO_VECTORS)

    def load(self, scene: SurfaceScene, settings: ViewSettings, *, replaces: bool) -> None:
        """Load a scene into the browsers, but leave it hidden until the next `turn`.

        If `replaces` is true, `turn` removes the previous scene; otherwise, `turn` keeps it in the
        history.
        """
        # A scene that was loaded but never shown is also replaced.
        self._replaces = replaces and (self._loading is None or self._replaces)
        with self._server.atomic():
            if self._loading is not None:
                self._loading.remove()
            self._loading = self._add(scene, settings)
        layer = settings.coloring.layer or settings.height_layer
        bounds = scene.bounds
        title = titled(layer, is_empty=bounds is not None and np.isnan(bounds[0]))
        self._legend.content = legend(settings.coloring, bounds, title) if bounds else ""
        self._scene = scene
        self._look(scene.view)

    def turn(self, history: int) -> None:
        """Show the loaded scene and its axes; remove all but the last `history` maps."""
        with self._server.atomic():
            self._exaggerate(self._base)
            if self._loading is not None:
                if self._replaces and self._shown:
                    self._shown.pop().remove()
                self._loading.visible = True
                self._shown.append(self._loading)
                self._loading = None
            while len(self._shown) > history:
                self._shown.pop(0).remove()
            if not history:
                self.mark(None)
                self._scene, self._legend.content = None, ""
            axes = None
            if self._scene is not None and self._has_axes.value:
                axes = axes_around(*self._scene.box, self._exaggeration)
            wanted = axes and (axes, self._exaggeration, self._base)
            if wanted == self._drawn_axes:
                return
            self._drawn_axes = wanted
            if self._axes is not None:
                self._axes.remove()
                self._axes = None
            if axes is None:
                return
            add, lift = self._server.scene, np.array([1.0, 1.0, self._exaggeration])
            place = self._lifted(axes.corner)
            self._axes = add.add_frame("/axes", show_axes=False, position=place)
            style: Any = {"thickness": 1.5, "thickness_units": "screen"}
            add.add_line_segments("/axes/grid", axes.lines() * lift, AXES_COLOR, **style)
            style = {"depth_test": True}
            for k, (text, at, anchor) in enumerate(axes.labels()):
                add.add_label(f"/axes/{k}", text, position=lift * at, anchor=anchor, **style)

    def draw_frame(self, name: str, label: str, pose: npt.NDArray[np.floating] | None) -> None:
        """Draw a coordinate frame at a pose (4, 4) in the map frame; None hides the frame."""
        if self._view is None:
            return
        size = FRAME_SIZE * self._view.reach
        known, node = self._frames.get(name, (None, None))
        if known != (label, size):
            # A new node replaces the node with the same name.
            add = self._server.scene
            node = add.add_frame(f"/{name}", axes_length=size, axes_radius=0.06 * size)
            add.add_label(f"/{name}/label", label, anchor="bottom-left")
            self._frames[name] = ((label, size), node)
        node.visible = pose is not None and self._has_frames.value
        if pose is not None:
            node.position = self._lifted(pose[:3, 3])
            node.wxyz = np.roll(Rotation.from_matrix(pose[:3, :3]).as_quat(), 1)

    def draw(self, name: str, drawing: Drawing) -> None:
        """Draw lines and triangles in the map frame; they replace the drawing of the same name."""
        lines, triangles = self._lifted(drawing.lines), self._lifted(drawing.triangles)
        drawing = drawing._replace(lines=lines, triangles=triangles)
        before, node = self._drawings.get(name, (EMPTY, None))
        pairs: Any = zip(before, drawing, strict=True)
        if all(np.array_equal(old, new) for old, new in pairs):
            return
        if node is not None:
            node.remove()
        self._drawings[name] = drawing, None
        starts = np.concatenate([lines[:1, 0], triangles[:1, 0]])
        if not len(starts):
            return
        add, start = self._server.scene, starts[0]
        node = add.add_frame(f"/{name}", show_axes=False, position=start)
        self._drawings[name] = drawing, node
        if len(lines):
            points, style = (lines - start).astype(np.float32), {"thickness": LINE_WIDTH}
            options: Any = {**style, "thickness_units": "screen"}
            add.add_line_segments(f"/{name}/lines", points, drawing.line_colors, **options)
        if len(triangles):
            vertices = (triangles - start).astype(np.float32).reshape(-1, 3)
            faces = np.arange(len(vertices), dtype=np.uint32).reshape(-1, 3)
            mesh = Mesh(start, vertices, faces, drawing.triangle_colors.reshape(-1, 3))
            glb = to_glb(mesh, shaded=False, opacity=drawing.opacity)
            add.add_glb(f"/{name}/triangles", glb, **SHADOWLESS)

    def take_click(self) -> tuple[Positions, Positions] | None:
        """Return and clear the ray (start, direction) of the last click, or None."""
        if not self._clicks:
            return None
        start, direction = self._clicks.pop()
        base, flat = np.array([0.0, 0.0, self._base]), np.array([1.0, 1.0, 1 / self._exaggeration])
        return base + (start - base) * flat, direction * flat

    def mark(self, point: Positions | None) -> None:
        """Move the marker to a point (3,); None removes the marker."""
        if self._marker is not None:
            self._marker.remove()
            self._marker = None
        self._marked = point
        if point is not None and self._view is not None:
            self._marker = self._server.scene.add_icosphere(
                "/marker",
                radius=0.008 * self._view.reach,
                color=MARKER_COLOR,
                position=self._lifted(point),
                **SHADOWLESS,
            )

    def tell(self, status: str) -> None:
        self._status.content = status

    def tell_values(self, readout: str) -> None:
        self._readout.content = readout

    def close(self) -> None:
        with redirect_stdout(io.StringIO()):
            self._server.stop()

    def _add(self, scene: SurfaceScene, settings: ViewSettings) -> Any:
        # viser stores every node name for new browsers, so names are reused.
        taken = {frame.name for frame in self._shown}
        name = next(name for name in map("/maps/{}".format, count()) if name not in taken)
        add, mesh = self._server.scene, scene.mesh
        place = self._lifted(mesh.origin)
        frame = add.add_frame(name, show_axes=False, visible=False, position=place)
        parts = self._parts[name] = []
        scale: Any = {"scale": (1.0, 1.0, self._exaggeration)}
        if scene.glb is not None:
            parts.append(add.add_glb(f"{name}/surface", scene.glb, **SHADOWLESS, **scale))
        # Line widths and point sizes are proportional to the cell spacing.
        width = 0.05 * scene.spacing
        for part, lines, color in (
            ("grid_lines", scene.grid_lines, GRID_COLOR),
            ("vectors", scene.vectors, VECTOR_COLOR),
        ):
            if len(lines):
                options: Any = {"thickness": width, **scale}
                parts.append(add.add_line_segments(f"{name}/{part}", lines, color, **options))
        if settings.points and len(mesh.vertices):
            points = add.add_point_cloud(
                f"{name}/points",
                mesh.vertices,
                mesh.colors,
                point_size=0.3 * scene.spacing,
                point_shape="circle",
                precision="float32",
                **scale,
            )
            parts.append(points)
        return frame

    def _lifted(self, points: npt.NDArray[np.floating]) -> Positions:
        """Return points (..., 3) with their heights scaled by the exaggeration."""
        lifted = np.array(points, np.float64)
        lifted[..., 2] = self._base + self._exaggeration * (lifted[..., 2] - self._base)
        return lifted

    def _exaggerate(self, base: float) -> None:
        """Scale all drawn heights above `base` [m] by the selected factor."""
        before = self._exaggeration, self._base
        self._exaggeration, self._base = float(self._factor.value), base
        if before == (self._exaggeration, base):
            return
        for frame in (*self._shown, *filter(None, [self._loading])):
            frame.position = self._lifted(np.append(frame.position[:2], 0.0))
            for part in self._parts[frame.name]:
                part.scale = (1.0, 1.0, self._exaggeration)
        self.mark(self._marked)

    def _look(self, view: View) -> None:
        """Set the initial view for new browsers and for the reset button.

        If the map is out of sight or much larger or smaller than before, all cameras move to it.
        """
        is_lost = self._aim is None or self._aim.loses(view)
        if is_lost:
            # With this base, the map stays centered at any exaggeration.
            self._exaggerate(float(view.target[2]))
        view = View(self._lifted(view.target) + view.offset, self._lifted(view.target))
        if self._view is None or not view.is_like(self._view):
            self._view = view
            camera = self._server.initial_camera
            _set_clipping(camera, view)
            camera.look_at, camera.position = view.target, view.start
        if not is_lost:
            return
        for client in self._server.get_clients().values():
            offset = view.offset
            if self._aim is not None:
                factor = view.reach / self._aim.reach
                offset = factor * (client.camera.position - client.camera.look_at)
            self._move(client, view, offset)
        self._aim = view

    def _move(self, client: Any, view: View, offset: Positions) -> None:
        camera = client.camera
        with client.atomic():
            _set_clipping(camera, view)
            # Setting the camera position also moves the target.
            camera.position = view.target + offset
            camera.look_at = view.target

    def _use_theme(self, _: Any = None) -> None:
        dark: Any = {"dark_mode": self._dark.value}
        self._server.gui.configure_theme(show_logo=False, show_share_button=False, **dark)

    def _make_controls(self, first: ViewSettings, topic: str) -> None:
        gui, coloring = self._server.gui, first.coloring

        def number(label: str, value: float, most: float) -> Any:
            return gui.add_number(label, value, min=-most, max=most, step=0.01)

        gui.main_panel.dock_right()
        self._topic = gui.add_dropdown("Topic", (topic,))
        self._status = gui.add_html(as_note("No map has arrived yet."))
        self._legend = gui.add_html("")
        self._factor = gui.add_slider("Exaggeration", 1.0, MOST_EXAGGERATED, 0.5, 1.0)
        self._paused = gui.add_checkbox("Pause", False)

        def look_from_above(event: Any) -> None:
            if self._view is not None:
                # Exactly above the map, the up direction of the screen would be undefined.
                offset = self._view.reach * np.array([0.0, -1e-3, 1.0])
                self._move(event.client, self._view, offset)

        gui.add_button("Top view").on_click(look_from_above)

        def send_screenshot(event: Any) -> None:
            client, camera = event.client, event.client.camera
            size = camera.image_height, camera.image_width
            with suppress(Exception):  # The browser may disconnect while it renders.
                picture = client.get_render(*size, transport_format="png", timeout=60.0)
                # Convert RGBA to BGR (OpenCV) on a white background.
                opacity = picture[..., 3:] / 255
                on_white = picture[..., 2::-1] * opacity + 255 * (1 - opacity)
                _, data = cv2.imencode(".png", on_white.round().astype(np.uint8))
                client.send_file_download("grid_map.png", data.tobytes(), save_immediately=True)

        gui.add_button("Screenshot").on_click(send_screenshot)
        self._cell = gui.add_panel()
        with self._cell.add_tab("Cell"):
            self._readout = gui.add_html(as_note("Click on the map."))
        self._cell.float(x=15, y=-15, width=240)
        self._cell.minimize()

        def remember_click(event: Any) -> None:
            self._clicks.append((np.array(event.ray_origin), np.array(event.ray_direction)))
            self._cell.expand()

        self._server.scene.on_click()(remember_click)
        with gui.add_folder("Surface", expand_by_default=False):
            # The keys are field names of `ViewSettings`.
            self._style = {
                "height_layer": gui.add_dropdown("Height", (first.height_layer or NO_LAYER,)),
                "flat": gui.add_checkbox("Flat", first.flat),
                "opacity": gui.add_slider("Opacity", 0.0, 1.0, 0.05, first.opacity),
                "grid_lines": gui.add_checkbox("Grid lines", first.grid_lines),
                "shaded": gui.add_checkbox("Shaded", first.shaded),
                "history": gui.add_slider("History", 1, 10, 1, first.history),
            }
        with gui.add_folder("Color", expand_by_default=False):
            mode = next(name for name, mode in MODES.items() if mode == coloring.mode)
            # The list contains no reversed maps, such as `viridis_r`.
            names = dict.fromkeys((coloring.color_map, *FIRST_COLOR_MAPS, *color_map_names()))
            # The keys are field names of `Coloring`.
            self._colors = {
                "mode": gui.add_dropdown("Color by", tuple(MODES), initial_value=mode),
                "layer": gui.add_dropdown("Layer", (coloring.layer or NO_LAYER,)),
                "color_map": gui.add_dropdown(
                    "Color map", tuple(names), initial_value=coloring.color_map
                ),
                "invert": gui.add_checkbox("Inverted", False),
            }
            self._automatic = gui.add_checkbox("Automatic bounds", True)
            self._colors |= {
                "lower": number("Lower bound", 0.0, LARGEST_VALUE),
                "upper": number("Upper bound", 1.0, LARGEST_VALUE),
                "color": gui.add_rgb("One color", (192, 192, 192)),
            }

            def use_bounds(_: Any) -> None:
                # Browsers send only the last of all changes within 50 ms. If the user clears the
                # checkbox and immediately types a bound, the change of the checkbox is lost.
                self._automatic.value = False

            for name in ("lower", "upper"):
                self._colors[name].on_update(use_bounds)
        with gui.add_folder("Overlays", expand_by_default=False):
            self._has_axes = gui.add_checkbox("Axes", True)
            self._has_frames = gui.add_checkbox("Frames", True)
            self._dark = gui.add_checkbox("Dark", False)
            self._dark.on_update(self._use_theme)
            self._style |= {
                "points": gui.add_checkbox("Points", first.points),
                "vectors": gui.add_dropdown("Vectors", (NO_VECTORS,)),
                "vector_scale": number("Vector length", first.vector_scale, LARGEST_SCALE),
            }
        self._use_theme()


def vector_prefixes(layers: Sequence[str]) -> list[str]:
    """Return the prefixes for which layers with the suffixes x, y and z exist."""
    prefixes = (name.removesuffix("x") for name in layers if name.endswith("x"))
    # An empty prefix is ignored, because layers called x, y and z are probably positions.
    return [name for name in prefixes if name and name + "y" in layers and name + "z" in layers]


def _serve(host: str, port: int, names: Container[str]) -> Any:
    """Start a viser server that answers only requests from its own page."""
    viser, websockets = (
        required(name, "web_viewer", remedy_for("viser"))
        for name in ("viser", "websockets.asyncio.server")
    )
    serve: Callable[..., Any] = websockets.serve
    is_guarded = False

    def serve_allowed(*args: Any, process_request: Any, **options: Any) -> Any:
        nonlocal is_guarded
        is_guarded = True

        def check_first(connection: Any, request: Any) -> Any:
            if is_allowed(request.headers, names):
                return process_request(connection, request)
            text = "This host name is not allowed, or the request comes from another web page.\n"
            return connection.respond(HTTPStatus.FORBIDDEN, text)

        guards = {"process_request": check_first, "max_size": LARGEST_MESSAGE}
        return serve(*args, **options | guards)

    # If the port is occupied, viser would silently use the next free port.
    listen(host, port).close()
    websockets.serve = serve_allowed
    try:
        # viser prints to the standard output, but nodes must log.
        with redirect_stdout(io.StringIO()):
            server = viser.ViserServer(host, port, label="Grid map", verbose=False)
            if not is_guarded:
                server.stop()
                why = "this version of viser cannot reject requests of other pages"
                raise PageError(f"the page cannot be served at {host}:{port}: {why}")
    finally:
        websockets.serve = serve
    return server


def _offer(dropdown: Any, options: tuple[str, ...], preferred: str) -> None:
    """Replace the options of a list; keep the selection if possible, or select `preferred`."""
    chosen = next((name for name in (dropdown.value, preferred) if name in options), options[0])
    if dropdown.options != options:
        dropdown.options = options
    dropdown.value = chosen


def _set_clipping(camera: Any, view: View) -> None:
    camera.near, camera.far = view.reach / 1000, 100 * view.reach
