# Copyright (c) 2026 grid_map_py contributors
# SPDX-License-Identifier: BSD-3-Clause
"""Meshes as binary glTF (GLB), which browsers load without parsing numbers.

Format: https://registry.khronos.org/glTF/specs/2.0/glTF-2.0.html
"""

import json
import struct
from typing import Any

import numpy as np
import numpy.typing as npt

from ..surface import Mesh
from .light import linear

FLOAT, UNSIGNED_INT, UNSIGNED_SHORT = 5126, 5125, 5123
"""Component types of glTF."""


def to_glb(mesh: Mesh, *, shaded: bool = True, opacity: float = 1.0) -> bytes:
    """Return a mesh as the content of a GLB file.

    Args:
        mesh: mesh with at least one face. Vertices are written relative to its origin.
        shaded: use the lights of the scene; otherwise colors are unlit.
        opacity: from 0 (invisible) to 1 (opaque).
    """
    lower, upper = (bound(mesh.vertices, axis=0).tolist() for bound in (np.min, np.max))
    # 16 bits distinguish dark colors. A fourth channel aligns vertices to four bytes.
    light = np.rint(0xFFFF * linear(np.arange(256, dtype=np.uint8))).astype("<u2")
    colors = np.insert(np.take(light, mesh.colors), 3, 0xFFFF, axis=1)
    arrays: list[tuple[npt.NDArray[Any], int, str, dict[str, Any]]] = [
        (mesh.vertices.astype("<f4", copy=False), FLOAT, "VEC3", {"min": lower, "max": upper}),
        (colors, UNSIGNED_SHORT, "VEC4", {"normalized": True}),
        (mesh.faces.astype("<u4", copy=False).reshape(-1), UNSIGNED_INT, "SCALAR", {}),
    ]
    blobs = [np.ascontiguousarray(values).tobytes() for values, *_ in arrays]
    ends = np.cumsum([len(blob) for blob in blobs]).tolist()
    surface = {"baseColorFactor": [1, 1, 1, opacity], "metallicFactor": 0, "roughnessFactor": 1}
    material: dict[str, Any] = {"pbrMetallicRoughness": surface, "doubleSided": True}
    primitive = {"attributes": {"POSITION": 0, "COLOR_0": 1}, "indices": 2, "material": 0}
    document = {
        "asset": {"version": "2.0"},
        "scene": 0,
        "scenes": [{"nodes": [0]}],
        "nodes": [{"mesh": 0}],
        "materials": [material],
        "meshes": [{"primitives": [primitive]}],
        "buffers": [{"byteLength": ends[-1]}],
        "bufferViews": [
            {"buffer": 0, "byteOffset": end - len(blob), "byteLength": len(blob)}
            for blob, end in zip(blobs, ends, strict=True)
        ],
        "accessors": [
            {"bufferView": k, "componentType": number, "count": len(values), "type": kind, **more}
            for k, (values, number, kind, more) in enumerate(arrays)
        ],
    }
    if opacity < 1:
        material["alphaMode"] = "BLEND"
    if not shaded:
        material["extensions"] = {"KHR_materials_unlit": {}}
        document["extensionsUsed"] = ["KHR_materials_unlit"]
    text = json.dumps(document).encode()
    text += b" " * (-len(text) % 4)
    chunks = struct.pack("<I4s", len(text), b"JSON"), text, struct.pack("<I4s", ends[-1], b"BIN\0")
    size = 12 + sum(map(len, chunks)) + ends[-1]
    return b"".join([struct.pack("<4sII", b"glTF", 2, size), *chunks, *blobs])
