# SPDX-License-Identifier: BSD-3-Clause
"""Array types, and functions that validate and convert arguments."""

from __future__ import annotations

import math
import re
import warnings
from collections.abc import Iterable
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..errors import GeometryError, GridMapError, LayerNotFoundError, short, wrong_crs

Layer: TypeAlias = NDArray[np.float32]
"""(rows, cols) float32, Fortran order; indices grow towards -x and -y. NaN means no data."""

Mask: TypeAlias = NDArray[np.bool_]
"""Booleans, one per cell or per point."""

Positions: TypeAlias = NDArray[np.float64]
"""(2,) or (N, 2) float64: x, y in meters, map frame."""

Integers: TypeAlias = NDArray[np.int64]
"""(N,) int64, such as the rows or the columns of cells."""

Cells: TypeAlias = tuple[Integers, Integers]
"""(rows, cols) of cells, as returned by `numpy.nonzero`; `layer[cells]` returns the cell values."""

Size: TypeAlias = tuple[int, int]
"""Number of rows and number of columns."""


Pair: TypeAlias = tuple[float, float]
"""x, y in meters, map frame, as plain numbers."""

_ROTATION_TOLERANCE = 1e-3
"""Largest deviation of R^T R from I that is accepted as rounding error in a rotation matrix R."""

_EXACT = 2**53  # integers up to this value are exact in float64
_EXACT_FLOAT32 = 2**24  # integers up to this value are exact in float32

_CONTROL = re.compile("[\0-\x1f\x7f-\x9f\ud800-\udfff]")


def as_positions(values: ArrayLike, name: str = "position") -> Positions:
    """Return positions as a float64 array of shape (..., 2)."""
    positions = as_array(values, np.float64, name)
    if positions.ndim == 0 or positions.shape[-1] != 2:
        raise GeometryError(f"{name}: expected x, y of shape (2,) or (N, 2), got {positions.shape}")
    return positions


def as_pair(values: ArrayLike, name: str) -> Pair:
    """Return `values` as two finite numbers."""
    pair = plain_pair(values)
    if pair is None:
        array = as_array(values, np.float64, name)
        pair = tuple(array.tolist()) if array.shape == (2,) else (math.nan, math.nan)
    if not (math.isfinite(pair[0]) and math.isfinite(pair[1])):
        raise GeometryError(f"{name}: expected two finite numbers, got {short(values)}")
    return pair


def as_crs(crs: Any) -> str:
    """Convert a coordinate reference system to text, such as WKT or an EPSG code."""
    if isinstance(crs, int | np.integer):
        return f"EPSG:{crs}"
    text = crs.to_wkt() if hasattr(crs, "to_wkt") else crs or ""
    if not isinstance(text, str):
        raise wrong_crs(crs)
    return text


def as_point(values: ArrayLike, name: str) -> Pair:
    """Return one position x, y; NaN and infinities are allowed."""
    pair = plain_pair(values)
    if pair is None:
        point = as_positions(values, name)
        if point.shape != (2,):
            raise GeometryError(f"{name}: expected one x, y of shape (2,), got {point.shape}")
        pair = tuple(point.tolist())
    return pair


def plain_pair(values: Any) -> Pair | None:
    """Return two numbers as floats, or None if `values` needs a slower conversion."""
    kind = type(values)
    if kind is np.ndarray:
        if values.shape != (2,) or values.dtype.kind not in "fiu":
            return None
        x, y = values.tolist()
    elif (kind is tuple or kind is list) and len(values) == 2:
        x, y = values
    else:
        return None
    if type(x) is float and type(y) is float:
        return x, y
    return (float(x), float(y)) if _is_plain(x) and _is_plain(y) else None


def _is_plain(number: Any) -> bool:
    kind = type(number)
    return kind is float or kind is np.float64 or (kind is int and -_EXACT <= number <= _EXACT)


def as_number(value: object, name: str) -> float:
    try:
        return float(value)  # type: ignore[arg-type]
    except (OverflowError, TypeError, ValueError) as error:
        raise GeometryError(f"{name}: expected a number, got {short(value)}") from error


