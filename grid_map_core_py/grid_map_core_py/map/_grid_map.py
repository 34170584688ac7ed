# SPDX-License-Identifier: BSD-3-Clause
"""`GridMap`, a grid with named layers."""

from __future__ import annotations

import operator
import warnings
from collections.abc import Iterable, Iterator, Mapping, MutableMapping
from importlib import import_module
from math import isfinite, nan
from typing import TYPE_CHECKING, Any, NoReturn

import numpy as np
from numpy.typing import ArrayLike, NDArray

from .._arrays._checks import (
    Cells,
    Layer,
    Mask,
    Pair,
    Positions,
    Size,
    as_crs,
    as_layer,
    as_names,
    as_numbers,
    as_pair,
    as_point,
    as_size,
    as_text,
    is_name,
    plain_cell,
    plain_pair,
    select_layers,
)
from ..errors import GeometryError, GridMapError, LayerNotFoundError, OutOfMapError, cut, short
from . import _merge as merge, _ring_buffer as ring_buffer
from ._geometry import GridGeometry
from ._interpolation import Interpolation, interpolate
from ._ring_buffer import BufferRegion
from ._transform import transformed_map

if TYPE_CHECKING:
    import xarray

_LARGEST_REST = 1e-3  # largest rounding of a length or coordinate without a warning [cells]
_NO_DATA = np.array(nan, np.float32)  # NumPy assigns an array faster than a number


