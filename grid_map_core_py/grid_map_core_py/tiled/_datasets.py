# SPDX-License-Identifier: BSD-3-Clause
"""Converts maps to xarray datasets, and reads layers from datasets.

Each layer becomes a variable with the dimensions ("x", "y") in map order, so both coordinates
descend. Datasets from other programs may have the dimensions ("y", "x") and ascending coordinates.
"""

import re
import warnings
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from typing import TYPE_CHECKING, Any, ClassVar
from uuid import uuid4
from weakref import WeakValueDictionary

import numpy as np
from numpy.typing import NDArray

from .._arrays._checks import Layer, Positions, Size, as_array, as_layer, select_layers
from ..errors import (
    GeometryError,
    GridMapError,
    MissingPackageError,
    required,
    short,
    wrong_crs,
)
from ..files._shared import storage_errors
from ..map._geometry import GridGeometry
from ..map._grid_map import GridMap
from ._source import TILE, TiledData, Window, shape

if TYPE_CHECKING:
    import xarray


DIMENSIONS = ("x", "y")

CRS_VARIABLE = "spatial_ref"
"""Name of the variable with the coordinate reference system, as in rioxarray."""

_BAND = "band"  # name of the band dimension in rioxarray

_ENCODED = ("_FillValue", "missing_value", "scale_factor", "add_offset")
"""Attributes that xarray removes when it decodes the values of a variable."""

_LARGEST_DIFFERENCE = 1e-3  # maximum deviation of a coordinate from an evenly spaced grid [cells]

_WKT = re.compile(r"\s*[A-Z]\w*\s*\[", re.IGNORECASE)

_DEGREES = re.compile(r"\s*GEOG\w*\s*\[", re.IGNORECASE)
"""Matches the beginning of the WKT of a geographic reference system."""

_ORIGINS = WeakValueDictionary[tuple[str, str], TiledData]()
"""Tiled map from which a Dask array was created, by (layer name, name of the Dask array)."""

# --- from maps ------------------------------------------------------------------------------------


def coordinates(geometry: GridGeometry, origin: Sequence[float] = (0.0, 0.0)) -> dict[str, Any]:
    """Return the cell centers as coordinates x and y in the reference system [m]."""
    axes = zip(DIMENSIONS, geometry.axes_in_map_order(), origin, strict=True)
    return {
        name: (name, axis + start, {"units": "m", "standard_name": f"projection_{name}_coordinate"})
        for name, axis, start in axes
    }


def attributes(described: GridMap | TiledData, layers: Iterable[str]) -> dict[str, Any]:
    names, origin = [*layers], described.origin
    return {
        # Zarr stores do not preserve the order of variables.
        "layers": names,
        "frame_id": described.frame_id,
        "timestamp": described.timestamp,
        "basic_layers": [name for name in described.basic_layers if name in names],
        "resolution": described.resolution,
        # A center computed from the coordinates would have a rounding error.
        "position": described.position.tolist(),
    } | ({"origin": [*origin]} if any(origin) else {})


def to_dataset(grid_map: GridMap) -> "xarray.Dataset":
    return dataset_of(grid_map, {name: grid_map.unwrapped(name) for name in grid_map})


def dataset_of(described: GridMap | TiledData, layers: Mapping[str, Any]) -> "xarray.Dataset":
    """Create a dataset from NumPy or Dask arrays in map order, without copying the arrays."""
    crs, about = described.crs, attributes(described, layers)
    xr = required("xarray", "a dataset")
    if taken := {*layers} & {*DIMENSIONS, CRS_VARIABLE}:
        raise GridMapError(
            f"layers: expected other names than those of coordinates, got {min(taken)!r}"
        )
    mapping = {"grid_mapping": CRS_VARIABLE} if crs else {}
    variables = {
        name: xr.Variable(DIMENSIONS, data, encoding=mapping) for name, data in layers.items()
    }
    known = coordinates(described.geometry, described.origin)
    if crs:
        known[CRS_VARIABLE] = ((), 0, grid_mapping(crs))
    dataset: xarray.Dataset = xr.Dataset(variables, known, about)
    return dataset


def grid_mapping(crs: str) -> dict[str, Any]:
    """Return the CF grid mapping attributes of a reference system; WKT requires no pyproj."""
    is_wkt = bool(_WKT.match(crs))
    wkt, about = crs, {}
    try:
        pyproj = required("pyproj", f"crs {short(crs)}")
        found = pyproj.CRS.from_user_input(crs)
        wkt, about = crs if is_wkt else found.to_wkt(), found.to_cf()
    except MissingPackageError:
        if not is_wkt:
            raise
    except RuntimeError:  # pyproj's CRSError is a subclass
        if not is_wkt:
            raise wrong_crs(crs) from None
    return {**about, "crs_wkt": wkt, "spatial_ref": wkt}


