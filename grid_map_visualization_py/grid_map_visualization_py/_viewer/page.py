# Copyright (c) 2026 grid_map_py contributors
# SPDX-License-Identifier: BSD-3-Clause
"""The page in the browser: scene, controls and texts, served by viser.

All browsers share the controls; each has its own view.
"""

import contextlib
import io
import ipaddress
import socket
from collections import deque
from collections.abc import Iterator
from typing import Any, cast

import cv2
import numpy as np

from grid_map_core_py.arrays import Positions
from grid_map_core_py.errors import GridMapError, MissingPackageError

from ..colors import Coloring, ColorScale, color_map_names
from .scene import Scene, View
from .settings import Settings
from .slots import Slots
from .texts import as_note, legend

REMEDY = "install viser (pip)"

FIRST_COLOR_MAPS = ("viridis", "turbo", "terrain", "BrBG", "coolwarm", "gray")
"""Color maps at the top of the list."""

MODES = {"layer": "intensity", "packed color layer": "color", "one color": "flat"}
"""Modes of `Coloring` by their names on the page."""

NO_LAYER = "(no map yet)"
NO_VECTORS = "(none)"
GRID_COLOR, VECTOR_COLOR, MARKER_COLOR = (0, 0, 0), (0, 160, 0), (255, 0, 200)

AMBIENT = 0.3
"""Share of ambient light on level ground."""

TO_SUN = (-1.0, 0.6, 1.2)
"""Direction to the directional light."""

SHADOWLESS = {"cast_shadow": False, "receive_shadow": False}


class PageError(GridMapError):
    """The page cannot be served."""


