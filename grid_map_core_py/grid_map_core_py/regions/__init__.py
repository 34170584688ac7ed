# SPDX-License-Identifier: BSD-3-Clause
"""Select the cells of a map in a shape, along a line or in a window.

- Shapes: `circle_cells`, `ellipse_cells`, `polygon_cells`, `spiral_cells`, `submap_cells`,
  `map_cells`.
- Lines: `line_cells`, `line_cells_between`.
- `cells_to_mask`: a mask of the cells that one of these functions returns.
- Windows around every cell: `sliding_windows`, `window_array`.
- `Polygon`: a polygon in the plane of the map.

The functions for shapes and lines return a tuple (rows, cols) that can index a layer. Cells outside
the map are omitted. The functions raise `GeometryError` for negative sizes and for numbers that are
not finite. They raise `OutOfMapError` for indices outside the map.
"""

from .. import _lazy
from ._polygon import Polygon as Polygon
from ._shapes import (
    cells_to_mask as cells_to_mask,
    circle_cells as circle_cells,
    ellipse_cells as ellipse_cells,
    line_cells as line_cells,
    line_cells_between as line_cells_between,
    map_cells as map_cells,
    polygon_cells as polygon_cells,
    submap_cells as submap_cells,
)
from ._sliding_window import sliding_windows as sliding_windows, window_array as window_array
from ._spiral import spiral_cells as spiral_cells

__all__, __dir__ = _lazy.public_names(dir())