# --- from datasets --------------------------------------------------------------------------------


def as_dataset(data: "xarray.Dataset | xarray.DataArray") -> "xarray.Dataset":
    """Convert a dataset or data array to a dataset with one variable per band.

    A single band keeps the name of its variable. If several bands have no unique names, they
    are named `height_1`, `height_2`, and so on. Missing values become NaN. Scales and offsets are
    applied.
    """
    xr = required("xarray", "a dataset")
    dataset: Any = data
    prefix = None
    if isinstance(data, xr.DataArray):
        prefix = None if data.name else _BAND
        dataset = data.to_dataset(name=data.name or "elevation").assign_attrs(data.attrs)
    elif not isinstance(data, xr.Dataset):
        expected = "a Dataset or DataArray of xarray"
        raise GridMapError(f"dataset: expected {expected}, got {short(data)}")
    if _BAND in dataset.dims:
        layers: dict[str, Any] = {}
        for name, array in dataset.data_vars.items():
            if _BAND not in array.dims:
                layers[str(name)] = array
                continue
            count, names = array.sizes[_BAND], array.attrs.get("long_name", ())
            if count == 1:
                names = [name]
            elif isinstance(names, str) or len({*names}) != count:
                names = [f"{prefix or name}_{number}" for number in range(1, count + 1)]
            for number, band in enumerate(names):
                layers[str(band)] = array.isel({_BAND: number}, drop=True)
        dataset = dataset.drop_dims(_BAND).assign(layers)
    if any({*_ENCODED} & {*variable.attrs} for variable in dataset.data_vars.values()):
        dataset = xr.decode_cf(dataset, decode_times=False, decode_coords=False)
    return dataset  # type: ignore[no-any-return]


def geometry_of(dataset: "xarray.Dataset") -> tuple[GridGeometry, tuple[bool, bool]]:
    """Return the geometry of a dataset in the map frame, and whether x and y ascend."""
    axes: list[Positions] = []
    for name in DIMENSIONS:
        if name not in dataset.coords or dataset[name].dims != (name,):
            raise GeometryError(
                f"{name}: expected the dimensions x and y with coordinates [m], got the dimensions "
                f"{short([*dataset.sizes])} and the coordinates {short([*dataset.coords])}; "
                "dataset.rename(lon='x', lat='y') changes names"
            )
        centers = as_array(dataset[name].values, np.float64, name)
        if not centers.size or not np.isfinite(centers).all():
            raise GeometryError(f"{name}: expected finite coordinates, got {short(centers)}")
        even = np.linspace(centers[0], centers[-1], centers.size)
        step = abs(even[-1] - even[0]) / max(centers.size - 1, 1)
        is_even = np.abs(centers - even).max() <= _LARGEST_DIFFERENCE * step
        if centers.size > 1 and not (step > 0 and is_even):
            steps = np.diff(centers)
            raise GeometryError(
                f"{name}: expected evenly spaced coordinates, got steps from {steps.min():.6g} to "
                f"{steps.max():.6g}"
            )
        axes.append(centers)
    resolution = _resolution(dataset, axes)
    middle = np.array([0.5 * (axis[0] + axis[-1]) for axis in axes]) - _origin_of(dataset)
    given = np.asarray(dataset.attrs.get("position", middle))
    # After slicing, a dataset still has the attributes of the original dataset.
    fits = given.shape == (2,) and given.dtype.kind in "iuf"
    position = given if fits and np.abs(given - middle).max() < 1e-6 * resolution else middle
    geometry = GridGeometry.from_size((axes[0].size, axes[1].size), resolution, position)
    return geometry, (bool(axes[0][-1] > axes[0][0]), bool(axes[1][-1] > axes[1][0]))


def _origin_of(dataset: "xarray.Dataset") -> tuple[float, float]:
    given = dataset.attrs.get("origin", (0.0, 0.0))
    try:
        x, y = map(float, given)
    except (TypeError, ValueError):
        raise GridMapError(f"origin: expected two numbers [m], got {short(given)}") from None
    return x, y


def _names_of(dataset: "xarray.Dataset", key: str) -> list[str]:
    given = dataset.attrs.get(key, ())
    try:
        return [given] if isinstance(given, str) else [str(each) for each in given]
    except TypeError:
        raise GridMapError(f"{key}: expected names of layers, got {short(given)}") from None


