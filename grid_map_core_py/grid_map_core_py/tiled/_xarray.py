# Copyright (c) 2026 grid_map_py contributors
# SPDX-License-Identifier: BSD-3-Clause
"""Maps and datasets of xarray: coordinates, attributes, and windows of datasets.

A variable of dimensions ("x", "y") is a layer as it is stored: x and y descend.
"""

import re
import warnings
from collections.abc import Iterable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np

from ..arrays._checks import Layer, Positions, Size, as_array, as_layer, select_layers
from ..errors import (
    ConfigError,
    GeometryError,
    GridMapError,
    MissingPackageError,
    required,
    short,
)
from ..files._shared import storage_errors
from ..limits import check_cells
from ..map._geometry import GridGeometry
from ..map._grid_map import GridMap
from ._source import TILE, Window, shape
from ._tiled_map import TiledMap

if TYPE_CHECKING:
    import xarray

REMEDY = "pip install 'grid_map_core_py[xarray]'"

DIMENSIONS = ("x", "y")

CRS_VARIABLE = "spatial_ref"
"""Variable that holds the reference system, as CF has it and rioxarray finds it."""

_BAND = "band"
"""Dimension of the bands of a raster, as rioxarray has it."""

_ENCODED = ("_FillValue", "missing_value", "scale_factor", "add_offset")
"""Attributes of values that xarray has not decoded."""

_WKT = re.compile(r"\s*[A-Z]\w*\s*\[", re.IGNORECASE)

_DEGREES = re.compile(r"\s*GEOG\w*\s*\[", re.IGNORECASE)
"""Beginning of the WKT of latitudes and longitudes."""

_LARGEST_DIFFERENCE = 1e-3
"""Largest difference of a coordinate from its place in the grid [cells]."""


def coordinates(geometry: GridGeometry) -> dict[str, Any]:
    """Return the coordinates of a dataset: centers of cells [m]."""
    return {
        name: (name, axis, {"units": "m", "standard_name": f"projection_{name}_coordinate"})
        for name, axis in zip(DIMENSIONS, geometry.axes_in_map_order(), strict=True)
    }


def attributes(
    geometry: GridGeometry, frame_id: str, timestamp: int, basic_layers: Sequence[str]
) -> dict[str, Any]:
    """Return the attributes of the dataset of a map."""
    return {
        "frame_id": frame_id,
        "timestamp": timestamp,
        "basic_layers": [*basic_layers],
        "resolution": geometry.resolution,
        # To the last bit, which the mean of two coordinates is not.
        "position": geometry.position.tolist(),
    }


def to_dataset(grid_map: GridMap, crs: str = "") -> "xarray.Dataset":
    """Return the dataset of a map; see `GridMap.to_xarray`."""
    layers = {name: grid_map.unwrapped(name) for name in grid_map}
    about = grid_map.frame_id, grid_map.timestamp, grid_map.basic_layers
    return dataset_of(grid_map.geometry, layers, attributes(grid_map.geometry, *about), crs)


def dataset_of(
    geometry: GridGeometry, layers: Mapping[str, Any], about: Mapping[str, Any], crs: str
) -> "xarray.Dataset":
    """Return a dataset of layers in map order, of NumPy or Dask; they are not copied."""
    xr = required("xarray", "a dataset", REMEDY)
    _register()
    if taken := {*layers} & {*DIMENSIONS, CRS_VARIABLE}:
        raise GridMapError(
            f"layers: expected other names than those of coordinates, got {min(taken)!r}"
        )
    mapping = {"grid_mapping": CRS_VARIABLE} if crs else {}
    variables = {
        name: xr.Variable(DIMENSIONS, data, encoding=mapping) for name, data in layers.items()
    }
    known = coordinates(geometry)
    if crs:
        known[CRS_VARIABLE] = ((), 0, grid_mapping(crs))
    dataset: xarray.Dataset = xr.Dataset(variables, known, about)
    return dataset


def _register() -> None:
    from ._accessor import register

    register()


