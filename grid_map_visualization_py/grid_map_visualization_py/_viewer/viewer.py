# SPDX-License-Identifier: BSD-3-Clause
"""Controller that connects maps, settings and the page."""

import time
from collections import deque
from collections.abc import Callable, Iterable
from typing import Any

import numpy as np

from grid_map_core_py import GridMap
from grid_map_core_py._arrays import Positions
from grid_map_ros_py import MessageError, ReceivedMap
from grid_map_ros_py.errors import DROPPED, reason

from .markers import Markers
from .page import PATH_COLOR, Page
from .scene import SurfaceScene, ViewSettings, drawn_path, hit, make_scene, on_surface, raised
from .texts import as_note, readout, status

RATE_WINDOW = 3.0
"""Duration over which the map rate is averaged [s]."""


def rate_of(arrivals: Iterable[float], now: float) -> float:
    """Return the arrival rate [Hz] in the last `RATE_WINDOW`; 0 for fewer than two arrivals."""
    recent = [at for at in arrivals if now - at <= RATE_WINDOW]
    return (len(recent) - 1) / (recent[-1] - recent[0]) if len(recent) > 1 else 0.0


class Viewer:
    """Shows maps on a web page while a browser is connected. `clock` returns the ROS time [ns]."""

    def __init__(
        self, page: Page, max_drawn_cells: int, clock: Callable[[], int] = time.time_ns
    ) -> None:
        self._page = page
        self._max_drawn_cells = max_drawn_cells
        self._clock = clock
        self._arrivals: deque[float] = deque(maxlen=200)
        self._latest: ReceivedMap | None = None
        self._shown: ReceivedMap | None = None
        self._settings: ViewSettings | None = None
        self._drawn: tuple[ReceivedMap, GridMap, SurfaceScene] | None = None
        self._selected: Positions | None = None
        self._problem = self._refusal = ""
        self._path, self._path_frame = np.empty((0, 3)), ""
        self._markers = Markers()

    @property
    def frame_id(self) -> str:
        """Frame of the shown map; empty if there is none."""
        return self._drawn[1].frame_id if self._drawn else ""

    def clear(self) -> None:
        """Discard all maps, for example after the user selects another topic."""
        self._arrivals.clear()
        self._latest = self._shown = self._settings = self._drawn = self._selected = None
        self._problem = self._refusal = ""
        self._page.turn(0)
        self._page.tell(as_note("No map has arrived yet."))
        self._page.tell_values(as_note("Click on the map."))

    def receive(self, received: ReceivedMap) -> None:
        """Accept a map to show at the next `update`; raise a `GridMapError` if it is invalid."""
        try:
            received.decode([])
        except DROPPED as error:
            self._refusal = reason(error)
            raise
        self._refusal = ""
        self._latest = received
        self._arrivals.append(time.monotonic())

    def receive_path(self, points: Positions, frame_id: str) -> None:
        """Accept a path (N, 3) [m]; raise `MessageError` if the shown map is in another frame."""
        self._path, self._path_frame = points, frame_id
        self._check_frames("header.frame_id", {frame_id} if len(points) else set())

    def receive_markers(self, message: Any) -> None:
        """Accept a `visualization_msgs/MarkerArray`; raise `MessageError` if it cannot be shown."""
        self._markers.receive(message)
        self._check_frames("markers.header.frame_id", self._markers.frames)

    def _check_frames(self, field: str, frames: set[str]) -> None:
        if self._drawn and (others := frames - {self.frame_id}):
            raise MessageError(field, f"{self.frame_id!r}, that of the map", min(others))

    def update(self) -> str:
        """Update the page; return an error message, or "" if there is no error."""
        page = self._page
        if page.is_watched:
            try:
                page.turn(self._settings.history if self._settings else 1)
                self._draw_if_due()
                ray = page.take_click()
                if ray is not None and self._drawn is not None:
                    received, _, scene = self._drawn
                    point = hit(scene.mesh, *ray)
                    page.mark(point)
                    self._selected = None if point is None else point[:2]
                    text = as_note("There is no map at this place.")
                    if self._selected is not None:
                        text = readout(received.decode(), self._selected)
                    page.tell_values(text)
            except Exception as error:  # A map that cannot be drawn must not end the node.
                self._problem = reason(error) if isinstance(error, DROPPED) else repr(error)
            if self._problem or self._refusal:
                page.tell(as_note(self._problem or self._refusal))
            elif self._drawn is not None:
                _, grid_map, scene = self._drawn
                now = time.monotonic()
                heard = rate_of(self._arrivals, now), now - self._arrivals[-1]
                paused = {"is_paused": page.is_paused}
                page.tell(status(grid_map, scene.size, *heard, self._clock(), **paused))
                page.draw_frame("origin", grid_map.frame_id, np.eye(4))
                self._draw(grid_map)
        return self._problem

    def _draw(self, grid_map: GridMap) -> None:
        if (settings := self._settings) is None:
            return
        points = self._path if self._path_frame == grid_map.frame_id else self._path[:0]
        path = drawn_path(on_surface(grid_map, settings, points), PATH_COLOR)
        self._page.draw("path", path)
        markers = self._markers.drawing(grid_map.frame_id)
        self._page.draw("markers", raised(markers, grid_map, settings))

    def _draw_if_due(self) -> None:
        received = self._shown if self._page.is_paused and self._shown else self._latest
        if received is None:
            return
        is_new = received is not self._shown
        self._shown = received
        if is_new and received.layers:
            self._page.offer(received.layers)
        # Remains None if the settings are invalid.
        before, self._settings = self._settings, None
        self._settings = settings = self._page.settings()
        if settings == before and not is_new:
            return
        grid_map = received.decode(settings.layers if self._selected is None else None)
        scene = make_scene(grid_map, settings, self._max_drawn_cells)
        self._page.load(scene, settings, replaces=not is_new)
        self._drawn, self._problem = (received, grid_map, scene), ""
        if self._selected is not None:
            self._page.tell_values(readout(grid_map, self._selected))
