# SPDX-License-Identifier: BSD-3-Clause
"""Footprints of robots on a map.

- `Footprint`: the outline of a robot.
"""

from typing import TYPE_CHECKING

from .._lazy import lazy_names

if TYPE_CHECKING:
    from ._footprint import Footprint as Footprint

# Footprints need no SciPy.
__all__, __getattr__, __dir__ = lazy_names(__name__, {"._footprint": "Footprint"})