class Page:
    """Serves the page.

    Args:
        host: host name or IP address at which the page is served.
        port: port of the page; 0 for any free one.
        first: initial settings.

    Attributes:
        url: address of the page.

    Raises:
        MissingPackageError: viser is not installed.
        PageError: the page cannot be served at this address.
    """

    def __init__(self, host: str, port: int, first: Settings) -> None:
        self._server = _serve(host, port)
        self.url = url_of(host, self._server.get_port())
        self._slots = Slots()
        self._places: dict[int, Place] = {}
        self._clicks: deque[tuple[Positions, Positions]] = deque(maxlen=1)
        self._marker: Any = None
        self._view: View | None = None
        self._aim: View | None = None
        self._prepare_scene()
        self._make_controls(first)

    @property
    def is_watched(self) -> bool:
        return bool(self._server.get_clients())

    @property
    def is_paused(self) -> bool:
        return bool(self._paused.value)

    @property
    def height_layer(self) -> str:
        return str(self._height_layer.value)

    @property
    def color_layer(self) -> str:
        return str(self._color_layer.value)

    @property
    def vectors(self) -> str:
        """Chosen prefix of the vectors; empty for none."""
        return "" if self._vectors.value == NO_VECTORS else str(self._vectors.value)

    def settings(self) -> Settings:
        """Return the settings that the user has chosen.

        Raises:
            ConfigError: the bounds of the colors are not in order.
        """
        is_automatic = self._automatic.value
        scale = ColorScale(
            color_map=self._color_map.value,
            lower=None if is_automatic else self._lower.value,
            upper=None if is_automatic else self._upper.value,
            invert=self._inverted.value,
        )
        red, green, blue = self._color.value
        return Settings(
            height_layer=self.height_layer,
            flat=self._flat.value,
            coloring=Coloring(
                mode=cast("Any", MODES[self._mode.value]),
                layer=self.color_layer,
                scale=scale,
                color=red << 16 | green << 8 | blue,
            ),
            shaded=self._shaded.value,
            opacity=self._opacity.value,
            grid_lines=self._grid_lines.value,
            points=self._points.value,
            vectors=self.vectors,
            vector_scale=self._vector_scale.value,
            history=self._history.value,
        )

    def offer(
        self,
        layers: tuple[str, ...],
        prefixes: list[str],
        *,
        height_layer: str,
        color_layer: str,
        vectors: str,
    ) -> None:
        """Fill the lists of layers and vector prefixes, and select the given ones."""
        _offer(self._height_layer, layers, height_layer)
        _offer(self._color_layer, layers, color_layer)
        _offer(self._vectors, (NO_VECTORS, *prefixes), vectors or NO_VECTORS)

    def load(self, scene: Scene, settings: Settings, *, replaces: bool) -> None:
        """Load a scene, which the next `turn` shows.

        Args:
            scene: the scene.
            settings: settings of the scene.
            replaces: the scene shows the same map as the one before.
        """
        slot = self._slots.load(replaces=replaces)
        with self._server.atomic():
            if slot not in self._places:
                self._places[slot] = Place(self._server.scene, f"/maps/{slot}")
            self._places[slot].fill(scene)
        bar = legend(settings.coloring.scale, scene.bounds) if scene.bounds else ""
        _set(self._legend, "content", bar)

    def turn(self, history: int) -> None:
        """Show the loaded scene, and keep at most `history` maps."""
        free = self._slots.turn(history)
        with self._server.atomic():
            for slot in self._slots.shown:
                self._places[slot].frame.visible = True
            for slot in free:
                self._places[slot].frame.visible = False
            # One more slot is loading; higher ones are unused.
            last = max([history, *self._slots.shown])
            for slot in [slot for slot in self._places if slot > last]:
                self._places.pop(slot).frame.remove()

    def look(self, view: View) -> None:
        """Set the view of new browsers and of the button that resets the view.

        Browsers that would lose sight of the map move to the view at once.
        """
        if self._view is None or not view.is_like(self._view):
            self._view = view
            camera = self._server.initial_camera
            _set_clipping(camera, view)
            camera.look_at, camera.position = view.target, view.start
        if self._aim is None or self._aim.loses(view):
            self._take_all(view)
            self._aim = view

    def take_click(self) -> tuple[Positions, Positions] | None:
        """Return start and direction of the ray of the last click, and forget it."""
        return self._clicks.pop() if self._clicks else None

    def mark(self, point: Positions | None) -> None:
        """Move the marker to a point (3,); None removes it."""
        if self._marker is not None:
            self._marker.remove()
            self._marker = None
        if point is not None and self._view is not None:
            self._marker = self._server.scene.add_icosphere(
                "/marker",
                radius=0.008 * self._view.reach,
                color=MARKER_COLOR,
                position=point,
                **SHADOWLESS,
            )

    def tell(self, status: str) -> None:
        """Show the HTML text about the map."""
        _set(self._status, "content", status)

    def tell_values(self, readout: str) -> None:
        """Show the HTML text about the clicked cell."""
        _set(self._readout, "content", readout)

    def close(self) -> None:
        """Stop serving the page."""
        with _silence():
            self._server.stop()

    def _take_all(self, view: View) -> None:
        """Move all browsers to a view; each keeps its viewing angle."""
        factor = view.reach / self._aim.reach if self._aim else 1.0
        for client in self._server.get_clients().values():
            camera = client.camera
            offset = factor * (camera.position - camera.look_at) if self._aim else view.offset
            with client.atomic():
                _set_clipping(camera, view)
                # Setting the position also moves the target.
                camera.position = view.target + offset
                camera.look_at = view.target

    def _prepare_scene(self) -> None:
        scene = self._server.scene
        scene.configure_default_lights(enabled=False)
        scene.configure_environment_map(None)
        # On level ground both lights sum to pi, because viser divides light by pi.
        scene.add_light_ambient("/lights/ambient", intensity=AMBIENT * np.pi)
        sun = (1 - AMBIENT) * np.linalg.norm(TO_SUN) / TO_SUN[2]
        scene.add_light_directional("/lights/sun", intensity=sun * np.pi, position=TO_SUN)
        scene.on_click()(self._remember_click)

    def _remember_click(self, event: Any) -> None:
        self._clicks.append((np.asarray(event.ray_origin), np.asarray(event.ray_direction)))

    def _make_controls(self, first: Settings) -> None:
        gui = self._server.gui
        gui.configure_theme(show_logo=False, show_share_button=False)
        gui.main_panel.dock_right()
        self._status = gui.add_html(as_note("No map has come yet."))
        self._paused = gui.add_checkbox("Pause", False)
        gui.add_button("Screenshot").on_click(_take_screenshot)
        with gui.add_folder("Cell"):
            self._readout = gui.add_html(as_note("Click on the map."))
        with gui.add_folder("Surface"):
            layer = first.height_layer or NO_LAYER
            self._height_layer = gui.add_dropdown("Height", (layer,))
            self._flat = gui.add_checkbox("Flat", first.flat)
            self._opacity = gui.add_slider("Opacity", 0.0, 1.0, 0.05, first.opacity)
            self._grid_lines = gui.add_checkbox("Grid lines", first.grid_lines)
            self._shaded = gui.add_checkbox("Shaded", first.shaded)
            self._history = gui.add_slider("History", 1, 10, 1, first.history)
        with gui.add_folder("Color"):
            self._make_color_controls(first.coloring)
        with gui.add_folder("Overlays"):
            self._points = gui.add_checkbox("Points", first.points)
            self._vectors = gui.add_dropdown("Vectors", (NO_VECTORS,))
            self._vector_scale = gui.add_number("Vector length", first.vector_scale, step=0.01)

    def _make_color_controls(self, coloring: Coloring) -> None:
        gui, scale = self._server.gui, coloring.scale
        modes = {mode: name for name, mode in MODES.items()}
        self._mode = gui.add_dropdown("Color by", tuple(MODES), initial_value=modes[coloring.mode])
        self._color_layer = gui.add_dropdown("Layer", (coloring.layer or NO_LAYER,))
        names = dict.fromkeys((*FIRST_COLOR_MAPS, *color_map_names()))
        self._color_map = gui.add_dropdown("Color map", tuple(names), initial_value=scale.color_map)
        self._inverted = gui.add_checkbox("Inverted", scale.invert)
        self._automatic = gui.add_checkbox("Automatic bounds", scale.lower is None)
        self._lower = gui.add_number("Lower bound", 0.0, step=0.01)
        self._upper = gui.add_number("Upper bound", 1.0, step=0.01)
        self._color = gui.add_rgb("One color", (192, 192, 192))
        self._legend = gui.add_html("")


