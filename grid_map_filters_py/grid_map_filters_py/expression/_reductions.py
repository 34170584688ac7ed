# SPDX-License-Identifier: BSD-3-Clause
"""Reductions of whole layers, computed tile by tile.

A function of the language reduces by the primitive `fold`. On a tile it runs with `Partial`, which
keeps what the folds give; then once with `Combined`, whose folds combine the parts of all tiles.
"""

from collections.abc import Iterable, Sequence
from dataclasses import replace
from functools import reduce

from ._matrices import Fold, Matrices, Value


class Partial(Matrices):
    """The primitives on a tile; `parts` has the results of all folds."""

    def __init__(self) -> None:
        super().__init__()
        self.parts: list[float] = []

    def fold(self, value: Value, axis: int | None, *folds: Fold) -> list[Value]:
        # Without `whole`, which has NaN for tiles with nothing to reduce.
        parts = super().fold(value, axis, *(replace(fold, whole=None) for fold in folds))
        self.parts += parts
        return parts


class Combined(Matrices):
    """The primitives for values whose folds are known.

    Args:
        parts: what each fold gives in each tile, in the order of the folds.
    """

    def __init__(self, parts: Iterable[Sequence[float]]) -> None:
        super().__init__()
        self._parts = iter(parts)

    def fold(self, _value: Value, _axis: int | None, *folds: Fold) -> list[Value]:
        return [float(reduce(fold.combine, next(self._parts))) for fold in folds]