def as_finite(
    value: object,
    name: str,
    expected: str = "a finite number",
    *,
    least: float = -math.inf,
    above: float = -math.inf,
) -> float:
    """Return a finite number that is >= `least` and > `above`, or raise `GeometryError`."""
    number = as_number(value, name)
    if not (math.isfinite(number) and number >= least and number > above):
        limit = f" >= {least:g}" if math.isfinite(least) else ""
        raise GeometryError(f"{name}: expected {expected}{limit}, got {short(value)}")
    return number


def as_numbers(values: ArrayLike, name: str) -> NDArray[Any]:
    """Return an array of real numbers of any type; masked values become NaN."""
    if type(values) is np.ndarray and values.dtype.kind in "biuf":
        return values
    try:
        if isinstance(values, np.ma.MaskedArray):
            values = np.ma.filled(values.astype(np.float64), np.nan)
        numbers = np.asarray(values)
        # NumPy would convert None to NaN and drop the imaginary part of complex numbers.
        if numbers.dtype.kind not in "biuf" and numbers.size:
            raise TypeError(numbers.dtype)
    except (TypeError, ValueError) as error:
        raise GeometryError(f"{name}: expected numbers, got {short(values)}") from error
    return numbers


def as_array(values: ArrayLike, dtype: type[np.generic], name: str) -> NDArray[Any]:
    if type(values) is np.ndarray and values.dtype == dtype:
        return values
    # Values outside the float32 range become infinite, as with a cast in C++.
    with np.errstate(over="ignore"):
        return as_numbers(values, name).astype(dtype, copy=False)


def as_floats(values: ArrayLike, name: str) -> NDArray[Any]:
    """Return a float32 array if `values` is float32, else a float64 array."""
    numbers = as_numbers(values, name)
    return numbers if numbers.dtype == np.float32 else numbers.astype(np.float64, copy=False)


def as_points(points: ArrayLike, name: str = "points") -> NDArray[Any]:
    """Return points (N, 3) or wider as floats; masked values become NaN."""
    values = as_floats(points, name)
    if values.ndim != 2 or values.shape[1] < 3:
        raise GeometryError(f"{name}: expected x, y, z of shape (N, 3), got {values.shape}")
    if len(values) in (3, 4) and values.shape[1] > 16:  # no cloud has that many fields
        raise GeometryError(f"{name}: expected shape (N, 3), got {values.shape}. Transpose it")
    return values


def as_rigid(transform: ArrayLike) -> Positions:
    """Return a rigid transform as a (4, 4) matrix, or raise `GeometryError`."""
    matrix: Positions = as_array(transform, np.float64, "transform")
    if matrix.shape != (4, 4) or not np.isfinite(matrix).all():
        text = f"transform: expected (4, 4) finite numbers, got {short(transform)}"
        raise GeometryError(f"{text}. The matrix holds the rotation and the position")
    if not np.allclose(matrix[3], (0, 0, 0, 1), rtol=0, atol=1e-9):
        raise GeometryError(
            f"transform: expected (0, 0, 0, 1) as the last row, got {tuple(matrix[3].tolist())}"
        )
    rotation = matrix[:3, :3]
    error = np.abs(rotation.T @ rotation - np.eye(3)).max()
    if error > _ROTATION_TOLERANCE or np.linalg.det(rotation) < 0:
        raise GeometryError(
            f"transform: expected a rotation and a translation, but it scales, shears or mirrors: "
            f"{rotation.tolist()}"
        )
    return matrix


def as_size(values: ArrayLike, name: str) -> Size:
    size = plain_cell(values)
    if size is None:
        array = _as_integers(values, name)
        if array.shape != (2,):
            raise GeometryError(f"{name}: expected two integers, got {short(values)}")
        size = tuple(array.tolist())
    return size


def plain_cell(values: Any) -> Size | None:
    """Return two integers as `int`, or None if `values` needs a slower conversion."""
    kind = type(values)
    if kind is np.ndarray:
        if values.shape != (2,) or values.dtype.kind != "i":
            return None
        row, column = values.tolist()
        return row, column
    if (kind is tuple or kind is list) and len(values) == 2:
        row, column = values
        if type(row) is int and type(column) is int:
            inside = -_EXACT <= row <= _EXACT and -_EXACT <= column <= _EXACT
            return (row, column) if inside else None
        # Elements of an index array.
        if type(row) is np.int64 and type(column) is np.int64:
            return int(row), int(column)
    return None


