# Copyright (c) 2026 grid_map_py contributors
# SPDX-License-Identifier: BSD-3-Clause
"""Names of layers that users give."""

from collections.abc import Iterable

from ..errors import GridMapError, LayerNotFoundError


def as_names(names: str | Iterable[str]) -> tuple[str, ...]:
    """Return names as a tuple; a single one may be given as a string."""
    try:
        # A string would be iterated letter by letter.
        return (names,) if isinstance(names, str) else tuple(names)
    except TypeError:
        raise GridMapError(f"layers: expected names of layers, got {names!r}") from None


def select_layers(available: Iterable[str], layers: str | Iterable[str] | None) -> tuple[str, ...]:
    """Return the names in `layers`, each once, or all that are available for None.

    Raises:
        LayerNotFoundError: a name is not available.
        GridMapError: `layers` is neither a name nor a sequence of names.
    """
    known = tuple(available)
    if layers is None:
        return known
    names = as_names(layers)
    for name in names:
        if name not in known:
            raise LayerNotFoundError(name, known)
    return tuple(dict.fromkeys(names))
