# SPDX-License-Identifier: BSD-3-Clause
"""Convert layers to and from images, packed colors, costmaps, point clouds and triangle meshes.

- Gray images: `to_image`, `from_image`, `add_layer_from_image`.
- Color images: `to_color_image`, `add_color_layer_from_image`.
- Change of the resolution of a map: `change_resolution`.
- Packed colors: `color_vector_to_value`, `color_value_to_vector`.
- Costmaps: `to_costs`, `from_costs`, `Costmap`. `CostTable` and `CostRange` define the costs.
- Point clouds: `from_points`, `rasterize`, `downsample`, `remove_outliers`, `PointCloudPipeline`.
- Triangle meshes: `from_mesh`, `rasterize_triangles`.
"""

from .. import _lazy
from ._costmap import (
    Costmap as Costmap,
    CostRange as CostRange,
    CostTable as CostTable,
    from_costs as from_costs,
    to_costs as to_costs,
)
from ._image_arrays import (
    add_color_layer_from_image as add_color_layer_from_image,
    add_layer_from_image as add_layer_from_image,
    change_resolution as change_resolution,
    from_image as from_image,
    to_color_image as to_color_image,
    to_image as to_image,
)
from ._mesh import from_mesh as from_mesh, rasterize_triangles as rasterize_triangles
from ._packed_colors import (
    color_value_to_vector as color_value_to_vector,
    color_vector_to_value as color_vector_to_value,
)
from ._point_cloud_pipeline import (
    PointCloudPipeline as PointCloudPipeline,
    downsample as downsample,
    remove_outliers as remove_outliers,
)
from ._point_layers import from_points as from_points, rasterize as rasterize

__all__, __dir__ = _lazy.public_names(dir())
