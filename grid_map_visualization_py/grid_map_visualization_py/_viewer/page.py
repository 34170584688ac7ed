# Copyright (c) 2026 grid_map_py contributors
# SPDX-License-Identifier: BSD-3-Clause
"""The page in the browser: scene, controls and texts, served by viser.

All browsers share the controls; each has its own view.
"""

import gc
import io
import ipaddress
import socket
from collections import deque
from collections.abc import Container, Sequence
from contextlib import redirect_stdout, suppress
from itertools import count
from typing import Any

import cv2
import numpy as np

from grid_map_core_py.arrays import Positions
from grid_map_core_py.errors import GridMapError, required

from ..colors import DEFAULT_COLOR_MAP, Coloring, color_map_names
from .gate import Gate
from .scene import Scene, Settings, View
from .texts import as_note, legend

FIRST_COLOR_MAPS = ("viridis", "turbo", "terrain", "BrBG", "coolwarm", "gray")
"""Color maps at the top of the list."""

MODES: dict[str, Any] = {"layer": "intensity", "packed color layer": "color", "one color": "flat"}
"""Modes of `Coloring` by their names on the page."""

LARGEST_VALUE, LARGEST_SCALE = 3e38, 1e9
"""Largest bound of the colors, which is a float32, and length of vectors, on either side of 0."""

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
        height_layer: layer of the heights at first.
        color_layer: layer of the colors at first, packed if its name ends in color; empty for the
            heights.
        color_map: color map at first.
        allowed_hosts: names under which browsers may open the page, besides IP addresses,
            `localhost`, `host` and the name of this machine, with or without `.local`.

    Attributes:
        url: address of the page.
        is_public: other machines can reach the page.

    Raises:
        ConfigError: there is no such color map.
        MissingPackageError: viser is not installed.
        PageError: the page cannot be served at this address.
    """

    def __init__(
        self,
        host: str,
        port: int,
        height_layer: str,
        color_layer: str = "",
        color_map: str = DEFAULT_COLOR_MAP,
        allowed_hosts: Sequence[str] = (),
    ) -> None:
        mode: Any = "color" if color_layer.endswith("color") else "intensity"
        coloring = Coloring(mode, color_layer, color_map)
        machine = socket.gethostname()
        names = {host, "localhost", machine, f"{machine}.local", *allowed_hosts}
        self._server, self._gate = _serve(host, port, {name.lower() for name in names})
        # A browser leaves cycles of references, which hold megabytes of messages.
        self._server.on_client_disconnect(lambda _: gc.collect())
        self.url = url_of(host, self._server.get_port())
        self.is_public = not is_loopback(host)
        self._shown: list[Any] = []
        self._loading: Any = None
        self._replaces = False
        self._clicks: deque[tuple[Positions, Positions]] = deque(maxlen=1)
        self._photographed: set[int] = set()
        self._marker: Any = None
        self._view: View | None = None
        self._aim: View | None = None
        self._prepare_scene()
        self._make_controls(Settings(height_layer=height_layer, coloring=coloring))

    @property
    def is_watched(self) -> bool:
        return bool(self._server.get_clients())

    @property
    def is_paused(self) -> bool:
        return bool(self._paused.value)

    def take_refusals(self) -> list[str]:
        """Return why messages of browsers were refused since the last call."""
        refusals = self._gate.refusals
        return [refusals.popleft() for _ in range(len(refusals))]

    def settings(self) -> Settings:
        """Return the settings that the user has chosen.

        Raises:
            ConfigError: the bounds of the colors are not in order.
        """
        chosen = {name: control.value for name, control in self._style.items()}
        colors = {name: control.value for name, control in self._colors.items()}
        if self._automatic.value:
            colors |= {"lower": None, "upper": None}
        red, green, blue = colors["color"]
        colors |= {"mode": MODES[colors["mode"]], "color": red << 16 | green << 8 | blue}
        if chosen["vectors"] == NO_VECTORS:
            chosen["vectors"] = ""
        return Settings(coloring=Coloring(**colors), **chosen)

    def offer(self, layers: tuple[str, ...]) -> None:
        """Offer these layers in the lists; chosen ones that are missing are replaced."""
        heights = self._style["height_layer"]
        _offer(heights, layers, "elevation")
        _offer(self._colors["layer"], layers, heights.value)
        _offer(self._style["vectors"], (NO_VECTORS, *vector_prefixes(layers)), NO_VECTORS)

    def load(self, scene: Scene, settings: Settings, *, replaces: bool) -> None:
        """Load a scene, which the next `turn` shows.

        A browser needs a moment to load a surface, which is hidden meanwhile, so that no gap is
        visible.

        Args:
            scene: the scene.
            settings: settings of the scene.
            replaces: the scene shows the same map as the one before.
        """
        # A map that was loaded but never shown is replaced as well.
        self._replaces = replaces and (self._loading is None or self._replaces)
        with self._server.atomic():
            if self._loading is not None:
                self._loading.remove()
            self._loading = self._add(scene, settings)
        coloring = settings.coloring
        self._legend.content = legend(coloring, scene.bounds) if scene.bounds else ""
        self._look(scene.view)

    def turn(self, history: int) -> None:
        """Show the loaded scene, and keep at most `history` maps."""
        with self._server.atomic():
            if self._loading is not None:
                if self._replaces and self._shown:
                    self._shown.pop().remove()
                self._loading.visible = True
                self._shown.append(self._loading)
                self._loading = None
            while len(self._shown) > history:
                self._shown.pop(0).remove()

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
        self._status.content = status

    def tell_values(self, readout: str) -> None:
        """Show the HTML text about the clicked cell."""
        self._readout.content = readout

    def close(self) -> None:
        """Stop serving the page."""
        with redirect_stdout(io.StringIO()):
            self._server.stop()

    def _add(self, scene: Scene, settings: Settings) -> Any:
        """Add a hidden node with the content of a scene."""
        # The server remembers every name for browsers to come, so names are used again.
        taken = {frame.name for frame in self._shown}
        name = next(name for name in map("/maps/{}".format, count()) if name not in taken)
        add, mesh = self._server.scene, scene.mesh
        frame = add.add_frame(name, show_axes=False, visible=False, position=mesh.origin)
        if scene.glb is not None:
            add.add_glb(f"{name}/surface", scene.glb, **SHADOWLESS)
        # Widths and sizes are relative to the distance between cells.
        width = 0.05 * scene.spacing
        for part, lines, color in (
            ("grid_lines", scene.grid_lines, GRID_COLOR),
            ("vectors", scene.vectors, VECTOR_COLOR),
        ):
            if len(lines):
                add.add_line_segments(f"{name}/{part}", lines, color, thickness=width)
        if settings.points and len(mesh.vertices):
            add.add_point_cloud(
                f"{name}/points",
                mesh.vertices,
                mesh.colors,
                point_size=0.3 * scene.spacing,
                point_shape="circle",
                precision="float32",
            )
        return frame

    def _look(self, view: View) -> None:
        """Set the view of new browsers and of the button that resets the view.

        Browsers that would lose sight of the map move to the view at once, and keep their angle.
        """
        if self._view is None or not view.is_like(self._view):
            self._view = view
            camera = self._server.initial_camera
            _set_clipping(camera, view)
            camera.look_at, camera.position = view.target, view.start
        if self._aim is not None and not self._aim.loses(view):
            return
        for client in self._server.get_clients().values():
            try:
                self._move(client, view)
            except Exception as error:  # A browser may have no view that can be moved.
                self._gate.note("a view stays", error)
        self._aim = view

    def _move(self, client: Any, view: View) -> None:
        """Move the view of a browser."""
        camera, offset = client.camera, view.offset
        if self._aim is not None:
            factor = view.reach / self._aim.reach
            offset = factor * (camera.position - camera.look_at)
        with client.atomic():
            _set_clipping(camera, view)
            # Setting the position also moves the target.
            camera.position = view.target + offset
            camera.look_at = view.target

    def _take_screenshot(self, event: Any) -> None:
        """Send the browser a picture of its current view."""
        client = event.client
        # A browser that does not answer must not keep all threads waiting.
        if client.client_id in self._photographed:
            return
        self._photographed.add(client.client_id)
        try:
            camera = client.camera
            size = camera.image_height, camera.image_width
            picture = client.get_render(*size, transport_format="png", timeout=60.0)
            # From RGBA to OpenCV's BGR, on white.
            opacity = picture[..., 3:] / 255
            on_white = picture[..., 2::-1] * opacity + 255 * (1 - opacity)
            _, data = cv2.imencode(".png", on_white.round().astype(np.uint8))
            client.send_file_download("grid_map.png", data.tobytes(), save_immediately=True)
        except Exception as error:  # What a browser sends may be no such picture.
            self._gate.note("no screenshot", error)
        finally:
            self._photographed.discard(client.client_id)

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
        self._clicks.append((np.array(event.ray_origin), np.array(event.ray_direction)))

    def _use_bounds(self, _: Any) -> None:
        # A browser sends the last change within 50 ms only, and so loses that automatic bounds
        # were switched off if a bound is typed at once.
        self._automatic.value = False

    def _make_controls(self, first: Settings) -> None:
        gui, coloring = self._server.gui, first.coloring

        def number(label: str, value: float, most: float) -> Any:
            return gui.add_number(label, value, min=-most, max=most, step=0.01)

        gui.configure_theme(show_logo=False, show_share_button=False)
        gui.main_panel.dock_right()
        self._status = gui.add_html(as_note("No map has come yet."))
        self._paused = gui.add_checkbox("Pause", False)
        screenshot = gui.add_button("Screenshot")
        screenshot.on_click(self._take_screenshot)
        with gui.add_folder("Cell"):
            self._readout = gui.add_html(as_note("Click on the map."))
        with gui.add_folder("Surface"):
            # By the names of the fields of `Settings`.
            self._style = {
                "height_layer": gui.add_dropdown("Height", (first.height_layer or NO_LAYER,)),
                "flat": gui.add_checkbox("Flat", first.flat),
                "opacity": gui.add_slider("Opacity", 0.0, 1.0, 0.05, first.opacity),
                "grid_lines": gui.add_checkbox("Grid lines", first.grid_lines),
                "shaded": gui.add_checkbox("Shaded", first.shaded),
                "history": gui.add_slider("History", 1, 10, 1, first.history),
            }
        with gui.add_folder("Color"):
            mode = next(name for name, mode in MODES.items() if mode == coloring.mode)
            names = dict.fromkeys((*FIRST_COLOR_MAPS, *color_map_names()))
            # By the names of the fields of `Coloring`.
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
            for name in ("lower", "upper"):
                self._colors[name].on_update(self._use_bounds)
            self._legend = gui.add_html("")
        with gui.add_folder("Overlays"):
            self._style |= {
                "points": gui.add_checkbox("Points", first.points),
                "vectors": gui.add_dropdown("Vectors", (NO_VECTORS,)),
                "vector_scale": number("Vector length", first.vector_scale, LARGEST_SCALE),
            }
        controls = *self._style.values(), *self._colors.values()
        for control in (*controls, self._paused, self._automatic, screenshot):
            self._gate.controls[control._impl.uuid] = control


def vector_prefixes(layers: Sequence[str]) -> list[str]:
    """Return the common prefixes of three layers that end in x, y and z."""
    prefixes = (name.removesuffix("x") for name in layers if name.endswith("x"))
    # Layers called x, y and z are more likely positions than vector components.
    return [name for name in prefixes if name and name + "y" in layers and name + "z" in layers]


def is_loopback(host: str) -> bool:
    """Return True if an address is reachable from this machine only."""
    with suppress(ValueError):
        return ipaddress.ip_address(host).is_loopback
    return host == "localhost"


def url_of(host: str, port: int) -> str:
    """Return the URL of a page; for wildcard addresses, with the name of this machine."""
    name = socket.gethostname() if host in {"", "0.0.0.0", "::"} else host
    return f"http://[{name}]:{port}" if ":" in name else f"http://{name}:{port}"


def _serve(host: str, port: int, names: Container[str]) -> tuple[Any, Gate]:
    viser, websockets, msgspec = (
        required(name, "web_viewer", "install viser (pip)")
        for name in ("viser", "websockets.asyncio.server", "msgspec")
    )
    gate = Gate(websockets, msgspec, f"viser-v{viser.__version__}", names)
    try:
        # Without this check, viser would silently use the next free port.
        for family, *_, address in socket.getaddrinfo(
            host, port, type=socket.SOCK_STREAM, flags=socket.AI_PASSIVE
        ):
            socket.create_server(address[:2], family=family).close()
        websockets.serve = gate
        # viser prints, but nodes use the log.
        with redirect_stdout(io.StringIO()):
            server = viser.ViserServer(host, port, label="Grid map", verbose=False)
            if port not in {0, server.get_port()} or not gate.is_used:
                server.stop()
                raise OSError(
                    "another program was faster"
                    if gate.is_used
                    else "this version of viser cannot be kept from serving foreign pages"
                )
    except (OSError, OverflowError) as error:
        raise PageError(
            f"the page cannot be served at {host}:{port}: {error}; "
            "the parameters 'host' and 'port' choose another address"
        ) from error
    finally:
        websockets.serve = gate.serve
    return server, gate


def _offer(dropdown: Any, options: tuple[str, ...], preferred: str) -> None:
    """Offer options; if the chosen one is missing, choose the preferred one, else the first."""
    chosen = next((name for name in (dropdown.value, preferred) if name in options), options[0])
    if dropdown.options != options:
        dropdown.options = options
    dropdown.value = chosen


def _set_clipping(camera: Any, view: View) -> None:
    camera.near, camera.far = view.reach / 1000, 100 * view.reach
