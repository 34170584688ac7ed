# SPDX-License-Identifier: BSD-3-Clause
"""Services of the `elevation_mapping` node."""

from typing import Any

from grid_map_core_py import GridMap
from grid_map_core_py.errors import GridMapError

from .._serving import part, place_below
from ..bags import BagWriter, bag_topics, load_from_bag
from ..bags._bag import chosen_storage
from ..errors import RequestError
from ..messages import from_message, to_message
from ..nodes import ConfiguredNode
from ..nodes._poses import frame_name
from ..nodes._scans import ScanInputs
from .fusion import ElevationFusion
from .outputs import MapOutputs
from .settings import Settings, read_mapper_parameters


class MapServices:
    """Service callbacks of `elevation_mapping`; they fill the response or raise `GridMapError`."""

    def __init__(
        self,
        node: ConfiguredNode,
        settings: Settings,
        fusion: ElevationFusion,
        outputs: MapOutputs,
        inputs: ScanInputs,
    ) -> None:
        self._node, self._settings = node, settings
        self._fusion, self._outputs, self._inputs = fusion, outputs, inputs
        self._storage: str = settings.storage
        if settings.directory:
            warn = node.get_logger().warning  # type: ignore[no-untyped-call]
            self._storage = chosen_storage(settings.storage, warn)

    def get_submap(self, request: Any, response: Any) -> None:
        response.map = _part_of(self._outputs.filtered()[0], request)

    def get_raw_submap(self, request: Any, response: Any) -> None:
        response.map = _part_of(self._fusion.grid_map, request)

    def masked_replace(self, request: Any, _response: Any) -> None:
        given = from_message(request.map, unwrap=False)
        self._fusion.replace(given, self._settings.masked_replace_service_mask_layer_name)
        self._outputs.publish_raw()

    def save_map(self, request: Any, response: Any) -> None:
        topic = _topic_of(request)
        filtered, _ = self._outputs.filtered()
        with (
            place_below(self._settings.directory, request.file_path) as path,
            BagWriter(path, storage=self._storage) as bag,
        ):
            bag.write(topic, filtered)
            bag.write(f"{topic}_raw", self._fusion.grid_map)
        response.success = True

    def load_map(self, request: Any, response: Any) -> None:
        topic = _topic_of(request)
        with place_below(self._settings.directory, request.file_path) as path:
            names = [each.name for each in bag_topics(path)]
            found = next((name for name in (f"{topic}_raw", topic) if name in names), topic)
            self._fusion.load(load_from_bag(path, found, unwrap=False))
        self._outputs.publish_raw()
        response.success = True

    def clear_map(self, _request: Any, _response: Any) -> None:
        self._fusion.clear()
        self._outputs.publish_raw()

    def trigger_fusion(self, _request: Any, _response: Any) -> None:
        self._outputs.trigger()

    def disable_updates(self, _request: Any, _response: Any) -> None:
        self._inputs.is_enabled = False

    def enable_updates(self, _request: Any, _response: Any) -> None:
        self._inputs.is_enabled = True

    def reload_parameters(self, _request: Any, response: Any) -> None:
        try:
            parameters = read_mapper_parameters(self._node, self._settings)
            self._fusion.mapper.configure(**parameters)
            response.success, response.message = True, "the map has the parameters that were set"
        except GridMapError as error:
            response.message = str(error)


def _part_of(grid_map: GridMap, request: Any) -> Any:
    position = request.position_x, request.position_y
    length = request.length_x, request.length_y
    found = part(grid_map, frame_name(request.frame_id), position, length)
    return to_message(found, request.layers or None)


def _topic_of(request: Any) -> str:
    """Return the bag topic of the filtered map; the raw map has the suffix `_raw`."""
    name = request.topic_name or "elevation_map"
    if "/" in name:
        raise RequestError(f"topic_name: expected a name without slashes, got {name!r}")
    return f"/{name}"
