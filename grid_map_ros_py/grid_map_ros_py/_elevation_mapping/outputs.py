# SPDX-License-Identifier: BSD-3-Clause
"""Publishers of the raw and the filtered elevation map."""

import math
import time
from collections.abc import Mapping
from importlib.metadata import entry_points
from typing import Any, Protocol

from rclpy.node import Node

from grid_map_core_py import GridMap
from grid_map_core_py._arrays import Size
from grid_map_core_py.errors import MissingPackageError

from ..messages import to_serialized_message
from ..nodes import MapPublisher
from ..nodes._health import LogThrottle
from ..nodes._spin import steady_timer
from .fusion import ElevationFusion

GROUP = "grid_map_ros_py.chains"
PACKAGE = "grid_map_filters_py"


class Chain(Protocol):
    """Interface of a filter chain, such as `FilterChain` of `grid_map_filters_py`."""

    def without_copies(
        self, grid_map: GridMap, *, warnings: list[str] | None = None
    ) -> tuple[GridMap, Size]:
        """Return the filtered map with start index (0, 0), and the start index for its message.

        Warnings of the filters are appended to `warnings`.
        """


def make_chain(config: Mapping[str, Any], threads: int = 1) -> Chain:
    found = next(iter(entry_points(group=GROUP)), None)
    if found is None:
        raise MissingPackageError(PACKAGE, "postprocessor_pipeline")
    chain: Chain = found.load().from_config(config, threads=threads)
    return chain


class MapOutputs:
    """Publishers of the raw and the filtered map of a fusion.

    Changed maps are published at `raw_rate` and `filtered_rate` [Hz]. If `filtered_rate` is 0, only
    `trigger` publishes the filtered map. If `filtered_rate` is infinite, `on_scan` publishes both
    maps.
    """

    def __init__(
        self,
        node: Node,
        fusion: ElevationFusion,
        chain: Chain | None,
        log: LogThrottle,
        *,
        raw_rate: float,
        filtered_rate: float,
    ) -> None:
        self._fusion, self._chain, self._log = fusion, chain, log
        self._with_raw = filtered_rate == math.inf

        def raw() -> bytes | None:
            return to_serialized_message(fusion.grid_map) if fusion.version else None

        def filtered() -> bytes | None:
            if not fusion.version:
                return None
            grid_map, start = self.filtered()
            return to_serialized_message(grid_map, start_index=start)

        self._raw = MapPublisher(node, "~/elevation_map_raw", raw, log)
        self._filtered = MapPublisher(node, "~/elevation_map", filtered, log)
        steady_timer(node, 1 / raw_rate, self.publish_raw)
        if 0 < filtered_rate < math.inf:
            steady_timer(node, 1 / filtered_rate, self._publish_filtered)

    def on_scan(self, publish: bool) -> None:
        """Log the warnings of the fusion. If `publish` is true, publish changed maps."""
        for text in self._fusion.warnings:
            self._log.warning(text)
        self._fusion.warnings.clear()
        if publish:
            self.publish_raw()
            if self._with_raw:
                self._publish_filtered()

    def publish_raw(self) -> None:
        """Publish the raw map if it has changed."""
        self._raw.publish_version(self._fusion.version)

    def trigger(self) -> None:
        """Publish the filtered map, even if it has not changed."""
        self._filtered.publish()

    def filtered(self) -> tuple[GridMap, Size]:
        """Return the filtered map and the start index for its message."""
        grid_map, texts = self._fusion.fused_map, list[str]()
        if self._chain is None:
            return grid_map, grid_map.start_index
        begin = time.perf_counter()
        try:
            result = self._chain.without_copies(grid_map, warnings=texts)
        finally:
            for text in texts:
                self._log.warning(text)
        self._fusion.time("pipeline", 1e3 * (time.perf_counter() - begin))
        return result

    def _publish_filtered(self) -> None:
        self._filtered.publish_version(self._fusion.version)
