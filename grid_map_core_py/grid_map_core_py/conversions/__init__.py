# Copyright (c) 2026 grid_map_py contributors
# SPDX-License-Identifier: BSD-3-Clause
"""Layers from and to images, colors, costmaps, point clouds and triangle meshes.

- Images: `to_image`, `from_image`, `add_layer_from_image`, with colors `to_color_image`,
  `add_color_layer_from_image`; `change_resolution`; the types `Image` and `Order`.
- Colors as layer values: `color_vector_to_value`, `color_value_to_vector`,
  `color_channels_to_value`, `color_value_to_bytes`; their bits: `join_channels`, `split_channels`,
  `NO_COLOR`; names of layers and fields with colors: `COLOR_LAYER`, `COLOR_FIELDS`.
- Costmaps: `to_costmap`, `from_costmap`, `Costmap`. A `CostCodec` turns values into costs: a
  `CostTable`, such as `CENTURY` and `DIRECT`, or a `CostRange`; costs are `FREE` to `LETHAL`.
- Point clouds: `from_points`, `rasterize`, `downsample`, `remove_outliers`, `fitting_geometry`;
  `PointCloudPipeline` with its parameters `CloudTransform`, `OutlierRemoval`, `Downsampling`,
  `ClusterExtraction` and `Grid`.
- Triangle meshes: `from_mesh`, `rasterize_triangles`.
"""

from ._costmap import (
    CENTURY,
    DIRECT,
    FREE,
    LETHAL,
    CostCodec,
    Costmap,
    CostRange,
    CostTable,
    from_costmap,
    to_costmap,
)
from ._image_arrays import (
    COLOR_LAYER,
    Image,
    Order,
    add_color_layer_from_image,
    add_layer_from_image,
    change_resolution,
    from_image,
    to_color_image,
    to_image,
)
from ._mesh import from_mesh, rasterize_triangles
from ._packed_colors import (
    NO_COLOR,
    color_channels_to_value,
    color_value_to_bytes,
    color_value_to_vector,
    color_vector_to_value,
    join_channels,
    split_channels,
)
from ._point_cloud_pipeline import (
    CloudTransform,
    ClusterExtraction,
    Downsampling,
    Grid,
    OutlierRemoval,
    PointCloudPipeline,
    downsample,
    remove_outliers,
)
from ._point_layers import COLOR_FIELDS, fitting_geometry, from_points, rasterize

__all__ = [
    "CENTURY",
    "COLOR_FIELDS",
    "COLOR_LAYER",
    "DIRECT",
    "FREE",
    "LETHAL",
    "NO_COLOR",
    "CloudTransform",
    "ClusterExtraction",
    "CostCodec",
    "CostRange",
    "CostTable",
    "Costmap",
    "Downsampling",
    "Grid",
    "Image",
    "Order",
    "OutlierRemoval",
    "PointCloudPipeline",
    "add_color_layer_from_image",
    "add_layer_from_image",
    "change_resolution",
    "color_channels_to_value",
    "color_value_to_bytes",
    "color_value_to_vector",
    "color_vector_to_value",
    "downsample",
    "fitting_geometry",
    "from_costmap",
    "from_image",
    "from_mesh",
    "from_points",
    "join_channels",
    "rasterize",
    "rasterize_triangles",
    "remove_outliers",
    "split_channels",
    "to_color_image",
    "to_costmap",
    "to_image",
]
