# SPDX-License-Identifier: BSD-3-Clause
"""Point clouds of any layout, packed number by number."""

import array
import struct
from collections.abc import Mapping, Sequence

from sensor_msgs.msg import PointCloud2, PointField

CODES = {1: "b", 2: "B", 3: "h", 4: "H", 5: "i", 6: "I", 7: "f", 8: "d"}
"""The letters by which `struct` knows the datatypes."""

FLOAT32, FLOAT64, UINT8, UINT32 = 7, 8, 2, 6
Field = tuple[str, int, int, int]
"""Name, offset, datatype, count."""


def xyz_fields(datatype: int = FLOAT32) -> list[Field]:
    size = struct.calcsize(CODES[datatype])
    return [(name, k * size, datatype, 1) for k, name in enumerate("xyz")]


def packed_cloud(
    points: Sequence[Mapping[str, object]],
    fields: Sequence[Field],
    *,
    point_step: int | None = None,
    height: int = 1,
    row_padding: int = 0,
    frame_id: str = "map",
) -> PointCloud2:
    """Return the points, each a number (or a list) per field, as a cloud of `height` rows."""
    ends = (offset + max(n, 1) * struct.calcsize(CODES[kind]) for _, offset, kind, n in fields)
    step = point_step or max(ends)
    width = len(points) // height
    data = bytearray(b"\xff" * ((width * step + row_padding) * height))
    for number, point in enumerate(points):
        row, column = divmod(number, width)
        start = row * (width * step + row_padding) + column * step
        for name, offset, datatype, count in fields:
            values = point[name] if count > 1 else [point[name]]
            struct.pack_into(f"<{max(count, 1)}{CODES[datatype]}", data, start + offset, *values)
    cloud = PointCloud2(
        height=height,
        width=width,
        fields=[PointField(name=n, offset=o, datatype=d, count=c) for n, o, d, c in fields],
        point_step=step,
        row_step=width * step + row_padding,
        data=array.array("B", data),
    )
    cloud.header.frame_id = frame_id
    cloud.header.stamp.sec = 7
    return cloud


def xyz_cloud(points: Sequence[Sequence[float]], frame_id: str = "map") -> PointCloud2:
    """Return (x, y, z) points as an unpadded float32 cloud."""
    named = [dict(zip("xyz", point, strict=True)) for point in points]
    return packed_cloud(named, xyz_fields(), frame_id=frame_id)