class Place:
    """Node of the scene graph for one map, hidden at first.

    Args:
        scene: scene of viser.
        name: path of the node in the scene.

    Attributes:
        frame: the node.
    """

    def __init__(self, scene: Any, name: str) -> None:
        self._scene = scene
        self._name = name
        self.frame = scene.add_frame(name, show_axes=False, visible=False)
        self._parts: dict[str, Any] = {}

    def fill(self, scene: Scene) -> None:
        """Replace the content by a scene."""
        self.frame.position = scene.mesh.origin
        parts = dict(self._parts_of(scene))
        for name in [name for name in self._parts if name not in parts]:
            self._parts.pop(name).remove()
        self._parts = parts

    def _parts_of(self, scene: Scene) -> Iterator[tuple[str, Any]]:
        # Widths and sizes are relative to the distance between cells.
        add, width = self._scene, 0.05 * scene.spacing
        if scene.glb is not None:
            yield "surface", add.add_glb(f"{self._name}/surface", scene.glb, **SHADOWLESS)
        for name, lines, color in (
            ("grid_lines", scene.grid_lines, GRID_COLOR),
            ("vectors", scene.vectors, VECTOR_COLOR),
        ):
            if len(lines):
                path = f"{self._name}/{name}"
                yield name, add.add_line_segments(path, lines, color, thickness=width)
        if len(scene.points):
            style = {"point_size": 0.3 * scene.spacing, "point_shape": "circle"}
            path, colors = f"{self._name}/points", scene.point_colors
            points = add.add_point_cloud(path, scene.points, colors, precision="float32", **style)
            yield "points", points


def is_loopback(host: str) -> bool:
    """Return True if an address is reachable from this machine only."""
    if host == "localhost":
        return True
    try:
        return ipaddress.ip_address(host).is_loopback
    except ValueError:
        return False


def url_of(host: str, port: int) -> str:
    """Return the URL of a page; for wildcard addresses, with the name of this machine."""
    name = socket.gethostname() if host in {"", "0.0.0.0", "::"} else host
    return f"http://[{name}]:{port}" if ":" in name else f"http://{name}:{port}"


def _serve(host: str, port: int) -> Any:
    try:
        import viser
    except ImportError as error:
        raise MissingPackageError("viser", "web_viewer", REMEDY) from error
    try:
        # Without this check, viser would silently use the next free port.
        for family, *_, address in socket.getaddrinfo(
            host, port, type=socket.SOCK_STREAM, flags=socket.AI_PASSIVE
        ):
            socket.create_server(address[:2], family=family).close()
        with _silence():
            server = viser.ViserServer(host, port, label="Grid map", verbose=False)
            if port not in {0, server.get_port()}:
                server.stop()
                raise OSError("another program was faster")
    except (OSError, OverflowError) as error:
        raise PageError(
            f"the page cannot be served at {host}:{port}: {error}; "
            "the parameters 'host' and 'port' choose another address"
        ) from error
    return server


@contextlib.contextmanager
def _silence() -> Iterator[None]:
    """Suppress what viser prints, because nodes use the log."""
    with contextlib.redirect_stdout(io.StringIO()):
        yield


def _set_clipping(camera: Any, view: View) -> None:
    camera.near, camera.far = view.reach / 1000, 100 * view.reach


def _offer(dropdown: Any, options: tuple[str, ...], chosen: str) -> None:
    if dropdown.options != options:
        dropdown.options = options
    dropdown.value = chosen


def _set(element: Any, name: str, value: object) -> None:
    if getattr(element, name) != value:
        setattr(element, name, value)


def _take_screenshot(event: Any) -> None:
    """Send the browser a picture of its current view."""
    client = event.client
    if client is None:
        return
    camera = client.camera
    picture = client.get_render(
        camera.image_height, camera.image_width, transport_format="png", timeout=60.0
    )
    # From RGBA to OpenCV's BGR, on white.
    opacity = picture[..., 3:] / 255
    on_white = picture[..., 2::-1] * opacity + 255 * (1 - opacity)
    _, data = cv2.imencode(".png", on_white.round().astype(np.uint8))
    client.send_file_download("grid_map.png", data.tobytes(), save_immediately=True)