def grid_mapping(crs: str) -> dict[str, Any]:
    """Return the attributes of the variable that holds a reference system.

    Args:
        crs: WKT, a code such as "EPSG:25832", or a string of PROJ.

    Raises:
        ConfigError: the reference system is unknown.
        MissingPackageError: it is no WKT, and pyproj is not installed.
    """
    is_wkt = bool(_WKT.match(crs))
    wkt, about = crs, {}
    try:
        pyproj = required("pyproj", f"crs {short(crs)}", "pip install 'grid_map_core_py[geo]'")
        found = pyproj.CRS.from_user_input(crs)
        wkt, about = crs if is_wkt else found.to_wkt(), found.to_cf()
    except MissingPackageError:
        if not is_wkt:
            raise
    except RuntimeError:  # that of pyproj is one
        if not is_wkt:
            expected = "WKT, a code such as 'EPSG:25832', or a string of PROJ"
            raise ConfigError(f"crs: expected {expected}, got {short(crs)}") from None
    return {**about, "crs_wkt": wkt, "spatial_ref": wkt}


def from_dataset(
    data: "xarray.Dataset | xarray.DataArray", layers: Iterable[str] | None = None
) -> GridMap:
    """Return the map of a dataset; see `GridMap.from_xarray`."""
    site = open_dataset(data)
    names = select_layers(site.layers, layers)
    check_cells("dataset", site.size, len(names))
    return site.to_map(names)


def as_dataset(data: "xarray.Dataset | xarray.DataArray") -> "xarray.Dataset":
    """Return the dataset of a dataset or an array, with one variable per band.

    Values that are marked as no data become NaN; scales and offsets are applied.
    """
    xr = required("xarray", "a dataset", REMEDY)
    dataset: Any = data
    prefix = None
    if isinstance(data, xr.DataArray):
        prefix = None if data.name else _BAND
        dataset = data.to_dataset(name=data.name or "elevation").assign_attrs(data.attrs)
    elif not isinstance(data, xr.Dataset):
        expected = "a Dataset or DataArray of xarray"
        raise GridMapError(f"dataset: expected {expected}, got {short(data)}")
    if _BAND in dataset.dims:
        dataset = _unstacked(dataset, prefix)
    if any({*_ENCODED} & {*variable.attrs} for variable in dataset.data_vars.values()):
        dataset = xr.decode_cf(dataset, decode_times=False, decode_coords=False)
    return dataset  # type: ignore[no-any-return]


def _unstacked(dataset: "xarray.Dataset", prefix: str | None) -> "xarray.Dataset":
    """Return a dataset whose bands are variables of their own.

    Those without names are called by numbers behind `prefix` or the name of their variable.
    """
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
    return dataset.drop_dims(_BAND).assign(layers)


def geometry_of(dataset: "xarray.Dataset") -> tuple[GridGeometry, tuple[bool, bool]]:
    """Return the geometry of a dataset, and whether x and y ascend.

    Raises:
        GeometryError: a coordinate is missing or not evenly spaced, or cells are no squares.
    """
    axes = [_centers(dataset, name) for name in DIMENSIONS]
    resolution = _resolution(dataset, axes)
    middle = np.array([0.5 * (axis[0] + axis[-1]) for axis in axes])
    given = np.asarray(dataset.attrs.get("position", middle))
    # A part of a dataset has the attributes of the whole one.
    fits = given.shape == (2,) and given.dtype.kind in "iuf"
    position = given if fits and np.abs(given - middle).max() < 1e-6 * resolution else middle
    geometry = GridGeometry.from_size((axes[0].size, axes[1].size), resolution, position)
    return geometry, (bool(axes[0][-1] > axes[0][0]), bool(axes[1][-1] > axes[1][0]))


