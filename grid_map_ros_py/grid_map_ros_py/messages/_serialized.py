# Copyright (c) 2026 grid_map_py contributors
# SPDX-License-Identifier: BSD-3-Clause
"""`grid_map_msgs/GridMap` as bytes (CDR) and `GridMap`, without a message object between them.

Every layer is copied once, and only the layers that are wanted.
"""

from collections.abc import Iterable
from functools import cached_property
from types import SimpleNamespace
from typing import Any

import numpy as np
import numpy.typing as npt

from grid_map_core_py import GridGeometry, GridMap
from grid_map_core_py.arrays import Layer, Size
from grid_map_core_py.map import unwrapped

from ._cdr import Buffer, Deferred, serialize_view, view
from ._definition import GRID_MAP
from ._grid_map import from_info, from_message, outgoing, received_start
from ._multi_array import to_layout
from ._time import NANOSECONDS, check_nanoseconds, from_stamp


def to_serialized_message(
    grid_map: GridMap,
    layers: Iterable[str] | None = None,
    *,
    start_index: Size | None = None,
) -> bytes:
    """Return the message of `to_message` in CDR; publishers accept it in place of the message.

    Every layer is copied once, also where the start index changes. No message package is needed.

    Args:
        grid_map, layers: as for `to_message`.
        start_index: row and column of the message's buffer where cell (0, 0) of the map is stored;
            None keeps the start index of the map.

    Raises:
        LayerNotFoundError: the map lacks a layer.
        OutOfMapError: the start index is no cell of the map.
        MessageError: the timestamp does not fit the message, or UTF-8 cannot hold a name.
    """
    if start_index is None:
        start_index = grid_map.start_index
    grid_map.geometry.check_cells(np.asarray(start_index))
    fields, first = outgoing(grid_map, layers, start_index)
    layout = to_layout(grid_map.size)
    fields["data"] = [
        SimpleNamespace(layout=layout, data=_values(layer, first)) for layer in fields["data"]
    ]
    seconds, rest = divmod(check_nanoseconds(grid_map.timestamp), NANOSECONDS)
    stamp = SimpleNamespace(sec=seconds, nanosec=rest)
    header = SimpleNamespace(stamp=stamp, frame_id=grid_map.frame_id)
    message = SimpleNamespace(header=header, info=_info(grid_map.geometry), **fields)
    return serialize_view(message, GRID_MAP)


def from_serialized_message(
    data: Buffer,
    layers: Iterable[str] | None = None,
    *,
    copy_basic_layers: bool = True,
    unwrap: bool = True,
    copy: bool = True,
) -> GridMap:
    """Return the map in a serialized message, as `from_message` does.

    Args:
        data: the message in CDR, as a raw subscription receives it and bags hold it.
        layers, copy_basic_layers, unwrap, copy: as for `from_message`.

    Raises:
        MessageError: the bytes are no such message, or it contradicts itself.
        LayerNotFoundError: `layers` names one that the message lacks.
    """
    received = ReceivedMap(data)
    return received.decode(layers, copy_basic_layers=copy_basic_layers, unwrap=unwrap, copy=copy)


class ReceivedMap:
    """A serialized map message that decodes only the requested layers.

    All but `data` raises MessageError if the bytes are no map message, or if what is asked for
    is invalid.

    Args:
        data: the message in CDR.

    Attributes:
        data: as given. Publishers accept it in place of the message.
    """

    def __init__(self, data: Buffer) -> None:
        self.data = data

    @property
    def frame_id(self) -> str:
        """Coordinate frame of the map."""
        frame_id: str = self._message.header.frame_id
        return frame_id

    @property
    def timestamp(self) -> int:
        """Time of the data [ns]."""
        return from_stamp(self._message.header.stamp)

    @property
    def geometry(self) -> GridGeometry:
        """Size, resolution and place of the grid."""
        return from_info(self._message.info)

    @property
    def start_index(self) -> Size:
        """(row, col) where the circular buffer begins."""
        return received_start(self._message, self.geometry.size)

    @property
    def layers(self) -> tuple[str, ...]:
        """Names of the layers."""
        return tuple(self._message.layers)

    @property
    def basic_layers(self) -> tuple[str, ...]:
        """Names of the layers that must be finite for a cell to be valid."""
        return tuple(self._message.basic_layers)

    def decode(
        self,
        layers: Iterable[str] | None = None,
        *,
        copy_basic_layers: bool = True,
        unwrap: bool = True,
        copy: bool = True,
    ) -> GridMap:
        """Return the map, or some of its layers; arguments and errors: see `from_message`."""
        return from_message(
            self._message,
            layers,
            copy_basic_layers=copy_basic_layers,
            unwrap=unwrap,
            copy=copy,
        )

    @cached_property
    def _message(self) -> Any:
        return view(self.data, GRID_MAP)


def _info(geometry: GridGeometry) -> SimpleNamespace:
    x, y = geometry.position.tolist()
    length_x, length_y = geometry.length.tolist()
    position = SimpleNamespace(x=x, y=y, z=0.0)
    orientation = SimpleNamespace(x=0.0, y=0.0, z=0.0, w=1.0)
    return SimpleNamespace(
        resolution=geometry.resolution,
        length_x=length_x,
        length_y=length_y,
        pose=SimpleNamespace(position=position, orientation=orientation),
    )


def _values(layer: Layer, first: Size) -> npt.NDArray[np.float32] | Deferred:
    """Return the values of a layer, column after column from the cell `first`."""
    if first == (0, 0):
        return np.asarray(layer, dtype=np.float32, order="F").ravel("K")
    return Deferred(
        layer.size,
        lambda values: unwrapped(layer, first, out=values.reshape(layer.shape, order="F")),
    )
