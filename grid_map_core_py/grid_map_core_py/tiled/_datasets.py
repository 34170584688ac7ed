# SPDX-License-Identifier: BSD-3-Clause
"""The description of a map by a dataset of xarray: grid, layers, frame, reference system."""

from collections.abc import Mapping, Sequence
from contextlib import suppress
from typing import TYPE_CHECKING, Any

import numpy as np

from .._arrays._checks import Positions, as_array
from ..errors import GeometryError, GridMapError, required, short
from ..map._geometry import GridGeometry

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

_LARGEST_DIFFERENCE = 1e-3
"""Largest difference of a coordinate from its place in the grid [cells]."""


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
    # Stores are read in any order.
    order = [*dataset.attrs.get("layers", ()), *layers]
    return tuple(sorted(layers, key=order.index))


def described(about: Mapping[Any, Any], layers: Sequence[str]) -> tuple[str, int, tuple[str, ...]]:
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
