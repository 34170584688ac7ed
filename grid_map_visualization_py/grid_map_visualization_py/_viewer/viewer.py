# Copyright (c) 2026 grid_map_py contributors
# SPDX-License-Identifier: BSD-3-Clause
"""Controller that brings maps, settings and the page together."""

import math
import time
from collections import deque

from grid_map_core_py import GridMap
from grid_map_core_py.arrays import Positions
from grid_map_core_py.errors import GridMapError
from grid_map_ros_py import ReceivedMap

from .page import Page
from .picking import hit
from .scene import Scene, make_scene, view
from .settings import Settings, follow, vector_prefixes
from .texts import as_note, readout, status

RATE_WINDOW = 3.0
"""Duration over which the rate of the maps is averaged [s]."""


class MapRate:
    """Rate of incoming maps and age of the last one, from their arrival times [s]."""

    def __init__(self) -> None:
        self._times: deque[float] = deque()

    def add(self, now: float) -> None:
        """Record a map that arrived now."""
        self._times.append(now)
        while now - self._times[0] > RATE_WINDOW:
            self._times.popleft()

    def rate(self, now: float) -> float:
        """Return maps per second; 0 with fewer than two maps in the window."""
        times = [time for time in self._times if now - time <= RATE_WINDOW]
        return (len(times) - 1) / (times[-1] - times[0]) if len(times) > 1 else 0.0

    def age(self, now: float) -> float:
        """Return the seconds since the last map; infinite if there is none."""
        return now - self._times[-1] if self._times else math.inf


class Viewer:
    """Shows maps on a page.

    Maps are decoded only while a browser is connected, and only the shown layers.

    Args:
        page: the page.
        max_cells: limit of the cells, as for `Surface`.
    """

    def __init__(self, page: Page, max_cells: int) -> None:
        self._page = page
        self._max_cells = max_cells
        self._rate = MapRate()
        self._latest: ReceivedMap | None = None
        self._shown: ReceivedMap | None = None
        self._drawn: ReceivedMap | None = None
        self._settings: Settings | None = None
        self._map: GridMap | None = None
        self._scene: Scene | None = None
        self._selected: Positions | None = None
        self._problem = ""

    def receive(self, received: ReceivedMap) -> None:
        """Accept a map, which is shown at the next `update`."""
        self._latest = received
        self._rate.add(time.monotonic())

    def update(self) -> str:
        """Update the page.

        Returns:
            The problem with the last map or with the settings, empty if there is none. The page
            shows this text as well, and keeps the map that it had.
        """
        if self._page.is_watched:
            self._page.turn(self._settings.history if self._settings else 1)
            try:
                self._draw_if_due()
                self._answer_click()
            except GridMapError as error:
                self._problem = str(error)
            self._tell_status()
        return self._problem

    def _draw_if_due(self) -> None:
        received = self._shown if self._page.is_paused and self._shown else self._latest
        if received is None:
            return
        is_new = received is not self._shown
        self._shown = received
        if is_new and received.layers:
            self._offer(received.layers)
        self._draw(received, is_new=is_new)

    def _offer(self, layers: tuple[str, ...]) -> None:
        page = self._page
        height = follow(page.height_layer, layers, ("elevation",))
        prefixes = vector_prefixes(layers)
        page.offer(
            layers,
            prefixes,
            height_layer=height,
            color_layer=follow(page.color_layer, layers, (height,)),
            vectors=page.vectors if page.vectors in prefixes else "",
        )

    def _draw(self, received: ReceivedMap, *, is_new: bool) -> None:
        before, self._settings = self._settings, None
        settings = self._page.settings()
        self._settings = settings
        if settings == before and not is_new:
            return
        layers = None if self._selected is not None else settings.layers
        grid_map = received.decode(layers)
        scene = make_scene(grid_map, settings, self._max_cells)
        self._page.load(scene, settings, replaces=not is_new)
        self._page.look(view(scene.mesh, grid_map))
        self._drawn, self._map, self._scene, self._problem = received, grid_map, scene, ""
        if self._selected is not None:
            self._page.tell_values(readout(grid_map, self._selected))

    def _answer_click(self) -> None:
        ray = self._page.take_click()
        if ray is None or self._scene is None or self._drawn is None:
            return
        point = hit(self._scene.mesh, *ray)
        self._page.mark(point)
        self._selected = None if point is None else point[:2]
        if self._selected is None:
            self._page.tell_values(as_note("There is no map at this place."))
        else:
            self._page.tell_values(readout(self._drawn.decode(), self._selected))

    def _tell_status(self) -> None:
        if self._problem:
            self._page.tell(as_note(self._problem))
        elif self._map is not None and self._scene is not None:
            now, is_paused = time.monotonic(), self._page.is_paused
            rate, age = self._rate.rate(now), self._rate.age(now)
            self._page.tell(status(self._map, self._scene.size, rate, age, is_paused=is_paused))
