# SPDX-License-Identifier: BSD-3-Clause
"""Multi-layer grid maps in NumPy, without ROS.

- `GridMap`: named float32 layers on a grid. The grid can move with a robot without copying data.
  Related classes: `GridGeometry`, `Interpolation`, `BufferRegion`, `SignedDistanceField`.
- Regions: `circle_cells` and similar functions return the cells in a shape as (rows, cols), which
  index a layer. See also `cells_to_mask`, `sliding_windows`, `window_array` and `Polygon`.
- Conversions: `to_image`, `from_image`, `change_resolution`, `from_points`, `from_mesh`.
- Packed colors: `color_vector_to_value` and `color_value_to_vector`.
- Files: `load` and `save` choose the format from the file name.
- Statistics of finite values: `mean_of_finites` and similar functions.
- Errors: all derive from `GridMapError`.

The modules `map`, `regions`, `conversions`, `files`, `elevation`, `planning`, `planes`,
`simulation`, `tiled`, `plugins`, `limits`, `errors` and `testing` contain further names. All names
are imported on first use.
"""

from typing import TYPE_CHECKING

from ._lazy import lazy_names

if TYPE_CHECKING:
    from ._arrays import (
        max_of_finites as max_of_finites,
        mean_of_finites as mean_of_finites,
        min_of_finites as min_of_finites,
        number_of_finites as number_of_finites,
        sum_of_finites as sum_of_finites,
    )
    from .conversions import (
        change_resolution as change_resolution,
        color_value_to_vector as color_value_to_vector,
        color_vector_to_value as color_vector_to_value,
        from_image as from_image,
        from_mesh as from_mesh,
        from_points as from_points,
        to_image as to_image,
    )
    from .errors import (
        ConfigError as ConfigError,
        GeometryError as GeometryError,
        GridMapError as GridMapError,
        LayerNotFoundError as LayerNotFoundError,
        LimitError as LimitError,
        MissingPackageError as MissingPackageError,
        OutOfMapError as OutOfMapError,
    )
    from .files import load as load, save as save
    from .map import (
        BufferRegion as BufferRegion,
        GridGeometry as GridGeometry,
        GridMap as GridMap,
        Interpolation as Interpolation,
        SignedDistanceField as SignedDistanceField,
    )
    from .regions import (
        Polygon as Polygon,
        cells_to_mask as cells_to_mask,
        circle_cells as circle_cells,
        ellipse_cells as ellipse_cells,
        line_cells as line_cells,
        line_cells_between as line_cells_between,
        map_cells as map_cells,
        polygon_cells as polygon_cells,
        sliding_windows as sliding_windows,
        spiral_cells as spiral_cells,
        submap_cells as submap_cells,
        window_array as window_array,
    )

_OFFERED = {
    "._arrays": "max_of_finites mean_of_finites min_of_finites number_of_finites sum_of_finites",
    ".conversions": "change_resolution color_value_to_vector color_vector_to_value from_image "
    "from_mesh from_points to_image",
    ".errors": "ConfigError GeometryError GridMapError LayerNotFoundError LimitError "
    "MissingPackageError OutOfMapError",
    ".files": "load save",
    ".map": "BufferRegion GridGeometry GridMap Interpolation SignedDistanceField",
    ".regions": "Polygon cells_to_mask circle_cells ellipse_cells line_cells line_cells_between "
    "map_cells polygon_cells sliding_windows spiral_cells submap_cells window_array",
} | dict.fromkeys(
    (".elevation", ".limits", ".planes", ".planning", ".plugins", ".simulation", ".testing"), ""
)
# `grid-map --help` starts quickly, because it does not import NumPy, SciPy and OpenCV.
__all__, __getattr__, __dir__ = lazy_names(__name__, _OFFERED)