class GridMap(MutableMapping[str, Layer]):
    """A rectangular grid of cells with any number of float32 layers.

    A map is a mutable mapping from layer names to arrays. `map[layer]` returns the (rows, cols)
    array of the layer without a copy, so writing to this array changes the map.
    `map[layer] = values` adds or replaces a layer. xarray arrays are aligned by their coordinates.
    NaN means "no data". If values exceed the float32 range, or if values above 2**24 are rounded, a
    `RuntimeWarning` is issued.

    In map order, cell (0, 0) is at the corner with the largest x and y. Rows run towards -x and
    columns towards -y. Layers of a new map are in map order. After `move`, layers are circular
    buffers, in which cell (0, 0) is stored at `start_index`. `axes()`, `grid_map_core_py.regions`
    and all methods that convert positions take the start index into account. To read or write a
    layer in map order, use `unwrapped(layer)` and `set_unwrapped(layer, values)`.

    Two maps are equal if their grids, frames, times, basic layers and layer values in map order are
    equal. NaN equals NaN. Layer order, start index and `crs` do not matter. Maps are not hashable,
    because they are mutable.

    Args:
        length: (2,) side lengths along x and y [m], not cells: at a resolution of 0.05, the lengths
            4.0 and 3.0 result in 80 x 60 cells. A length that is not a whole number of cells is
            rounded, and a `UserWarning` is issued.
        resolution: side of a cell [m].
        position: (2,) center of the map [m], in `frame_id`.
        layers: names of layers to add without data, or a mapping from names to values.
        basic_layers: names of the layers that must be finite for a cell to be valid.
        frame_id: coordinate frame that all positions refer to.
        timestamp: time of the data [ns].

    Unless stated otherwise, methods raise `LayerNotFoundError` if a layer is missing, and
    `OutOfMapError` if a position or an index is outside the map. They raise `GeometryError` if an
    array has the wrong shape, or if a length, center or transform is not finite. A position with
    NaN is outside the map.

    Example:
        >>> grid_map = GridMap(length=(2.0, 1.0), resolution=0.5, layers=["elevation"])
        >>> grid_map["elevation"][grid_map.get_index((0.6, 0.1))] = 0.3
        >>> grid_map
        GridMap(4 x 2 cells of 0.5 m, 2 x 1 m at (0.0, 0.0) in '', layers: elevation)
    """

    __slots__ = (
        "__weakref__",
        "_basic_layers",
        "_frame_id",
        "_geometry",
        "_layers",
        "_reference",
        "_shared",
        "_start",
        "_timestamp",
    )
    __hash__ = None  # type: ignore[assignment]

    def __init__(
        self,
        length: ArrayLike,
        resolution: float,
        position: ArrayLike = (0.0, 0.0),
        layers: Iterable[str] | Mapping[str, ArrayLike] = (),
        *,
        basic_layers: Iterable[str] = (),
        frame_id: str = "",
        timestamp: int = 0,
    ) -> None:
        geometry = GridGeometry(length, resolution, position)
        rests = (
            abs(a - b) for a, b in zip(geometry._sides, as_pair(length, "length"), strict=True)
        )
        if max(rests) > _LARGEST_REST * geometry.resolution:
            text = f"length: expected a multiple of {resolution:g} m, got {as_text(length)}"
            warnings.warn(f"{text}; the map is {as_text(geometry.length)} m", stacklevel=2)
        self._put(geometry, (0, 0), {}, (), _as_frame(frame_id), _as_time(timestamp))
        self._fill(layers, basic_layers)

    @classmethod
    def from_array(
        cls,
        values: ArrayLike,
        resolution: float,
        position: ArrayLike = (0.0, 0.0),
        *,
        layer: str = "elevation",
        frame_id: str = "map",
        timestamp: int = 0,
    ) -> GridMap:
        """Create a map with one cell per value of an array.

        Args:
            values: (rows, cols) numbers, copied; rows run towards -x, columns towards -y. Pass
                `image.T[::-1]` for an image or raster whose first row is the top (+y).
            resolution, position, frame_id, timestamp: see the constructor.
            layer: name of the layer.
        """
        data = as_numbers(values, "values")
        if data.ndim != 2 or not data.size:
            raise GeometryError(f"values: expected shape (rows, cols), got {data.shape}")
        geometry = GridGeometry.from_size(data.shape, resolution, position)
        return cls.from_geometry(geometry, {layer: values}, frame_id=frame_id, timestamp=timestamp)

    @classmethod
    def from_geometry(
        cls,
        geometry: GridGeometry,
        layers: Iterable[str] | Mapping[str, ArrayLike] = (),
        *,
        basic_layers: Iterable[str] = (),
        frame_id: str = "",
        timestamp: int = 0,
    ) -> GridMap:
        """Create a map with the grid `geometry`. See the constructor for the other arguments."""
        grid_map = cls.__new__(cls)
        grid_map._put(geometry, (0, 0), {}, (), _as_frame(frame_id), _as_time(timestamp))
        grid_map._fill(layers, basic_layers)
        return grid_map

    def _fill(
        self, layers: Iterable[str] | Mapping[str, ArrayLike], basic_layers: Iterable[str]
    ) -> None:
        if not isinstance(layers, Mapping):
            layers = dict.fromkeys(as_names(layers), np.nan)
        # Skipping an empty update speeds up the conversion of small messages.
        if layers:
            self.update(layers)
        if basic_layers != ():
            self.basic_layers = basic_layers

    def _put(
        self,
        geometry: GridGeometry,
        start: Size,
        layers: dict[str, Layer],
        basic_layers: tuple[str, ...],
        frame_id: str,
        timestamp: int,
        reference: tuple[str, Pair] = ("", (0.0, 0.0)),
    ) -> None:
        self._geometry = geometry
        self._reference = reference  # the reference system, and the frame origin in this system
        self._shared: set[str] = set()  # layers that another map owns; copied on first access
        self._start = start
        self._layers = layers
        self._basic_layers = basic_layers
        self._frame_id = frame_id
        self._timestamp = timestamp

    # Properties

    @property
    def geometry(self) -> GridGeometry:
        """Geometry of the grid: size, resolution and position."""
        return self._geometry

    @property
    def size(self) -> Size:
        """Number of rows (along x) and columns (along y)."""
        return self._geometry.size

    @property
    def shape(self) -> Size:
        """Shape of every layer, the same as `size`."""
        return self.size

    @property
    def length(self) -> Positions:
        """(2,) side lengths along x and y [m]."""
        return self._geometry.length

    @property
    def resolution(self) -> float:
        """Side of a cell [m]."""
        return self._geometry.resolution

    @property
    def position(self) -> Positions:
        """(2,) center of the map [m].

        Setting `position` shifts the map together with its data. `move` keeps the data in place.
        """
        return self._geometry.position

    @position.setter
    def position(self, position: ArrayLike) -> None:
        self._geometry = self._geometry.at(position)

    @property
    def start_index(self) -> Size:
        """Buffer row and column at which cell (0, 0) of the map is stored.

        Setting `start_index` copies no data: the stored values then belong to other positions.
        """
        return self._start

    @start_index.setter
    def start_index(self, index: ArrayLike) -> None:
        start = as_size(index, "start_index")
        self._geometry.check_indices(start, "start_index")
        self._start = start

    @property
    def layers(self) -> tuple[str, ...]:
        """Names of the layers in the order in which they were added."""
        return tuple(self._layers)

    @property
    def basic_layers(self) -> tuple[str, ...]:
        """Names of the layers that must be finite for a cell to be valid."""
        return self._basic_layers

    @basic_layers.setter
    def basic_layers(self, names: Iterable[str]) -> None:
        self._basic_layers = select_layers(self._layers, as_names(names))

    @property
    def frame_id(self) -> str:
        """Coordinate frame that all positions refer to."""
        return self._frame_id

    @frame_id.setter
    def frame_id(self, frame_id: str) -> None:
        self._frame_id = _as_frame(frame_id)

    @property
    def crs(self) -> str:
        """Coordinate reference system of the frame: WKT, a code or a PROJ string; "" if unknown.

        Copies and submaps of a map have the same `crs`. GeoTIFF, Zarr and .npz files store it, but
        ROS messages and images do not. Setting `crs` resets `origin` to (0, 0).
        """
        return self._reference[0]

    @crs.setter
    def crs(self, crs: Any) -> None:
        self._reference = as_crs(crs), (0.0, 0.0)

    @property
    def origin(self) -> Pair:
        """Coordinates of the frame origin in `crs` [m]; see `TiledMap.with_origin`."""
        return self._reference[1]

    def _in_crs(self, crs: Any) -> GridMap:
        """Return a map with the same layers and this `crs`, or this map if `crs` is empty."""
        if not crs or merge.is_same_crs(self.crs, as_crs(crs)):
            return self
        result = self._with(self._layers)
        result._reference = as_crs(crs), (0.0, 0.0)
        return result

    @property
    def timestamp(self) -> int:
        """Time of the data [ns]."""
        return self._timestamp

    @timestamp.setter
    def timestamp(self, timestamp: int) -> None:
        self._timestamp = _as_time(timestamp)

    # Layers

    def __getitem__(self, layer: str) -> Layer:
        try:
            data = self._layers[layer]
        except (KeyError, TypeError):
            raise LayerNotFoundError(layer, self._layers) from None
        if layer in self._shared:
            data = self._layers[layer] = data.copy("F")
            self._shared.discard(layer)
        return data

    def __setitem__(self, layer: str, value: ArrayLike) -> None:
        if not is_name(layer):
            raise _wrong_name(layer)
        # `map[layer] += 1` has already changed the layer in place.
        if layer not in self._layers or value is not self._layers[layer]:
            self._layers[layer] = as_layer(self._aligned(layer, value), self.size, layer)

    def __delitem__(self, layer: str) -> None:
        select_layers(self._layers, (layer,))
        del self._layers[layer]
        self._basic_layers = tuple(name for name in self._basic_layers if name != layer)

    def __contains__(self, layer: object) -> bool:
        return isinstance(layer, str) and layer in self._layers

    def __iter__(self) -> Iterator[str]:
        return iter(self._layers)

    def __len__(self) -> int:
        return len(self._layers)

    def _ipython_key_completions_(self) -> list[str]:
        return [*self]

    def __array__(self, dtype: Any = None, copy: bool | None = None) -> NoReturn:
        # NumPy would make an array of the layer names.
        raise GeometryError("array: expected a layer such as map['elevation'], got a GridMap")

    def __bool__(self) -> bool:
        # A map without layers is still a map: `if grid_map:` must not depend on layers.
        return True

    def __eq__(self, other: object) -> bool:
        if not isinstance(other, GridMap):
            return NotImplemented
        if (
            self._geometry != other._geometry
            or (self._frame_id, self._timestamp) != (other._frame_id, other._timestamp)
            or self._layers.keys() != other._layers.keys()
            or set(self._basic_layers) != set(other._basic_layers)
        ):
            return False
        return all(
            np.array_equal(data, other._from_start(other[name], self._start), equal_nan=True)
            for name, data in self._layers.items()
        )

    def update(  # type: ignore[override]
        self,
        layers: Mapping[str, ArrayLike] | Iterable[tuple[str, ArrayLike]] = (),
        /,
        **named: ArrayLike,
    ) -> None:
        """Add or replace layers, as `dict.update` does.

        Args:
            layers: names and values, or a map of the same size; its start index may differ.
            named: additional layers as keyword arguments.
        """
        for name, value in {**dict(self._in_my_order(layers)), **named}.items():
            self[name] = value

    def setdefault(self, layer: str, default: ArrayLike = np.nan) -> Layer:
        """Return a layer. If it is missing, add it first with the value `default`."""
        if layer not in self:
            self[layer] = default
        return self[layer]

    def add(self, layer: str, value: ArrayLike = np.nan) -> None:
        """Add or replace a layer, as `map[layer] = value` does.

        Args:
            layer: name of the layer.
            value: a number for all cells, or a (rows, cols) array in buffer order; copied.
        """
        self[layer] = value

    def with_layers(self, layers: Mapping[str, ArrayLike]) -> GridMap:
        """Return a new map in which `layers` are added or replaced.

        This map stays unchanged. All other layers are shared, and copied only when they are first
        accessed in the new map. Values in `layers` are copied, except float32 arrays in Fortran
        order: the new map uses these arrays directly.
        """
        if not isinstance(layers, Mapping):
            raise GridMapError(
                f"layers: expected a mapping of names to values, got {short(layers)}"
            )
        adopted = {n: self._adopt(n, data) for n, data in self._in_my_order(layers).items()}
        return self._sharing({**self._layers, **adopted})

    def without_layers(self, names: Iterable[str]) -> GridMap:
        """Return a new map without the named layers. Others are shared, as in `with_layers`."""
        dropped = select_layers(self._layers, as_names(names))
        return self._sharing({n: data for n, data in self._layers.items() if n not in dropped})

    def clear(self, layer: str) -> None:  # type: ignore[override]
        """Set all values of a layer to NaN."""
        self[layer][...] = np.nan

    def clear_basic(self) -> None:
        """Set all values of the basic layers to NaN."""
        for name in self._basic_layers:
            self.clear(name)

    def clear_all(self) -> None:
        """Set all values of all layers to NaN."""
        for name in self._layers:
            self.clear(name)

    def copy(self) -> GridMap:
        """Return a deep copy of the map."""
        return self._with({name: data.copy("F") for name, data in self._layers.items()})

    __copy__ = copy

    # Positions and indices

    def is_inside(self, positions: ArrayLike) -> bool | Mask:
        """Return whether each (2,) or (N, 2) position [m] is inside the map.

        The +x and +y borders belong to the map; the -x and -y borders do not.
        """
        position = plain_pair(positions)
        if position is not None:
            return self._geometry.contains(position)
        inside = self._geometry.is_inside(positions)
        return bool(inside) if inside.ndim == 0 else inside

    def get_index(self, position: ArrayLike) -> Size:
        """Return the buffer row and column of the cell that contains a (2,) position [m]."""
        point = as_point(position, "position")
        index = self._geometry.cell_at(point, self._start)
        if index is None:
            raise OutOfMapError(f"position {point} is outside the map: {self._geometry.place}")
        return index

    def get_indices(self, positions: ArrayLike) -> tuple[Cells, Mask]:
        """Return the cell that contains each position, and a mask of the positions on the map.

        Args:
            positions: (N, 2) x, y [m].

        Returns:
            cells: (rows, cols) buffer indices, so `map["elevation"][cells]` returns the values. A
                position outside the map gets the nearest border cell.
            inside: (N,) bool, True for positions on the map.
        """
        return self._geometry.cells_at(positions, self._start)

    def get_position(self, index: ArrayLike) -> Positions:
        """Return the center (2,) [m] of the cell at a buffer index."""
        return np.array(self._geometry.center_of(self._checked(index), self._start))

    def get_positions(self, indices: ArrayLike | None = None) -> Positions:
        """Return the centers (N, 2) [m] of cells.

        Args:
            indices: buffer indices as (N, 2), or as (rows, cols) like those from `get_indices` and
                `grid_map_core_py.regions`. None means all cells in buffer order, column by column.
        """
        if indices is None:
            x, y = self.axes()
            positions: Positions = np.empty((x.size * y.size, 2))
            positions[:, 0] = np.tile(x, y.size)
            positions[:, 1] = np.repeat(y, x.size)
            return positions
        return self._geometry.centers(indices, self._start)

    def axes(self) -> tuple[Positions, Positions]:
        """Return the x of each row (rows,) and the y of each column (cols,) of the layers [m].

        Both are in the order in which layers are stored, even after `move`:

            x, y = grid_map.axes()
            grid_map["elevation"] = np.sin(x[:, None]) * y
        """
        x, y = self._geometry.axes_in_map_order()
        return np.roll(x, self._start[0]), np.roll(y, self._start[1])

    def get_closest_position_in_map(self, positions: ArrayLike) -> Positions:
        """Return the point on the map nearest to each (2,) or (N, 2) position [m].

        Raises:
            GeometryError: a position contains NaN.
        """
        return self._geometry.closest_position(positions)

    def at_position(
        self,
        layer: str,
        positions: ArrayLike,
        interpolation: Interpolation | str = Interpolation.NEAREST,
    ) -> float | NDArray[np.float64]:
        """Return the values of a layer at positions.

        If cubic interpolation needs a cell that is not finite, linear interpolation is used
        instead. If linear interpolation also needs such a cell, the result is the value of the
        nearest cell, which may be NaN. At the map border, the border cell replaces missing
        neighbors.

        Args:
            layer: name of the layer.
            positions: (2,) or (N, 2) x, y [m].
            interpolation: interpolation method, or its name such as "linear".

        Returns:
            A float for one position, else (N,) float64.
        """
        return interpolate(self, layer, positions, interpolation)

    def _checked(self, index: ArrayLike) -> Size:
        row, column = cell = as_size(index, "index")
        rows, columns = self._geometry.size
        if not (0 <= row < rows and 0 <= column < columns):
            self._geometry.check_indices(cell)
        return cell

    # Validity and vectors

    def is_valid(self, index: ArrayLike, layers: str | Iterable[str] | None = None) -> bool | Mask:
        """Return whether one or several cells are valid, that is, finite in all `layers`.

        Args:
            index: one buffer index (row, col), or several as (rows, cols) or (N, 2).
            layers: names of layers; None means the basic layers. Without any layers, no cell is
                valid.
        """
        cell = plain_cell(index)
        if cell is not None:
            self._checked(cell)
            names = self._names(layers)
            return bool(names) and all(isfinite(self._layers[n].item(cell)) for n in names)
        cells = self._geometry.check_indices(index)
        names = self._names(layers)
        valid = np.full(cells[0].shape, bool(names))
        for name in names:
            valid &= np.isfinite(self._layers[name][cells])
        return bool(valid) if valid.ndim == 0 else valid

    def valid_mask(self, layers: str | Iterable[str] | None = None) -> Mask:
        """Return a mask (rows, cols) of the valid cells, as `is_valid` defines them."""
        names = self._names(layers)
        valid: Mask = np.full(self.size, bool(names), order="F")
        for name in names:
            valid &= np.isfinite(self._layers[name])
        return valid

    def _names(self, layers: str | Iterable[str] | None) -> tuple[str, ...]:
        return self._basic_layers if layers is None else select_layers(self._layers, layers)

    def get_position3(self, layer: str, index: ArrayLike) -> Positions:
        """Return x, y [m] and the value (3,) of a cell; all are NaN if the value is not finite."""
        cell = self._checked(index)
        x, y = self._geometry.center_of(cell, self._start)
        return _finite_or_nan(x, y, self[layer].item(cell))

    def get_vector(self, prefix: str, index: ArrayLike) -> Positions:
        """Return the vector (3,) of a cell in the layers `prefix` + "x", "y" and "z".

        If a component is not finite, all components are NaN.
        """
        cell = self._checked(index)
        return _finite_or_nan(*(self[f"{prefix}{axis}"].item(cell) for axis in "xyz"))

    # Moving and cutting

    def move(self, position: ArrayLike) -> list[BufferRegion]:
        """Move the map to a new center. Data keeps its position in the frame.

        The map moves by whole cells, so the new center is within half a cell of `position`. Data
        that leaves the map is lost, and new cells are NaN in all layers. No data is copied.

        Args:
            position: (2,) new center [m].

        Returns:
            Buffer regions of the new cells; empty if the map did not move.
        """
        shift = self._geometry.index_shift(position)
        if shift == (0, 0):
            return []
        (rows, columns), (row, column) = size, start = self._geometry.size, self._start
        regions = ring_buffer.uncovered(start, size, shift)
        for region in regions:
            slices = region.slices
            for data in self.values():
                data[slices] = _NO_DATA
        self._start = (row + shift[0]) % rows, (column + shift[1]) % columns
        self._geometry = self._geometry.shifted(shift)
        return regions

    def unwrapped(self, layer: str) -> Layer:
        """Return a layer (rows, cols) in map order: row 0, column 0 has the largest x and y.

        If `start_index` is (0, 0), the result is the layer itself, otherwise a copy. To change the
        layer, use `set_unwrapped`.
        """
        return self._from_start(self[layer], (0, 0))

    def set_unwrapped(self, layer: str, value: ArrayLike) -> None:
        """Add or replace a layer whose values are in map order.

        Args:
            layer: name of the layer.
            value: a number for all cells, or a (rows, cols) array in map order; copied.
        """
        if self._start == (0, 0) or hasattr(value, "dims"):
            self[layer] = value
        else:
            back = -self._start[0] % self.size[0], -self._start[1] % self.size[1]
            self._layers[layer] = ring_buffer.unwrapped(self._adopt(layer, value), back)

    def with_start_index(self, index: ArrayLike) -> GridMap:
        """Return a copy of the map whose layers are stored with the start index `index`.

        `with_start_index((0, 0))` stores all layers in map order.
        """
        result = self._with({})
        result.start_index = index
        for name, data in self._layers.items():
            stored = self._from_start(data, result._start)
            result._layers[name] = data.copy("F") if stored is data else stored
        result._basic_layers = self._basic_layers
        return result

    def convert_to_default_start_index(self) -> None:
        """Reorder the stored layers to map order, so that `start_index` is (0, 0)."""
        self._layers = {name: self.unwrapped(name) for name in self._layers}
        self._start = (0, 0)

    def get_submap(self, position: ArrayLike, length: ArrayLike) -> GridMap:
        """Return a copy of the cells that a rectangle overlaps.

        The rectangle is clipped to the map. A cell counts only if the rectangle extends into it by
        more than 1e-9 m.

        Args:
            position: (2,) center of the rectangle [m].
            length: (2,) side lengths along x and y [m].

        Returns:
            A map with the same layers, basic layers, frame, time and `crs`. Its start index is
            (0, 0).
        """
        return self._block(*self._geometry.overlapped(position, length))

    def get_block(self, rows: slice, columns: slice) -> GridMap:
        """Return a copy of a block of cells, with the same attributes as in `get_submap`.

        Args:
            rows, columns: nonempty slices in map order, without a step.
        """
        return self._block(
            *(
                slice(*part.indices(count)[:2])
                for part, count in zip((rows, columns), self.size, strict=True)
            )
        )

    def _block(self, rows: slice, columns: slice) -> GridMap:
        copies = ring_buffer.copies(self._start, self.size, rows, columns)
        shape = rows.stop - rows.start, columns.stop - columns.start
        layers = {}
        for name, data in self._layers.items():
            layers[name] = out = np.empty(shape, np.float32, "F")
            for source, target in copies:
                out[target] = data[source]
        return self._with(layers, self._geometry.cropped(rows, columns), (0, 0))

    def extend_to_include(self, other: GridMap) -> None:
        """Extend the map by whole cells so that it covers another map.

        Existing cells keep their positions and values. New cells are NaN. If the map already
        covers the other map (within 1e-9 m), it does not change. Otherwise `start_index` becomes
        (0, 0). `add_data_from` also copies the data.

        Raises:
            GridMapError: the maps name different frames or reference systems.
            GeometryError: the maps are so far apart that there would be too many cells.
        """
        extended = merge.extended_map(self, other)
        self._geometry, self._start = extended._geometry, extended._start
        self._layers = extended._layers

    def add_data_from(
        self,
        other: GridMap,
        *,
        extend_map: bool,
        overwrite_data: bool,
        layers: Iterable[str] | None = None,
    ) -> None:
        """Copy data from another map, which may differ in size, position and resolution.

        Each cell of this map gets the values of the `other` cell that contains its center.
        Values that are not finite are not copied. A map without `crs` adopts the `crs` of `other`.

        Args:
            other: the map to copy from, in the same frame or without a frame.
            extend_map: whether to extend this map first, as `extend_to_include` does.
            overwrite_data: whether to overwrite the finite values of this map.
            layers: names of the layers to copy; None means all layers of the other map. Layers
                missing in this map are added.

        Raises:
            GridMapError: the maps name different frames or reference systems.
            GeometryError: the maps are so far apart that there would be too many cells.
        """
        merge.add_data_from(
            self, other, extend_map=extend_map, overwrite_data=overwrite_data, layers=layers
        )

    def get_transformed_map(
        self, transform: ArrayLike, height_layer: str, frame_id: str, sample_ratio: float = 0.0
    ) -> GridMap:
        """Return the map in another frame, as its surface appears from above.

        Each cell with a finite height becomes a 3-D point with the values of the other layers. If
        several points are in the same cell of the new map, the highest point is used. Among equally
        high points, the point from the last cell in column-major map order is used. Points outside
        the new map are dropped.

        Args:
            transform: (4, 4) rotation and translation [m] from the frame of this map to the new
                one. Scaling, shear and reflection are rejected.
            height_layer: name of the layer that holds z [m].
            frame_id: the new frame.
            sample_ratio: distance from a cell center to four additional points, as a fraction of
                the resolution; 0 for none. The points close gaps in the new map. They lie at the
                height of the cell, in the directions +x, -x, +y and -y of this map.

        Returns:
            A map with the same resolution, layers, basic layers and time, but no `crs`. Its start
            index is (0, 0). It covers the transformed corners of this map at z = 0.
        """
        return transformed_map(self, transform, height_layer, frame_id, sample_ratio)

    # xarray

    def to_xarray(self, *, crs: Any = "") -> xarray.Dataset:
        """Return the map as an xarray dataset.

        Each layer is a float32 variable with the dimensions ("x", "y"). The coordinates are the
        cell centers [m], both descending. If `start_index` is (0, 0), the dataset shares memory
        with the map. The attributes `frame_id`, `timestamp` [ns], `basic_layers`, `resolution` [m]
        and `position` [m] describe the map.

        Args:
            crs: coordinate reference system of the frame, such as "EPSG:25832"; if empty, the `crs`
                of the map. It is stored in the coordinate `spatial_ref`, as rioxarray expects.

        Raises:
            MissingPackageError: xarray, or pyproj for `crs`, is not installed.
            ConfigError: `crs` is unknown.
            GridMapError: a layer is named x, y or spatial_ref.
        """
        from ..tiled._datasets import to_dataset
        from ..tiled._tiled_map import register

        dataset = to_dataset(self._in_crs(crs))
        register()
        return dataset

    @classmethod
    def from_xarray(
        cls,
        dataset: xarray.Dataset | xarray.DataArray,
        layers: Iterable[str] | None = None,
    ) -> GridMap:
        """Create a map from an xarray dataset or array; the values are copied.

        Each variable with the dimensions x and y, in any order and direction, becomes a layer. If
        it also has the dimension `band`, each band becomes a layer. Values equal to `_FillValue`
        become NaN. Scales and offsets are applied. Variables without x or y are ignored. An unnamed
        array becomes the layer `elevation`. The attribute `frame_id` names the frame; the default
        is "map".

        Args:
            dataset: dataset or array; the coordinates x and y are the evenly spaced centers of
                square cells [m]. A map of one cell needs the attribute `resolution` [m].
            layers: names of the layers to read; None means all.

        Raises:
            GeometryError: coordinates are missing, not finite or not evenly spaced, or the cells
                are not square.
            LimitError: the map exceeds the limits in `grid_map_core_py.limits`.
            GridMapError: a layer has further dimensions or non-numeric values, the values cannot
                be read, or an attribute is invalid.
        """
        from ..tiled._tiled_map import GridMapAccessor

        return GridMapAccessor(dataset).to_map(layers)

    # Pictures

    def plot(self, layer: str = "", ax: Any = None, *, style: str = "flat", **options: Any) -> Any:
        """Draw the map with Matplotlib and return the axes.

        Args:
            layer: layer drawn as colors (style "flat") or as heights (other styles); empty means
                `elevation` if it exists, else the first layer.
            ax: axes to draw on; None means the current axes, or new axes for "surface".
            style: "flat", "surface" or "relief", or a style that another package adds.
            options: keyword arguments of the function that draws the style: `plot`, `plot_3d` or
                `plot_relief` in `grid_map_visualization_py.pictures`.

        Raises:
            MissingPackageError: grid_map_visualization_py or Matplotlib is not installed.
            ConfigError: the style is unknown, or an option is invalid.
        """
        from ._plots import plot

        return plot(self, layer, ax, style, options)

    def __repr__(self) -> str:
        (rows, columns), (x, y) = self.size, self.length.tolist()
        return cut(
            f"GridMap({rows} x {columns} cells of {self.resolution:.12g} m, {x:.12g} x {y:.12g} m "
            f"at {as_text(self.position)} in {self.frame_id!r}, "
            f"layers: {', '.join(self) or '(none)'})"
        )

    def _repr_html_(self) -> str:
        from ._notebook import to_html

        return to_html(self)

    def _repr_png_(self) -> bytes | None:
        from ._notebook import to_png

        return to_png(self)

    def _in_my_order(self, layers: Any) -> Any:
        """Reorder `layers` to this map's start index if it is a `GridMap` of the same size."""
        if isinstance(layers, GridMap) and layers.size == self.size:
            return layers if layers._start == self._start else layers.with_start_index(self._start)
        return layers

    def _aligned(self, name: str, value: Any) -> ArrayLike:
        """Align an xarray array with the buffer by its coordinates; return other values as is."""
        if not getattr(value, "dims", ()):
            return value  # type: ignore[no-any-return]
        x, y = (axis + start for axis, start in zip(self.axes(), self.origin, strict=True))
        near = {"method": "nearest", "tolerance": _LARGEST_REST * self.resolution}
        try:
            if hasattr(value, "to_dataset"):
                decode = import_module("xarray").decode_cf
                encoded = value.to_dataset(name=name)
                value = decode(encoded, decode_times=False, decode_coords=False)[name]
            return np.asarray(value.sel(x=x, y=y, **near).transpose("x", "y"))
        except Exception as error:  # xarray and pandas raise errors of many types
            expected = "the dimensions x and y with the coordinates of all cells [m]"
            found = f"{short(value.dims)}. Pass `array.values` if they are (rows, cols)"
            raise GeometryError(f"layer {name!r}: expected {expected}, got {found}") from error

    def _adopt(self, name: str, data: ArrayLike) -> Layer:
        if not is_name(name):
            raise _wrong_name(name)
        if (
            isinstance(data, np.ndarray)
            and data.dtype == np.float32
            and data.shape == self.size
            and data.flags.f_contiguous
        ):
            return data
        return as_layer(self._aligned(name, data), self.size, name)

    def _sharing(self, layers: dict[str, Layer]) -> GridMap:
        """Return a map with the given layers. Layers of this map are copied on first access."""
        result, mine = self._with(layers), {*map(id, self._layers.values())}
        # Read-only arrays need no copy.
        result._shared = {n for n, d in layers.items() if id(d) in mine and d.flags.writeable}
        return result

    def _with(
        self,
        layers: dict[str, Layer],
        geometry: GridGeometry | None = None,
        start: Size | None = None,
    ) -> GridMap:
        """Return a map with these layers and all other attributes, without any checks."""
        result = GridMap.__new__(GridMap)
        result._put(
            geometry or self._geometry,
            start or self._start,
            layers,
            tuple([name for name in self._basic_layers if name in layers]),
            self._frame_id,
            self._timestamp,
            self._reference,
        )
        return result

    def _from_start(self, data: Layer, start: Size) -> Layer:
        """Reorder `data` from this map's start index to `start`, without an unnecessary copy."""
        (row, column), (rows, columns) = self._start, self.size
        first = (row - start[0]) % rows, (column - start[1]) % columns
        return data if first == (0, 0) else ring_buffer.unwrapped(data, first)


def _as_frame(frame_id: str) -> str:
    if frame_id != "" and not is_name(frame_id):
        expected = "a string without control characters"
        raise GridMapError(f"frame_id: expected {expected}, got {short(frame_id)}")
    return frame_id


def _as_time(timestamp: int) -> int:
    try:
        return operator.index(timestamp)
    except TypeError:
        raise GridMapError(
            f"timestamp: expected an integer of nanoseconds, got {short(timestamp)}"
        ) from None


def _wrong_name(layer: object) -> GridMapError:
    expected = "a name, a non-empty string without control characters"
    return GridMapError(f"layer: expected {expected}, got {short(layer)}")


def _finite_or_nan(*vector: float) -> Positions:
    return np.array(vector if all(map(isfinite, vector)) else (nan, nan, nan))