def as_cells(values: ArrayLike, name: str = "index") -> Cells:
    """Return int64 (rows, cols) of one cell or several; `values` may be an (N, 2) array."""
    if isinstance(values, tuple):
        numbers = [_as_integers(value, name) for value in values]
        if len(numbers) != 2 or numbers[0].shape != numbers[1].shape:
            shapes = ", ".join(str(part.shape) for part in numbers)
            raise GeometryError(
                f"{name}: expected a tuple (rows, cols) of equal shapes, got shapes {shapes}"
            )
        return numbers[0], numbers[1]
    cells = _as_integers(values, name)
    if cells.ndim == 0 or cells.shape[-1] != 2:
        raise GeometryError(
            f"{name}: expected (rows, cols) or an array of shape (N, 2), got shape {cells.shape}"
        )
    return cells[..., 0], cells[..., 1]


def as_layer(value: ArrayLike, size: Size, name: str) -> Layer:
    """Return a new layer filled with a scalar or with an array (rows, cols)."""
    data = as_numbers(value, f"layer {name!r}")
    if data.ndim and data.shape != size:
        hint = ""
        if data.shape == size[::-1]:
            hint = ". Rows run along x: transpose an image-like array with values.T"
        raise GeometryError(f"layer {name!r}: expected shape {size}, got {data.shape}{hint}")
    layer: Layer = np.empty(size, dtype=np.float32, order="F")
    if data.dtype == np.float32:
        layer[...] = data
        return layer

    def warn(*_: object) -> None:
        text = f"layer {name!r}: values beyond float32 become infinite"
        warnings.warn(text, RuntimeWarning, stacklevel=4)

    with np.errstate(over="call", call=warn):
        layer[...] = data
    if max(abs(float(choose.reduce(data, None))) for choose in (np.fmin, np.fmax)) > _EXACT_FLOAT32:
        sizes = np.abs(layer)
        # Values from 2**53 on are skipped, because even float64 cannot hold every such integer.
        is_large = (sizes >= _EXACT_FLOAT32) & (sizes < _EXACT)
        # NumPy 1.26 would compare a 0-D array in float32.
        if (layer != np.atleast_1d(data))[is_large].any():
            text = f"layer {name!r}: values above 2**24 lose digits in float32"
            warnings.warn(f"{text}. Subtract a constant first", RuntimeWarning, stacklevel=3)
    return layer


def is_name(text: object) -> bool:
    """Return whether `text` can name a layer: not empty, and without control characters."""
    if not isinstance(text, str) or not text:
        return False
    return text.isprintable() or not _CONTROL.search(text)


def as_names(names: str | Iterable[str]) -> tuple[str, ...]:
    try:
        # Iterating over a string would yield its characters.
        return (names,) if isinstance(names, str) else tuple(names)
    except TypeError:
        raise GridMapError(f"layers: expected names of layers, got {short(names)}") from None


def select_layers(available: Iterable[str], layers: str | Iterable[str] | None) -> tuple[str, ...]:
    """Return layer names without duplicates; None selects all available layers."""
    if layers is None:
        return tuple(available)
    names = as_names(layers)
    known = available if isinstance(available, dict) else dict.fromkeys(available)
    for name in names:
        if not isinstance(name, str) or name not in known:
            raise LayerNotFoundError(name, known)
    return tuple(dict.fromkeys(names))


def as_text(values: ArrayLike) -> str:
    """Format two numbers with at most 12 significant digits each, for messages."""
    return str(tuple(float(f"{value:.12g}") for value in np.asarray(values, dtype=np.float64)))


def _as_integers(values: ArrayLike, name: str) -> Integers:
    integers = as_numbers(values, name)
    if integers.size and integers.dtype.kind not in "iu":
        raise GeometryError(f"{name}: expected integers, got {short(values)}")
    return integers.astype(np.int64, copy=False)
