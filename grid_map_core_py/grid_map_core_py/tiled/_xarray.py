# Copyright (c) 2026 grid_map_py contributors
# SPDX-License-Identifier: BSD-3-Clause
"""Maps and datasets of xarray: coordinates, attributes, and windows of datasets.

A variable of dimensions ("x", "y") is a layer as it is stored: x and y descend.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from ..arrays._checks import Layer, Size
from ..errors import GeometryError, required
from ..files._shared import storage_errors
from ..map._geometry import GridGeometry
from ..map._grid_map import GridMap
from ._source import Window
from ._tiled_map import TiledMap

if TYPE_CHECKING:
    import xarray

REMEDY = "pip install 'grid_map_core_py[xarray]'"

DIMENSIONS = ("x", "y")

CRS_VARIABLE = "spatial_ref"
"""Variable that holds the reference system, as CF has it and rioxarray finds it."""

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


def to_dataset(grid_map: GridMap) -> "xarray.Dataset":
    """Return the dataset of a map; see `GridMap.to_xarray`."""
    xarray = required("xarray", "a dataset of xarray", REMEDY)
    layers = {name: (DIMENSIONS, grid_map.unwrapped(name)) for name in grid_map}
    about = attributes(
        grid_map.geometry, grid_map.frame_id, grid_map.timestamp, grid_map.basic_layers
    )
    dataset: xarray.Dataset = xarray.Dataset(layers, coordinates(grid_map.geometry), about)
    return dataset


def geometry_of(dataset: "xarray.Dataset") -> tuple[GridGeometry, tuple[bool, bool]]:
    """Return the geometry of a dataset, and whether x and y ascend.

    Raises:
        GeometryError: a coordinate is missing or not evenly spaced, or cells are no squares.
    """
    ends, steps, flipped = [], [], []
    for name in DIMENSIONS:
        if name not in dataset.coords or dataset[name].dims != (name,):
            expected = "a dataset with the dimensions and coordinates x and y [m]"
            raise GeometryError(f"{name}: expected {expected}, got {[*dataset.coords]}")
        centers = np.asarray(dataset[name].values, np.float64)
        if not centers.size or not np.isfinite(centers).all():
            raise GeometryError(f"{name}: expected finite coordinates, got {centers}")
        first, last = float(centers[0]), float(centers[-1])
        step = abs(last - first) / (centers.size - 1) if centers.size > 1 else None
        if step is not None:
            even = np.linspace(first, last, centers.size)
            if not step > 0 or np.abs(centers - even).max() > _LARGEST_DIFFERENCE * step:
                raise GeometryError(f"{name}: expected evenly spaced coordinates")
        ends.append((first, last, centers.size))
        steps.append(step)
        flipped.append(last > first)
    resolution = _resolution(steps, dataset.attrs.get("resolution"))
    middle = np.array([0.5 * (first + last) for first, last, _ in ends])
    given = np.asarray(dataset.attrs.get("position", middle), np.float64)
    # A part of a dataset has the attributes of the whole one.
    fits = given.shape == (2,) and np.abs(given - middle).max() < 1e-6 * resolution
    position, size = given if fits else middle, (ends[0][2], ends[1][2])
    return GridGeometry.from_size(size, resolution, position), (flipped[0], flipped[1])


def _resolution(steps: Sequence[float | None], given: object) -> float:
    """Return the side of a cell: as given, if the coordinates fit it."""
    known = [step for step in steps if step is not None]
    if isinstance(given, int | float) and given > 0:
        known, resolution = [*known, float(given)], float(given)
    elif known:
        resolution = known[0]
    else:
        raise GeometryError("resolution: expected an attribute of a dataset with one cell")
    if max(known) - min(known) > _LARGEST_DIFFERENCE * resolution:
        raise GeometryError(f"expected cells that are squares, got sides of {known} m")
    return resolution


def layers_of(dataset: "xarray.Dataset") -> tuple[str, ...]:
    """Return the names of the variables that are layers."""
    return tuple(
        str(name)
        for name, variable in dataset.data_vars.items()
        if {*variable.dims} == {*DIMENSIONS}
    )


@dataclass(frozen=True, eq=False)
class DatasetSource:
    """Layers in the variables of a dataset, which may be in memory, in a file, or of Dask.

    Args:
        dataset: its variables of the dimensions x and y are layers.
        layers: their names.
        ascends: whether x and y ascend.
        name: what errors call it.
    """

    dataset: "xarray.Dataset"
    layers: tuple[str, ...]
    ascends: tuple[bool, bool]
    name: str

    def describe(self) -> str:
        path = Path(self.name) / ".zattrs"
        if path.exists():
            return f"{Path(self.name).absolute()} of {path.stat().st_mtime_ns}"
        return str(required("dask.base", "tiled maps", REMEDY).tokenize(self.dataset))

    def prepare(self) -> None:
        """Do nothing: windows have nothing in common."""

    def read(self, window: Window, names: Sequence[str]) -> list[Layer]:
        stored = dict(zip(DIMENSIONS, map(self._stored, range(2), window), strict=True))
        step = tuple(slice(None, None, -1 if ascends else None) for ascends in self.ascends)
        layers = []
        with storage_errors(Path(self.name), "read"):
            for name in names:
                part = self.dataset[name].variable.isel(stored).transpose(*DIMENSIONS)
                # Within a task of Dask, another scheduler would wait for the threads of this one.
                values = part.compute(scheduler="synchronous").values[step]
                layers.append(np.array(values, np.float32, order="F"))
        return layers

    def _stored(self, axis: int, part: slice) -> slice:
        """Return a slice of map order in the order of the dataset."""
        if not self.ascends[axis]:
            return part
        count = self.dataset.sizes[DIMENSIONS[axis]]
        return slice(count - part.stop, count - part.start)


def open_dataset(dataset: "xarray.Dataset", tile: Size, name: str = "dataset") -> TiledMap:
    """Return the tiled map of a dataset."""
    geometry, ascends = geometry_of(dataset)
    about = dataset.attrs
    layers = layers_of(dataset)
    basic = about.get("basic_layers", ())
    basic = [basic] if isinstance(basic, str) else basic
    return TiledMap(
        DatasetSource(dataset.drop_vars([*dataset.coords]), layers, ascends, name),
        geometry,
        tile,
        frame_id=str(about.get("frame_id", "map")),
        timestamp=int(about.get("timestamp", 0)),
        basic_layers=tuple(name for name in basic if name in layers),
        crs=crs_of(dataset),
    )


def crs_of(dataset: "xarray.Dataset") -> str:
    """Return the reference system of a dataset as WKT; empty if it has none."""
    about = dataset[CRS_VARIABLE].attrs if CRS_VARIABLE in dataset.variables else {}
    return str(about.get("crs_wkt") or about.get("spatial_ref") or "")