def _centers(dataset: "xarray.Dataset", name: str) -> Positions:
    """Return a coordinate that is evenly spaced."""
    if name not in dataset.coords or dataset[name].dims != (name,):
        raise GeometryError(
            f"{name}: expected the dimensions x and y with coordinates [m], got the dimensions "
            f"{short([*dataset.sizes])} and the coordinates {short([*dataset.coords])}; "
            "dataset.rename(lon='x', lat='y') changes names"
        )
    centers: Positions = as_array(dataset[name].values, np.float64, name)
    if not centers.size or not np.isfinite(centers).all():
        raise GeometryError(f"{name}: expected finite coordinates, got {short(centers)}")
    if centers.size > 1:
        even = np.linspace(centers[0], centers[-1], centers.size)
        step = abs(even[1] - even[0])
        if not step > 0 or np.abs(centers - even).max() > _LARGEST_DIFFERENCE * step:
            steps = np.diff(centers)
            raise GeometryError(
                f"{name}: expected evenly spaced coordinates, got steps from {steps.min():.6g} to "
                f"{steps.max():.6g}"
            )
    return centers


def _resolution(dataset: "xarray.Dataset", axes: Sequence[Positions]) -> float:
    """Return the side of a cell: as the attributes say, if the coordinates fit it."""
    steps = [abs(axis[-1] - axis[0]) / (axis.size - 1) for axis in axes if axis.size > 1]
    if steps and max(steps) - min(steps) > _LARGEST_DIFFERENCE * min(steps):
        raise GeometryError(
            f"dataset: expected cells that are squares, got {steps[0]:.6g} x {steps[1]:.6g} m"
        )
    for given in (dataset.attrs.get("resolution"), _transform(dataset)):
        side = float(given) if isinstance(given, int | float | np.number) else 0.0
        if side > 0 and all(abs(step - side) <= _LARGEST_DIFFERENCE * side for step in steps):
            return side
    if not steps:
        raise GeometryError(
            "dataset: expected the attribute 'resolution' [m] of one cell, got "
            f"{short(dataset.attrs.get('resolution'))}"
        )
    return float(steps[0])


def _transform(dataset: "xarray.Dataset") -> float | None:
    """Return the side of a pixel that rioxarray has written down."""
    words = str(_mapping(dataset).get("GeoTransform", "")).split()
    with suppress(ValueError):
        return float(words[1]) if len(words) == 6 else None
    return None


def layers_of(dataset: "xarray.Dataset") -> tuple[str, ...]:
    """Return the names of the variables that are layers, in the order of the attribute `layers`.

    Raises:
        GridMapError: a variable has further dimensions, or holds no numbers.
    """
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
    # Stores are read in the order of the alphabet.
    order = [*dataset.attrs.get("layers", ()), *layers]
    return tuple(sorted(layers, key=order.index))


@dataclass(frozen=True, eq=False)
class DatasetSource:
    """Layers in the variables of a dataset, which may be in memory, in a file, or of Dask.

    Args:
        dataset: its variables of the dimensions x and y are layers.
        layers: their names.
        size: rows and columns.
        ascends: whether x and y ascend.
        name: what errors call it.
    """

    dataset: "xarray.Dataset"
    layers: tuple[str, ...]
    size: Size
    ascends: tuple[bool, bool]
    name: str

    reads_layers_alone: ClassVar[bool] = True
    """Several layers take as long together as one after the other."""

    def describe(self) -> str:
        path = Path(self.name) / ".zattrs"
        if path.exists():
            return f"{Path(self.name).absolute()} of {path.stat().st_mtime_ns}"
        return str(required("dask.base", "tiled maps", REMEDY).tokenize(self.dataset))

    def prepare(self) -> None:
        """Do nothing: windows have nothing in common."""

    def read(self, window: Window, names: Sequence[str]) -> list[Layer]:
        stored = self.stored(window)
        step = tuple(slice(None, None, -1 if ascends else None) for ascends in self.ascends)
        with storage_errors(Path(self.name), "read"):
            variables = self.dataset.variables
            parts = [variables[name].isel(stored).transpose(*DIMENSIONS) for name in names]
            return [
                as_layer(values[step], shape(window), name)
                for name, values in zip(names, _computed(parts), strict=True)
            ]

    def stored(self, window: Window) -> dict[str, slice]:
        """Return a window in the order of the dataset, for `isel`."""
        slices = (
            slice(size - part.stop, size - part.start) if ascends else part
            for part, size, ascends in zip(window, self.size, self.ascends, strict=True)
        )
        return dict(zip(DIMENSIONS, slices, strict=True))