def _resolution(dataset: "xarray.Dataset", axes: Sequence[Positions]) -> float:
    """Return the attribute `resolution`; the coordinate spacing if the attribute does not match."""
    steps = [abs(axis[-1] - axis[0]) / (axis.size - 1) for axis in axes if axis.size > 1]
    if steps and max(steps) - min(steps) > _LARGEST_DIFFERENCE * min(steps):
        raise GeometryError(
            f"dataset: expected cells that are squares, got {steps[0]:.6g} x {steps[1]:.6g} m"
        )
    given = dataset.attrs.get("resolution")
    side = float(given) if isinstance(given, int | float | np.number) else 0.0
    if side > 0 and all(abs(step - side) <= _LARGEST_DIFFERENCE * side for step in steps):
        return side
    if not steps:
        expected = "the attribute 'resolution' [m] of one cell"
        raise GeometryError(f"dataset: expected {expected}, got {short(given)}")
    return float(steps[0])


def layers_of(dataset: "xarray.Dataset") -> tuple[str, ...]:
    layers = []
    for key, variable in dataset.data_vars.items():
        name, dimensions = str(key), variable.dims
        if not {*DIMENSIONS} <= {*dimensions}:
            continue
        others = [each for each in dimensions if each not in DIMENSIONS]
        if others:
            raise GridMapError(
                f"layer {name!r}: expected the dimensions x and y, got {short(dimensions)}; "
                f"dataset.isel({others[0]}=0) takes one of many"
            )
        if variable.dtype.kind not in "biuf":
            raise GridMapError(f"layer {name!r}: expected numbers, got {variable.dtype}")
        layers.append(name)
    # Zarr stores return variables in any order.
    order = [*_names_of(dataset, "layers"), *layers]
    return tuple(sorted(layers, key=order.index))


def crs_of(dataset: "xarray.Dataset") -> str:
    """Return the reference system of a dataset as WKT; empty if it has none."""
    names = [
        variable.encoding.get("grid_mapping") or variable.attrs.get("grid_mapping")
        for variable in dataset.data_vars.values()
    ]
    for name in (*names, CRS_VARIABLE):
        if name in dataset.variables:
            about = dataset[name].attrs
            return str(about.get("crs_wkt") or about.get("spatial_ref") or "")
    return ""


# --- windows --------------------------------------------------------------------------------------


@dataclass(frozen=True, eq=False)
class DatasetSource:
    """Source that reads layers from a dataset in memory, in a file or in Dask arrays."""

    dataset: "xarray.Dataset"
    layers: tuple[str, ...]
    name: str
    ascends: tuple[bool, bool]

    reads_layers_alone: ClassVar[bool] = True

    def describe(self) -> str:
        return str(required("dask.base", "tiled maps").tokenize(self.dataset))

    def prepare(self) -> None:
        """Do nothing, because windows share no data."""

    def read(self, window: Window, names: Sequence[str]) -> list[Layer]:
        with storage_errors(f"{self.name}/{names[0]}" if len(names) == 1 else self.name, "read"):
            # Without layers, the dataset has no dimensions.
            rows, columns = (self.dataset.sizes.get(each, 0) for each in DIMENSIONS)
            stored = mirrored(window, (rows, columns), self.ascends)
            part = dict(zip(DIMENSIONS, stored, strict=True))
            layers = [self.dataset.variables[name].isel(part) for name in names]
            if any(layer.chunks for layer in layers):
                compute = required("dask.base", "a dataset of Dask").compute
                # Compute in this thread. Within a Dask task, a pool would wait for busy threads.
                values = compute(*(layer.data for layer in layers), scheduler="synchronous")
            else:
                values = [layer.values for layer in layers]
            # zarr-python 2 cannot read backwards, so the layers are reversed in memory.
            order = tuple(slice(None, None, -1 if each else None) for each in self.ascends)
            return [
                as_layer(np.asarray(each)[order], shape(window), name)
                for name, each in zip(names, values, strict=True)
            ]


