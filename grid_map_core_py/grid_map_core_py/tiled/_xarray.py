# SPDX-License-Identifier: BSD-3-Clause
"""Maps and datasets of xarray: coordinates, attributes, and windows of datasets.

A variable of dimensions ("x", "y") is a layer as it is stored: x and y descend.
"""

import re
import warnings
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np

from .._arrays._checks import Layer, Size, as_layer, select_layers
from ..errors import (
    ConfigError,
    GridMapError,
    MissingPackageError,
    required,
    short,
)
from ..files._shared import storage_errors
from ..limits import check_cells
from ..map._geometry import GridGeometry
from ..map._grid_map import GridMap
from ._datasets import (
    CRS_VARIABLE,
    DIMENSIONS,
    REMEDY,
    as_dataset,
    crs_of,
    described,
    geometry_of,
    layers_of,
)
from ._source import TILE, Window, shape
from ._tiled_map import TiledMap

if TYPE_CHECKING:
    import xarray

_WKT = re.compile(r"\s*[A-Z]\w*\s*\[", re.IGNORECASE)

_DEGREES = re.compile(r"\s*GEOG\w*\s*\[", re.IGNORECASE)
"""Beginning of the WKT of latitudes and longitudes."""


def coordinates(geometry: GridGeometry) -> dict[str, Any]:
    """Return the coordinates of a dataset: centers of cells [m]."""
    return {
        name: (name, axis, {"units": "m", "standard_name": f"projection_{name}_coordinate"})
        for name, axis in zip(DIMENSIONS, geometry.axes_in_map_order(), strict=True)
    }


def attributes(
    geometry: GridGeometry,
    layers: Iterable[str],
    frame_id: str,
    timestamp: int,
    basic_layers: Sequence[str],
) -> dict[str, Any]:
    """Return the attributes of the dataset of a map."""
    return {
        # Stores do not keep the order of variables.
        "layers": [*layers],
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
    return dataset_of(grid_map.geometry, layers, attributes(grid_map.geometry, layers, *about), crs)


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
        with storage_errors(Path(self.name), "read"):
            variables = self.dataset.variables
            parts = [variables[name].isel(stored).transpose(*DIMENSIONS) for name in names]
            return [
                as_layer(self.turned(values), shape(window), name)
                for name, values in zip(names, _computed(parts), strict=True)
            ]

    def stored(self, window: Window) -> dict[str, slice]:
        """Return a window in the order of the dataset, for `isel`."""
        return dict(zip(DIMENSIONS, self.mirrored(window), strict=True))

    def mirrored(self, window: Window) -> Window:
        """Return a window of the map as one of the dataset (x, y), or the other way around."""
        rows, columns = (
            slice(size - part.stop, size - part.start) if ascends else part
            for part, size, ascends in zip(window, self.size, self.ascends, strict=True)
        )
        return rows, columns

    def turned(self, cells: Any) -> Any:
        """Return a view of cells (x, y) of the dataset in the order of the map."""
        return cells[tuple(slice(None, None, -1 if ascends else None) for ascends in self.ascends)]


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
    frame_id, timestamp, basic_layers = described(dataset.attrs, layers)
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