def _computed(variables: Sequence["xarray.Variable"]) -> list[Any]:
    """Return the values of variables; those of Dask are computed together."""
    if all(variable.chunks is None for variable in variables):
        return [variable.values for variable in variables]
    compute = required("dask.base", "a dataset of Dask", REMEDY).compute
    # Within a task of Dask, another scheduler would wait for the threads of this one.
    values = compute(*(variable.data for variable in variables), scheduler="synchronous")
    return [np.asarray(each) for each in values]


def open_dataset(
    data: "xarray.Dataset | xarray.DataArray", tile: Size | None = None, name: str = "dataset"
) -> TiledMap:
    """Return the tiled map of a dataset.

    Args:
        data: see `GridMap.from_xarray`; its values are read, or computed, with the windows.
        tile: rows and columns of a tile; None means the chunks of Dask, or else 1024 cells.
        name: what errors call it.

    Raises:
        GeometryError: coordinates are missing or no grid of squares.
        GridMapError: an attribute is wrong, or a layer has other dimensions or no numbers.
    """
    dataset = as_dataset(data)
    _register()
    geometry, ascends = geometry_of(dataset)
    layers = layers_of(dataset)
    lazy = [dataset[name].chunksizes for name in layers if dataset[name].chunks]
    chunks = [lazy[0][side][0] for side in DIMENSIONS] if lazy else [TILE, TILE]
    frame_id, timestamp, basic_layers = _described(dataset.attrs, layers)
    crs = crs_of(dataset)
    if _DEGREES.match(crs) or "degree" in str(dataset["x"].attrs.get("units")):
        warnings.warn(
            f"{name}: x and y are in degrees, which are taken for meters; "
            "dataset.rio.reproject(...) of rioxarray projects it",
            stacklevel=4,
        )
    # Coordinates would be sent along to every process.
    bare = dataset.drop_vars([*dataset.coords])
    return TiledMap(
        DatasetSource(bare, layers, geometry.size, ascends, name),
        geometry,
        tile or (chunks[0], chunks[1]),
        frame_id=frame_id,
        timestamp=timestamp,
        basic_layers=basic_layers,
        crs=crs,
    )


def _described(about: Mapping[Any, Any], layers: Sequence[str]) -> tuple[str, int, tuple[str, ...]]:
    """Return frame, time and basic layers in the attributes of a dataset."""
    basic = about.get("basic_layers", ())
    names = [basic] if isinstance(basic, str) else [str(name) for name in basic]
    timestamp = about.get("timestamp", 0)
    if not isinstance(timestamp, int | np.integer):
        expected = "an integer of nanoseconds"
        raise GridMapError(f"timestamp: expected {expected}, got {short(timestamp)}")
    frame_id = str(about.get("frame_id", "map"))
    return frame_id, int(timestamp), tuple(name for name in names if name in layers)


def crs_of(dataset: "xarray.Dataset") -> str:
    """Return the reference system of a dataset as WKT; empty if it has none."""
    about = _mapping(dataset)
    return str(about.get("crs_wkt") or about.get("spatial_ref") or "")


def _mapping(dataset: "xarray.Dataset") -> Mapping[Any, Any]:
    """Return the attributes of the grid mapping of a dataset; empty if it has none."""
    names = [
        variable.encoding.get("grid_mapping") or variable.attrs.get("grid_mapping")
        for variable in dataset.data_vars.values()
    ]
    for name in (*names, CRS_VARIABLE):
        if name in dataset.variables:
            return dataset[name].attrs
    return {}