def open_dataset(
    data: "xarray.Dataset | xarray.DataArray", tile: Size | None = None, name: str = "dataset"
) -> TiledData:
    """Open a dataset as a tiled map; see `GridMap.from_xarray`.

    The default tile has the size of the first Dask chunk, or 1024 x 1024 cells.
    """
    dataset = as_dataset(data)
    geometry, ascends = geometry_of(dataset)
    layers = layers_of(dataset)
    lazy = [dataset[name].chunksizes for name in layers if dataset[name].chunks]
    chunks = [lazy[0][side][0] for side in DIMENSIONS] if lazy else [TILE, TILE]
    about = dataset.attrs
    timestamp, basic = about.get("timestamp", 0), _names_of(dataset, "basic_layers")
    if not isinstance(timestamp, int | np.integer):
        expected = "an integer of nanoseconds"
        raise GridMapError(f"timestamp: expected {expected}, got {short(timestamp)}")
    crs = crs_of(dataset)
    if _DEGREES.match(crs) or "degree" in str(dataset["x"].attrs.get("units")):
        warnings.warn(
            f"{name}: x and y are in degrees, which are treated as meters; "
            "dataset.rio.reproject(...) of rioxarray projects it",
            stacklevel=3,
        )
    # Without the coordinates, less data is pickled and sent to each process.
    bare = dataset.drop_vars([*dataset.coords])[[*layers]]
    ordered = bare.transpose(*DIMENSIONS, missing_dims="ignore")
    return TiledData(
        DatasetSource(ordered, layers, name, ascends),
        geometry,
        tile or (chunks[0], chunks[1]),
        frame_id=str(about.get("frame_id", "map")),
        timestamp=int(timestamp),
        basic_layers=tuple(each for each in basic if each in layers),
        crs=crs,
        origin=_origin_of(dataset),
    )


def turned(ascends: Sequence[bool]) -> dict[str, slice]:
    """Return the argument of `isel` that reverses ascending coordinates."""
    return {
        name: slice(None, None, -1) for name, each in zip(DIMENSIONS, ascends, strict=True) if each
    }


def mirrored(window: Window, size: Size, ascends: Sequence[bool]) -> Window:
    """Mirror a window between map order and the order of a dataset."""
    rows, columns = (
        slice(length - part.stop, length - part.start) if each else part
        for part, length, each in zip(window, size, ascends, strict=True)
    )
    return rows, columns


# --- tiled maps as datasets of Dask arrays --------------------------------------------------------


def to_lazy_dataset(tiled_map: TiledData, layers: Iterable[str] | None = None) -> "xarray.Dataset":
    required("dask.array", "a dataset that is computed later")
    from dask.array import map_blocks
    from dask.delayed import delayed

    names = select_layers(tiled_map.layers, layers)
    source = tiled_map.source
    source.prepare()
    chunks = tuple(
        tuple(min(side, size - first) for first in range(0, size, side))
        for size, side in zip(tiled_map.size, tiled_map.tile, strict=True)
    )
    # The map is a task of its own in the Dask graph, so each worker receives it only once.
    known = delayed(tiled_map, name=f"map-{uuid4().hex}", traverse=False)
    arrays: dict[str, Any] = {}
    for group in [[n] for n in names] if getattr(source, "reads_layers_alone", False) else [names]:
        # Without a name, Dask would hash the function and all its data.
        tiles = map_blocks(
            partial(_read, group),
            chunks=tuple((1,) * len(side) for side in chunks),
            dtype=object,
            meta=np.empty((0, 0), object),
            name=f"tiles-{uuid4().hex}",
            tiled_map=known,
        )
        for number, name in enumerate(group):
            arrays[name] = map_blocks(
                lambda tile, number=number: tile[0, 0][number],
                tiles,
                chunks=chunks,
                dtype=np.float32,
                meta=np.empty((0, 0), np.float32),
                name=f"layer-{uuid4().hex}",
            )
    dataset = dataset_of(tiled_map, arrays)
    remember(dataset, tiled_map)
    return dataset


def _read(names: Sequence[str], tiled_map: TiledData, block_id: Size) -> NDArray[np.object_]:
    # Dask requires an array as the result.
    tiles, result = tiled_map.tiles, np.empty((1, 1), object)
    window = tiles[block_id[0] * tiles.counts[1] + block_id[1]]
    result[0, 0] = tiled_map.source.read(window, names)
    return result


def remember(dataset: "xarray.Dataset", tiled_map: TiledData) -> None:
    """Record that a dataset was created from a tiled map, for `origin_of`."""
    for name in {*tiled_map.layers} & {*dataset}:
        _ORIGINS[name, dataset[name].data.name] = tiled_map


def origin_of(dataset: "xarray.Dataset", layers: Sequence[str]) -> TiledData | None:
    """Return the tiled map from which a dataset was created; None if layers have changed.

    Computed layers count as changed.
    """
    arrays = {name: dataset[name].data for name in layers if dataset[name].chunks}
    found = {_ORIGINS.get((name, array.name)) for name, array in arrays.items()}
    (tiled_map,) = found if len(found) == 1 else (None,)
    if tiled_map is None or tuple(layers) != tiled_map.layers or len(arrays) != len(layers):
        return None
    # The Dask graph of a persisted array has a single layer.
    return tiled_map if all(len(array.dask.layers) > 1 for array in arrays.values()) else None
